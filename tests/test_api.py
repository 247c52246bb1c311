"""From Python: what `repro` exports, results as arrays with names and units, and how little importing it takes."""

import base64
import copy
import importlib.resources
import io
import re
import tomllib
from dataclasses import replace
from importlib.metadata import version

import matplotlib.pyplot as plt
import numpy as np
import pytest

import repro
from repro import results
from repro.cli import main
from repro.errors import OutputError
from repro.results import field_files
from repro.results.tables import SHOWN, Results, solve
from repro.scene import SceneError, load_scene, packaged_scenes
from tests import faults
from tests.pages import PURE, whole_of
from tests.strategies import arrays_of, same_arrays

SHORT = ["numerics.preset=fast", 'growth.end="0.6 h"', 'output.times=["0.2 h", "0.4 h", "0.6 h"]']


@pytest.fixture(scope="module")
def found() -> Results:
    return solve(load_scene("base", SHORT))


@pytest.mark.parametrize("elements, corners", [("linear", 3), ("quadratic", 6), ("cubic", 6)])
def test_fields_are_those_of_the_files_of_a_run(elements, corners):
    """On straight triangles and on curved ones."""
    scene = load_scene("base", ["numerics.preset=fast", f"numerics.elements={elements}", 'growth.end="0.2 h"',
                                'output.times=["0.2 h"]'])
    fields, written = solve(scene).fields(0.2), arrays_of(field_files.read(whole_of(scene) / "fields/fields_0001.vtu"))
    written |= {"places_um": written.pop("points")[:, :2], "triangles": written.pop("cells")}
    assert same_arrays(fields, written) and fields["triangles"].shape[1] == corners


def test_what_is_not_modelled_is_not_there():
    (flow,) = [solve(load_scene("flow_only"))]
    assert flow["mean_velocity_m_per_d"] == pytest.approx(2.9) and "donor_balance" not in flow
    assert len(flow.time) == 1 and not any("donor" in name for name in flow.fields(0.0))
    with pytest.raises(KeyError, match="did you mean conductivity_m_per_d"):
        flow["conductivity"]


def test_another_time_is_refused_by_the_nearest(found):
    with pytest.raises(KeyError, match=r"0.55 h: not a reported time; the nearest is 0.6"):
        found.fields(0.55)


def test_a_time_that_is_off_by_round_off_is_that_of_its_row():
    """On either side of every row, as 0.1 + 0.2 is."""
    rows = [dict.fromkeys(results.COLUMNS) | {"time_h": time} for time in (0.0, 0.3, 0.7)]
    said = Results("x", rows, [{"row": k} for k in range(3)], "completed")
    for row, time in enumerate(said.time):
        assert [said.fields(time + off)["row"] for off in (-1e-12, 0.0, 1e-12)] == [row] * 3
    with pytest.raises(KeyError, match="nan h: not a reported time"):
        said.fields(np.nan)


def test_a_run_without_rows_can_be_shown():
    """It failed before its first row was there."""
    none = Results("x", [], [], "failed")
    assert "0 rows" in repr(none) and "<img" not in none._repr_html_() and len(none.to_pandas()) == 0
    with pytest.raises(KeyError, match="0.0 h: not a reported time; none is"):
        none.fields(0.0)


def test_a_run_to_the_pores_end_says_so():
    scene = load_scene("wide", ["aggregate.radius=40 um", "pore.length=90 um", "growth.time_step=2 h", "growth.end=4 h",
                                "numerics.refinement=0.5"])
    assert "reaches the pore's" in solve(scene).status


def test_the_table_of_a_notebook_escapes_and_is_short(found):
    rows = [dict.fromkeys(results.COLUMNS) | {"time_h": float(k)} for k in range(40)]
    html = Results("<script>alert(1)</script>&", rows, [{}] * 40, "<b>")._repr_html_()
    assert "<script" not in html and "&lt;script&gt;" in html and "<b>" not in html
    assert html.count("<td>") == 2 * SHOWN and "<td>39</td>" in html and "<td>20</td>" not in html
    assert found._repr_html_().count("<td>") == len(found) * len(found.time)
    assert "<th>conductivity_m_per_d (m/d)</th>" in found._repr_html_()
    assert repr(found) == f"<Results of base: {len(found.time)} rows, {len(found)} columns, completed>"


def test_what_the_package_ships():
    project = (importlib.resources.files("repro") / ".." / "pyproject.toml").read_text(encoding="utf-8")
    for name in ("py.typed", "results/network.csv"):
        assert (importlib.resources.files("repro") / name).is_file() and f'"{name}"' in project


NARROW = {"pore": {"width": "30 um"}, "aggregate": {"radius": "8 um"}, "flow": {"mean_velocity": "1.5 m/day"},
          "substrates": {"acceptor": {"supply": "8 mg/L"}, "donor": {"supply": "5 mg/L"}}, "growth": {"end": "1 h"}}


def test_a_scene_may_be_a_dict_a_file_or_a_name(tmp_path):
    """And one that was loaded; the dict is left as it is."""
    kept = copy.deepcopy(NARROW)
    scene = load_scene(NARROW)
    assert kept == NARROW and scene == load_scene(scene) and scene.name == "scene"
    file = tmp_path / "narrow.toml"
    file.write_text(str(scene))
    from_file = solve(str(file))
    for other in (solve(NARROW), solve(scene)):
        assert all(np.array_equal(from_file[name], other[name]) for name in from_file)
    assert [load_scene(one, ["pore.width=40 um"]).pore.width for one in (scene, NARROW)] == [40, 40]
    still = load_scene(scene, ["numerics.extent=full"], ["flow"])
    assert still.flow is None and scene.flow is not None and kept == NARROW
    with pytest.raises(SceneError, match=r"scene: pore.width = 3: a length"):
        load_scene({"pore": {"width": 3}})


def test_a_scene_prints_as_its_toml(tmp_path):
    """Every key, with units, and it reads as an equal scene."""
    for name in packaged_scenes():
        scene = load_scene(name)
        assert load_scene(tomllib.loads(str(scene))) == replace(scene, name="scene") and 'width = "' in str(scene)
    assert repr(load_scene("flow_only")).startswith("<Scene flow_only: pore, aggregate, flow, numerics, output; hash ")


def test_check_tells_what_repro_check_does(capsys):
    assert main(["check", "wide"]) == 0
    told = capsys.readouterr().out.partition("Cost")[0]  # which is of a trial
    assert "Mesh at t = 0" in told and str(repro.check("wide")).startswith(told)


def test_a_run_is_loaded_as_it_was_solved(found, tmp_path):
    """Rows, those of its table, and fields to the last bit, of a folder without fields too."""
    repro.run(load_scene("base", SHORT), str(tmp_path))
    loaded, table = repro.load_run(tmp_path), results.read_table(tmp_path / "timeseries.csv")
    assert list(loaded) == list(found) == list(table) == results.COLUMNS and loaded.units == found.units
    assert repr(loaded) == repr(found) and found.status == "completed"
    assert np.array_equal(found.time, found["time_h"]) and found.time[-1] == 0.6
    assert same_arrays(loaded, found) and same_arrays(table, found)
    assert all(same_arrays(loaded.fields(time), found.fields(time)) for time in found.time)
    assert loaded._repr_html_() == found._repr_html_()
    (tmp_path / "fields.pvd").unlink()
    assert "<img" not in repro.load_run(tmp_path)._repr_html_()
    with pytest.raises(OutputError, match="holds no run"):
        repro.load_run(tmp_path / "fields")


def test_fields_that_are_lost_are_told_and_none_is_taken_for_another(found, tmp_path):
    """Of four times two files are gone, then one is damaged, then the list: the others stay what they are, units too,
    and a notebook shows no picture."""
    repro.run(load_scene("base", SHORT), str(tmp_path))
    for row in (0, 1):
        (tmp_path / f"fields/fields_000{row}.vtu").unlink()
    loaded = repro.load_run(tmp_path)
    assert all(same_arrays(loaded.fields(time), found.fields(time)) for time in (0.4, 0.6))
    assert loaded.units == found.units
    (tmp_path / "fields/fields_0003.vtu").write_text("<VTKFile")
    assert "<img" not in loaded._repr_html_()
    for time, said in ((0.2, "fields_0001.vtu: the fields of 0.2 h are missing"),
                       (0.6, "fields_0003.vtu: the fields cannot be read")):
        with pytest.raises(OutputError, match=said):
            loaded.fields(time)
    (tmp_path / "fields.pvd").unlink()
    with pytest.raises(OutputError, match=r"fields\.pvd: no fields of 0.6 h are listed"):
        repro.load_run(tmp_path).fields(0.6)
    (tmp_path / "fields.pvd").write_text("<VTKFile>")
    with pytest.raises(OutputError, match=r"fields\.pvd cannot be read: it is not as it was written"):
        repro.load_run(tmp_path)


def test_data_frames_and_datasets_have_names_and_units(found):
    """Units are what the names end with, "1" for pure numbers."""
    assert set(found.units) == {*found, *found.fields(0.0)}
    assert {name for name, unit in found.units.items() if unit == "1"} == {*PURE, "triangles"}
    frame = found.to_pandas()
    assert frame.index.name == "time_h" and list(frame) == list(found)[1:]
    assert frame.attrs["units"]["conductivity_m_per_d"] == "m/d" and (frame["nodes"] == found["nodes"]).all()
    dataset = found.to_xarray()
    assert dataset["head_loss_cm"].attrs["units"] == "cm" and dataset.attrs["status"] == "completed"
    assert np.array_equal(dataset["time_h"], found.time)


@pytest.mark.parametrize("package, make", [("pandas", Results.to_pandas), ("xarray", Results.to_xarray)])
def test_an_optional_package_that_is_not_there_is_told_in_one_line(found, monkeypatch, package, make):
    faults.absent_package(monkeypatch, package)
    with pytest.raises(ImportError, match=f"^the package {package} is not installed; pip install {package}$"):
        make(found)


def test_a_sweep_from_python(tmp_path):
    """Runs, labels and tables; a second call makes nothing again."""
    events = []
    asked = NARROW, ["pore.width=30 um, 40 um"], tmp_path / "sweep"
    swept = repro.sweep(*asked, workers=1, tell=events.append)
    assert [one.done for one in swept.runs] == [True, True] and swept.failed == []
    assert [swept.label(one) for one in swept.runs] == ["pore.width = 30 um", "pore.width = 40 um"]
    assert [event["done"] for event in events] == [0, 1, 2] and repr(swept).startswith("<Sweep of scene: 2 of 2 runs")
    widths = [repro.load_run(path)["head_loss_cm"][0] for path in swept.paths]
    assert widths[0] > widths[1] and (tmp_path / "sweep" / "runs.csv").exists()
    again = []
    repro.sweep(*asked, workers=1, tell=again.append)
    assert [event["done"] for event in again] == [2]


def test_a_notebook_shows_key_figures_and_a_picture(found):
    """The picture is a PNG of the whole meshed part; white is the aggregate's boundary, up to its top."""
    html = found._repr_html_()
    told = "conductivity of the pore 174.1 → 173.8 m/day; thickness of the aggregate 5 → 5.295 um"
    assert told in html and "at t = 0.6 h" in html and len(html) < 100_000
    data = base64.b64decode(re.search(r'src="data:image/png;base64,([^"]+)"', html)[1])
    pixels = plt.imread(io.BytesIO(data))
    height, width = pixels.shape[:2]
    along, across = np.ptp(found.fields(0.6)["places_um"], axis=0)
    assert width == 480 and height == pytest.approx(480 * across / along, abs=1)
    top = np.argwhere((pixels[..., :3] == 1).all(axis=2))[:, 0].min()
    assert (height - top) * along / width == pytest.approx(found["thickness_um"][-1], abs=2 * along / width)


def test_help_begins_with_use_and_the_version_is_told(capsys):
    lines = repro.__doc__.splitlines()
    assert "Ten lines of use" in lines[2] and sum("repro." in line for line in lines[4:14]) >= 6
    code = "\n".join(line.strip() for line in lines[4:14])
    assert set(re.findall(r"repro\.(\w+)\(", code)) <= set(repro.__all__)
    with pytest.raises(SystemExit) as ended:
        main(["--version"])
    assert ended.value.code == 0 and capsys.readouterr().out == f"repro {repro.__version__}\n"
    assert repro.__version__ == version("dupin2001-repro") and dir(repro) == sorted(repro.__all__)
