"""What must not matter at all: units, left and right, and, where the theory is reversible, the flow's direction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from repro.fem.outline import BOTTOM, FREE, Outline
from repro.march.simulation import simulate
from repro.model import pore
from repro.scene import load_scene
from verification.case import Outcome, Profile, at_least, at_most, case
from verification.coupling import runs
from verification.reprojection import grids


@case("coupling-units", kind="property", norm="relative difference at 2 h",
      claim="A pore eight times larger or smaller, with transport to match, grows alike to the last bits: nothing has "
            "a scale of its own",
      mutants=("length-scale",))
def units() -> Outcome:
    ways = {elements: (runs.of(elements), runs.coarser(elements, 0.4)) for elements in runs.ELEMENTS}
    ways |= {preset: (runs.by(preset),) for preset in ("fast", "accurate")}
    return Outcome(tuple(check for name, changes in ways.items() for check in _scale_free(name, *changes)))


def _scale_free(name: str, *changes: str) -> list:
    """Checks with one kind of elements, or one preset."""
    scene, checks = runs.base("2 h", *changes), []
    speed = next(simulate(scene)).solved.flow.mean_velocity
    own = runs.numbers(runs.last(_scaled(scene, 1.0, speed)))
    for factor in (8.0, 0.125):
        other = runs.numbers(runs.last(_scaled(scene, factor, speed)))
        for quantity, power in (("area", 2), ("upstream tip", 1), ("conductivity", 2)):
            checks.append(at_most(f"{quantity}, lengths times {factor:g}, {name}",
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
      mutants=("rounded-twice",))
def foreign_units() -> Outcome:
    return Outcome(tuple(check for preset in runs.PRESETS for check in _foreign(preset)))


def _foreign(preset: str) -> list:
    """Checks with one preset."""
    ours, theirs = (runs.last(runs.base(end, runs.by(preset), *changes))
                    for end, changes in (("1 h", ()), ("60 min", FOREIGN)))
    apart = np.abs(ours.pore.mesh.points - theirs.pore.mesh.points).max()
    fields = np.abs(ours.solved.concentrations.acceptor - theirs.solved.concentrations.acceptor).max()
    return [at_most(f"places, {preset}", apart, 0.0, "the same numbers after reading"),
            at_most(f"C_A, {preset}", fields, 0.0, "the same numbers after reading")]


@case("coupling-mirror", kind="property",
      norm="difference of the tips' distances from the origin, and of C_A left and right, relative",
      claim="Without flow an aggregate grows alike to both sides",
      mutants=("one-supply-held", "fixed-beside-the-middle"))
def mirror() -> Outcome:
    found = [_alike(elements) for elements in runs.ELEMENTS]
    return Outcome(tuple(check for checks, _ in found for check in checks), (), tuple(picture for _, picture in found))


def _alike(elements: str) -> tuple[list, Profile]:
    """Checks and a picture with one kind of elements."""
    last = runs.last(runs.without_flow(runs.base("8 h", runs.of(elements), runs.coarser(elements, 0.5))))
    outline, space = last.pore.outline, last.pore.space
    tips = abs(outline.downstream + outline.upstream) / outline.downstream
    x = np.linspace(1.0, 70.0, 70)
    sides = [grids.sample(space, last.solved.concentrations.acceptor, np.column_stack([s * x, 0.3 + 0 * x]))
             for s in (-1, 1)]
    profile = Profile(f"C_A along the lower wall, 8 h, {elements}", "|x| (um)", "C_A (mg/L)",
                      (("upstream", "ours", x, sides[0]), ("downstream", "reference", x, sides[1])))
    checks = [at_most(f"tips, {elements}", tips, 3e-6, "unsymmetric mesh: the error of C_A, of which growth feels a "
                      "tenth"),
              at_most(f"C_A, {elements}", np.abs(sides[0] - sides[1]).max() / 10.0, 1e-4,
                      "unsymmetric mesh: error in space"),
              at_least(f"it has grown (area over the seed's), {elements}", outline.area / 39.27, 2.0,
                       "else nothing is tested")]
    return checks, profile


@case("coupling-reversed", kind="property",
      norm="relative difference between a lopsided aggregate and its mirror image, refinement 2, t = 0",
      claim="Flow from the other side meets the same resistance (Stokes flow is reversible) and, where uptake is of "
            "first order, loses as much of its substrate (reciprocity of (7), (11) and (12))",
      mutants=("inlet-held",))
def reversed_flow() -> Outcome:
    return Outcome(tuple(check for elements in runs.ELEMENTS for check in _reversed(elements)))


def _reversed(elements: str) -> list:
    """Checks with one kind of elements."""
    ours, theirs = (_lopsided(elements, sign) for sign in (1.0, -1.0))
    apart = {name: abs(ours[name] / theirs[name] - 1) for name in ours}
    return [at_most(f"conductivity, {elements}", apart["conductivity"], 3e-4, ERROR),
            at_most(f"effluent, {elements}", apart["effluent"], 3e-4, ERROR),
            at_least(f"C at the inlet, which no theorem makes equal, {elements}", apart["inlet"], 3e-3,
                     "else the aggregate is not lopsided")]


ERROR = "error in space: linear elements 9e-4, 2e-4, 6e-5 at refinement 1, 1.4, 2"
LARGE = 1e9


def _lopsided(elements: str, sign: float) -> dict[str, float]:
    """Conductivity, and C at the outlet and the inlet, with q_D = 0.5/h C_D / (1 mg/L) and no other uptake."""
    scene = load_scene("base", (runs.of(elements), runs.coarser(elements, 0.6, 2.0)))
    both = replace(scene.substrates, acceptor=replace(scene.substrates.acceptor, half_saturation=1 / LARGE),
                   donor=replace(scene.substrates.donor, half_saturation=LARGE))
    law = replace(scene.kinetics, maximum_utilization_rate=0.5 * LARGE, decay_coefficient=0.0,
                  acceptor_to_donor_ratio=1e-12)
    scene = replace(scene, substrates=both, kinetics=law)
    with runs.shaped(lambda radius, geometry: _outline(sign, geometry)):
        now = pore.seeded(scene)
    solved = pore.solve(scene, now)
    donor = solved.fluxes[1]
    return {"conductivity": solved.flow.conductivity, "effluent": donor.effluent, "inlet": donor.inlet}


def _outline(sign: float, geometry: int) -> Outline:
    """24 um (1 + 0.35 cos a - 0.15 cos 2a), or its image in x -> -x for sign = -1."""
    angle = np.linspace(0.0, np.pi, 80 * geometry + 1)
    radius = 24.0 * (1 + 0.35 * sign * np.cos(angle) - 0.15 * np.cos(2 * angle))
    arc = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    base = np.column_stack([np.linspace(arc[-1, 0], arc[0, 0], 20 * geometry + 1), np.zeros(20 * geometry + 1)])
    points = np.vstack([base, arc[1:-1]])
    wall = np.where(np.arange(len(points)) < len(base), BOTTOM, FREE)
    return Outline(points, wall, np.arange(len(points)) == 10 * geometry, points.copy(), geometry)
