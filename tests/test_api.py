"""The Python interface: exported functions, and results as arrays with names and units."""

import base64
import copy
import io
import re
from importlib.metadata import version

import matplotlib.pyplot as plt
import numpy as np
import pytest

import repro
from repro import results
from repro.cli import main
from repro.errors import OutputError
from repro.results import drawing
from repro.results.tables import END_TIMES, Results, solve
from repro.scene import SceneError, load_scene
from tests import faults
from tests.pages import PURE
from tests.strategies import same_arrays

SHORT = ["numerics.preset=fast", 'growth.end="0.6 h"', 'output.times=["0.2 h", "0.4 h", "0.6 h"]']


@pytest.fixture(scope="module")
def solved() -> Results:
    return solve(load_scene("base", SHORT))


def test_results_lack_quantities_that_are_not_modelled():
    (flow,) = [solve(load_scene("flow_only"))]
    assert flow["mean_velocity_m_per_d"] == pytest.approx(2.9) and "donor_balance" not in flow
    assert len(flow.time) == 1 and not any("donor" in name for name in flow.fields(0.0))
    with pytest.raises(KeyError, match="did you mean conductivity_m_per_d"):
        flow["conductivity"]


def test_another_time_is_refused_by_the_nearest(solved):
    """By the times of the run, or by the rows beside it where the scene is not known."""
    with pytest.raises(KeyError, match="7.0 h: outside the run, from 0 to 0.6 h"):
        solved.fields(7.0)
    rows = [dict.fromkeys(results.COLUMNS) | {"time_h": time} for time in solved.time]
    with pytest.raises(KeyError, match="0.55 h: not .* the nearest rows are at 0.4 and 0.6 h, of 4 from 0 to 0.6 h"):
        Results("x", rows, [{}] * 4, "completed").fields(0.55)


def test_a_time_may_have_a_unit(solved):
    """A number is in hours. A text without a unit of time is refused."""
    assert solved.fields("12 min") is solved.fields(0.2) and solved.fields("0.6 h") is solved.fields(0.6)
    for text in ("1", "1 um", "soon", "1e999 h"):
        with pytest.raises(ValueError, match=f"time: '{text}': a number of hours or a text such as"):
            solved.fields(text)
    with pytest.raises(TypeError, match="fields: time: float or str is needed, not None"):
        solved.fields(None)


def test_the_nearest_row_replaces_a_time_between_rows(solved):
    """The names of columns complete in IPython, and those of fields as keys of a dict."""
    assert solved.fields(0.55, method="nearest") is solved.fields(0.6)
    assert solved.fields(7.0, "nearest") is solved.fields(0.6) and solved.fields(0.25, "nearest") is solved.fields(0.2)
    with pytest.raises(ValueError, match=r'method: None or "nearest" is needed, not \'linear\''):
        solved.fields(0.6, "linear")
    with pytest.raises(KeyError, match="nan h"):
        solved.fields(np.nan, "nearest")
    assert solved._ipython_key_completions_() == list(solved)


def test_a_time_with_round_off_selects_its_row():
    """The time may err on either side, like 0.1 + 0.2."""
    rows = [dict.fromkeys(results.COLUMNS) | {"time_h": time} for time in (0.0, 0.3, 0.7)]
    table = Results("x", rows, [{"row": k} for k in range(3)], "completed")
    for row, time in enumerate(table.time):
        assert [table.fields(time + off)["row"] for off in (-1e-12, 0.0, 1e-12)] == [row] * 3
    with pytest.raises(KeyError, match="nan h: not a reported time"):
        table.fields(np.nan)


def test_a_run_without_rows_can_be_shown():
    """The run failed before its first row."""
    empty = Results("x", [], [], "failed")
    assert "0 rows" in repr(empty) and "<img" not in empty._repr_html_() and len(empty.to_pandas()) == 0
    assert empty.to_pandas().attrs["status"] == "failed"
    with pytest.raises(KeyError, match="0.0 h: not a reported time; there is no row"):
        empty.fields(0.0)


def test_the_table_of_a_notebook_escapes_and_is_short(solved):
    rows = [dict.fromkeys(results.COLUMNS) | {"time_h": float(k)} for k in range(40)]
    html = Results("<script>alert(1)</script>&", rows, [{}] * 40, "<b>")._repr_html_()
    assert "<script" not in html and "&lt;script&gt;" in html and "<b>" not in html
    assert html.count("<td>") == 2 * END_TIMES and "<td>39</td>" in html and "<td>20</td>" not in html
    assert solved._repr_html_().count("<td>") == len(solved) * len(solved.time)
    assert "<th>conductivity_m_per_d (m/d)</th>" in solved._repr_html_()
    assert repr(solved) == f"<Results of base: {len(solved.time)} rows, {len(solved)} columns, completed>"


NARROW = {"pore": {"width": "30 um"}, "aggregate": {"radius": "8 um"}, "flow": {"mean_velocity": "1.5 m/day"},
          "substrates": {"acceptor": {"supply": "8 mg/L"}, "donor": {"supply": "5 mg/L"}}, "growth": {"end": "1 h"},
          "output": {"times": ["0.5 h", "1 h"]}}


@pytest.mark.exact_lengths
def test_a_scene_may_be_a_dict_a_file_or_a_name(tmp_path):
    """It may also be a loaded scene. The dict stays unchanged."""
    original = copy.deepcopy(NARROW)
    scene = load_scene(NARROW)
    assert original == NARROW and scene == load_scene(scene) and scene.name == "scene"
    file = tmp_path / "narrow.toml"
    file.write_text(str(scene))
    from_file, *others = map(solve, (str(file), NARROW, scene))
    assert all(same_arrays(from_file, other) for other in others)
    assert [load_scene(source, ["pore.width=40 um"]).pore.width for source in (scene, NARROW)] == [40, 40]
    extended = load_scene(scene, ["numerics.extent=full"], unset=["flow"])
    assert extended.flow is None and scene.flow is not None and original == NARROW
    with pytest.raises(SceneError, match=r"scene: pore.width = 3: a length"):
        load_scene({"pore": {"width": 3}})


def test_a_loaded_run_equals_the_solved_one(solved, tmp_path):
    """Rows, the table and fields agree to the last bit, also in a folder without fields."""
    repro.run(load_scene("base", SHORT), str(tmp_path))
    loaded, table = repro.load_run(tmp_path), results.read_table(tmp_path / "timeseries.csv")
    assert list(table) == results.column_names(load_scene("base")) and loaded.units == solved.units
    table = {name: column for name, column in table.items() if not np.isnan(column).all()}
    assert list(loaded) == list(solved) == list(table)
    assert repr(loaded) == repr(solved) and solved.status == "completed"
    assert np.array_equal(solved.time, solved["time_h"]) and solved.time[-1] == 0.6
    assert same_arrays(loaded, solved) and same_arrays(table, solved)
    assert all(same_arrays(loaded.fields(time), solved.fields(time)) for time in solved.time)
    assert loaded._repr_html_() == solved._repr_html_()
    (tmp_path / "fields.pvd").unlink()
    assert "<img" not in repro.load_run(tmp_path)._repr_html_()
    with pytest.raises(OutputError, match="holds no run"):
        repro.load_run(tmp_path / "fields")


def test_missing_fields_are_refused_and_none_replaces_another(solved, tmp_path):
    """Of four times two files are missing, then one is damaged, then the list. The other fields and all units stay
    available, and a notebook shows no picture."""
    repro.run(load_scene("base", SHORT), str(tmp_path))
    for row in (0, 1):
        (tmp_path / f"fields/fields_000{row}.vtu").unlink()
    loaded = repro.load_run(tmp_path)
    assert all(same_arrays(loaded.fields(time), solved.fields(time)) for time in (0.4, 0.6))
    assert loaded.units == solved.units
    (tmp_path / "fields/fields_0003.vtu").write_text("<VTKFile")
    assert "<img" not in loaded._repr_html_()
    for time, message in ((0.2, "fields_0001.vtu: the fields of 0.2 h are missing"),
                       (0.6, "fields_0003.vtu: the fields are cut short or altered")):
        with pytest.raises(OutputError, match=message):
            loaded.fields(time)
    (tmp_path / "fields.pvd").unlink()
    with pytest.raises(OutputError, match=r"fields\.pvd: no fields of 0.6 h are listed"):
        repro.load_run(tmp_path).fields(0.6)
    (tmp_path / "fields.pvd").write_text("<VTKFile>")
    with pytest.raises(OutputError, match=r"fields\.pvd cannot be read: it is not as it was written"):
        repro.load_run(tmp_path)


def test_data_frames_and_datasets_have_names_and_units(solved):
    """Units are the ends of the names, and "1" for pure numbers."""
    assert set(solved.units) == {*solved, *solved.fields(0.0)}
    assert {name for name, unit in solved.units.items() if unit == "1"} == {*PURE, "triangles"}
    frame = solved.to_pandas()
    assert frame.index.name == "time_h" and list(frame) == list(solved)[1:]
    assert frame.attrs["units"]["conductivity_m_per_d"] == "m/d" and (frame["nodes"] == solved["nodes"]).all()
    dataset = solved.to_xarray()
    assert dataset["head_loss_cm"].attrs["units"] == "cm" and dataset.attrs["status"] == "completed"
    assert np.array_equal(dataset["time_h"], solved.time)


@pytest.mark.parametrize("package, make", [("pandas", Results.to_pandas), ("xarray", Results.to_xarray)])
def test_a_missing_optional_package_is_reported_in_one_line(solved, monkeypatch, package, make):
    faults.remove_package(monkeypatch, package)
    with pytest.raises(ImportError, match=f"^the package {package} is not installed; pip install {package}$"):
        make(solved)


def test_a_notebook_shows_key_figures_and_a_picture(solved):
    """The picture is a PNG of the meshed part, in which the aggregate's boundary is red. pyplot keeps no figure."""
    before = plt.get_fignums()
    html = solved._repr_html_()
    assert "conductivity of the pore 174.1 → 173.8 m/day; area of the aggregate 39.27 → " in html
    assert "; thickness of the aggregate 5 → 5.295 um" in html and "at t = 0.6 h" in html and len(html) < 100_000
    data = base64.b64decode(re.search(r'src="data:image/png;base64,([^"]+)"', html)[1])
    pixels = (255 * plt.imread(io.BytesIO(data))[..., :3]).round().astype(int)
    rows, columns = np.nonzero((np.abs(pixels - [215, 25, 28]) < 40).all(axis=2))  # the colour of the boundary
    thickness, upstream, downstream = (solved[f"{name}_um"][-1] for name in ("thickness", "upstream", "downstream"))
    assert np.ptp(columns) / np.ptp(rows) == pytest.approx((downstream - upstream) / thickness, rel=0.1)
    assert plt.get_fignums() == before


def test_a_notebook_without_matplotlib_shows_key_figures_alone(solved, monkeypatch):
    faults.remove_package(monkeypatch, "matplotlib.figure")
    html = solved._repr_html_()
    assert "<img" not in html and "thickness of the aggregate 5 → 5.295 um" in html


def test_the_version_is_printed(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["--version"])
    assert ended.value.code == 0 and capsys.readouterr().out == f"repro {repro.__version__}\n"
    assert repro.__version__ == version("dupin2001-repro") and {*repro.__all__} < {*dir(repro)}


def test_a_picture_states_which_values_are_dark():
    coordinates = np.array([(0.0, 0.0), (4.0, 0.0), (0.0, 3.0)])
    fields = {"places_um": coordinates, "triangles": np.array([[0, 1, 2]]), "region": np.zeros(1)}
    caption = drawing.figure(fields | {"acceptor_mg_per_L": np.array([3.0, 1.5, 7.0])}, "base", 2.5)
    assert caption.count("acceptor (mg/L), 1.5 (dark) to 7 (light), at t = 2.5 h") == 2
    speeds = np.array([[-3.0, 4, 0], [0, 1, 0], [0, 2, 0]])
    caption = drawing.figure(fields | {"velocity_m_per_d": speeds}, "base", 2.5)
    assert "velocity (m/day), 1 (dark) to 5 (light)" in caption
