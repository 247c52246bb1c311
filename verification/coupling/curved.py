"""Whole runs on curved triangles with the midpoint rule: closed forms, order in time, presets, the paper's limit."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from unittest import mock

import numpy as np

from reference import whole_run
from repro.curved import coupling as curved
from repro.fem import geometry, linear
from repro.march import midpoint
from repro.march.coupling import simulate as paper_run
from repro.march.simulation import simulate
from repro.scene import load_scene
from verification.case import Outcome, at_least, at_most, case
from verification.convergence import study


def _base(*changes: str):
    return load_scene("base", changes)


def _mass_after(scene, time: float) -> float:
    """(X_A + X_I) over that at the start, (9)-(10) at the supply, by hand."""
    law, both = scene.kinetics, scene.substrates
    m_a, m_d = (s.supply / (s.supply + s.half_saturation) for s in (both.acceptor, both.donor))
    rise = m_a * (law.maximum_utilization_rate * law.yield_coefficient * m_d - law.decay_coefficient)
    left = m_a * law.decay_coefficient * (1 - law.degradable_fraction)
    return float(np.exp(rise * time) + left / rise * np.expm1(rise * time))


@case("coupling-curved-uniform-growth", kind="exact",
      norm="relative error of area and mass; largest deviation of the outline from a half-disc",
      claim="Where diffusion holds the supply everywhere, curved triangles keep a half-disc of exactly exp-growing "
            "mass through remeshes, in few long steps",
      mutants=("curved-expansion-forgotten", "curved-mass-lost", "curved-half-of-the-half"))
def uniform_growth() -> Outcome:
    scene = _base('numerics.preset="fast"', 'growth.end="9 h"', 'output.times=["9 h"]')
    quick = {name: replace(getattr(scene.substrates, name), diffusivity=1e13, diffusivity_in_aggregate=1e13)
             for name in ("acceptor", "donor")}
    scene = replace(scene, flow=None, substrates=replace(scene.substrates, **quick))
    first, last = simulate(scene)
    wanted = first.pore.outline.area * _mass_after(scene, 9.0)
    outline = last.pore.outline
    free = outline.wall == geometry.FREE
    radius = np.hypot(*outline.points[free].T) / np.sqrt(2 * wanted / np.pi)
    return Outcome((at_most("mass", abs(last.pore.mass() / wanted - 1), 1e-6, "C to 1e-7 of the supply"),
                    at_most("area", abs(outline.area / wanted - 1), 1e-6, "J = theta"),
                    at_most("outline", np.abs(radius - 1).max(), 1e-4, "arcs that are parabolas: (edge / R)^4 / 100"),
                    at_least("steps' remeshes", last.remeshes, 1.0, "else less is tested")))


STEPS = (1, 2, 4, 8, 16)


@cache
def _uniform(scheme, scene, steps: int) -> np.ndarray:
    """Area and upstream tip after 2 h in equal steps, on one mesh."""
    now, solved = scheme.seeded(scene), None
    for _ in range(steps):
        solved = scheme.solve(scene, now)
        now = replace(now, concentrations=solved.concentrations)
        step = scheme.attempt(scene, now, solved, 2.0 / steps).step
        if step.remeshed:
            raise RuntimeError("a new mesh: the error in space would not be common")
        now = step.pore
    return np.array([now.outline.area, now.outline.upstream, scheme.solve(scene, now).flow.conductivity])


@case("coupling-midpoint-order", kind="property",
      norm="relative difference between a run and that with half the step; base from a seed of 25 um, 2 h, no remesh",
      claim="The midpoint rule is of second order in time, on curved triangles as on the paper's",
      mutants=("curved-rates-of-the-start", "midpoint-rates-of-the-start"))
def order_in_time() -> Outcome:
    studies = []
    for name, scheme, preset in (("curved", curved, "fast"), ("linear", midpoint, "paper")):
        scene = _base(f'numerics.preset="{preset}"', 'numerics.refinement=0.5', 'aggregate.radius="25 um"')
        values = np.array([_uniform(scheme, scene, steps) for steps in STEPS])
        apart = np.abs(np.diff(values, axis=0) / values[-1])
        for k, quantity in enumerate(("area", "upstream tip")):
            studies.append(study(f"{quantity}, {name}", 2 / np.array(STEPS[:-1]), apart[:, k], 2, "midpoint rule",
                                 ceiling=2e-5, band=0.15))
    return Outcome(studies=tuple(studies))


@case("coupling-midpoint-limit", kind="property", slow=True,
      norm="relative difference at 3.2 h from a seed of 25 um, base",
      claim="With short steps the paper's shape updates and the midpoint rule come to the same, on the same triangles",
      mutants=("midpoint-rates-of-the-start",))
def limit() -> Outcome:
    def last(run, *changes):
        *_, found = run(_base('aggregate.radius="25 um"', 'growth.end="3.2 h"', 'output.times=["3.2 h"]',
                              "numerics.refinement=0.6", *changes))
        return np.array([found.pore.outline.area, found.pore.outline.upstream])

    steps = (0.8, 0.4, 0.2, 0.1)
    middle = last(simulate, 'numerics.time="midpoint"', "numerics.tolerance=0.00003")
    apart = np.array([np.abs(last(paper_run, f'growth.time_step="{step} h"') / middle - 1) for step in steps])
    return Outcome(studies=tuple(study(name, steps, apart[:, k], 1, "shape updates: first order", ceiling=2e-3)
                                 for k, name in enumerate(("area", "upstream tip"))))


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
    _, *found = simulate(_base(f'numerics.preset="{preset}"', f"output.times=[{times}]", *changes))
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
      mutants=("curved-rates-of-the-start", "curved-fluid-diffusivity", "paired-without-decay"))
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
    apart = _apart(_listed("accurate", 'numerics.elements="cubic"'), _reference()[0])
    return Outcome(tuple(at_most(name, value, 1e-3, "what the preset is for")
                         for name, value in zip(whole_run.NAMES, apart)))


@case("coupling-jacobian-reused", kind="property",
      norm="relative difference of the area, the tips and the conductivity at 2 h; factorisations over those of fresh "
           "derivatives; base from a seed of 25 um",
      claim="Newton's methods that use a derivative again come to the same with fewer factorisations",
      mutants=("newton-never-reused",))
def reused() -> Outcome:
    checks = []
    for elements, preset in (("quadratic", "fast"), ("linear", "paper")):
        (fresh, made), (again, fewer) = (_factorisations(preset, kind) for kind in ("fresh", "reused"))
        checks += [at_most(f"difference, {elements}", np.abs(again / fresh - 1).max(), 1e-8,
                           "Newton's tolerances, 1e-10 and less, times the steps"),
                   at_most(f"factorisations, {elements}", fewer / made, 0.8, "one in three of Newton's is saved")]
    return Outcome(tuple(checks))


def _factorisations(preset: str, kind: str) -> tuple[np.ndarray, int]:
    """Area, tips and conductivity at 2 h, and how many matrices were factorised on the way."""
    scene = _base(f'numerics.preset="{preset}"', f'numerics.jacobian="{kind}"', 'aggregate.radius="25 um"',
                  'growth.end="2 h"', 'growth.time_step="1 h"')
    with mock.patch.object(linear, "factorised", wraps=linear.factorised) as factorised:
        *_, last = simulate(scene)
    shape, flow = last.pore.outline, last.solved.flow
    return np.array([shape.area, shape.upstream, shape.downstream, flow.conductivity]), factorised.call_count
