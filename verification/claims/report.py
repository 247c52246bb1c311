"""The report of the claims: a table for the terminal, Markdown and JSON."""

from __future__ import annotations

import math
import textwrap
from collections import Counter
from dataclasses import dataclass
from itertools import zip_longest

from verification.claims import Check, Claim, Finding
from verification.claims.independence import Comparison

WIDTH, INDENT = 120, " " * 5
COLUMNS = (("quantity", 50), ("paper", 15), ("ours", 10), ("deviation", 13), ("tolerance", 22))


@dataclass(frozen=True)
class Row:
    """A judged claim: its finding and verdict; or the error for which there is none."""

    id: str
    claim: Claim | None
    finding: Finding | None
    verdict: str
    error: str = ""


@dataclass(frozen=True)
class Independence:
    """What does not come from the paper: comparisons of runs, and the bounds that they must keep."""

    comparisons: tuple[Comparison, ...]
    checks: tuple[Check, ...]


def number(value: float) -> str:
    """Four digits."""
    return f"{value:.4g}"


def _cells(check: Check) -> tuple[str, ...]:
    return check.quantity, check.paper, number(check.ours), check.deviation, check.accepted


def _line(cells) -> str:
    """Cells side by side, each wrapped in its column."""
    wrapped = [textwrap.wrap(cell, width) or [""] for cell, (_, width) in zip(cells, COLUMNS)]
    rows = zip_longest(*wrapped, fillvalue="")
    return "\n".join(INDENT + " ".join(f"{text:<{width}}" for text, (_, width) in zip(row, COLUMNS)).rstrip()
                     for row in rows)


def _paragraph(label: str, text: str) -> str:
    return textwrap.fill(f"{label}{text}", WIDTH, initial_indent=INDENT, subsequent_indent=INDENT + "  ")


def terminal(row: Row) -> str:
    """A claim with its checks, at most WIDTH columns wide."""
    if row.claim is None:
        return f"{row.id}  {row.verdict.upper()}: {row.error}\n"
    head = textwrap.fill(f"{row.id}  {row.verdict.upper()}: {row.claim.text} (paper: {row.claim.where})", WIDTH,
                         subsequent_indent=INDENT)
    parts = [head]
    if row.finding:
        parts += [_line(name for name, _ in COLUMNS), *(_line(_cells(check)) for check in row.finding.checks)]
        parts += [_paragraph(label, text) for label, text in _remarks(row) if text]
    if row.error:
        parts.append(_paragraph("error: ", row.error))
    return "\n".join([*parts, _paragraph("command: ", row.claim.command)]) + "\n"


def _remarks(row: Row) -> tuple[tuple[str, str], ...]:
    """What was changed, why it fails if it does, and what else is worth telling."""
    finding = row.finding
    failed = not all(check.holds for check in finding.checks)
    return (("changed: ", finding.change), ("because: ", finding.reason if failed else ""), ("", finding.note))


def terminal_independence(section: Independence) -> str:
    """The comparisons as tables, and the bounds."""
    parts = ["Mesh and time-step independence of base", ""]
    for comparison in section.comparisons:
        parts += [comparison.title, *_comparison_lines(comparison), ""]
    parts += [_line(("what", "bound", "ours", "", "accepted")), *(_line(_cells(check)) for check in section.checks)]
    return "\n".join(parts) + "\n"


def _comparison_lines(comparison: Comparison) -> list[str]:
    head = INDENT + " " * 36 + "".join(f"{name:>24}" for name in comparison.runs)
    return [head, *(INDENT + f"{name:<36}" + "".join(f"{text:>24}" for text in _moving(values, moved))
                    for name, values, moved in comparison.lines)]


def _moving(values: tuple[float, ...], moved: tuple[float, ...]) -> list[str]:
    """Values, each but the first with its difference from the one before."""
    return [number(values[0]), *(f"{number(v)} ({m:+.2f} %)" for v, m in zip(values[1:], moved))]


def markdown(rows: list[Row], section: Independence | None) -> str:
    """The whole report."""
    head = ("id", "claim", "paper", "ours", "deviation", "tolerance", "verdict", "command")
    parts = ["# What the paper claims, judged by computed numbers", "", summary(rows), "", *_markdown_head(head)]
    parts += [_markdown_row(row) for row in rows]
    parts += ["", "## Remarks", "", *(_markdown_remarks(row) for row in rows if row.finding), ""]
    return "\n".join(parts + (_markdown_independence(section) if section else [])) + "\n"


def _markdown_independence(section: Independence) -> list[str]:
    parts = ["## Mesh and time-step independence of base", ""]
    for comparison in section.comparisons:
        lines = [_markdown_line((name, *_moving(values, moved))) for name, values, moved in comparison.lines]
        parts += [f"### {comparison.title}", "", *_markdown_head(("", *comparison.runs)), *lines, ""]
    checks = [_markdown_line((c.quantity, c.paper, number(c.ours) + ("" if c.holds else " FAILS")))
              for c in section.checks]
    return [*parts, *_markdown_head(("what", "bound", "ours")), *checks]


def summary(rows: list[Row]) -> str:
    """How many claims have each verdict."""
    counts = Counter(row.verdict for row in rows)
    return f"{len(rows)} claims: " + ", ".join(f"{count} {verdict}" for verdict, count in counts.items()) + "."


def _markdown_head(cells) -> list[str]:
    return [_markdown_line(cells), _markdown_line(["---"] * len(cells))]


def _markdown_line(cells) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _markdown_row(row: Row) -> str:
    text, command = (row.claim.text, f"`{row.claim.command}`") if row.claim else ("", "")
    if row.finding is None:
        return _markdown_line((row.id, text, "", "", "", "", f"**{row.verdict}**: {row.error}", command))
    columns = list(zip(*(_cells(check) for check in row.finding.checks)))
    paper = [f"{quantity}: {said}" for quantity, said in zip(columns[0], columns[1])]
    cells = ["<br>".join(column) for column in (paper, *columns[2:])]
    return _markdown_line((row.id, text, *cells, f"**{row.verdict}** {row.error}".strip(), command))


def _markdown_remarks(row: Row) -> str:
    origin = "; ".join(dict.fromkeys(check.why for check in row.finding.checks))
    parts = [f"{label}{text.rstrip('.')}." for label, text in _remarks(row) if text]
    return f"- **{row.id}** (paper: {row.claim.where}). Tolerances: {origin}. " + " ".join(parts)


def as_json(rows: list[Row], section: Independence | None) -> dict:
    """The same as plain values; an open end of a range is None."""
    found = {"claims": [_json_row(row) for row in rows]}
    if section:
        found["independence"] = {"comparisons": [_json_comparison(c) for c in section.comparisons],
                                 "checks": [_json_check(check) for check in section.checks]}
    return found


def _json_row(row: Row) -> dict:
    found = {"id": row.id, "verdict": row.verdict, "error": row.error}
    if row.claim:
        found |= {"where": row.claim.where, "claim": row.claim.text, "command": row.claim.command}
    if row.finding:
        found |= {"checks": [_json_check(check) for check in row.finding.checks], "change": row.finding.change,
                  "reason": row.finding.reason, "note": row.finding.note}
    return found


def _json_comparison(comparison: Comparison) -> dict:
    return {"title": comparison.title, "runs": comparison.runs, "lines": [
        {"quantity": name, "values": values, "differences_percent": moved} for name, values, moved in comparison.lines]}


def _json_check(check: Check) -> dict:
    return {"quantity": check.quantity, "paper": check.paper, "ours": _finite(check.ours), "low": _finite(check.low),
            "high": _finite(check.high), "deviation": check.deviation, "tolerance": check.accepted, "why": check.why,
            "holds": check.holds}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
