"""The uptake of both substrates by an aggregate in a throat, and the growth that follows from it.

The law has one concentration C of each substrate in the aggregate, at which (7)-(10) hold. An
uptake U, the part f of what flows in, lowers it to

    C = supply (1 - f + P f / ln(1 / (1 - f))) / (1 + P) - U / (S D),

    S = sherwood (A / W^2)^power,        P = plug Pe (A / W^2)^plug_power,

with the diffusivity D in the aggregate and Pe = u_ave W / D. The first term is the concentration in
the water beside the aggregate: that of the effluent if the water is mixed, and the logarithmic mean
along the aggregate if it is not (large P). The second one is the drop that diffusion needs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from repro.model.kinetics import RateLaw, rate_law
from repro.network.arguments import SHARE, Check, area_share
from repro.network.resistance import is_plug, share_range
from repro.results import M_PER_D
from repro.scene import load_scene


class Transport(NamedTuple):
    """Constants of S and P."""

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
    area, width, velocity, acceptor, donor = np.broadcast_arrays(
        *(np.asarray(values, float) for values in (area, width, velocity, acceptor, donor)))
    check = Check("uptake", outside)
    ranges = (("width", width, *WIDTHS),
              (SHARE, area_share(area, width), 0.0, share_range(True)[1]),
              ("velocity", velocity, 0.0, FASTEST),
              ("acceptor", acceptor, 0.0, LARGEST_SUPPLY),
              ("donor", donor, 0.0, LARGEST_SUPPLY))
    is_known = np.all([check.within(*each) for each in ranges], axis=0)
    takes = is_known & (area > 0) & (velocity > 0) & (acceptor > 0)
    throats = Throats(area, width, velocity, np.stack([acceptor, donor]))
    results = np.full((4, *area.shape), np.nan)
    results[:3, is_known] = 0.0
    results[:3, takes] = throats.where(takes).uptake()
    results[3, is_known] = throats.where(is_known).bound()
    return Uptake(*results)


@dataclass(frozen=True, eq=False)
class Throats:
    """Throats with aggregates.

    area: (n,) um2; width: (n,) um; velocity: (n,) m/d; supplies: (2, n) mg/L of acceptor and donor;
    transports: constants before contact and after it.
    """

    area: np.ndarray
    width: np.ndarray
    velocity: np.ndarray
    supplies: np.ndarray
    transports: tuple[Transport, Transport] = TRANSPORTS

    @cached_property
    def share(self) -> np.ndarray:
        """(n,) A / W^2."""
        return area_share(self.area, self.width)

    @cached_property
    def inflow(self) -> np.ndarray:
        """(n,) u_ave W, um2/h."""
        return self.velocity / M_PER_D * self.width

    def where(self, selected: np.ndarray) -> Throats:
        """Select throats."""
        return Throats(self.area[selected], self.width[selected], self.velocity[selected],
                       self.supplies[:, selected], self.transports)

    def uptake(self) -> np.ndarray:
        """(3, n) uptake of acceptor and donor, um2 mg/L/h, and growth of the area, um2/h."""
        kinetics = _rates().constants
        donor = self._donor_uptake()
        acceptor = self._acceptor_uptake(donor)
        need = kinetics.acceptor_to_donor_ratio * donor
        decayed = (acceptor - need) / kinetics.decay_oxygen_demand
        growth = (kinetics.yield_coefficient * donor - decayed) / kinetics.maximum_density
        return np.stack([acceptor, donor, growth])

    def bound(self) -> np.ndarray:
        """(n,) relative bound of the uptakes."""
        return UPTAKE_BOUND * self.spread()

    def spread(self) -> np.ndarray:
        """(n,) bound over its least value."""
        peclet = self.inflow / _diffusivities()[1]
        return 1 + np.where(is_plug(self.share), 0.0, FAST * (peclet * self.share)**2)

    def _donor_uptake(self) -> np.ndarray:
        """(n,) uptake of the donor, by which both concentrations in the aggregate fall."""
        acceptor_limit, donor_limit = self.inflow * self.supplies
        most = np.minimum(acceptor_limit / _rates().constants.acceptor_to_donor_ratio, donor_limit)
        _, fastest = self._uptake_at(*self.supplies)

        def rate(donor: np.ndarray) -> np.ndarray:
            acceptor = self._concentration(0, self._acceptor_uptake(donor))
            return self._uptake_at(acceptor, self._concentration(1, donor))[1]

        return _balance(np.zeros_like(most), np.minimum(most, fastest), HALVINGS, rate)

    def _acceptor_uptake(self, donor: np.ndarray) -> np.ndarray:
        """(n,) uptake of the acceptor: for the uptake of the donor (n,), and for decay."""
        need = _rates().constants.acceptor_to_donor_ratio * donor
        spare = np.maximum(self.inflow * self.supplies[0] - need, 0.0)
        most = need + np.minimum(self._largest_demand_of_decay, spare)
        return _balance(need, most, DECAY_HALVINGS, lambda acceptor: (
            need + self._demand_of_decay(self._concentration(0, acceptor))))

    def _demand_of_decay(self, acceptor: np.ndarray) -> np.ndarray:
        """(n,) uptake of the acceptor without donor."""
        return self._uptake_at(acceptor, np.zeros_like(acceptor))[0]

    @cached_property
    def _largest_demand_of_decay(self) -> np.ndarray:
        return self._demand_of_decay(self.supplies[0])

    def _uptake_at(self, acceptor: np.ndarray, donor: np.ndarray) -> np.ndarray:
        """(2, n) uptake of acceptor and donor at concentrations in the aggregates."""
        biomass = _rates().constants.maximum_density * self.area
        return biomass * np.stack(_rates().uptake(acceptor, donor))

    def _concentration(self, substrate: int, consumed: np.ndarray) -> np.ndarray:
        """(n,) mg/L in the aggregates that take up (n,) um2 mg/L/h of acceptor (0) or donor (1)."""
        sherwood, power, plug, plug_power = self._transport
        supply, diffusivity = self.supplies[substrate], _diffusivities()[substrate]
        unmixed = plug * self.inflow / diffusivity * self.share**plug_power
        used = np.divide(consumed, self.inflow * supply, out=np.zeros_like(consumed),
                         where=supply > 0)
        used = np.clip(used, 1e-12, 1 - 1e-12)
        mean = (1 - used - unmixed * used / np.log1p(-used)) / (1 + unmixed)
        resistance = 1 / (sherwood * self.share**power * diffusivity)
        return np.maximum(supply * mean - consumed * resistance, 0.0)

    @cached_property
    def _transport(self) -> np.ndarray:
        """(4, n) the constants of each aggregate."""
        before, after = (np.array(kind)[:, None] for kind in self.transports)
        return np.where(is_plug(self.share), after, before)


def _balance(low: np.ndarray, high: np.ndarray, halvings: int, rate: Callable) -> np.ndarray:
    """(n,) x between low and high with rate(x) = x, for a rate that falls with x."""
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        exceeds = rate(middle) > middle
        low, high = np.where(exceeds, middle, low), np.where(exceeds, high, middle)
    return 0.5 * (low + high)


@cache
def _rates() -> RateLaw:
    """Rates of Table 1."""
    scene = load_scene("base")
    return rate_law(scene.substrates, scene.kinetics)


@cache
def _diffusivities() -> tuple[float, float]:
    """Diffusivities of acceptor and donor in the aggregate (um2/h) of Table 1."""
    substrates = load_scene("base").substrates
    return (substrates.acceptor.diffusivity_in_aggregate,
            substrates.donor.diffusivity_in_aggregate)
