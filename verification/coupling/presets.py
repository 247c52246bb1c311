"""The midpoint rule and the presets: order in time, the limit of the paper's updates, an independent solver."""

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
from verification.case import Outcome, at_most, case
from verification.convergence import study
from verification.coupling import runs


def _base(*changes: str):
    return load_scene("base", changes)


STEPS = (1, 2, 4, 8, 16)


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
      mutants=("curved-rates-of-the-start", "midpoint-rates-of-the-start"))
def order_in_time() -> Outcome:
    studies = []
    for elements in runs.ELEMENTS:
        scene = _base(runs.by("fast"), runs.of(elements), "numerics.refinement=0.5", 'aggregate.radius="25 um"')
        values = np.array([_equal_steps(scene, steps) for steps in STEPS])
        apart = np.abs(np.diff(values, axis=0) / values[-1])
        for k, quantity in enumerate(("area", "upstream tip")):
            studies.append(study(f"{quantity}, {elements}", 2 / np.array(STEPS[:-1]), apart[:, k], 2, "midpoint rule",
                                 ceiling=2e-5, band=0.15))
    return Outcome(studies=tuple(studies))


@case("coupling-midpoint-limit", kind="property", slow=True,
      norm="relative difference at 3.2 h from a seed of 25 um, base",
      claim="With short steps the paper's shape updates and the midpoint rule come to the same, on the same triangles",
      mutants=("midpoint-rates-of-the-start",))
def limit() -> Outcome:
    studies = []
    for elements in runs.ELEMENTS:
        steps = (0.8, 0.4, 0.2, 0.1)
        middle = _at_the_end(elements, 'numerics.time="midpoint"', "numerics.tolerance=0.00003")
        apart = np.array([np.abs(_at_the_end(elements, f'growth.time_step="{step} h"') / middle - 1)
                          for step in steps])
        studies += [study(f"{name}, {elements}", steps, apart[:, k], 1, "shape updates: first order", ceiling=2e-3)
                    for k, name in enumerate(("area", "upstream tip"))]
    return Outcome(studies=tuple(studies))


def _at_the_end(elements: str, *changes: str) -> np.ndarray:
    """Area and upstream tip at 3.2 h."""
    outline = runs.last(runs.base("3.2 h", runs.of(elements), 'aggregate.radius="25 um"',
                                  runs.coarser(elements, 0.3, 0.6), *changes)).pore.outline
    return np.array([outline.area, outline.upstream])


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
    _, *found = simulate(_base(runs.by(preset), f"output.times=[{times}]", *changes))
    rows = []
    for instant in found:
        flow, outline, fluxes = instant.solved.flow, instant.pore.outline, instant.solved.fluxes
        rows.append([whole_run.M_PER_D * flow.mean_velocity, whole_run.M_PER_D * flow.conductivity, outline.area,
                     outline.thickness, outline.upstream, outline.downstream, *(flux.effluent for flux in fluxes)])
    return np.array(rows)


@case("coupling-presets", kind="cross-code", slow=True,
      norm="largest difference at 19.2 and 19.4 h to an independent solver, extrapolated in space and time: relative, "
           "of effluents over the supply",
      claim="Each of the eight numbers of base is within 1 % with preset fast, and within 0.1 % with preset accurate",
      mutants=("curved-rates-of-the-start", "fluid-diffusivity", "uptake-without-decay"))
def presets() -> Outcome:
    theirs, error = _reference()
    checks = [at_most("the reference itself", error, 2e-4, "a fifth of what is asked of accurate")]
    for preset, bound in (("fast", 1e-2), ("accurate", 1e-3)):
        checks += [at_most(f"{name}, {preset}", apart, bound, "what the preset is for")
                   for name, apart in zip(whole_run.NAMES, _apart(_listed(preset), theirs))]
    return Outcome(tuple(checks))


@case("coupling-cubic", kind="cross-code", slow=True, norm="as coupling-presets",
      claim="With cubic velocities and concentrations each of the eight numbers of base is within 0.1 % too",
      mutants=("cubic-shown-less",))
def cubic() -> Outcome:
    apart = _apart(_listed("accurate", runs.of("cubic")), _reference()[0])
    return Outcome(tuple(at_most(name, value, 1e-3, "what the preset is for")
                         for name, value in zip(whole_run.NAMES, apart)))


@case("coupling-jacobian-reused", kind="property",
      norm="relative difference of the area, the tips and the conductivity at 2 h; factorisations over those of fresh "
           "derivatives; base from a seed of 25 um",
      claim="Newton's methods that use a derivative again come to the same with fewer factorisations",
      mutants=("newton-never-reused",))
def reused() -> Outcome:
    checks = []
    for elements, preset in (*((elements, "fast") for elements in runs.ELEMENTS), ("linear", "paper")):
        (fresh, made), (again, fewer) = (_factorisations(preset, elements, kind) for kind in ("fresh", "reused"))
        checks += [at_most(f"difference, {elements}, {preset}", np.abs(again / fresh - 1).max(), 1e-8,
                           "Newton's tolerances, 1e-10 and less, times the steps"),
                   at_most(f"factorisations, {elements}, {preset}", fewer / made, 0.8,
                           "one in three of Newton's is saved")]
    return Outcome(tuple(checks))


def _factorisations(preset: str, elements: str, kind: str) -> tuple[np.ndarray, int]:
    """Area, tips and conductivity at 2 h, and how many matrices were factorised on the way."""
    scene = runs.base("2 h", runs.by(preset), runs.of(elements), f'numerics.jacobian="{kind}"',
                      'aggregate.radius="25 um"', 'growth.time_step="1 h"')
    with mock.patch.object(linear, "factorised", wraps=linear.factorised) as factorised:
        last = runs.last(scene)
    shape, flow = last.pore.outline, last.solved.flow
    return np.array([shape.area, shape.upstream, shape.downstream, flow.conductivity]), factorised.call_count
