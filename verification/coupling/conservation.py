"""What a whole run conserves: substrates, biomass, the yield that links them, and X_m times the area."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from repro.march import updates
from repro.march.simulation import simulate
from repro.model import pore, remeshing
from repro.scene import Scene
from verification.case import Check, Outcome, at_least, at_most, between, case
from verification.convergence import Study, study
from verification.coupling import runs
from verification.reprojection import bodies


@case("coupling-ledger", kind="property",
      norm="base to 19.4 h in steps of 24 min: worst step of both substrates' balances and of the biomass', relative; "
           "X_m times the area over the biomass; largest deviation of the density from X_m",
      claim="Over a whole run with its remeshes substrates and biomass are accounted for to round-off, and the area is "
            "the biomass over X_m",
      mutants=("theta-anew-at-a-remesh", "biomass-interpolated-at-a-remesh", "growth-spread-evenly"))
def ledger() -> Outcome:
    steps = 'growth.time_step="24 min"'
    checks = _accounted("linear", steps, 6e-7, 4e-3, 3.0)
    for elements in ("quadratic", "cubic"):
        checks += _accounted(elements, steps, 1e-10, 1e-3, 2.0, runs.of(elements), "numerics.refinement=0.2")
    for preset in ("fast", "accurate"):
        checks += _accounted(preset, runs.by(preset), 1e-10, 1e-3, 2.0)
    return Outcome(tuple(checks))


def _accounted(name: str, steps: str, area: float, density: float, remeshes: float, *changes: str) -> list:
    """Checks of a run of base: largest deviations of the area and of the density, and fewest remeshes."""
    scene = runs.base("19.4 h", steps, *changes)
    instants = list(simulate(scene))
    rows, last = instants[-1].ledgers, instants[-1].pore
    made = sum(row.biomass_made for row in rows)
    total = scene.kinetics.maximum_density * last.outline.area
    return [at_most(f"substrates, {name}", substrates(rows), 1e-10, "Newton's tolerance, 1e-13 of the largest term of "
                    "each row, over all rows"),
            at_most(f"biomass, worst step, {name}", biomass(rows), 1e-10, runs.ROUND_OFF),
            at_most(f"biomass, whole run, {name}", abs((rows[0].biomass_before + made) / rows[-1].biomass_after - 1),
                    1e-10, runs.ROUND_OFF),
            at_most(f"X_m times the area, {name}", abs(total / rows[-1].biomass_after - 1), area,
                    "J = theta in the mean: to the stabilisation of linear elements, else to Newton's tolerance"),
            at_most(f"density, {name}", runs.density_drift(scene, instants[-1]), density,
                    "J = theta in the mean around a node only [E7]; worked off at each remesh"),
            at_least(f"remeshes, {name}", instants[-1].remeshes, remeshes, "else they are not tested")]


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
    found = [_yield(elements) for elements in runs.ELEMENTS]
    return Outcome(tuple(check for check, _ in found), tuple(orders for _, orders in found))


def _yield(elements: str) -> tuple[Check, Study]:
    """The size of the defect, and its order, with one kind of elements."""
    defects = [_yield_defect(elements, step) for step in STEPS]
    return (between(f"at 0.1 h, over (a step's growth)^2 / 12, {elements}", defects[-1] / _trapezoid(STEPS[-1]), 0.7,
                    1.3, "the trapezoidal rule on an exponential; its rate falls by 30 % as the pore clogs"),
            study(f"yield, {elements}", STEPS, np.abs(defects), 2, "Heun's method, and the trapezoidal rule on what is "
                  "consumed: second order", ceiling=4e-5, band=0.1))


def _scene(step: float, *changes: str) -> Scene:
    return runs.base("1.6 h", 'aggregate.radius="20 um"', f'growth.time_step="{step} h"', *changes)


def _yield_defect(elements: str, step: float) -> float:
    scene = _scene(step, runs.of(elements), runs.coarser(elements, 0.3))
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
    checks = [at_most("X_m times the area", max(area for _, area in found), 1e-11, runs.ROUND_OFF)]
    for elements in ("quadratic", "cubic"):
        error, area = _restored(0.5, runs.of(elements))
        checks += [at_most(f"density, {elements}", error, 1e-10, "the masses of a new mesh are X_m, and J = theta in "
                           "each point where it can be"),
                   at_most(f"X_m times the area, {elements}", area, 1e-11, runs.ROUND_OFF)]
    return Outcome(tuple(checks),
                   (study("density", sizes, [error for error, _ in found], 1.5,
                          "theta of triangles against X of nodes: second order, but at the rim, where they lie on one "
                          "side, first; in L2 half an order more", ceiling=1.2e-3),))


def _restored(refinement: float, *changes: str) -> tuple[float, float]:
    """L2 of the density's error, and X_m times the area over the biomass, less 1."""
    scene = runs.base("1 h", 'kinetics.decay_coefficient="0 1/d"', 'kinetics.maximum_utilization_rate="0 1/d"',
                      f"numerics.refinement={refinement}", 'aggregate.radius="20 um"', *changes)
    now = pore.seeded(scene)
    x = bodies.places(now.space)[0]
    now = replace(now, active=now.active * (1 + 0.1 * x / scene.aggregate.radius))
    solved = pore.solve(scene, now)
    anew = remeshing.remesh(scene, now, now, solved.flow.mean_velocity)[0]
    after = updates.step(scene, anew, pore.solve(scene, anew), 0.2).pore
    weight = after.space.reaction.dx
    density = (after.active + after.inert) / weight / scene.kinetics.maximum_density
    error = np.sqrt(np.vdot(weight, (density - 1) ** 2) / weight.sum())
    return float(error), abs(float(np.vdot(weight, density)) / after.outline.area - 1)
