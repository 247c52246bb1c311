"""The report of the claims on the terminal, and what it counts; `written` has it as Markdown and JSON."""

from __future__ import annotations

import textwrap
from collections import Counter
from dataclasses import dataclass, field
from itertools import zip_longest

from verification.claims import (
    FAILS,
    HOLDS,
    INSIDE_BAR,
    INSIDE_FEW,
    NEITHER,
    REACHES_OVER,
    Check,
    Claim,
    Finding,
)
from verification.claims.bars import Numbers
from verification.claims.cells import HEAD, LEGEND, cells, number
from verification.claims.independence import Comparison
from verification.claims.levels import Level

WIDTH, INDENT = 120, " " * 5
COLUMNS = (28, 13, 10, 10, 9, 9, 15, 14)
BOUNDS = (60, 12, 12, 24)


@dataclass(frozen=True)
class Row:
    """A judged claim: its finding and verdict, or the error for which there is none; its numbers at other levels."""

    id: str
    claim: Claim | None
    finding: Finding | None
    verdict: str
    error: str = ""
    others: dict[Level, Numbers] = field(default_factory=dict)

    @property
    def checks(self) -> tuple[Check, ...]:
        """Those that have a bar: none of a claim that came to an error."""
        return tuple(check for check in self.finding.checks if check.bar) if self.finding else ()


@dataclass(frozen=True)
class Independence:
    """What does not come from the paper: comparisons of runs, and the bounds that they must keep."""

    comparisons: tuple[Comparison, ...]
    checks: tuple[Check, ...]


def _line(texts, widths: tuple[int, ...]) -> str:
    """Cells side by side, each wrapped in its column."""
    wrapped = [textwrap.wrap(text, width) or [""] for text, width in zip(texts, widths)]
    rows = zip_longest(*wrapped, fillvalue="")
    return "\n".join(INDENT + " ".join(f"{text:<{width}}" for text, width in zip(row, widths)).rstrip()
                     for row in rows)


def _paragraph(label: str, text: str) -> str:
    return textwrap.fill(f"{label}{text}", WIDTH, initial_indent=INDENT, subsequent_indent=INDENT + "  ")


def legend() -> str:
    """What the columns say."""
    return _paragraph("", LEGEND) + "\n"


def terminal(row: Row) -> str:
    """A claim with its checks, at most WIDTH columns wide."""
    if row.claim is None:
        return f"{row.id}  {row.verdict.upper()}: {row.error}\n"
    head = textwrap.fill(f"{row.id}  {row.verdict.upper()}: {row.claim.text} (paper: {row.claim.where})", WIDTH,
                         subsequent_indent=INDENT)
    parts = [head]
    if row.checks:
        parts += [_line(HEAD, COLUMNS), *(_line(cells(check), COLUMNS) for check in row.checks)]
        parts += [_paragraph(label, text) for label, text in remarks(row) if text]
    if row.error:
        parts.append(_paragraph("error: ", row.error))
    return "\n".join([*parts, _paragraph("command: ", row.claim.command)]) + "\n"


def remarks(row: Row) -> tuple[tuple[str, str], ...]:
    """What was changed, why it fails if it does, what is not varied, and what else is worth telling."""
    finding = row.finding
    failed = not all(check.holds for check in finding.checks)
    return (("changed: ", finding.change), ("because: ", finding.reason if failed else ""),
            ("steps are not varied: ", row.claim.fixed), ("", finding.note))


def terminal_independence(section: Independence) -> str:
    """The comparisons as tables, and the bounds."""
    parts = ["Mesh and time-step independence of base", ""]
    for comparison in section.comparisons:
        parts += [comparison.title, *_comparison_lines(comparison), ""]
    parts += [_line(("what", "bound", "ours", "accepted"), BOUNDS)]
    parts += [_line((c.quantity, c.paper, number(c.ours), c.accepted), BOUNDS) for c in section.checks]
    return "\n".join(parts) + "\n"


def _comparison_lines(comparison: Comparison) -> list[str]:
    head = INDENT + " " * 36 + "".join(f"{name:>24}" for name in comparison.runs)
    return [head, *(INDENT + f"{name:<36}" + "".join(f"{text:>24}" for text in moving(values, moved))
                    for name, values, moved in comparison.lines)]


def moving(values: tuple[float, ...], moved: tuple[float, ...]) -> list[str]:
    """Values, each but the first with its difference from the one before."""
    return [number(values[0]), *(f"{number(v)} ({m:+.2f} %)" for v, m in zip(values[1:], moved))]


def summary(rows: list[Row]) -> str:
    """How many claims have each verdict, what becomes of their numbers, and where the paper's values are."""
    verdicts = Counter(row.verdict for row in rows)
    checks = [check for row in rows for check in row.checks]
    outcomes = Counter(check.outcome for check in checks)
    against = Counter(check.against_paper for check in checks if check.against_paper)
    return "\n".join((
        f"{len(rows)} claims: " + "; ".join(f"{count} {verdict}" for verdict, count in verdicts.items()) + ".",
        f"{len(checks)} numbers with their bars: {outcomes[HOLDS]} hold, {outcomes[FAILS]} fail, the bar of "
        f"{outcomes[REACHES_OVER]} reaches over a bound.",
        f"{against.total()} values of the paper: {against[INSIDE_BAR]} {INSIDE_BAR}, "
        f"{against[INSIDE_FEW]} {INSIDE_FEW}, {against[NEITHER]} {NEITHER}."))
