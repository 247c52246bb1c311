"""Outlines of aggregates: from results, over images, and from files of polygons and masks."""

import json

import matplotlib.pyplot as plt
import numpy as np
import pytest
import shapely
from PIL import Image

import repro
from repro.cli import main
from repro.results import COLUMNS, drawing
from tests import faults

pytestmark = pytest.mark.usefixtures("close_figures")

SHORT = {"numerics.preset": "fast", "growth.end": "0.4 h", "output.every": "0.2 h"}
CLEAN = {"pore": {"width": "50 um"}, "flow": {"head": "1 mm"}}
TWO = {"pore": {"width": "50 um"}, "flow": {"mean_velocity": "2 m/day"}, "numerics": {"extent": "full"},
       "aggregate": [{"radius": "6 um", "position": "-30 um", "name": "first"},
                     {"radius": "9 um", "position": "20 um", "wall": "upper"}]}


@pytest.fixture(scope="module", params=["fast", "paper"])
def results(request):
    return repro.solve("base", {**SHORT, "numerics.preset": request.param})


def test_an_outline_is_that_of_the_pore(results):
    """From the upstream end to the downstream one, with the reported area; as wide and high as reported."""
    for row, time in enumerate(results.time):
        outline = np.asarray(results.outline(time))
        assert outline.shape[1] == 2 and len(results.outline(time)) == len(outline)
        assert outline[[0, -1], 1].tolist() == [0, 0] and outline[0, 0] < outline[-1, 0]
        assert outline[:, 1].max() == pytest.approx(results["thickness_um"][row], rel=1e-4)
        assert (outline[0, 0], outline[-1, 0]) == pytest.approx(
            (results["upstream_um"][row], results["downstream_um"][row]), rel=1e-4)
        # 16 lines an arc leave out 1/256 of its sag; a seed of 8 arcs has a sag of 2 % of its radius
        area = results.outline(time).to_shapely().area
        assert area == pytest.approx(results["aggregate_area_um2"][row], rel=2e-4)


def test_an_outline_is_accepted_by_a_scene(results):
    outline = results.outline("0.4 h")
    scene = repro.load_scene("base", {"aggregate.outline": outline}, unset=["aggregate.radius"])
    assert np.array_equal(scene.aggregate.outline, np.asarray(outline))
    assert np.asarray(outline, dtype=np.float32).dtype == np.float32


@pytest.mark.parametrize("body, wall, middle, radius", [
    ("first", 0, -30, 6), (1, 0, -30, 6), ("2", 50, 20, 9), (2, 50, 20, 9)])
def test_one_of_several_outlines_has_a_name_or_a_number(body, wall, middle, radius):
    outline = np.asarray(repro.solve(TWO).outline(0, body))
    assert outline[[0, -1]] == pytest.approx(np.array([[middle - radius, wall], [middle + radius, wall]]))
    assert np.hypot(*(outline - [middle, wall]).T) == pytest.approx(radius, rel=1e-3)


@pytest.mark.parametrize("call, error, message", [
    (lambda: repro.solve(TWO).outline(0), ValueError, "body: one of first, 2 is needed, not None"),
    (lambda: repro.solve(TWO).outline(0, 3), ValueError, "body: one of first, 2 is needed, not 3"),
    (lambda: repro.solve(CLEAN).outline(0), KeyError, "outline: there is no aggregate 1 at t = 0 h"),
    (lambda: repro.solve(CLEAN).plot("outlines"), KeyError, "outlines: this run has no aggregate")])
def test_an_outline_that_is_not_there_is_refused(call, error, message):
    with pytest.raises(error, match=message):
        call()


def test_an_aggregate_across_the_pore_has_its_contact_in_its_outline():
    """Its area lies between both walls."""
    points = [["-9 um", "0 um"], ["-6 um", "50 um"], ["8 um", "50 um"], ["9 um", "0 um"]]
    across = repro.solve("base", {"aggregate.outline": points, "growth.end": "0 h"}, unset=["aggregate.radius"])
    outline = np.asarray(across.outline(0))
    assert outline[outline[:, 1] == 50][:, 0].tolist()[::len(outline) or 1][0] == -6
    assert across.outline(0).to_shapely().area == pytest.approx(50 * 16)


def test_outlines_lie_over_an_image(results, tmp_path):
    """In the coordinates of the pore, whatever the unit; at the times that are asked for."""
    Image.fromarray(np.full((20, 40), 99, np.uint8)).save(tmp_path / "photo.png")
    over = {"image": tmp_path / "photo.png", "um_per_pixel": 2.5}
    ax = results.plot("outlines", time=[0, "12 min"], cmap="autumn", title="mine", **over)
    drawn = ax.collections[-1]
    assert len(drawn.get_segments()) == 2 and drawn.get_array().tolist() == [0, 0.2]
    assert np.array_equal(drawn.get_segments()[1], np.asarray(results.outline(0.2)))
    assert tuple(ax.images[0].get_extent()) == (-50, 50, 0, 50) and ax.get_title(loc="left") == "mine"
    ax = results.plot("outlines", unit="mm", corner=(-10, 5), **over)
    assert ax.images[0].get_extent() == pytest.approx((-0.01, 0.09, 0.005, 0.055)) and ax.get_xlabel() == "x (mm)"
    assert ax.collections[-1].get_segments()[0].max() == pytest.approx(0.005)
    assert len(results.plot("outlines", time=0.4).collections[-1].get_segments()) == 1


@pytest.mark.parametrize("keywords, error, message", [
    ({"name": "outlines", "image": "photo.png"}, ValueError, "um_per_pixel: a number greater than zero is needed"),
    ({"name": "outlines", "um_per_pixel": 0.5}, ValueError, "um_per_pixel: a number greater than zero is needed with"),
    ({"name": "thickness", "image": "photo.png"}, ValueError, 'image, um_per_pixel, corner: "outlines" are drawn over'),
    ({"name": "outlines", "image": np.ones((2, 2)), "um_per_pixel": 1, "corner": (1,)}, ValueError, "corner: a place"),
    ({"name": "thickness", "unit": "s"}, ValueError, "unit: 's': a unit of thickness_um, such as um, is needed"),
    ({"unit": "mm"}, ValueError, "unit: the name of a column is needed"),
    ({"name": "acceptor", "time": [0, 0.2]}, TypeError, "plot: time: one time of a field is needed")])
def test_a_wrong_picture_is_refused(results, keywords, error, message):
    with pytest.raises(error, match=message):
        results.plot(**keywords)


def test_a_quantity_is_shown_in_a_unit_and_on_a_scale_of_choice(results):
    ax = results.plot("conductivity", unit="cm/s", log=True)
    values = ax.lines[0].get_ydata()
    assert values == pytest.approx(results["conductivity_m_per_d"] * 100 / 86400, rel=1e-14)
    assert ax.get_yscale() == "log" and ax.get_ylabel() == "conductivity\n(cm/s)"
    ax = results.plot("acceptor", unit="ug/L", log=True, cmap="magma", title="oxygen")
    image = ax.collections[0]
    assert image.cmap.name == "magma" and type(image.norm).__name__ == "LogNorm"
    assert image.get_clim()[1] == pytest.approx(1e3 * results.fields(0.4)["acceptor_mg_per_L"].max())
    assert ax.get_title(loc="left") == "oxygen: acceptor (ug/L)"


@pytest.mark.parametrize("values, scale", [
    ([1, 99.9], "linear"), ([1, 100], "log"), ([0, 100], "linear"), ([-1, 100], "linear"),
    ([np.nan, np.nan], "linear")])
def test_an_axis_is_logarithmic_from_two_decades_on(values, scale):
    rows = [dict.fromkeys(COLUMNS) | {"time_h": float(k), "head_loss_cm": value, "nodes": 1}
            for k, value in enumerate(values)]
    ax = repro.Results("x", rows, [], "completed").plot("head_loss")
    assert ax.get_yscale() == scale


def test_a_curved_outline_is_drawn_as_a_curve():
    """Middles of edges lie off their chords, and points between lie on the arc."""
    run = repro.solve("base", {**SHORT, "growth.end": "0 h"})
    lines = np.array(run.plot("acceptor").collections[1].get_segments())
    assert lines.shape[1] == 17 and np.hypot(*lines.reshape(-1, 2).T) == pytest.approx(5, rel=1e-3)


@pytest.fixture
def stand_in_ffmpeg(tmp_path, monkeypatch):
    """A program that writes its last argument from the frames that it reads."""
    program = tmp_path / "ffmpeg"
    program.write_text('#!/bin/sh\nfor file; do :; done\nwc -c > "$file"\n')
    program.chmod(0o755)
    monkeypatch.setitem(plt.rcParams, "animation.ffmpeg_path", str(program))
    return tmp_path


def test_a_film_may_be_an_mp4(results, stand_in_ffmpeg):
    file = stand_in_ffmpeg / "film.mp4"
    ax = results.animate("acceptor", file, unit="ug/L", title="oxygen")
    size = np.prod(ax.figure.get_size_inches() * drawing.RESOLUTION // 1)
    assert int(file.read_text()) == len(results.time) * size * 4
    assert ax.get_title(loc="left") == "oxygen, t = 0.4 h: acceptor (ug/L)"


def test_a_film_as_mp4_needs_ffmpeg(results, monkeypatch, tmp_path):
    monkeypatch.setitem(plt.rcParams, "animation.ffmpeg_path", str(tmp_path / "none"))
    with pytest.raises(ImportError, match="the program ffmpeg is not installed; a film as .gif needs none"):
        results.animate("acceptor", tmp_path / "film.mp4")
    assert list(tmp_path.iterdir()) == []


def test_the_command_lists_and_draws(tmp_path, capsys):
    repro.run("base", tmp_path / "run", SHORT)
    assert main(["plot", str(tmp_path / "run")]) == 0
    listed = capsys.readouterr().out
    assert all(f"{name} " in listed for name in ("thickness_um", "acceptor_mg_per_L", "outlines"))
    Image.fromarray(np.full((20, 40), 99, np.uint8)).save(tmp_path / "photo.png")
    out = tmp_path / "outlines.png"
    assert main(["plot", str(tmp_path / "run"), "outlines", "--time", "0", "--time", "24 min", "--image",
                 str(tmp_path / "photo.png"), "--um-per-pixel", "2.5", "--corner", "-50", "0", "--out", str(out)]) == 0
    assert out.exists()
    with pytest.raises(SystemExit):
        main(["plot", str(tmp_path / "run"), "outlines"])
    assert "--out FILE is needed with QUANTITY" in capsys.readouterr().err


# ---------------------------------------------------------------- files

RING = [[-10, 0], [10, 0], [5, 12], [0, 15], [-10, 0]]
LINE = ((-10, 0), (0, 15), (5, 12), (10, 0))


def geojson(folder, geometry, **more):
    path = folder / "colony.geojson"
    path.write_text(json.dumps({**geometry, **more}))
    return path


def table(folder, ring, head=""):
    path = folder / "colony.csv"
    path.write_text(head + "".join(f"{x},{y}\n" for x, y in ring))
    return path


def mask(folder, inside, value=255):
    path = folder / "mask.png"
    Image.fromarray((inside * value).astype(np.uint8)).save(path)
    return path


def from_file(path, scale=1.0, **changes):
    return repro.load_scene({"pore": {"width": "50 um", "length": "600 um"}, "flow": {"head": "1e-3 cm"}, "aggregate": {
        "outline": {"file": str(path), "um_per_unit": scale}, **changes}}).aggregate.outline


def disc(radius=12.0, pixel=0.25, shape=(200, 400)):
    """(rows, columns) True in a half-disc (um) on the lower edge."""
    row, column = np.indices(shape)
    return np.hypot((column + 0.5 - shape[1] / 2), shape[0] - row - 0.5) * pixel < radius


@pytest.mark.parametrize("ring", [RING, RING[::-1], [*RING[2:-1], *RING[:3]], [[x, y + 0.04] for x, y in RING]])
def test_a_polygon_becomes_the_line_on_its_wall(tmp_path, ring):
    """Whatever its first point and its direction; points within a thousandth of the width are on the wall."""
    line = np.array(from_file(table(tmp_path, ring, "x,y\n")))
    assert line == pytest.approx(np.array(LINE), abs=0.05) and line[[0, -1], 1].tolist() == [0, 0]
    polygon = {"type": "Polygon", "coordinates": [ring]}
    for content in (polygon, {"type": "Feature", "geometry": polygon},
                    {"type": "FeatureCollection", "features": [{"geometry": polygon}]},
                    {"type": "MultiPolygon", "coordinates": [[[[*point, 7.0] for point in ring]]]}):
        assert from_file(geojson(tmp_path, content)) == from_file(table(tmp_path, ring))


def test_a_scale_and_the_upper_wall(tmp_path):
    assert from_file(table(tmp_path, [[x / 10, y / 10] for x, y in RING]), 10) == LINE
    ring = [[x, 50 - y] for x, y in RING]
    assert from_file(table(tmp_path, ring), wall="upper") == tuple((x, 50.0 - y) for x, y in LINE)


@pytest.mark.parametrize("value", [1, 255])
def test_a_mask_becomes_a_smooth_line(tmp_path, value):
    """The area errs by less than half a pixel along the line; the line is within 1.5 pixels of the circle."""
    line = np.array(from_file(mask(tmp_path, disc(), value), 0.25))
    assert line[[0, -1]].tolist() == [[-12, 0], [12, 0]] and len(line) < 30
    assert shapely.Polygon(line).area == pytest.approx(np.pi * 72, abs=0.5 * 0.25 * np.pi * 12)
    assert abs(np.hypot(*line.T) - 12).max() < 1.5 * 0.25
    upper = np.array(from_file(mask(tmp_path, disc()[::-1], value), 0.25, wall="upper"))
    assert upper == pytest.approx(np.column_stack([line[:, 0], 50 - line[:, 1]]))


def test_a_mask_across_the_pore_keeps_its_contact(tmp_path):
    columns = np.abs(np.arange(400) + 0.5 - 200) < 36
    assert from_file(mask(tmp_path, np.tile(columns, (200, 1))), 0.25) == ((-9, 0), (-9, 50), (9, 50), (9, 0))


def test_a_file_is_beside_the_scene_and_an_override_in_the_present_folder(tmp_path, monkeypatch, capsys):
    """The command line reads it, and the run has its points."""
    (tmp_path / "scenes").mkdir()
    table(tmp_path / "scenes", RING)
    scene = tmp_path / "scenes" / "mine.toml"
    scene.write_text('[pore]\nwidth = "50 um"\n[aggregate]\noutline = { file = "colony.csv", um_per_unit = 1 }\n')
    monkeypatch.chdir(tmp_path)
    assert repro.load_scene(scene).aggregate.outline == LINE
    assert main(["run", str(scene), "--out", "run", "--quiet"]) == 0
    table(tmp_path, [[2 * x, y] for x, y in RING])
    assert main(["check", str(scene), "--no-run", "--set",
                 'aggregate.outline={file = "colony.csv", um_per_unit = 100}']) == 2
    assert "um_per_unit it is from 0 to 1500 um" in capsys.readouterr().err
    text = (tmp_path / "run" / "run.json").read_text()
    assert "15.0 um" in text and "um_per_unit" not in text


CROSSED = [[-10, 0], [10, 0], [-5, 12], [5, 12], [-10, 0]]
POLYGON = {"type": "Polygon"}


@pytest.mark.parametrize("write, scale, message", [
    (lambda to: table(to, RING[:-1]), 1, "a closed ring is needed: its first point is also its last one"),
    (lambda to: geojson(to, POLYGON, coordinates=[RING, RING]), 1, "without holes is needed, not 2 rings"),
    (lambda to: geojson(to, {"type": "MultiPolygon"}, coordinates=[[RING], [RING]]), 1, "one polygon is needed, not 2"),
    (lambda to: geojson(to, {"type": "FeatureCollection"}, features=[]), 1, "one polygon is needed, not 0"),
    (lambda to: geojson(to, {"type": "LineString"}, coordinates=RING), 1, "a polygon is needed, closed"),
    (lambda to: geojson(to, POLYGON, coordinates=[[[1, "a"]]]), 1, "a polygon is needed, closed"),
    (lambda to: table(to, CROSSED), 1, "a polygon that does not cross itself is needed"),
    (lambda to: table(to, [[x, y + 1] for x, y in RING]), 1, r"on its wall \(y = 0 um\) is needed; .* in 0 places"),
    (lambda to: table(to, RING), 4, "y from 0 to 50 um, is needed; with this um_per_unit it is from 0 to 60 um"),
    (lambda to: table(to, RING), 40, "with this um_per_unit it is from 0 to 600 um"),
    (lambda to: table(to, [[x + 400, y] for x, y in RING]), 1, r"\|x\| < half of pore.length"),
    (lambda to: table(to, RING), 1e-3, "a larger um_per_unit is needed: the polygon is 0.015 um high"),
    (lambda to: table(to, RING), 0, "um_per_unit, the length of a unit or pixel in um, is a plain number"),
    (lambda to: table(to, RING), "1 um", "um_per_unit, the length of a unit or pixel in um, is a plain number"),
    (lambda to: mask(to, disc() & False), 0.25, "the mask is empty"),
    (lambda to: mask(to, disc() | True), 0.25, "water at an end of the mask is needed"),
    (lambda to: mask(to, ~disc()), 0.25, "water at an end of the mask is needed"),
    (lambda to: mask(to, disc()[::-1]), 0.25, 'in 0 places, and the other one, for which wall = "upper" is needed'),
    (lambda to: mask(to, disc() ^ disc(3)), 0.25, "in 2 places"),
    (lambda to: mask(to, disc() ^ np.roll(disc(3), -20, axis=0)), 0.25, "a mask without holes is needed"),
    (lambda to: mask(to, disc() | disc()[::-1]), 0.25, "one polygon is needed, not 2"),
    (lambda to: mask(to, disc()), 0.5, "the mask is 100 um high and the pore 50 um: crop it at the walls"),
    (lambda to: mask(to, np.roll(disc(), -4, axis=0)), 0.25, "a mask without|one polygon|in 0 places"),
    (lambda to: to / "none.csv", 1, "cannot be read"), (lambda to: to / "colony.dxf", 1, "a file that ends in"),
    (lambda to: table(to, RING).rename(to / "colony.png"), 1, "cannot be read")])
def test_a_file_without_an_outline_in_the_pore_is_refused_in_one_line(tmp_path, write, scale, message):
    with pytest.raises(repro.SceneError, match=f"^scene: aggregate.outline = .*{message}") as caught:
        from_file(write(tmp_path), scale)
    assert "\n" not in str(caught.value)


def test_a_file_needs_its_scale():
    with pytest.raises(repro.SceneError, match="is needed, such as .*; a file has the keys file and um_per_unit"):
        repro.load_scene({"aggregate": {"outline": {"file": "colony.csv"}}})


def test_a_mask_needs_pillow(tmp_path, monkeypatch):
    path = mask(tmp_path, disc())
    faults.remove_package(monkeypatch, "PIL.Image")
    with pytest.raises(repro.SceneError, match="the package pillow is not installed; pip install pillow"):
        from_file(path, 0.25)
