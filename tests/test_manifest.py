"""The manifest of `make figures`: a difference is reported with its reason, and the committed one is up to date."""
import copy
import json
from importlib import import_module

import pytest

import paper_figures
from paper_figures import manifest
from repro.scene import scene_hash

NAME = "initial_mesh"
#: A manifest of a run and a figure.
MANIFEST = {
    "environment": {"numpy": "1", "source": "a"},
    "runs": {NAME: {"scene": "a" * 16, "files": {"timeseries.csv": "a" * 64},
                    "last_row": {"thickness_um": 5.0, "acceptor_balance": 1e-15}}},
    "figures": {"figure_9": {"title": "T", "runs": [NAME], "data": "f" * 64, "wall_time_s": 1.0,
                             "pictures": {"f.pdf": 9}}}}


def changed(factor=None, scene="", data="", **environment):
    """The manifest of another computation. A factor scales a number of the last row, and changes the table's hash and
    a balance, which is round-off."""
    other = copy.deepcopy(MANIFEST)
    entry = other["runs"][NAME]
    if factor:
        entry["files"]["timeseries.csv"] = "0" * 64
        entry["last_row"]["thickness_um"] *= factor
        entry["last_row"]["acceptor_balance"] = -3e-15
    entry["scene"] = scene or entry["scene"]
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
     ("initial_mesh (scene)", "scenes or outputs are not those"), ""),
    ({"data": "0" * 64}, ("drawn otherwise from the same data: figure_9 (drawn)", "has changed"), ""),
    ({"numpy": "2"}, (), "")])
def test_round_off_passes_and_larger_differences_are_reported_with_their_cause(changes, wrong, words):
    """The source is not named as the cause if a version or a scene explains the difference."""
    other = changed(**changes)
    errors, notes = manifest.check(other, other, MANIFEST)
    assert len(errors) == len(wrong) and all(part in line for part, line in zip(wrong, errors))
    assert len(notes) == bool(words) and all(words in line and "source: b" not in line for line in notes)


def test_the_committed_manifest_is_of_the_present_figures():
    committed = json.loads(manifest.COMMITTED.read_text(encoding="utf-8"))
    assert list(committed["figures"]) == list(paper_figures.FIGURES)
    requests = {request for name in paper_figures.FIGURES for request in import_module(f"paper_figures.{name}").RUNS}
    scenes = {request.name: scene_hash(request.load()) for request in requests}
    assert {name: run["scene"] for name, run in committed["runs"].items()} == scenes
    assert {"python", "numpy", "scipy", "mmgpy", "blas", "processor"} <= set(committed["environment"])
