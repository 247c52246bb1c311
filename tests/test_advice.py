"""Advice: it is given once, the value that it names is accepted, and it helps; or it says that no setting does."""
import math
import random
import re

import numpy as np
import pytest
import scipy.sparse as sp

from repro.errors import Advised, LinearError, SimulationError, Unresolved
from repro.fem.linear import factorised
from repro.march.simulation import simulate
from repro.model import pore, remeshing
from repro.preflight import numbers, simplifications
from repro.scene import load_scene, parse_scene

#: Settings that a warning names, by the pattern of its text.
ADVICE = {
    r"numerics\.refinement = ([\d.e+]+) would resolve it": "numerics.refinement={}",
    r'"gear" with numerics\.time = "updates" follows': ("numerics.time=updates", "numerics.transport=gear"),
    r'"included" takes it in$': "growth.fluid_forces=included",
    r'"included" with growth\.new_biomass = "stressed"': (
        "growth.new_biomass=stressed", "growth.fluid_forces=included"),
    r'or take numerics\.time = "midpoint"': "numerics.time=midpoint",
    r'"80 %" keeps their ratio': "substrates.{key}=80 %",
}
NO_SETTING = ("no refinement up to 20", "no setting takes it in")


def drawn(seed):
    """What a user may change of base, by orders of magnitude."""
    draw = random.Random(seed)

    def between(least, most):
        return math.exp(draw.uniform(math.log(least), math.log(most)))

    width = between(10, 5e5)
    changes = [f"pore.width={width} um", f"pore.length={6 * width} um", f"aggregate.radius={0.1 * width} um",
               f"flow.mean_velocity={between(1e-3, 1e3)} m/day",
               f"numerics.preset={draw.choice(['fast', 'accurate', 'paper'])}",
               f"substrates.acceptor.half_saturation={between(1e-4, 10)} mg/L",
               f"growth.end={between(0.5, 100)} h", f"growth.time_step={between(0.05, 0.5)} h",
               f"growth.shear_modulus={between(1e-6, 1e-2)} MPa"]
    if draw.random() < 0.3:
        changes.append(f"substrates.donor.diffusivity={between(0.1, 3)} cm^2/day")
    if draw.random() < 0.3 and "numerics.preset=paper" not in changes:
        changes += ["flow.biomass=brinkman", f"flow.permeability={between(1e-11, 1e-7) * width**2} um^2"]
    elif draw.random() < 0.3:
        changes.append("growth.new_biomass=stress_free")
    return changes


def warnings(changes):
    scene = load_scene("base", changes, ["flow.head"])
    return simplifications.warnings(*numbers.judged(scene, pore.fastest(scene)))


def setting(warned):
    """The overrides that a warning advises, none where it advises nothing."""
    for pattern, advised in ADVICE.items():
        if match := re.search(pattern, warned.text):
            entries = (advised,) if isinstance(advised, str) else advised
            key = warned.key.removeprefix("substrates.")
            return [entry.format(*match.groups(), key=key) for entry in entries]
    return []


def test_the_advice_of_check_is_accepted_and_helps():
    """200 scenes: what a warning advises silences it; each kind of advice is met, and so is its absence."""
    met = set()
    for seed in range(200):
        changes = drawn(seed)
        for warned in warnings(changes):
            more = setting(warned)
            if not more:
                met |= {text for text in NO_SETTING if text in warned.text}
                continue
            met.add(more[-1].partition("=")[0])
            start = warned.text[:40]
            assert not any(again.key == warned.key and again.text.startswith(start)
                           for again in warnings([*changes, *more])), (seed, warned)
    assert met >= {*NO_SETTING, "numerics.refinement", "numerics.transport", "growth.fluid_forces"}


@pytest.mark.parametrize("radius, start", [(20, "t = 0 h"), (12, r"t = 2\.\d+ h")])
def test_an_unresolved_front_is_advised_of_once(radius, start):
    """Within a step too, whose end is tried first on the mesh of its start."""
    substrate = {"supply": "0.28 mg/L", "half_saturation": "3e-5 mg/L"}
    scene = parse_scene({
        "pore": {"width": "100 um", "length": "600 um"}, "aggregate": {"radius": f"{radius} um"},
        "flow": {"mean_velocity": "2.9 m/day"}, "substrates": {"acceptor": substrate, "donor": substrate},
        "kinetics": {}, "growth": {"end": "3 h"}}, "front", "front.toml")
    with pytest.raises(SimulationError, match=f"from {start}, in transport: .*resolves this state") as stopped:
        list(simulate(scene))
    assert str(stopped.value).count("numerics.refinement") == 1


@pytest.mark.parametrize("refinement, said", [
    (0.2, "; numerics.refinement up to 0.6 does not resolve it"),
    (10, "; numerics.refinement up to 20 does not resolve it"),
    (15, "; no numerics.refinement that is accepted (up to 20) is much larger")])
def test_no_refinement_is_named_that_is_not_accepted_or_not_tried(refinement, said, monkeypatch):
    """Nor is one named for an error that carries advice already."""
    def refuses(*_):
        raise Unresolved("too coarse")

    scene = load_scene("base", ["numerics.preset=paper", f"numerics.refinement={refinement}"])
    monkeypatch.setattr(pore, "seeded", refuses)
    at_start = type("AtStart", (), {"time": 0.0, "front": 1.0})()
    advised = remeshing.advised(scene, at_start, Unresolved("too coarse"))
    assert isinstance(advised, Advised) and str(advised) == f"too coarse{said}"
    assert remeshing.advised(scene, at_start, advised) is advised


def test_a_singular_system_gives_no_advice_of_its_own():
    """Growth adds what to try to it, and what was here too was then there twice."""
    with pytest.raises(LinearError, match="is singular$"):
        factorised(sp.csc_matrix(np.ones((3, 3)))).solve(np.arange(3.0))
