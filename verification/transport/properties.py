"""What must hold whatever the solution is: the balance closes, nothing is negative, and there is one steady state."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from repro.model import gear, pore, transport
from repro.model.kinetics import Sink
from repro.scene import load_scene
from verification.case import Outcome, at_most, case
from verification.transport.channels import NAMES, ORDERS, WORDS, both

SLOW = 0.35e6 / 24
#: Radius (um), supplies of acceptor and donor (mg/L): pores under 0.35 m/d whose biomass could take up far more.
STARVED = [(radius, *supplies) for radius in (27.0, 42.0)
           for supplies in ((0.15, 0.15), (0.15, 10.0), (10.0, 0.15), (10.0, 10.0))]
#: Refinements of each order: less than the paper's where elements are curved.
REFINED = {1: 1.0, 2: 0.5, 3: 0.4}
ROUND_OFF = "the sum of the weak form over its test functions; rows are solved to 1e-13 of terms 1e3 times the supply"


@cache
def _solved(radius: float, acceptor: float = 10.0, donor: float = 10.0, speed: float | None = 2.9e6 / 24,
            inlet: str = "local", order: int = 1):
    """(Pore, Solved); speed: um/h, None: no flow."""
    scene = load_scene("base", [f'aggregate.radius="{radius} um"', f'substrates.acceptor.supply="{acceptor} mg/L"',
                                f'substrates.donor.supply="{donor} mg/L"', f'numerics.inlet="{inlet}"',
                                f'numerics.elements="{WORDS[order]}"', f"numerics.refinement={REFINED[order]}"])
    carried = None if speed is None else replace(scene.flow, head=None, mean_velocity=speed)
    scene = replace(scene, flow=carried)
    now = pore.seeded(scene)
    return now, pore.solve(scene, now)


def _defects(now, solved) -> list[float]:
    """(supplied - out - consumed) / supplied of both substrates."""
    both_fluxes = transport.fluxes(solved.problem, Sink(now.active), solved.concentrations)
    return [(flux.supplied - flux.out - flux.consumed) / flux.supplied for flux in both_fluxes]


@case("transport-balance", kind="property",
      norm="supplied - out - consumed over supplied; in time, less what is stored",
      claim="Supply in = out + consumed to round-off, with flow and without; with the printed inlet (11) once its "
            "(u_ave - u_x) C is counted [E4]; and supply in = out + consumed + stored in the transient scheme; with "
            "linear, quadratic and cubic elements",
      mutants=("carried-by-u", "weights-of-the-ends", "ledger-of-backward-euler", "printed-inlet-forgotten",
               "outlet-forgotten"))
def balance() -> Outcome:
    checks = []
    for order in ORDERS:
        rows = [("R = 5 um", _solved(5.0, order=order)), ("R = 40 um", _solved(40.0, order=order)),
                ("R = 20 um, no flow", _solved(20.0, speed=None, order=order))]
        for title, found in rows:
            checks += [at_most(f"{name}, {title}, {WORDS[order]}", abs(defect), 1e-9, ROUND_OFF)
                       for name, defect in zip(NAMES, _defects(*found))]
        checks += [*_printed_inlet(order), *_in_time(_solved(5.0, order=order), order),
                   *_in_time(_solved(20.0, speed=None, order=order), order)]
    return Outcome((*checks, *_in_time(_solved(42.0, 10.0, 0.15, SLOW), 1)))


def _printed_inlet(order: int):
    """What enters is u_ave C_s less (u_ave - u_x) C of what is at the inlet, (u_ave - u_x) C_h counted as the weak form
    has it: lumped at the nodes with linear elements."""
    now, solved = _solved(30.0, speed=SLOW, inlet="mean", order=order)
    made, space = solved.problem, now.space
    edges = space.dofs.inlet
    apart = solved.flow.mean_velocity - solved.flow.velocity[:, 0]
    weight = space.summed(edges, space.end_loads(edges, apart))
    lost = [weight @ field / supplied for field, supplied in
            zip(both(solved.concentrations), made.source.reshape(2, -1).sum(axis=1))]
    return [at_most(f"{name}, R = 30 um, printed inlet, {WORDS[order]}", abs(defect - part), 1e-9, ROUND_OFF)
            for name, defect, part in zip(NAMES, _defects(now, solved), lost)]


def _in_time(found, order: int):
    """From the supply everywhere, over 36 s in controlled steps."""
    now, solved = found
    start = transport.supplied_everywhere(solved.problem)
    done = gear.advance(solved.problem, now.active, now.inert, start, 0.01)
    told = f"R = {now.outline.thickness:.0f} um, in time, " + ("" if solved.flow else "no flow, ") + WORDS[order]
    return [at_most(f"{name}, {told}", abs(supplied - out - consumed - stored) / supplied, 3e-12,
                    "fluxes are integrated by the formula of the concentrations: round-off")
            for name, (supplied, out, consumed, stored) in zip(NAMES, zip(*done.flows))]


@case("transport-starved", kind="property",
      norm="least C over the supply; balance as above; largest relative difference between ways to the steady state",
      claim="Starved pores (0.35 m/d, radius 27 and 42 um, supplies of 0.15 and 10 mg/L) have one steady state, "
            "C >= 0, that closes the balance to round-off, whatever Newton's method starts from; the transient scheme "
            "comes to rest in it; with quadratic and cubic elements C is no more below zero than is let pass",
      mutants=("newton-in-concentrations", "newton-stopped-early"))
def starved() -> Outcome:
    checks = [check for row in STARVED for check in _starved(*row)]
    for order in (2, 3):
        checks += [check for row in STARVED for check in _starved(*row, order=order)]
    return Outcome((*checks, *(_at_rest(*row) for row in STARVED[:4])))


def _titled(radius: float, acceptor: float, donor: float, order: int) -> str:
    return f"R = {radius:g} um, supplies {acceptor:g}, {donor:g} mg/L, {WORDS[order]}"


#: How far C may be below zero over the supply, and why; how alike ways to the steady state end up.
BELOW = {1: (0.0, "C >= 0"), 2: (1e-3, "what is let pass as resolved"), 3: (1e-3, "what is let pass")}


def _starved(radius: float, *supplies: float, order: int = 1):
    now, solved = _solved(radius, *supplies, SLOW, order=order)
    title, (bound, why) = _titled(radius, *supplies, order), BELOW[order]
    found = both(solved.concentrations)
    least = max(-(field.min() / supply) for field, supply in zip(found, supplies))
    return (at_most(f"least C below zero, {title}", max(least, 0.0), bound, why),
            at_most(f"balance, {title}", np.abs(_defects(now, solved)).max(), 1e-9, ROUND_OFF),
            at_most(f"from other first iterates, {title}", _spread(now, solved, found), 1e-8, "one steady state"))


def _spread(now, solved, found) -> float:
    """From rich and from random first iterates, up to 30 mg/L: with linear elements over each concentration itself,
    else, where they may be zero, over the supply."""
    random = np.random.default_rng(1)
    guesses = [np.full_like(found, 30.0), random.uniform(0, 30.0, found.shape), random.uniform(0, 0.1, found.shape)]
    size = found if now.space.order == 1 else solved.problem.supply.reshape(2, -1)
    again = [both(transport.steady(solved.problem, Sink(now.active), transport.Concentrations(*guess)))
             for guess in guesses]
    return max(float(np.abs((one - found) / size).max()) for one in again)


def _at_rest(radius: float, *supplies: float):
    now, solved = _solved(radius, *supplies, SLOW)
    again, found = both(gear.settle(solved.problem, Sink(now.active), None)), both(solved.concentrations)
    return at_most(f"the transient scheme at rest, {_titled(radius, *supplies, 1)}", np.abs(again / found - 1).max(),
                   1e-7, "it stops when 1e-9 of the supply is left to come")
