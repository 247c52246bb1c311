"""What a verification case is, and when it passes: the verdict is computed from its numbers and written down nowhere.

A case is a function without arguments that returns an :class:`Outcome`: checks (a number in an accepted range), studies
(errors on a series of meshes or steps, see :mod:`verification.convergence`) and profiles, which are drawn. It passes if
it measures something and all of it holds; an exception, a not-a-number or an empty outcome is a failure.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable
from dataclasses import dataclass
from math import floor, inf, isfinite, log10
from time import perf_counter

import numpy as np

KINDS = ("exact", "manufactured", "cross-code", "property")
STAGES = ("flow", "transport", "growth", "reprojection", "mesh_motion", "coupling", "hard")
PASSES, FALLS_SHORT = "passes", "FALLS SHORT"


@dataclass(frozen=True)
class Check:
    """One number in its accepted range; ``origin`` says where that range comes from."""

    quantity: str
    value: float
    low: float
    high: float
    origin: str

    @property
    def holds(self) -> bool:
        """Not-a-number never does."""
        return bool(self.low <= self.value <= self.high)

    @property
    def measured(self) -> str:
        """The number, rounded to a twentieth of its tolerance: stable from run to run."""
        return rounded(self.value, self._tolerance / 20)

    @property
    def _tolerance(self) -> float:
        if isfinite(self.low) and isfinite(self.high) and self.low != 0:
            return (self.high - self.low) / 2
        return abs(self.high if isfinite(self.high) else self.low)

    @property
    def expected(self) -> str:
        """The accepted range in words."""
        if isfinite(self.low) and isfinite(self.high) and self.low != 0:
            return f"{self.low:.6g} to {self.high:.6g}"
        return f"at most {self.high:.3g}" if isfinite(self.high) else f"at least {self.low:.3g}"


def at_most(quantity: str, value: float, bound: float, origin: str) -> Check:
    """A size, of an error for instance: from zero to a bound."""
    return Check(quantity, float(value), 0.0, bound, origin)


def at_least(quantity: str, value: float, bound: float, origin: str) -> Check:
    """A number that must not be under a bound."""
    return Check(quantity, float(value), bound, inf, origin)


def between(quantity: str, value: float, low: float, high: float, origin: str) -> Check:
    """A number that must lie in a range."""
    return Check(quantity, float(value), low, high, origin)


def rounded(value: float, quantum: float) -> str:
    """The value to the power of ten at or under ``quantum``; a size that vanishes there is told as "under" it."""
    if not isfinite(value) or quantum <= 0:
        return f"{value:.3g}"
    unit = 10.0 ** floor(log10(quantum))
    steps = round(value / unit)
    if steps == 0:
        return f"under {unit:.0e}"
    digits = max(0, floor(log10(abs(steps)))) + 1
    return f"{steps * unit:.{digits}g}"


@dataclass(frozen=True, eq=False)
class Profile:
    """Curves over one axis, for a picture: each (name, kind, x, y), kind "ours", "reference" or "exact"."""

    title: str
    x_label: str
    y_label: str
    curves: tuple[tuple[str, str, np.ndarray, np.ndarray], ...]


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a case has measured."""

    checks: tuple = ()
    studies: tuple = ()
    profiles: tuple[Profile, ...] = ()

    @property
    def measured(self) -> tuple:
        """All that must hold: studies first."""
        return (*self.studies, *self.checks)


@dataclass(frozen=True)
class Case:
    """id: "flow-poiseuille"; claim: one sentence; norm: what is measured and how; mutants: ids of changes of code (see
    :mod:`verification.mutants`), each of which must make the case fall short; slow: left out by ``make verify-fast``;
    function: () -> Outcome."""

    id: str
    stage: str
    claim: str
    kind: str
    norm: str
    mutants: tuple[str, ...]
    slow: bool
    function: Callable[[], Outcome]


@dataclass(frozen=True, eq=False)
class Result:
    """A case that has run: outcome, or the error that stopped it, and its seconds."""

    id: str
    outcome: Outcome
    error: str
    seconds: float

    @property
    def holds(self) -> bool:
        """Did it measure something, and does all of it hold?"""
        return not self.error and bool(self.outcome.measured) and all(part.holds for part in self.outcome.measured)

    @property
    def verdict(self) -> str:
        """One of two words."""
        return PASSES if self.holds else FALLS_SHORT


CASES: dict[str, Case] = {}


def case(id: str, *, claim: str, kind: str, norm: str, mutants: tuple[str, ...], slow: bool = False):
    """Register the decorated function () -> Outcome; the stage is the package of its module."""
    def register(function: Callable[[], Outcome]) -> Callable[[], Outcome]:
        if id in CASES or kind not in KINDS or not all((claim, norm, mutants)):
            raise ValueError(f"{id}: registered twice, of an unknown kind, or without claim, norm or mutants")
        CASES[id] = Case(id, function.__module__.split(".")[1], claim, kind, norm, mutants, slow, function)
        return function
    return register


def run(chosen: Case) -> Result:
    """Run one case; floating-point errors raise."""
    start = perf_counter()
    try:
        with np.errstate(all="raise", under="ignore"):
            outcome, error = chosen.function(), ""
    except Exception:
        outcome, error = Outcome(), traceback.format_exc(limit=-3)
    return Result(chosen.id, outcome, error, perf_counter() - start)
