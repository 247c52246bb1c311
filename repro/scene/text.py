"""A scene as TOML text with every possible key: value, default, unit, range and source.

Keys that the scene sets are active. Keys that it leaves to the defaults follow a "#" without a
space, so that they still change with the preset. All words come from the fields of
:mod:`repro.scene`.
"""

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import MISSING, Field
from pathlib import Path

from repro.scene import (
    NOT_IN_PAPER,
    PRESETS,
    Numerics,
    Scene,
    load_tables,
    packaged_scenes,
    parse_scene,
)
from repro.scene.files import key_of, read_text
from repro.scene.reading import entries, toml_value
from repro.scene.units import Choice, Flag, Number


def scene_text(source: str, overrides: Sequence[str] = (), unset: Sequence[str] = ()) -> str:
    """The TOML text of a packaged scene or of a file, with the changes of --set and --unset.

    The text parses to an equal scene. Raises SceneError like load_scene.
    """
    tables = load_tables(source, overrides, unset)
    changed = [key_of(entry) for entry in overrides]
    scene = parse_scene(tables, Path(source).stem, source, changed)
    name = "".join(letter if letter.isprintable() and letter.isascii() else "?"
                   for letter in scene.name)
    lines = [*_comment(
        f"Scene {name}. A \"#\" without a space is before what this scene leaves out, or leaves to "
        "the default shown: remove it to set the key. \"Paper\" is Dupin, Kitanidis & McCarty "
        "(2001), by section, equation or table; [En] are its ambiguities, reference/ERRATA.md.")]
    for key, entry in entries(Scene).items():
        written = tables.get(key, {})
        part = getattr(scene, entry.name)
        several = isinstance(written, list)
        each = zip(written, part) if several else [(written, only(part))]
        for table, each_part in each:
            lines += _table(key, entry, table, each_part, several)
    return "\n".join(lines) + "\n"


def titles() -> dict[str, str]:
    """The title of each packaged scene: its first line."""
    return {name: read_text(name).partition("\n")[0].removeprefix("# ")
            for name in packaged_scenes()}


def only(part: object) -> object:
    """A section of a scene; the only one, or None, of a section that a scene may have more than
    once."""
    return (part[0] if part else None) if isinstance(part, tuple) else part


def _about(field: Field) -> str:
    source = field.metadata["source"]
    return f"{field.metadata['about']}. {source if source == NOT_IN_PAPER else f'Paper: {source}'}."


def _table(path: str, entry: Field, written: dict, part: object,
           several: bool = False) -> Iterator[str]:
    """Lines of a section.

    written: keys that the scene sets; part: the section of the scene, None if it is left out;
    several: is the section one of a list?
    """
    kind = entry.metadata["section"]
    yield ""
    yield from _comment(_about(entry))
    head = f"[[{path}]]" if several else f"[{path}]"
    yield head if part else f"#{head}"
    inner = {key: field for key, field in entries(kind).items() if "section" in field.metadata}
    for key, field in entries(kind).items():
        if key not in inner:
            yield from _comment(_about(field))
            yield from _comment(f"{field.metadata['kind'].accepted}; {stated(kind, key, field)}")
            value = written[key] if key in written else _default(field, getattr(part, key, None))
            yield f"{'' if key in written else '#'}{key} = {toml_value(value)}"
    for key, field in inner.items():
        yield from _table(f"{path}.{key}", field, written.get(key, {}), getattr(part, key, None))


def stated(kind: type, key: str, field: Field) -> str:
    """The value of a key that a scene does not set, in words."""
    if field.metadata["stated"]:
        return field.metadata["stated"]
    if field.default is MISSING and field.default_factory is MISSING:
        return "must be given"
    if field.default is None:
        return "not set by default"
    preset_default = _default(field, None)
    presets = PRESETS.values() if kind is Numerics else []
    values = [preset.get(key, preset_default) for preset in presets]
    if set(values) <= {preset_default}:
        return f"default {toml_value(preset_default)}"
    defaults = [f"{toml_value(value)} ({preset})" for preset, value in zip(PRESETS, values)]
    return "default " + ", ".join(defaults)


def _default(field: Field, value: object) -> object:
    """Value to show for a key that the scene does not set.

    It is the value of the preset, else the default, else an example.
    """
    kind = field.metadata["kind"]
    if isinstance(kind, Choice | Flag | Number):
        value = field.default if value is None else value
        return kind.example if value is None and isinstance(kind, Number) else value
    return kind.example


def _comment(text: str) -> Iterator[str]:
    yield from textwrap.wrap(text, 100, initial_indent="# ", subsequent_indent="# ",
                             break_on_hyphens=False)
