"""Flow, transport and uptake around thin aggregates at t = 0: Peclet by uptake, from hardly touched to starved."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from repro.model import pore
from verification.case import Outcome, Profile, at_most, case
from verification.convergence import study
from verification.coupling import averaged, averaged_thin, runs

ASPECTS = (0.2, 0.1, 0.05, 0.025)
#: u times half the aggregate's length over D_A; X_m (mg/L) over the square of the aspect ratio.
PECLETS, DENSITIES = (0.1, 1.0, 5.0), (1e6, 3e6, 1e7)


@case("coupling-averaged-uptake", kind="cross-code", slow=True,
      norm="largest difference of the section means of C_A and C_D along the mesh, over the supply; half-ellipses 5 um "
           "high, thickness over half length 1/5 to 1/40 (FiPy's cells: its inverse, u: as it, X_m: as its square)",
      claim="Around thin aggregates C is the averaged pore's (FiPy) up to the square of the aspect ratio, at Peclet "
            "0.1, 1, 5 and three densities, from 99 % to 1 % of the acceptor leaving",
      mutants=("inlet-held", "seed-too-thin"))
def uptake() -> Outcome:
    checks, studies, profiles = [], [], []
    for elements in ("linear", "quadratic"):
        found = [_around(elements, aspect) for aspect in ASPECTS]
        studies += [study(f"Pe = {peclet:g}, X = {density:g} mg/L, {elements}", ASPECTS,
                          [rows[peclet, density][0] for rows in found], 2, averaged_thin.SQUARE, ceiling=1e-3)
                    for peclet, density in found[0]]
        thinnest = [profile for _, profile in found[-1].values()]
        left = min(profile.curves[0][3][-1] for profile in thinnest) / 10.0
        checks.append(at_most(f"acceptor leaving the starved one, over the supply, {elements}", left, 0.02,
                              "else none is starved"))
        profiles += thinnest
    return Outcome(tuple(checks), tuple(studies), tuple(profiles))


def _around(elements: str, aspect: float) -> dict:
    """{(Peclet, density): (largest difference, profile)} on one mesh."""
    with runs.shaped(lambda radius, geometry: averaged_thin.half_ellipse(radius / aspect, radius, geometry)):
        now = pore.seeded(averaged_thin.scene(elements, aspect))
    return {(peclet, density): _compared(elements, aspect, now, peclet, density)
            for peclet in PECLETS for density in DENSITIES}


def _compared(elements: str, aspect: float, now: pore.Pore, peclet: float, density: float) -> tuple[float, Profile]:
    scene = averaged_thin.scene(elements, aspect)
    speed = peclet * scene.substrates.acceptor.diffusivity * aspect / averaged_thin.THICKNESS
    dense = replace(scene.kinetics, maximum_density=density * aspect**2)
    scene = runs.at_velocity(replace(scene, kinetics=dense), speed)
    now = replace(now, active=now.active * density / averaged_thin.DENSITY)
    x = np.linspace(*now.mesh.ends, averaged.PLACES)
    ours = runs.section_means(now, pore.solve(scene, now), x)
    moment = averaged_thin.strip_of(scene, now.outline.area, round(16 / aspect)).seed()
    theirs = np.stack([np.interp(x, moment.x, field) for field in moment.fields])
    curves = [(name, kind, x, field) for kind, both in (("ours", ours), ("reference", theirs))
              for name, field in zip(("C_A", "C_D") if kind == "ours" else ("averaged", "averaged"), both)]
    return (float(np.abs(ours - theirs).max()) / 10.0,
            Profile(f"Pe = {peclet:g}, X = {density:g} mg/L, {elements}", "x (um)", "C (mg/L)", tuple(curves)))
