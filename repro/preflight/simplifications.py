"""Thresholds beyond which a simplification of a scene does not hold, each with its reason."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from repro.fem import sizing
from repro.march.stepping import SHORTEST
from repro.model.brinkman import ACROSS
from repro.model.pore import Pore, film, resolution
from repro.model.remeshing import MOST_REFINED
from repro.model.surface import CREASE, surface
from repro.preflight import numbers
from repro.preflight.numbers import Number
from repro.scene import Kinetics, Scene
from repro.scene.keys import RATIO

#: (1) neglects inertia, whose ratio to the viscous forces is of the order of the Reynolds number.
REYNOLDS = 0.1
#: Linear elements may overshoot where a concentration changes within an element of a cell Peclet
#: number above this.
CELL_PECLET = 2.0
#: Largest ratio of the time of transport to that of growth for quasi-steady substrates.
LAG = 0.05
#: Largest ratio of the transit time of water to the time of growth for profiles at rest in each
#: shape. In base, a seed of 20 um in a pore full of the supply makes 0.5, 2, 4, 7 and 19 % less
#: biomass in 6 h than with Gear's method at ratios of 0.009, 0.027, 0.05, 0.09 and 0.28.
TRANSIT = 0.05
#: Largest strain of the aggregate, roughly, due to the neglected forces.
STRAIN = 0.01
#: Drag on a half-cylinder on a wall in shear flow, over the wall's shear and the radius: 6.73 in
#: reference/half_cylinder.py, for a radius much smaller than the pore's width.
DRAG = 6.73
#: Largest growth in a shape update. The update uses the rates at its start and errs by about half
#: of the growth.
GROWTH_IN_A_STEP = 0.1
#: The bound on the time of contact is 10 % early in the paper's pores. An end later than this many
#: times the bound is long after contact.
AFTER_CONTACT = 1.2
#: With fewer distances between nodes across a film, its flow (the cube of its thickness) depends on
#: the mesh.
ACROSS_FILM = 4.0
#: The flow through the narrowest film may be too small by this share if elements do not resolve the
#: layer in which a permeable aggregate slows the water. The water slips on this layer: the flow
#: through a film of thickness h beside a layer l is at most 1 + 3 l / h times that beside a wall.
FILM_LOSS = 0.01

#: A fold is expected below this estimate of the rim's stretch (docs/design.md).
FOLD_EXPECTED = 0.7
#: The key in the warning of a crease.
CREASED = "growth.new_biomass"


@dataclass(frozen=True)
class Caveat:
    """A simplification that does not hold: the key of the scene that chooses it, and the reason."""

    key: str
    text: str


def find_warnings(scene: Scene, computed: list[Number]) -> list[Caveat]:
    """Every simplification that does not hold; computed: the numbers of the scene."""
    value = {number.name: number.start for number in computed}
    checks = [_inertia(value), _cells(scene, value), _diffusivities(scene)]
    if scene.aggregate:
        checks += [_seed_film(scene), _ends(scene), _drag_layer(scene)]
    if scene.kinetics:
        checks += [_fronts(scene), _demand(scene.kinetics)]
    if scene.growth:
        checks += [_lag(scene, value), _transit(value), _forces(scene, computed),
                   _support(scene, computed), _steps(scene), _contact(scene), _fold(scene, value)]
    return [caveat for check in checks for caveat in check]


def _inertia(value: dict[str, float]) -> Iterator[Caveat]:
    reynolds = value.get("Reynolds", 0.0)
    if reynolds > REYNOLDS:
        yield Caveat("flow", f"the Reynolds number is {reynolds:.2g}, above {REYNOLDS:g}: "
                     "Stokes flow (1) neglects inertia, which is about this fraction of the "
                     "viscous forces")


def _cells(scene: Scene, value: dict[str, float]) -> Iterator[Caveat]:
    cell = value.get("cell Peclet", 0.0)
    if scene.numerics.elements == "linear" and cell > CELL_PECLET:
        required = scene.numerics.refinement * cell / CELL_PECLET
        yield Caveat("numerics.refinement", f"the cell Peclet number is {cell:.2g}, above "
                     f"{CELL_PECLET:g}: linear elements may overshoot where concentrations are "
                     f"steep{_resolving(required)}; the presets fast and accurate refine by "
                     "themselves")


def _diffusivities(scene: Scene) -> Iterator[Caveat]:
    """Warn if only one of two related values of Table 1 is changed."""
    kinds = scene.substrates.modelled if scene.substrates and scene.aggregate else {}
    for name, substrate in kinds.items():
        table = type(substrate)(supply=substrate.supply)
        inside = substrate.diffusivity_in_aggregate
        if substrate.diffusivity != table.diffusivity and inside == table.diffusivity_in_aggregate:
            yield Caveat(f"substrates.{name}.diffusivity_in_aggregate", "it still has the "
                         f"value of Table 1, now {100 * inside / substrate.diffusivity:.3g} % of "
                         'the changed diffusivity in water; "80 %" keeps their ratio (2.2)')


def _demand(law: Kinetics) -> Iterator[Caveat]:
    """Warn if Y or d_c is changed but F = COD - Y d_c (7) is not."""
    table = Kinetics()
    product = law.yield_coefficient * law.decay_oxygen_demand
    table_product = table.yield_coefficient * table.decay_oxygen_demand
    is_changed = law.donor_oxygen_demand is None and product != table_product
    if is_changed and law.acceptor_to_donor_ratio == table.acceptor_to_donor_ratio:
        yield Caveat("kinetics.acceptor_to_donor_ratio", f"F still has the value of Table 1, "
                     f"{RATIO:g}, but Y d_c has changed from {table_product:.3g} to {product:.3g}, "
                     "and F = COD - Y d_c (7); replace F by donor_oxygen_demand (COD), from which "
                     "it is computed")


def _lag(scene: Scene, value: dict[str, float]) -> Iterator[Caveat]:
    lag = value["transport over growth time"]
    if scene.numerics.transport == "quasi_steady" and lag > LAG:
        yield Caveat("numerics.transport", f"transport takes {lag:.2g} of the time of growth, "
                     f"above {LAG:g}: quasi-steady substrates err by about this fraction; "
                     '"gear" with numerics.time = "updates" integrates them in time')


def _transit(value: dict[str, float]) -> Iterator[Caveat]:
    transit = value.get("transit over growth time", 0.0)
    if transit > TRANSIT:
        yield Caveat("flow", f"water takes {transit:.2g} of the time of growth to pass the pore, "
                     f"above {TRANSIT:g}: steady profiles in each shape (3.3.2) ignore the "
                     "substrates that the pore contained before, so the biomass may err by this "
                     "fraction")


def _forces(scene: Scene, computed: list[Number]) -> Iterator[Caveat]:
    stresses = [max(number.start, number.end or 0.0) for number in computed
            if number.name == "fluid stress over modulus"]
    strain = max(stresses, default=0.0)
    if scene.growth.fluid_forces == "neglected" and strain > STRAIN:
        yield Caveat("growth.fluid_forces", f"the fluid's stress reaches {strain:.2g} of mu_L, "
                     f"above {STRAIN:g}: it strains the aggregate by about this fraction, and the "
                     f"scene neglects it (2.3.3); {_included(scene)}")


def _support(scene: Scene, computed: list[Number]) -> Iterator[Caveat]:
    """Warn if the shape depends on how a wall bears the water's force on a sliding aggregate."""
    growth = scene.growth
    if growth.fluid_forces == "neglected" or growth.wall == "bonded":
        return
    stress = next(number for number in computed if number.name == "fluid stress over modulus")
    force = DRAG * stress.start + (stress.end or 0.0)
    if force > STRAIN:
        yield Caveat("growth.wall", f"the water's force reaches {force:.2g} of mu_L times the "
                     f"aggregate's thickness, above {STRAIN:g}: a sliding aggregate is kept in "
                     "place by a uniform traction, which is an assumption, and its shape depends "
                     'on it by about this fraction; growth.wall = "bonded" computes the traction')


def _included(scene: Scene) -> str:
    """Name the setting that includes fluid forces, if there is one."""
    if scene.flow and scene.flow.biomass == "brinkman":
        return 'no setting models it with flow.biomass = "brinkman"'
    if scene.growth.new_biomass == "stress_free":
        return '"included" with growth.new_biomass = "stressed" models it'
    return '"included" models it'


def _fronts(scene: Scene) -> Iterator[Caveat]:
    thickness = numbers.at_end(scene).thickness
    nodes = _interface_size(scene) / scene.numerics.order
    for uptake in numbers.uptakes(scene):
        layer = uptake.layer
        if layer < min(nodes, thickness):
            zero_order = uptake.law.saturates(uptake.substrate.supply)
            kind = "zero-order front" if zero_order else "layer of first-order uptake"
            yield Caveat("numerics.refinement", f"the {uptake.name} is used up in a {kind} "
                         f"of thickness (D K_s / (q X_m))^1/2 = {layer:.2g} um, thinner than the "
                         f"{nodes:.2g} um between nodes in the aggregate (a run checks the front "
                         "in its solution)" + _resolving(resolution(scene) * nodes / layer))


def _interface_size(scene: Scene) -> float:
    """The largest size (um) of elements at the interface."""
    thickness = numbers.at_end(scene).thickness
    size = min(thickness / sizing.ACROSS_AGGREGATE, scene.pore.width / sizing.ACROSS_PORE)
    return size / resolution(scene)


def _drag_layer(scene: Scene) -> Iterator[Caveat]:
    permeability = scene.flow.permeability if scene.flow else None
    if permeability is None:
        return
    root = math.sqrt(permeability)
    size = _interface_size(scene)
    thickness = size / ACROSS[scene.numerics.order]
    gap = max(scene.pore.width - numbers.at_end(scene).thickness, film(scene))
    loss = 3 * (root - permeability / thickness) / gap
    if loss > FILM_LOSS:
        accepted = root / (1 - FILM_LOSS * gap / (3 * root))
        yield Caveat("flow.permeability", f"the flow fades in the aggregate over the root of "
                     f"the permeability, {root:.2g} um, which elements of {size:.2g} um widen to "
                     f"{thickness:.2g} um: the flow through the narrowest film, {gap:.2g} um, may "
                     f"be {100 * loss:.2g} % too small" + _resolving(resolution(scene) * thickness
                                                             / accepted))


def _resolving(refinement: float) -> str:
    """Name the refinement that resolves a thin layer, with three digits, rounded up."""
    unit = 10.0 ** (math.floor(math.log10(refinement)) - 2)
    sufficient = unit * math.ceil(refinement / unit)
    if sufficient <= MOST_REFINED:
        return f"; numerics.refinement = {sufficient:.3g} would resolve it"
    return f"; no refinement up to {MOST_REFINED:g} resolves it"


def _seed_film(scene: Scene) -> Iterator[Caveat]:
    gap = scene.pore.width - numbers.at_start(scene).thickness
    share = min(1.0, gap / film(scene))
    nodes = sizing.ACROSS_FILM * scene.numerics.refinement * share * scene.numerics.order
    if nodes < ACROSS_FILM:
        key = "aggregate.radius" if scene.aggregate.outline is None else "aggregate.outline"
        yield Caveat(key, f"the film over the seed, {gap:.2g} um, spans only "
                     f"{nodes:.2g} distances between nodes, under {ACROSS_FILM:g}: its flow "
                     "depends on the mesh, whose elements are sized for films of at least "
                     f"{film(scene):g} um (2.3.3)")


def _ends(scene: Scene) -> Iterator[Caveat]:
    end = numbers.at_end(scene)
    free = min(10 * end.thickness, 1.5 * scene.pore.width)
    if end.reach + free > scene.pore.length / 2:
        when = "by growth.end" if end.reach > numbers.at_start(scene).reach else "from the start"
        yield Caveat("pore.length", f"the aggregate may come within {free:.3g} um of the pore's "
                     f"ends {when} (reach {end.reach:.3g} of {scene.pore.length / 2:g} um): the "
                     "conditions at inlet and outlet (3.1, (11)-(12)) are then too near, and the "
                     "run stops if the aggregate reaches an end")


def _steps(scene: Scene) -> Iterator[Caveat]:
    grown = numbers.fastest_growth(scene) * scene.growth.time_step
    if scene.numerics.time == "updates" and grown > GROWTH_IN_A_STEP:
        yield Caveat("growth.time_step", f"the aggregate grows by {100 * grown:.2g} % in a shape "
                     f"update, above {100 * GROWTH_IN_A_STEP:g} %: it uses the rates at "
                     'its start; choose a shorter one, or numerics.time = "midpoint"')


def warn_missed_tolerance(scene: Scene, worst: float, count: str = "") -> Iterator[Caveat]:
    """Warn if the error estimate of a shortest step exceeds the tolerance.

    worst: the largest of these estimates, 0 if none exceeds it; count: number of steps in words.
    """
    if worst:
        yield Caveat("numerics.tolerance", f"{scene.numerics.tolerance:g} was not met{count}: the "
                     f"smallest allowed step, growth.time_step / {1 / SHORTEST:g}, errs by "
                     f"{worst:.2g} (estimate)")


def _fold(scene: Scene, value: dict[str, float]) -> Iterator[Caveat]:
    """Warn if growth is expected to compress the rim around a starved core into a fold."""
    if scene.growth.new_biomass != "stressed":
        return
    uptake = max(value.get(f"Damkoehler, {name}", 0.0) for name in ("acceptor", "donor"))
    stretch = numbers.rim_stretch(scene, uptake / numbers.at_start(scene).area)
    if stretch < FOLD_EXPECTED:
        yield Caveat("growth.end", f"the surface may fold, which ends the run, before "
                     f"{scene.growth.end:g} h: the supply reaches {numbers.depth(scene):.3g} um "
                     f"into an aggregate of up to {numbers.at_end(scene).thickness:.3g} um, and "
                     f"growth may compress the rim to an elastic stretch of {stretch:.2f} or less "
                     "(estimate, `repro docs scope`)")


def warn_crease(pore: Pore) -> Iterator[Caveat]:
    """Warn if creases begin to lower the energy of the surface."""
    if pore.outline is None or surface(pore).least >= CREASE:
        return
    crease = surface(pore)
    x, y = crease.place
    yield Caveat(CREASED, f"from t = {pore.time:.4g} h on growth compresses the aggregate's "
                 f"surface near x = {x:.4g}, y = {y:.4g} um to an elastic stretch of "
                 f"{crease.least:.3f}, below {CREASE:g}: a crease there would lower the energy, "
                 "and only a surface without flaws stays smooth; "
                 '"stress_free" avoids this')


def _contact(scene: Scene) -> Iterator[Caveat]:
    contact = numbers.at_end(scene).contact
    if contact is not None and scene.growth.end > AFTER_CONTACT * contact:
        yield Caveat("growth.end", f"contact with the opposite wall is expected from {contact:.3g} "
                     f"h on, long before {scene.growth.end:g} h: then conductivity (2.3.3) is "
                     'accurate to a few percent with numerics.elements = "linear" (preset '
                     "paper), and to 1 % with curved triangles (preset fast)")
