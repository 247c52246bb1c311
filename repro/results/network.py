"""Laws for networks: the resistance that an aggregate adds to a pore, and its uptake (section 5).

A network model knows the area A of the aggregate in a pore of width W and needs the pore's head
loss. Stokes flow is linear, so the mean velocity drops out; W is the only length, so areas count in
W^2. The rest depends on lambda and the shape, and is in a table,

    head loss = 12 nu u_ave / (g W^2) (L + r W),        r = r(A / W^2, lambda, spanned).

r is a length of empty pore, over W: it resists as much as the aggregate adds. Before the aggregate
spans the pore it is a half-disc on one wall, and r hardly depends on lambda while the film is wide.
After that r is nearly (lambda - 1) (A / W^2 - 0.4). A plug with straight ends has exactly
(lambda - 1) A / W^2; rounded ends let more water pass.

``python -m verification.network`` makes ``network.csv``. It has r of half-discs, and the mean r of
plugs that have grown. Its bounds are the least and the largest r of two kinds of shapes. Grown
shapes are from pores of 40 to 150 um, at 0.5 to 6 m/d and W^2 / 2500 to 20 mg/L of both substrates.
Drawn shapes are 1 % thinner or 3 % thicker than a half-disc, or lean by 5 %.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from repro.model.kinetics import RateLaw, rate_law
from repro.results import read_table
from repro.scene import load_scene

TABLE = Path(__file__).with_name("network.csv")
SHARE = "area / width^2"
OUTSIDE = ("raise", "nan")
#: A / W^2 between which an aggregate may touch both walls or not. A film of 2 um closes under a
#: half-disc of 1.42 W^2 in a pore of 40 um, and of 1.53 W^2 in one of 150 um.
CONTACT = (1.41, 1.6)
#: r / A of a half-disc falls by this factor times its thickness over W, within 0.4 % between
#: thicknesses of 0.01 and 0.05 W, for lambda of 100 to 10 000.
THINNER = 1.25
#: A plug resists like one with straight ends that is shorter by this length, over W.
ROUNDED = 0.4
#: Per A / W^2 below 1.6, the lower bound of plugs falls by this part of r: contact surfaces that
#: have just formed are short. With 0.9, one of the fit's shapes was below it by 0.2 %.
EARLY = 1.25


class Transport(NamedTuple):
    """Constants of the uptake: S = sherwood (A / W^2)^power, P = plug Pe (A / W^2)^plug_power."""

    sherwood: float
    power: float
    plug: float
    plug_power: float


#: Before and after contact, as ``python -m verification.network uptake`` fits them.
TRANSPORTS = Transport(8.5, 0.364, 1.05, 0.57), Transport(12.7, 2.18, 0.529, 0.259)
#: Relative bound of the uptake, of any aggregate: 1.25 times the largest error of the fit. Before
#: contact it rises with the square of Pe A / W^2 of the donor by this factor, since boundary layers
#: form beside a thick body in a fast flow.
UPTAKE_BOUND, FAST = 0.0761, 0.02
#: Ranges of the uptake: widths (um), mean velocities (m/d) and supplies (mg/L).
WIDTHS, FASTEST, LARGEST_SUPPLY = (40.0, 150.0), 10.0, 20.0
#: Halvings of the interval of the donor's uptake, and of that of the acceptor's for decay, which
#: is a few per cent of its uptake.
HALVINGS, DECAY_HALVINGS = 24, 12
UM_PER_HOUR = 1e6 / 24  # in 1 m/d


class AddedResistance(NamedTuple):
    """Lengths of empty pore, over W, that resist as much as aggregates add.

    length: r; least, most: bounds of r for other shapes of the same area. All have the shape of the
    areas.
    """

    length: np.ndarray
    least: np.ndarray
    most: np.ndarray


def added_resistance(area: ArrayLike, width: ArrayLike, spanned: ArrayLike | None = None,
                     viscosity_ratio: float = 2000.0, *, outside: str = "raise") -> AddedResistance:
    """Resistance that aggregates add to pores, as a length of empty pore over W.

    Parameters
    ----------
    area : array_like
        Areas of the aggregates, in any unit of area and of any shape; zero in an empty pore.
    width : array_like
        Widths of the pores, in the square root of that unit. Its shape broadcasts with the areas.
    spanned : array_like of bool, optional
        True if the aggregate touches both walls. Its shape broadcasts with the areas. By default
        the area decides: an aggregate of more than 1.51 width^2 touches both walls. From 1.41 to
        1.6 width^2 the bounds then include shapes with contact and without it.
    viscosity_ratio : float
        Viscosity of the aggregates over that of water, lambda, without unit.
    outside : {"raise", "nan"}
        A pore outside the law's range raises an error with its index, or its results are
        not-a-number.

    Returns
    -------
    AddedResistance
        Arrays of the broadcast shape, without unit.

    Raises
    ------
    ValueError
        If a width is not positive, or area / width^2 or viscosity_ratio is outside the law's range:
        0 to 1.5 before contact, 1.41 to 4.5 after it, lambda 100 to 10 000.

    Notes
    -----
    The head loss of a pore is 12 nu u_ave / (g W^2) (L + length W), with the viscous aggregate of
    2.1 and the paper's condition on its surface [E2], at least 1.5 W from the pore's ends.

    Examples
    --------
    >>> import repro
    >>> added = repro.added_resistance([0.0, 500.0, 4000.0, 9000.0], 50.0)
    >>> bool((added.least <= added.length).all() and (added.length <= added.most).all())
    True
    """
    ratio, ratios = float(viscosity_ratio), _table(False)[1]
    check = Check("added_resistance", outside)
    Check("added_resistance", "raise").within("viscosity_ratio", ratio, ratios[0], ratios[-1])
    share, widths = _shares(area, width)
    touches = share > share_range(False)[1] if spanned is None else np.asarray(spanned, bool)
    share, widths, touches = np.broadcast_arrays(share, widths, touches)
    is_known = _in_table(check, share, widths, None if spanned is None else touches)
    results = np.full((3, *share.shape), np.nan)
    for kind in (False, True):
        selected = is_known & (touches == kind)
        results[:, selected] = _law(kind, share[selected], ratio)
    if spanned is None:
        _include_both_kinds(results, share, is_known, ratio)
    return AddedResistance(*results)


def _in_table(check: Check, share: np.ndarray, width: np.ndarray,
              touches: np.ndarray | None) -> np.ndarray:
    """Return where the law covers the throats; touches: None if the area decides the contact."""
    last, largest = share_range(False)[1], share_range(True)[1]
    is_known = check.positive("width", width)
    if touches is None:
        return is_known & check.within(SHARE, share, 0.0, largest, is_known)
    is_known &= check.within(f"{SHARE} before contact (spanned=False)", share, 0.0, last,
                             is_known & ~touches)
    return is_known & check.within(f"{SHARE} of a plug (spanned=True)", share, CONTACT[0], largest,
                                   is_known & touches)


def _include_both_kinds(results: np.ndarray, share: np.ndarray, is_known: np.ndarray,
                        ratio: float) -> None:
    """Widen the bounds of the (3, ...) results where the area does not determine the kind."""
    either = is_known & (share >= CONTACT[0]) & (share <= CONTACT[1])
    kinds = [_law(kind, np.minimum(share[either], share_range(kind)[1]), ratio)
             for kind in (False, True)]
    results[1, either] = np.min(kinds, axis=0)[1]
    results[2, either] = np.max(kinds, axis=0)[2]


class Uptake(NamedTuple):
    """Uptake of aggregates in throats, per metre of depth.

    acceptor, donor: pg/m/h; growth: of the area, um^2/h, by (9) and (10); bound: relative error of
    acceptor and donor. All have the shape of the areas.
    """

    acceptor: np.ndarray
    donor: np.ndarray
    growth: np.ndarray
    bound: np.ndarray


def uptake(area: ArrayLike, width: ArrayLike, velocity: ArrayLike, acceptor: ArrayLike,
           donor: ArrayLike, *, outside: str = "raise") -> Uptake:
    """Uptake of both substrates by aggregates in throats, and the growth that follows from it.

    Parameters
    ----------
    area : array_like
        Areas of the aggregates, um^2, of any shape; zero in an empty throat.
    width : array_like
        Widths of the throats, um. Its shape broadcasts with the areas.
    velocity : array_like
        Mean velocities in the throats, m/d. Its shape broadcasts with the areas.
    acceptor, donor : array_like
        Supplies: concentrations in the water that enters the throats, mg/L. Their shapes broadcast
        with the areas.
    outside : {"raise", "nan"}
        As for :func:`added_resistance`.

    Returns
    -------
    Uptake
        Arrays of the broadcast shape.

    Raises
    ------
    ValueError
        If a throat is outside the law's range: area / width^2 to 4.5, width 40 to 150 um, velocity
        to 10 m/d, supplies to 20 mg/L.

    Notes
    -----
    The kinetics and diffusivities are those of Table 1, with X_A = X_m and steady profiles. The
    effluent of a throat has the supply less uptake / (velocity width).

    Examples
    --------
    >>> import repro
    >>> taken = repro.uptake([0.0, 500.0, 4000.0], 50.0, 1.0, 8.0, 5.0)
    >>> bool(taken.growth[0] == 0 and (taken.growth[1:] > 0).all())
    True
    """
    check = Check("uptake", outside)
    area, width, velocity, *supplies = np.broadcast_arrays(
        *(np.asarray(values, float) for values in (area, width, velocity, acceptor, donor)))
    is_known = check.within("width", width, *WIDTHS)
    share = area / np.where(is_known, width, np.nan)**2
    is_known &= check.within(SHARE, share, 0.0, share_range(True)[1], is_known)
    is_known &= check.within("velocity", velocity, 0.0, FASTEST)
    for name, supply in zip(("acceptor", "donor"), supplies):
        is_known &= check.within(name, supply, 0.0, LARGEST_SUPPLY)
    results = np.full((4, *share.shape), np.nan)
    results[:3, is_known] = 0.0
    arguments = (area, width, velocity, *supplies)
    results[3, is_known] = throats_of(*(values[is_known] for values in arguments)).bound()
    takes = is_known & (area > 0) & (velocity > 0) & (supplies[0] > 0)
    results[:3, takes] = throats_of(*(values[takes] for values in arguments)).uptake()
    return Uptake(*results)


class Throats(NamedTuple):
    """Throats with aggregates.

    area: (n,) um2; share: (n,) A / W^2; inflow: (n,) u_ave W, um2/h; supplies: (2, n) mg/L of
    acceptor and donor; transports: constants before contact and after it.
    """

    area: np.ndarray
    share: np.ndarray
    inflow: np.ndarray
    supplies: np.ndarray
    transports: tuple[Transport, Transport] = TRANSPORTS

    def uptake(self) -> np.ndarray:
        """(3, n) uptake of acceptor and donor, um2 mg/L/h, and growth of the area, um2/h.

        Two unknowns, one inside the other: the uptake of the acceptor follows from that of the
        donor, by which both concentrations in the aggregate fall.
        """
        law, _, density = _constants()
        active = density * self.area
        ratio = law.constants.acceptor_to_donor_ratio
        decay, _ = active * law.uptake(self.supplies[0], 0.0 * self.area)
        _, fastest = active * law.uptake(*self.supplies)
        limits = self.inflow * self.supplies

        def acceptor(taken: np.ndarray) -> np.ndarray:
            need = ratio * taken
            most = need + np.minimum(decay, np.maximum(limits[0] - need, 0.0))
            return _balance(need, most, DECAY_HALVINGS, lambda trial: (
                need + active * law.uptake(self.concentration(0, trial), 0.0 * trial)[0]))

        def donor(trial: np.ndarray) -> np.ndarray:
            c_acceptor = self.concentration(0, acceptor(trial))
            return active * law.uptake(c_acceptor, self.concentration(1, trial))[1]

        most = np.minimum(np.minimum(limits[0] / ratio, limits[1]), fastest)
        taken = _balance(np.zeros_like(most), most, HALVINGS, donor)
        both = acceptor(taken)
        decayed = (both - ratio * taken) / law.constants.decay_oxygen_demand
        growth = (law.constants.yield_coefficient * taken - decayed) / density
        return np.stack([both, taken, growth])

    def concentration(self, substrate: int, taken: np.ndarray) -> np.ndarray:
        """(n,) mg/L in the aggregates that take up (n,) um2 mg/L/h of acceptor (0) or donor (1)."""
        _, diffusivities, _ = _constants()
        sherwood, power, plug, plug_power = self.transport()
        supply, diffusivity = self.supplies[substrate], diffusivities[substrate]
        is_plug = plug * self.inflow / diffusivity * self.share**plug_power
        used = np.divide(taken, self.inflow * supply, out=np.zeros_like(taken), where=supply > 0)
        used = np.clip(used, 1e-12, 1 - 1e-12)
        mean = (1 - used - is_plug * used / np.log1p(-used)) / (1 + is_plug)
        resistance = 1 / (sherwood * self.share**power * diffusivity)
        return np.maximum(supply * mean - taken * resistance, 0.0)

    def transport(self) -> np.ndarray:
        """(4, n) the constants of each aggregate."""
        before, after = (np.array(kind)[:, None] for kind in self.transports)
        return np.where(self._spanned(), after, before)

    def bound(self) -> np.ndarray:
        """(n,) relative bound of the uptakes."""
        return UPTAKE_BOUND * self.spread()

    def spread(self) -> np.ndarray:
        """(n,) bound over its least value."""
        peclet = self.inflow / _constants()[1][1]
        return 1 + np.where(self._spanned(), 0.0, FAST * (peclet * self.share)**2)

    def _spanned(self) -> np.ndarray:
        return self.share > share_range(False)[1]


def throats_of(area: np.ndarray, width: np.ndarray, velocity: np.ndarray, acceptor: np.ndarray,
               donor: np.ndarray) -> Throats:
    """Throats of the (n,) arguments of :func:`uptake`."""
    inflow = velocity * width * UM_PER_HOUR
    return Throats(area, area / width**2, inflow, np.stack([acceptor, donor]))


def _balance(low: np.ndarray, high: np.ndarray, halvings: int, rate: Callable) -> np.ndarray:
    """(n,) x between low and high with rate(x) = x, for a rate that falls with x."""
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        exceeds = rate(middle) > middle
        low, high = np.where(exceeds, middle, low), np.where(exceeds, high, middle)
    return 0.5 * (low + high)


@cache
def _constants() -> tuple[RateLaw, tuple[float, float], float]:
    """Rates, diffusivities of acceptor and donor in the aggregate (um2/h), X_m: of Table 1."""
    scene = load_scene("base")
    both = scene.substrates.acceptor, scene.substrates.donor
    acceptor, donor = (substrate.diffusivity_in_aggregate for substrate in both)
    rates = rate_law(scene.substrates, scene.kinetics)
    return rates, (acceptor, donor), scene.kinetics.maximum_density


def share_range(spanned: bool) -> tuple[float, float]:
    """Return the least and the largest A / W^2 in the table."""
    shares, _, _ = _table(spanned)
    return float(shares[0]), float(shares[-1])


class Check(NamedTuple):
    """Check of a law's arguments. function: the law's name; outside: as in the law."""

    function: str
    outside: str

    def within(self, name: str, values: ArrayLike, low: float, high: float,
               where: ArrayLike = True) -> np.ndarray:
        """Return where values are in a range or need no check."""
        values = np.asarray(values, float)
        is_known = (values >= low) & (values <= high) | ~np.asarray(where)
        return self._checked(name, values, is_known, f"{low:.4g} to {high:.4g}")

    def positive(self, name: str, values: np.ndarray) -> np.ndarray:
        """Return where values are more than zero and finite."""
        is_known = (values > 0) & np.isfinite(values)
        return self._checked(name, values, is_known, "more than zero")

    def _checked(self, name: str, values: np.ndarray, is_known: np.ndarray,
                 accepted: str) -> np.ndarray:
        """Return ``is_known``. Raises ValueError for the first value that is not known."""
        if self.outside not in OUTSIDE:
            raise ValueError(f"{self.function}: outside = {self.outside!r} is not known; "
                             "'raise' or 'nan' is accepted")
        if self.outside == "raise" and not is_known.all():
            index = tuple(map(int, np.argwhere(~is_known)[0]))
            throat = f"throat {', '.join(map(str, index))}: " if index else ""
            raise ValueError(f"{self.function}: {throat}{name} = {values[index]:.6g} is not known; "
                             f"{accepted} is accepted")
        return is_known


def _shares(area: ArrayLike, width: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Broadcast A / W^2 and W; A / W^2 is not-a-number where W is not positive."""
    area, width = np.broadcast_arrays(np.asarray(area, float), np.asarray(width, float))
    return area / np.where(width > 0, width, np.nan)**2, width


def _law(spanned: bool, share: np.ndarray, ratio: float) -> np.ndarray:
    """Interpolate (3, n) r and its bounds at A / W^2 (n,) for one kind of aggregate.

    Logarithms are interpolated: those of r by monotone cubics, those of its bounds over r linearly.
    """
    from scipy.interpolate import PchipInterpolator  # its import takes a quarter of a second

    shares, ratios, values = _table(spanned)
    length, *bounds = PchipInterpolator(np.log(ratios), values, axis=1)(np.log(ratio))
    inside = np.maximum(share, shares[0])
    place, nodes = np.log(inside), np.log(shares)
    length = PchipInterpolator(nodes, length)(place)
    rows = np.exp([length, *(length + np.interp(place, nodes, bound) for bound in bounds)])
    return rows * (_early_plug(share, inside) if spanned else _thin_body(share, inside))


def _thin_body(share: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Ratio of r at A / W^2 to r at the first area of the table, for thinner half-discs.

    They are in a shear flow, where r is proportional to the area. Its profile is a parabola, which
    reduces r / A in proportion to the thickness.
    """
    thickness, first = np.sqrt(2 * share / np.pi), np.sqrt(2 * inside / np.pi)
    return share / inside * (1 + THINNER * (first - thickness))


def _early_plug(share: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """(3, n) r and its bounds at A / W^2 over those at the first area of the table.

    Plugs with less area have just touched both walls.
    """
    factor = (share - ROUNDED) / (inside - ROUNDED)
    return factor * np.stack([np.ones_like(share), 1 - EARLY * (inside - share),
                              np.ones_like(share)])


@cache
def _table(spanned: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Read the table of one kind of aggregate.

    It has A / W^2 (m,), lambda (l,), and (3, l, m) the logarithms of r and of its bounds over r.
    """
    columns = read_table(TABLE)
    rows = columns["spanned"] == spanned
    ratios = np.unique(columns["viscosity_ratio"][rows])
    share, *values = (columns[name][rows].reshape(len(ratios), -1) for name in
                      ("area_over_width2", "added_length_over_width", "least", "most"))
    return share[0], ratios, np.log(values)
