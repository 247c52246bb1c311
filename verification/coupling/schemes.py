"""What must not matter much: the time step, storage of the substrates, the part of the pore that is meshed.

The midpoint rule and the presets: order in time, the limit of the paper's updates, an independent solver.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from unittest import mock

import numpy as np

from reference import whole_run
from repro.fem import linear
from repro.march import midpoint
from repro.march.simulation import simulate
from repro.model import pore
from repro.scene import load_scene
from verification.coupling import every, kinds
from verification.kernel.case import at_most, case, refine, study
from verification.problems import runs

#: Shape updates (h).
STEPS = (0.8, 0.4, 0.2, 0.1)


SLOWER = (16.0, 8.0, 4.0, 2.0)


@case("coupling-quasi-steady", kind="property",
      norm="relative difference at 0.6 h, and that of C_A at the nodes over the supply; base from 25 um at 2.9 m/d, "
           "with D, u and X_m over 16 to 2: steady states and growth stay, substrates are 16 to 2 times slower",
      claim="The paper's transient scheme and quasi-steady substrates make the same aggregate, up to the substrates' "
            "lag, which is as their storage",
      mutants=("rates-two-percent-low",), over=kinds(0.4), ways="paper",
      because="fast, accurate: the transient scheme goes with updates")
def quasi_steady(*changes: str):
    errors = refine(_lag, SLOWER, *changes)
    return [study(name, SLOWER, values, 1, "lag: first order in storage over reaction, 2e-4 for base", ceiling=3e-6,
                  band=0.15) for name, values in errors.items()]


def _lag(factor: float, *changes: str) -> dict[str, float]:
    """How far the quasi-steady run is from the transient one, substrates being ``factor`` times slower than growth."""
    ours, theirs = (runs.last(_slower(factor, name, *changes)) for name in ("quasi_steady", "gear"))
    one, other = runs.numbers(ours), runs.numbers(theirs)
    apart = ours.solved.concentrations.acceptor - theirs.solved.concentrations.acceptor
    return {**{name: abs(one[name] / other[name] - 1) for name in one}, "C_A": float(np.abs(apart).max()) / 10.0}


def _slower(factor: float, transport_scheme: str, *changes: str):
    scene = runs.base("0.6 h", 'aggregate.radius="25 um"', f'numerics.transport="{transport_scheme}"', *changes)
    scene = runs.with_diffusivities(scene, lambda water, biomass: (water / factor, biomass / factor))
    law = replace(scene.kinetics, maximum_density=scene.kinetics.maximum_density / factor)
    return runs.at_velocity(replace(scene, kinetics=law), runs.SPEED / factor)


@case("coupling-extent", kind="property",
      norm="t = 0, refinement 2 (linear) and 0.6: conductivity and effluents relative; section means of C along the "
           "central mesh, over the supply",
      claim="The central mesh with (6) and (26) beyond it is worth the whole pore",
      mutants=("extent-not-subtracted", "inlet-held", "head-on-the-mesh-alone"),
      over={f"R = {radius}, {label}": (f'aggregate.radius="{radius}"', *changes)
            for radius, labelled in (("5 um", kinds(0.6, 2.0)), ("25 um", every(0.6, 2.0)))
            for label, changes in labelled.items()}, ways="paper")
def extent(*changes: str):
    (central, near), (full, far) = (_solved(f'numerics.extent="{name}"', *changes) for name in ("central", "full"))
    for name, (bound, origin) in BOUNDS.items():
        yield at_most(name, abs(central[name] / full[name] - 1), bound, origin)
    yield at_most("C", np.abs(near - far).max() / 10.0, *APART.get(changes[1:], (4e-4, IN_SPACE)))


IN_SPACE = "error in space, 0.1 % at refinement 1, a quarter of that here"
#: How far section means of C may be apart on the coarser mesh of a preset.
APART = {(runs.by("fast"),): (2.5e-3, "error in space: a quarter of the 1 % that the preset stands for")}
BOUNDS = {"conductivity": (1e-3, "of first order in the mesh: 0.17 % in a clean channel at this refinement, most of "
                           "which both meshes have in common"),
          "effluent acceptor": (4e-4, IN_SPACE), "effluent donor": (4e-4, IN_SPACE)}


def _solved(*changes: str):
    """Conductivity and effluents of base at t = 0, and the section means along its central mesh."""
    scene = load_scene("base", changes)
    now = pore.seeded(scene)
    solved = pore.solve(scene, now)
    leaving = solved.fluxes
    reach = min(10 * scene.aggregate.radius, 1.5 * scene.pore.width) + scene.aggregate.radius
    x = np.linspace(-reach, reach, runs.PLACES)
    return ({"conductivity": solved.flow.conductivity, "effluent acceptor": leaving[0].effluent,
             "effluent donor": leaving[1].effluent}, runs.section_means(now, solved, x))


RULE_STEPS = (1, 2, 4, 8, 16)


def _equal_steps(scene, steps: int) -> np.ndarray:
    """Area and upstream tip after 2 h in equal steps, on one mesh."""
    now = pore.seeded(scene)
    for _ in range(steps):
        solved = pore.solve(scene, now)
        now = replace(now, concentrations=solved.concentrations)
        step = midpoint.attempt(scene, now, solved, 2.0 / steps).step
        if step.remeshed:
            raise RuntimeError("a new mesh: the error in space would not be common")
        now = step.pore
    return np.array([now.outline.area, now.outline.upstream])


@case("coupling-midpoint-order", kind="property",
      norm="relative difference between a run and that with half the step; base from a seed of 25 um, 2 h, no remesh",
      claim="The midpoint rule is of second order in time, with every kind of elements",
      mutants=("curved-rates-of-the-start", "midpoint-rates-of-the-start"), over=runs.ELEMENTS, ways="fast",
      because="paper: coupling-midpoint-limit; accurate: equal steps know no tolerance, and so are those of fast")
def order_in_time(elements: str):
    scene = load_scene("base", (runs.by("fast"), runs.of(elements), "numerics.refinement=0.5",
                                'aggregate.radius="25 um"'))
    values = np.array([_equal_steps(scene, steps) for steps in RULE_STEPS])
    apart = np.abs(np.diff(values, axis=0) / values[-1])
    return [study(name, 2 / np.array(RULE_STEPS[:-1]), column, 2, "midpoint rule", ceiling=2e-5, band=0.15)
            for name, column in zip(("area", "upstream tip"), apart.T)]


@case("coupling-midpoint-limit", kind="property", slow=True,
      norm="relative difference at 3.2 h from a seed of 25 um, base, no remesh",
      claim="With short steps the paper's shape updates and the midpoint rule come to the same, on the same triangles: "
            "the loop of updates is of first order in the step, as the geometry is frozen within it and the rates are "
            "not",
      mutants=("midpoint-rates-of-the-start", "rates-at-the-start", "stale-flow"), over=kinds(0.3, 0.6), ways="paper",
      because="fast, accurate: coupling-midpoint-order; their own tolerances would be seen")
def limit(*changes: str):
    """Remeshes, and the orders."""
    short = ('numerics.time="midpoint"', "numerics.tolerance=0.00003")
    steps = [(f'growth.time_step="{step} h"',) for step in STEPS]
    middle, *rest = [runs.last(runs.base("3.2 h", 'aggregate.radius="25 um"', *changes, *how))
                     for how in (short, *steps)]
    exact, rows = runs.numbers(middle), [runs.numbers(instant) for instant in rest]
    remeshes = sum(instant.remeshes for instant in (middle, *rest))
    yield at_most("remeshes, all runs", remeshes, 0.0, "one mesh: the error in space is common")
    for name, value in exact.items():
        yield study(name, STEPS, [abs(row[name] / value - 1) for row in rows], 1, "frozen geometry: first order",
                    ceiling=2e-3, band=0.15)


TIMES = (19.2, 19.4)


@cache
def _reference():
    """The independent solver's numbers of base at TIMES, (2, 8), and the largest estimate of their error."""
    found = whole_run.converged(whole_run.Pore(), TIMES, rings=(6, 8), steps=(8, 16))
    return found.values, _apart(found.values + np.abs(found.space) + np.abs(found.time), found.values).max()


def _apart(ours: np.ndarray, theirs: np.ndarray) -> np.ndarray:
    """(8,) largest differences over the times: relative, of effluents over the supply."""
    scale = np.abs(theirs).copy()
    scale[:, 6:] = whole_run.Pore().supply
    return (np.abs(ours - theirs) / scale).max(axis=0)


def _listed(preset: str, *changes: str) -> np.ndarray:
    """(2, 8) of base at TIMES, as whole_run.NAMES lists them."""
    times = ", ".join(f'"{time} h"' for time in TIMES)
    _, *found = simulate(load_scene("base", (runs.by(preset), f"output.times=[{times}]", *changes)))
    rows = []
    for instant in found:
        flow = instant.solved.flow
        outline = instant.pore.outline
        fluxes = instant.solved.fluxes
        rows.append([whole_run.M_PER_D * flow.mean_velocity, whole_run.M_PER_D * flow.conductivity, outline.area,
                     outline.thickness, outline.upstream, outline.downstream, *(flux.effluent for flux in fluxes)])
    return np.array(rows)


@case("coupling-presets", kind="cross-code", slow=True,
      norm="largest difference at 19.2 and 19.4 h to an independent solver, extrapolated in space and time: relative, "
           "of effluents over the supply",
      claim="Each of the eight numbers of base is within 1 % with preset fast, and within 0.1 % with preset accurate, "
            "with quadratic and with cubic velocities and concentrations",
      mutants=("curved-rates-of-the-start", "fluid-diffusivity", "uptake-without-decay", "cubic-shown-less"),
      over={"fast": (1e-2, "fast"), "accurate": (1e-3, "accurate"),
            "accurate, cubic": (1e-3, "accurate", runs.of("cubic"))}, ways="2",
      because="paper, order 1: its error is that of linear elements, see bench")
def presets(bound: float, *numerics: str):
    return _within(bound, 2e-4, "a fifth of what is asked of accurate", *numerics)


@case("coupling-exact", kind="cross-code", slow=True, norm="as coupling-presets",
      claim="Each of the eight numbers of base is within 0.01 % with preset exact",
      mutants=("exact-steps-of-accurate",), ways="2",
      because="orders 1 and 3 and the other presets: coupling-presets")
def exact():
    return _within(1e-4, 5e-5, "half of what is asked", "exact")


def _within(bound: float, allowed: float, why: str, *numerics: str):
    """Checks of the eight numbers, and of the reference."""
    theirs, error = _reference()
    yield at_most("the reference itself", error, allowed, why)
    for name, apart in zip(whole_run.NAMES, _apart(_listed(*numerics), theirs)):
        yield at_most(name, apart, bound, "what the preset is for")


@case("coupling-jacobian-reused", kind="property",
      norm="relative difference of the area, the tips and the conductivity at 2 h; factorisations over those of fresh "
           "derivatives; base from a seed of 25 um",
      claim="Newton's methods that use a derivative again come to the same with fewer factorisations",
      mutants=("newton-never-reused",),
      over={**{f"{kind}, fast": (runs.by("fast"), runs.of(kind)) for kind in runs.ELEMENTS},
            **{f"{kind}, {preset}": (runs.by(preset),) for kind, preset in (("linear", "paper"),
                                                                            ("quadratic", "accurate"))}})
def reused(*changes: str):
    (fresh, made), (again, fewer) = (_factorisations(kind, *changes) for kind in ("fresh", "reused"))
    return (at_most("difference", np.abs(again / fresh - 1).max(), 1e-8,
                    "Newton's tolerances, 1e-10 and less, times the steps"),
            at_most("factorisations", fewer / made, 0.8, "one in three of Newton's is saved"))


def _factorisations(kind: str, *changes: str) -> tuple[np.ndarray, int]:
    """Area, tips and conductivity at 2 h, and how many matrices were factorised on the way."""
    scene = runs.base("2 h", *changes, f'numerics.jacobian="{kind}"', 'aggregate.radius="25 um"',
                      'growth.time_step="1 h"')
    with mock.patch.object(linear, "factorised", wraps=linear.factorised) as factorised:
        last = runs.last(scene)
    shape, flow = last.pore.outline, last.solved.flow
    return np.array([shape.area, shape.upstream, shape.downstream, flow.conductivity]), factorised.call_count
