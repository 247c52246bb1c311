"""The committed record of the claims, `claims.json`: intervals and verdicts that a run on any machine must agree with.

A check's `value` lies in `low` to `high` (numerics), the paper's in `paper_low` to `paper_high` (printing, null for
words), and `input_low` to `input_high` is where the value goes as the inputs of Table 1 move within their rounding
(from the committed record of the sensitivities, null where that does not tell). `scheme_2001` is the range that the
paper's scheme gives on three meshes, for a claim about the scheme that of all its levels.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from math import inf, isfinite
from pathlib import Path

from verification import sensitivity
from verification.claims import OF_SCHEME, PaperCheck, outcome_of, verdict_of
from verification.claims.bars import unnumbered
from verification.claims.report import Row

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
    paper, inputs = check.printed or (None, None), sensitivity.interval(check.input, check.value)
    scheme = (check.bar.low, check.bar.high) if about == OF_SCHEME else check.scheme
    return {"quantity": check.quantity, "rests_on": check.rests_on, "paper": check.paper,
            "paper_low": paper[0], "paper_high": paper[1], "value": _finite(check.value),
            "low": _finite(check.bar.low), "high": _finite(check.bar.high),
            "input_low": inputs and inputs[0], "input_high": inputs and inputs[1],
            "scheme_2001": scheme and [_finite(value) for value in scheme],
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
    names = [[unnumbered(check["quantity"]) for check in each["checks"]] for each in (ours, known)]
    if names[0] != names[1]:
        return [*told, f"{id}: other quantities than recorded"]
    return told + [line for pair in zip(ours["checks"], known["checks"]) for line in _of_check(id, *pair)]


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
