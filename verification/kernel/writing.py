"""One writer: blocks of text, pictures and tables, as Markdown, as pages and for a terminal; and records in JSON."""

from __future__ import annotations

import html
import json
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from repro.results import write_text
from repro.results.files import whole

STYLE = """body {font: 15px/1.5 sans-serif; max-width: 1200px; margin: 2em auto; padding: 0 1em; color: #222}
table {border-collapse: collapse; font-size: 13px; margin: 1em 0} .no {background: #fbe3e0} img {max-width: 100%}
td, th {border-bottom: 1px solid #ddd; padding: 3px 8px; text-align: left; vertical-align: top} pre {color: #a00}"""
#: Cells that make a row of a page red.
BAD = {"wrong", "does not hold", "FALLS SHORT", "NO", "not caught"}


@dataclass(frozen=True)
class Link:
    """A cell that leads to a place on a page: page "flow", place "flow-plug" or ""; or to a file that is there in
    Markdown alone: page "../../docs/network.md"."""

    text: str
    page: str
    place: str = ""

    def to(self, ending: str) -> str:
        """The address, with the ending of the pages' files."""
        name = self.page if self.page.endswith(".md") else f"{self.page}.{ending}"
        return name + (f"#{self.place}" if self.place else "")


Cell = str | Link
Row = tuple[Cell, ...]


@dataclass(frozen=True)
class Block:
    """A piece of a text: a heading, a paragraph, a picture (file and what it shows), an error, or a table (head and
    rows); ``detail``: on pages alone; ``brief``: in Markdown alone."""

    kind: str
    text: str = ""
    rows: tuple[Row, ...] = ()
    detail: bool = False
    brief: bool = False


def table(head: Iterable[Cell], rows: Iterable[Iterable[Cell]], **where: bool) -> Block:
    """A table of a head and rows; where: detail or brief, as of a Block."""
    return Block("table", rows=(tuple(head), *map(tuple, rows)), **where)


def markdown(blocks: Iterable[Block], level: int = 3, pictures: str = "verification/report") -> str:
    """What is no detail; headings of a level; pictures: where they are from there."""
    return "\n\n".join(_markdown(block, level, pictures) for block in blocks if not block.detail)


def _markdown(block: Block, level: int, pictures: str) -> str:
    if block.kind == "heading":
        return f"{'#' * level} {block.text}"
    if block.kind == "picture":
        name, _, shown = block.text.partition(": ")
        return f"![{shown}]({pictures}/{name})"
    if block.kind != "table":
        return block.text
    head, *rows = block.rows
    return "\n".join(map(markdown_row, (head, ("---",) * len(head), *rows)))


def markdown_row(row: Row) -> str:
    """A row of a table."""
    return "| " + " | ".join(map(_markdown_cell, row)) + " |"


def _markdown_cell(cell: Cell) -> str:
    if isinstance(cell, Link):
        return f"[{cell.text}]({cell.to('md')})"
    return cell.replace("|", "\\|")


def plain(blocks: Iterable[Block]) -> str:
    """For a terminal: tables in columns."""
    return "\n".join(line for block in blocks if not block.brief for line in _plain(block))


def _plain(block: Block) -> list[str]:
    if block.kind != "table":
        return [block.text]
    rows = [[*map(_words, row)] for row in block.rows]
    widths = [max(map(len, column)) for column in zip(*rows)]
    return ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]


def _words(cell: Cell) -> str:
    return cell.text if isinstance(cell, Link) else cell


def page(title: str, blocks: Iterable[Block]) -> str:
    """A whole page."""
    body = "".join(_html(block) for block in blocks if not block.brief)
    return (f"<!doctype html><html lang='en'><meta charset='utf-8'><title>{_safe(title)}</title><style>{STYLE}</style>"
            f"<body><h1>{_safe(title)}</h1>{body}</body></html>\n")


def _html(block: Block) -> str:
    text = _safe(block.text)
    if block.kind == "picture":
        name, _, shown = text.partition(": ")
        return f"<img src='{name}' alt='{shown or name}'>"
    if block.kind == "table":
        head, *rows = block.rows
        return f"<table>{_row('th', head)}{''.join(_row('td', row) for row in rows)}</table>"
    return {"heading": f"<h2 id='{text}'>{text}</h2>", "error": f"<pre>{text}</pre>"}.get(block.kind, f"<p>{text}")


def _row(kind: str, row: Row) -> str:
    """A row of a table; red where something does not hold."""
    cells = "".join(f"<{kind}>{_html_cell(cell)}" for cell in row)
    return f"<tr class='{'no' if BAD & {*row} else 'yes'}'>{cells}"


def _html_cell(cell: Cell) -> str:
    if isinstance(cell, Link):
        return f"<a href='{_safe(cell.to('html'))}'>{_safe(cell.text)}</a>"
    return _safe(cell)


def _safe(text: str) -> str:
    return html.escape(text)


def load(file: Path, empty: Any = None) -> Any:
    """A record; ``empty`` where there is none."""
    return json.loads(file.read_text(encoding="utf-8")) if file.exists() else empty


def save(record: Any, file: Path) -> None:
    """Write a record whole or not at all; ValueError where it holds not-a-number."""
    text = json.dumps(record, indent=1, allow_nan=False)
    file.parent.mkdir(parents=True, exist_ok=True)
    with whole(file) as beside:
        write_text(beside, text + "\n")


def lines(file: Path) -> list[dict]:
    """Rows that were appended to a file; the last one may be cut."""
    rows = []
    for line in file.read_text(encoding="utf-8").splitlines() if file.exists() else []:
        with suppress(json.JSONDecodeError):
            rows.append(json.loads(line))
    return rows


def append(row: dict, file: Path) -> None:
    """Add a row to a file, so that a break loses one at most."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("a", encoding="utf-8") as opened:
        opened.write(json.dumps(row) + "\n")
