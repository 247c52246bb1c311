"""What must hold whatever the solution is: the balance closes, nothing is negative, and there is one steady state.

Substrates around a half-disc as scenes have them, sharp fronts and fast water among them, against finer meshes.
"""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache

import numpy as np

from repro.errors import Unresolved
from repro.model import gear, pore, remeshing, transport
from repro.model.kinetics import Sink
from repro.scene import load_scene, parse_scene
from verification.kernel.case import Check, Outcome, at_most, case
from verification.problems.channels import NAMES, ORDERS, WORDS, both

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
               "outlet-forgotten"), ways="1 2 3")
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
      mutants=("newton-in-concentrations", "newton-stopped-early"), ways="1 2 3")
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


SCENE = load_scene("base")
SUPPLY = SCENE.substrates.acceptor.supply
PRESETS_NAMES = ("acceptor", "donor")
#: What the front is solved with: a scene's [numerics], and how far its effluents may be from those far away.
SOLVED = {"fast": ({"preset": "fast", "refinement": 0.25}, 1e-2),
          "accurate": ({"preset": "fast", "refinement": 0.45}, 1e-3),
          "linear": ({"preset": "paper"}, 1e-2)}
CUBIC = {"preset": "fast", "elements": "cubic", "refinement": 0.45}


@case("transport-proportion", kind="property", norm="consumed acceptor over F times consumed donor, less one",
      claim="Behind a front where the donor is used up, at half saturations of a hundredth of its supply, both are "
            "taken up in their proportion, with linear, quadratic and cubic elements",
      mutants=("unpaired",), ways="1 2 3 paper fast accurate")
def proportion() -> Outcome:
    half = "1e-2 mg/L"
    kinds = {**{name: numerics for name, (numerics, _) in SOLVED.items()}, "cubic": CUBIC}
    return Outcome(tuple(_in_proportion(_front(half, numerics), name, half) for name, numerics in kinds.items()))


def _in_proportion(found, name: str, half: str) -> Check:
    ratio = found[0].consumed / found[1].consumed / SCENE.kinetics.acceptor_to_donor_ratio
    return at_most(f"proportion, {name}, K_s = {half}", abs(ratio - 1), 1e-9,
                   "one rate for both: exact but for where Newton's method stops")


@case("transport-curved-front", kind="property", slow=True,
      norm="consumed acceptor over F times consumed donor, less one; difference of effluents over the larger supply, "
           "to a mesh of refinement 1.3",
      claim="Behind a front where the donor is used up, to half saturations of a millionth of the supply, both are "
            "taken up in their proportion, with linear and quadratic elements, and what leaves is within the "
            "presets' accuracy; where a mesh is refused, with the refinement that the refusal names",
      mutants=("unpaired",), ways="1 2 paper fast accurate", because="order 3: transport-proportion")
def front() -> Outcome:
    checks = []
    for half in ("1e-2 mg/L", "1e-3 mg/L", "1e-5 mg/L"):
        far = _front(half, {"preset": "fast", "refinement": 1.3})
        for name, (numerics, bound) in SOLVED.items():
            found = _front(half, numerics)
            apart = max(abs(a.effluent - b.effluent) for a, b in zip(found, far)) / SUPPLY
            checks += [_in_proportion(found, name, half),
                       at_most(f"effluents, {name}, K_s = {half}", apart, bound, "what the preset is for")]
    return Outcome(tuple(checks))


def _front(half: str, numerics: dict):
    """Ledgers of a thick half-disc that the donor, 1 mg/L, does not pass, without decay; on elements that are graded to
    the front, and if these are refused, with the refinement that is then advised."""
    both = {"acceptor": {"half_saturation": half}, "donor": {"supply": "1 mg/L", "half_saturation": half}}
    tables = {"pore": {"width": "100 um"}, "aggregate": {"radius": "60 um"}, "flow": {"mean_velocity": "0.29 m/day"},
              "substrates": both, "kinetics": {"decay_coefficient": "0 1/day"}, "numerics": numerics}
    scene = _scene(tables)
    try:
        return remeshing.resolved(scene, pore.seeded(scene))[1].fluxes
    except Unresolved as refusal:
        advised = re.search(r"numerics\.refinement = ([\d.]+) resolves this state", str(refusal))
        if advised is None:
            raise
    scene = replace(scene, numerics=replace(scene.numerics, refinement=float(advised[1])))
    return remeshing.resolved(scene, pore.seeded(scene))[1].fluxes


def _scene(tables: dict):
    return parse_scene(tables, "half disc", "half_disc.toml")


def _fluxes(tables: dict):
    """Ledgers of a scene at t = 0, on the first mesh that is made."""
    scene = _scene(tables)
    return pore.solve(scene, pore.seeded(scene)).fluxes


FAR, WITHIN = 2.5, "0.1 %, what preset accurate is for"


@case("transport-curved-peclet", kind="property", slow=True,
      norm="difference of effluents, over the supply, and of consumption, relative, to a mesh of refinement 2.5",
      claim="In fast water (u W / D to 3e4) the boundary layers that preset accurate makes its elements for are "
            "resolved to 0.1 %, with quadratic and with cubic elements",
      mutants=("layers-ignored",),
      ways="2 3 accurate", because="paper, fast: elements for boundary layers are accurate's")
def peclet() -> Outcome:
    checks = []
    for speed in ("2.9 m/day", "29 m/day", "290 m/day"):
        far = _carried(speed, FAR, "quadratic")
        for kind in ("quadratic", "cubic"):
            for name, ours, trusted in zip(PRESETS_NAMES, _carried(speed, 0.45, kind), far):
                told = f"{name}, {speed}, {kind}"
                checks += [at_most(f"effluent {told}", abs(ours.effluent - trusted.effluent) / SUPPLY, 1e-3, WITHIN),
                           at_most(f"consumed {told}", abs(ours.consumed / trusted.consumed - 1), 1e-3, WITHIN)]
    return Outcome(tuple(checks))


@cache
def _carried(speed: str, refinement: float, kind: str):
    """Ledgers of a thick half-disc in a pore of 100 um."""
    return _fluxes({"pore": {"width": "100 um"}, "aggregate": {"radius": "60 um"}, "flow": {"mean_velocity": speed},
                    "substrates": {},
                    "numerics": {"preset": "accurate", "refinement": refinement, "elements": kind}})


@case("transport-cubic-half-disc", kind="property",
      norm="(in - out - consumed) over what comes in; difference over the supply to quadratic concentrations",
      claim="Around a half-disc, under the flow of cubic velocities, each substrate is in balance to round-off, and "
            "the effluents are those of quadratic elements on a mesh twice finer",
      mutants=("cubic-edge-nodes", "outlet-forgotten"),
      ways="2 3 accurate", because="order 1 and the others: transport-balance")
def half_disc() -> Outcome:
    checks = []
    for name, ours, theirs in zip(PRESETS_NAMES, _around("cubic", 0.45), _around("quadratic", 0.9)):
        for kind, flux in (("cubic", ours), ("quadratic", theirs)):
            defect = flux.supplied - flux.out - flux.consumed
            checks.append(at_most(f"balance, {name}, {kind}", abs(defect / flux.supplied), 1e-11,
                                  "round-off: the form conserves"))
        checks.append(at_most(f"effluent, {name}", abs(ours.effluent - theirs.effluent) / SUPPLY, 1e-5,
                              "a hundredth of what preset accurate is for"))
    return Outcome(tuple(checks))


def _around(kind: str, refinement: float):
    """Ledgers around a half-disc of 40 um in a pore of 50 um."""
    return _fluxes({"pore": {"width": "50 um"}, "aggregate": {"radius": "40 um"},
                    "flow": {"mean_velocity": "2.9 m/day"}, "substrates": {},
                    "numerics": {"preset": "accurate", "refinement": refinement, "elements": kind}})
