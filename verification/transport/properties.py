"""What must hold whatever the solution is: the balance closes, nothing is negative, and there is one steady state."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from repro.model import gear, pore, transport
from repro.scene import load_scene
from verification.case import Outcome, at_most, case
from verification.transport.channels import both

NAMES = ("acceptor", "donor")
SLOW = 0.35e6 / 24
#: Radius (um), supplies of acceptor and donor (mg/L): pores under 0.35 m/d whose biomass could take up far more.
STARVED = [(radius, *supplies) for radius in (27.0, 42.0)
           for supplies in ((0.15, 0.15), (0.15, 10.0), (10.0, 0.15), (10.0, 10.0))]
ROUND_OFF = "the sum of the weak form over its test functions; rows are solved to 1e-13 of terms 1e3 times the supply"


@cache
def _solved(radius: float, acceptor: float = 10.0, donor: float = 10.0, speed: float | None = 2.9e6 / 24,
            inlet: str = "local"):
    """(Pore, Solved); speed: um/h, None: no flow."""
    scene = load_scene("base", [f'aggregate.radius="{radius} um"', f'substrates.acceptor.supply="{acceptor} mg/L"',
                                f'substrates.donor.supply="{donor} mg/L"', f'numerics.inlet="{inlet}"'])
    carried = None if speed is None else replace(scene.flow, head=None, mean_velocity=speed)
    scene = replace(scene, flow=carried)
    now = pore.seeded(scene)
    return now, pore.solve(scene, now)


def _defects(now, solved) -> list[float]:
    """(supplied - out - consumed) / supplied of both substrates."""
    both_fluxes = transport.fluxes(solved.problem, now.active, solved.concentrations)
    return [(flux.supplied - flux.out - flux.consumed) / flux.supplied for flux in both_fluxes]


@case("transport-balance", kind="property",
      norm="supplied - out - consumed over supplied; in time, less what is stored",
      claim="Supply in = out + consumed to round-off, with flow and without; with the printed inlet (11) once its "
            "(u_ave - u_x) C is counted [E4]; and supply in = out + consumed + stored in the transient scheme",
      mutants=("carried-by-u", "weights-of-the-ends", "ledger-of-backward-euler"))
def balance() -> Outcome:
    rows = [("R = 5 um", _solved(5.0)), ("R = 40 um", _solved(40.0)), ("R = 20 um, no flow", _solved(20.0, speed=None))]
    checks = [at_most(f"{name}, {title}", abs(defect), 1e-9, ROUND_OFF)
              for title, found in rows for name, defect in zip(NAMES, _defects(*found))]
    return Outcome((*checks, *_printed_inlet(), *_in_time(_solved(5.0)), *_in_time(_solved(42.0, 10.0, 0.15, SLOW))))


def _printed_inlet():
    now, solved = _solved(30.0, speed=SLOW, inlet="mean")
    lost = [(operator.source / operator.supply - operator.inflow) @ field / operator.supplied
            for operator, field in zip(solved.problem.both, both(solved.concentrations))]
    return [at_most(f"{name}, R = 30 um, printed inlet", abs(defect - part), 1e-9, ROUND_OFF)
            for name, defect, part in zip(NAMES, _defects(now, solved), lost)]


def _in_time(found):
    """From the supply everywhere, over 36 s in controlled steps."""
    now, solved = found
    start = transport.supplied_everywhere(solved.problem)
    done = gear.advance(solved.problem, now.active, now.inert, start, 0.01)
    radius = now.outline.points[:, 1].max()
    return [at_most(f"{name}, R = {radius:.0f} um, in time", abs(supplied - out - consumed - stored) / supplied, 3e-12,
                    "fluxes are integrated by the formula of the concentrations: round-off")
            for name, (supplied, out, consumed, stored) in zip(NAMES, zip(*done.flows))]


@case("transport-starved", kind="property",
      norm="least C over the supply; balance as above; largest relative difference between ways to the steady state",
      claim="Starved pores (0.35 m/d, radius 27 and 42 um, supplies of 0.15 and 10 mg/L) have one steady state, "
            "C >= 0, that closes the balance to round-off, whatever Newton's method starts from; the transient scheme "
            "comes to rest in it",
      mutants=("unguarded-newton", "newton-stopped-early"))
def starved() -> Outcome:
    checks = [check for row in STARVED for check in _starved(*row)]
    return Outcome((*checks, *(_at_rest(*row) for row in STARVED[:4])))


def _titled(radius: float, acceptor: float, donor: float) -> str:
    return f"R = {radius:g} um, supplies {acceptor:g}, {donor:g} mg/L"


def _starved(radius: float, *supplies: float):
    now, solved = _solved(radius, *supplies, SLOW)
    title = _titled(radius, *supplies)
    found = both(solved.concentrations)
    least = max(-(field.min() / supply) for field, supply in zip(found, supplies))
    return (at_most(f"least C below zero, {title}", max(least, 0.0), 0.0, "C >= 0 (trap 1)"),
            at_most(f"balance, {title}", np.abs(_defects(now, solved)).max(), 1e-9, ROUND_OFF),
            at_most(f"from other first iterates, {title}", _spread(now, solved, found), 1e-8, "one steady state"))


def _spread(now, solved, found) -> float:
    """From rich and from random first iterates, up to 30 mg/L."""
    random = np.random.default_rng(1)
    guesses = [np.full_like(found, 30.0), random.uniform(0, 30.0, found.shape), random.uniform(0, 0.1, found.shape)]
    again = [both(transport.steady(solved.problem, now.active, transport.Concentrations(*guess))) for guess in guesses]
    return max(float(np.abs(one / found - 1).max()) for one in again)


def _at_rest(radius: float, *supplies: float):
    now, solved = _solved(radius, *supplies, SLOW)
    again, found = both(gear.settle(solved.problem, now.active, None)), both(solved.concentrations)
    return at_most(f"the transient scheme at rest, {_titled(radius, *supplies)}", np.abs(again / found - 1).max(), 1e-7,
                   "it stops when 1e-9 of the supply is left to come")
