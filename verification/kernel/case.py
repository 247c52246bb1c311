"""What a verification case is, and when it passes: the verdict is computed from its numbers and written down nowhere.

A case is a function that gives checks (a number in an accepted range) and studies (errors on at least four unrelated
meshes or steps; orders between neighbours, judged two-sidedly: one above its band fails like one below it, as a
surprise has to be explained before it is expected). It is called once for each of the variants (orders of elements,
presets, rows of its table) that it says it runs ``over``, and one that stops hides no other. It passes if it measures
something and all of it holds; an exception, a not-a-number or an empty outcome is a failure.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from itertools import product
from math import floor, inf, isfinite, log10
from pkgutil import iter_modules
from time import perf_counter
from typing import Self

import numpy as np

KINDS = ("exact", "manufactured", "cross-code", "property")
STAGES = ("flow", "transport", "growth", "reprojection", "mesh_motion", "coupling", "hard")
PASSES, FALLS_SHORT = "passes", "FALLS SHORT"
#: What a case may run with: elements of order 1, 2 and 3, and the presets of whole scenes.
WAYS = ("1", "2", "3", "paper", "fast", "accurate", "exact")
#: The way that a word of a label stands for, where it is not one itself.
OF_LABELS = {"linear": "1", "quadratic": "2", "cubic": "3", "order 1": "1", "order 2": "2", "order 3": "3",
             "straight": "1", "curved": "2", "of cubic scenes": "3"}
#: A tolerance under which a number is round-off: not told in what is committed, as every machine has its own.
ROUND_OFF = 1e-6


@dataclass(frozen=True)
class Quantity:
    """What is judged, in words."""

    quantity: str

    def labelled(self, label: str) -> Self:
        """The same of one variant of its case."""
        return replace(self, quantity=f"{self.quantity}, {label}") if label else self


@dataclass(frozen=True)
class Check(Quantity):
    """One number in its accepted range; ``origin`` says where that range comes from."""

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
    def told(self) -> str:
        """The number as another machine finds it too: to half of its tolerance, nothing where it is round-off."""
        return rounded(self.value, self._tolerance / 2) if self._tolerance >= ROUND_OFF else ""

    @property
    def _two_sided(self) -> bool:
        return isfinite(self.low) and isfinite(self.high) and self.low != 0

    @property
    def _tolerance(self) -> float:
        if self._two_sided:
            return (self.high - self.low) / 2
        return abs(self.high if isfinite(self.high) else self.low)

    @property
    def used(self) -> float:
        """How much of its tolerance it uses, 0 to 1, if it holds: of a size, or of a number that should not be below
        zero, the share of its bound."""
        if self._two_sided:
            return abs(self.value - self.low - self._tolerance) / self._tolerance
        bound = self.high if isfinite(self.high) else self.low
        return max(0.0, self.value / bound) if bound else 0.0

    @property
    def expected(self) -> str:
        """The accepted range in words."""
        return self._range(6)

    @property
    def accepted(self) -> str:
        """The same, of a range that a run has found, as another machine finds it too."""
        return self._range(3)

    def _range(self, digits: int) -> str:
        if self._two_sided:
            return f"{self.low:.{digits}g} to {self.high:.{digits}g}"
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


def each_at_most(values: Mapping[str, float], bound: float, origin: str, told: str = "") -> list[Check]:
    """Sizes by name that have one bound; told: what ends their names."""
    return [at_most(name + told, value, bound, origin) for name, value in values.items()]


def largest(values: np.ndarray) -> float:
    """The largest size of some numbers."""
    return float(np.abs(values).max())


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


FEWEST = 4
#: Half width of the band around an expected order: errors on unrelated meshes scatter by a tenth or two, which between
#: neighbours whose sizes differ by a factor of 2 is an order of 0.2 or 0.3.
BAND = 0.3


@dataclass(frozen=True, eq=False)
class Study(Quantity):
    """Errors (k,) on a series of sizes (k,), falling: orders between neighbours must lie from low to high.

    ceiling: the last error must not exceed it; origin: where the expected order comes from.
    """

    sizes: np.ndarray
    errors: np.ndarray
    low: float
    high: float
    origin: str
    ceiling: float = inf

    def __post_init__(self):
        if len(self.sizes) < FEWEST or len(self.sizes) != len(self.errors) or not (np.diff(self.sizes) < 0).all():
            raise ValueError(f"{self.quantity}: a study takes {FEWEST} or more falling sizes, and an error of each")

    @property
    def orders(self) -> np.ndarray:
        """(k - 1,) log of the ratio of errors over log of the ratio of sizes; infinite or not-a-number where an error
        is not positive and finite."""
        with np.errstate(all="ignore"):
            return np.diff(np.log(self.errors)) / np.diff(np.log(self.sizes))

    @property
    def holds(self) -> bool:
        """Are all orders in the band, and is the last error under its ceiling?"""
        orders = self.orders
        return bool(((self.low <= orders) & (orders <= self.high)).all() and self.errors[-1] <= self.ceiling)

    @property
    def measured(self) -> str:
        """Orders to a tenth, and the last error to one digit."""
        last = float(self.errors[-1])
        known = isfinite(self.ceiling)
        return f"{self.told}; last error {rounded(last, self.ceiling / 20) if known else f'{last:.0e}'}"

    @property
    def told(self) -> str:
        """Orders to a tenth: what another machine finds too."""
        return f"order {', '.join(f'{order:.1f}' for order in self.orders)}"

    @property
    def expected(self) -> str:
        """The band, and the ceiling where there is one."""
        band = f"order {self.low:.3g} to {self.high:.3g}"
        return band if self.ceiling == inf else f"{band}; at most {self.ceiling:.3g}"

    @property
    def accepted(self) -> str:
        """The same: no run has found it."""
        return self.expected


def around(order: float, band: float = BAND) -> tuple[float, float]:
    """The lowest and the highest order that are expected about one."""
    return order - band, order + band


def study(quantity: str, sizes, errors, order: float, origin: str, *, ceiling: float = inf,
          band: float = BAND) -> Study:
    """A study whose orders are expected within ``band`` of ``order``."""
    return Study(quantity, np.asarray(sizes, float), np.asarray(errors, float), *around(order, band), origin, ceiling)


def studies(errors: Mapping[str, np.ndarray], rows: Mapping[str, tuple], told: str = "") -> list[Study]:
    """Studies of some fields of what :func:`refine` gives, {field: (order, or the lowest and the highest; where it
    comes from; what the last error must not exceed)}; told: what ends their names."""
    bands = {name: row[0] if isinstance(row[0], tuple) else around(row[0]) for name, row in rows.items()}
    return [Study(name + told, errors["size"], errors[name], *bands[name], *row[1:]) for name, row in rows.items()]


def refine(measure: Callable[..., dict[str, float]], sizes: Iterable[float] | Mapping[float, int],
           *given) -> dict[str, np.ndarray]:
    """Errors (k,) of each field on each size: ``measure(size, *given)`` gives {field: error}.

    sizes: {size: how many unrelated meshes of it}: root mean squares of ``measure(size, number, *given)`` over these,
    with the "size" of each unless that is measured too.
    """
    if isinstance(sizes, Mapping):
        rows = [{"size": size, **_averaged(measure, size, count, given)} for size, count in sizes.items()]
    else:
        rows = [measure(size, *given) for size in sizes]
    return columns(rows)


def columns(rows: Sequence[Mapping[str, float]]) -> dict[str, np.ndarray]:
    """{name: (k,)} of rows {name: number}, all of the same names."""
    return dict(zip(rows[0], np.array([[*row.values()] for row in rows]).T))


def _averaged(measure: Callable, size: float, count: int, given: tuple) -> dict[str, float]:
    found = [measure(size, number, *given) for number in range(count)]
    return {name: float(np.sqrt(np.mean(values**2))) for name, values in columns(found).items()}


Line = tuple[str, str, str, bool]


class Note:
    """What a variant of a case keeps besides, for those who write of it: nothing judges it."""

    def labelled(self, label: str) -> Note:
        """It knows its variant."""
        return self

    def lines(self, every: Sequence) -> list[Line]:
        """What a page tells of a case with such notes, in the place of its numbers: as of an Outcome."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a case has measured: checks, studies and notes."""

    parts: tuple

    @property
    def measured(self) -> tuple:
        """All that must hold: studies first."""
        judged = (part for part in self.parts if isinstance(part, Quantity))
        return tuple(sorted(judged, key=lambda part: isinstance(part, Check)))

    @property
    def notes(self) -> tuple[Note, ...]:
        """What is kept besides."""
        return tuple(part for part in self.parts if isinstance(part, Note))

    def lines(self) -> list[Line]:
        """(quantity and what it is, expected, origin, holds) of each, as another machine finds them too."""
        if self.notes:
            return self.notes[0].lines(self.notes)
        return [(part.quantity + (f" ({part.told})" if part.told else ""), part.accepted, part.origin, part.holds)
                for part in self.measured]


def flat(found) -> Iterator:
    """What a function of a case gives, one by one: checks, studies and notes in any order, or lists of them."""
    if isinstance(found, Quantity | Note):
        yield found
    else:
        for part in found:
            yield from flat(part)


@dataclass(frozen=True)
class Case:
    """id: "flow-poiseuille"; claim: one sentence; norm: what is measured and how; mutants: ids of changes of code (see
    :mod:`verification.kernel.mutants`), each of which must make the case fall short; slow: left out by ``make
    verify-fast``; function: gives what is to be an Outcome; over: {label: arguments} of the variants
    that it is called for, none: once without arguments; ways: which of WAYS it runs with; because: why not others."""

    id: str
    stage: str
    claim: str
    kind: str
    norm: str
    mutants: tuple[str, ...]
    slow: bool
    function: Callable
    over: Mapping[str, tuple]
    ways: tuple[str, ...]
    because: str


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


def load() -> None:
    """Register the cases of every stage."""
    for stage in STAGES:
        package = import_module(f"verification.{stage}")
        for module in iter_modules(package.__path__):
            import_module(f"{package.__name__}.{module.name}")


def combined(*axes: Mapping[str, object]) -> dict[str, tuple]:
    """{label: arguments} of every combination of some axes {label: argument}: what a case may run ``over``."""
    rows = [zip(*chosen) for chosen in product(*map(dict.items, axes))]
    return {", ".join(labels): arguments for labels, arguments in rows}


def case(id: str, *, claim: str, kind: str, norm: str, mutants: tuple[str, ...], slow: bool = False,
         over: Iterable[str] | Mapping[str, tuple] = (), ways: str = "", because: str = ""):
    """Register the decorated function; the stage is the package of its module. over: {label: arguments}, or labels that
    are the arguments; ways: words of WAYS besides those that the labels stand for."""
    variants = dict(over) if isinstance(over, Mapping) else {label: (label,) for label in over}

    def register(function: Callable) -> Callable:
        if id in CASES or kind not in KINDS or not all((claim, norm, mutants)):
            raise ValueError(f"{id}: registered twice, of an unknown kind, or without claim, norm or mutants")
        CASES[id] = Case(id, function.__module__.split(".")[1], claim, kind, norm, mutants, slow, function, variants,
                         _ways(id, variants, ways), because)
        return function
    return register


def _ways(id: str, variants: Iterable[str], more: str) -> tuple[str, ...]:
    """Those of the labels, and more, in their order. Raises ValueError for a word that is none."""
    words = [word for label in variants for word in label.split(", ")]
    named = {OF_LABELS.get(word, word) for word in words} & {*WAYS} | {*more.split()}
    if not named <= {*WAYS}:
        raise ValueError(f"{id}: {', '.join(sorted(named - {*WAYS}))} are none of {', '.join(WAYS)}")
    return tuple(way for way in WAYS if way in named)


def run(chosen: Case) -> Result:
    """Run every variant of a case, whether others stop or not; floating-point errors raise."""
    start = perf_counter()
    found: list = []
    errors = ""
    for label, arguments in (chosen.over or {"": ()}).items():
        try:
            with np.errstate(all="raise", under="ignore"):
                found += [part.labelled(label) for part in flat(chosen.function(*arguments))]
        except Exception:
            errors += f"{label}{': ' * bool(label)}{traceback.format_exc(limit=-3)}"
    return Result(chosen.id, Outcome(tuple(found)), errors, perf_counter() - start)
