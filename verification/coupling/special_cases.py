"""Smaller models that the whole one must become: no growth, no biomass, no viscosity jump, no stiffness.

Growth where nothing is scarce: the area follows (9)-(10), integrated by hand.

What must not matter at all: units, left and right, and, where the theory is reversible, the flow's direction.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from reference import poiseuille
from repro.fem.mesh import Mesh
from repro.fem.outline import FREE
from repro.fem.space import Space
from repro.march.loop import Instant
from repro.march.simulation import shaped, simulate
from repro.model import flow, pore
from repro.scene import Scene, load_scene
from verification.coupling import PRESETS, every
from verification.kernel.case import at_least, at_most, case, study
from verification.problems import pairs, runs
from verification.problems.channels import both


@case("coupling-no-growth", kind="property",
      norm="t = 0 against 1 h: arrays of geometry, flow and C that differ in any bit; largest |X_A / X_m - 1|",
      claim="Biomass that neither takes up nor decays leaves the pore fixed, and C the supply",
      mutants=("increase-not-taken",), over=runs.EVERY, ways="paper")
def no_growth(*changes: str):
    scene = runs.base("1 h", 'kinetics.decay_coefficient="0 1/d"', 'kinetics.maximum_utilization_rate="0 1/d"',
                      *changes)
    first, last = list(simulate(scene))
    pairs = [(one.pore.mesh.points, one.pore.theta, one.pore.inert, one.solved.flow.velocity, one.solved.flow.head,
              one.solved.concentrations.acceptor, one.solved.concentrations.donor) for one in (first, last)]
    moved = sum(not np.array_equal(a, b) for a, b in zip(*pairs))
    return [at_most("arrays moved", moved, 0.0, "nothing acts on them: bit for bit"),
            at_most("X_A", runs.density_drift(scene, last), 1e-14, "(34) multiplies and divides by the same areas"),
            at_most("C over the supply, less 1", _lack(last), *(EVEN if scene.numerics.order == 1 else UNEVEN))]


def _lack(instant: Instant) -> float:
    """Largest |C / supply - 1|."""
    return float(np.abs(both(instant.solved.concentrations) / 10.0 - 1).max())


def _poiseuille(scene: Scene) -> float:
    """Mean velocity (um/h) of the clean channel under the scene's head."""
    viscosity = scene.flow.kinematic_viscosity / scene.flow.gravity
    return scene.flow.head / poiseuille.head_loss(scene.pore.length, scene.pore.width, 1.0, viscosity)


#: How far C may be from the supply. w is divergence-free for the very functions that carry C where these are linear;
#: Taylor-Hood's u is so for functions of one order less, and jumps of viscosity bend it.
EVEN = 1e-12, runs.ROUND_OFF
UNEVEN = 1e-4, "div u is zero against functions of one order less than C's: error in space"


REFINEMENTS = (1.0, 1.4, 2.0, 2.8)
#: Of linear elements in a clean channel, and of the others.
LAYER = "first order: the stabilisation spoils one layer of elements at both ends of the mesh"
PARABOLA = "elements hold the parabola: round-off"


@case("coupling-clean-channel", kind="exact",
      norm="refinement 1 to 2.8: mean velocity under the head relative to Poiseuille's; largest |C / supply - 1|",
      claim="A scene without an aggregate is a clean channel: Poiseuille's flow under the head, and C the supply "
            "everywhere",
      mutants=("extent-not-subtracted", "head-on-the-mesh-alone"), over=every(0.3), ways="paper")
def clean_channel(*changes: str):
    """The order of linear elements; what the others hold."""
    if load_scene("base", changes).numerics.order > 1:
        error, lack = _clean(*changes)
        yield at_most("mean velocity", error, 1e-9, PARABOLA)
    else:
        errors, lacks = zip(*(_clean(*changes, f"numerics.refinement={refinement}") for refinement in REFINEMENTS))
        lack = max(lacks)
        yield study("mean velocity", 1 / np.array(REFINEMENTS), errors, 1, LAYER, ceiling=2e-3)
    yield at_most("C", lack, 1e-12, runs.ROUND_OFF)


def _clean(*changes: str) -> tuple[float, float]:
    """Relative error of the mean velocity; largest |C / supply - 1|."""
    scene = load_scene("base", changes)
    now = next(simulate(replace(scene, aggregate=None, kinetics=None, growth=None)))
    return abs(now.solved.flow.mean_velocity / _poiseuille(scene) - 1), _lack(now)


@case("coupling-equal-viscosities", kind="property",
      norm="relative difference of the mean velocity from Poiseuille's, and of u from that in an empty channel on the "
           "same mesh; base from 25 um, 1 h, lambda = 1",
      claim="An aggregate as thin as water, growing, is hydraulically an empty channel",
      mutants=("tau-jumps", "stale-flow", "extent-not-subtracted"), over=runs.EVERY, ways="paper")
def equal_viscosities(*changes: str):
    scene = runs.base("1 h", 'aggregate.radius="25 um"', "flow.viscosity_ratio=1.0", *changes)
    first, last = list(simulate(scene))
    grid, found = last.pore.mesh, last.solved.flow
    bare = Mesh.of(grid.points, grid.cells, np.zeros_like(grid.biomass), np.empty(0, int), grid.width, grid.ends)
    empty = flow.unit_flow(Space(bare, last.pore.space.order), 7.0)
    return [at_most("u", np.abs(found.velocity / found.mean_velocity - empty.velocity).max(), 1e-13,
                    runs.ROUND_OFF),
            at_most("mean velocity", abs(found.mean_velocity / _poiseuille(scene) - 1), 5e-3,
                    "linear elements: first order in the mesh, 0.3 % as in coupling-clean-channel"),
            at_least("growth of the area", last.pore.outline.area / first.pore.outline.area, 1.1,
                     "else nothing is tested")]


@case("coupling-stiffness", kind="property", norm="largest difference of any node's place (um) at 1 h",
      claim="mu_L does not matter without tractions: 0.001 or 10 MPa make the same aggregate",
      mutants=("modulus-in-the-shape",), over=runs.EVERY, ways="paper")
def stiffness(*changes: str):
    soft, stiff = (runs.last(runs.base("1 h", f'growth.shear_modulus="{value} MPa"', *changes)).pore
                   for value in (0.001, 10))
    seed = pore.seeded(runs.base("1 h", *changes)).outline.area
    return [at_most("places", np.abs(soft.mesh.points - stiff.mesh.points).max(), 0.0,
                    "it is nowhere in the equations without tractions"),
            at_least("growth of the area", soft.outline.area / seed, 1.1, "else nothing is tested")]


def _everywhere(scene):
    """The scene without flow, diffusion a million times D_A and more."""
    return runs.with_diffusivities(runs.without_flow(scene), lambda water, biomass: (1e13, 1e13))


EVERY_HOUR = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
OF_UPDATES = 1e-8, "J = theta to the stabilisation, and C to 1e-8 of the supply: D is a million times D_A"
OF_LONG_STEPS = 1e-6, "J = theta, and C to 1e-7 of the supply"
#: Changes of a scene, by label, whose steps are those of a preset.
LONG = {**{kind: (runs.by("fast"), runs.of(kind), runs.coarser(kind, 0.2)) for kind in runs.ELEMENTS},
        "accurate": (runs.by("accurate"),)}


@case("coupling-uniform-growth", kind="exact",
      norm="largest relative error of area and mass, every hour to 6 h; largest deviation of the outline from a "
           "half-disc",
      claim="Where diffusion holds the supply everywhere the aggregate stays a half-disc of exactly exp-growing mass, "
            "through a remesh",
      mutants=("growth-three-percent-low", "euler-biomass", "inert-not-in-the-area", "theta-anew-at-a-remesh",
               "geometry-of-the-step-before"),
      over={kind: (EVERY_HOUR, *OF_UPDATES, *changes) for kind, changes in every(0.3).items()}, ways="paper")
@case("coupling-curved-uniform-growth", kind="exact",
      norm="relative error of area and mass; largest deviation of the outline from a half-disc",
      claim="Where diffusion holds the supply everywhere the midpoint rule keeps a half-disc of exactly exp-growing "
            "mass through remeshes, in few long steps",
      mutants=("theta-power", "curved-mass-lost", "curved-half-of-the-half"),
      over={kind: ((9.0,), *OF_LONG_STEPS, *changes) for kind, changes in LONG.items()}, ways="fast",
      because="paper: coupling-uniform-growth")
def uniform_growth(hours: tuple[float, ...], most: float, why: str, *changes: str):
    """Checks of a run to the last of some hours, with rows at these."""
    scene = _everywhere(runs.base(f"{hours[-1]} h", *changes, times=", ".join(f'"{hour} h"' for hour in hours)))
    seed, instants = pore.seeded(scene).outline, runs.ours(scene)
    expected = seed.area * np.array([runs.mass_after(scene, hour) for hour in hours])
    sizes = {"area": [instant.pore.outline.area for instant in instants],
             "mass": [instant.pore.mass / scene.kinetics.maximum_density for instant in instants]}
    for name, size in sizes.items():
        yield at_most(name, np.abs(size / expected - 1).max(), most, why)
    yield at_most("outline", _unround(instants[-1], expected[-1]), *_roundness(scene, seed))
    yield at_least("remeshes", sum(i.remeshes for i in instants), 1.0, "else that is not tested")


def _roundness(scene, seed) -> tuple[float, str]:
    """How far the outline may be from a half-disc, and why."""
    if seed.geometry == 2:
        return 1e-4, "arcs that are parabolas: (edge / R)^4 / 100"
    chord = 1 - np.sqrt(2 * seed.area / np.pi) / scene.aggregate.radius
    return 1.5 * chord + 1e-3, "polygon for arc, and linear elements"


def _unround(instant, area: float) -> float:
    """Largest deviation of the interface's nodes from the half-disc of an area, over its radius."""
    outline = instant.pore.outline
    radius = np.hypot(*outline.points[outline.wall == FREE].T)
    return float(np.abs(radius / np.sqrt(2 * area / np.pi) - 1).max())


@case("coupling-units", kind="property", norm="relative difference at 2 h",
      claim="A pore eight times larger or smaller, with transport to match, grows alike to the last bits: nothing has "
            "a scale of its own",
      mutants=("length-scale",), over=runs.EVERY, ways="paper")
def units(*changes: str):
    scene, checks = runs.base("2 h", *changes), []
    speed = next(simulate(scene)).solved.flow.mean_velocity
    own = runs.numbers(runs.last(_scaled(scene, 1.0, speed)))
    for factor in (8.0, 0.125):
        other = runs.numbers(runs.last(_scaled(scene, factor, speed)))
        for quantity, power in (("area", 2), ("upstream tip", 1), ("conductivity", 2)):
            checks.append(at_most(f"{quantity}, lengths times {factor:g}",
                                  abs(other[quantity] / own[quantity] / factor**power - 1), 1e-14,
                                  "powers of two are exact: even the mesher does the same"))
    return checks


def _scaled(scene, factor: float, speed: float):
    """The scene with lengths times a factor, diffusivities times its square, times as they are."""
    scene = runs.with_diffusivities(runs.at_velocity(scene, factor * speed),
                                    lambda water, biomass: (factor**2 * water, factor**2 * biomass))
    return replace(scene, pore=replace(scene.pore, width=factor * scene.pore.width, length=factor * scene.pore.length),
                   aggregate=replace(scene.aggregate, radius=factor * scene.aggregate.radius),
                   growth=replace(scene.growth, minimum_film=factor * scene.growth.minimum_film))


#: Base to 1 h in other units.
FOREIGN = ('pore.width="0.05 mm"', 'pore.length="0.06 cm"', 'aggregate.radius="5e-6 m"', 'flow.head="1e-5 m"',
           'substrates.acceptor.supply="10 g/m^3"', 'substrates.donor.supply="0.01 g/L"',
           'substrates.acceptor.diffusivity="232 mm^2/day"', 'flow.gravity="981 cm/s^2"',
           'flow.kinematic_viscosity="1.003e-6 m^2/s"', 'kinetics.maximum_density="30 g/L"',
           'growth.time_step="720 s"', 'growth.shear_modulus="10 kPa"')


@case("coupling-foreign-units", kind="property", norm="largest difference of any node's place (um), and of C, at 1 h",
      claim="A scene written in other units is the same scene, bit for bit",
      mutants=("rounded-twice",), over=PRESETS, ways="1 2")
def foreign_units(*changes: str):
    ours, theirs = (runs.last(runs.base(end, *changes, *units)) for end, units in (("1 h", ()), ("60 min", FOREIGN)))
    pairs = {"places": (ours.pore.mesh.points, theirs.pore.mesh.points),
             "C_A": (ours.solved.concentrations.acceptor, theirs.solved.concentrations.acceptor)}
    return [at_most(name, np.abs(a - b).max(), 0.0, "the same numbers after reading") for name, (a, b) in pairs.items()]


@case("coupling-mirror", kind="property",
      norm="difference of the tips' distances from the origin, and of C_A left and right, relative",
      claim="Without flow an aggregate grows alike to both sides",
      mutants=("one-supply-held", "fixed-beside-the-middle"), over=every(0.5), ways="paper")
def mirror(*changes: str):
    last = runs.last(runs.without_flow(runs.base("8 h", *changes)))
    outline, space = last.pore.outline, last.pore.space
    tips = abs(outline.downstream + outline.upstream) / outline.downstream
    x = np.linspace(1.0, 70.0, 70)
    sides = [pairs.sample(space, last.solved.concentrations.acceptor, np.column_stack([s * x, 0.3 + 0 * x]))
             for s in (-1, 1)]
    return [at_most("tips", tips, 3e-6, "unsymmetric mesh: the error of C_A, of which growth feels a tenth"),
            at_most("C_A", np.abs(np.subtract(*sides)).max() / 10.0, 1e-4, "unsymmetric mesh: error in space"),
            at_least("it has grown (area over the seed's)", outline.area / 39.27, 2.0, "else nothing is tested")]


@case("coupling-reversed", kind="property",
      norm="relative difference between a lopsided aggregate and its mirror image, refinement 2, t = 0",
      claim="Flow from the other side meets the same resistance (Stokes flow is reversible) and, where uptake is of "
            "first order, loses as much of its substrate (reciprocity of (7), (11) and (12))",
      mutants=("inlet-held",), over=every(0.6, 2.0), ways="paper")
def reversed_flow(*changes: str):
    ours, theirs = (_lopsided(sign, *changes) for sign in (1.0, -1.0))
    apart = {name: abs(ours[name] / theirs[name] - 1) for name in ours}
    return [at_most("conductivity", apart["conductivity"], 3e-4, ERROR),
            at_most("effluent", apart["effluent"], 3e-4, ERROR),
            at_least("C at the inlet, which no theorem makes equal", apart["inlet"], 3e-3,
                     "else the aggregate is not lopsided")]


ERROR = "error in space: linear elements 9e-4, 2e-4, 6e-5 at refinement 1, 1.4, 2"
LARGE = 1e9


def _lopsided(sign: float, *changes: str) -> dict[str, float]:
    """Conductivity, and C at the outlet and the inlet, with q_D = 0.5/h C_D / (1 mg/L) and no other uptake."""
    scene = load_scene("base", changes)
    both = replace(scene.substrates, acceptor=replace(scene.substrates.acceptor, half_saturation=1 / LARGE),
                   donor=replace(scene.substrates.donor, half_saturation=LARGE))
    law = replace(scene.kinetics, maximum_utilization_rate=0.5 * LARGE, decay_coefficient=0.0,
                  acceptor_to_donor_ratio=1e-12)
    scene = replace(scene, substrates=both, kinetics=law)
    scene = shaped(scene, _outline(sign, 80 * scene.numerics.geometry))
    now = pore.seeded(scene)
    solved = pore.solve(scene, now)
    donor = solved.fluxes[1]
    return {"conductivity": solved.flow.conductivity, "effluent": donor.effluent, "inlet": donor.inlet}


def _outline(sign: float, edges: int) -> np.ndarray:
    """(edges + 1, 2): 24 um (1 + 0.35 cos a - 0.15 cos 2a), or its image in x -> -x for sign = -1."""
    angle = np.linspace(np.pi, 0.0, edges + 1)
    radius = 24.0 * (1 + 0.35 * sign * np.cos(angle) - 0.15 * np.cos(2 * angle))
    return np.column_stack([radius * np.cos(angle), runs.on_wall(radius * np.sin(angle))])
