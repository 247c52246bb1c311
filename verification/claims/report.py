"""The report of the claims on the terminal and as Markdown, and what it counts."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import zip_longest
from math import isfinite

from verification import sensitivity
from verification.claims import (
    CHANGED,
    FAILS,
    HOLDS,
    PREDICTED,
    REACHES_OVER,
    REPRODUCED,
    VERDICTS,
    Claim,
    Finding,
    PaperCheck,
)
from verification.claims.independence import Comparison
from verification.kernel import writing
from verification.kernel.writing import Block, table

WIDTH, INDENT = 120, " " * 5
HEAD = ("quantity", "paper", "ours", "numerics", "inputs", "scheme of 2001", "accepted", "outcome")
COLUMNS = (24, 11, 10, 15, 15, 15, 14, 11)
LEGEND = ("paper: as printed. ours: the converged solution, or the scheme where the claim is about that. numerics: the "
          "error bar; inputs: where the number goes as the inputs of Table 1 move within their rounding; scheme of "
          "2001: its range on three meshes. accepted: the interval of the printed digits, or what the words are taken "
          "for. An outcome is that of the whole bar.")


@dataclass(frozen=True)
class Row:
    """A judged claim: its finding and verdict, or the error for which there is none."""

    id: str
    claim: Claim | None
    finding: Finding | None
    verdict: str
    error: str = ""

    @property
    def checks(self) -> tuple[PaperCheck, ...]:
        """Those that have a bar: none of a claim that came to an error."""
        return tuple(check for check in self.finding.checks if check.bar) if self.finding else ()

    @property
    def reason(self) -> str:
        """Why a check does not hold; empty where all do."""
        return "" if self.verdict in (REPRODUCED, CHANGED) or not self.finding else self.finding.reason


@dataclass(frozen=True)
class Independence:
    """What does not come from the paper: comparisons of runs of its scheme, and the bounds that they must keep."""

    comparisons: tuple[Comparison, ...]
    checks: tuple[PaperCheck, ...]

    @property
    def kept(self) -> bool:
        """Are all bounds kept?"""
        return all(check.holds for check in self.checks)


def moving(values: tuple[float, ...], moved: tuple[float, ...]) -> list[str]:
    """Values, each but the first with its difference from the one before."""
    return [number(values[0]), *(f"{number(v)} ({m:+.2f} %)" for v, m in zip(values[1:], moved))]


def terminal_independence(section: Independence) -> str:
    """The bounds as lines."""
    lines = [INDENT + f"{c.quantity}: {number(c.value)}, bound {c.paper}" for c in section.checks]
    return "\n".join(["Mesh and time-step independence of base in the paper's scheme", *lines]) + "\n"


def number(value: float) -> str:
    """Four digits."""
    return f"{value:.4g}"


def spanned(pair) -> str:
    """An interval in words; empty where there is none."""
    if pair is None:
        return ""
    low, high = pair
    if isfinite(low) and isfinite(high):
        return number(low) if low == high else f"{number(low)} to {number(high)}"
    return f"at least {number(low)}" if isfinite(low) else f"at most {number(high)}"


def cells(check: PaperCheck) -> tuple[str, ...]:
    """A check with its widths, in the order of HEAD."""
    return (check.quantity, check.paper, number(check.value), spanned((check.bar.low, check.bar.high)),
            spanned(sensitivity.interval(check.input, check.value)), spanned(check.scheme),
            spanned((check.low, check.high)), check.outcome)


def _line(texts, widths: tuple[int, ...]) -> str:
    """Cells side by side, each wrapped in its column."""
    wrapped = [textwrap.wrap(text, width - 1) or [""] for text, width in zip(texts, widths)]
    rows = zip_longest(*wrapped, fillvalue="")
    return "\n".join(INDENT + "".join(f"{text:<{width}}" for text, width in zip(row, widths)).rstrip()
                     for row in rows)


def _paragraph(label: str, text: str) -> str:
    return textwrap.fill(f"{label}{text}", WIDTH, initial_indent=INDENT, subsequent_indent=INDENT + "  ")


def legend() -> str:
    """What the columns say."""
    return _paragraph("", LEGEND) + "\n"


def terminal(row: Row) -> str:
    """A claim with its checks."""
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
    """What was changed, why it does not hold if it does not, what is not varied, and what else is worth telling."""
    finding = row.finding
    return (("about: ", row.claim.about), ("changed: ", finding.change), ("because: ", row.reason),
            ("inputs: ", finding.rounding), ("steps are not varied: ", row.claim.fixed), ("", finding.note))


def predicted(checks) -> list[PaperCheck]:
    """Numbers that the paper prints and a solution predicts: what can be reproduced."""
    return [check for check in checks if check.printed and check.rests_on == PREDICTED]


def summary(rows: list[Row]) -> str:
    """How many claims have each verdict, and what becomes of their numbers."""
    verdicts = Counter(row.verdict for row in rows)
    checks = [check for row in rows for check in row.checks]
    outcomes, values = (Counter(check.outcome for check in chosen) for chosen in (checks, predicted(checks)))
    named = [*VERDICTS, *(verdict for verdict in verdicts if verdict not in VERDICTS)]
    return "\n".join((
        f"{len(rows)} claims: " + "; ".join(f"{verdicts[verdict]} {verdict}" for verdict in named) + ".",
        f"{len(checks)} numbers with their bars: {outcomes[HOLDS]} hold, {outcomes[FAILS]} fail, the bar of "
        f"{outcomes[REACHES_OVER]} reaches over a bound.",
        f"{values.total()} printed values that a solution predicts: {values[HOLDS]} within their printed digits, "
        f"{values[FAILS]} outside, {values[REACHES_OVER]} not decided. Inputs, rules of construction and arithmetic of "
        "Table 1 are not among them."))


def markdown(rows: list[Row], section: Independence) -> str:
    """The whole report."""
    blocks = [Block("text", summary(rows).replace("\n", "\n\n")), Block("text", LEGEND),
              table(("id", "claim", *HEAD[1:], "verdict"), map(_row, rows)), Block("heading", "Remarks"),
              Block("text", "\n".join(_remarks(row) for row in rows if row.finding)), *_independence(section)]
    return f"# What the paper claims, judged by computed numbers\n\n{writing.markdown(blocks, 2)}\n"


def _independence(section: Independence) -> Iterator[Block]:
    yield Block("heading", "Mesh and time-step independence of base in the paper's scheme")
    for comparison in section.comparisons:
        yield Block("text", f"### {comparison.title}")
        yield table(("", *comparison.runs),
                    ((name, *moving(values, moved)) for name, values, moved in comparison.lines))
    yield table(("what", "bound", "ours"), ((c.quantity, c.paper, number(c.value) + ("" if c.holds else " FAILS"))
                                            for c in section.checks))


def _row(row: Row) -> tuple[str, ...]:
    text = row.claim.text if row.claim else ""
    if not row.checks:
        return row.id, text, *[""] * (len(HEAD) - 1), f"**{row.verdict}**: {row.error}"
    quantity, paper, *columns = zip(*map(cells, row.checks))
    paper = [f"{name}: {said}" for name, said in zip(quantity, paper)]
    return row.id, text, *("<br>".join(column) for column in (paper, *columns)), f"**{row.verdict}**"


def _remarks(row: Row) -> str:
    origin = "; ".join(dict.fromkeys(f"{check.origin} ({check.date})" for check in row.checks))
    parts = [f"{label}{text.rstrip('.')}." for label, text in remarks(row) if text]
    return f"- **{row.id}** (paper: {row.claim.where}). Tolerances: {origin}. " + " ".join(parts)
