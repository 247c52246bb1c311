"""The manifest of `make figures`: hashes follow the data and nothing else, and a difference is told with its reason."""
import copy
import json
from importlib import import_module

import pytest
from matplotlib.figure import Figure

import paper_figures
from paper_figures import manifest, runs
from repro import load_scene, run
from repro.scene import scene_hash

NAME = "initial_mesh"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A run of 0.1 s."""
    made = tmp_path_factory.mktemp("runs") / NAME
    run(load_scene(NAME), made)
    return made


@pytest.fixture
def told(folder):
    """A manifest of that run and a made-up figure."""
    figure = {"title": "T", "runs": [NAME], "data": "f" * 64, "wall_time_s": 1.0, "pictures": {"f.pdf": 9}}
    computed = manifest.of_run(runs.INITIAL_MESH, folder)
    computed["last_row"]["acceptor_balance"] = 1e-15
    return {"environment": {"numpy": "1", "source": "a"}, "figures": {"figure_9": figure}, "runs": {NAME: computed}}


def test_a_run_again_has_the_same_hashes(folder, told, tmp_path):
    """Of every file with data."""
    run(load_scene(NAME), tmp_path / "again")
    found = manifest.of_run(runs.INITIAL_MESH, tmp_path / "again")["files"]
    files = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    assert found == told["runs"][NAME]["files"] and {*found} == files - {*manifest.NOT_DATA}


def test_a_figure_is_hashed_by_what_it_draws_and_says():
    def hashed(x=1.0, label="h", many=1.0, caption="c"):
        made = Figure()
        axes = made.subplots()
        axes.plot([0.0, x], [0.0, 1.0])
        axes.scatter([0.0, 1.0], [0.0, many])
        axes.set(xlabel=label, xlim=(0, 5), ylim=(0, 5))
        return manifest.figure_hash(made, caption)

    others = hashed(x=1.0 + 1e-15), hashed(label="s"), hashed(many=2.0), hashed(caption="d")
    assert hashed() == hashed() and len({hashed(), *others}) == 5


def changed(told, factor=None, scene="", data="", **environment):
    """The manifest of another computation; factor: another table, a number of its last row times this, and another
    balance, which is round-off."""
    other = copy.deepcopy(told)
    one = other["runs"][NAME]
    if factor:
        one["files"]["timeseries.csv"] = "0" * 64
        one["last_row"]["thickness_um"] *= factor
        one["last_row"]["acceptor_balance"] = -3e-15
    one["scene"] = scene or one["scene"]
    other["figures"]["figure_9"] |= {"data": data or "f" * 64, "wall_time_s": 99.0}
    other["environment"] |= environment
    return other


SOURCE = "the source of repro has changed what it computes"
THICK = "initial_mesh, thickness_um: 5.05 instead of 5, more than 0.2 %"


@pytest.mark.parametrize("changes, wrong, words", [
    ({"factor": 1.001, "numpy": "2"}, (), "numpy: 2 instead of 1"),
    ({"factor": 1.001, "source": "b"}, (), "the order of some operations has changed"),
    ({"factor": 1.001, "source": "b", "numpy": "2"}, (), "numpy: 2 instead of 1"),
    ({"factor": 1.001}, (), "not reproducible bit for bit"),
    ({"factor": 1.01, "numpy": "2"}, (THICK, "the same source computes something else with numpy: 2 instead of 1"), ""),
    ({"factor": 1.01, "source": "b"}, (THICK, SOURCE), ""),
    ({"factor": 1.01}, (THICK, "source and environment are the committed ones"), ""),
    ({"factor": 1.0, "scene": "f" * 16, "source": "b"},
     ("initial_mesh (scene)", "other scenes or outputs were asked for"), ""),
    ({"data": "0" * 64}, ("drawn otherwise from the same data: figure_9 (drawn)", "has changed"), ""),
    ({"numpy": "2"}, (), "")])
def test_other_bits_within_what_is_promised_are_as_committed_and_numbers_beyond_have_their_cause(
        told, changes, wrong, words):
    """And the source is not blamed where a version, or a scene, explains it."""
    other = changed(told, **changes)
    found, said = manifest.check(other, other, told)
    assert len(found) == len(wrong) and all(part in line for part, line in zip(wrong, found))
    assert len(said) == bool(words) and all(words in line and "source: b" not in line for line in said)


def test_the_committed_manifest_is_of_the_present_figures():
    kept = json.loads(manifest.COMMITTED.read_text(encoding="utf-8"))
    assert list(kept["figures"]) == list(paper_figures.FIGURES)
    requests = {request for name in paper_figures.FIGURES for request in import_module(f"paper_figures.{name}").RUNS}
    scenes = {request.name: scene_hash(request.load()) for request in requests}
    assert {name: run["scene"] for name, run in kept["runs"].items()} == scenes
    assert {"python", "numpy", "scipy", "mmgpy", "blas", "processor"} <= set(kept["environment"])
