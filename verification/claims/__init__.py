"""Every claim of the paper, judged by computed numbers: `make claims`, or `python -m verification.claims [C07 ...]`.

A claim is a function without arguments that computes a `Finding`: our numbers against the paper's. A number that the
paper prints is an interval, half a unit of its last digit to both sides; words become a range with its origin and the
date when it was set. Each number has three widths: printing, numerics (a bar from several levels, see `levels`), and
inputs, because Table 1 is rounded too (`verification.sensitivity`).

Claims about **the model** are judged with a converged solution; the range of the paper's own scheme stands beside it.
Claims about **the scheme** are judged with the scheme. A verdict follows from the outcomes of the checks alone:

    all hold                                                                 reproduced
    all hold, something was changed against the paper                        reproduced with a stated change
    some fail beyond their bars, but one set of inputs within the rounding
    of Table 1 gives every printed number of base at once                    reproduced within the rounding of Table 1
    some fail beyond their bars                                              contradicted; the finding says why
    no check fails, but a bar reaches over a bound                           undecided
    no value could contradict the statement; the claim says why              not judged

If the paper says that something may or could happen, the claim holds if it happens in at least one of the scenes that
are tried. If the paper says that it depends on the conditions, it must also not happen in another scene.

A definition carries the date when it was written, which is before its first value. If the definition of a claim changes
after its values are known, its other definitions stay in `other_definitions.json` with their outcomes, and the claim
counts with the verdict of its first definition.

`rests_on` says what a number depends on: the prediction of a solution, or an input, a rule of construction or the
arithmetic of Table 1. The last three need no solution and do not count as reproduced numbers.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from decimal import Decimal
from math import inf, isfinite, isnan

from verification import sensitivity
from verification.claims.levels import (
    ALONE,
    BESIDE,
    CONVERGED,
    FINE,
    SCHEME,
    SIZES,
    STEPS,
    WIDE_FINE,
    Level,
)
from verification.evidence.checks import Check
from verification.uncertainty import Bar

#: The rows that must be judged.
EXPECTED = tuple(f"C{number:02d}" for number in (*range(1, 54), *range(60, 66)))

REPRODUCED = "reproduced"
CHANGED = "reproduced with a stated change"
CONTRADICTED = "contradicted"
WITHIN_ROUNDING, UNDECIDED = "reproduced within the rounding of Table 1", "undecided"
NOT_JUDGED = "not judged"
VERDICTS = (REPRODUCED, WITHIN_ROUNDING, CHANGED, CONTRADICTED, UNDECIDED, NOT_JUDGED)
#: Outcomes of a check.
HOLDS = "holds"
FAILS = "fails"
REACHES_OVER = "reaches over"
#: The subject of a claim.
MODEL = "the model"
OF_SCHEME = "the scheme"
CLOSED = "closed forms"
#: The basis of a number.
PREDICTED = "a solution"
ARITHMETIC = "arithmetic of Table 1"
CONSTRUCTION = "a rule of construction"
#: Dates: when the ranges of the words were set; when the ranges of later claims were set, and the printed digits became
#: the ranges of the numbers.
SET, LATER = "2026-11-21", "2026-11-22"
#: A value that the paper prints: 2.9, or ~60.
PRINTED = re.compile(r"~?\d+(\.\d+)?")
DIGITS = "half a unit of the last digit printed"
#: The accuracy that the paper states of its own numbers. Section 4: mass balance "is generally satisfied within a few
#: percentage points, which was deemed satisfactory considering numerical inaccuracies from time and spatial
#: discretization"; errors "of the order of a few percent" are "less than the error due to discretization". A few is
#: taken as up to five.
FEW, FEW_WORDS = 0.05, "a few percent: up to five"
#: Section 3.3.2: the transient, to 0.1 %.
TRANSPORT, TRANSPORT_WORDS = 0.001, "0.1 %, the paper's accuracy of transport"


class ClaimError(RuntimeError):
    """A claim has no verdict: it has no check, a number is NaN or has no bar, or a failure has no reason."""


def interval(text: str) -> tuple[float, float] | None:
    """The interval of a printed number: 1.5 is 1.45 to 1.55. After a ~ trailing zeros are no digits: ~60 is 55 to 65.
    None for words."""
    if not PRINTED.fullmatch(text):
        return None
    value = Decimal(text.removeprefix("~"))
    digits = value.normalize() if text.startswith("~") else value
    half = 0.5 * 10.0 ** int(digits.as_tuple().exponent)
    return float(value) - half, float(value) + half


def outcome_of(bar: tuple[float, float], bounds: tuple[float, float]) -> str:
    """HOLDS if the whole bar lies between the bounds, FAILS if all of it lies outside, else REACHES_OVER."""
    (first, last), (low, high) = bar, bounds
    return HOLDS if low <= first and last <= high else FAILS if last < low or high < first else REACHES_OVER


def verdict_of(outcomes: set[str], changed: bool, rounding: bool) -> str:
    """The verdict from the outcomes of all checks. changed: whether the claim differs from the paper's statement;
    rounding: whether one set of inputs within the rounding gives all printed numbers."""
    if outcomes == {HOLDS}:
        return CHANGED if changed else REPRODUCED
    if FAILS not in outcomes:
        return UNDECIDED
    return WITHIN_ROUNDING if rounding else CONTRADICTED


@dataclass(frozen=True)
class PaperCheck(Check):
    """A check of a number against the paper's number.

    paper: the paper's text, "2.9"; date: when the accepted range was set, by default the date of the claim; converges:
    whether the number has a limit as mesh and step are refined; rests_on: the basis of the number; input: its name in
    the record of the sensitivities; bar: the interval of the number, None before it is known; if the run ended before
    the number was reached, the bar has no upper end, and the value is the end of the run; holds_at: for a number
    without a limit, whether it holds at each level; scheme: smallest and largest value with the scheme of 2001, None
    if it is not computed; on_sizes: for a claim about the model, the values on the sizes of the converged solution,
    the judged one first.
    """

    paper: str
    date: str = ""
    converges: bool = True
    rests_on: str = PREDICTED
    input: str = ""
    within: tuple[float, float] | None = None
    bar: Bar | None = None
    holds_at: tuple[bool, ...] = ()
    scheme: tuple[float, float] | None = None
    on_sizes: tuple[float, ...] = ()

    @property
    def holds(self) -> bool:
        """Whether the number lies in its interval. If its bar has no upper end, it never lies under an upper bound."""
        return super().holds and not (self.is_lower_bound and isfinite(self.high))

    @property
    def is_lower_bound(self) -> bool:
        """Whether the value is only a lower bound, because the run ended before the number was reached."""
        return self.bar is not None and self.bar.high == inf

    @property
    def printed(self) -> tuple[float, float] | None:
        """The interval of the printed value; None if the paper prints words or a bound."""
        return interval(self.paper)

    @property
    def inputs(self) -> tuple[float, float] | None:
        """The range of the number as the inputs of Table 1 vary within their rounding; None if it is not known."""
        return self.within or sensitivity.interval(self.input, self.value)

    @property
    def outcome(self) -> str:
        """The outcome of the whole bar: HOLDS, FAILS or REACHES_OVER. Raises ClaimError without a bar or a number."""
        if isnan(self.value):
            raise ClaimError(f"{self.quantity}: not a number")
        if self.bar is None:
            raise ClaimError(f"{self.quantity}: no error bar")
        if self.converges:
            return outcome_of((self.bar.low, self.bar.high), (self.low, self.high))
        return HOLDS if all(self.holds_at) else FAILS if not any(self.holds_at) else REACHES_OVER


@dataclass(frozen=True)
class Finding:
    """The result of a claim.

    change: the change against the paper, empty if there is none; reason: why a check fails or cannot be decided, used
    only then; rounding: the set of inputs within the rounding of Table 1 that gives all printed numbers of base at
    once, empty if no set does; note: further computed numbers, or a function that computes them at the judged level
    alone, if they need runs or time of their own.
    """

    checks: tuple[PaperCheck, ...]
    change: str = ""
    reason: str = ""
    rounding: str = ""
    note: str | Callable[[], str] = ""

    @property
    def verdict(self) -> str:
        """The verdict from the checks and their bars. Raises ClaimError if there is none."""
        if not self.checks:
            raise ClaimError("the finding has no checks")
        outcomes = {check.outcome for check in self.checks}
        if outcomes != {HOLDS} and not self.reason:
            raise ClaimError("a check does not hold and no reason is given: " + self._failed())
        return verdict_of(outcomes, bool(self.change), bool(self.rounding))

    def with_note(self) -> Finding:
        """Return the finding with its note computed."""
        return replace(self, note=self.note() if callable(self.note) else self.note)

    def _failed(self) -> str:
        return "; ".join(f"{c.quantity} is {c.value:.4g}, accepted {c.low:.4g} to {c.high:.4g}"
                         for c in self.checks if c.outcome != HOLDS)


@dataclass(frozen=True)
class Claim:
    """A row of the table: the paper's section, its statement, and the function that computes the numbers.

    about: MODEL, OF_SCHEME or CLOSED; fine: sizes of the converged solution; beside: sizes of the scheme whose range is
    shown beside a number of the model; sizes, steps: those of a claim about the scheme; fixed: why sizes or steps are
    not varied; date: when its definition was written (UTC); unjudged: why no value could contradict it, empty if a
    value could.
    """

    id: str
    where: str
    text: str
    function: Callable[[], Finding]
    about: str = MODEL
    fine: tuple[float, ...] = FINE
    beside: tuple[float, ...] = BESIDE
    sizes: tuple[float, ...] = SIZES
    steps: tuple[float, ...] = STEPS
    fixed: str = ""
    date: str = SET
    unjudged: str = ""

    def verdict(self, finding: Finding) -> str:
        """The verdict of a finding. Raises ClaimError if there is none, or if a claim that is not judged has checks."""
        if self.unjudged and finding.checks:
            raise ClaimError("a claim that is not judged has checks")
        return NOT_JUDGED if self.unjudged else finding.verdict

    @property
    def of_wide(self) -> bool:
        """Whether the claim is about wide, which has sizes of its own."""
        return self.fine == WIDE_FINE

    @property
    def meshes(self) -> dict[float, Level]:
        """{element size: level} of the levels that give the bars."""
        sizes = {MODEL: self.fine, OF_SCHEME: self.sizes, CLOSED: ALONE}[self.about]
        return {size: Level(CONVERGED if self.about == MODEL else SCHEME, size) for size in sizes}

    @property
    def stepped(self) -> dict[float, Level]:
        """{step: level} of the levels that give the bars of a claim about the scheme."""
        return {step: Level(step=step) for step in self.steps if self.about == OF_SCHEME}

    @property
    def judging_levels(self) -> tuple[Level, ...]:
        """The levels of meshes and steps, the judged one first; only the judged one if no number needs a bar."""
        levels = tuple(dict.fromkeys((*self.meshes.values(), *self.stepped.values())))
        return levels[:1] if self.unjudged else levels

    @property
    def levels(self) -> tuple[Level, ...]:
        """All levels; a claim about the model adds those of the scheme."""
        beside = self.about == MODEL and not self.unjudged
        return (*self.judging_levels, *(Level(size=size) for size in self.beside if beside))

    @property
    def judged(self) -> Level:
        """The level that gives the number of the claim."""
        return self.judging_levels[0]


CLAIMS: dict[str, Claim] = {}


def claim(id: str, where: str, text: str, **fields):
    """Register the decorated function () -> Finding as the judge of a claim; fields: further fields of `Claim`."""
    def register(function: Callable[[], Finding]) -> Callable[[], Finding]:
        CLAIMS[id] = Claim(id, where, text, function, **fields)
        return function
    return register


def printed(quantity: str, paper_text: str, computed: float, why: str = DIGITS, **fields) -> PaperCheck:
    """A number that the paper prints: it must lie in the interval of its digits. Raises ValueError for words."""
    accepted = interval(paper_text)
    if accepted is None:
        raise ValueError(f"{quantity}: {paper_text!r} is not a printed number")
    return between(quantity, paper_text, computed, *accepted, why, date=LATER, **fields)


def near(quantity: str, paper_text: str, computed: float, target: float, tolerance: float, why: str, **fields
         ) -> PaperCheck:
    """A number that must lie within a tolerance of its target."""
    return between(quantity, paper_text, computed, target - tolerance, target + tolerance, why, **fields)


def at_most(quantity: str, paper_text: str, computed: float, bound: float, why: str, **fields) -> PaperCheck:
    """A number that must not exceed a bound."""
    return between(quantity, paper_text, computed, -inf, bound, why, **fields)


def at_least(quantity: str, paper_text: str, computed: float, bound: float, why: str, **fields) -> PaperCheck:
    """A number that must not be under a bound."""
    return between(quantity, paper_text, computed, bound, inf, why, **fields)


def between(quantity: str, paper_text: str, computed: float, low: float, high: float, why: str, **fields) -> PaperCheck:
    """A number that must lie in a range."""
    return PaperCheck(quantity, float(computed), low, high, why, paper_text, **fields)


def without_limit(check: PaperCheck) -> PaperCheck:
    """A count, or a number that has no limit as mesh and step are refined. Its bar extends from the least to the
    largest value of all levels, and it holds if it holds at every level."""
    return replace(check, converges=False)
