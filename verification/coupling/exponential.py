"""Growth where nothing is scarce: the area follows (9)-(10), integrated by hand."""

from __future__ import annotations

import numpy as np

from repro.fem.outline import FREE
from repro.march.simulation import simulate
from repro.model import pore
from verification.case import Outcome, Profile, at_least, at_most, case
from verification.coupling import runs

TIMES = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)


def _everywhere(scene):
    """The scene without flow, diffusion a million times D_A and more."""
    return runs.with_diffusivities(runs.without_flow(scene), lambda water, biomass: (1e13, 1e13))


@case("coupling-uniform-growth", kind="exact",
      norm="largest relative error of the area, every hour to 6 h; largest deviation of the outline from a half-disc",
      claim="Where diffusion holds the supply everywhere the aggregate stays a half-disc of exactly exp-growing mass, "
            "through a remesh",
      mutants=("growth-three-percent-low", "euler-biomass", "inert-not-in-the-area", "theta-anew-at-a-remesh",
               "geometry-of-the-step-before"))
def uniform_growth() -> Outcome:
    checks, profiles = [], []
    for elements in runs.ELEMENTS:
        found, profile = _updated(elements)
        checks += found
        profiles.append(profile)
    return Outcome(tuple(checks), (), tuple(profiles))


def _updated(elements: str) -> tuple[list, Profile]:
    """Checks and a picture of a run by the paper's updates."""
    times = ", ".join(f'"{time} h"' for time in TIMES)
    scene = _everywhere(runs.base("6 h", runs.of(elements), runs.coarser(elements, 0.3), times=times))
    seed, instants = pore.seeded(scene).outline, list(simulate(scene))[1:]
    areas = np.array([instant.pore.outline.area for instant in instants])
    expected = seed.area * np.array([_mass_after(scene, time) for time in TIMES])
    profile = Profile(f"area, {elements}", "time (h)", "area (um2)",
                      (("ours", "ours", np.array(TIMES), areas),
                       ("closed form", "exact", np.array(TIMES), expected)))
    bound, origin = _roundness(scene, seed)
    checks = [at_most(f"area, {elements}", np.abs(areas / expected - 1).max(), 1e-8,
                      "J = theta to the stabilisation, and C to 1e-8 of the supply: D is a million times D_A"),
              at_most(f"outline, {elements}", _unround(instants[-1], expected[-1]), bound, origin),
              at_least(f"remeshes, {elements}", sum(i.remeshes for i in instants), 1.0, "else that is not tested")]
    return checks, profile


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


@case("coupling-curved-uniform-growth", kind="exact",
      norm="relative error of area and mass; largest deviation of the outline from a half-disc",
      claim="Where diffusion holds the supply everywhere the midpoint rule keeps a half-disc of exactly exp-growing "
            "mass through remeshes, in few long steps",
      mutants=("theta-power", "curved-mass-lost", "curved-half-of-the-half"))
def long_steps() -> Outcome:
    return Outcome(tuple(check for elements in runs.ELEMENTS for check in _by_midpoints(elements)))


def _by_midpoints(elements: str) -> list:
    """Checks of a run to 9 h with the steps of the preset fast."""
    scene = _everywhere(runs.base("9 h", runs.by("fast"), runs.of(elements), runs.coarser(elements, 0.2)))
    first, last = simulate(scene)
    wanted = first.pore.outline.area * _mass_after(scene, 9.0)
    bound, origin = _roundness(scene, first.pore.outline)
    mass = last.pore.mass / scene.kinetics.maximum_density
    return [at_most(f"mass, {elements}", abs(mass / wanted - 1), 1e-6, "C to 1e-7 of the supply"),
            at_most(f"area, {elements}", abs(last.pore.outline.area / wanted - 1), 1e-6, "J = theta"),
            at_most(f"outline, {elements}", _unround(last, wanted), bound, origin),
            at_least(f"remeshes, {elements}", last.remeshes, 1.0, "else less is tested")]


def _mass_after(scene, time: float) -> float:
    """(X_A + X_I) over that at the start, (9)-(10) at the supply, by hand."""
    law, both = scene.kinetics, scene.substrates
    m_a, m_d = (s.supply / (s.supply + s.half_saturation) for s in (both.acceptor, both.donor))
    rise = m_a * (law.maximum_utilization_rate * law.yield_coefficient * m_d - law.decay_coefficient)
    left = m_a * law.decay_coefficient * (1 - law.degradable_fraction)
    return float(np.exp(rise * time) + left / rise * np.expm1(rise * time))
