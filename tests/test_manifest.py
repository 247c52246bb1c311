"""The manifest of `make figures`: hashes follow the data and nothing else, and a difference is told with its reason."""
import copy
import importlib
import json

import meshio
import numpy as np
import pytest
from matplotlib.figure import Figure

import paper_figures
from paper_figures import manifest, runs
from repro import load_scene, run
from repro.scene import scene_hash


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A run of 0.1 s."""
    made = tmp_path_factory.mktemp("runs") / "initial_mesh"
    run(load_scene("initial_mesh"), made)
    return made


@pytest.fixture
def told(folder):
    """A manifest of that run and a made-up figure."""
    figure = {"title": "T", "runs": ["initial_mesh"], "data": "f" * 64, "wall_time_s": 1.0, "pictures": {"f.pdf": 9}}
    return {"environment": {"numpy": "1", "source": "a"}, "figures": {"figure_9": figure},
            "runs": {"initial_mesh": manifest.of_run(runs.INITIAL_MESH, folder)}}


def drawn(x, label="h", many=()):
    """A figure of a line and of points."""
    made = Figure()
    axes = made.subplots()
    axes.plot([0.0, x], [0.0, 1.0])
    axes.scatter([0.0, 1.0], [0.0, *many] if many else [0.0, 1.0])
    axes.set(xlabel=label, xlim=(0, 5), ylim=(0, 5))
    return made


def test_every_file_with_data_is_listed(folder, told):
    """Fields by their arrays, so that the hashes of their files are none."""
    files = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    there = files - {"run.json", "report.html", "checkpoint.last", "fields.sha256"}
    assert set(told["runs"]["initial_mesh"]["files"]) == there and "fields/fields_0000.vtu" in there


def test_a_run_again_has_the_same_hashes(folder, told, tmp_path):
    run(load_scene("initial_mesh"), tmp_path / "again")
    assert manifest.of_run(runs.INITIAL_MESH, tmp_path / "again")["files"] == told["runs"]["initial_mesh"]["files"]


@pytest.mark.parametrize("packed, change, same", [
    (None, lambda content: None, True),
    ("zlib", lambda content: np.multiply(content.points, 1.0 + 1e-15, out=content.points), False),
    ("zlib", lambda content: np.add.at(content.cell_data["region"][0], 0, 1e-12), False)])
def test_fields_are_hashed_as_arrays(folder, tmp_path, packed, change, same):
    """Unpacked it is the same data; with the last bits of places, or one value of a cell, changed it is not."""
    original = folder / "fields" / "fields_0000.vtu"
    content = meshio.read(original)
    change(content)
    content.write(tmp_path / "copy.vtu", file_format="vtu", compression=packed)
    assert (manifest.file_hash(tmp_path / "copy.vtu") == manifest.file_hash(original)) is same


def test_a_figure_is_hashed_by_what_it_draws_and_says():
    made = [(drawn(1.0), "c"), (drawn(1.0 + 1e-15), "c"), (drawn(1.0, label="s"), "c"), (drawn(1.0), "d"),
            (drawn(1.0, many=(2.0,)), "c")]
    hashes = [manifest.figure_hash(*one) for one in made]
    assert hashes[0] == manifest.figure_hash(drawn(1.0), "c") and len(set(hashes)) == 5


def test_an_altered_file_is_told_as_altered(told):
    """By name; no environment is blamed."""
    now = copy.deepcopy(told)
    now["runs"]["initial_mesh"]["files"]["timeseries.csv"] = "0" * 64
    del now["runs"]["initial_mesh"]["files"]["fields.pvd"]
    lines, _ = manifest.check(now, told, told)
    assert len(lines) == 2 and all(line.startswith("altered since make figures wrote it") for line in lines)
    assert "timeseries.csv: 000000000000... instead of" in lines[1] and "fields.pvd: missing" in lines[0]


def another(told, factor=1.0, **environment):
    """The manifest of another computation: another table, a number of its last row times a factor."""
    other = copy.deepcopy(told)
    other["runs"]["initial_mesh"]["files"]["timeseries.csv"] = "0" * 64
    other["runs"]["initial_mesh"]["last_row"]["thickness_um"] *= factor
    other["environment"] |= environment
    return other


BLAMED = "the source of repro has changed what it computes"


@pytest.mark.parametrize("environment, within, beyond", [
    ({"numpy": "2"}, "numpy: 2 instead of 1", "the same source computes something else with numpy: 2 instead of 1"),
    ({"source": "b"}, "the order of some operations has changed", BLAMED),
    ({"source": "b", "numpy": "2"}, "numpy: 2 instead of 1", BLAMED),
    ({}, "not reproducible bit for bit", "source and environment are the committed ones")])
def test_other_bits_within_what_is_promised_are_as_committed_and_numbers_beyond_have_their_cause(
        told, environment, within, beyond):
    """And the source is not blamed where a version explains it."""
    other = another(told, 1.001, **environment)
    wrong, words = manifest.check(other, other, told)
    assert wrong == [] and len(words) == 1 and within in words[0] and "source: b" not in words[0]
    other = another(told, 1.01, **environment)
    wrong, words = manifest.check(other, other, told)
    assert words == [] and len(wrong) == 2 and beyond in wrong[1]
    assert "initial_mesh, thickness_um: 5.05 instead of 5, more than 0.2 %" in wrong[0]


def test_another_scene_is_the_cause_before_any_source(told):
    other = another(told, 1.0, source="b")
    other["runs"]["initial_mesh"]["scene"] = "f" * 16
    wrong, _ = manifest.check(other, other, told)
    assert "initial_mesh (scene)" in wrong[0] and "other scenes or outputs were asked for" in wrong[-1]


def test_a_figure_drawn_otherwise_from_the_same_data_is_wrong(told):
    other = copy.deepcopy(told)
    other["figures"]["figure_9"]["data"] = "0" * 64
    wrong, _ = manifest.check(other, other, told)
    assert "drawn otherwise from the same data: figure_9 (drawn)" in wrong[0] and "has changed" in wrong[1]


def test_round_off_times_sizes_and_versions_alone_are_no_difference(told):
    """A balance of 1e-15 may become -3e-15."""
    other, kept = another(told), copy.deepcopy(told)
    for one, balance in ((other, 1e-15), (kept, -3e-15)):
        one["runs"]["initial_mesh"]["last_row"]["acceptor_balance"] = balance
    assert manifest.check(other, other, kept)[0] == []
    other = copy.deepcopy(told)
    other["environment"]["numpy"], other["figures"]["figure_9"]["pictures"]["f.pdf"] = "2", 10
    other["figures"]["figure_9"]["wall_time_s"] = other["runs"]["initial_mesh"]["wall_time_s"] = 99.0
    assert manifest.check(other, other, told) == ([], [])


@pytest.mark.parametrize("change, status", [({}, 0), ({"data": "0"}, 1), ({"pictures": {}}, 1)])
def test_the_exit_status_follows(told, tmp_path, monkeypatch, capsys, change, status):
    now, committed = copy.deepcopy(told), tmp_path / "committed.json"
    now["figures"]["figure_9"] |= change
    for name, value in (("OUT", tmp_path), ("COMMITTED", committed), ("present", lambda: now)):
        monkeypatch.setattr(manifest, name, value)
    for path in (tmp_path / manifest.NAME, committed):
        path.write_text(json.dumps(told), encoding="utf-8")
    assert manifest.main() == status
    assert ("as committed" in capsys.readouterr().out) is (status == 0)


def test_without_figures_the_check_says_what_to_do(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(runs, "CACHE", tmp_path)
    with pytest.raises(FileNotFoundError, match="make figures"):
        manifest.present()
    monkeypatch.setattr(manifest, "OUT", tmp_path)
    assert manifest.main() == 1 and str(tmp_path) in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_the_committed_manifest_is_of_the_present_figures():
    kept = json.loads(manifest.COMMITTED.read_text(encoding="utf-8"))
    assert list(kept["figures"]) == list(paper_figures.FIGURES)
    assert {name: run["scene"] for name, run in kept["runs"].items()} == {
        request.name: scene_hash(request.load()) for name in paper_figures.FIGURES
        for request in importlib.import_module(f"paper_figures.{name}").RUNS}
    assert {"python", "numpy", "scipy", "mmgpy", "blas", "processor"} <= set(kept["environment"])
