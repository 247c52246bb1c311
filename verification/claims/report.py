"""The report of the claims on the terminal and as Markdown, and what it counts.

The committed record of the claims, `claims.json`: intervals and verdicts that a run on any machine must agree with.

A check's `value` lies in `low` to `high` (numerics), the paper's in `paper_low` to `paper_high` (printing, null for
words), and `input_low` to `input_high` is where the value goes as the inputs of Table 1 move within their rounding
(from the committed record of the sensitivities or a closed form, null where none tells). `scheme_2001` is the range
that the paper's scheme gives on one to three meshes, for a claim about the scheme that of all its levels. `on_sizes`
are the values on the sizes of the converged solution, the judged one first, and `order` is that which is observed on
them, or on the meshes of the scheme; null where none fits.
"""

from __future__ import annotations

import json
import textwrap
from collections import Counter
from dataclasses import dataclass
from itertools import zip_longest
from math import inf, isfinite
from pathlib import Path

from verification.claims import (
    CHANGED,
    FAILS,
    HOLDS,
    OF_SCHEME,
    PREDICTED,
    REACHES_OVER,
    REPRODUCED,
    VERDICTS,
    Claim,
    Finding,
    PaperCheck,
    outcome_of,
    verdict_of,
)
from verification.claims.evaluate import unnumbered
from verification.kernel import writing
from verification.kernel.writing import Block, table

WIDTH, INDENT = 120, " " * 5
HEAD = ("quantity", "paper", "ours", "numerics", "inputs", "scheme of 2001", "accepted", "outcome")
COLUMNS = (24, 11, 10, 15, 15, 15, 14, 11)
LEGEND = ("paper: as printed. ours: the converged solution, or the scheme where the claim is about that. numerics: the "
          "error bar; inputs: where the number goes as the inputs of Table 1 move within their rounding; scheme of "
          "2001: its range on one to three meshes. accepted: the interval of the printed digits, or what the words are "
          "taken for. An outcome is that of the whole bar.")


INDEPENDENCE = "Mesh and time-step independence of base in the paper's scheme"


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


def terminal_independence(checks: tuple[PaperCheck, ...]) -> str:
    """The bounds as lines."""
    lines = [INDENT + f"{c.quantity}: {number(c.value)}, bound {c.paper}" for c in checks]
    return "\n".join([INDEPENDENCE, *lines]) + "\n"


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
            spanned(check.inputs), spanned(check.scheme),
            spanned((check.low, check.high)), check.outcome)


def _line(texts, widths: tuple[int, ...]) -> str:
    """Cells side by side, each wrapped in its column."""
    wrapped = [textwrap.wrap(text, width - 1) or [""] for text, width in zip(texts, widths)]
    form = INDENT + "".join(f"{{:<{width}}}" for width in widths)
    return "\n".join(form.format(*row).rstrip() for row in zip_longest(*wrapped, fillvalue=""))


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
    outcomes = Counter(check.outcome for check in checks)
    values = Counter(check.outcome for check in predicted(checks))
    named = [*VERDICTS, *(verdict for verdict in verdicts if verdict not in VERDICTS)]
    return "\n".join((
        f"{len(rows)} claims: " + "; ".join(f"{verdicts[verdict]} {verdict}" for verdict in named) + ".",
        f"{len(checks)} numbers with their bars: {outcomes[HOLDS]} hold, {outcomes[FAILS]} fail, the bar of "
        f"{outcomes[REACHES_OVER]} reaches over a bound.",
        f"{values.total()} printed values that a solution predicts: {values[HOLDS]} within their printed digits, "
        f"{values[FAILS]} outside, {values[REACHES_OVER]} not decided. Inputs, rules of construction and arithmetic of "
        "Table 1 are not among them."))


def markdown(rows: list[Row], checks: tuple[PaperCheck, ...]) -> str:
    """The whole report; checks: of what does not come from the paper, that base does not hang on mesh and step."""
    independence = ((c.quantity, c.paper, number(c.value) + ("" if c.holds else " FAILS")) for c in checks)
    blocks = [Block("text", summary(rows).replace("\n", "\n\n")), Block("text", LEGEND),
              table(("id", "claim", *HEAD[1:], "verdict"), map(_row, rows)), Block("heading", "Remarks"),
              Block("text", "\n".join(_remarks(row) for row in rows if row.finding)),
              Block("heading", INDEPENDENCE), table(("what", "bound", "ours"), independence)]
    return f"# What the paper claims, judged by computed numbers\n\n{writing.markdown(blocks, 2)}\n"


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


COMMITTED = Path(__file__).parent / "claims.json"
#: Numbers this small are the round-off of exact ones, which differs between machines; so do last digits.
ROUND_OFF, LAST_DIGITS = 1e-9, 1e-9


def read() -> list[dict]:
    """The committed record; empty where there is none yet."""
    return json.loads(COMMITTED.read_text(encoding="utf-8")) if COMMITTED.exists() else []


def replaced(ours: list[dict]) -> list[dict]:
    """The record with some claims anew, in order."""
    known = {each["id"]: each for each in (*read(), *ours)}
    return [known[id] for id in sorted(known)]


def entry(row: Row) -> dict:
    """A judged claim as plain values."""
    claim, finding = row.claim, row.finding
    return {"id": row.id, "claim": claim.text, "verdict": row.verdict, "where": claim.where, "about": claim.about,
            "change": finding.change, "reason": row.reason, "rounding": finding.rounding, "note": finding.note,
            "fixed": claim.fixed, "checks": [_check(check, claim.about) for check in row.checks]}


def _check(check: PaperCheck, about: str) -> dict:
    paper, inputs = check.printed or (None, None), check.inputs
    scheme = (check.bar.low, check.bar.high) if about == OF_SCHEME else check.scheme
    return {"quantity": check.quantity, "rests_on": check.rests_on, "paper": check.paper,
            "paper_low": paper[0], "paper_high": paper[1], "value": _finite(check.value),
            "low": _finite(check.bar.low), "high": _finite(check.bar.high),
            "input_low": inputs and inputs[0], "input_high": inputs and inputs[1],
            "scheme_2001": scheme and [_finite(value) for value in scheme],
            "on_sizes": [_finite(value) for value in check.on_sizes],
            "order": _finite(check.bar.mesh.order) if check.bar.mesh else None,
            "tolerance": {"low": _finite(check.low), "high": _finite(check.high), "origin": check.origin,
                          "date": check.date}, "outcome": check.outcome}


def _finite(value: float) -> float | None:
    return value if isfinite(value) else None


def differences(ours: list[dict], committed: list[dict]) -> list[str]:
    """Where claims do not agree with the record, a line each: another verdict or outcome, a number out of its interval.
    """
    known = {each["id"]: each for each in committed}
    return [line for each in ours for line in _of_claim(each, known.get(each["id"]))]


def _of_claim(ours: dict, known: dict | None) -> list[str]:
    id = ours["id"]
    if known is None:
        return [f"{id}: not in the record"]
    told = [f"{id}: {ours['verdict']}, recorded as {known['verdict']}"] if ours["verdict"] != known["verdict"] else []
    if _quantities(ours) != _quantities(known):
        return [*told, f"{id}: other quantities than recorded"]
    return told + [line for pair in zip(ours["checks"], known["checks"]) for line in _of_check(id, *pair)]


def _quantities(entry: dict) -> list[str]:
    return [unnumbered(check["quantity"]) for check in entry["checks"]]


def _of_check(id: str, ours: dict, known: dict) -> list[str]:
    told = []
    if not inside(ours["value"], known["low"], known["high"]):
        told.append(f"{id}: {ours['quantity']} is {ours['value']:.6g}, recorded as {known['low']:.6g} to "
                    f"{known['high']:.6g}")
    if ours["outcome"] != known["outcome"]:
        told.append(f"{id}: {ours['quantity']} {ours['outcome']}, recorded: {known['outcome']}")
    return told


def inside(value: float | None, low: float | None, high: float | None) -> bool:
    """Does a value lie in a recorded interval, but for round-off? An open end is None."""
    if value is None or low is None or high is None:
        return value is None and (low is None or high is None)
    near = LAST_DIGITS * max(abs(low), abs(high)) + ROUND_OFF
    return low - near <= value <= high + near


@dataclass(frozen=True)
class Flip:
    """A recorded verdict that is another one with a bound moved by the bar of its number.

    id: the claim; quantity: of the check; verdict: with the moved bound.
    """

    id: str
    quantity: str
    verdict: str


def flips(entry: dict) -> list[Flip]:
    """What moving one bound by half the width of its number's bar, to either side, makes of a recorded claim; each
    check and verdict once."""
    found = [Flip(entry["id"], check["quantity"], _verdict_with(entry, number, bounds))
             for number, check in enumerate(entry["checks"]) for bounds in _moved(check)]
    return [flip for flip in dict.fromkeys(found) if flip.verdict != entry["verdict"]]


def _moved(check: dict) -> list[tuple[float, float]]:
    """The bounds of a check, one of them moved by the bar; none where that has no end."""
    if check["low"] is None or check["high"] is None:
        return []
    low, high = (-inf if check["tolerance"]["low"] is None else check["tolerance"]["low"],
                 inf if check["tolerance"]["high"] is None else check["tolerance"]["high"])
    half = 0.5 * (check["high"] - check["low"])
    return [(low - half, high), (low + half, high), (low, high - half), (low, high + half)]


def _verdict_with(entry: dict, number: int, bounds: tuple[float, float]) -> str:
    """The verdict with other bounds of one check."""
    outcomes = [check["outcome"] for check in entry["checks"]]
    moved = entry["checks"][number]
    outcomes[number] = outcome_of((moved["low"], moved["high"]), bounds)
    return verdict_of(set(outcomes), bool(entry["change"]), bool(entry["rounding"]))
