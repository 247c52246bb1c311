"""Substrates around a half-disc as scenes have them, sharp fronts and fast water among them, against finer meshes."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache

from repro.errors import Unresolved
from repro.model import pore, remeshing
from repro.scene import load_scene, parse_scene
from verification.case import Check, Outcome, at_most, case

SCENE = load_scene("base")
SUPPLY = SCENE.substrates.acceptor.supply
NAMES = ("acceptor", "donor")
#: What the front is solved with: a scene's [numerics], and how far its effluents may be from those far away.
SOLVED = {"fast": ({"preset": "fast", "refinement": 0.25}, 1e-2),
          "accurate": ({"preset": "fast", "refinement": 0.45}, 1e-3),
          "linear": ({"preset": "paper"}, 1e-2)}
CUBIC = {"preset": "fast", "elements": "cubic", "refinement": 0.45}


@case("transport-proportion", kind="property", norm="consumed acceptor over F times consumed donor, less one",
      claim="Behind a front where the donor is used up, at half saturations of a hundredth of its supply, both are "
            "taken up in their proportion, with linear, quadratic and cubic elements",
      mutants=("unpaired",))
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
      mutants=("unpaired",))
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
        advised = re.search(r"numerics\.refinement = ([\d.]+) resolves it", str(refusal))
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
      mutants=("layers-ignored",))
def peclet() -> Outcome:
    checks = []
    for speed in ("2.9 m/day", "29 m/day", "290 m/day"):
        far = _carried(speed, FAR, "quadratic")
        for kind in ("quadratic", "cubic"):
            for name, ours, trusted in zip(NAMES, _carried(speed, 0.45, kind), far):
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
      mutants=("cubic-edge-nodes", "outlet-forgotten"))
def half_disc() -> Outcome:
    checks = []
    for name, ours, theirs in zip(NAMES, _around("cubic", 0.45), _around("quadratic", 0.9)):
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
