"""Checks and studies, which cases record. The verdict follows from the numbers alone.

A check is a number with the interval that it must lie in. A study is a series of errors on at least four unrelated
meshes or steps. Its orders between neighbours are judged on both sides, because an order above its band is as
unexpected as one below it. Each states the origin of its interval.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import floor, inf, isfinite, log10

import numpy as np

#: A number whose tolerance is smaller is round-off. It differs between machines, so the pages leave it out.
ROUND_OFF = 1e-6


@dataclass(frozen=True)
class Check:
    """One number, the interval that it must lie in, and the origin of that interval.

    Parameters
    ----------
    quantity : str
        Name of the number on the pages.
    value : float
        The number, in any unit.
    low, high : float
        The interval, in the unit of the number; either may be infinite.
    origin : str
        The reason for this interval.

    Examples
    --------
    >>> from verification.evidence.checks import Check
    >>> Check("porosity", 0.31, 0.30, 0.32, "two digits of the paper").holds
    True
    """

    quantity: str
    value: float
    low: float
    high: float
    origin: str

    @property
    def holds(self) -> bool:
        """Whether the number lies in its interval. Not-a-number never does."""
        return bool(self.low <= self.value <= self.high)

    @property
    def measured(self) -> str:
        """The number rounded to a twentieth of its tolerance, the same in every run."""
        return rounded(self.value, self.tolerance / 20)

    @property
    def reproducible(self) -> str:
        """The number rounded to half of its tolerance, the same on every machine; empty if it is round-off."""
        return rounded(self.value, self.tolerance / 2) if self.tolerance >= ROUND_OFF else ""

    @property
    def _two_sided(self) -> bool:
        return isfinite(self.low) and isfinite(self.high) and self.low != 0

    @property
    def tolerance(self) -> float:
        """Half the width of a two-sided interval, else the size of its bound."""
        if self._two_sided:
            return (self.high - self.low) / 2
        return abs(self.high if isfinite(self.high) else self.low)

    @property
    def used(self) -> float:
        """The share of the tolerance that the number uses, from 0 to 1 if it holds."""
        if self._two_sided:
            return abs(self.value - self.low - self.tolerance) / self.tolerance
        bound = self.high if isfinite(self.high) else self.low
        return max(0.0, self.value / bound) if bound else 0.0

    def interval(self, digits: int = 6) -> str:
        """Write the interval. Pages show 3 digits: some bounds are computed, and differ in the last ones."""
        if self._two_sided:
            return f"{self.low:.{digits}g} to {self.high:.{digits}g}"
        return f"at most {self.high:.3g}" if isfinite(self.high) else f"at least {self.low:.3g}"


def at_most(quantity: str, value: float, bound: float, origin: str) -> Check:
    """Check that a size, for instance of an error, lies between zero and a bound.

    Parameters
    ----------
    quantity : str
        Name of the size on the pages.
    value : float
        The size, in any unit.
    bound : float
        The largest accepted size, in the same unit.
    origin : str
        The reason for this bound.

    Returns
    -------
    Check
        The check, for ``record``. It does not hold for a negative number or NaN.

    Examples
    --------
    >>> from verification.evidence.checks import at_most
    >>> at_most("velocity", 2e-4, 1e-3, "a tenth of the error of the preset fast").holds
    True
    """
    return Check(quantity, float(value), 0.0, bound, origin)


def at_least(quantity: str, value: float, bound: float, origin: str) -> Check:
    """Check that a number is not under a bound.

    Parameters
    ----------
    quantity : str
        Name of the number on the pages.
    value : float
        The number, in any unit.
    bound : float
        The least accepted number, in the same unit.
    origin : str
        The reason for this bound.

    Returns
    -------
    Check
        The check, for ``record``. It does not hold for NaN.

    Examples
    --------
    >>> from verification.evidence.checks import at_least
    >>> at_least("least angle of a triangle (degrees)", 12.0, 20.0, "angles that the mesher promises").holds
    False
    """
    return Check(quantity, float(value), bound, inf, origin)


def between(quantity: str, value: float, low: float, high: float, origin: str) -> Check:
    """Check that a number lies in a range.

    Parameters
    ----------
    quantity : str
        Name of the number on the pages.
    value : float
        The number, in any unit.
    low, high : float
        The ends of the range, in the same unit. They belong to it.
    origin : str
        The reason for this range.

    Returns
    -------
    Check
        The check, for ``record``. It does not hold for NaN.

    Examples
    --------
    >>> from verification.evidence.checks import between
    >>> between("doubling time (h)", 3.05, 2.5, 3.5, "the paper says about 3 h").holds
    True
    """
    return Check(quantity, float(value), low, high, origin)


def each_at_most(values: Mapping[str, float], bound: float, origin: str, suffix: str = "") -> list[Check]:
    """Check several sizes against one bound. The suffix is added to each name."""
    return [at_most(name + suffix, value, bound, origin) for name, value in values.items()]


def largest(values: np.ndarray) -> float:
    """Return the largest absolute value."""
    return float(np.abs(values).max())


def rounded(value: float, quantum: float) -> str:
    """Round to the power of ten at or under ``quantum``; a smaller size reads "under" that power."""
    if not isfinite(value) or quantum <= 0:
        return f"{value:.3g}"
    unit = 10.0 ** floor(log10(quantum))
    steps = round(value / unit)
    if steps == 0:
        return f"under {unit:.0e}"
    digits = max(0, floor(log10(abs(steps)))) + 1
    return f"{steps * unit:.{digits}g}"


MIN_SIZES = 4
#: Half width of the band around an expected order. Errors on unrelated meshes scatter by a tenth or two. Between
#: neighbours whose sizes differ by a factor of 2 that is an order of 0.2 or 0.3.
BAND = 0.3


@dataclass(frozen=True, eq=False)
class Study:
    """Errors on meshes or steps of falling sizes, whose orders must lie in a band.

    Parameters
    ----------
    quantity : str
        Name of the error on the pages.
    sizes : (k,) array
        Sizes of at least four unrelated meshes or steps, falling, in any unit.
    errors : (k,) array
        The error on each, in any unit.
    low, high : float
        The band of the order between neighbours, without unit.
    origin : str
        The reason why this order is expected.
    ceiling : float
        The largest accepted last error, in the unit of the errors.

    Raises
    ------
    ValueError
        If there are fewer than four sizes, they do not fall, or the number of errors differs.

    Examples
    --------
    >>> import numpy as np
    >>> from verification.evidence.checks import Study
    >>> sizes = np.array([8.0, 4.0, 2.0, 1.0])
    >>> study = Study("velocity", sizes, 0.1 * sizes**2, 1.7, 2.3, "linear elements, in the mean square")
    >>> study.orders.round(6).tolist(), study.holds
    ([2.0, 2.0, 2.0], True)
    """

    quantity: str
    sizes: np.ndarray
    errors: np.ndarray
    low: float
    high: float
    origin: str
    ceiling: float = inf

    def __post_init__(self):
        if len(self.sizes) < MIN_SIZES or len(self.sizes) != len(self.errors) or not (np.diff(self.sizes) < 0).all():
            raise ValueError(f"{self.quantity}: a study takes {MIN_SIZES} or more falling sizes, and an error of each")

    @property
    def orders(self) -> np.ndarray:
        """(k - 1,) log of the ratio of errors over log of the ratio of sizes, without unit.

        It is infinite or not-a-number where an error is not positive and finite.
        """
        with np.errstate(all="ignore"):
            return np.diff(np.log(self.errors)) / np.diff(np.log(self.sizes))

    @property
    def holds(self) -> bool:
        """Whether all orders lie in the band and the last error is under its ceiling."""
        orders = self.orders
        return bool(((self.low <= orders) & (orders <= self.high)).all() and self.errors[-1] <= self.ceiling)

    @property
    def measured(self) -> str:
        """Orders to a tenth, and the last error to one digit."""
        last = float(self.errors[-1])
        known = isfinite(self.ceiling)
        return f"{self.reproducible}; last error {rounded(last, self.ceiling / 20) if known else f'{last:.0e}'}"

    @property
    def reproducible(self) -> str:
        """Orders to a tenth, the same on every machine."""
        return f"order {', '.join(f'{order:.1f}' for order in self.orders)}"

    def interval(self, digits: int = 3) -> str:
        """Write the band, and the ceiling if there is one."""
        band = f"order {self.low:.{digits}g} to {self.high:.{digits}g}"
        return band if self.ceiling == inf else f"{band}; at most {self.ceiling:.3g}"


def around(order: float, band: float = BAND) -> tuple[float, float]:
    """Return the lowest and the highest order of a band around one."""
    return order - band, order + band


def study(quantity: str, sizes, errors, order: float, origin: str, *, ceiling: float = inf,
          band: float = BAND) -> Study:
    """Judge errors on falling sizes by their order of convergence.

    Parameters
    ----------
    quantity : str
        Name of the error on the pages.
    sizes : (k,) array_like
        Sizes of at least four unrelated meshes or steps, falling, in any unit.
    errors : (k,) array_like
        The error on each, in any unit.
    order : float
        The expected order between neighbours, without unit.
    origin : str
        The reason why this order is expected.
    ceiling : float, optional
        The largest accepted last error, in the unit of the errors; none by default.
    band : float, optional
        The largest difference of an order from the expected one, without unit.

    Returns
    -------
    Study
        The study, for ``record``. An order above the band fails like one below it.

    Raises
    ------
    ValueError
        If there are fewer than four sizes, they do not fall, or the number of errors differs.

    Examples
    --------
    >>> from verification.evidence.checks import study
    >>> study("velocity", [8, 4, 2, 1], [0.64, 0.16, 0.04, 0.01], 2, "linear elements, in the mean square").holds
    True
    >>> study("velocity", [8, 4, 2, 1], [0.64, 0.32, 0.16, 0.08], 2, "linear elements, in the mean square").holds
    False
    """
    return Study(quantity, np.asarray(sizes, float), np.asarray(errors, float), *around(order, band), origin, ceiling)


def studies(errors: Mapping[str, np.ndarray], rows: Mapping[str, tuple], suffix: str = "") -> list[Study]:
    """Judge the errors of several fields by their orders of convergence.

    Parameters
    ----------
    errors : dict of (k,) array
        The errors of each field, in any unit, and the sizes of the meshes or steps as "size", as from :func:`refine`.
    rows : dict of tuple
        {field: (order, origin)} or {field: (order, origin, ceiling)}, as for :func:`study`. The order may be a pair:
        the lowest and the highest accepted one.
    suffix : str, optional
        Text at the end of each name on the pages.

    Returns
    -------
    list of Study
        A study per field of ``rows``, for ``record``.

    Raises
    ------
    ValueError
        If there are fewer than four sizes, they do not fall, or the number of errors differs.

    Examples
    --------
    >>> import numpy as np
    >>> from verification.evidence.checks import studies
    >>> sizes = np.array([8.0, 4.0, 2.0, 1.0])
    >>> errors = {"size": sizes, "velocity": sizes**2, "pressure": sizes}
    >>> [study.holds for study in studies(errors, {"velocity": (2, "theory"), "pressure": ((0.9, 1.5), "theory")})]
    [True, True]
    """
    bands = {name: row[0] if isinstance(row[0], tuple) else around(row[0]) for name, row in rows.items()}
    return [Study(name + suffix, errors["size"], errors[name], *bands[name], *row[1:]) for name, row in rows.items()]


def refine(measure: Callable[..., dict[str, float]], sizes: Iterable[float] | Mapping[float, int],
           *arguments) -> dict[str, np.ndarray]:
    """Errors (k,) of each field on each size: ``measure(size, *arguments)`` gives {field: error}.

    With sizes {size: how many unrelated meshes of it}, root mean squares of ``measure(size, number, *arguments)`` over
    the meshes of each, and the "size" of each unless that is measured too.
    """
    if isinstance(sizes, Mapping):
        rows = [{"size": size, **_averaged(measure, size, count, arguments)} for size, count in sizes.items()]
    else:
        rows = [measure(size, *arguments) for size in sizes]
    return columns(rows)


def columns(rows: Sequence[Mapping[str, float]]) -> dict[str, np.ndarray]:
    """Return {name: (k,)} of rows {name: number}, all of the same names; None becomes NaN."""
    return dict(zip(rows[0], np.array([[*row.values()] for row in rows], dtype=float).T))


def _averaged(measure: Callable, size: float, count: int, arguments: tuple) -> dict[str, float]:
    rows = [measure(size, number, *arguments) for number in range(count)]
    return {name: float(np.sqrt(np.mean(values**2))) for name, values in columns(rows).items()}


def flat(evidence: Check | Study | Iterable) -> Iterator[Check | Study]:
    """Yield checks and studies one by one, from nested lists or generators of them."""
    if isinstance(evidence, Iterable):
        for part in evidence:
            yield from flat(part)
    else:
        yield evidence
