"""What a whole run conserves: substrates, biomass, the yield that links them, and X_m times the area."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from repro.march import updates
from repro.march.simulation import simulate
from repro.model import pore, remeshing
from repro.scene import Scene
from verification.case import Outcome, at_least, at_most, between, case
from verification.convergence import study
from verification.coupling import runs


@case("coupling-ledger", kind="property",
      norm="base to 19.4 h in steps of 24 min: worst step of both substrates' balances and of the biomass', relative; "
           "X_m times the area over the biomass; largest deviation of the density from X_m",
      claim="Over a whole run with its remeshes substrates and biomass are accounted for to round-off, and the area is "
            "the biomass over X_m",
      mutants=("theta-anew-at-a-remesh", "biomass-interpolated-at-a-remesh", "growth-spread-evenly"))
def ledger() -> Outcome:
    scene = runs.base("19.4 h", 'growth.time_step="24 min"')
    instants = list(simulate(scene))
    rows, last = instants[-1].ledgers, instants[-1].pore
    made = sum(row.biomass_made for row in rows)
    total = scene.kinetics.maximum_density * last.outline.area
    return Outcome((at_most("substrates", substrates(rows), 1e-10, "Newton's tolerance, 1e-13 of the largest term of "
                            "each row, over all rows"),
                    at_most("biomass, worst step", biomass(rows), 1e-10, runs.ROUND_OFF),
                    at_most("biomass, whole run", abs((rows[0].biomass_before + made) / rows[-1].biomass_after - 1),
                            1e-10, runs.ROUND_OFF),
                    at_most("X_m times the area", abs(total / rows[-1].biomass_after - 1), 6e-7,
                            "J = theta to the stabilisation"),
                    at_most("density", runs.density_drift(scene, instants[-1]), 4e-3,
                            "J = theta in the mean around a node only [E7]; worked off at each remesh"),
                    at_least("remeshes", instants[-1].remeshes, 3.0, "else they are not tested")))


def substrates(rows) -> float:
    """The worst of in - out - consumed over in."""
    return max(abs(s - out - used) / s for row in rows for s, out, used in zip(row.supplied, row.out, row.consumed))


def biomass(rows) -> float:
    """The worst of before + made - after over after, and of one step's end against the next one's start."""
    steps = [abs((row.biomass_before + row.biomass_made) / row.biomass_after - 1) for row in rows]
    return max(steps + [abs(two.biomass_before / one.biomass_after - 1) for one, two in zip(rows, rows[1:])])


STEPS = (0.8, 0.4, 0.2, 0.1)


@case("coupling-yield", kind="property",
      norm="biomass made over the yield of the substrates, less 1; base from 20 um to 1.6 h, steps of 0.8 to 0.1 h",
      claim="The biomass made is Y times the donor consumed, less f_d of what decays, which the acceptor's demand "
            "beyond F times the donor tells: the ledgers agree to second order in the step",
      mutants=("euler-biomass", "rates-at-the-start", "rates-two-percent-low", "decay-leaves-all"))
def yields() -> Outcome:
    defects = [_yield_defect(step) for step in STEPS]
    return Outcome((between("at 0.1 h, over (a step's growth)^2 / 12", defects[-1] / _trapezoid(STEPS[-1]), 0.7, 1.3,
                            "the trapezoidal rule on an exponential; its rate falls by 30 % as the pore clogs"),),
                   (study("yield", STEPS, np.abs(defects), 2, "Heun's method, and the trapezoidal rule on what is "
                          "consumed: second order", ceiling=4e-5, band=0.1),))


def _scene(step: float) -> Scene:
    return runs.base("1.6 h", 'aggregate.radius="20 um"', f'growth.time_step="{step} h"')


def _yield_defect(step: float) -> float:
    scene = _scene(step)
    law, rows = scene.kinetics, runs.last(scene).ledgers
    acceptor, donor = np.sum([row.consumed for row in rows], axis=0)
    decayed = (acceptor - law.acceptor_to_donor_ratio * donor) / law.decay_oxygen_demand
    return float(1 - sum(row.biomass_made for row in rows) / (law.yield_coefficient * donor - decayed))


def _trapezoid(step: float) -> float:
    """(r step)^2 / 12 at the supply's rate of growth r."""
    law, both = _scene(step).kinetics, _scene(step).substrates
    m_a, m_d = (s.supply / (s.supply + s.half_saturation) for s in (both.acceptor, both.donor))
    return (m_a * (law.maximum_utilization_rate * law.yield_coefficient * m_d - law.decay_coefficient) * step) ** 2 / 12


REFINEMENTS = (0.7, 1.0, 1.4, 2.0)


@case("coupling-density-restored", kind="property",
      norm="a half-disc of 20 um whose density is X_m (1 + 0.1 x / R), remeshed, one step without uptake or decay: L2 "
           "of (X_A + X_I) / X_m - 1 over it; X_m times the area over the biomass, less 1",
      claim="What a density has of error at a remesh is gone after the next update [E7]: the shape takes up X_m again",
      mutants=("density-not-worked-off", "theta-anew-at-a-remesh"))
def density_restored() -> Outcome:
    found = [_restored(refinement) for refinement in REFINEMENTS]
    sizes = [1 / refinement for refinement in REFINEMENTS]
    return Outcome((at_most("X_m times the area", max(area for _, area in found), 1e-11, runs.ROUND_OFF),),
                   (study("density", sizes, [error for error, _ in found], 1.5,
                          "theta of triangles against X of nodes: second order, but at the rim, where they lie on one "
                          "side, first; in L2 half an order more", ceiling=1.2e-3),))


def _restored(refinement: float) -> tuple[float, float]:
    """L2 of the density's error, and X_m times the area over the biomass, less 1."""
    scene = runs.base("1 h", 'kinetics.decay_coefficient="0 1/d"', 'kinetics.maximum_utilization_rate="0 1/d"',
                      f"numerics.refinement={refinement}", 'aggregate.radius="20 um"')
    now = pore.seeded(scene)
    x = now.mesh.points[now.space.reaction.cells, 0]
    now = replace(now, active=now.active * (1 + 0.1 * x / scene.aggregate.radius))
    solved = pore.solve(scene, now)
    anew = remeshing.remesh(scene, now, now, solved.flow.mean_velocity)[0]
    after = updates.step(scene, anew, pore.solve(scene, anew), 0.2).pore
    weight = after.space.reaction.dx
    density = (after.active + after.inert) / weight / scene.kinetics.maximum_density
    error = np.sqrt(np.vdot(weight, (density - 1) ** 2) / weight.sum())
    return float(error), abs(float(np.vdot(weight, density)) / after.outline.area - 1)
