"""Cubic concentrations on curved triangles: the channels of the quadratic cases, fourth order in L2.

The effluent, a functional of the solution, is of sixth order and soon at round-off: one mesh of it is judged.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from repro.curved import pore
from repro.scene import parse_scene
from verification.case import Outcome, at_most, case
from verification.convergence import refine, study
from verification.transport.curved import DENSITIES, SCENE, mean, monod_errors, robin_errors

#: Random meshes of each size; with Monod uptake they are coarser, as solve_bvp is good to 1e-11 or so.
LINEAR, MONOD = {3.2: 8, 1.6: 6, 0.8: 4, 0.4: 2}, {6.4: 8, 3.2: 4, 1.6: 3, 0.8: 2}
FOURTH = "cubic elements: fourth order in L2"


@case("transport-cubic-robin", kind="exact", slow=True,
      norm="root mean square of C over the mesh, and C leaving with 1.6 um, over the supply",
      claim="Cubic concentrations follow the closed form of first-order uptake in a slab to fourth order, the inlet's "
            "(11) included, at Peclet 1 and 10",
      mutants=("cubic-outlet-order", "cubic-quadratic-uptake", "curved-outlet-forgotten"))
def robin() -> Outcome:
    studies, checks = [], []
    for peclet, ceiling in ((1.0, 2e-11), (10.0, 1e-9)):
        errors = refine(partial(mean, robin_errors, meshes=LINEAR), LINEAR, peclet, 3)
        studies.append(study(f"C, Pe = {peclet:g}", errors["size"], errors["C"], 4, FOURTH, ceiling=ceiling))
        checks.append(at_most(f"C leaving, Pe = {peclet:g}", errors["out"][1], 1e-11,
                              "sixth order: twice that of the gradient"))
    return Outcome(tuple(checks), tuple(studies))


@case("transport-cubic-monod", kind="cross-code", slow=True,
      norm="root mean square over the mesh of both substrates less solve_bvp, over the supply",
      claim="Dual Monod uptake under plug flow on cubic triangles is solve_bvp's, to fourth order, from barely touched "
            "to starved biomass",
      mutants=("cubic-quadratic-uptake",))
def monod() -> Outcome:
    studies = []
    for density in DENSITIES:
        errors = refine(partial(mean, monod_errors, meshes=MONOD), MONOD, 1.0, density, 3)
        studies.append(study(f"Pe = 1, X = {density:g} mg/L", errors["size"], errors["C"], 4, FOURTH, ceiling=1e-9))
    return Outcome(studies=tuple(studies))


@case("transport-cubic-half-disc", kind="property",
      norm="(in - out - consumed) over what comes in; difference over the supply to quadratic concentrations",
      claim="Around a half-disc, under the flow of cubic velocities, each substrate is in balance to round-off, and "
            "the effluents are those of quadratic elements on a mesh twice finer",
      mutants=("cubic-outlet-order", "curved-outlet-forgotten"))
def half_disc() -> Outcome:
    (cubic, _), (quadratic, _) = _fluxes("cubic", 0.45), _fluxes("quadratic", 0.9)
    supply, checks = SCENE.substrates.acceptor.supply, []
    for name, ours, theirs in zip(("acceptor", "donor"), cubic, quadratic):
        defect = ours.supplied - ours.out - ours.consumed
        checks += [at_most(f"balance, {name}", abs(defect / ours.supplied), 1e-11, "round-off: the form conserves"),
                   at_most(f"effluent, {name}", abs(ours.effluent - theirs.effluent) / supply, 1e-5,
                           "a hundredth of what preset accurate is for")]
    return Outcome(tuple(checks))


def _fluxes(elements: str, refinement: float):
    """Ledgers around a half-disc of 40 um in a pore of 50 um, and the concentrations at the mesh's nodes."""
    tables = {"pore": {"width": "50 um"}, "aggregate": {"radius": "40 um"}, "flow": {"mean_velocity": "2.9 m/day"},
              "substrates": {}, "numerics": {"preset": "accurate", "refinement": refinement, "elements": elements}}
    scene = parse_scene(tables, "half disc", "half_disc.toml")
    found = pore.solve(scene, pore.seeded(scene))
    return found.fluxes, np.column_stack([found.concentrations.acceptor, found.concentrations.donor])
