"""What must not matter much: the time step, storage of the substrates, the part of the pore that is meshed."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from repro.model import pore
from repro.scene import load_scene
from verification.case import Check, Outcome, Profile, at_most, case
from verification.convergence import Study, study
from verification.coupling import averaged, runs

STEPS = (0.8, 0.4, 0.2, 0.1, 0.05)


@case("coupling-time-step", kind="property", slow=True,
      norm="difference between a run and that with half the step, relative; base from 25 um, 3.2 h, no remesh",
      claim="The loop is of first order in the shape update: the geometry is frozen within a step, the rates are not",
      mutants=("rates-at-the-start", "stale-flow"))
def time_step() -> Outcome:
    found = [_frozen(elements) for elements in runs.ELEMENTS]
    return Outcome(tuple(check for check, _ in found), tuple(one for _, studies in found for one in studies))


def _frozen(elements: str) -> tuple[Check, list[Study]]:
    """Remeshes, and the orders, with one kind of elements."""
    instants = [runs.last(runs.base("3.2 h", 'aggregate.radius="25 um"', f'growth.time_step="{step} h"',
                                    runs.of(elements), runs.coarser(elements, 0.3))) for step in STEPS]
    numbers, studies = [runs.numbers(instant) for instant in instants], []
    for name in numbers[0]:
        values = np.array([row[name] for row in numbers])
        apart = np.abs(np.diff(values) / values[-1])
        studies.append(study(f"{name}, {elements}", STEPS[:-1], apart, 1, "frozen geometry: first order", ceiling=1e-3,
                             band=0.15))
    remeshes = sum(instant.remeshes for instant in instants)
    return at_most(f"remeshes, all runs, {elements}", remeshes, 0.0, "one mesh: the error in space is common"), studies


SLOWER = (16.0, 8.0, 4.0, 2.0)


@case("coupling-quasi-steady", kind="property",
      norm="relative difference at 0.6 h, and that of C_A at the nodes over the supply; base from 25 um at 2.9 m/d, "
           "with D, u and X_m over 16 to 2: steady states and growth stay, substrates are 16 to 2 times slower",
      claim="The paper's transient scheme and quasi-steady substrates make the same aggregate, up to the substrates' "
            "lag, which is as their storage",
      mutants=("rates-two-percent-low",))
def quasi_steady() -> Outcome:
    return Outcome((), tuple(one for elements in runs.ELEMENTS for one in _lags(elements)))


def _lags(elements: str) -> list[Study]:
    """Studies with one kind of elements."""
    rows = [_lag(elements, factor) for factor in SLOWER]
    return [study(f"{name}, {elements}", SLOWER, [row[name] for row in rows], 1,
                  "lag: first order in storage over reaction, 2e-4 for base", ceiling=3e-6, band=0.15)
            for name in rows[0]]


def _lag(elements: str, factor: float) -> dict[str, float]:
    """How far the quasi-steady run is from the transient one, substrates being ``factor`` times slower than growth."""
    ours, theirs = (runs.last(_slower(elements, factor, name)) for name in ("quasi_steady", "gear"))
    one, other = runs.numbers(ours), runs.numbers(theirs)
    apart = ours.solved.concentrations.acceptor - theirs.solved.concentrations.acceptor
    return {**{name: abs(one[name] / other[name] - 1) for name in one}, "C_A": float(np.abs(apart).max()) / 10.0}


def _slower(elements: str, factor: float, transport_scheme: str):
    scene = runs.base("0.6 h", 'aggregate.radius="25 um"', f'numerics.transport="{transport_scheme}"',
                      runs.of(elements), runs.coarser(elements, 0.4))
    scene = runs.with_diffusivities(scene, lambda water, biomass: (water / factor, biomass / factor))
    law = replace(scene.kinetics, maximum_density=scene.kinetics.maximum_density / factor)
    return runs.at_velocity(replace(scene, kinetics=law), runs.SPEED / factor)


@case("coupling-extent", kind="property",
      norm="t = 0, refinement 2 (linear) and 0.6: conductivity and effluents relative; section means of C along the "
           "central mesh, over the supply",
      claim="The central mesh with (6) and (26) beyond it is worth the whole pore",
      mutants=("extent-not-subtracted", "inlet-held", "head-on-the-mesh-alone"))
def extent() -> Outcome:
    checks, profiles = [], []
    for radius, elements in product(("5 um", "25 um"), runs.ELEMENTS):
        (central, x, near), (full, _, far) = (_solved(radius, elements, name) for name in ("central", "full"))
        which = f"R = {radius}, {elements}"
        checks += [at_most(f"{name}, {which}", abs(central[name] / full[name] - 1), bound, origin)
                   for name, (bound, origin) in BOUNDS.items()]
        checks.append(at_most(f"C, {which}", np.abs(near - far).max() / 10.0, 4e-4, IN_SPACE))
        profiles.append(Profile(f"section means, {which}", "x (um)", "C (mg/L)", tuple(
            curve for k, name in enumerate(("C_A", "C_D"))
            for curve in ((f"{name}, central", "ours", x, near[k]), (f"{name}, whole pore", "reference", x, far[k])))))
    return Outcome(tuple(checks), (), tuple(profiles))


IN_SPACE = "error in space, 0.1 % at refinement 1, a quarter of that here"
BOUNDS = {"conductivity": (1e-3, "of first order in the mesh: 0.17 % in a clean channel at this refinement, most of "
                           "which both meshes have in common"),
          "effluent acceptor": (4e-4, IN_SPACE), "effluent donor": (4e-4, IN_SPACE)}


def _solved(radius: str, elements: str, extent: str):
    """Conductivity and effluents of base at t = 0; x along its central mesh, and the section means there."""
    scene = load_scene("base", (f'aggregate.radius="{radius}"', f'numerics.extent="{extent}"',
                                runs.of(elements), runs.coarser(elements, 0.6, 2.0)))
    now = pore.seeded(scene)
    solved = pore.solve(scene, now)
    leaving = solved.fluxes
    reach = min(10 * scene.aggregate.radius, 1.5 * scene.pore.width) + scene.aggregate.radius
    x = np.linspace(-reach, reach, averaged.PLACES)
    return ({"conductivity": solved.flow.conductivity, "effluent acceptor": leaving[0].effluent,
             "effluent donor": leaving[1].effluent}, x, runs.section_means(now, solved, x))
