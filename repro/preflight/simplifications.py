"""Thresholds beyond which a simplification of a scene does not hold, each with its reason."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import chain
from typing import Any

from repro.fem import sizing
from repro.march.step_control import SHORTEST
from repro.model.brinkman import ACROSS
from repro.model.kinetics import THINNEST
from repro.model.meshing import (
    MOST_REFINED,
    film,
    least_gap,
    resolution,
    walls_of,
)
from repro.model.pore import Pore
from repro.model.surface import least_stretched
from repro.model.transport_in_time import transport_in_time
from repro.preflight import numbers
from repro.preflight.numbers import Number, Sizes
from repro.scene import Kinetics, Scene
from repro.scene.keys import RATIO

#: The numbers of a scene by their names.
Numbers = dict[str, Number]
#: Yields warnings from a scene, its numbers and the sizes of its aggregates.
Check = Callable[[Scene, Numbers, Sizes], Iterator["Caveat"]]

#: (1) neglects inertia, whose ratio to the viscous forces is of the order of the Reynolds number.
REYNOLDS = 0.1
#: Linear elements may overshoot where a concentration changes within an element of a cell Peclet
#: number above this.
CELL_PECLET = 2.0
#: Largest ratio of the time of transport, or of the transit of water, to the time of growth for
#: profiles at rest in each shape. In base, a seed of 20 um in a pore full of the supply makes 0.5,
#: 2, 4, 7 and 19 % less biomass in 6 h than with Gear's method at ratios of the transit of 0.009,
#: 0.027, 0.05, 0.09 and 0.28.
LAG = 0.05
#: Largest relative error by one simplification, roughly. Neglected forces change the strain of the
#: aggregate. Elements that are too large for a layer change the flow through the narrowest film, or
#: the uptake.
ACCEPTED = 0.01
#: Drag on a half-cylinder on a wall in shear flow, over the wall's shear and the radius: 6.73 in
#: reference/half_cylinder.py, for a radius much smaller than the pore's width.
DRAG = 6.73
#: Largest growth in a shape update. The update uses the rates at its start and errs by about half
#: of the growth.
GROWTH_IN_A_STEP = 0.1
#: With fewer distances between nodes across a film, its flow (the cube of its thickness) depends on
#: the mesh.
ACROSS_FILM = 4.0


@dataclass(frozen=True)
class Caveat:
    """A simplification that does not hold: the key of the scene that chooses it, and the reason."""

    key: str
    text: str


def find_warnings(scene: Scene, velocity: float | None, end: Sizes | None = None) -> list[Caveat]:
    """Find the simplifications that do not hold at the sizes ``end`` or at t = 0.

    velocity: mean velocity (um/h) at t = 0, None without flow. A check that warns at both has the
    numbers of ``end``.
    """
    checks = _apply(scene, velocity, None)
    if end:
        checks = [later or first for first, later in zip(checks, _apply(scene, velocity, end))]
    return list(chain(*checks))


def _apply(scene: Scene, velocity: float | None, end: Sizes | None) -> list[list[Caveat]]:
    """The warnings of each check at t = 0, or at the sizes ``end``."""
    largest, computed = numbers.evaluate_at_largest(scene, velocity, end)
    by_name = {number.name: number for number in computed}
    sizes = end or numbers.at_start(largest)
    return [list(find(largest, by_name, sizes)) for find, parts in CHECKS
            if all(_has(scene, part) for part in parts)]


def _has(scene: Scene, part: str) -> bool:
    """Whether a scene has a section, a subsection or a key."""
    section: object = scene
    for name in part.split("."):
        section = section and getattr(section, name)
    return section not in (None, ())


#: Each check and the parts of a scene that it needs.
CHECKS: list[tuple[Check, tuple[str, ...]]] = []


def _check(*parts: str) -> Callable[[Check], Check]:
    """Add a function to the checks. It runs only if the scene has all ``parts``, so no warning
    mentions a part that the scene leaves out."""
    def add(find: Check) -> Check:
        CHECKS.append((find, parts))
        return find

    return add


@_check("flow")
def _inertia(scene: Scene, computed: Numbers, sizes: Sizes) -> Iterator[Caveat]:
    reynolds = computed["Reynolds"].start
    if reynolds > REYNOLDS:
        yield Caveat("flow", f"the Reynolds number is {reynolds:.2g}, above {REYNOLDS:g}: "
                     "Stokes flow (1) neglects inertia, which is about this fraction of the "
                     "viscous forces")


@_check("flow", "substrates")
def _cells(scene: Scene, computed: Numbers, sizes: Sizes) -> Iterator[Caveat]:
    cell = computed["cell Peclet"].start
    if not scene.numerics.scheme.follows_layers and cell > CELL_PECLET:
        required = scene.numerics.refinement * cell / CELL_PECLET
        yield Caveat("numerics.refinement", f"the cell Peclet number is {cell:.2g}, above "
                     f"{CELL_PECLET:g}: linear elements may overshoot where concentrations are "
                     f"steep{_resolving(required)}; the presets fast and accurate refine by "
                     "themselves")


@_check("aggregates", "substrates")
def _diffusivities(scene: Scene, computed: Numbers, sizes: Sizes) -> Iterator[Caveat]:
    """Warn if only one of two related values of Table 1 is changed."""
    for name, substrate in scene.substrates.modelled.items():
        kind: Any = type(substrate)
        table = kind()
        inside = substrate.diffusivity_in_aggregate
        if substrate.diffusivity != table.diffusivity and inside == table.diffusivity_in_aggregate:
            yield Caveat(f"substrates.{name}.diffusivity_in_aggregate", "it still has the "
                         f"value of Table 1, now {100 * inside / substrate.diffusivity:.3g} % of "
                         'the changed diffusivity in water; "80 %" keeps their ratio (2.2)')


@_check("aggregates", "flow")
def _seed_film(scene: Scene, computed: Numbers, sizes: Sizes) -> Iterator[Caveat]:
    _, opposite = walls_of(scene)
    gap = (scene.pore.width - numbers.at_start(scene).thickness) / opposite.part
    share = min(1.0, gap / film(scene))
    nodes = sizing.ACROSS_FILM * scene.numerics.refinement * share * scene.numerics.scheme.order
    if nodes < ACROSS_FILM:
        place, seed = max(zip(scene.aggregate_keys, scene.aggregates),
                          key=lambda each: each[1].height(scene.pore.width))
        key = f"{place}.radius" if seed.outline is None else f"{place}.outline"
        yield Caveat(key, f"the film over the seed, {gap:.2g} um, spans only "
                     f"{nodes:.2g} distances between nodes, under {ACROSS_FILM:g}: its flow "
                     "depends on the mesh, whose elements are sized for films of at least "
                     f"{film(scene):g} um (2.3.3)")


@_check("aggregates")
def _ends(scene: Scene, computed: Numbers, sizes: Sizes) -> Iterator[Caveat]:
    """Warn if the conditions at the pore's ends, of flow or of substrates, are too near."""
    if not (scene.flow or scene.substrates):
        return
    for reached in (numbers.at_start(scene), sizes):
        free = min(10 * reached.thickness, 1.5 * scene.pore.whole_width)
        if reached.reach + free > scene.pore.length / 2:
            when = f"at t = {reached.time:.3g} h" if reached.time else "from the start"
            stops = ", and the run ends if the aggregate reaches one of them"
            yield Caveat("pore.length", f"the aggregate is within {free:.3g} um of the pore's ends "
                         f"{when} (reach {reached.reach:.3g} of {scene.pore.length / 2:g} um): the "
                         "conditions at the ends (3.1) are then too near"
                         + (stops if scene.growth else ""))
            return


@_check("aggregates", "flow.permeability")
def _drag_layer(scene: Scene, computed: Numbers, sizes: Sizes) -> Iterator[Caveat]:
    """Warn if elements widen the layer in which a permeable aggregate slows the water.

    The water slips on this layer: the flow through a film of thickness h beside a layer l is at
    most 1 + 3 l / h times that beside a wall.
    """
    permeability = scene.flow.permeability
    root = math.sqrt(permeability)
    size = _interface_size(scene, sizes.thickness)
    thickness = size / ACROSS
    gap = max(scene.pore.width - sizes.thickness, least_gap(scene))
    loss = 3 * (root - permeability / thickness) / gap
    if loss > ACCEPTED:
        accepted = root / (1 - ACCEPTED * gap / (3 * root))
        yield Caveat("flow.permeability", f"the flow fades in the aggregate over the root of "
                     f"the permeability, {root:.2g} um, which elements of {size:.2g} um widen to "
                     f"{thickness:.2g} um: the flow through the narrowest film, {gap:.2g} um, may "
                     f"be {100 * loss:.2g} % too small" + _resolving(resolution(scene) * thickness
                                                             / accepted))


@_check("kinetics")
def _fronts(scene: Scene, computed: Numbers, sizes: Sizes) -> Iterator[Caveat]:
    """Warn of layers thinner than elements, and of fronts of zero order that elements widen: see
    :meth:`RateLaw.on`."""
    thickness = sizes.thickness
    size = _interface_size(scene, thickness)
    nodes = size / scene.numerics.scheme.order
    front = THINNEST * math.sqrt(math.sqrt(3) / 4) * size  # equilateral triangles
    for uptake in numbers.uptakes(scene):
        layer, depth = uptake.layer, uptake.depth
        lost = (front / depth) ** 2 if uptake.law.sharp and depth else 0.0
        if lost > ACCEPTED:
            yield Caveat("numerics.refinement", f"elements widen the front behind which there is "
                         f"no {uptake.name} to {front:.2g} um, of {depth:.2g} um that the supply "
                         f"reaches: uptake may be {100 * lost:.2g} % too small"
                         + _resolving(resolution(scene) * (lost / ACCEPTED) ** 0.5))
        elif not uptake.law.sharp and layer < min(nodes, thickness):
            zero_order = uptake.law.saturates(uptake.substrate.supply)
            kind = "zero-order front" if zero_order else "layer of first-order uptake"
            yield Caveat("numerics.refinement", f"the {uptake.name} is used up in a {kind} "
                         f"of thickness (D K_s / (q X_m))^1/2 = {layer:.2g} um, thinner than the "
                         f"{nodes:.2g} um between nodes in the aggregate (a run checks the front "
                         "in its solution)" + _resolving(resolution(scene) * nodes / layer))


@_check("kinetics", "substrates.acceptor")
def _demand(scene: Scene, computed: Numbers, sizes: Sizes) -> Iterator[Caveat]:
    """Warn if Y or d_c is changed but F = COD - Y d_c is not; F occurs in (7) alone."""
    law = scene.kinetics
    table = Kinetics()
    product = law.yield_coefficient * law.decay_oxygen_demand
    table_product = table.yield_coefficient * table.decay_oxygen_demand
    is_changed = law.donor_oxygen_demand is None and product != table_product
    if is_changed and law.acceptor_to_donor_ratio == table.acceptor_to_donor_ratio:
        yield Caveat("kinetics.acceptor_to_donor_ratio", f"F still has the value of Table 1, "
                     f"{RATIO:g}, but Y d_c has changed from {table_product:.3g} to {product:.3g}, "
                     "and F = COD - Y d_c (7); replace F by donor_oxygen_demand (COD), from which "
                     "it is computed")


@_check("growth")
def _lag(scene: Scene, computed: Numbers, sizes: Sizes) -> Iterator[Caveat]:
    lag = computed["transport over growth time"].start
    if lag > LAG and not transport_in_time(scene.numerics.transport).stores:
        permeable = _has(scene, "flow.permeability")
        remedy = '; "gear" with numerics.preset = "paper" integrates them in time'
        yield Caveat("numerics.transport", f"transport takes {lag:.2g} of the time of growth, "
                     f"above {LAG:g}: quasi-steady substrates err by about this fraction"
                     f"{'' if permeable else remedy}")


@_check("growth", "flow")
def _transit(scene: Scene, computed: Numbers, sizes: Sizes) -> Iterator[Caveat]:
    transit = computed.get("transit over growth time")  # not of water that stands still
    if transit and transit.start > LAG:
        yield Caveat("flow", f"water takes {transit.start:.2g} of the time of growth to pass the "
                     f"pore, above {LAG:g}: steady profiles in each shape (3.3.2) ignore the "
                     "substrates that the pore contained before, so the biomass may err by this "
                     "fraction")


@_check("growth", "flow")
def _forces(scene: Scene, computed: Numbers, sizes: Sizes) -> Iterator[Caveat]:
    stress = computed["fluid stress over modulus"]
    strain = max(stress.start, stress.end or 0.0)
    if not scene.growth.has_fluid_forces and strain > ACCEPTED:
        stressed = scene.growth.new_biomass == "stressed"
        setting = '"included"' + ("" if stressed else ' with growth.new_biomass = "stressed"')
        yield Caveat("growth.fluid_forces", f"the fluid's stress reaches {strain:.2g} of mu_L, "
                     f"above {ACCEPTED:g}: it strains the aggregate by about this fraction, and "
                     f"the scene neglects it (2.3.3); {setting} models it")


@_check("growth", "flow")
def _strengths(scene: Scene, computed: Numbers, sizes: Sizes) -> Iterator[Caveat]:
    """Warn if the forces of the flow do not count against a strength."""
    for key in ("bonding_strength", "tensile_strength"):
        is_set = getattr(scene.growth, key) is not None
        if is_set and not scene.growth.has_fluid_forces:
            yield Caveat(f"growth.{key}", "the flow cannot exceed it, since the scene neglects the "
                         "fluid's forces, and only the stress of growth counts; "
                         'growth.fluid_forces = "included" adds the forces')


@_check("growth", "flow")
def _support(scene: Scene, computed: Numbers, sizes: Sizes) -> Iterator[Caveat]:
    """Warn if the shape depends on how a wall bears the water's force on a sliding aggregate."""
    if scene.growth.bonded or not scene.growth.has_fluid_forces:
        return
    stress = computed["fluid stress over modulus"]
    force = DRAG * stress.start + (stress.end or 0.0)
    if force > ACCEPTED:
        yield Caveat("growth.wall", f"the water's force reaches {force:.2g} of mu_L times the "
                     f"aggregate's thickness, above {ACCEPTED:g}: a sliding aggregate is kept in "
                     "place by a traction of an assumed distribution, and its shape depends "
                     'on it by about this fraction; growth.wall = "bonded" computes the traction')


@_check("growth")
def _steps(scene: Scene, computed: Numbers, sizes: Sizes) -> Iterator[Caveat]:
    grown = numbers.fastest_growth(scene) * scene.growth.time_step
    if not scene.numerics.scheme.controls_error and grown > GROWTH_IN_A_STEP:
        yield Caveat("growth.time_step", f"the aggregate grows by {100 * grown:.2g} % in a shape "
                     f"update, above {100 * GROWTH_IN_A_STEP:g} %: an update uses the "
                     'rates at its start; choose a shorter one, or numerics.preset = "fast"')


def _interface_size(scene: Scene, thickness: float) -> float:
    """The size (um) of elements at the interface of an aggregate of a thickness (um)."""
    size = min(thickness / sizing.ACROSS_AGGREGATE, scene.pore.width / sizing.ACROSS_PORE)
    return size / resolution(scene)


def _resolving(refinement: float) -> str:
    """Name the refinement that resolves a thin layer, with three digits, rounded up."""
    unit = 10.0 ** (math.floor(math.log10(refinement)) - 2)
    sufficient = unit * math.ceil(refinement / unit)
    if sufficient <= MOST_REFINED:
        return f"; numerics.refinement = {sufficient:.3g} would resolve it"
    return f"; no refinement up to {MOST_REFINED:g} resolves it"


def warn_missed_tolerance(scene: Scene, worst: float, count: str = "") -> Iterator[Caveat]:
    """Warn if the error estimate of a shortest step exceeds the tolerance.

    worst: the largest of these estimates, 0 if none exceeds it; count: number of steps in words.
    """
    if worst:
        yield Caveat("numerics.tolerance", f"{scene.numerics.tolerance:g} was not met{count}: the "
                     f"smallest allowed step, growth.time_step / {1 / SHORTEST:g}, errs by "
                     f"{worst:.2g} (estimate)")


def warn_missing_rows(rows: list[tuple[float, str]]) -> Iterator[Caveat]:
    """Warn about rows that could not be computed; rows: their times (h) and the reasons."""
    if rows:
        times = [f"{time:g}" for time, _ in rows]
        yield Caveat("output.times", f"the run has no row at {', '.join(times)} h, because the "
                     f"state at this time could not be computed; at {times[0]} h: {rows[0][1]}")


def warn_surface(pore: Pore) -> Iterator[Caveat]:
    """Warn if creases begin to lower the energy of the surface, or if positions at t = 0 fold."""
    if not pore.bodies:
        return
    if not all(body.origin_known for body in pore.bodies):
        yield Caveat("position_t0_um", f"from t = {pore.time:.4g} h on the positions at t = 0 "
                     "fold: fields have no displacement, position at t = 0, theta and J; nothing "
                     'else depends on them with growth.new_biomass = "stress_free"')
    limit = pore.bodies[0].solid.energy.crease
    if limit is None:
        return
    crease = least_stretched(pore)
    if crease.least >= limit:
        return
    x, y = crease.place
    yield Caveat("growth.new_biomass", f"from t = {pore.time:.4g} h on growth compresses the "
                 f"aggregate's surface near x = {x:.4g}, y = {y:.4g} um to an elastic stretch of "
                 f"{crease.least:.3f}, below {limit:g}: a crease there would lower the energy, "
                 "and only a surface without flaws stays smooth; "
                 '"stress_free" avoids this')
