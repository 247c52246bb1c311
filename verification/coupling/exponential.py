"""Growth where nothing is scarce: the area follows (9)-(10), integrated by hand."""

from __future__ import annotations

import numpy as np

from repro.fem import geometry
from repro.march.coupling import simulate
from repro.model import pore
from verification.case import Outcome, Profile, at_least, at_most, case
from verification.coupling import runs

TIMES = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)


@case("coupling-uniform-growth", kind="exact",
      norm="largest relative error of the area, every hour to 6 h; largest deviation of the outline from a half-disc",
      claim="Where diffusion holds the supply everywhere the aggregate stays a half-disc of exactly exp-growing mass, "
            "through a remesh",
      mutants=("growth-three-percent-low", "euler-biomass", "inert-not-in-the-area", "theta-anew-at-a-remesh",
               "geometry-of-the-step-before"))
def uniform_growth() -> Outcome:
    scene = runs.base("6 h", times=", ".join(f'"{time} h"' for time in TIMES))
    scene = runs.with_diffusivities(runs.without_flow(scene), lambda water, biomass: (1e13, 1e13))
    seed, instants = pore.seeded(scene).outline, list(simulate(scene))[1:]
    areas = np.array([instant.pore.outline.area for instant in instants])
    expected = seed.area * np.array([_mass_after(scene, time) for time in TIMES])
    outline = instants[-1].pore.outline
    radius = np.hypot(*outline.points[outline.wall == geometry.FREE].T) / np.sqrt(2 * expected[-1] / np.pi)
    chord = 1 - np.sqrt(2 * seed.area / np.pi) / scene.aggregate.radius
    profile = Profile("area", "time (h)", "area (um2)", (("ours", "ours", np.array(TIMES), areas),
                                                         ("closed form", "exact", np.array(TIMES), expected)))
    return Outcome((at_most("area", np.abs(areas / expected - 1).max(), 1e-8,
                            "J = theta to the stabilisation, and C to 1e-8 of the supply: D is a million times D_A"),
                    at_most("outline", np.abs(radius - 1).max(), 1.5 * chord + 1e-3,
                            "polygon for arc, and linear elements"),
                    at_least("remeshes", sum(i.remeshes for i in instants), 1.0, "else that is not tested")),
                   (), (profile,))


def _mass_after(scene, time: float) -> float:
    """(X_A + X_I) over that at the start, (9)-(10) at the supply, by hand."""
    law, both = scene.kinetics, scene.substrates
    m_a, m_d = (s.supply / (s.supply + s.half_saturation) for s in (both.acceptor, both.donor))
    rise = m_a * (law.maximum_utilization_rate * law.yield_coefficient * m_d - law.decay_coefficient)
    left = m_a * law.decay_coefficient * (1 - law.degradable_fraction)
    return float(np.exp(rise * time) + left / rise * np.expm1(rise * time))
