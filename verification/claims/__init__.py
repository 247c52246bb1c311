"""Every claim of the paper, judged by computed numbers: `make claims`, or `python -m verification.claims [C07 ...]`.

A claim is a function without arguments that computes a `Finding`: numbers of ours against the paper's, each with the
range that is accepted and where that range comes from. The verdict follows from them and is written down nowhere:

    all checks hold                              reproduced
    all hold, something was changed              reproduced with a stated change
    a check fails, and the finding says why      contradicted

A failed check without a reason is an error, as is a claim that nobody computes. The modules of this package register
their claims by the decorator `claim`; `python -m verification.claims` imports them all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, isfinite, isnan

#: The rows that must be judged.
EXPECTED = tuple(f"C{number:02d}" for number in range(1, 38))

REPRODUCED, CHANGED, CONTRADICTED = "reproduced", "reproduced with a stated change", "contradicted"


class ClaimError(RuntimeError):
    """A claim has no verdict: nothing was checked, a number is not one, or a failure has no reason."""


@dataclass(frozen=True)
class Check:
    """One computed number against the paper's.

    quantity: "mean velocity at t = 0 (m/d)"; paper: what the paper prints, as text: "2.9"; ours: computed by this run;
    low, high: the accepted range, infinite where it is one-sided; why: where that range comes from; target: the
    number to be near to, None for a mere range.
    """

    quantity: str
    paper: str
    ours: float
    low: float
    high: float
    why: str
    target: float | None = None

    @property
    def holds(self) -> bool:
        """Is the number in the accepted range? Not-a-number never is."""
        return bool(self.low <= self.ours <= self.high)

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


@dataclass(frozen=True)
class Finding:
    """What a claim came to.

    change: what had to be changed against the paper, empty if nothing; reason: used only where a check fails: why the
    paper's statement does not reproduce; note: further computed numbers worth telling.
    """

    checks: tuple[Check, ...]
    change: str = ""
    reason: str = ""
    note: str = ""

    @property
    def verdict(self) -> str:
        """One of three; raises ClaimError where there is none."""
        if not self.checks:
            raise ClaimError("nothing is checked")
        for check in self.checks:
            if isnan(check.ours):
                raise ClaimError(f"{check.quantity}: not a number")
        if not all(check.holds for check in self.checks):
            if not self.reason:
                raise ClaimError("a check fails and no reason is given: " + self._failed())
            return CONTRADICTED
        return CHANGED if self.change else REPRODUCED

    def _failed(self) -> str:
        return "; ".join(f"{c.quantity} is {c.ours:.4g}, accepted {c.accepted}" for c in self.checks if not c.holds)


@dataclass(frozen=True)
class Claim:
    """A row of the table: the paper's section, what it says, how to compute it, and the function that does.

    scenes: those that the function runs, as ("base", 'growth.end="5 h"', ...); the driver computes them beforehand,
    those of all claims side by side.
    """

    id: str
    where: str
    text: str
    command: str
    function: Callable[[], Finding]
    scenes: tuple[tuple[str, ...], ...] = ()


CLAIMS: dict[str, Claim] = {}


def claim(id: str, where: str, text: str, command: str, scenes: tuple[tuple[str, ...], ...] = ()):
    """Register the decorated function () -> Finding as the judge of a claim."""
    def register(function: Callable[[], Finding]) -> Callable[[], Finding]:
        if id in CLAIMS:
            raise ValueError(f"{id} is registered twice: {CLAIMS[id].function.__module__}, {function.__module__}")
        CLAIMS[id] = Claim(id, where, text, command, function, scenes)
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
