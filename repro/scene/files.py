"""Read the tables of a scene from a file or a packaged scene, and apply --set and --unset."""
import os
import re
import tomllib
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from importlib import resources
from pathlib import Path
from typing import Any

from repro.errors import shortened
from repro.scene import bodies
from repro.scene.reading import Place, did_you_mean, elsewhere, quote
from repro.scene.units import SceneError, nearest, odd_character

#: Largest size of a file (bytes). The longest accepted outline and tables take 245 000 bytes;
#: tomllib needs up to 400 times as much memory.
LARGEST = 300_000
MOST_PARTS = 8  # of a dotted key; tomllib's memory grows with their square
#: Tokens of TOML, without backtracking: possible parts of a key, dots, and the rest.
TOKEN = re.compile(
    r'''(?P<blank>[ \t]++)|(?P<dot>\.)|(?P<comment>\#[^\n]*+)
    |"""(?:[^"\\]|\\.|"(?!""))*+(?:"{3,5})?|'{3}(?:[^']|'(?!''))*+(?:'{3,5})?
    |(?P<part>[A-Za-z0-9_-]++|"(?:[^"\\\n]|\\.)*+"?|'[^'\n]*+'?)
    |.''', re.S | re.X)


#: The packaged scenes.
PACKAGED = resources.files("repro.scene").joinpath("packaged")


def packaged_scenes() -> tuple[str, ...]:
    """Names of the packaged scenes."""
    names = [path.name for path in PACKAGED.iterdir()]
    return tuple(sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml")))


def read_text(file: str) -> str:
    """Read the text of a packaged scene or of a file; SceneError if it cannot be read."""
    content = _content(file)
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        encoding = "UTF-16" if content[:2] in (BOM_UTF16_LE, BOM_UTF16_BE) else "WINDOWS-1252"
        raise SceneError(f"{file}: not UTF-8 text (at byte {error.start + 1}); "
                         "a scene is a TOML file, saved with the encoding UTF-8 of the editor, or "
                         f"converted by: iconv -f {encoding} -t UTF-8") from None


def _content(file: str) -> bytes:
    names = packaged_scenes()
    if file in names:
        return PACKAGED.joinpath(f"{file}.toml").read_bytes()
    if not os.path.isfile(file):
        reason = "a directory, not" if os.path.isdir(file) else "neither a file nor"
        hint = did_you_mean(nearest(file, names))
        raise SceneError(f"{file}: {reason} a packaged scene ({', '.join(names)}){hint}")
    try:
        with Path(file).open("rb") as opened:
            content = opened.read(LARGEST + 1)
    except OSError as error:
        raise SceneError(f"{file}: cannot be read ({error.strerror})") from None
    if len(content) > LARGEST:
        raise SceneError(f"{file}: more than {LARGEST} bytes; a scene has a few thousand, one "
                         "with long tables up to 250 000")
    return content


def read_tables(file: str) -> dict:
    """Read the tables of a packaged scene or of a file; SceneError if it is not TOML.

    Files of outlines are beside the file of the scene.
    """
    text = read_text(file)
    deep = line_of_a_deep_key(text)
    if deep:
        raise SceneError(f"{file}: a key of more than {MOST_PARTS} parts (at line {deep}); "
                         "one of a scene has at most 3, such as substrates.donor.supply")
    try:
        tables = tomllib.loads(text)
    except RecursionError:
        raise SceneError(f"{file}: not TOML: values nested too deeply; "
                         "a scene has tables of plain values") from None
    except ValueError as error:
        raise SceneError(f"{file}: not TOML: {error}{_line_of(text, str(error))}") from None
    part = tables.get(bodies.SECTION)
    for seed in part if isinstance(part, list) else [part]:
        drawn = seed.get("outline") if isinstance(seed, dict) else None
        if isinstance(drawn, dict) and isinstance(drawn.get("file"), str):
            drawn["file"] = str(Path(file).parent / drawn["file"])
    return tables


def line_of_a_deep_key(text: str) -> int:
    """Number of the first line with a key of more than MOST_PARTS parts; 0 without one."""
    dots = 0
    for token in TOKEN.finditer(text):
        kind = token.lastgroup
        dots += kind == "dot"
        if dots >= MOST_PARTS:
            return text.count("\n", 0, token.start()) + 1
        if kind not in ("part", "dot", "blank"):
            dots = 0
    return 0


def _line_of(text: str, message: str) -> str:
    """The line that the parser's message names, with a hint; empty without a line."""
    lines = text.replace("\r\n", "\n").split("\n")
    named = re.search(r"\(at line (\d+), column (\d+)", message)
    if named is None:
        return ""
    line = lines[int(named[1]) - 1]
    letter = line[int(named[2]) - 1:][:1]
    line = line.strip()
    quotes = '; a value with a unit stands in quotes, such as width = "50 um"'
    path = "; a path has / or stands in single quotes, such as file = 'C:\\images\\colony.png'"
    has_unit = re.search(r"=\s*[-+.\d][-+.\deE]*\s*[A-Za-z\u00b5\u03bc]", line)
    hint = quotes if has_unit else path if "\\" in line else ""
    hint = hint if letter.isascii() else f"; {odd_character(letter)}"
    return f": {shortened(line, 80)}{hint}"


def key_of(entry: str) -> str:
    """The dotted key of a "KEY=VALUE"."""
    return ".".join(part.strip() for part in entry.partition("=")[0].split("."))


def leave_out(tables: dict, key: str, file: str, known: tuple[str, ...]) -> None:
    """Remove a dotted key or a section from the tables. Raises SceneError if it is absent.

    One of several aggregates becomes None, so that the others keep their numbers.
    """
    bodies.refuse_unaddressed(tables, key_of(key), f"{file}: --unset {quote(key)}", known)
    *above, last = bodies.path_of(tables, key_of(key))
    table: Any = tables
    for part in above:
        table = table[part] if isinstance(part, int) else \
            table.get(part) if isinstance(table, dict) else None
    if not (table[last] if isinstance(last, int) else isinstance(table, dict) and last in table):
        hint = did_you_mean("" if key_of(key) in known else elsewhere(key_of(key)[:60], known))
        raise SceneError(f"{file}: --unset {quote(key)}: the scene does not set it{hint}")
    if isinstance(last, int):
        table[last] = None
    else:
        del table[last]


def override(tables: dict, entry: str, file: str, known: tuple[str, ...]) -> None:
    """Set one "KEY=VALUE" in the tables; known: all dotted keys."""
    equals, text = entry.partition("=")[1:]
    path = key_of(entry).split(".")
    if not equals or not all(path):
        typed = ".".join(part for part in path if part)[:60]
        near = elsewhere(typed, known)
        hint = did_you_mean("" if near == typed else near)
        raise SceneError(f"{file}: --set {quote(entry)}: KEY=VALUE is needed, such as "
                         f'pore.width="50 um"{hint}')
    if len(path) > MOST_PARTS:
        raise SceneError(f"{file}: --set {quote(entry)}: a key of at most {MOST_PARTS} parts "
                         "is needed")
    bodies.refuse_unaddressed(tables, key_of(entry), f"{file}: --set {quote(entry)}", known)
    place = Place(file)
    path = bodies.path_of(tables, key_of(entry))
    for part, following in zip(path, path[1:]):
        tables = tables[part] if isinstance(part, int) else tables.setdefault(part, {})
        place = place.below(str(part))
        if not isinstance(tables, list if isinstance(following, int) else dict):
            hint = did_you_mean(place.key if place.key in known else "")
            requirement = f"it takes no keys, so that --set {quote(entry)} is not accepted{hint}"
            raise place.refuse(tables, requirement)
    tables[path[-1]] = _toml_value(text.strip())


def _toml_value(text: str) -> object:
    """Parse a text as a TOML value; if that fails, return the text."""
    if line_of_a_deep_key(text):
        return text
    try:
        read = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text
    return read["value"] if list(read) == ["value"] else text
