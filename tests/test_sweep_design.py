"""The points of a sweep: ranges, lists, grids, Latin hypercubes and refusals."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from repro.scene import SceneError, scene_tables
from repro.sweeps.design import MOST_POINTS, Factor, grid, latin, levels, parse, points

RANGES = st.tuples(st.floats(1e-6, 1e6), st.floats(1.001, 1e6)).map(lambda pair: (pair[0], pair[0] * pair[1]))
SPACINGS = st.sampled_from(["linear", "log"])


@pytest.mark.parametrize("text, factor", [
    ("flow.mean_velocity=0.3:30 m/day:log:8", Factor("flow.mean_velocity", "m/day", (0.3, 30.0), "log", 8)),
    (" pore.width = 1e3 : 2e3 : linear", Factor("pore.width", "", (1e3, 2e3), "linear")),
    ("pore.width=50 um, 6e1um", Factor("pore.width", "um", (50.0, 60.0))),
    ('numerics.preset="fast", paper', Factor("numerics.preset", "", ("fast", "paper")))])
def test_a_range_has_its_unit_spacing_and_count(text, factor):
    """A list has numbers in one unit, or words."""
    assert parse(text) == factor


@pytest.mark.parametrize("text", [
    "pore.width", "=5 um", "pore.width=", "pore.width=50 um,", "pore.width=50 um, 60 mm", "pore.width=50 um, wide",
    "pore.width=1:2 um", "pore.width=1:2 um:cubic:3", "pore.width=1 um:2 um:log:3", "pore.width=1:1 um:linear:3",
    "pore.width=0:2 um:log:3", "pore.width=1:2 um:log:1", "pore.width=1:2 um:log:3:4", "pore.width=1:1e999 um:log:3",
    "pore.width=1e999 um, 2 um", "pore.width=a:b um:log:3",
    "pore.width=1:2 um:log:\N{ARABIC-INDIC DIGIT THREE}",
])
def test_a_text_that_is_no_range_or_list_is_refused_in_one_line(text):
    with pytest.raises(SceneError) as refused:
        parse(text)
    message = str(refused.value)
    assert message.startswith("vary ") and "needed" in message and "\n" not in message and text[:10] in message


@given(RANGES, SPACINGS, st.integers(2, 50))
def test_levels_are_evenly_spaced_between_the_ends(ends, spacing, count):
    """Levels are rounded to 12 digits."""
    computed = levels(Factor("pore.width", "um", ends, spacing, count))
    assert len(computed) == count and (computed[0], computed[-1]) == ends
    even = np.geomspace if spacing == "log" else np.linspace
    assert computed == pytest.approx(even(*ends, count), rel=1e-11, abs=1e-11 * (ends[1] if spacing == "linear" else 0))


@given(st.lists(st.tuples(RANGES, SPACINGS), min_size=1, max_size=4), st.integers(1, 60), st.integers(0, 2**32))
def test_each_stratum_of_each_range_has_one_value(ranges, samples, seed):
    factors = [Factor(f"key{k}", "um", ends, spacing) for k, (ends, spacing) in enumerate(ranges)]
    for factor, drawn in zip(factors, zip(*latin(factors, samples, seed))):
        low, high = factor.values
        parts = [math.log(v / low) / math.log(high / low) if factor.spacing == "log" else (v - low) / (high - low)
                 for v in drawn]
        assert all(low <= v <= high for v in drawn)
        # A value within round-off of a border may belong to either stratum, and is not counted.
        certain = sorted(int(samples * part) for part in parts
                         if int(samples * part - 1e-6) == int(samples * part + 1e-6))
        assert len(set(certain)) == len(certain)
        if len(certain) == samples:
            assert certain == list(range(samples))


@given(st.integers(1, 12), st.integers(1, 5), st.integers(0, 1000))
def test_a_list_is_drawn_evenly(words, times, seed):
    factor = Factor("numerics.preset", "", tuple(f"word{k}" for k in range(words)))
    drawn = [values[0] for values in latin([factor], words * times, seed)]
    assert {word: drawn.count(word) for word in factor.values} == dict.fromkeys(factor.values, times)


def test_a_design_follows_from_its_seed():
    factors = [parse("pore.width=40:60 um:linear"), parse("flow.mean_velocity=1:3 m/day:log")]
    assert latin(factors, 5, 1) == latin(factors, 5, 1) != latin(factors, 5, 2)


@pytest.mark.parametrize("build, part", [
    (lambda: latin([parse("pore.width=1:2 um:log:3")], 5, 0), "leave :3 out"),
    (lambda: latin([parse("pore.width=1:2 um:log")], 0, 0), "samples 0"),
    (lambda: latin([parse("pore.width=1:2 um:log")], MOST_POINTS + 1, 0), "samples 10001"),
    (lambda: grid([parse("pore.width=1:2 um:log")]), "pore.width: how many values is needed"),
    (lambda: grid([parse(f"pore.{key}=1:2 um:log:101") for key in ("width", "length")]), f"at most {MOST_POINTS} run")])
def test_an_impossible_hypercube_or_grid_is_refused(build, part):
    with pytest.raises(SceneError, match=part):
        build()


def test_a_column_has_its_unit():
    """Levels between the ends of a range have few digits."""
    columns = [parse(f"key={text}").column for text in ("1 m/day", "1 1/day", "1 cm^2/s", "1", "fast", "1 mg / L")]
    assert columns == ["key_m_per_d", "key_1_per_d", "key_cm2_per_s", "key", "key", "key_mg_per_L"]
    assert levels(parse("flow.mean_velocity=0.3:30 m/day:log:3")) == [0.3, 3.0, 30.0]


def make_points(*varied, sets=(), source="base"):
    factors = [parse(text) for text in varied]
    return points(source, list(sets), factors, grid(factors))


@pytest.mark.exact_lengths
def test_varying_one_of_the_pair_replaces_the_other_and_keeps_the_rest():
    """The scene base has a head."""
    (point,) = make_points("flow.mean_velocity=2 m/day", sets=["flow.viscosity_ratio=7"])
    keys = scene_tables(point.scene)["flow"]
    assert "head" not in keys and keys["viscosity_ratio"] == 7
    assert point.scene.flow.mean_velocity == pytest.approx(2e6 / 24, rel=1e-15)
    (point,) = make_points("flow.head=1 um", source="wide")
    assert point.scene.flow.mean_velocity is None and point.scene.flow.head == 1
    (point,) = make_points("flow.rate=3 uL/day", sets=["pore.depth=20 um"])
    assert (point.scene.flow.head, point.scene.flow.rate) == (None, pytest.approx(3e9 / 24))


@pytest.mark.parametrize("varied, sets, part", [
    (["pore.width=50 um, 4 um"], [], "run 2 .pore.width = 4 um.: base: aggregate.radius"),
    (["pore.widht=50 um"], [], "did you mean width"),
    (["pore.width=50 s"], [], 'run 1 .pore.width = 50 s.: base: pore.width = "50.0 s": a length is needed'),
    (["numerics.preset=fast, best"], [], "run 2 .*preset"),
    (["pore.width=50 um, 50.0 um"], [], "run 2 .*same scene as run 1"),
    (["pore.width=50 um", "pore.width=60 um"], [], "one vary"),
    *((["flow.head=1 um", f"flow.{drive}"], [], "exclude each other")
      for drive in ("mean_velocity=1 m/day", "rate=3 uL/day")),
    (["flow.head=1 um"], ['flow.head="2 um"'], "overrides of flow.head"),
    (["flow.head=1 um"], ['flow.mean_velocity="2 m/day"'], "overrides of flow.head or flow.mean_velocity"),
])
def test_an_impossible_run_is_refused_before_any_is_made(varied, sets, part):
    with pytest.raises(SceneError, match=part):
        make_points(*varied, sets=sets)
