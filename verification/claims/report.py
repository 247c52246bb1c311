"""The report of the claims on the terminal, with its counts.

The committed record of the claims, `claims.json`: intervals and verdicts that a run on any machine must agree with.

An entry has the date of its definition, `defined`, and the time of the first value that was recorded for it,
`first_value`. `meanings` are the meanings of its words with their verdicts, `flips` the thresholds at which the worded
bounds flip, and `dependence` says with which values of an input that the paper does not print the claim holds.
`taken_back` is a meaning that was taken back after its value was known. `former` are all verdicts that the claim had
before: when a verdict changes, `--record` adds the last one. `other_definitions` are earlier definitions of the claim,
with their outcomes and the reason why they were replaced.

A check's `value` lies in `low` to `high` (numerics), the paper's in `paper_low` to `paper_high` (printing, null for
words), and `input_low` to `input_high` is its range as the inputs of Table 1 move within their rounding (from the
committed record of the sensitivities or a closed form; null if neither has it). `scheme_2001` is the range that the
paper's scheme gives on one to three meshes, for a claim about the scheme that of all its levels. `on_sizes` are the
values on the sizes of the converged solution, the judged one first, and `order` is the order observed on them, or on
the meshes of the scheme; null if no order fits. If the run ended before a number was reached, `value` is the end of the
run, a lower bound: `high` is null, an open end, and so is `scheme_2001`.
"""

import textwrap
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from math import inf, isfinite
from pathlib import Path

from verification.claims import (
    AS_STATED,
    DEPENDS,
    FAILS,
    HOLDS,
    NOT_JUDGED,
    OF_SCHEME,
    PREDICTED,
    REACHES_OVER,
    TAKEN_BACK,
    VERDICTS,
    Claim,
    ClaimError,
    Finding,
    PaperCheck,
    common_verdict,
)
from verification.claims.evaluate import unnumbered
from verification.evidence.writing import load

LEGEND = ("paper: as printed. ours: the converged solution, or the scheme if the claim is about the scheme. numerics: "
          "the error bar; inputs: the range of the number as the inputs of Table 1 vary within their rounding; scheme "
          "of 2001: its range on one to three meshes. accepted: the interval of the printed digits, or the range that "
          "the words stand for. An outcome is that of the whole bar.\n")
INDEPENDENCE = "Mesh and time-step independence of base in the paper's scheme"


@dataclass(frozen=True)
class Row:
    """A judged claim: its finding and verdict, or the error that prevents a verdict."""

    id: str
    claim: Claim | None
    finding: Finding | None
    verdict: str
    error: str = ""

    @property
    def checks(self) -> tuple[PaperCheck, ...]:
        """The checks that have a bar: none if the claim failed with an error."""
        return tuple(check for check in self.finding.checks if check.bar) if self.finding else ()

    @property
    def reason(self) -> str:
        """Why a check does not hold, or the claim is not judged; empty where all checks hold."""
        if self.verdict == NOT_JUDGED:
            return self.claim.unjudged
        if self.finding and any(check.outcome != HOLDS for check in self.checks):
            return self.finding.reason
        return self.finding.dependence.text if self.verdict == DEPENDS else ""


def terminal_independence(checks: tuple[PaperCheck, ...]) -> str:
    """A line for each check with its bound."""
    lines = (f"     {c.quantity}: {c.value:.4g}, bound {c.paper}" for c in checks)
    return "\n".join([INDEPENDENCE, *lines]) + "\n"


def interval_text(pair: tuple[float, float] | None) -> str:
    """An interval in words; empty where there is none."""
    if pair is None:
        return ""
    low, high = pair
    if isfinite(low) and isfinite(high):
        return f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"
    return f"at least {low:.4g}" if isfinite(low) else f"at most {high:.4g}"


def value_text(value: float, high: float | None) -> str:
    """A number as text; or its lower bound, if the run ended before the number was reached. high: upper end of its
    bar."""
    return f"not reached by {value:.4g}" if high in (None, inf) else f"{value:.4g}"


def check_text(check: PaperCheck) -> str:
    """A check with its widths."""
    widths = {"numerics": (check.bar.low, check.bar.high), "inputs": check.inputs, "scheme of 2001": check.scheme,
              "accepted": (check.low, check.high)}
    words = (f"{name} {interval_text(pair)}" for name, pair in widths.items() if pair)
    ours = value_text(check.value, check.bar.high)
    return "; ".join([f"{check.quantity}: paper {check.paper}; ours {ours}", *words, check.outcome])


def _paragraph(text: str, indent: str = "     ") -> str:
    return textwrap.fill(text, 120, initial_indent=indent, subsequent_indent="       ")


def terminal(row: Row) -> str:
    """Describe a claim: its checks, its change, the reason of a failure, the sizes or steps that are not varied, and
    its note."""
    if row.claim is None:
        return f"{row.id}  {row.verdict.upper()}: {row.error}\n"
    remarks = {"error": row.error, "command": f"python -m verification.claims {row.id}"}
    if row.checks or row.verdict == NOT_JUDGED:
        finding = row.finding
        known = entry(row)
        remarks = {"about": row.claim.about, "meanings": "; ".join(map(meaning_text, known["meanings"])),
                   "flips": "; ".join(map(flip_text, known["flips"])), "depends": known["dependence"],
                   "changed": finding.change, "because": row.reason,
                   "inputs": finding.rounding, "steps are not varied": row.claim.fixed, "note": finding.note, **remarks}
    lines = [*map(check_text, row.checks), *(f"{name}: {text}" for name, text in remarks.items() if text)]
    head = _paragraph(f"{row.id}  {row.verdict.upper()}: {row.claim.text} (paper: {row.claim.where})", "")
    return "\n".join([head, *map(_paragraph, lines)]) + "\n"


@cache
def other_definitions() -> dict[str, list[dict]]:
    """{id: the definitions that a claim had before or after the one that is computed}, with their outcomes."""
    return load(OTHERS, {})


def former_text(entry: dict) -> str:
    """The verdicts that a recorded claim had before, with the dates of their definitions, the first one first."""
    return "; ".join(f"{each['verdict']} ({each['defined']})" for each in entry["former"])


def meaning_text(meaning: dict) -> str:
    """A meaning with its origin and its verdict."""
    return f"{meaning['words']} [{meaning['origin']}]: {meaning['verdict']}"


def flips(checks: list[dict]) -> list[dict]:
    """The thresholds of the worded bounds of recorded checks: the checks with the same words and origin, bound on the
    same side, hold together with bounds from ``holds`` on, and one of them fails with bounds beyond ``fails``. Numbers
    that are round-off have no threshold."""
    found = []
    groups: dict[tuple[str, str, str], list[tuple[float, float]]] = {}
    for check in checks:
        if side := _side(check):
            groups.setdefault((check["paper"], side, check["tolerance"]["origin"]), []).append(ends(check))
    for (words, side, _), bars in groups.items():
        lows, highs = zip(*bars)
        least = {"at most": (max(highs), max(lows)), "at least": (min(lows), min(highs))}[side]
        if max(map(abs, least)) < ROUND_OFF:
            continue
        found.append({"words": words, "bound": side, "holds": _finite(least[0]), "fails": _finite(least[1])})
    return found


def _side(check: dict) -> str:
    """The side of a worded bound; empty for a printed number, or for a range."""
    low, high = ends(check["tolerance"])
    if check["paper_low"] is not None or isfinite(low) == isfinite(high):
        return ""
    return "at least" if isfinite(low) else "at most"


def flip_text(flip: dict) -> str:
    """A threshold in words."""
    beyond = "under" if flip["bound"] == "at most" else "over"
    values = {name: "an open bound" if flip[name] is None else f"{flip[name]:.3g}" for name in ("holds", "fails")}
    return f"\"{flip['words']}\" as {flip['bound']} {values['holds']} holds, and fails {beyond} {values['fails']}"


def distinct(entries: list[dict]) -> dict[tuple[str, str], str]:
    """{(claim, printed text): outcome} of the distinct values that the paper prints and a solution predicts. A value
    that several checks of a claim judge counts once: it holds if all of them hold, and fails if one fails."""
    outcomes: dict[tuple[str, str], set[str]] = {}
    for entry in entries:
        for check in entry["checks"]:
            if check["paper_low"] is not None and check["rests_on"] == PREDICTED:
                outcomes.setdefault((entry["id"], check["paper"]), set()).add(check["outcome"])
    return {key: min(kinds, key=(FAILS, REACHES_OVER, HOLDS).index) for key, kinds in outcomes.items()}


def summary(rows: list[Row]) -> str:
    """Count the claims with each verdict, and their numbers with each outcome."""
    verdicts = Counter(row.verdict for row in rows)
    checks = [check for row in rows for check in row.checks]
    outcomes = Counter(check.outcome for check in checks)
    values = Counter(distinct([entry(row) for row in rows if row.checks]).values())
    named = [*VERDICTS, *(verdict for verdict in verdicts if verdict not in VERDICTS)]
    tally = "; ".join(f"{verdicts[verdict]} {verdict}" for verdict in named)
    return "\n".join((
        f"{len(rows)} claims: {tally}.",
        f"{len(checks)} numbers with their bars: {outcomes[HOLDS]} hold, {outcomes[FAILS]} fail, the bar of "
        f"{outcomes[REACHES_OVER]} reaches over a bound.",
        f"{values.total()} distinct printed values that a solution predicts: {values[HOLDS]} within their printed "
        f"digits, {values[FAILS]} outside, {values[REACHES_OVER]} not decided. Inputs, rules of construction and "
        "arithmetic of Table 1 are not among them."))


#: Since when a definition must be dated before its first value; some older ones were written with their values.
RULE_SINCE = "2026-11-24"
COMMITTED, OTHERS = (Path(__file__).parent / name for name in ("claims.json", "other_definitions.json"))
#: Numbers this small are the round-off of exact ones, which differs between machines; so do last digits.
ROUND_OFF, LAST_DIGITS = 1e-9, 1e-9


def read() -> list[dict]:
    """The committed record; empty if there is none yet."""
    return load(COMMITTED, [])


def replaced(entries: list[dict]) -> list[dict]:
    """The record with the entries of some claims replaced, in order."""
    by_id = {entry["id"]: entry for entry in (*read(), *entries)}
    return [by_id[id] for id in sorted(by_id)]


def entry(row: Row) -> dict:
    """A judged claim as plain values."""
    claim, finding = row.claim, row.finding
    checks = [_check(check, claim.about) for check in row.checks]
    given = finding.verdicts(claim.meanings) if checks else ()
    return {"id": row.id, "claim": claim.text, "verdict": row.verdict, "where": claim.where, "about": claim.about,
            "change": finding.change, "reason": row.reason, "rounding": finding.rounding, "note": finding.note,
            "dependence": finding.dependence.text if finding.dependence else "", "fixed": claim.fixed,
            "depends": bool(finding.dependence and finding.dependence.splits),
            "taken_back": TAKEN_BACK.get(row.id, ""),
            "meanings": _meanings(claim, given), "flips": flips(checks), "defined": claim.defined, "first_value": "",
            "former": [], "other_definitions": other_definitions().get(row.id, []), "checks": checks}


def stamped(entry: dict, recorded: dict | None, now: str) -> dict:
    """The entry with the time of its first value: the recorded one while the definition is the same, else now (UTC);
    and with all former verdicts: a recorded verdict that changes, or that has a new definition, is one. Raises
    ClaimError for a definition that is not dated before its first value, or not after those of another one; for a new
    claim not after RULE_SINCE."""
    former = recorded["former"] if recorded else []
    same = recorded and _definition(entry) == _definition(recorded)
    if recorded and (not same or entry["verdict"] != recorded["verdict"]):
        former = [*former, {"verdict": recorded["verdict"], "defined": recorded["defined"]}]
    if same:
        return {**entry, "first_value": recorded["first_value"], "former": former}
    before = recorded["first_value"] if recorded else RULE_SINCE
    if not before < entry["defined"] < now:
        raise ClaimError(f"{entry['id']}: the definition is new, and {entry['defined']} is not between {before} and "
                         f"{now}: a definition is dated before its first value, and after those of another definition")
    return {**entry, "first_value": now, "former": former}


def _definition(entry: dict) -> tuple:
    """The date of a definition, its quantities, their printed values with the origins of the tolerances, and the
    meanings of its words."""
    tolerances = [(check["paper"], unnumbered(check["tolerance"]["origin"])) for check in entry["checks"]]
    meanings = [(meaning["words"], meaning["bounds"]) for meaning in entry.get("meanings", [])
                if meaning["words"] != AS_STATED.words]
    return entry["defined"], _quantities(entry), tolerances, meanings


def judged_again(recorded: dict, claim: Claim) -> dict:
    """A recorded claim with the verdict of the present meanings of its words, from its recorded numbers alone."""
    checks = recorded["checks"]
    numbers = [(check["quantity"], ends(check), ends(check["tolerance"])) for check in checks]
    words = bool(recorded["change"]), bool(recorded["rounding"])
    given = [meaning.verdict(numbers, *words) for meaning in claim.meanings] if checks else []
    depends = recorded.get("depends", False)
    sure = bool(checks) and all(check["outcome"] == HOLDS for check in checks)
    reason = (recorded["dependence"] if depends else "") if sure else recorded["reason"]
    return {**recorded, "reason": reason, "dependence": recorded.get("dependence", ""), "depends": depends,
            "taken_back": TAKEN_BACK.get(claim.id, ""), "defined": claim.defined,
            "meanings": _meanings(claim, given), "flips": flips(checks),
            "verdict": common_verdict(given, depends) if given else NOT_JUDGED}


def _meanings(claim: Claim, given: Iterable[str]) -> list[dict]:
    return [{"words": meaning.words, "origin": meaning.origin, "judges": list(meaning.judges),
             "bounds": {name: [*map(_finite, bounds)] for name, bounds in meaning.bounds.items()},
             "verdict": verdict} for meaning, verdict in zip(claim.meanings, given)]


def _check(check: PaperCheck, about: str) -> dict:
    paper, inputs = check.printed or (None, None), check.inputs or (None, None)
    bar = check.bar
    scheme = (bar.low, bar.high) if about == OF_SCHEME else check.scheme
    return {"quantity": check.quantity, "rests_on": check.rests_on, "paper": check.paper,
            "paper_low": paper[0], "paper_high": paper[1], "value": _finite(check.value),
            "low": _finite(bar.low), "high": _finite(bar.high), "input_low": inputs[0], "input_high": inputs[1],
            "scheme_2001": scheme and [*map(_finite, scheme)], "on_sizes": [*map(_finite, check.on_sizes)],
            "order": _finite(bar.mesh.order) if bar.mesh else None,
            "tolerance": {"low": _finite(check.low), "high": _finite(check.high), "origin": check.origin,
                          "date": check.date}, "outcome": check.outcome}


def _finite(value: float) -> float | None:
    return value if isfinite(value) else None


def differences(entries: list[dict], committed: list[dict]) -> list[str]:
    """One line for each disagreement of claims with the record: another verdict or outcome, or a number outside its
    interval.
    """
    by_id = {entry["id"]: entry for entry in committed}
    return [f"{entry['id']}: {line}" for entry in entries for line in _of_claim(entry, by_id.get(entry["id"]))]


def _of_claim(entry: dict, recorded_entry: dict | None) -> Iterator[str]:
    if recorded_entry is None:
        yield "not in the record"
        return
    if entry["verdict"] != recorded_entry["verdict"]:
        yield f"{entry['verdict']}, recorded as {recorded_entry['verdict']}"
    if _quantities(entry) != _quantities(recorded_entry):
        yield "other quantities than recorded"
        return
    for computed, recorded in zip(entry["checks"], recorded_entry["checks"]):
        if not inside(computed["value"], recorded["low"], recorded["high"]):
            yield (f"{computed['quantity']} is {computed['value']:.6g}, "
                   f"recorded as {recorded['low']:.6g} to {recorded['high']:.6g}")
        if computed["outcome"] != recorded["outcome"]:
            yield f"{computed['quantity']} {computed['outcome']}, recorded: {recorded['outcome']}"


def _quantities(entry: dict) -> list[str]:
    return [unnumbered(check["quantity"]) for check in entry["checks"]]


def inside(value: float | None, low: float | None, high: float | None) -> bool:
    """Whether a value lies in a recorded interval, up to round-off. An open end is None."""
    if value is None:
        return low is None or high is None
    near = LAST_DIGITS * max(abs(end) for end in (low, high, 0.0) if end is not None) + ROUND_OFF
    return (low is None or low - near <= value) and (high is None or value <= high + near)


def ends(recorded: dict) -> tuple[float, float]:
    """The ends of a recorded interval, in which an open end is null."""
    return -inf if recorded["low"] is None else recorded["low"], inf if recorded["high"] is None else recorded["high"]
