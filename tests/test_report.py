"""The pages of runs: what they say, that they need nothing else, and that nothing told by others is markup."""

import html
import json
import re
import runpy
import shutil
from pathlib import Path

import meshio
import numpy as np
import pytest

from repro import report, results
from repro.fem.mesh import Mesh, curved
from repro.report import fields, page, quantities, run_page
from repro.report.reading import read
from repro.results import names, vtu
from repro.results.vtu import Cells, Grid
from tests.pages import (
    FAST,
    HOSTILE,
    PURE,
    Page,
    check_alone,
    check_drawn,
    first,
    hostile,
    numbers,
    run,
    stored,
    text_of,
)


def test_every_run_has_a_page_that_needs_nothing_else(fast, paper, flow_only):
    for out in (fast, paper, flow_only):
        found = check_alone(text_of(out))
        assert found.outside == [] and {kind for kind, _, _ in found.scripts} == {"style", "script"}


def test_charts_of_a_whole_run_are_its_columns(fast):
    """That the lines of charts are the columns that they name is in `test_derived.py`."""
    text, charts = text_of(fast), quantities.charts_of(read(fast))
    assert [chart.title for chart in charts] == [kind.title for kind in quantities.KINDS]
    check_drawn(text, {chart.title: chart.lines for chart in charts})
    for word in ("factorise and solve", "Newton iterations, transport", "scene hash", "numpy", "kinematic_viscosity"):
        assert word in text


@pytest.mark.parametrize("name", ["fast", "paper"])
def test_numbers_are_those_of_the_first_and_the_last_row(request, name):
    """As the page's table has them, to four digits."""
    out = request.getfixturevalue(name)
    panel = first("<h2>Numbers</h2>(.*?)</table>", text_of(out))
    lines = [re.findall("<td.*?>(.*?)</td>", row) for row in re.findall("<tr>(.*?)</tr>", panel)[1:]]
    told = {html.unescape(label): shown for label, *shown in lines}
    series = results.read_table(out / "timeseries.csv")
    times = series.pop("time_h")
    assert re.findall("t = ([^ ]*) h", panel) == [f"{times[k]:.6g}" for k in (0, -1)] and len(times) > 2
    assert told.keys() == set(map(names.with_unit, series)) and (series["conductivity_m_per_d"] > 0).all()
    for column, values in series.items():
        shown = told[names.with_unit(column)]
        if column in ("remeshed", "contact"):
            assert shown == ["yes" if value else "no" for value in values[[0, -1]]]
        else:
            assert list(map(float, shown)) == pytest.approx(values[[0, -1]], rel=5.1e-5), column


def test_what_is_not_modelled_is_left_out(flow_only, fast):
    text, packed = text_of(flow_only), stored(flow_only)
    assert "Not modelled: substrates, kinetics, growth." in text and "acceptor" not in text.split("<script>")[0]
    assert [field["name"] for field in packed["fields"]] == ["velocity_m_per_d", "head_cm", "region"]
    assert "<figure" not in text and '<div class="time" hidden>' in text
    assert "Not modelled" not in text_of(fast) and '<div class="time">' in text_of(fast)


def test_each_frame_is_drawn_on_its_own_mesh(fast, paper):
    """Of a run with two meshes: triangles of six nodes, and then of three."""
    packed = fields.packed([*fields.index(fast)[:1], *fields.index(paper)[:1]])
    assert [packed["meshes"][frame["mesh"]]["per"] for frame in packed["frames"]] == [6, 3]


def places(packed, frame):
    """(N, 2) um of the nodes of a frame, and the sides of the box that holds all."""
    low, high = np.array(packed["box"]).reshape(2, 2).T
    return low + values((0.0, 1.0, frame["points"])).reshape(-1, 2) * (high - low), high - low


def values(told):
    """Of the least, the largest and the levels of an array."""
    low, high, text = told
    return low + numbers(text, "<u2") / 65534 * (high - low)


@pytest.mark.parametrize("name", ["fast", "paper"])
def test_fields_of_the_page_are_those_of_the_files(request, name):
    """Each array to half a step of its 65534, with the mesh's own nodes."""
    out = request.getfixturevalue(name)
    packed, entries = stored(out), fields.index(out)
    assert packed["of"] == len(entries) == len(packed["frames"])
    for frame, (time, path) in zip(packed["frames"], entries):
        grid, mesh = meshio.vtu.read(path), packed["meshes"][frame["mesh"]]
        cells = grid.cells[0].data
        assert frame["time"] == time and mesh["per"] == cells.shape[1] == {"fast": 6, "paper": 3}[name]
        assert (numbers(mesh["cells"], "<u4").reshape(cells.shape) == cells).all()
        region = numbers(mesh["body"], "<u1") == 1
        assert (region == grid.cell_data["region"][0]).all() and region.any() and not region.all()
        points, box = places(packed, frame)
        assert np.abs(points - grid.points[:, :2]).max() <= 0.51 / 65534 * box.max()
        nodes = np.unique(cells[region])
        for field in packed["fields"]:
            told = frame["values"][field["name"]]
            low, high = told[:2]
            node = field["at"] == "node"
            value = grid.point_data[field["name"]] if node else grid.cell_data[field["name"]][0]
            value = np.linalg.norm(value, axis=1) if value.ndim == 2 else value
            value = value[nodes if node else region] if field["body"] else value
            assert (low, high) == (value.min(), value.max())
            assert np.abs(values(told) - value).max() <= 0.51 / 65534 * (high - low)


def test_a_value_that_is_not_finite_has_none(tmp_path):
    low, high, text = fields._levels(np.array([1.0, np.nan, 3.0, np.inf]))
    assert (low, high) == (1.0, 3.0) and numbers(text, "<u2").tolist() == [0, 65535, 65534, 65535]


def test_many_frames_are_thinned_and_the_page_says_so(paper, tmp_path, monkeypatch):
    """The first and the last are always shown."""
    monkeypatch.setattr(fields, "MOST_FRAMES", 3)
    copy = shutil.copytree(paper, tmp_path / "run")
    report.write(copy)
    assert [frame["time"] for frame in stored(copy)["frames"]] == [0, 0.4, 1.0]
    assert "3 of 6 times shown" in text_of(copy) and "all 6 times shown" in text_of(paper)
    monkeypatch.setattr(fields, "MOST_BYTES", 1)
    report.write(copy)
    assert [frame["time"] for frame in stored(copy)["frames"]] == [0, 1.0]


def test_fields_are_read_from_the_runs_own_files_alone(paper, tmp_path):
    copy = shutil.copytree(paper, tmp_path / "run")
    (tmp_path / "fields").mkdir()
    shutil.copy(copy / "fields/fields_0000.vtu", tmp_path / "fields/fields_0000.vtu")
    results.write_index(copy / "fields.pvd", [(0.0, "../fields/fields_0000.vtu"), (1.0, "fields/fields_0001.vtu"),
                                              (2.0, str(tmp_path / "fields/fields_0000.vtu"))])
    assert [time for time, _ in fields.index(copy)] == [1.0]


def test_nothing_told_by_others_is_markup(fast, tmp_path):
    """Names, status, keys, values, columns and folders."""
    copy = hostile(shutil.copytree(fast, tmp_path / "<b onclick=pwned=1>"))
    report.write(copy)
    report.compare([copy, fast], tmp_path / "both.html")
    for text in (text_of(copy), (tmp_path / "both.html").read_text()):
        found = Page(text)
        assert {tag for tag, _ in found.tags} <= {tag for tag, _ in Page(text_of(fast)).tags} | {"ul", "li", "b"}
        assert "<script>pwned" not in text and "<img" not in text and "<b onclick" not in text
        assert any(HOSTILE in one for one in found.texts)
        assert len(found.scripts) <= 6


def test_a_scene_with_a_hostile_name_runs_to_its_page(tmp_path):
    (tmp_path / HOSTILE).write_text('[pore]\nwidth = "50 um"\n')
    text, name = text_of(run(tmp_path, tmp_path / HOSTILE)), HOSTILE.removesuffix(".toml")
    assert Page(text).texts.count(name) == 1 and f"<title>{html.escape(name)}: a pore</title>" in text


def test_data_cannot_end_its_block():
    text = page.data("x", {"a": "</script><!--<script>"})
    assert text.count("<") == 2 and json.loads(Page(text).scripts[0][2]) == {"a": "</script><!--<script>"}


def test_storage_is_drawn_where_there_is_some(paper):
    assert "acceptor_stored_ug_per_m_per_h" not in quantities.series(read(paper))


def test_contact_is_marked(tmp_path):
    out = run(tmp_path, "wide", FAST, 'pore.width="20 um"', 'aggregate.radius="17.9 um"', 'growth.end="1 h"')
    series = results.read_table(out / "timeseries.csv")
    touching = series["time_h"][series["contact"] == 1][0]
    assert quantities.contact(read(out)) == [touching] and 0 < touching < series["time_h"][-1]
    assert f"contact with the opposite wall, t = {touching:.6g} h" in text_of(out) and 'class="mark"' in text_of(out)


def test_a_run_that_stops_has_its_page(tmp_path, monkeypatch, capsys):
    from repro.errors import SimulationError
    from repro.run import running

    steps = running.steps

    def stops(scene, state=None):
        yield next(steps(scene))
        raise SimulationError("stopped in the step from t = 0 h, in <growth>: no")

    monkeypatch.setattr(running, "steps", stops)
    text = text_of(run(tmp_path, "base", status=1))
    assert "Failed: stopped in the step from t = 0 h, in &lt;growth&gt;: no" in text
    Page(text)


def test_every_name_has_its_unit_or_is_a_pure_number(fast, paper):
    """Names of columns, ledgers and arrays."""
    arrays = [meshio.vtu.read(fields.index(out)[-1][1]) for out in (fast, paper)]
    told = {name for grid in arrays for name in (*grid.point_data, *grid.cell_data)}
    assert told | {*results.COLUMNS, *results.LEDGER_COLUMNS} == names.KNOWN.keys()
    for name, each in names.KNOWN.items():
        assert bool(names.unit(name)) != (name in PURE) and each.formula and names.words(name) != name or name == "J"
    assert (names.unit("mean_velocity_m_per_d"), names.unit("thickness_um")) == ("m/day", "um")
    units = {"conductivity_m_per_d": "m d-1", "head_loss_cm": "cm", "aggregate_area_um2": "um2", "thickness_um": "um",
             "nodes": "1", "acceptor_supplied_pg_per_m": "pg m-1", "donor_min_mg_per_L": "mg L-1"}
    assert {name: names.udunits(name) for name in units} == units


def test_the_table_in_docs_is_that_of_the_definitions():
    docs = Path(__file__).parents[1] / "docs"
    made = runpy.run_path(str(docs / "quantities.py"))["text"]()
    assert (docs / "quantities.md").read_text(encoding="utf-8") == made
    for name in (*results.COLUMNS, *results.LEDGER_COLUMNS, *names.KNOWN, "clogging_time_h", "remeshed_nodes"):
        assert f"| `{name}` |" in made


@pytest.mark.parametrize("content", ["", "<VTKFile", '<VTKFile type="UnstructuredGrid"/>'])
def test_broken_fields_are_an_error_and_no_page(paper, tmp_path, content):
    copy = shutil.copytree(paper, tmp_path / "run")
    (copy / "fields/fields_0005.vtu").write_text(content)
    (copy / "report.html").unlink()
    with pytest.raises(ValueError, match="fields cannot be read"):
        report.write(copy)
    assert not (copy / "report.html").exists()


def test_the_state_before_an_expansion_is_shown_ahead_of_that_after_it(tmp_path):
    """Both at the same time, and the page says which is which."""
    folder = run(tmp_path, "base", "growth.end=0.6 h", 'output.times=["0 h", "0.4 h", "0.6 h"]')
    packed = stored(folder)
    told = [(frame["time"], frame.get("note")) for frame in packed["frames"]]
    assert told == [(0, None), (0.4, fields.BEFORE), (0.4, None), (0.6, fields.BEFORE), (0.6, None)]
    before, after = packed["frames"][1:3]
    assert before["values"]["theta"][1] > after["values"]["theta"][1] or before["points"] != after["points"]
    assert "all 3 times shown, those grown and not yet expanded besides" in text_of(folder)


def test_warnings_come_first_and_then_what_is_assumed(tmp_path):
    """On the first screen, ahead of fields and charts."""
    text = text_of(run(tmp_path / "one", "base", "growth.end=0.2 h", "kinetics.yield_coefficient=0.5"))
    places = [text.index(words) for words in ("kinetics.acceptor_to_donor_ratio</b>", "Assumed: ", "Fields and mesh")]
    assert places == sorted(places) and "traction on the aggregate neglected" in text and "quasi-steady" in text
    text = text_of(run(tmp_path / "two", "flow_only"))
    assert "quasi-steady" not in text and "traction" not in text and "Assumed: a pore in the plane" in text


def regular(monkeypatch, most):
    """Points and triangles of the page's own grid over 100 um by 50 um, of about so many nodes."""
    with monkeypatch.context() as patch:
        patch.setattr(fields, "MOST_NODES", most)
        return fields._regular(np.zeros(2), np.array([100.0, 50.0]))


@pytest.mark.parametrize("kind, count", [("triangle", 101_000), ("triangle6", 26_000)])
def test_a_page_of_a_fine_mesh_is_small_and_true(tmp_path, monkeypatch, kind, count):
    """1e5 nodes in several times take 3 MB at most; values on the grid are those of the mesh."""
    points, cells = regular(monkeypatch, count)
    if kind == "triangle6":
        made = curved(Mesh.of(points, cells, np.zeros(len(cells), bool), np.empty(0, int), 50.0, (0.0, 100.0)), None)
        points, cells = made.points, made.cells
    x, y = points.T
    region = (np.hypot(points[cells[:, :3], 0].mean(1) - 50, points[cells[:, :3], 1].mean(1)) < 20).astype(float)
    nodal = {name: 3 * x - 2 * y for name in ("head_cm", "acceptor_mg_per_L", "donor_mg_per_L", "active_biomass",
                                              "inert_biomass", "pressure_MPa")}
    nodal["velocity_m_per_d"] = np.column_stack([x, y, 0 * x])
    celled = {name: [region] for name in ("region", "theta", "J", "largest_principal_stress_MPa", "stress_xx_MPa")}
    path = tmp_path / "0.vtu"
    vtu.write(path, Grid(np.column_stack([x, y, 0 * x]), [Cells(kind, cells)], nodal, celled))
    entries = [(float(k), path) for k in range(5)]
    packed = fields.packed(entries, entries)
    assert len(json.dumps(packed)) < 3e6 - 200e3 and packed["nodes"] == len(points) >= 1e5
    frame, mesh = packed["frames"][-1], packed["meshes"][0]
    assert len(packed["frames"]) >= 2 and mesh["per"] == 3
    there = places(packed, frame)[0]
    assert np.abs(values(frame["values"]["head_cm"]) - there @ [3, -2]).max() < 0.02
    shown = there[numbers(mesh["cells"], "<u4").reshape(-1, 3)].mean(axis=1)
    away = np.hypot(shown[:, 0] - 50, shown[:, 1])
    assert ((numbers(mesh["body"], "<u1") == 1) == (away < 20))[np.abs(away - 20) > 1].all()


def test_stages_are_parts_of_the_whole_time_the_longest_first():
    """Of which those that took none are left out."""
    made = run_page._bars({"flow": 1.0, "none": 0.0, "growth": 3.0}, 6.0)
    assert re.findall('<text x="0"[^>]*>([^<]*)<', made) == ["growth", "flow"]
    assert re.findall('<rect [^>]*width="([^"]*)"', made) == ["75.0", "25.0"]
    assert re.findall(">([0-9.]+) s<", made) == ["3", "1"]


def test_each_frame_has_the_aggregate_of_its_own_time(tmp_path):
    """Though all have the same triangles, as on the page's own grid."""
    points = np.array([[0, 0, 0], [3, 0, 0], [0, 2, 0], [3, 2, 0]], float)
    regions, entries = [[1, 0], [1, 1], [0, 1], [1, 0]], []
    for k, region in enumerate(regions):
        entries.append((float(k), tmp_path / f"{k}.vtu"))
        vtu.write(entries[-1][1], Grid(points, [Cells("triangle", np.array([[0, 1, 2], [1, 3, 2]]))],
                                       cell_data={"region": [np.array(region, float)]}))
    packed = fields.packed(entries)
    bodies = [numbers(packed["meshes"][frame["mesh"]]["body"], "<u1").tolist() for frame in packed["frames"]]
    assert bodies == regions and len(packed["meshes"]) == 3


def test_a_page_of_many_rows_and_frames_is_small(fast, tmp_path, monkeypatch):
    """A thousand rows and steps of forty meshes that are shown as they are: 3 MB at most with its charts, which
    take a third."""
    copy = shutil.copytree(fast, tmp_path / "run")
    digits = np.random.default_rng(0)
    for name, times in (("timeseries", ["time_h"]), ("ledger", ["start_h", "end_h"])):
        table = results.read_table(copy / f"{name}.csv")
        rows = {column: digits.uniform(0.1, 1.0, 1500) for column in table}
        rows |= {column: np.linspace(0, 30, 1500) + 0.01 * k for k, column in enumerate(times)}
        results.write_table(copy / f"{name}.csv", list(rows), np.column_stack(list(rows.values())).tolist())
    points, cells = regular(monkeypatch, 2500)
    region = (points[cells[:, 0], 0] > 50).astype(float)
    nodal = {name: digits.uniform(size=len(points)) for name in fields.SHOWN[1:6]}
    for k in range(40):  # each mesh is another one
        celled = {name: [np.roll(region, k)] for name in ("region", "theta", "J")}
        vtu.write(copy / f"fields/fields_{k:04d}.vtu",
                  Grid(np.pad(points, ((0, 0), (0, 1))), [Cells("triangle", np.roll(cells, k, 0))], nodal, celled))
    results.write_index(copy / "fields.pvd", [(float(k), f"fields/fields_{k:04d}.vtu") for k in range(40)])
    report.write(copy)
    packed = stored(copy)
    assert packed["nodes"] == len(points) and 5 < len(packed["frames"]) < 20
    assert 2e6 < (copy / "report.html").stat().st_size <= 3e6
    assert len(re.findall('data-chart="', text_of(copy))) == len(quantities.KINDS)
