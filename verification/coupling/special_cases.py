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
    scene = runs.base("1 h", 'kinetics.decay_coefficient="0 1/d"', 'kinetics.maximum_utilization_rate="0 1/d"')
    first, last = list(simulate(scene))
    pairs = [(one.pore.mesh.points, one.pore.theta, one.pore.inert, one.solved.flow.velocity, one.solved.flow.head,
              one.solved.concentrations.acceptor, one.solved.concentrations.donor) for one in (first, last)]
    moved = sum(not np.array_equal(a, b) for a, b in zip(*pairs))
    state = last.solved.concentrations
    left = max(np.abs(c / 10.0 - 1).max() for c in (state.acceptor, state.donor))
    drift = runs.density_drift(scene, last)
    return Outcome((at_most("arrays moved", moved, 0.0, "nothing acts on them: bit for bit"),
                    at_most("X_A", drift, 1e-14, "(34) multiplies and divides by the same areas"),
                    at_most("C over the supply, less 1", left, 1e-12, runs.ROUND_OFF)))


REFINEMENTS = (1.0, 1.4, 2.0, 2.8)


@case("coupling-clean-channel", kind="exact",
      norm="refinement 1 to 2.8: mean velocity under the head relative to Poiseuille's; largest |C / supply - 1|",
      claim="A scene without an aggregate is a clean channel: Poiseuille's flow under the head, and C the supply "
            "everywhere",
      mutants=("extent-not-subtracted", "head-on-the-mesh-alone"))
def clean_channel() -> Outcome:
    found = [_clean(refinement) for refinement in REFINEMENTS]
    sizes = [1 / refinement for refinement in REFINEMENTS]
    return Outcome((at_most("C", max(lack for _, lack in found), 1e-12, runs.ROUND_OFF),),
                   (study("mean velocity", sizes, [error for error, _ in found], 1,
                          "first order: the stabilisation spoils one layer of elements at both ends of the mesh",
                          ceiling=2e-3),))


def _clean(refinement: float) -> tuple[float, float]:
    """Relative error of the mean velocity; largest |C / supply - 1|."""
    scene = load_scene("base", (f"numerics.refinement={refinement}",))
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
    scene = runs.base("1 h", 'aggregate.radius="25 um"', "flow.viscosity_ratio=1.0")
    first, last = list(simulate(scene))
    grid, found = last.pore.mesh, last.solved.flow
    bare = Mesh.of(grid.points, grid.cells, np.zeros_like(grid.biomass), np.empty(0, int), grid.width, grid.ends)
    empty = flow.unit_flow(Space(bare, last.pore.space.order), 7.0)
    viscosity = scene.flow.kinematic_viscosity / scene.flow.gravity
    exact = scene.flow.head / poiseuille.head_loss(scene.pore.length, scene.pore.width, 1.0, viscosity)
    return Outcome((at_most("u", np.abs(found.velocity / found.mean_velocity - empty.velocity).max(), 1e-13,
                            runs.ROUND_OFF),
                    at_most("mean velocity", abs(found.mean_velocity / exact - 1), 5e-3,
                            "first order in the mesh: 0.3 % as in coupling-clean-channel"),
                    at_least("growth of the area", last.pore.outline.area / first.pore.outline.area, 1.1,
                             "else nothing is tested")))


@case("coupling-stiffness", kind="property", norm="largest difference of any node's place (um) at 1 h",
      claim="mu_L does not matter without tractions: 0.001 or 10 MPa make the same aggregate",
      mutants=("modulus-in-the-shape",))
def stiffness() -> Outcome:
    soft, stiff = (runs.last(runs.base("1 h", f'growth.shear_modulus="{value} MPa"')).pore for value in (0.001, 10))
    seed = pore.seeded(runs.base("1 h")).outline.area
    return Outcome((at_most("places", np.abs(soft.mesh.points - stiff.mesh.points).max(), 0.0,
                            "it is nowhere in the equations without tractions"),
                    at_least("growth of the area", soft.outline.area / seed, 1.1, "else nothing is tested")))
