"""The report of the claims as Markdown and as JSON."""

from __future__ import annotations

import math

from verification.claims import Check
from verification.claims.cells import HEAD, LEGEND, cells, number
from verification.claims.independence import Comparison
from verification.claims.report import Independence, Row, moving, remarks, summary
from verification.uncertainty import Bar, Estimate


def markdown(rows: list[Row], section: Independence | None) -> str:
    """The whole report."""
    parts = ["# What the paper claims, judged by computed numbers", "", summary(rows).replace("\n", "\n\n"), "", LEGEND,
             "", *_head(("id", "claim", *HEAD[1:], "verdict", "command"))]
    parts += [_row(row) for row in rows]
    parts += ["", "## Remarks", "", *(_remarks(row) for row in rows if row.finding), ""]
    return "\n".join(parts + (_independence(section) if section else [])) + "\n"


def _head(cells_) -> list[str]:
    return [_line(cells_), _line(["---"] * len(cells_))]


def _line(cells_) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells_) + " |"


def _row(row: Row) -> str:
    text, command = (row.claim.text, f"`{row.claim.command}`") if row.claim else ("", "")
    if not row.checks:
        empty = [""] * (len(HEAD) - 1)
        return _line((row.id, text, *empty, f"**{row.verdict}**: {row.error}", command))
    quantity, paper, *columns = zip(*map(cells, row.checks))
    paper = [f"{name}: {said}" for name, said in zip(quantity, paper)]
    return _line((row.id, text, *("<br>".join(column) for column in (paper, *columns)),
                  f"**{row.verdict}** {row.error}".strip(), command))


def _remarks(row: Row) -> str:
    origin = "; ".join(dict.fromkeys(check.why for check in row.finding.checks))
    parts = [f"{label}{text.rstrip('.')}." for label, text in remarks(row) if text]
    return f"- **{row.id}** (paper: {row.claim.where}). Tolerances: {origin}. " + " ".join(parts)


def _independence(section: Independence) -> list[str]:
    parts = ["## Mesh and time-step independence of base", ""]
    for comparison in section.comparisons:
        lines = [_line((name, *moving(values, moved))) for name, values, moved in comparison.lines]
        parts += [f"### {comparison.title}", "", *_head(("", *comparison.runs)), *lines, ""]
    checks = [_line((c.quantity, c.paper, number(c.ours) + ("" if c.holds else " FAILS"))) for c in section.checks]
    return [*parts, *_head(("what", "bound", "ours")), *checks]


def as_json(rows: list[Row], section: Independence | None) -> dict:
    """The same as plain values; an open end of a range, and an order that none fits, are None."""
    found = {"summary": summary(rows).split("\n"), "claims": [_json_row(row) for row in rows]}
    if section:
        found["independence"] = {"comparisons": [_json_comparison(c) for c in section.comparisons],
                                 "checks": [_json_check(check) for check in section.checks]}
    return found


def _json_row(row: Row) -> dict:
    found = {"id": row.id, "verdict": row.verdict, "error": row.error}
    if row.claim:
        found |= {"where": row.claim.where, "claim": row.claim.text, "command": row.claim.command,
                  "fixed": row.claim.fixed}
    if row.checks:
        found |= {"checks": [_json_check(check) | _json_bar(check) for check in row.checks],
                  "change": row.finding.change, "reason": row.finding.reason, "note": row.finding.note,
                  "other_levels": [{"size": level.size, "step": level.step, "values": [_finite(value) for _, value, _ in
                                    numbers]} for level, numbers in row.others.items()]}
    return found


def _json_comparison(comparison: Comparison) -> dict:
    return {"title": comparison.title, "runs": comparison.runs, "lines": [
        {"quantity": name, "values": values, "differences_percent": moved} for name, values, moved in comparison.lines]}


def _json_check(check: Check) -> dict:
    return {"quantity": check.quantity, "paper": check.paper, "ours": _finite(check.ours), "low": _finite(check.low),
            "high": _finite(check.high), "deviation": check.deviation, "tolerance": check.accepted, "why": check.why,
            "holds": check.holds}


def _json_bar(check: Check) -> dict:
    bar: Bar = check.bar
    return {"outcome": check.outcome, "against_paper": check.against_paper, "bar_low": _finite(bar.low),
            "bar_high": _finite(bar.high), "mesh": _json_estimate(bar.mesh), "step": _json_estimate(bar.step)}


def _json_estimate(found: Estimate | None) -> dict | None:
    if found is None:
        return None
    return {"bar": found.bar, "order": _finite(found.order), "factor": found.factor}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
