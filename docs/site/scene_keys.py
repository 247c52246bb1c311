"""The tables of the page of scene keys: a table a section, from the fields that define the keys."""

from collections.abc import Iterator
from dataclasses import Field

from repro.scene import Scene
from repro.scene.reading import entries
from repro.scene.text import stated
from repro.scene.units import Quantity

PAGE = "docs/reference/keys"
PLACE = "<!-- tables of keys -->"
HEAD = "| key | meaning | unit | accepted | default | source |\n|---|---|---|---|---|---|\n"


def tables(path: str, entry: Field) -> Iterator[str]:
    """Yield the heading and the table of a section, and of the sections within it."""
    kind = entry.metadata["section"]
    fields = entries(kind)
    rows = [row(path, key, kind, field) for key, field in fields.items() if "section" not in field.metadata]
    yield f"## `[{path}]`\n\n{entry.metadata['about']}. Source: {entry.metadata['source']}."
    if rows:
        yield HEAD + "\n".join(rows)
    for key, field in fields.items():
        if "section" in field.metadata:
            yield from tables(f"{path}.{key}", field)


def row(path: str, key: str, kind: type, field: Field) -> str:
    """Return the row of a key, whose anchor is its path."""
    values = field.metadata["kind"]
    unit = values.usual_unit if isinstance(values, Quantity) else ""
    default = stated(kind, key, field).removeprefix("default ")
    cells = (f'<a id="{path}.{key}"></a>`{key}`', field.metadata["about"], unit, values.accepted, default,
             field.metadata["source"])
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def render() -> str:
    """Return the tables of all sections as Markdown."""
    return "\n\n".join(block for key, entry in entries(Scene).items() for block in tables(key, entry))


def render_keys(app, docname: str, source: list[str]) -> None:
    """Put the tables in their place while Sphinx reads the page."""
    if docname == PAGE:
        source[0] = source[0].replace(PLACE, render())


def setup(app) -> dict:
    """Register the transformation."""
    app.connect("source-read", render_keys)
    return {"parallel_read_safe": True}
