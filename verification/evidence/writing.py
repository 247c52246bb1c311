"""Writers of pages in Markdown, of records in JSON, and of figures."""

import json
from collections.abc import Collection, Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.figure import Figure

from repro.results import write_text
from repro.results.files import atomic_path

ROOT = Path(__file__).parents[2]
REPORT = ROOT / "verification" / "report"


def link(text: str, page: str, place: str = "") -> str:
    """A link in Markdown.

    page: a page of the report, such as "flow", or the path of another page, such as "../../docs/network.md"; place: a
    heading on it, such as "flow-plug".
    """
    file = page if page.endswith(".md") else f"{page}.md"
    return f"[{text}]({file}{'#' * bool(place)}{place})"


def page(title: str, blocks: Iterable[str]) -> str:
    """A page of Markdown from a title and blocks, which are headings, paragraphs, pictures and tables."""
    return "\n\n".join([f"# {title}", *blocks]) + "\n"


def table(head: Collection[str], rows: Iterable[Iterable]) -> str:
    """A table in Markdown."""
    return "\n".join(map(markdown_row, (head, ["---"] * len(head), *rows)))


def markdown_row(cells: Iterable) -> str:
    """A row of a table."""
    return "| " + " | ".join(str(cell).replace("|", "\\|") for cell in cells) + " |"


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
    """The complete rows of a file. Incomplete rows are skipped."""
    rows = []
    for line in file.read_text(encoding="utf-8").splitlines() if file.exists() else []:
        with suppress(json.JSONDecodeError):
            rows.append(json.loads(line))
    return rows


def append(row: dict, file: Path) -> None:
    """Append a row to a file. A row begins with its line break, so an interruption damages at most one row."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("a", encoding="utf-8") as opened:
        opened.write("\n" + json.dumps(row))
