"""The pages of runs: their content, that they need no other file, and that they escape all foreign text."""

import html
import json
import re
import runpy
import shutil
from pathlib import Path

import numpy as np
import pytest
import shapely

from repro import report, results
from repro.model import growth
from repro.preflight.modelled import describe_model
from repro.report import comparison, fields, quantities, run_page
from repro.report.reading import Run, read
from repro.results import field_files, names
from repro.results.arrays import ARRAYS
from repro.results.field_files import Grid
from repro.results.quantities import ending
from tests.pages import (
    FAST,
    HOSTILE,
    NODE,
    Page,
    check_alone,
    decode_numbers,
    evaluate,
    first_group,
    make_hostile,
    page_data,
    run,
    text_of,
)


def test_every_run_has_a_self_contained_page(fast, paper, flow_only):
    for out in (fast, paper, flow_only):
        page = check_alone(text_of(out))
        assert page.outside == [] and {kind for kind, _, _ in page.scripts} == {"style", "script"}


@pytest.mark.parametrize("name", ["fast", "paper"])
def test_numbers_are_those_of_the_first_and_the_last_row(request, name):
    """The page's table has them to four digits."""
    out = request.getfixturevalue(name)
    panel = first_group("<h2>Numbers</h2>(.*?)</table>", text_of(out))
    lines = [re.findall("<td.*?>(.*?)</td>", row) for row in re.findall("<tr>(.*?)</tr>", panel)[1:]]
    cells = {html.unescape(label): first_last for label, *first_last in lines}
    series = results.read_table(out / "timeseries.csv")
    times = series.pop("time_h")
    series = {name: values for name, values in series.items() if np.isfinite(values).any()}
    kind = {"fast": "Quadratic triangles, drawn curved", "paper": "Linear triangles"}[name]
    record = read(out).record
    for expected in (kind, f"{record['wall_time_s']:.3g} s in all", '<td>width</td><td class="value">50 um<',
                 f'meshes</td><td class="value">{record["remeshes"]}<', f'hash</td><td class="value">{record["hash"]}<',
                 f"{len(times)} rows, to t = {times[-1]:g} h."):
        assert expected in text_of(out)
    assert re.findall("t = ([^ ]*) h", panel) == [f"{times[k]:.6g}" for k in (0, -1)] and len(times) > 2
    assert cells.keys() == set(map(names.with_unit, series)) and (series["conductivity_m_per_d"] > 0).all()
    for column, values in series.items():
        first_last = cells[names.with_unit(column)]
        if column in ("remeshed", "contact"):
            assert first_last == ["yes" if value else "no" for value in values[[0, -1]]]
        else:
            assert list(map(float, first_last)) == pytest.approx(values[[0, -1]], rel=5.1e-4), column


def test_the_page_leaves_out_physics_that_is_not_modelled(flow_only, fast):
    """Assumptions about the modelled physics stand before fields and charts."""
    text, packed = text_of(flow_only), page_data(flow_only)
    assert "no growth: only the state at t = 0" in text and "acceptor" not in text.split("<script>")[0]
    assert [(field["name"], field["unit"]) for field in packed["fields"]] == [
        ("velocity_m_per_d", "m/day"), ("head_cm", "cm"), ("region", "")]
    assert "data-chart" not in text.split("<script")[0]
    assert '<div class="time" hidden>' in text
    page_of_growth = text_of(fast)
    assert "no growth" not in page_of_growth and '<div class="time">' in page_of_growth
    head = page_of_growth[page_of_growth.index("Modelled, by"): page_of_growth.index("Fields and mesh")]
    for section, words in describe_model(read(fast).scene):
        assert f"<li><b>{section}</b>: {html.escape(words)}</li>" in head
    for words in ("fluid forces neglected", "steady in each shape"):
        assert words in head and words not in text


@pytest.mark.parametrize("stress, shown, unit", [
    (2.5, 2.5, "MPa"), (1.01, 1.01, "MPa"), (0.99, 990.0, "kPa"), (0.00101, 1.01, "kPa"), (0.00099, 990.0, "Pa"),
    (-0.0137, -13.7, "kPa"), (1.3e-6, 1.3, "Pa"), (3e-9, 0.003, "Pa"), (0.0, 0.0, "MPa")])
def test_pages_show_small_stresses_in_a_smaller_unit(stress, shown, unit):
    """It is the largest unit in which the largest value, of either sign, is at least one. The numbers, the charts and
    a comparison have it."""
    series = {"time_h": np.array([0.0, 3.0]), "tensile_stress_max_MPa": np.array([np.nan, stress]),
              "wall_traction_max_MPa": np.array([0.1 * stress, stress])}
    record = {"scene": "one", "status": "completed", "tables": {}}
    one, other = Run(Path("one"), record, series, {}), Run(Path("other"), record, series, {})
    pattern = f"largest traction that a wall must bear .{unit}.<(.*?)</tr>"
    first_last = re.findall('class="value">([^<]*)<', first_group(pattern, run_page._numbers(one)))
    assert list(map(float, first_last)) == pytest.approx([0.1 * shown, shown])
    compared = re.findall('class="value">([^<]*)<', first_group(pattern, comparison.build([one, other])))
    assert list(map(float, compared[:2])) == pytest.approx([shown, shown])
    for chart in (*quantities.charts_of(one), *quantities.overlaid([one, other], ["one", "other"])):
        assert chart.axis == f"stress ({unit})"
        assert all(line.values[-1] == pytest.approx(shown) for line in chart.lines)


def test_each_frame_is_drawn_on_its_own_mesh(fast, paper):
    """The first mesh has triangles of six nodes, the second of three."""
    packed = fields.packed([*fields.index(fast)[:1], *fields.index(paper)[:1]])
    assert [packed["meshes"][frame["mesh"]]["per"] for frame in packed["frames"]] == [6, 3]


def places(packed, frame):
    """(N, 2) um, the nodes of a frame, and the sides of the box around all frames."""
    low, high = np.array(packed["box"]).reshape(2, 2).T
    return low + values((0.0, 1.0, frame["points"])).reshape(-1, 2) * (high - low), high - low


def values(packed_array):
    """The values of an array that is packed as least, largest and levels."""
    low, high, text = packed_array
    return low + decode_numbers(text, "<u2") / 65534 * (high - low)


@pytest.mark.parametrize("name", ["fast", "paper"])
def test_fields_of_the_page_are_those_of_the_files(request, name):
    """Each array agrees to half of its 65534 levels, on the nodes of the mesh."""
    out = request.getfixturevalue(name)
    packed, entries = page_data(out), fields.index(out)
    assert packed["of"] == len(entries) == len(packed["frames"])
    for frame, (time, path) in zip(packed["frames"], entries):
        grid, mesh = field_files.read(path), packed["meshes"][frame["mesh"]]
        cells = grid.cells
        assert frame["time"] == time and mesh["per"] == cells.shape[1] == {"fast": 6, "paper": 3}[name]
        assert (decode_numbers(mesh["cells"], "<u4").reshape(cells.shape) == cells).all()
        region = decode_numbers(mesh["body"], "<u1") == 1
        assert (region == grid.cell_data["region"]).all() and region.any() and not region.all()
        points, box = places(packed, frame)
        assert np.abs(points - grid.points[:, :2]).max() <= 0.51 / 65534 * box.max()
        nodes = np.unique(cells[region])
        for field in packed["fields"]:
            packed_array = frame["values"][field["name"]]
            low, high = packed_array[:2]
            node = field["at"] == "node"
            value = grid.point_data[field["name"]] if node else grid.cell_data[field["name"]]
            value = np.linalg.norm(value, axis=1) if value.ndim == 2 else value
            value = value[nodes if node else region] if field["body"] else value
            value = value * {"kPa": 1e3, "Pa": 1e6}.get(field["unit"], 1.0)
            assert (low, high) == (value.min(), value.max())
            assert np.abs(values(packed_array) - value).max() <= 0.51 / 65534 * (high - low)


def test_many_frames_are_thinned_and_the_page_says_so(paper, tmp_path, monkeypatch):
    """The first and the last frame are always shown."""
    copy = shutil.copytree(paper, tmp_path / "run")
    for most, value, times in (("MOST_FRAMES", 3, [0, 0.4, 1.0]), ("MOST_BYTES", 1, [0, 1.0])):
        monkeypatch.setattr(fields, most, value)
        report.write(copy)
        assert [frame["time"] for frame in page_data(copy)["frames"]] == times
        assert f"{len(times)} of 6 times shown" in text_of(copy)
    assert "all 6 times shown" in text_of(paper)


def test_fields_are_read_from_the_runs_own_files_alone(paper, tmp_path):
    copy = shutil.copytree(paper, tmp_path / "run")
    (tmp_path / "fields").mkdir()
    shutil.copy(copy / "fields/fields_0000.vtu", tmp_path / "fields/fields_0000.vtu")
    results.write_index(copy / "fields.pvd", [(0.0, "../fields/fields_0000.vtu"), (1.0, "fields/fields_0001.vtu"),
                                              (2.0, str(tmp_path / "fields/fields_0000.vtu"))])
    assert [time for time, _ in fields.index(copy)] == [1.0]


def test_foreign_text_is_escaped(fast, tmp_path):
    """Names, status, keys, values, columns and folders are escaped."""
    copy = make_hostile(shutil.copytree(fast, tmp_path / "<b onclick=pwned=1>"))
    report.write(copy)
    report.compare([copy, fast], tmp_path / "both.html")
    for text in (text_of(copy), (tmp_path / "both.html").read_text()):
        page = Page(text)
        assert {tag for tag, _ in page.tags} <= {tag for tag, _ in Page(text_of(fast)).tags} | {"ul", "li", "b"}
        assert "<script>pwned" not in text and "<img" not in text and "<b onclick" not in text
        assert any(HOSTILE in text_node for text_node in page.texts)
        assert len(page.scripts) <= 6


def test_storage_is_drawn_only_if_it_is_not_zero(paper):
    assert "acceptor_stored_ug_per_m_per_h" not in quantities.series(read(paper))


@pytest.mark.thorough
def test_contact_is_marked(tmp_path):
    out = run(tmp_path, "wide", FAST, 'pore.width="20 um"', 'aggregate.radius="17.9 um"', 'growth.end="1 h"')
    series = results.read_table(out / "timeseries.csv")
    contact_time = series["time_h"][series["contact"] == 1][0]
    assert quantities.contact(read(out)) == [contact_time] and 0 < contact_time < series["time_h"][-1]
    text = text_of(out)
    assert f"contact with the opposite wall, t = {contact_time:.6g} h" in text and 'class="mark"' in text


def test_a_run_that_stops_has_its_page(tmp_path, monkeypatch):
    monkeypatch.setattr(growth, "MOST_ITERATIONS", 1)
    text = text_of(run(tmp_path, "base", status=1))
    assert "Failed: stopped in the step from t = 0 h, in growth: " in text
    Page(text)


#: The words for parts of a name; other parts occur in the long name as they are.
MEANING = {"out": "leaving", "effluent": "leaving", "consumed": "taken up", "min": "least", "max": "largest",
           "fraction": "part", "balance": "relative", "t0": "t = 0", "remeshed": "new mesh", "before": "start",
           "after": "end", "region": "aggregate (1)", "overshoot": "above"}
#: A name and its long name have the same word of each tuple, or none.
CONTRASTS = [("acceptor", "donor"), ("upstream", "downstream"), ("least", "largest"), ("active", "inert"),
             ("supplied", "leaving", "taken up", "stored"), (" xx", " yy", " zz", " xy")]


@pytest.mark.parametrize("name", names.KNOWN)
def test_the_long_name_of_a_quantity_agrees_with_its_name(name):
    """The long name, in NetCDF files, on pages and in `docs/quantities.md`, has each part of the name."""
    words = " " + names.words(name)
    parts = [MEANING.get(part, part) for part in name.removesuffix(ending(name)).split("_")]
    assert [part for part in parts if part.lower() not in words.lower()] == []
    name_text = " " + " ".join(parts)
    for contrast in CONTRASTS:
        pattern = r"\b(?:" + "|".join(each.strip() for each in contrast) + r")\b"
        used, meant = (set(re.findall(pattern, text)) for text in (words, name_text))
        assert used == meant, contrast


def test_no_two_columns_have_one_long_name():
    for columns in (results.COLUMNS, results.LEDGER_COLUMNS, [each.name for each in ARRAYS]):
        assert len({*map(names.words, columns)}) == len(columns)


def test_the_table_in_docs_is_that_of_the_definitions():
    docs = Path(__file__).parents[1] / "docs"
    text = runpy.run_path(str(docs / "quantities.py"))["text"]()
    assert (docs / "quantities.md").read_text(encoding="utf-8") == text
    for name in (*results.COLUMNS, *results.LEDGER_COLUMNS, *names.KNOWN, "clogging_time_h"):
        assert f"| `{name}` |" in text


def test_the_state_before_an_expansion_is_shown_before_that_after_it(tmp_path):
    """Both have the same time, and a note distinguishes them."""
    folder = run(tmp_path, "base", "growth.end=0.6 h", 'output.times=["0 h", "0.4 h", "0.6 h"]')
    packed = page_data(folder)
    frames = [(frame["time"], frame.get("note")) for frame in packed["frames"]]
    note = "before the expansion"
    assert frames == [(0, None), (0.4, note), (0.4, None), (0.6, note), (0.6, None)]
    before, after = packed["frames"][1:3]
    assert before["values"]["theta"][1] > after["values"]["theta"][1] or before["points"] != after["points"]
    assert "all 3 times shown, those grown and not yet expanded besides" in text_of(folder)


def regular_grid(monkeypatch, most):
    """Points and triangles of the page's grid over 100 um by 50 um, of about ``most`` nodes."""
    with monkeypatch.context() as patch:
        patch.setattr(fields, "MOST_NODES", most)
        return fields._regular(np.zeros(2), np.array([100.0, 50.0]))


def write_fields(path, points, cells, nodal, region):
    """Write a file of fields, in which all fields of triangles equal the region."""
    celled = dict.fromkeys(("region", "theta", "J", "largest_principal_stress_MPa", "stress_xx_MPa"), region)
    field_files.write(path, Grid(np.pad(points, ((0, 0), (0, 1))), cells, nodal, celled))


@pytest.mark.parametrize("count", [12_000, pytest.param(101_000, marks=pytest.mark.thorough)])
def test_a_page_of_a_fine_mesh_is_small_and_accurate(tmp_path, monkeypatch, count):
    """1e5 nodes at several times take at most 3 MB. Values on the grid are those of the mesh, and each frame has the
    aggregate of its own time, although all have the same triangles."""
    points, cells = regular_grid(monkeypatch, count)
    nodal = dict.fromkeys(("head_cm", "acceptor_mg_per_L", "donor_mg_per_L", "active_biomass", "inert_biomass",
                           "pressure_MPa"), points @ [3, -2])
    nodal["velocity_m_per_d"] = np.pad(points, ((0, 0), (0, 1)))
    middles, entries = points[cells].mean(axis=1), [(float(k), tmp_path / f"{k}.vtu") for k in range(3)]
    for time, path in entries:
        write_fields(path, points, cells, nodal, 1.0 * (np.hypot(middles[:, 0] - 50, middles[:, 1]) < 20 + 5 * time))
    packed = fields.packed(entries, entries)
    assert len(json.dumps(packed)) < 3e6 - 200e3 and packed["nodes"] == len(points) > count / 1.02
    assert len(packed["frames"]) >= 2
    for frame in packed["frames"]:
        mesh, nodes = packed["meshes"][frame["mesh"]], places(packed, frame)[0]
        assert mesh["per"] == 3 and np.abs(values(frame["values"]["head_cm"]) - nodes @ [3, -2]).max() < 0.02
        centres = nodes[decode_numbers(mesh["cells"], "<u4").reshape(-1, 3)].mean(axis=1)
        beyond = np.hypot(centres[:, 0] - 50, centres[:, 1]) - 20 - 5 * frame["time"]
        assert ((decode_numbers(mesh["body"], "<u1") == 1) == (beyond < 0))[np.abs(beyond) > 1].all()


needs_node = pytest.mark.skipif(NODE is None, reason="Node is not installed")
#: The drawn bands, as places of their colours and outlines, the script's data of the picture, and its place and scale.
BANDS = """({
    bands: part.picture.children.find(part => part.attributes.class === "bands").children.map(
        path => [data.colours.indexOf(path.attributes.fill), path.attributes.d]),
    area: areaOf(drawn.pieces), ...part.picture.dataset, box: data.box,
    unit: [drawn.edge.left, drawn.edge.top, drawn.scale, drawn.tall]})"""


def drawn_bands(page, field):
    """Return the script's data of the picture of a field, and the polygons of each colour."""
    drawn = evaluate(page, BANDS, f"#field={field}")
    outlines = {place: [np.array(re.split("[ L]", each), float).reshape(-1, 2) for each in outline[1:-1].split("ZM")]
                for place, outline in drawn["bands"]}
    return drawn, {place: list(map(shapely.Polygon, polygons)) for place, polygons in outlines.items()}


def in_pixels(drawn, points):
    """(N, 2) places (um) in the picture, rounded as its outlines are."""
    left, top, scale, tall = drawn["unit"]
    low_x, _, low_y, _ = drawn["box"]
    x, y = points.T
    pixels = np.column_stack([left + (x - low_x) * scale, top + tall - (y - low_y) * scale])
    return np.floor(10 * pixels + 0.5) / 10


@needs_node
@pytest.mark.parametrize("name", ["fast", "paper"])
def test_the_picture_is_the_field(request, name):
    """Values at the nodes, on straight and curved triangles; the coloured area of the aggregate; the colour of every
    part of the picture, to the width of a band and rounding to a tenth of a pixel."""
    out = request.getfixturevalue(name)
    page, (_, path) = out / "report.html", fields.index(out)[-1]
    grid = field_files.read(path)
    drawn, bands = drawn_bands(page, "acceptor_mg_per_L")
    middles = {place: [list(polygon.centroid.coords[0]) for polygon in polygons if polygon.area > 1]
               for place, polygons in bands.items()}
    places = json.dumps([*in_pixels(drawn, grid.points[:, :2]).tolist(), *sum(middles.values(), [])])
    script = f"{places}.map(([x, y]) => fieldAt(drawn.pieces, x, y))"
    computed = np.array(evaluate(page, script, "#field=acceptor_mg_per_L"), float)
    expected, span = grid.point_data["acceptor_mg_per_L"], drawn["high"] - drawn["low"]
    at_nodes, in_bands = np.split(computed, [len(expected)])
    inside = np.isfinite(at_nodes)  # nodes on the edge may be rounded to the outside
    assert inside.mean() > 0.8 and np.abs(at_nodes - expected)[inside].max() < 0.005 * span
    place = np.repeat([*middles], [*map(len, middles.values())])
    shares = (in_bands - drawn["low"]) / span
    assert len(place) > 1000 and np.abs(128 * shares - place - 0.5).max() < 0.6
    area = sum(polygon.area for polygons in bands.values() for polygon in polygons)
    assert area == pytest.approx(drawn["area"], rel=2e-3) and drawn["filled"] == pytest.approx(1, abs=1e-3)
    theta, _ = drawn_bands(page, "theta")
    low_x, high_x, low_y, high_y = theta["box"]
    expected_area = results.read_table(out / "timeseries.csv")["aggregate_area_um2"][-1]
    computed_area = theta["filled"] * (high_x - low_x) * (high_y - low_y)
    assert computed_area == pytest.approx(expected_area, rel=0.004 if name == "fast" else 0.02)


@needs_node
def test_colours_are_logarithmic_over_two_decades_or_more(flow_only, tmp_path, monkeypatch):
    """The head is exponential in x. Colours are linear below two decades, and cover at most four decades. A node is a
    corner of bands that may be neighbours of its own."""
    copy = shutil.copytree(flow_only, tmp_path / "run")
    ((_, file),) = fields.index(copy)
    points, cells = regular_grid(monkeypatch, 1000)
    for decades in (1.9, 2.1, 6.0):
        head = 10 ** (decades * points[:, 0] / 100)
        write_fields(file, points, cells, {"head_cm": head}, np.zeros(len(cells)))
        drawn, bands = drawn_bands(report.write(copy), "head_cm")
        part = decades * (points[:, 0] / 100 - 1)
        expected = 1 + part / min(decades, 4) if decades > 2 else (10**part - 10**-decades) / (1 - 10**-decades)
        colours = np.repeat([*bands], [*map(len, bands.values())])
        tree = shapely.STRtree([polygon for polygons in bands.values() for polygon in polygons])
        nodes, polygons = tree.query(shapely.points(in_pixels(drawn, points)), predicate="intersects")
        assert {*nodes} == {*range(len(points))}
        assert np.abs(colours[polygons] + 0.5 - 128 * np.maximum(expected, 0)[nodes]).max() < 1.6, decades


def test_a_value_that_is_not_finite_has_no_level():
    low, high, text = fields._levels(np.array([1.0, np.nan, 3.0, np.inf]))
    assert (low, high, decode_numbers(text, "<u2").tolist()) == (1.0, 3.0, [0, 65535, 65534, 65535])


@pytest.mark.parametrize("value, displayed", [(0.00123457, "0.00123457"), (True, "yes"), (False, "no"), (None, "none"),
                                         ("1234.56789 um", "1234.57 um"), ("a b", "a b"), ([], "none"),
                                         ([1.5, "2.0 h"], "1.5, 2 h")])
def test_a_value_is_shown_with_six_digits_and_its_unit(value, displayed):
    assert run_page.page.format_value(value) == displayed
