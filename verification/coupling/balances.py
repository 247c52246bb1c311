"""What every single step must balance, all at once, and how right the amounts are that balance.

Two balances may close on wrong amounts, as both do when a step's ledger takes the flows of its start: the third one,
of what is made against what is taken up, and a run with shorter steps see that.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy.interpolate import CubicSpline

from repro.march.loop import Instant, Ledger
from repro.march.simulation import simulate
from repro.scene import Kinetics, Scene
from verification.case import Outcome, Profile, at_least, at_most, case
from verification.convergence import Study, study
from verification.coupling import runs

#: Round-off and Newton's tolerance, 1e-13 of the largest term of each row, over all rows and with room to spare.
CLOSED, CLOSES = 1e-9, "identities of the discrete equations: round-off and Newton's tolerance, with room"
#: Steps of the paper's updates (h), from the longest on.
STEPS = (0.8, 0.4, 0.2, 0.1)
#: How long (h) a run goes on after contact.
PAST = 2.0


@case("coupling-one-balance", kind="property", slow=True,
      norm="worst ledger step, all at once: |supplied - out - consumed - stored| over supplied, |after - before - "
           "made| over after, |made - (Y donor - (acceptor - F donor) / d_c)| over the larger of its two terms; base, "
           "and a pore of 40 um at 2.9 m/d from a seed to 2 h past contact",
      claim="In every step what is supplied leaves, is consumed or stored, what is there is what was and what is made, "
            "and what is made is what the substrates taken up are worth: to round-off by the midpoint rule, to second "
            "order by the paper's updates",
      mutants=("biomass-of-the-start-takes-up", "remesh-half-way-unmatched", "masses-of-the-start-kept",
               "flows-of-the-start"))
def one_balance() -> Outcome:
    checks = [check for preset in runs.PRESETS for check in (*_of_base(preset), *_of_narrow(preset))]
    for elements in runs.ELEMENTS:
        checks += _of_midpoints(elements)
        checks += _of_gear(elements)
    return Outcome(tuple(checks), tuple(_of_updates(elements) for elements in runs.ELEMENTS))


def defects(law: Kinetics, ledgers: Iterable[Ledger]) -> np.ndarray:
    """(steps, 3) of substrates (the worse), of biomass, and of what is made against what is taken up."""
    return np.array([(_substrates(step), _biomass(step), _worth(law, step)) for step in ledgers])


def _substrates(step: Ledger) -> float:
    """The worse of both substrates."""
    left = np.array(step.supplied) - step.out - step.consumed - step.stored
    return float(np.max(np.abs(left) / step.supplied))


def _biomass(step: Ledger) -> float:
    return abs(step.biomass_after - step.biomass_before - step.biomass_made) / step.biomass_after


def _worth(law: Kinetics, step: Ledger) -> float:
    """Biomass made, against Y times the donor less what decays: the acceptor beyond F times the donor, over d_c."""
    acceptor, donor = step.consumed
    grown = law.yield_coefficient * donor
    decayed = (acceptor - law.acceptor_to_donor_ratio * donor) / law.decay_oxygen_demand
    return abs(step.biomass_made - (grown - decayed)) / max(abs(grown), abs(decayed))


def _closed(name: str, scene: Scene, ledgers: Iterable[Ledger], worth: float, why: str) -> list:
    """Checks of a run."""
    worst = defects(scene.kinetics, ledgers).max(axis=0)
    return [at_most(f"substrates, {name}", worst[0], CLOSED, CLOSES),
            at_most(f"biomass, {name}", worst[1], CLOSED, CLOSES),
            at_most(f"made against taken up, {name}", worst[2], worth, why)]


#: What the paper's updates may err by in a step: they weigh the rates of both ends alike, and grow by their mean.
TRAPEZOID = 2e-4, "trapezoidal rule on an exponential: (r step)^2 / 12, 1.2e-4 at the supply's rate"


def _bound(preset: str) -> tuple[float, str]:
    return TRAPEZOID if preset == "paper" else (CLOSED, CLOSES)


def _of_base(preset: str) -> list:
    """Checks of base."""
    scene = runs.base("19.4 h", runs.by(preset))
    instants = list(simulate(scene))
    return [*_closed(f"base, {preset}", scene, _ledgers(instants), *_bound(preset)),
            at_least(f"remeshes, base, {preset}", sum(i.remeshes for i in instants), 1.0, "else they are not tested")]


def _of_narrow(preset: str) -> list:
    """Checks of a pore of 40 um through contact."""
    scene = runs.every_step("25 h", runs.by(preset), 'pore.width="40 um"')
    scene = runs.at_velocity(scene, runs.SPEED)
    instants, touched = [], np.inf
    for instant in simulate(scene):
        instants.append(instant)
        touched = min(touched, instant.pore.time if instant.pore.contact else np.inf)
        if instant.pore.time >= touched + PAST:
            break
    name = f"40 um, {preset}"
    return [*_closed(name, scene, _ledgers(instants), *_bound(preset)),
            at_least(f"hours after contact, {name}", instants[-1].pore.time - touched, PAST, "else less is tested")]


def _ledgers(instants: Iterable[Instant]) -> list[Ledger]:
    return [step for instant in instants for step in instant.ledgers]


def _short(elements: str, *changes: str) -> Scene:
    """Base from 20 um to 1.6 h."""
    return runs.base("1.6 h", runs.of(elements), 'aggregate.radius="20 um"', *changes)


def _of_midpoints(elements: str) -> list:
    """Checks of a short run by the midpoint rule, with any kind of elements."""
    scene = _short(elements, runs.by("fast"), "numerics.refinement=0.5")
    return _closed(f"midpoint rule, {elements}", scene, _ledgers(simulate(scene)), CLOSED, CLOSES)


def _of_gear(elements: str) -> list:
    """Checks of a short run by the paper's transient scheme, with any kind of elements."""
    scene = _short(elements, 'numerics.transport="gear"', "numerics.refinement=0.5")
    return _closed(f"gear, {elements}", scene, _ledgers(simulate(scene)), 1e-3, "its own tolerance, 0.1 %")


def _of_updates(elements: str) -> Study:
    """Made against taken up in the worst step of the paper's updates, as steps become shorter."""
    errors = [_worst_update(elements, step) for step in STEPS]
    return study(f"made against taken up, updates, {elements}", STEPS, errors, 2, "Heun's method, and the trapezoidal "
                 "rule on what is consumed: second order", ceiling=4e-5, band=0.15)


def _worst_update(elements: str, step: float) -> float:
    scene = _short(elements, f'growth.time_step="{step} h"', "numerics.refinement=0.5")
    return float(defects(scene.kinetics, _ledgers(simulate(scene)))[:, 2].max())


#: What the presets are for, in all; three times that in a single step.
RIGHT = {"fast": 1e-2, "accurate": 1e-3}
IN_A_STEP = 3.0


@case("coupling-amounts", kind="property", slow=True,
      norm="amounts of both substrates consumed over base, and in its worst step, over those of a run with a hundredth "
           "of the tolerance, less 1; of that run, of ten times as many steps, the cumulated amounts are interpolated "
           "at the ends of the steps by a cubic spline",
      claim="The amounts in the ledgers are those of ten times shorter steps: to 1 % by preset fast and 0.1 % by "
            "accurate in all, to three times that in every step",
      mutants=("flows-of-the-start", "curved-rates-of-the-start"))
def amounts() -> Outcome:
    checks, profiles = [], []
    for preset in RIGHT:
        found, profile = _amounts(preset)
        checks += found
        profiles.append(profile)
    return Outcome(tuple(checks), (), tuple(profiles))


def _amounts(preset: str) -> tuple[list, Profile]:
    """Checks and a picture of one preset."""
    scene = runs.base("19.4 h", runs.by(preset))
    shorter = runs.base("19.4 h", runs.by(preset), f"numerics.tolerance={scene.numerics.tolerance / 100}")
    (times, ours), (fine, theirs) = (_cumulated(one) for one in (scene, shorter))
    there = CubicSpline(fine, theirs)(times)
    in_all, in_a_step = np.abs(ours[-1] / there[-1] - 1), np.abs(np.diff(ours, axis=0) / np.diff(there, axis=0) - 1)
    checks, bound = [], RIGHT[preset]
    for k, name in enumerate(("acceptor", "donor")):
        checks += [at_most(f"{name} in all, {preset}", in_all[k], bound, "what the preset is for"),
                   at_most(f"{name} in a step, {preset}", in_a_step[:, k].max(), IN_A_STEP * bound,
                           "three times what the preset is for")]
    checks.append(at_least(f"steps, of the other run over these, {preset}", len(fine) / len(times), 6.0,
                           "tolerance to the power 1/2, ten; fewer where a step ends with the run"))
    return checks, Profile(f"acceptor consumed, {preset}", "time (h)", "um2 mg/L",
                           (("ours", "ours", times, ours[:, 0]), ("shorter steps", "reference", fine, theirs[:, 0])))


def _cumulated(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """(ends of steps (n + 1,) h, amounts of acceptor and donor consumed until then (n + 1, 2)), zero first."""
    ledgers = _ledgers(simulate(scene))
    consumed = np.cumsum([step.consumed for step in ledgers], axis=0)
    return np.array([0.0, *(step.end for step in ledgers)]), np.vstack([np.zeros(2), consumed])
