"""Fast diffusion, where averaging over sections is exact: the disagreement falls as theory says, to the coefficient."""

from __future__ import annotations

import numpy as np

from reference import averaged_pore
from repro import results
from repro.march.simulation import simulate
from verification.case import Check, Outcome, at_most, between, case
from verification.convergence import Study, study
from verification.coupling import averaged, runs

SQUARE = "regular perturbation in 1 / D: the square of the transverse Thiele number"


def thiele(scene, factor: float) -> float:
    """Transverse Thiele number of the donor over a thickness of half the pore's width, diffusivities times ``factor``:
    W/2 sqrt(X_m k / (D_B (C_s + K)))."""
    law, donor = scene.kinetics, scene.substrates.donor
    rate = law.maximum_density * law.maximum_utilization_rate / (donor.supply + donor.half_saturation)
    return scene.pore.width / 2 * float(np.sqrt(rate / (factor * donor.diffusivity_in_aggregate)))


FASTER = (4.0, 16.0, 64.0, 256.0)


@case("coupling-averaged-mixing", kind="cross-code",
      norm="effluents less those of the averaged pore (FiPy); a seed of 20 um at t = 0, refinement 1.5, D the same in "
           "fluid and biomass and times 4 to 256",
      claim="What averaging over sections costs in the effluents is, as diffusion becomes fast, the constriction of a "
            "half-disc in a strip, in closed form",
      mutants=("effluent-at-the-inlet", "inlet-held", "seed-too-thin"))
def mixing() -> Outcome:
    found = [_mixed(elements) for elements in runs.ELEMENTS]
    return Outcome(tuple(check for checks, _ in found for check in checks),
                   tuple(one for _, studies in found for one in studies))


def _mixed(elements: str) -> tuple[list[Check], list[Study]]:
    """Checks and studies with one kind of elements."""
    scene = runs.base("0 h", 'aggregate.radius="20 um"', runs.of(elements), runs.coarser(elements, 0.5, 1.5))
    scene = runs.at_velocity(scene, runs.SPEED)
    found = [_leaving(scene, factor) for factor in FASTER]
    sizes = [thiele(scene, factor) for factor in FASTER]
    studies, checks = [], []
    for k, name in enumerate(("acceptor", "donor")):
        gaps = np.array([(ours - reference)[k] for ours, reference, _ in found])
        theory = np.array([first[k] for _, _, first in found])
        studies.append(study(f"effluent {name} (mg/L), {elements}", sizes, np.abs(gaps), 2, SQUARE, ceiling=2.5e-5))
        checks.append(between(f"{name}: disagreement over first-order theory, {elements}", gaps[-1] / theory[-1],
                              0.995, 1.005, "the next order: 0.2 %, a quarter of that at D times 64; mesh: 0.7 % at "
                              "refinement 1 of linear elements, less than half of that here"))
    return checks, studies


def _leaving(scene, factor: float):
    """Effluents (2,) mg/L: ours, the averaged pore's, and the first-order difference."""
    scene = runs.with_diffusivities(scene, lambda water, _: (factor * water, factor * water))
    row = results.row(scene, next(simulate(scene)))
    ours = [row["effluent_acceptor_mg_per_L"], row["effluent_donor_mg_per_L"]]
    reference = averaged.half_disc(scene).seed()
    radius = averaged.half_disc_radius(row["aggregate_area_um2"])
    return np.array(ours), reference.fields[:, -1], averaged_pore.excess(averaged.pore_of(scene), radius, runs.SPEED)


SLOWER = (8.0, 16.0, 32.0, 64.0)
TIMES = (5.0, 10.0, 15.0, 19.4)


@case("coupling-averaged-run", kind="cross-code", slow=True,
      norm="largest difference at 5, 10, 15 and 19.4 h: area relative, effluents and section means of C along the mesh "
           "over the supply; base at 2.9 m/d, diffusivities times 8 to 64; paper, and accurate with a fifth of its "
           "tolerance: its own error in time, 4e-5, would be seen",
      claim="The whole base run is that of the averaged pore (FiPy, solve_ivp) up to the square of the transverse "
            "Thiele number, and base itself is where that square puts it",
      mutants=("rates-two-percent-low",))
def whole_run() -> Outcome:
    found = [_of_preset(preset) for preset in ("paper", "accurate")]
    return Outcome(tuple(check for checks, _, _ in found for check in checks),
                   tuple(one for _, studies, _ in found for one in studies), found[0][2])


def _of_preset(preset: str) -> tuple[list[Check], list[Study], tuple]:
    """Checks, studies and pictures of one preset."""
    found = {factor: _whole(preset, factor) for factor in (1.0, *SLOWER)}
    scene, studies, checks = _base(preset, 1.0), [], []
    sizes = [thiele(scene, factor) for factor in SLOWER]
    for name in ("area", "effluents", "C along the pore"):
        errors = [found[factor][0][name] for factor in SLOWER]
        studies.append(study(f"{name}, {preset}", sizes, errors, 2, SQUARE, ceiling=3e-4))
        if name == "C along the pore":
            continue
        checks.append(between(f"base, {name}: over the square law through the first of these, {preset}",
                              found[1.0][0][name] / (SLOWER[0] * errors[0]), 1.0, 2.0,
                              "terms of fourth order"))
    return checks, studies, tuple(found[1.0][1])


def _base(preset: str, factor: float):
    finer = ("numerics.tolerance=0.0002",) if preset == "accurate" else ()
    scene = runs.base("19.4 h", runs.by(preset), *finer, times=", ".join(f'"{time} h"' for time in TIMES))
    scene = runs.with_diffusivities(scene, lambda water, biomass: (factor * water, factor * biomass))
    return runs.at_velocity(scene, runs.SPEED)


def _whole(preset: str, factor: float):
    """(largest differences, profiles) of one run."""
    scene = _base(preset, factor)
    instants = averaged.ours(scene)
    moments = averaged.half_disc(scene).run(TIMES, accuracy=1e-6)
    rows = [averaged.apart(scene, *pair) for pair in zip(instants, moments)]
    return averaged.worst(rows), averaged.profiles(instants, moments)


#: Refinement of our mesh, our time step (min), and cells of the averaged pore: as in the whole run, and twice as fine.
COARSE, FINE = (1.0, 12.0, 1), (2.0, 6.0, 2)


@case("coupling-averaged-refined", kind="cross-code", slow=True,
      norm="change of the disagreement, over itself, when mesh, step and FiPy's cells are halved: area, effluents and "
           "section means of C; 2 h from 20 um at 2.9 m/d",
      claim="The disagreement with the averaged pore is that of the models: it stays when both codes are refined",
      mutants=("rates-at-the-start",))
def refined() -> Outcome:
    checks, profiles = [], []
    for elements in runs.ELEMENTS:
        (coarse, _), (fine, pictures) = (_piece(elements, *level) for level in (COARSE, FINE))
        checks += [at_most(f"{name}, {elements}", abs(fine[name] / coarse[name] - 1), 0.01,
                           "error in space 0.1 % of what is lost, in time 0.2 % of an hour's growth")
                   for name in ("area", "effluents", "C along the pore")]
        profiles += pictures
    return Outcome(tuple(checks), (), tuple(profiles))


def _piece(elements: str, refinement: float, minutes: float, finer: int):
    """(differences, profiles) after 2 h."""
    scene = runs.base("2 h", 'aggregate.radius="20 um"', runs.of(elements),
                      runs.coarser(elements, 0.45 * refinement, refinement),
                      f'growth.time_step="{minutes} min"')
    scene = runs.at_velocity(scene, runs.SPEED)
    instants = averaged.ours(scene)
    moments = averaged.half_disc(scene, cells=finer * averaged.CELLS, fluid=finer * averaged.FLUID).run((2.0,))
    return averaged.apart(scene, instants[-1], moments[-1]), averaged.profiles(instants, moments)
