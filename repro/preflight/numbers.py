"""Dimensionless numbers of a scene, which justify its simplifications.

Each has a value at t = 0 and, if it depends on the size of the aggregate, a value at the size that
the aggregate reaches. Tables of the scene have their largest values.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from repro.fem.outline import Outline
from repro.model.flow import MPA_PER_UM
from repro.model.kinetics import rate_law
from repro.model.meshing import Meshing, initial_outlines, least_gap, sized
from repro.model.pore import Pore
from repro.model.resistance import resistance_of
from repro.model.uptake_law import UptakeLaw
from repro.scene import Scene, Substrate, at_largest, at_time


@dataclass(frozen=True)
class Number:
    """A dimensionless number: its name, its value at t = 0, its value at the sizes that the
    aggregate reaches (None if they are unknown), and its definition."""

    name: str
    start: float
    end: float | None
    definition: str


@dataclass(frozen=True)
class Sizes:
    """The aggregates at a time (h): area (um2) of all, largest thickness (um), reach (um) to either
    side of the origin; contact: does one touch the opposite wall? length: twice the reach of the
    only one, or the sum of the lengths of several (um)."""

    time: float
    area: float
    thickness: float
    reach: float
    contact: bool
    length: float

    @classmethod
    def of(cls, time: float, sizes: Sequence[tuple[float, float, float, float]],
           thin: float) -> Sizes:
        """Sizes of aggregates with area, thickness, upstream and downstream end; thin: thickness
        above which one touches the opposite wall."""
        if not sizes:
            return cls(time, 0.0, 0.0, 0.0, False, 0.0)
        areas, thicknesses, first, last = zip(*sizes)
        reach = max(max(-x for x in first), max(last))
        length = sum(last) - sum(first) if len(sizes) > 1 else 2 * reach
        return cls(time, sum(areas), max(thicknesses), reach, max(thicknesses) > thin, length)


def at_start(scene: Scene) -> Sizes:
    """Sizes of the seeds; zero without an aggregate."""
    drawn = (_sizes(outline) if seed.outline else
             (math.pi / 2 * seed.radius**2, seed.radius, seed.position - seed.radius,
              seed.position + seed.radius)
             for seed, outline in zip(scene.aggregates, initial_outlines(scene)))
    return Sizes.of(0.0, list(drawn), scene.pore.width - least_gap(scene))


def reached(pore: Pore) -> Sizes:
    """Sizes of the aggregates of a pore."""
    sizes = Sizes.of(pore.time, list(map(_sizes, pore.outlines)), math.inf)
    return replace(sizes, contact=pore.contact)


def _sizes(outline: Outline) -> tuple[float, float, float, float]:
    """Area, thickness, upstream and downstream end of an aggregate."""
    return outline.area, outline.thickness, outline.upstream, outline.downstream


def fastest_growth(scene: Scene) -> float:
    """F3 / X_A (1/h) at the concentrations of the supply (9)."""
    supplies = [kind.supply for kind in scene.substrates.modelled.values()]
    return float(rate_law(scene.substrates, scene.kinetics).growth_rate(*supplies))


@dataclass(frozen=True)
class Uptake:
    """Uptake of one substrate: its name, its description, its law, and q X_m (mg/L/h), the uptake
    per its own fraction m if the other substrate is in excess."""

    name: str
    substrate: Substrate
    law: UptakeLaw
    rate: float

    @property
    def per_layer(self) -> float:
        """(q X_m / (K_s D))^1/2 (1/um), one over the thickness of a layer of first-order uptake."""
        inside = self.substrate.diffusivity_in_aggregate
        return math.sqrt(self.rate / (self.law.half_saturation * inside))

    @property
    def layer(self) -> float:
        """(D K_s / (q X_m))^1/2 (um); infinite without uptake or supply."""
        return 1 / self.per_layer if self.rate and self.substrate.supply else math.inf

    @property
    def depth(self) -> float:
        """Depth (um) that the supply reaches at the largest uptake; infinite without uptake."""
        supply = self.substrate.supply
        largest = self.rate * self.law.largest(supply)
        inside = self.substrate.diffusivity_in_aggregate
        return math.sqrt(2 * inside * supply / largest) if largest else math.inf


def uptakes(scene: Scene) -> Iterator[Uptake]:
    """Uptake of the modelled substrates, (7)-(8)."""
    kinds = scene.substrates.modelled
    rates = rate_law(scene.substrates, scene.kinetics)
    laws = dict(zip(kinds, rates.uptake_law))
    largest = {name: laws[name].largest(kind.supply) for name, kind in kinds.items()}
    per_fraction = {"acceptor": rates.per_acceptor(largest.get("donor", 1.0)),
                    "donor": rates.per_donor(largest.get("acceptor", 1.0))}
    for name, kind in kinds.items():
        rate = per_fraction[name] * scene.kinetics.maximum_density
        yield Uptake(name, kind, laws[name], rate)


def numbers(scene: Scene, speed: float | None, end: Sizes | None = None) -> list[Number]:
    """The numbers of all sections of the scene.

    speed: mean velocity at t = 0 (um/h); end: the sizes that the aggregate reaches.
    """
    computed: list[Number] = []
    if speed is not None:
        reynolds = speed * scene.pore.whole_width / scene.flow.kinematic_viscosity
        computed.append(Number("Reynolds", reynolds, None, "u W / nu"))
    if speed is not None and scene.substrates:
        for name, substrate in scene.substrates.modelled.items():
            peclet = speed * scene.pore.whole_width / substrate.diffusivity
            computed.append(Number(f"Peclet, {name}", peclet, None, "u W / D, D in water"))
        cell = 1.5 * speed * sized(scene).largest / scene.substrates.slowest
        computed.append(Number("cell Peclet", cell, None,
                               "1.5 u h / D, h of the largest elements, the smallest D"))
    if scene.kinetics:
        computed += _taken_up(scene, speed, end)
    if scene.growth:
        computed += _grown(scene, speed, end)
    return computed


def evaluate_at_largest(scene: Scene, velocity: float | None,
                        end: Sizes | None = None) -> tuple[Scene, list[Number]]:
    """Return the scene with each table at its largest value, and its numbers.

    velocity: mean velocity (um/h) at t = 0, None without flow; end: sizes that are reached.
    """
    most = scene.largest
    if velocity is None or scene.flow is None:
        return most, numbers(most, None, end)
    drive = at_largest(scene.flow)
    if drive.mean_velocity is not None:
        return most, numbers(most, drive.mean_velocity, end)
    rise = drive.driving_head / at_time(scene.flow, 0.0).driving_head
    return most, numbers(most, velocity * rise, end)


def _taken_up(scene: Scene, speed: float | None, end: Sizes | None) -> Iterator[Number]:
    start = at_start(scene)
    for uptake in uptakes(scene):
        per = uptake.per_layer
        yield Number(f"Thiele, {uptake.name}", start.thickness * per,
                     end.thickness * per if end else None,
                     "R (q X_m / (K_s D))^1/2, R thickness, q largest uptake, D in the aggregate")
    for uptake in uptakes(scene):
        supply = uptake.substrate.supply
        if speed and supply:
            taken_up = uptake.rate * uptake.law.fraction(supply)
            per = taken_up / (speed * scene.pore.width * supply)
            yield Number(f"Damkoehler, {uptake.name}", start.area * per,
                         end.area * per if end else None,
                         "q X_m m A / (u W C), uptake of the area A at the supply over the inflow")


def _grown(scene: Scene, speed: float | None, end: Sizes | None) -> Iterator[Number]:
    across = half_length(scene) if speed is None else scene.pore.whole_width
    length = "l half of the meshed part" if speed is None else "l = W"
    yield Number("transport over growth time",
                 fastest_growth(scene) * across**2 / scene.substrates.slowest, None,
                 f"(l^2 / D) F3 / X_A, {length}")
    if speed:
        passed = scene.pore.length / speed
        yield Number("transit over growth time", fastest_growth(scene) * passed, None,
                     "(L / u) F3 / X_A")
    if speed is not None:
        yield Number("fluid stress over modulus", *stresses(scene, speed, end),
                     "shear 6 rho nu u / W at t = 0; later the pressure drop over the "
                     "aggregate; over mu_L")


def half_length(scene: Scene) -> float:
    """Half of the length (um) that is meshed at t = 0."""
    first, last = Meshing.of(scene).extent(initial_outlines(scene))
    return (last - first) / 2


def stresses(scene: Scene, speed: float, end: Sizes | None) -> tuple[float, float | None]:
    """Wall shear at t = 0, and pressure drop over the aggregate of the size ``end``, both over
    mu_L.

    The drop is the smaller one of a film as long as the aggregate and of a plug of the same
    length. It does not exceed the head of the scene.
    """
    drive = scene.flow
    width = scene.pore.width
    whole = scene.pore.whole_width
    modulus = scene.growth.shear_modulus
    viscosity = MPA_PER_UM * drive.density * drive.kinematic_viscosity / modulus
    shear = 6 * viscosity * speed / whole
    if end is None:
        return shear, None
    gap = max(width - end.thickness, least_gap(scene))
    film_loss = math.inf if end.contact else (width / gap) ** 3
    body_loss = resistance_of(drive).loss(whole)
    drop = 12 * viscosity * speed * end.length / whole**2 * min(body_loss, film_loss)
    if drive.head is not None:
        drop = min(drop, MPA_PER_UM * drive.density * drive.gravity * drive.head / modulus)
    return shear, drop
