"""`repro check --error`: the finer run, the largest differences, the limit of time, and what is refused."""

import json

import numpy as np
import pytest

import repro
from repro.cli import main
from repro.errors import StageError
from repro.model.meshing import MOST_REFINED
from repro.preflight import refined
from repro.preflight.refined import Difference, refine
from repro.scene import FINER, PRESETS, SceneError, load_scene
from tests.shell import refusal

pytestmark = pytest.mark.usefixtures("without_progress")

SHORT = {"growth.end": "0.2 h", "output.times": ["0 h", "0.05 h", "0.2 h"], "numerics.preset": "sketch"}


def numbers(scene):
    return {key: getattr(scene.numerics, key) for key in ("refinement", "tolerance", "contact_elements")}


@pytest.mark.exact_lengths
@pytest.mark.parametrize("preset", PRESETS)
def test_the_finer_run_has_the_next_preset_or_smaller_elements_and_steps(preset):
    scene = load_scene("base", {"numerics.preset": preset})
    finer = refine(scene)
    if preset in FINER:  # the layers of base have elements of 0.18 in sketch
        least = {"sketch": 0.27426723}.get(preset, PRESETS[FINER[preset]]["refinement"])
        assert numbers(finer) == pytest.approx(PRESETS[FINER[preset]] | {"refinement": least})
        assert finer.numerics.preset == FINER[preset] and finer.growth == scene.growth
        return
    assert finer.numerics.preset == preset and finer.numerics.scheme == scene.numerics.scheme
    assert finer.numerics.refinement == pytest.approx(1.5 * scene.numerics.refinement)
    if scene.numerics.scheme.controls_error:
        assert finer.numerics.tolerance == pytest.approx(scene.numerics.tolerance / 2.25)
    else:
        assert finer.growth.time_step == pytest.approx(scene.growth.time_step / 2.25)


def test_a_key_that_is_as_fine_as_the_next_preset_is_refined_too():
    own = load_scene("base", {"numerics.preset": "fast", "numerics.refinement": 0.5, "numerics.tolerance": 0.0005})
    assert numbers(refine(own)) == {"refinement": 0.75, "tolerance": pytest.approx(0.0005 / 2.25),
                                    "contact_elements": PRESETS["accurate"]["contact_elements"]}
    assert refine(load_scene("base", {"numerics.refinement": 19})).numerics.refinement == MOST_REFINED


@pytest.mark.parametrize("preset", ["sketch", "fast", "accurate", "exact"])
def test_elements_that_boundary_layers_make_small_are_refined_too(preset):
    """At u W / D = 100 m/day 50 um / 0.81 cm2/day = 61.7 the layers need a refinement of 0.15 Pe^(1/3) = 0.593."""
    scene = load_scene("base", {"flow.mean_velocity": "100 m/day", "numerics.preset": preset}, unset=["flow.head"])
    own = max(scene.numerics.refinement, 0.15 * (1e8 * 50 / 0.81e8)**(1 / 3))
    assert refine(scene).numerics.refinement == pytest.approx(1.5 * own)
    assert f"({preset} (refinement {own:.3g}, " in f"({refined._describe(scene)}"


def test_the_differences_are_those_of_two_runs():
    """Each column has the time and the values of the row that differs most."""
    compared = repro.error("base", SHORT)
    elements = refine(load_scene("base", SHORT)).numerics.refinement
    own, finer = (repro.solve("base", SHORT | changes) for changes in (
        {}, {"numerics.preset": "fast", "numerics.refinement": elements}))
    assert (compared.time, compared.rows, compared.stopped) == (0.2, 3, "") and 0 < compared.seconds < compared.limit
    differences = {each.column: each for each in compared.differences}
    assert differences.keys() < set(own) and "donor_balance" not in differences and "contact" not in differences
    for name in ("conductivity_m_per_d", "aggregate_area_um2", "surface_stretch_min", "thickness_um"):
        changes = np.abs(own[name] - finer[name]) / finer[name]
        worst = differences[name]
        row = list(own.time).index(worst.time)
        assert (worst.own, worst.finer, worst.unit) == (own[name][row], finer[name][row], "%")
        assert worst.difference == pytest.approx(100 * changes.max(), rel=1e-6)
    changes = np.abs(own["upstream_um"] - finer["upstream_um"])
    assert differences["upstream_um"].difference == changes.max() and differences["upstream_um"].unit == "um"
    worst = differences["conductivity_m_per_d"]
    assert f"hydraulic conductivity of the pore changes by at most {worst.difference:.2g} %" in compared.sentence
    assert compared.sentence in " ".join(str(compared).split()) and "From t = 0 to 0.2 h" in compared.sentence
    assert "from sketch (refinement 0.183, tolerance 0.01) to fast (refinement 0.274, tolerance 0.0075)" in str(
        compared.sentence)


@pytest.mark.parametrize("name, own, finer, expected", [
    ("thickness_um", [1, 2, 3], [1, 2.5, 4], (25, "%", 2, 3, 4)),
    ("head_loss_cm", [0, 1, 9], [0, 2, 10], (50, "%", 1, 1, 2)),
    ("head_loss_cm", [0, 1, 0], [2, 1, 4], (100, "%", 0, 0, 2)),
    ("head_loss_cm", [1, 1, 4], [0, 4, 4], (75, "%", 1, 1, 4)),
    ("head_loss_cm", [0, 0, 0], [0, 0, 0], (0, "%", 0, 0, 0)),
    ("effluent_donor_mg_per_L", [0, 1, 9], [0, 2, 10], (10, "%", 1, 1, 2)),
    ("fluid_moment_nN", [-10, 0.2, 0], [-8, 0.1, 0], (20, "%", 0, -10, -8)),
    ("upstream_um", [-5, 0, 1], [-5, 0.5, 1], (0.5, "um", 1, 0, 0.5))])
def test_a_difference_has_its_scale(name, own, finer, expected):
    """It is relative to the finer value, where a column may be negative or is zero to the largest one, and that of a
    coordinate is a length."""
    difference, unit, time, *values = expected
    computed = refined._largest(name, np.arange(3.0), *np.array([own, finer], float))
    assert computed == Difference(name, pytest.approx(difference), unit, time, *values)


LONG = SHORT | {"growth.end": "19 h", "output.times": ["0 h", "0.05 h", "19 h"]}


def watch_steps(monkeypatch, after=lambda preset, time: None):
    """The time that the run of each preset has reached; after: called after each step."""
    original, reached = refined.steps, {"sketch": 0.0, "fast": 0.0}

    def steps(scene):
        for state, row in original(scene):
            reached[scene.numerics.preset] = state.pore.time
            yield state, row
            after(scene.numerics.preset, state.pore.time)

    monkeypatch.setattr(refined, "steps", steps)
    return reached


def test_runs_are_compared_as_far_as_the_time_allows(monkeypatch):
    """Both runs advance side by side: neither makes a step that is not compared."""
    reached = watch_steps(monkeypatch)
    monkeypatch.setattr(refined, "process_time", lambda: 151 * (min(reached.values()) > 0.05))
    compared = repro.error("base", LONG, limit=150)
    assert (compared.time, compared.rows, compared.stopped) == (0.05, 2, "the 150 s are over")
    assert "to t = 0.05 h: the 150 s are over" in " ".join(str(compared).split())
    assert "From t = 0 to 0.05 h" in compared.sentence and max(reached.values()) < 19
    monkeypatch.setattr(refined, "process_time", iter(range(99)).__next__)
    with pytest.raises(SceneError, match="base: no row to compare: the 1 s are over"):
        repro.error("base", SHORT, limit=1)


@pytest.mark.parametrize("stopping, error, reason", [
    ("sketch", repro.PoreEnd("the aggregate reaches the end"), "the own run ends: the aggregate reaches the end"),
    ("fast", repro.SimulationError("x"), "the finer run fails: x"), ("fast", StageError("y"), "the finer run fails: y"),
    ("sketch", ZeroDivisionError("z"), "the own run fails: z")])
def test_a_run_that_stops_early_says_why(monkeypatch, stopping, error, reason):
    """The other run goes no farther than it must."""
    def stop(preset, time):
        if preset == stopping and time > 0.05:
            raise error

    reached = watch_steps(monkeypatch, stop)
    compared = repro.error("base", LONG)
    assert (compared.time, compared.rows, compared.stopped) == (0.05, 2, reason)
    assert max(reached.values()) < 19


def test_the_command_prints_the_comparison(capsys):
    words = ["check", "--error", "flow_only", "--json", "--limit", "100"]
    assert main(words) == 0
    printed = json.loads(capsys.readouterr().out)
    expected = repro.error("flow_only", limit=100).tables()
    assert {**printed, "seconds": 0} == {**expected, "seconds": 0} and printed["differences"]
    assert printed["sentence"].startswith("At t = 0, the hydraulic conductivity of the pore changes by at most 0.")
    assert main(["check", "--error", "initial_mesh"]) == 0
    assert "the area of the aggregate changes by at most" in " ".join(capsys.readouterr().out.split())


def test_wrong_options_are_refused(tmp_path, capsys):
    with pytest.raises(SceneError, match="^limit 0: a number of seconds"):
        repro.error("base", limit=0)
    assert "--limit 0: a number of seconds" in refusal(tmp_path, capsys, "check", "--error", "base", "--limit", "0")
    for words in (["--error", "base", "--no-run"], ["--error", str(tmp_path)]):
        with pytest.raises(SystemExit) as ended:
            main(["check", *words])
        assert ended.value.code == 2 and "--error" in capsys.readouterr().err
