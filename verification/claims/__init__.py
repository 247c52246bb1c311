"""Every claim of the paper, judged by computed numbers: `make claims`, or `python -m verification.claims [C07 ...]`.

A claim is a function without arguments that computes a `Finding`: our numbers against the paper's. A number that the
paper prints is an interval, half a unit of its last digit to both sides; words become a range with its origin and the
date when it was set. Each number has three widths: printing, numerics (a bar from several levels, see `levels`), and
inputs, because Table 1 is rounded too (`verification.sensitivity`).

Claims about **the model** are judged with a converged solution; the range of the paper's own scheme stands beside it.
Claims about **the scheme** are judged with the scheme. Words have several meanings (`meanings`). Each gives a verdict,
which follows from the outcomes of the checks alone:

    all hold                                                                 reproduced
    all hold, something was changed against the paper                        reproduced with a stated change
    some fail beyond their bars, but one set of inputs within the rounding
    of Table 1 gives every printed number of base at once                    reproduced within the rounding of Table 1
    some fail beyond their bars                                              contradicted; the finding says why
    no check fails, but a bar reaches over a bound                           undecided

and the claim has

    the verdict of its meanings                                              if all of them give the same
    a matter of degree                                                       if they differ; the numbers say of which
    depends on what the paper does not print                                 if it holds in a part of the range tried
    not judged                                                               if no value could contradict it

Each worded bound has the threshold at which its outcome flips, computed from the bars (`report.flips`). If the paper
says that something may, could or can happen, one scene with a measured effect is enough, and its absence in another
scene contradicts nothing.

A definition carries the date when it was written, which is before its first value. If the definition of a claim changes
after its values are known, its other definitions stay in `other_definitions.json` with their outcomes. Every verdict
that a claim ever had stays in its row of the record.

`rests_on` says what a number depends on: the prediction of a solution, or a rule of construction, the arithmetic of
Table 1, or another value that the paper prints. The last three do not count as reproduced numbers.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
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
from verification.sensitivity import Dependence
from verification.uncertainty import Bar

#: The rows that must be judged.
EXPECTED = tuple(f"C{number:02d}" for number in (*range(1, 55), *range(60, 66)) if number != 62)

REPRODUCED = "reproduced"
CHANGED = "reproduced with a stated change"
CONTRADICTED = "contradicted"
WITHIN_ROUNDING, UNDECIDED = "reproduced within the rounding of Table 1", "undecided"
DEGREE, DEPENDS = "a matter of degree", "depends on what the paper does not print"
NOT_JUDGED = "not judged"
VERDICTS = (REPRODUCED, WITHIN_ROUNDING, CHANGED, DEGREE, DEPENDS, CONTRADICTED, UNDECIDED, NOT_JUDGED)
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
REPEATED = "another printed value"
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


def common_verdict(verdicts: Iterable[str], depends: bool) -> str:
    """The verdict of a claim from those of its meanings; depends: whether the claim holds in a part of a range that the
    paper does not print."""
    first, *others = verdicts
    if depends:
        return DEPENDS
    return first if all(other == first for other in others) else DEGREE


@dataclass(frozen=True)
class Meaning:
    """What the words of a claim may be taken for.

    words: the meaning; origin: where it comes from; judges: the beginnings of the quantities that it judges, all by
    default; bounds: {beginning of a quantity: (least, largest) accepted value}, where they differ from those of the
    check.
    """

    words: str
    origin: str
    judges: tuple[str, ...] = ("",)
    bounds: dict[str, tuple[float, float]] = field(default_factory=dict)

    def bounds_of(self, quantity: str, own: tuple[float, float]) -> tuple[float, float] | None:
        """The accepted interval of a quantity, or None if this meaning does not judge it."""
        if not quantity.startswith(self.judges):
            return None
        return next((bounds for name, bounds in self.bounds.items() if quantity.startswith(name)), own)

    def verdict(self, numbers: Iterable[tuple], changed: bool, rounding: bool) -> str:
        """The verdict from (quantity, bar, own bounds) of all checks. Raises ClaimError if it judges none, or if a name
        of a bound is no quantity's."""
        rows = [(quantity, bar, self.bounds_of(quantity, own)) for quantity, bar, own in numbers]
        names = [name for name in self.bounds if not any(quantity.startswith(name) for quantity, *_ in rows)]
        outcomes = {outcome_of(bar, bounds) for _, bar, bounds in rows if bounds}
        if names or not outcomes:
            raise ClaimError(f"{self.words}: no quantity has the name {', '.join(names) or self.judges}")
        return verdict_of(outcomes, changed, rounding)


#: The meaning of a claim without words of degree: its own bounds.
AS_STATED = Meaning("as stated", "the bounds of its numbers")


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
    alone, if they need runs or time of their own; dependence: the range of an input that the paper does not print, or
    a function that computes it, like the note.
    """

    checks: tuple[PaperCheck, ...]
    change: str = ""
    reason: str = ""
    rounding: str = ""
    note: str | Callable[[], str] = ""
    dependence: Dependence | Callable[[], Dependence] | None = None

    def verdicts(self, meanings: tuple[Meaning, ...] = (AS_STATED,)) -> tuple[str, ...]:
        """The verdict by each meaning, from the checks and their bars. Raises ClaimError if there is none."""
        if not self.checks:
            raise ClaimError("the finding has no checks")
        if {check.outcome for check in self.checks} != {HOLDS} and not self.reason:
            raise ClaimError("a check does not hold and no reason is given: " + self._failed())
        numbers = [(check.quantity, (check.bar.low, check.bar.high), (check.low, check.high)) for check in self.checks]
        return tuple(meaning.verdict(numbers, bool(self.change), bool(self.rounding)) for meaning in meanings)

    def verdict(self, meanings: tuple[Meaning, ...] = (AS_STATED,)) -> str:
        """The verdict by all meanings."""
        return common_verdict(self.verdicts(meanings), bool(self.dependence and self.dependence.splits))

    def with_note(self) -> Finding:
        """Return the finding with its note and its dependence computed."""
        return replace(self, note=self.note() if callable(self.note) else self.note,
                       dependence=self.dependence() if callable(self.dependence) else self.dependence)

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
        return NOT_JUDGED if self.unjudged else finding.verdict(self.meanings)

    @property
    def meanings(self) -> tuple[Meaning, ...]:
        """The meanings of its words."""
        return MEANINGS.get(self.id, (AS_STATED,))

    @property
    def defined(self) -> str:
        """When its numbers and the meanings of its words were written, the later of both."""
        return max(self.date, WRITTEN) if self.id in MEANINGS else self.date

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
#: The meanings of the words of claims, by id, and when they were written; `meanings` fills them in.
MEANINGS: dict[str, tuple[Meaning, ...]] = {}
#: Meanings that were taken back after their values were known, by id, with the reason.
TAKEN_BACK: dict[str, str] = {}
WRITTEN = "2026-11-29 16:48"


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
