"""A scene written out with every key that it could have: value, default, unit, range and source.

What the scene says is active. What it leaves to the defaults is there too, behind a "#" without a
space: changing the preset goes on changing what hangs on it. All words come from the fields of
:mod:`repro.scene`.
"""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import MISSING, Field
from pathlib import Path

from repro.scene import OURS, PRESETS, Numerics, Scene, load_tables, packaged_scenes, parse_scene
from repro.scene.files import key_of, read_text
from repro.scene.reading import entries
from repro.scene.units import Choice, Flag, Number

WIDTH = 100
HEAD = ("A \"#\" without a space is before what this scene leaves out, or leaves to the default "
        "shown: remove it to set the key. \"Paper\" is Dupin, Kitanidis & McCarty (2001), by "
        "section, equation or table; [En] are its ambiguities, reference/ERRATA.md.")


def scene_text(source: str, overrides: Sequence[str] = (), unset: Sequence[str] = ()) -> str:
    """The TOML text of a packaged scene or of a file, with what --set and --unset change.

    It parses to an equal scene. Raises SceneError as load_scene.
    """
    tables = load_tables(source, overrides, unset)
    changed = [key_of(entry) for entry in overrides]
    scene = parse_scene(tables, Path(source).stem, source, changed)
    name = "".join(one if one.isprintable() and one.isascii() else "?" for one in scene.name)
    lines = [*_comment(f"Scene {name}. {HEAD}")]
    for key, entry in entries(Scene).items():
        lines += _table(key, entry, tables.get(key, {}), getattr(scene, key))
    return "\n".join(lines) + "\n"


def titles() -> dict[str, str]:
    """The first line of each packaged scene, which says what it is."""
    first = {name: read_text(name).partition("\n")[0] for name in packaged_scenes()}
    return {name: line.removeprefix("# ") for name, line in first.items()}


def _table(path: str, entry: Field, said: dict, made: object) -> Iterator[str]:
    """The lines of a section.

    said: what the scene writes in it; made: what it reads as, None where it is left out.
    """
    kind = entry.metadata["section"]
    yield ""
    yield from _comment(_about(entry))
    yield f"[{path}]" if made else f"#[{path}]"
    inner = {key: field for key, field in entries(kind).items() if "section" in field.metadata}
    for key, field in entries(kind).items():
        if key not in inner:
            yield from _comment(_about(field))
            yield from _comment(f"{field.metadata['kind'].accepted}; {_stated(kind, key, field)}")
            value = said[key] if key in said else _default(field, getattr(made, key, None))
            yield f"{'' if key in said else '#'}{key} = {_toml(value)}"
    for key, field in inner.items():
        yield from _table(f"{path}.{key}", field, said.get(key, {}), getattr(made, key, None))


def _about(field: Field) -> str:
    source = field.metadata["source"]
    return f"{field.metadata['about']}. {source if source == OURS else f'Paper: {source}'}."


def _stated(kind: type, key: str, field: Field) -> str:
    """What holds where a scene does not say."""
    if field.metadata["stated"]:
        return field.metadata["stated"]
    if field.default is MISSING and field.default_factory is MISSING:
        return "must be given"
    if field.default is None:
        return "not set by default"
    own = _default(field, None)
    values = [preset.get(key, own) for preset in PRESETS.values()] if kind is Numerics else []
    if set(values) <= {own}:
        return f"default {_toml(own)}"
    told = [f"{_toml(value)} ({preset})" for preset, value in zip(PRESETS, values)]
    return "default " + ", ".join(told)


def _default(field: Field, made: object) -> object:
    """The value to show where the scene writes none.

    It is what a preset has made of it, else the default or an example.
    """
    kind = field.metadata["kind"]
    if isinstance(kind, Choice | Flag | Number):
        made = field.default if made is None else made
        return kind.example if made is None and isinstance(kind, Number) else made
    return kind.example


def _comment(text: str) -> Iterator[str]:
    yield from textwrap.wrap(text, WIDTH, initial_indent="# ", subsequent_indent="# ",
                             break_on_hyphens=False)


def _toml(value: object) -> str:
    """A number, a text or a list of texts, as TOML writes them, in ASCII."""
    return json.dumps(value)
