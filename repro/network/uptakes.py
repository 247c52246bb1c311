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
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from repro.model.kinetics import RateLaw, rate_law
from repro.network.arguments import SHARE, Check, area_share
from repro.network.resistance import is_plug, share_range
from repro.results import M_PER_D
from repro.scene import Scene, load_scene


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
#: Largest errors of the uptakes of donor and acceptor, over the intervals that contain them. Every
#: third step of the search halves an interval, so that 72 steps reach the error.
ERROR, MOST_STEPS = 2.0**-24, 72


class Law(NamedTuple):
    """The law of uptake with the kinetics of a scene.

    rates: (7)-(10); diffusivities: of acceptor and donor in the aggregate, um2/h; transports: those
    before contact and after it; bound: least relative bound of the uptake; widths: um; supplies:
    largest ones of acceptor and donor, mg/L; share: largest A / W^2.
    """

    rates: RateLaw
    diffusivities: tuple[float, ...]
    transports: tuple[Transport, ...]
    bound: float
    widths: tuple[float, float]
    supplies: tuple[float, ...]
    share: float


def law_of(scene: Scene, transports: tuple[Transport, ...], bound: float, *,
           widths: tuple[float, float], supplies: tuple[float, ...], share: float) -> Law:
    """Return the law with the kinetics and the diffusivities of a scene."""
    inside = (kind.diffusivity_in_aggregate for kind in scene.substrates.modelled.values())
    return Law(rate_law(scene.substrates, scene.kinetics), tuple(inside), transports, bound, widths,
               supplies, share)


@cache
def table_1() -> Law:
    """Return the law with the kinetics of Table 1."""
    return law_of(load_scene("base"), TRANSPORTS, UPTAKE_BOUND, widths=WIDTHS,
                  supplies=(LARGEST_SUPPLY,) * 2, share=share_range(True)[1])


class Uptake(NamedTuple):
    """Uptake of aggregates in throats, per metre of depth.

    acceptor, donor: pg/m/h; growth: of the area, um^2/h, by (9) and (10); bound: relative error of
    acceptor and donor. All have the shape of the areas.
    """

    acceptor: np.ndarray
    donor: np.ndarray
    growth: np.ndarray
    bound: np.ndarray


def uptake(law: Law, area: ArrayLike, width: ArrayLike, velocity: ArrayLike, acceptor: ArrayLike,
           donor: ArrayLike, outside: str = "raise") -> Uptake:
    """Uptake by a law; arguments as for :func:`repro.uptake`."""
    area, width, velocity, acceptor, donor = np.broadcast_arrays(
        *(np.asarray(values, float) for values in (area, width, velocity, acceptor, donor)))
    check = Check("uptake", outside)
    ranges = (("width", width, *law.widths),
              (SHARE, area_share(area, width), 0.0, law.share),
              ("velocity", velocity, 0.0, FASTEST),
              ("acceptor", acceptor, 0.0, law.supplies[0]),
              ("donor", donor, 0.0, law.supplies[1]))
    is_known = np.all([check.within(*each) for each in ranges], axis=0)
    takes = is_known & (area > 0) & (velocity > 0) & (acceptor > 0)
    throats = Throats(area, width, velocity, np.stack([acceptor, donor]), law)
    results = np.full((4, *area.shape), np.nan)
    results[:3, is_known] = 0.0
    results[:3, takes] = throats.where(takes).uptake()
    results[3, is_known] = throats.where(is_known).bound()
    return Uptake(*results)


@dataclass(frozen=True, eq=False)
class Throats:
    """Throats with aggregates.

    area: (n,) um2; width: (n,) um; velocity: (n,) m/d; supplies: (2, n) mg/L of acceptor and donor;
    law: the law of their uptake.
    """

    area: np.ndarray
    width: np.ndarray
    velocity: np.ndarray
    supplies: np.ndarray
    law: Law = field(default_factory=table_1)

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
                       self.supplies[:, selected], self.law)

    def uptake(self) -> np.ndarray:
        """(3, n) uptake of acceptor and donor, um2 mg/L/h, and growth of the area, um2/h.

        Both concentrations in the aggregate fall by the uptake of the donor.
        """
        kinetics = self.law.rates.constants
        ratio = kinetics.acceptor_to_donor_ratio
        acceptor_limit, donor_limit = self._inflows
        limit = np.minimum(acceptor_limit / ratio, donor_limit)
        _, fastest = self._uptake_at(*self.supplies)

        def rate(donor: np.ndarray) -> np.ndarray:
            acceptor = self._concentration(0, self._acceptor_uptake(donor))
            return self._uptake_at(acceptor, self._concentration(1, donor))[1]

        donor = _balance(np.zeros_like(limit), np.minimum(limit, fastest), rate)
        acceptor = self._acceptor_uptake(donor)
        decayed = (acceptor - ratio * donor) / kinetics.decay_oxygen_demand
        growth = (kinetics.yield_coefficient * donor - decayed) / kinetics.maximum_density
        return np.stack([acceptor, donor, growth])

    def bound(self) -> np.ndarray:
        """(n,) relative bound of the uptakes."""
        return self.law.bound * self.spread()

    def spread(self) -> np.ndarray:
        """(n,) bound over its least value."""
        peclet = self.inflow / self.law.diffusivities[1]
        return 1 + np.where(is_plug(self.share), 0.0, FAST * (peclet * self.share)**2)

    def _acceptor_uptake(self, donor: np.ndarray) -> np.ndarray:
        """(n,) uptake of the acceptor: for the uptake of the donor (n,), and for decay."""
        need = self.law.rates.constants.acceptor_to_donor_ratio * donor
        spare = np.maximum(self.inflow * self.supplies[0] - need, 0.0)
        limit = need + np.minimum(self._demand_of_decay(self.supplies[0]), spare)
        return _balance(need, limit, lambda acceptor: (
            need + self._demand_of_decay(self._concentration(0, acceptor))))

    def _demand_of_decay(self, acceptor: np.ndarray) -> np.ndarray:
        """(n,) uptake of the acceptor without donor."""
        return self._uptake_at(acceptor, np.zeros_like(acceptor))[0]

    def _uptake_at(self, acceptor: np.ndarray, donor: np.ndarray) -> np.ndarray:
        """(2, n) uptake of acceptor and donor at concentrations in the aggregates."""
        biomass = self.law.rates.constants.maximum_density * self.area
        return biomass * np.stack(self.law.rates.uptake(acceptor, donor))

    def _concentration(self, substrate: int, consumed: np.ndarray) -> np.ndarray:
        """(n,) mg/L in the aggregates that take up (n,) um2 mg/L/h of acceptor (0) or donor (1)."""
        supply, inflow = self.supplies[substrate], self._inflows[substrate]
        diffusivity = self.law.diffusivities[substrate]
        before, after = (np.array(kind)[:, None] for kind in self.law.transports)
        sherwood, power, plug, plug_power = np.where(is_plug(self.share), after, before)
        unmixed = plug * self.inflow * self.share**plug_power / diffusivity  # P
        used = np.divide(consumed, inflow, out=np.zeros_like(consumed), where=supply > 0)
        used = np.clip(used, 1e-12, 1 - 1e-12)
        mean = (1 - used - unmixed * used / np.log1p(-used)) / (1 + unmixed)
        resistance = 1 / (sherwood * self.share**power * diffusivity)  # 1 / (S D), h/um2
        return np.maximum(supply * mean - consumed * resistance, 0.0)

    @cached_property
    def _inflows(self) -> np.ndarray:
        """(2, n) inflow of both substrates, um2 mg/L/h."""
        return self.inflow * self.supplies


def _balance(low: np.ndarray, high: np.ndarray, rate: Callable) -> np.ndarray:
    """(n,) x between low and high with rate(x) = x, for a rate that falls with x.

    Regula falsi in Illinois's form: the value at an end that stays twice counts half. The slope of
    rate(x) - x is -1 or less, so that x errs by at most rate(x) - x, and by at most high - low.
    """
    error = ERROR * (high - low)
    over, under = rate(low) - low, rate(high) - high
    previous = np.zeros_like(low)
    for step in range(MOST_STEPS):
        part = np.divide(over, over - under, out=np.full_like(low, 0.5), where=over > under)
        x = low + (high - low) * (0.5 if step % 3 == 2 else np.clip(part, 0.0, 1.0))
        excess = rate(x) - x
        if (np.minimum(np.abs(excess), high - low) <= error).all():
            break
        side = np.sign(excess)
        weight = np.where(side == previous, 0.5, 1.0)
        low, high = np.where(side >= 0, x, low), np.where(side <= 0, x, high)
        over = np.where(side >= 0, excess, weight * over)
        under = np.where(side <= 0, excess, weight * under)
        previous = side
    return x
