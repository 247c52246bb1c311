"""Dimensionless numbers of a scene, which justify its simplifications.

Each has a value at t = 0 and, if the aggregate grows, a bound at ``growth.end``. The bound replaces
unknowns of the run: tables of the scene have their largest values, and the aggregate grows at the
rate of the supply (9) in the layer that the supply reaches. In the run the aggregate is no larger,
and touches the opposite wall no earlier.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

from repro.fem.sizing import meshed_extent
from repro.fem.walls import whole_width
from repro.model.flow import MPA_PER_UM
from repro.model.kinetics import rate_law
from repro.model.pore import initial_outline, least_gap, sized, walls_of
from repro.model.uptake_law import UptakeLaw
from repro.scene import Scene, Substrate, at_largest, at_time

#: Number of steps in which the bound on the growth is integrated.
STEPS = 2000
#: The largest exponent of growth in a step.
LARGEST = 50.0
#: Exponent of the compression of a rim over that of its growth, after contact, if the core
#: starves. Fitted to 100 pores (docs/design.md).
SQUEEZE = 0.1


@dataclass(frozen=True)
class Number:
    """A dimensionless number: its name, its value at t = 0, its bound at growth.end (None without
    growth), and its definition."""

    name: str
    start: float
    end: float | None
    definition: str


@dataclass(frozen=True)
class Sizes:
    """The size of the aggregate: area (um2), thickness (um), reach (um) to either side of the
    origin; contact: the time (h) at which it touches the opposite wall, None without contact."""

    area: float
    thickness: float
    reach: float
    contact: float | None


def sizes(scene: Scene, area: float, contact: float | None = None) -> Sizes:
    """Sizes of a half-disc of an area (um2), or of a plug if the half-disc exceeds the pore."""
    width = scene.pore.width
    radius = math.sqrt(2 * area / math.pi)
    if radius <= width:
        return Sizes(area, radius, radius, contact)
    return Sizes(area, width, 0.5 * area / width + (1 - math.pi / 4) * width, contact)


def at_start(scene: Scene) -> Sizes:
    """Sizes of the seed."""
    seed = scene.aggregate
    if seed.outline is None:
        touches = scene.pore.width - seed.radius < least_gap(scene)
        current = sizes(scene, math.pi / 2 * seed.radius**2, 0.0 if touches else None)
        return replace(current, reach=current.reach + abs(seed.position))
    outline = initial_outline(scene)
    touches = scene.pore.width - outline.thickness < least_gap(scene)
    reach = max(-outline.upstream, outline.downstream)
    return Sizes(outline.area, outline.thickness, reach, 0.0 if touches else None)


@lru_cache(maxsize=1)
def at_end(scene: Scene) -> Sizes:
    """Bound on the sizes at growth.end; those of the seed without growth."""
    current = at_start(scene)
    if scene.growth is None:
        return current
    offset = max(0.0, current.reach - sizes(scene, current.area).reach)
    rate = max(0.0, fastest_growth(scene))  # a decaying aggregate is no larger than at the start
    layer = depth(scene)
    step = scene.growth.end / STEPS
    width = scene.pore.width
    full = width * scene.pore.length
    thin = width - least_gap(scene)
    area = current.area
    thickness = current.thickness
    contact = current.contact
    for k in range(STEPS):  # as a half-disc of the same area
        exposed = math.pi * thickness if contact is None else 2 * width
        share = min(1.0, layer * exposed / area)
        area = min(full, area * math.exp(min(LARGEST, rate * share * step)))
        radius = math.sqrt(2 * area / math.pi)
        thickness = min(radius, width)
        if radius >= thin and contact is None:
            contact = (k + 1) * step
    current = sizes(scene, area, contact)
    return replace(current, reach=current.reach + offset)


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
        if not (self.rate and self.substrate.supply):
            return math.inf
        inside = self.substrate.diffusivity_in_aggregate
        return math.sqrt(inside * self.law.half_saturation / self.rate)

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
    laws = dict(zip(kinds, rates.both))
    largest = {name: laws[name].largest(kind.supply) for name, kind in kinds.items()}
    per_fraction = {"acceptor": rates.per_acceptor(largest.get("donor", 1.0)),
                    "donor": rates.per_donor(largest.get("acceptor", 1.0))}
    for name, kind in kinds.items():
        rate = per_fraction[name] * scene.kinetics.maximum_density
        yield Uptake(name, kind, laws[name], rate)


def depth(scene: Scene) -> float:
    """Depth (um) that the scarcer substrate reaches in biomass with the largest uptake."""
    return min(uptake.depth for uptake in uptakes(scene))


def rim_stretch(scene: Scene, uptake: float) -> float:
    """Estimate of the elastic stretch along the rim of a half-disc at growth.end (docs/scope.md).

    uptake: uptake of biomass at the supply over the inflow of the substrate, per area, 1/um2.
    """
    scarcer = min(uptakes(scene), key=lambda substrate_uptake: substrate_uptake.depth)
    rate = max(fastest_growth(scene), 0.0)
    step = scene.growth.end / STEPS
    start = at_start(scene).area
    touching = scene.pore.width - least_gap(scene)
    spanning = math.pi / 2 * touching**2
    area, grown, squeezed = start, 0.0, 0.0
    for _ in range(STEPS):
        arc = math.pi * min(math.sqrt(2 * area / math.pi), touching)
        fed = min(area, scarcer.depth * arc)
        fed /= max(1.0, uptake * fed)
        rim = min(area, max(fed, scarcer.layer * arc))
        growth = min(LARGEST, rate * step * fed / rim)
        if area < spanning:
            grown += growth
            area *= math.exp(growth * rim / area)
        elif touching > 2 * scarcer.depth:
            squeezed += growth
    return math.sqrt(area / start) * math.exp(-0.5 * grown - SQUEEZE * squeezed)


def numbers(scene: Scene, speed: float | None) -> list[Number]:
    """The numbers of all sections of the scene; speed: mean velocity at t = 0 (um/h)."""
    computed: list[Number] = []
    if speed is not None:
        reynolds = speed * scene.pore.width / scene.flow.kinematic_viscosity
        computed.append(Number("Reynolds", reynolds, None, "u W / nu"))
    if speed is not None and scene.substrates:
        computed += _transported(scene, speed)
    if scene.kinetics:
        computed += _taken_up(scene, speed)
    if scene.growth:
        computed += _grown(scene, speed)
    return computed


def evaluate_at_largest(scene: Scene, velocity: float | None) -> tuple[Scene, list[Number]]:
    """Return the scene with each table at its largest value, and its numbers; velocity: mean
    velocity (um/h) at t = 0, None without flow."""
    most = scene.largest
    if velocity is None or scene.flow is None:
        return most, numbers(most, None)
    drive = at_largest(scene.flow)
    if drive.mean_velocity is not None:
        return most, numbers(most, drive.mean_velocity)
    rise = drive.driving_head / at_time(scene.flow, 0.0).driving_head
    return most, numbers(most, velocity * rise)


def _transported(scene: Scene, speed: float) -> Iterator[Number]:
    for name, substrate in scene.substrates.modelled.items():
        value = speed * scene.pore.width / substrate.diffusivity
        yield Number(f"Peclet, {name}", value, None, "u W / D, D in water")
    yield Number("cell Peclet", 1.5 * speed * sized(scene).largest / slowest(scene), None,
                 "1.5 u h / D, h of the largest elements, the smallest D")


def slowest(scene: Scene) -> float:
    """The smallest diffusivity (um2/h)."""
    return min(min(kind.diffusivity, kind.diffusivity_in_aggregate)
               for kind in scene.substrates.modelled.values())


def _taken_up(scene: Scene, speed: float | None) -> Iterator[Number]:
    start = at_start(scene)
    end = at_end(scene)
    has_growth = scene.growth is not None
    for uptake in uptakes(scene):
        per = uptake.per_layer
        yield Number(f"Thiele, {uptake.name}", start.thickness * per,
                     end.thickness * per if has_growth else None,
                     "R (q X_m / (K_s D))^1/2, R thickness, q largest uptake, D in the aggregate")
    for uptake in uptakes(scene):
        supply = uptake.substrate.supply
        if speed and supply:
            taken_up = uptake.rate * uptake.law.fraction(supply)
            per = taken_up / (speed * scene.pore.width * supply)
            at_end_of_growth = end.area * per if has_growth else None
            yield Number(f"Damkoehler, {uptake.name}", start.area * per, at_end_of_growth,
                         "q X_m m A / (u W C), uptake of the area A at the supply over the inflow")


def _grown(scene: Scene, speed: float | None) -> Iterator[Number]:
    across = half_length(scene) if speed is None else scene.pore.width
    length = "l half of the meshed part" if speed is None else "l = W"
    yield Number("transport over growth time",
                 fastest_growth(scene) * across**2 / slowest(scene), None,
                 f"(l^2 / D) F3 / X_A, {length}")
    if speed:
        passed = scene.pore.length / speed
        yield Number("transit over growth time", fastest_growth(scene) * passed, None,
                     "(L / u) F3 / X_A")
    if speed is not None:
        yield Number("fluid stress over modulus", *stresses(scene, speed),
                     "shear 6 rho nu u / W at t = 0; at the end the pressure drop over the "
                     "aggregate; over mu_L")


def half_length(scene: Scene) -> float:
    """Half of the length (um) that is meshed at t = 0."""
    seed = initial_outline(scene)
    is_full = scene.numerics.extent == "full"
    first, last = meshed_extent(seed, whole_width(walls_of(scene)), scene.pore.length, is_full)
    return (last - first) / 2


def stresses(scene: Scene, speed: float) -> tuple[float, float]:
    """Wall shear at t = 0, and pressure drop over the aggregate at the end, both over mu_L.

    The drop is the smaller one of a film as long as the aggregate and of a plug of the same
    length. It does not exceed the head of the scene.
    """
    drive = scene.flow
    width = scene.pore.width
    whole = whole_width(walls_of(scene))
    end = at_end(scene)
    modulus = scene.growth.shear_modulus
    viscosity = MPA_PER_UM * drive.density * drive.kinematic_viscosity / modulus
    gap = max(width - end.thickness, least_gap(scene))
    film_loss = math.inf if end.contact is not None else (width / gap) ** 3
    body_loss = drive.viscosity_ratio or 1 + whole**2 / 12 / drive.permeability
    drop = 12 * viscosity * speed * 2 * end.reach / whole**2 * min(body_loss, film_loss)
    if drive.head is not None:
        drop = min(drop, MPA_PER_UM * drive.density * drive.gravity * drive.head / modulus)
    return 6 * viscosity * speed / whole, drop
