"""One writer: blocks of text, pictures and tables, as Markdown; and records in JSON."""

import json
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.figure import Figure

from repro.results import write_text
from repro.results.files import atomic_path

ROOT = Path(__file__).parents[2]
REPORT = ROOT / "verification" / "report"
Row = tuple[str, ...]


def link(text: str, page: str, place: str = "") -> str:
    """A cell of Markdown that leads to a place on a page of the report: page "flow", place "flow-plug"; or to another
    file: page "../../docs/network.md"."""
    file = page if page.endswith(".md") else f"{page}.md"
    return f"[{text}]({file}{'#' * bool(place)}{place})"


@dataclass(frozen=True)
class Block:
    """A piece of a text: a heading, a paragraph, a picture (file and what it shows), or a table (head and rows)."""

    kind: str
    text: str = ""
    rows: tuple[Row, ...] = ()


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> Block:
    """A table of a head and rows."""
    return Block("table", rows=(tuple(head), *map(tuple, rows)))


def markdown(blocks: Iterable[Block], level: int = 3, pictures: str = "verification/report") -> str:
    """Headings of a level; pictures: where they are from there."""
    return "\n\n".join(_markdown(block, level, pictures) for block in blocks)


def _markdown(block: Block, level: int, pictures: str) -> str:
    if block.kind == "heading":
        return f"{'#' * level} {block.text}"
    if block.kind == "picture":
        name, _, caption = block.text.partition(": ")
        return f"![{caption}]({pictures}/{name})"
    if block.kind != "table":
        return block.text
    head, *rows = block.rows
    return "\n".join(map(markdown_row, (head, ("---",) * len(head), *rows)))


def markdown_row(row: Row) -> str:
    """A row of a table."""
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |"


def load(file: Path, empty: Any = None) -> Any:
    """Read a record; ``empty`` if there is no file."""
    return json.loads(file.read_text(encoding="utf-8")) if file.exists() else empty


def save(record: Any, file: Path) -> None:
    """Write a record completely or not at all. Raises ValueError if it contains not-a-number."""
    text = json.dumps(record, indent=1, allow_nan=False)
    file.parent.mkdir(parents=True, exist_ok=True)
    with atomic_path(file) as beside:
        write_text(beside, text + "\n")


def saved_figure(figure: Figure, target: Path) -> None:
    """Save a figure as SVG. The same data give the same bytes."""
    with matplotlib.rc_context({"svg.hashsalt": "verification", "svg.fonttype": "none"}):
        figure.savefig(target, format="svg", metadata={"Date": None, "Creator": None})


def lines(file: Path) -> list[dict]:
    """The complete rows of a file; rows that were cut off are skipped."""
    rows = []
    for line in file.read_text(encoding="utf-8").splitlines() if file.exists() else []:
        with suppress(json.JSONDecodeError):
            rows.append(json.loads(line))
    return rows


def append(row: dict, file: Path) -> None:
    """Append a row to a file. Each row begins with its line break, so that an interruption loses at most one row."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("a", encoding="utf-8") as opened:
        opened.write("\n" + json.dumps(row))
