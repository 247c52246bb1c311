"""`repro check`: the mesh of the run, numbers computed by hand, and warnings exactly where a simplification fails."""

import itertools
import json
import math
import re
import signal
import time
from dataclasses import replace

import numpy as np
import pytest

from reference import half_cylinder
from repro.cli import main
from repro.errors import GrowthError, SimulationError
from repro.march import simulation
from repro.march.simulation import simulate
from repro.model.meshing import seeded
from repro.preflight import checked, cost, modelled, numbers, outlook, simplifications
from repro.preflight.checked import check
from repro.preflight.modelled import describe_model
from repro.preflight.numbers import Sizes
from repro.preflight.outlook import CoarseRun, sketched
from repro.results.tables import solve
from repro.scene import SceneError, load_scene, packaged_scenes, scene_tables
from repro.scene.units import units_of
from repro.schemes import CURVED
from tests.shell import refusal
from tests.strategies import coarse_base

pytestmark = pytest.mark.usefixtures("without_progress")

#: Mean velocity of the clean channel of base: (1e-3 cm / 600 um) g W^2 / (12 nu), um/h.
CLEAN = 1e-5 / 600e-6 * 9.81 * (50e-6) ** 2 / (12 * 1.003e-6) * 3600e6


def examine(name, *overrides, reach=None):
    """Return the numbers of a scene by name and the keys of its warnings, without solving anything."""
    scene = load_scene(name, overrides)
    speed = (scene.flow.mean_velocity or CLEAN) if scene.flow else None
    _, computed = numbers.evaluate_at_largest(scene, speed, later(scene))
    return {number.name: number for number in computed}, [warning.key for warning in warned(scene, reach)]


def later(scene, reach=None):
    """A size that the aggregate of a scene reaches: a plug after a day, before that a half-disc of 8 um."""
    if scene.growth is None:
        return None
    end, width = scene.growth.end, scene.pore.width
    if end >= 24:
        return Sizes(end, 3 * width**2, width, reach or 1.5 * width, True, 2 * (reach or 1.5 * width))
    return Sizes(end, 32 * np.pi, 8.0, 8.0, False, 16.0)


def warned(scene, reach=None):
    """The warnings at t = 0 and at a later size."""
    speed = (scene.flow.mean_velocity or CLEAN) if scene.flow else None
    return simplifications.find_warnings(scene, speed, later(scene, reach))


def test_the_numbers_of_base_are_those_of_table_1():
    """The expected numbers are computed by hand in SI units."""
    computed, _ = examine("base", "growth.end=24 h")
    R, W = 5e-6, 50e-6
    day, u = 86400.0, CLEAN / 3600e6
    D_A, D_D = 2.32e-4 / day, 1.01e-4 / day
    X, K = 30.0, 1e-3
    q_D = 9.3 / day
    q_A = q_D * 1.52 + 1.42 * 0.8 * 0.12 / day
    supplied = u * W * 10 * K
    by_hand = {
        "Reynolds": u * W / 1.003e-6,
        "Peclet, acceptor": u * W / D_A,
        "Peclet, donor": u * W / D_D,
        "cell Peclet": 1.5 * u * W / 14 / (0.81e-4 / day),
        "Thiele, acceptor": R * math.sqrt(q_A * X / (K * 1.85e-4 / day)),
        "Thiele, donor": R * math.sqrt(q_D * X / (K * 0.81e-4 / day)),
        "Damkoehler, acceptor": q_A * X * 10 / 11 * math.pi / 2 * R**2 / supplied,
        "Damkoehler, donor": q_D * X * 10 / 11 * math.pi / 2 * R**2 / supplied,
        "transport over growth time": W**2 / (0.81e-4 / day) * 10 / 11 * (q_D * 0.61 * 10 / 11 - 0.12 / day),
        "transit over growth time": 600e-6 / u * 10 / 11 * (q_D * 0.61 * 10 / 11 - 0.12 / day),
        "fluid stress over modulus": 6 * 998 * 1.003e-6 * u / W / 1e4,
    }
    assert set(computed) == set(by_hand)
    for name, value in by_hand.items():
        assert computed[name].start == pytest.approx(value, rel=1e-9), name
    assert computed["fluid stress over modulus"].end == pytest.approx(998 * 9.81 * 1e-5 / 1e4, rel=1e-12)


def test_half_a_pore_has_the_numbers_of_the_whole_one():
    """A pore with a plane of symmetry has the numbers of a pore of twice the width with the same seed. Only the
    Damkoehler number is twice as large, because the mirror image takes up as much."""
    scenes = [load_scene("base", ["flow.mean_velocity=3 m/day", f"pore.width={width} um", f"pore.upper_wall={wall}"],
                         unset=["flow.head"]) for width, wall in ((25, "symmetry"), (50, "no slip"))]
    half, whole = ({number.name: number for number in numbers.numbers(each, each.flow.mean_velocity)}
                   for each in scenes)
    assert half.keys() == whole.keys() and "Reynolds" in half
    for name, number in whole.items():
        share = 2 if name.startswith("Damkoehler") else 1
        if name != "cell Peclet":
            assert half[name].start == pytest.approx(share * number.start, rel=1e-12), name


QUIET = ("base", "numerics.preset=paper", "growth.end=5 h", "pore.length=2000 um")
QUIET_WIDE = ("wide", *QUIET[1:])
QUICK = (*QUIET, "kinetics.maximum_density=30 mg/L", "growth.time_step=1e-4 h", "growth.end=1e-3 h")
FASTER = "kinetics.maximum_utilization_rate=3400 1/day"
FORCED = (*QUIET, "growth.end=24 h")
FORCED_SLIDING = (*FORCED, "growth.fluid_forces=included")
PERMEABLE = ("flow_only", "numerics.preset=fast", "numerics.refinement=1", "aggregate.radius=20 um")
COARSE_PERMEABLE = (*PERMEABLE, "numerics.refinement=0.5")
FEW = ("substrates.acceptor.half_saturation=2e-3 mg/L", "substrates.donor.half_saturation=2e-3 mg/L")
FINE, FAST = "numerics.refinement=2", "numerics.preset=fast"


THRESHOLDS = [
    # u W / nu = 0.1 at 173 m/day in 50 um
    ("flow", ["flow_only"], "flow.mean_velocity=170 m/day", "flow.mean_velocity=176 m/day"),
    # 1.5 u (W / 14) / D = 2 at 15 m/day in 100 um, at twice that on elements half as large; never if quadratic
    ("numerics.refinement", QUIET_WIDE, "flow.mean_velocity=15 m/day", "flow.mean_velocity=15.5 m/day"),
    ("numerics.refinement", [*QUIET_WIDE, FINE], "flow.mean_velocity=30 m/day", "flow.mean_velocity=31 m/day"),
    ("numerics.refinement", [*QUIET_WIDE, "flow.mean_velocity=60 m/day"], FAST, ""),
    # (D K / (q X))^1/2 = 0.93 um for the acceptor and 0.76 um for the donor at K = 2e-3 mg/L; nodes at R / 10
    ("numerics.refinement", [*QUIET, FEW[0]], "", FEW[1]),
    ("numerics.refinement", [*QUIET, *FEW], FINE, "numerics.refinement=1"),
    # W^2 / D over the time of growth is 1.4e-4 in 50 um
    ("numerics.transport", QUICK, "kinetics.maximum_utilization_rate=3200 1/day", FASTER),
    ("numerics.transport", [*QUICK, FASTER], "numerics.transport=gear", ""),
    # L / u over the time of growth, 5.24 h, is 0.05 at 0.183 m/day in 2000 um, and less in a shorter pore
    ("flow", QUIET_WIDE, "flow.mean_velocity=0.185 m/day", "flow.mean_velocity=0.181 m/day"),
    ("flow", [*QUIET_WIDE, "flow.mean_velocity=0.181 m/day"], "pore.length=1950 um", ""),
    ("flow", [*QUIET_WIDE, "numerics.transport=gear"], "", "flow.mean_velocity=0.181 m/day"),
    # the head's pressure over mu_L is 0.01 at 0.0979 Pa / 9.79 Pa; the aggregate in contact bears all of it
    ("growth.fluid_forces", FORCED, "growth.shear_modulus=9.9 Pa", "growth.shear_modulus=9.6 Pa"),
    ("growth.fluid_forces", [*FORCED, "growth.shear_modulus=4 Pa"], "growth.fluid_forces=included", ""),
    # drag of 6.73 times the shear of 4.03e-3 Pa, and the head's pressure, over mu_L: 0.01 at 12.5 Pa
    ("growth.wall", FORCED_SLIDING, "growth.shear_modulus=12.7 Pa", "growth.shear_modulus=12.3 Pa"),
    ("growth.wall", [*FORCED_SLIDING, "growth.shear_modulus=4 Pa"], "growth.wall=bonded", ""),
    # a film of 1 um has five intervals; in a coarse mesh a film of 2 um has three
    ("aggregate.radius", ["flow_only"], "aggregate.radius=49.1 um", "aggregate.radius=49.3 um"),
    ("aggregate.radius", ["flow_only", "aggregate.radius=40 um"], "numerics.refinement=0.41",
     "numerics.refinement=0.39"),
    # in fast a film of 2 um has four intervals; boundary layers add none
    ("aggregate.radius", ["wide", FAST, "flow.mean_velocity=60 m/day"], "aggregate.radius=97.9 um",
     "aggregate.radius=98.1 um"),
    # the mesh of a seed of 40 um extends 75 um to either side
    ("pore.length", ["flow_only", "aggregate.radius=40 um"], "pore.length=231 um", "pore.length=229 um"),
    # the growth rate is 0.19 1/h
    ("growth.time_step", QUIET, "growth.time_step=0.5 h", "growth.time_step=0.55 h"),
    ("growth.time_step", [*QUIET, "growth.time_step=0.55 h"], FAST, ""),
    # elements of 4 um widen the layer to d = 2/3 um, and 3 (r - r^2 / d) / 30 um is 1 % at r = 0.12251 and 0.54415 um;
    # on elements half as large it is less everywhere
    ("flow.permeability", COARSE_PERMEABLE, "flow.permeability=1.495e-14 m^2", "flow.permeability=1.505e-14 m^2"),
    ("flow.permeability", COARSE_PERMEABLE, "flow.permeability=2.965e-13 m^2", "flow.permeability=2.955e-13 m^2"),
    ("flow.permeability", [*PERMEABLE, "flow.permeability=1e-13 m^2"], "", "numerics.refinement=0.5"),
    # a diffusivity of Table 1 changes, with or without its partner in the aggregate; F = COD - Y d_c
    ("substrates.donor.diffusivity_in_aggregate", [*QUIET, "substrates.donor.diffusivity=2 cm^2/day"],
     "substrates.donor.diffusivity_in_aggregate=80 %", ""),
    ("substrates.acceptor.diffusivity_in_aggregate", QUIET,
     "substrates.acceptor.diffusivity_in_aggregate=1 cm^2/day", "substrates.acceptor.diffusivity=3 cm^2/day"),
    ("kinetics.acceptor_to_donor_ratio", [*QUIET, "kinetics.yield_coefficient=0.5"],
     "kinetics.donor_oxygen_demand=2.38", ""),
    ("kinetics.acceptor_to_donor_ratio", [*QUIET, "kinetics.decay_oxygen_demand=1.2"],
     "kinetics.acceptor_to_donor_ratio=1.7", ""),
    # a strength that the water's forces do not count against
    *((f"growth.{strength}", [*QUIET, f"growth.{strength}=1 kPa"], "growth.fluid_forces=included", "")
      for strength in ("bonding_strength", "tensile_strength")),
]


@pytest.mark.parametrize("key, common, inside, outside", THRESHOLDS)
def test_warnings_are_exactly_where_a_simplification_fails(key, common, inside, outside):
    """Thresholds are computed by hand, and no other warning occurs. "" makes no change to ``common``."""
    inside_keys, outside_keys = (set(examine(*common, *filter(None, [change]))[1]) for change in (inside, outside))
    assert key not in inside_keys and outside_keys - inside_keys == {key}


#: Scenes in which every check warns at least once, beside the packaged ones.
WARNED = [*((name,) for name in packaged_scenes()), *((*common, *filter(None, [outside]))
          for _, common, _, outside in THRESHOLDS), ("base", "pore.width=200 um", "growth.end=90 h", FAST)]
#: {part of a scene: words about it in a warning, and the parts that go with it}.
ABSENT = {
    "aggregate": ("aggregate|seed|biomass", ["kinetics", "growth"]),
    "flow": ("flow|conductivity|inlet|outlet|Reynolds|Stokes|fluid|water takes|film", []),
    "substrates": ("substrate|supply|concentration|acceptor|donor|uptake", ["kinetics", "growth"]),
    "substrates.acceptor": (r"\bacceptor\b|\(7\)|oxygen|COD", []),
    "substrates.donor": (r"\bdonor\b|\(8\)", []),
    "growth": ("grow|run ends|update|contact", []),
}


def without(scene, part):
    """The scene without a part and what depends on it, or None if the scene has no such part alone."""
    section, _, kind = part.partition(".")
    parent = getattr(scene, section)
    if section == "aggregate":
        return replace(scene, aggregates=(), **dict.fromkeys(ABSENT[part][1])) if parent else None
    if parent is None or (kind and len(parent.modelled) == 1):
        return None
    changed = {section: replace(parent, **{kind: None}) if kind else None}
    return replace(scene, **changed, **dict.fromkeys(ABSENT[part][1]))


@pytest.mark.parametrize("name, changes", [(each[0], each[1:]) for each in WARNED])
def test_a_warning_speaks_of_no_part_that_the_scene_leaves_out(name, changes):
    """Its key is one of the scene, and its text has no word about an absent part. None, one or two parts are removed. A
    scene without flow and substrates, in which nothing is computed, has no warning."""
    for parts in itertools.chain.from_iterable(itertools.combinations(ABSENT, count) for count in range(3)):
        scene = load_scene(name, changes)
        for part in parts:
            scene = scene and without(scene, part)
        absent = [words for part, (words, _) in ABSENT.items() if scene and not simplifications._has(scene, part)]
        for warning in warned(scene) if scene else ():
            assert scene.flow or scene.substrates
            assert simplifications._has(scene, warning.key.rpartition(".")[0] or warning.key)
            assert not [words for words in absent if re.search(words, warning.text)], (parts, warning)


def test_the_drag_in_the_warning_is_that_on_a_small_half_cylinder():
    drag, _, _ = half_cylinder.solve(1e-3).load()
    assert simplifications.DRAG == pytest.approx(drag, rel=2e-3)  # the rest is of the order of R / W


@pytest.mark.parametrize("position", [-90.0, 90.0])
def test_an_offset_of_the_seed_adds_to_its_reach(position):
    middle, aside = (load_scene("base", [f"aggregate.position={x} um"]) for x in (0.0, position))
    assert numbers.at_start(aside).reach == pytest.approx(numbers.at_start(middle).reach + 90.0, rel=1e-12)
    assert numbers.at_start(aside).area == pytest.approx(numbers.at_start(middle).area, rel=1e-12)
    assert numbers.half_length(middle) == pytest.approx(5 + 10 * 5)


@pytest.mark.parametrize("changes, lengths, expected", [
    # updates every 0.2 h; the midpoint rule, whose steps are half as long with a quarter of the tolerance
    (["numerics.preset=paper"], [2.0] * 4, (40, 1.0)), ([FAST, "numerics.tolerance=0.0025"], [2.0] * 4, (8, 1.0)),
    # no step is shorter than a thousandth of 0.2 h
    ([FAST, "numerics.tolerance=1e-300"], [4.0, 4.0], (40000, 1.0)),
    # the half that was not reached counts like the second half of the rest, in which steps cost three times as much
    ([FAST, "numerics.tolerance=0.01"], [1.0, 1.0, (1.0, 3.0), (1.0, 3.0)], (8, 20 / 8))])
def test_steps_are_expected_from_those_of_the_coarse_run(changes, lengths, expected):
    scene = load_scene("base", ["growth.end=8 h", *changes])
    look = CoarseRun(scene)
    look.steps = [length if isinstance(length, tuple) else (length, 1.0) for length in lengths]
    assert cost.expect_steps(scene, look) == pytest.approx(expected, rel=1e-12)
    look.ends = True
    assert cost.expect_steps(scene, look)[0] == pytest.approx(expected[0] * sum(each for each, _ in look.steps) / 8)


@pytest.mark.parametrize("preset, transport, steps", [
    ("paper", "quasi_steady", "midpoint"), ("accurate", "quasi_steady", "midpoint"), ("paper", "gear", "updates")])
def test_the_coarse_run_keeps_the_physics_of_the_scene(preset, transport, steps):
    """It has the numbers of the preset sketch and the curved scheme, which makes updates with Gear's scheme."""
    changes = [f"numerics.transport={transport}", "numerics.interface=traction", "numerics.extent=full"]
    scene = load_scene("base", [f"numerics.preset={preset}", *changes])
    expected = load_scene("base", ["numerics.preset=sketch", *changes[1:]]).numerics
    coarse = sketched(scene)
    assert coarse.numerics.scheme == replace(CURVED, steps=steps)
    assert replace(coarse.numerics, exchanged=None, transport="quasi_steady") == expected
    assert replace(coarse, numerics=scene.numerics, output=scene.output) == scene


def test_the_outlook_has_the_time_of_contact():
    """It is that of the preset fast, to a per cent. The mesh and all steps belong to the coarse run."""
    scene = load_scene("wide", ["aggregate.radius=17.5 um", "pore.width=20 um", "growth.end=1 h", FAST])
    expected = next(state.pore.time for state, _ in simulation.steps(scene) if state.pore.contact)
    times, look = [], CoarseRun(scene)
    outlook = look.run(times.append, 300.0)
    assert outlook.stopped == "" and outlook.time == times[-1] == 1 and times[0] == 0
    assert outlook.contact == pytest.approx(expected, rel=0.01) and expected < 0.9
    assert look.pore.contact and look.node_growth >= 1 and sum(length for length, _ in look.steps) == pytest.approx(1)


def test_a_look_ends_within_a_step():
    outlook = CoarseRun(load_scene("base")).run(lambda _: pytest.fail("it does not end"), 0.0)
    assert (outlook.time, outlook.stopped, outlook.contact) == (0.0, "its 0 s are over", None)


def test_the_outlook_says_how_a_run_ends():
    near = load_scene("base", ["aggregate.position=285 um", FAST])
    assert re.match("the run ends there: the aggregate reaches the pore's downstream end at t = ",
                    CoarseRun(near).run(lambda _: None, 300.0).stopped)
    assert check(near, run=False).outlook is None


def test_a_coarse_run_that_fails_is_no_refusal(monkeypatch, capsys):
    def fail(scene):
        yield from itertools.islice(simulation.steps(scene), 2)
        raise SimulationError("no more") from GrowthError("no rest")

    monkeypatch.setattr(outlook, "steps", fail)
    assert main(["check", "base", "--set", FAST]) == 0
    assert re.search(r"Outlook of a coarse run .*: to t = [\d.]+ h: it fails there: no rest\n", capsys.readouterr().out)


def test_a_trial_takes_few_steps_however_short_they_are(monkeypatch):
    """A tolerance that requires thousands of steps does not slow `repro check` down."""
    yielded, steps = [], cost.iterate_steps
    monkeypatch.setattr(cost, "iterate_steps", lambda scene: (yielded.append(one) or one for one in steps(scene)))
    trial = cost.run_trial(load_scene("base", ["numerics.preset=fast", "numerics.tolerance=1e-7"]), 458)
    assert len(yielded) == 1 + cost.MOST_STEPS and 0 < trial.step < np.inf


@pytest.mark.thorough
@pytest.mark.parametrize("name, preset", [("base", "fast"), ("base", "accurate"), ("base", "paper"), ("wide", "paper")])
def test_the_estimate_is_right_within_a_factor_of_three(name, preset):
    """The best of three estimates counts, because other work disturbs the machine. The run follows right after them."""
    scene = load_scene(name, [f"numerics.preset={preset}"])
    estimates = [check(scene).cost.seconds for _ in range(3)]
    start = time.perf_counter()
    for _ in simulate(scene):
        pass
    ratio = np.array(estimates) / (time.perf_counter() - start)
    assert np.abs(np.log(ratio)).min() < math.log(3), ratio


def test_the_modelled_physics_follow_the_sections():
    """The text has the numbers of the scene in its own units."""
    changes = ["pore.width=44 um", "aggregate.radius=7 um", "aggregate.position=-40 um", "aggregate.inert_fraction=0.3",
               "growth.time_step=0.35 h"]
    words = dict(describe_model(load_scene("base", changes)))
    assert "(1)-(6)" in words["flow"] and "head of 0.001 cm" in words["flow"] and "(14)-(29)" in words["growth"]
    assert words["pore"].startswith("a channel 44 um wide and 600 um long")
    assert "radius 7 um on the lower wall at x = -40 um; 30 % of it inert at t = 0" in words["aggregate"]
    assert "a shape update every 21 min" in words["numerics"]
    bare = dict(describe_model(load_scene("initial_mesh", ["substrates={}", "growth.end=1 h", "numerics.extent=full"])))
    assert bare["flow"] == "no flow: pure diffusion" and "supply prescribed at both ends" in bare["substrates"]
    assert "as a whole" in bare["pore"] and "(9)-(10)" in bare["kinetics"]
    outline = 'aggregate={outline=[["-5 um", "0 um"], ["1 um", "9 um"], ["6 um", "0 um"]], smooth=true}'
    transient = load_scene("base", ["numerics.transport=gear", "growth.new_biomass=stress_free", outline])
    gear = dict(describe_model(transient))
    assert "Gear" in gear["substrates"] and "without stress" in gear["growth"]
    assert gear["aggregate"].startswith("biomass inside a spline through 3 points")


def test_check_describes_what_leaves_and_when_a_run_ends_early():
    """Nothing of it is said of a scene without it."""
    leaving = ["growth.bonding_strength=1e-3 MPa", "growth.after_detachment=continue", "growth.until=steady"]
    pair = [FAST, 'aggregate=[{radius="5 um"}, {radius="5 um", wall="upper"}]']
    assert "; aggregates that meet join if this encloses no water, and the run goes on; strain" in dict(describe_model(
        load_scene("base", pair)))["growth"]
    assert 'aggregates that meet end the run, because growth.meeting is "end"' in dict(describe_model(
        load_scene("base", [*pair, "growth.meeting=end"])))["growth"]
    words = dict(describe_model(load_scene("base", leaving)))["growth"]
    assert "; an aggregate that detaches leaves the pore, and the run goes on; it ends early if the aggregates are " \
        "steady; strain" in words and "erode" not in words
    eroding = [FAST, "growth.new_biomass=stress_free", 'growth.erosion.speed="0.1 um/h"']
    assert "free surfaces erode, by the law constant; new" in describe_model(load_scene("base", eroding))[5][1]
    plain = dict(describe_model(load_scene("base")))["growth"]
    assert not any(word in plain for word in ("leaves", "early", "erode", "join"))


def test_check_describes_values_over_time():
    """The text keeps the order of the substrates and has the range of values and the last time."""
    steps = [["0 h", "3 mg/L"], ["1 h", "9 mg/L"], ["4 h", "5 mg/L"]]
    words = dict(describe_model(load_scene("wide", [f"substrates.donor.supply={json.dumps(steps)}", FAST])))
    assert "acceptor (10 mg/L) and donor (3 to 9 mg/L, in steps, the last from 4 h)" in words["substrates"]
    assert "mean velocity of 2.9 m/day" in words["flow"] and words["output"].endswith(", and every 1.6 h")
    assert words["growth"].startswith("to 45 h: ") and "tolerance 0.0075" in words["numerics"]
    head = 'flow.head={table=[["0 h", "1 cm"], ["2 h", "4 cm"]], between="linear"}'
    words = dict(describe_model(load_scene("base", [head])))
    assert "a head of 1 to 4 cm, linear in time, the last from 2 h over" in words["flow"]


@pytest.mark.parametrize("key, name, changes, excerpt", [
    ("pore.length", "wide", [], "ends at t = 45 h (reach 160 of 300 um)"),
    ("pore.length", "flow_only", ["aggregate.radius=40 um", "pore.length=200 um"], "from the start (reach 40 of 100"),
    ("numerics.refinement", "base", FEW[1:], "= 0.76 um, thinner than"),
    ("growth.time_step", "base", ["growth.time_step=0.6 h"], "grows by 11 % in a shape update, above 10 %"),
    *(("numerics.refinement", "wide", [f"substrates.donor.half_saturation={half} mg/L", "numerics.refinement=0.1",
                                       "kinetics.maximum_density=3e6 mg/L"], f"donor is used up in a {layer} ")
      for half, layer in ((0.02, "zero-order front"), (20, "layer of first-order uptake"))),
    ("substrates.donor.diffusivity_in_aggregate", "base", ["substrates.donor.diffusivity=2 cm^2/day"], "40.5 % of")])
def test_a_warning_states_its_numbers(key, name, changes, excerpt):
    """A thin layer is of zero order if the supply exceeds the half saturation."""
    warnings = warned(load_scene(name, changes), 160.0)
    assert [warning.key for warning in warnings if excerpt in warning.text] == [key]


@pytest.mark.parametrize("seconds, duration", [(0.123, "0.12 s"), (45.3, "45 s"), (119.0, "119 s"), (130.0, "2 min"),
                                           (7100.0, "118 min"), (7300.0, "2 h"), (9000.0, "2 h"), (90000.0, "25 h")])
def test_the_duration_of_a_run_has_a_suitable_unit(seconds, duration):
    first, *_ = checked._cost(cost.Cost(7, seconds, 256.0))
    assert first == f"Cost, roughly: {duration} (7 steps) without writing files; 256 MB in addition to the program"


def test_check_prints_a_report_and_exits_with_zero(capsys):
    """Warnings leave the status at 0. In 1 h the area grows by exp(0.19) and the radius by the root of that."""
    assert main(["check", "wide", "--set", "growth.end=1 h", "--set", "growth.time_step=0.6 h"]) == 0
    output = capsys.readouterr()
    assert output.err == "" and "wide: can be run" in output.out and "WARNING growth.time_step: " in output.out
    assert re.search(r"Thiele, donor +0\.29 +0\.32\n  Damkoehler, acceptor +0\.0053 +0\.0064\n", output.out)
    mesh = seeded(load_scene("wide")).mesh
    assert f"Mesh at t = 0: {len(mesh.points)} nodes, {len(mesh.cells)} triangles" in output.out
    assert all(len(line) <= 120 for line in output.out.splitlines())


def test_check_prints_json(capsys):
    assert main(["check", "flow_only", "--json"]) == 0
    text = capsys.readouterr().out
    report = json.loads(text)
    assert text == json.dumps(report, indent=2) + "\n"
    assert set(report) == {"scene", "modelled", "nodes", "triangles", "numbers", "warnings", "cost",
                         "estimated", "outlook"}
    assert report["nodes"] == 783 and report["cost"]["steps"] == 0 and report["warnings"] == []
    assert report["numbers"][0]["name"] == "Reynolds" and "growth" in report["modelled"]


@pytest.mark.parametrize("override, excerpt", [
    ("pore.widht=5 um", "did you mean width?"),
    ("flow.head=1e-300 um", "base: it cannot be run: stopped in the step from t = 0 h, in transport"),
])
def test_a_scene_that_cannot_run_is_refused(tmp_path, override, excerpt, capsys):
    assert excerpt in refusal(tmp_path, capsys, "check", "base", "--set", override)


def test_the_pressure_of_a_plug_drops_over_its_whole_length():
    scene = load_scene("wide", ['flow.mean_velocity="2.9 m/day"'])
    drop = 12 * 2000 * 998 * 1.003e-6 * 2.9 / 86400 / 100e-6**2 * 2 * 150e-6 / 1e4
    assert numbers.stresses(scene, scene.flow.mean_velocity, later(scene))[1] == pytest.approx(drop, rel=1e-12)


@pytest.mark.parametrize("times", ['["5 h", "18 h"]', '["0 h", "5 h", "18 h"]'])
def test_requested_rows_are_counted_with_that_at_zero(times):
    """The permeability is reported in the units of the scene."""
    scene, _ = coarse_base(2, f"output.times={times}", 'flow.permeability="2.5e-15 m^2"')
    description = dict(modelled.describe_model(scene))
    assert "rows and fields at 3 times" in description["output"]
    assert "an aggregate with a permeability of 2.5e-15 m2" in description["flow"]


BASE = load_scene("base", ["numerics.preset=fast"])
#: The unit of every key of base that has one.
UNITS = units_of(scene_tables(BASE))


@pytest.mark.parametrize("change", [
    "flow.head=1e160 cm", "flow.gravity=1e30 m/s^2", "flow.kinematic_viscosity=1e-300 cm^2/s",
    *(f"substrates.{name}.{key}=1e-30 cm^2/s" for name in ("acceptor", "donor")
      for key in ("diffusivity", "diffusivity_in_aggregate"))])
def test_extreme_peclet_numbers_are_refused_by_their_keys(change):
    """No mesh that sparse matrices can index resolves the layers; a run in memory is refused as well."""
    key = re.match(r"[a-z_.]+?(?=_in_aggregate|=)", change)[0]
    for function, error in ((check, SceneError), (solve, SimulationError)):
        with pytest.raises((error, ValueError)) as refused:
            function(BASE, [change])
        assert isinstance(refused.value, error)
        refused.match(f"boundary layers: the Peclet number u W / D is .*{re.escape(key)}")


def test_a_peclet_number_that_memory_limits_is_refused_by_its_keys():
    with pytest.raises(SceneError, match="MB of memory are needed .* boundary layers fits: .* flow.mean_velocity"):
        check("base", ["numerics.preset=fast", "flow.mean_velocity=1e12 m/day"], unset=["flow.head"])


@pytest.mark.thorough
@pytest.mark.parametrize("value", ["1e-300", "1e-30", "1e30", "1e160"])
@pytest.mark.parametrize("key", UNITS)
@pytest.mark.parametrize("preset", ["paper", "fast"])
def test_extreme_values_are_checked_or_refused_in_one_line(capsys, preset, key, value):
    """A check that does not end within 60 s of processor time fails."""
    signal.signal(signal.SIGPROF, lambda *arguments: pytest.fail("the check does not end"))
    signal.setitimer(signal.ITIMER_PROF, 60.0)
    try:
        status = main(["check", "--json", "base", "--set", f"numerics.preset={preset}",
                       "--set", f"{key}={value} {UNITS[key]}"])
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    printed = capsys.readouterr()
    assert (status == 0 and json.loads(printed.out)) or (status == 2 and printed.err.count("\n") == 1)
