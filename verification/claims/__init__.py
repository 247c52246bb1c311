"""Every claim of the paper, judged by computed numbers: `make claims`, or `python -m verification.claims [C07 ...]`.

A claim is a function without arguments that computes a `Finding`: numbers of ours against the paper's, each with the
range that is accepted and where that range comes from. It is computed on several meshes and with several time steps
(`levels`), and every number gets an error bar from them (`bars`). The verdict follows and is written down nowhere:

    all checks hold                              reproduced
    all hold, something was changed              reproduced with a stated change
    a check fails beyond its bar                 contradicted; the finding says why
    checks fail, none of them beyond its bar     undecided

Where a claim is reproduced, but a bar reaches over the bound of its range, the verdict says so. A failed check without
a reason is an error, as is a number without a bar, and a claim that nobody computes. The modules of this package
register their claims by the decorator `claim`; `python -m verification.claims` imports them all.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf, isfinite, isnan

from verification.claims.accuracy import FEW
from verification.claims.levels import DEFAULT, SIZES, STEPS, Level
from verification.uncertainty import Bar

#: The rows that must be judged.
EXPECTED = tuple(f"C{number:02d}" for number in range(1, 38))

REPRODUCED, CHANGED, CONTRADICTED = "reproduced", "reproduced with a stated change", "contradicted"
UNDECIDED = "undecided: it fails by less than a bar"
WITHIN_BAR = ", but a bar reaches over a bound"
#: What comes of a check, and where the paper's value is.
HOLDS, FAILS, REACHES_OVER = "holds", "FAILS", "bar reaches over"
INSIDE_BAR, INSIDE_FEW, NEITHER = "inside our bar", "inside a few percent", "neither"
#: A value that the paper prints: 2.9, or ~60.
PRINTED = re.compile(r"~?(\d+\.?\d*)")


class ClaimError(RuntimeError):
    """A claim has no verdict: nothing was checked, a number is not one or has no bar, or a failure has no reason."""


@dataclass(frozen=True)
class Check:
    """One computed number against the paper's.

    quantity: "mean velocity at t = 0 (m/d)"; paper: what the paper prints, as text: "2.9"; ours: computed by this run;
    low, high: the accepted range, infinite where it is one-sided; why: where that range comes from; target: the
    number to be near to, None for a mere range; converges: has the number a limit as mesh and step are refined?
    bar: where the number lies, None before it is known; held: for a number without a limit, whether it holds in the
    range of each level.
    """

    quantity: str
    paper: str
    ours: float
    low: float
    high: float
    why: str
    target: float | None = None
    converges: bool = True
    bar: Bar | None = None
    held: tuple[bool, ...] = ()

    @property
    def holds(self) -> bool:
        """Is the number, whatever its bar, in the accepted range? Not-a-number never is."""
        return bool(self.low <= self.ours <= self.high)

    @property
    def outcome(self) -> str:
        """HOLDS or FAILS with the whole bar, or REACHES_OVER. Raises ClaimError without a bar or a number."""
        if isnan(self.ours):
            raise ClaimError(f"{self.quantity}: not a number")
        if self.bar is None:
            raise ClaimError(f"{self.quantity}: no error bar")
        inside, outside = all(self.held), not any(self.held)
        if self.converges:
            inside = self.low <= self.bar.low and self.bar.high <= self.high
            outside = self.bar.high < self.low or self.high < self.bar.low
        return HOLDS if inside else FAILS if outside else REACHES_OVER

    @property
    def printed(self) -> float | None:
        """The value that the paper prints, None where it prints words or a bound."""
        found = PRINTED.fullmatch(self.paper)
        return float(found[1]) if found and isfinite(self.low) and isfinite(self.high) else None

    @property
    def against_paper(self) -> str:
        """Where the printed value is: in our bar, in the paper's own accuracy, or neither; empty if there is none."""
        if self.printed is None or self.bar is None:
            return ""
        if self.printed in self.bar:
            return INSIDE_BAR
        return INSIDE_FEW if abs(self.ours - self.printed) <= FEW * abs(self.printed) else NEITHER

    @property
    def deviation(self) -> str:
        """Of the number from its target, or from the range where there is none, in words."""
        if self.target is not None:
            apart = self.ours - self.target
            return f"{100 * apart / abs(self.target):+.2g} %" if self.target else f"{apart:+.2g}"
        if self.holds:
            return "within"
        bound = self.low if self.ours < self.low else self.high
        return f"{self.ours - bound:+.2g} beyond"

    @property
    def accepted(self) -> str:
        """The accepted range in words."""
        if isfinite(self.low) and isfinite(self.high):
            return f"{self.low:.4g} to {self.high:.4g}"
        return f"at least {self.low:.4g}" if isfinite(self.low) else f"at most {self.high:.4g}"


Words = str | Callable[[], str]


@dataclass(frozen=True)
class Finding:
    """What a claim came to.

    change: what had to be changed against the paper, empty if nothing; reason: used only where a check fails: why the
    paper's statement does not reproduce; note: further computed numbers worth telling. Words that take runs or time of
    their own are a function, which is called at the default level alone.
    """

    checks: tuple[Check, ...]
    change: Words = ""
    reason: Words = ""
    note: Words = ""

    @property
    def verdict(self) -> str:
        """What follows from the checks and their bars; raises ClaimError where nothing does."""
        if not self.checks:
            raise ClaimError("nothing is checked")
        outcomes = [check.outcome for check in self.checks]
        if not all(check.holds for check in self.checks):
            if not self.reason:
                raise ClaimError("a check fails and no reason is given: " + self._failed())
            return CONTRADICTED if FAILS in outcomes else UNDECIDED
        return (CHANGED if self.change else REPRODUCED) + (WITHIN_BAR if REACHES_OVER in outcomes else "")

    def told(self) -> Finding:
        """The same, with all words worked out."""
        words = {name: getattr(self, name) for name in ("change", "reason", "note")}
        return replace(self, **{name: text() if callable(text) else text for name, text in words.items()})

    def _failed(self) -> str:
        return "; ".join(f"{c.quantity} is {c.ours:.4g}, accepted {c.accepted}" for c in self.checks if not c.holds)


@dataclass(frozen=True)
class Claim:
    """A row of the table: the paper's section, what it says, how to compute it, and the function that does.

    scenes: those that the checks need, as ("base", 'growth.end="5 h"', ...), and words: those of which only the words
    tell; the driver computes them beforehand, those of all claims side by side. sizes, steps: the levels, the default
    first; fixed: why one of them is not varied.
    """

    id: str
    where: str
    text: str
    command: str
    function: Callable[[], Finding]
    scenes: tuple[tuple[str, ...], ...] = ()
    words: tuple[tuple[str, ...], ...] = ()
    sizes: tuple[float, ...] = SIZES
    steps: tuple[float, ...] = STEPS
    fixed: str = ""

    @property
    def levels(self) -> tuple[Level, ...]:
        """The levels beside the default."""
        chosen = (*(Level(size=size) for size in self.sizes), *(Level(step=step) for step in self.steps))
        return tuple(level for level in chosen if level != DEFAULT)


CLAIMS: dict[str, Claim] = {}


def claim(id: str, where: str, text: str, command: str, scenes: tuple[tuple[str, ...], ...] = (), **levels):
    """Register the decorated function () -> Finding as the judge of a claim; levels: further fields of `Claim`."""
    def register(function: Callable[[], Finding]) -> Callable[[], Finding]:
        if id in CLAIMS:
            raise ValueError(f"{id} is registered twice: {CLAIMS[id].function.__module__}, {function.__module__}")
        CLAIMS[id] = Claim(id, where, text, command, function, scenes, **levels)
        return function
    return register


def near(quantity: str, paper_text: str, ours: float, target: float, *, relative: float | None = None,
         absolute: float | None = None, why: str) -> Check:
    """A number within a relative or an absolute tolerance of its target."""
    if (relative is None) == (absolute is None):
        raise ValueError(f"{quantity}: a relative or an absolute tolerance is needed, one of them")
    apart = absolute if relative is None else relative * abs(target)
    return Check(quantity, paper_text, float(ours), target - apart, target + apart, why, target)


def at_most(quantity: str, paper_text: str, ours: float, bound: float, why: str) -> Check:
    """A number that must not exceed a bound."""
    return Check(quantity, paper_text, float(ours), -inf, bound, why)


def at_least(quantity: str, paper_text: str, ours: float, bound: float, why: str) -> Check:
    """A number that must not be under a bound."""
    return Check(quantity, paper_text, float(ours), bound, inf, why)


def between(quantity: str, paper_text: str, ours: float, low: float, high: float, why: str) -> Check:
    """A number that must lie in a range."""
    return Check(quantity, paper_text, float(ours), low, high, why)


def without_limit(check: Check) -> Check:
    """A count, or a number that belongs to its mesh or step: its bar goes from the least to the largest of all levels,
    and it holds where it does at every level."""
    return replace(check, converges=False)
