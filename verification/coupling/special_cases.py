"""Smaller models that the whole one must become: no growth, no biomass, no viscosity jump, no stiffness."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from reference import poiseuille
from repro.fem.mesh import Mesh
from repro.fem.space import Space
from repro.march.simulation import simulate
from repro.model import flow, pore
from repro.scene import load_scene
from verification.case import Outcome, at_least, at_most, case
from verification.convergence import study
from verification.coupling import runs


@case("coupling-no-growth", kind="property",
      norm="t = 0 against 1 h: arrays of geometry, flow and C that differ in any bit; largest |X_A / X_m - 1|",
      claim="Biomass that neither takes up nor decays leaves the pore fixed, and C the supply",
      mutants=("increase-not-taken",))
def no_growth() -> Outcome:
    ways = {elements: (runs.of(elements), runs.coarser(elements, 0.4)) for elements in runs.ELEMENTS}
    ways |= {preset: (runs.by(preset),) for preset in ("fast", "accurate")}
    return Outcome(tuple(check for name, changes in ways.items() for check in _resting(name, *changes)))


def _resting(name: str, *changes: str) -> list:
    """Checks of an hour with one kind of elements, or one preset."""
    scene = runs.base("1 h", 'kinetics.decay_coefficient="0 1/d"', 'kinetics.maximum_utilization_rate="0 1/d"',
                      *changes)
    first, last = list(simulate(scene))
    pairs = [(one.pore.mesh.points, one.pore.theta, one.pore.inert, one.solved.flow.velocity, one.solved.flow.head,
              one.solved.concentrations.acceptor, one.solved.concentrations.donor) for one in (first, last)]
    moved = sum(not np.array_equal(a, b) for a, b in zip(*pairs))
    state = last.solved.concentrations
    left = max(np.abs(c / 10.0 - 1).max() for c in (state.acceptor, state.donor))
    drift = runs.density_drift(scene, last)
    return [at_most(f"arrays moved, {name}", moved, 0.0, "nothing acts on them: bit for bit"),
            at_most(f"X_A, {name}", drift, 1e-14, "(34) multiplies and divides by the same areas"),
            at_most(f"C over the supply, less 1, {name}", left, *(EVEN if name == "linear" else UNEVEN))]


#: How far C may be from the supply. w is divergence-free for the very functions that carry C where these are linear;
#: Taylor-Hood's u is so for functions of one order less, and jumps of viscosity bend it.
EVEN = 1e-12, runs.ROUND_OFF
UNEVEN = 1e-4, "div u is zero against functions of one order less than C's: error in space"


REFINEMENTS = (1.0, 1.4, 2.0, 2.8)


@case("coupling-clean-channel", kind="exact",
      norm="refinement 1 to 2.8: mean velocity under the head relative to Poiseuille's; largest |C / supply - 1|",
      claim="A scene without an aggregate is a clean channel: Poiseuille's flow under the head, and C the supply "
            "everywhere",
      mutants=("extent-not-subtracted", "head-on-the-mesh-alone"))
def clean_channel() -> Outcome:
    found = [_clean(refinement) for refinement in REFINEMENTS]
    sizes = [1 / refinement for refinement in REFINEMENTS]
    checks = [at_most("C", max(lack for _, lack in found), 1e-12, runs.ROUND_OFF)]
    for elements in ("quadratic", "cubic"):
        error, lack = _clean(0.3, runs.of(elements))
        checks += [at_most(f"mean velocity, {elements}", error, 1e-9, "elements hold the parabola: round-off"),
                   at_most(f"C, {elements}", lack, 1e-12, runs.ROUND_OFF)]
    return Outcome(tuple(checks),
                   (study("mean velocity", sizes, [error for error, _ in found], 1,
                          "first order: the stabilisation spoils one layer of elements at both ends of the mesh",
                          ceiling=2e-3),))


def _clean(refinement: float, *changes: str) -> tuple[float, float]:
    """Relative error of the mean velocity; largest |C / supply - 1|."""
    scene = load_scene("base", (f"numerics.refinement={refinement}", *changes))
    now = next(simulate(replace(scene, aggregate=None, kinetics=None, growth=None)))
    viscosity, state = scene.flow.kinematic_viscosity / scene.flow.gravity, now.solved.concentrations
    exact = scene.flow.head / poiseuille.head_loss(scene.pore.length, scene.pore.width, 1.0, viscosity)
    lack = max(np.abs(c / 10.0 - 1).max() for c in (state.acceptor, state.donor))
    return abs(now.solved.flow.mean_velocity / exact - 1), float(lack)


@case("coupling-equal-viscosities", kind="property",
      norm="relative difference of the mean velocity from Poiseuille's, and of u from that in an empty channel on the "
           "same mesh; base from 25 um, 1 h, lambda = 1",
      claim="An aggregate as thin as water, growing, is hydraulically an empty channel",
      mutants=("tau-jumps", "stale-flow", "extent-not-subtracted"))
def equal_viscosities() -> Outcome:
    return Outcome(tuple(check for elements in runs.ELEMENTS for check in _as_thin_as_water(elements)))


def _as_thin_as_water(elements: str) -> list:
    """Checks with one kind of elements."""
    scene = runs.base("1 h", 'aggregate.radius="25 um"', "flow.viscosity_ratio=1.0", runs.of(elements),
                      runs.coarser(elements, 0.4))
    first, last = list(simulate(scene))
    grid, found = last.pore.mesh, last.solved.flow
    bare = Mesh.of(grid.points, grid.cells, np.zeros_like(grid.biomass), np.empty(0, int), grid.width, grid.ends)
    empty = flow.unit_flow(Space(bare, last.pore.space.order), 7.0)
    viscosity = scene.flow.kinematic_viscosity / scene.flow.gravity
    exact = scene.flow.head / poiseuille.head_loss(scene.pore.length, scene.pore.width, 1.0, viscosity)
    return [at_most(f"u, {elements}", np.abs(found.velocity / found.mean_velocity - empty.velocity).max(), 1e-13,
                    runs.ROUND_OFF),
            at_most(f"mean velocity, {elements}", abs(found.mean_velocity / exact - 1), 5e-3,
                    "linear elements: first order in the mesh, 0.3 % as in coupling-clean-channel"),
            at_least(f"growth of the area, {elements}", last.pore.outline.area / first.pore.outline.area, 1.1,
                     "else nothing is tested")]


@case("coupling-stiffness", kind="property", norm="largest difference of any node's place (um) at 1 h",
      claim="mu_L does not matter without tractions: 0.001 or 10 MPa make the same aggregate",
      mutants=("modulus-in-the-shape",))
def stiffness() -> Outcome:
    return Outcome(tuple(check for elements in runs.ELEMENTS for check in _of_any_stiffness(elements)))


def _of_any_stiffness(elements: str) -> list:
    """Checks with one kind of elements."""
    changes = runs.of(elements), runs.coarser(elements, 0.4)
    soft, stiff = (runs.last(runs.base("1 h", f'growth.shear_modulus="{value} MPa"', *changes)).pore
                   for value in (0.001, 10))
    seed = pore.seeded(runs.base("1 h", *changes)).outline.area
    return [at_most(f"places, {elements}", np.abs(soft.mesh.points - stiff.mesh.points).max(), 0.0,
                    "it is nowhere in the equations without tractions"),
            at_least(f"growth of the area, {elements}", soft.outline.area / seed, 1.1, "else nothing is tested")]
