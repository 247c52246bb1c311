"""Pictures of results: curves, fields with the outline of the aggregate, films, and the command that draws them."""

import io

import matplotlib.pyplot as plt
import numpy as np
import pytest
from PIL import Image, ImageSequence

import repro
from repro.cli import main
from tests import faults
from tests.shell import refusal

pytestmark = pytest.mark.usefixtures("close_figures")

CONTACT = ['numerics.preset="fast"', 'aggregate.radius="17.98 um"', 'pore.width="20 um"', 'growth.end="0.6 h"',
           "output.every=0.2 h"]


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return repro.run("base", tmp_path_factory.mktemp("run"), CONTACT)


def test_curves_are_the_columns_with_the_time_of_contact(results):
    axes = results.plot()
    names = ["conductivity_m_per_d", "thickness_um", "effluent_acceptor_mg_per_L", "effluent_donor_mg_per_L"]
    lines = [axes[0].lines[0], axes[1].lines[0], *axes[2].lines[:2]]
    assert all(np.array_equal(line.get_ydata(), results[name]) for line, name in zip(lines, names))
    contact = results.time[results["contact"] == 1][0]
    assert [set(axis.lines[-1].get_xdata()) for axis in axes] == [{contact}] * 3
    assert [len(axis.lines) for axis in axes] == [2, 2, 3] and axes[0].get_ylabel() == "conductivity\n(m/day)"


def test_axes_are_accepted_and_returned(results):
    _, (one, two) = plt.subplots(2)
    assert results.plot("thickness", ax=one) is one and results.plot("acceptor", ax=two) is two
    assert len(one.lines) == 2 and len(plt.get_fignums()) == 1
    with pytest.raises(ValueError, match="ax: 3 axes are needed, not 1"):
        results.plot(ax=one)
    with pytest.raises(ValueError, match="time: thickness_um is drawn over all times; the name of a field is needed"):
        results.plot("thickness", time=0.2)


@pytest.mark.parametrize("preset", ["paper", "fast"])
@pytest.mark.parametrize("name", [
    "velocity_m_per_d", "J", *(pytest.param(name, marks=pytest.mark.thorough) for name in ("acceptor", "pressure"))])
def test_a_field_has_its_colours_and_the_outline(preset, name):
    """The outline lies on the interface: ends on the wall, top at the thickness, a chain without gaps."""
    run = repro.solve("base", [f"numerics.preset={preset}", "growth.end=0.2 h", 'output.times=["0.2 h"]'])
    ax = run.plot(name, time=0.2)
    fields = run.fields(0.2)
    values = next(fields[each] for each in fields if each.startswith(name))
    values = np.linalg.norm(values, axis=1) if values.ndim == 2 else values
    image, outline = ax.collections
    assert image.get_clim() == (np.nanmin(values), np.nanmax(values))
    lines = np.array(outline.get_segments())
    ends = lines[:, [0, -1]].reshape(-1, 2)
    places, counts = np.unique(ends, axis=0, return_counts=True)
    assert np.sort(counts).tolist() == [1, 1] + [2] * (len(lines) - 1)
    tips = [[run["upstream_um"][-1], 0], [run["downstream_um"][-1], 0]]
    assert np.allclose(sorted(places[counts == 1].tolist()), tips, atol=1e-6)
    assert lines[..., 1].max() == pytest.approx(run["thickness_um"][-1])
    assert ax.get_title(loc="left").startswith("base, t = 0.2 h: ") and ax.child_axes


@pytest.mark.thorough
def test_a_film_has_every_row_in_one_view_and_one_palette(results, tmp_path):
    """The pixels of the colour bar and of the axes do not change."""
    ax = results.animate("donor", tmp_path / "film.gif")
    with Image.open(tmp_path / "film.gif") as film:
        frames = np.array([np.asarray(frame.convert("RGB")) for frame in ImageSequence.Iterator(film)])
    assert len(frames) == len(results.time) and ax.get_title(loc="left").startswith("base, t = 0.6 h")
    width = frames.shape[2]
    right = frames[:, :, int(0.93 * width):]
    assert (right == right[0]).all() and len(np.unique(right[0].reshape(-1, 3), axis=0)) > 50
    assert (frames[0] != frames[-1]).any()


def test_a_film_has_the_colours_of_its_colour_bar_in_all_frames(tmp_path):
    """The values of the first frame fill a small part of the scale. All colours of the map are close to those drawn."""
    run = repro.solve("base", {"numerics.preset": "sketch", "growth.end": "6 h", "output.times": ["0 h", "6 h"]})
    axes = run.animate("acceptor", tmp_path / "film.gif")
    bar, figure = axes.child_axes[0].get_window_extent(), axes.figure.bbox
    with Image.open(tmp_path / "film.gif") as film:
        frames = [np.asarray(frame.convert("RGB"), float) for frame in ImageSequence.Iterator(film)]
    for frame in frames:
        scale = len(frame) / figure.height
        column = frame[:, round(scale * (bar.x0 + bar.x1) / 2)]
        inside = column[round(len(frame) - scale * bar.y1) + 2:round(len(frame) - scale * bar.y0) - 2]
        colours = 255 * plt.get_cmap()(np.linspace(1, 0, len(inside)))[:, :3]
        assert len(frames) == 2 and len(inside) > 100 and np.abs(inside - colours).max() < 20


def test_the_title_of_a_long_name_leaves_room_for_the_axes(results, monkeypatch):
    """The name of a file may have 240 letters."""
    monkeypatch.setattr(results, "name", "n" * 240)
    for axes in (results.plot()[0], results.plot("donor", time=0.2), results.plot("outlines")):
        axes.figure.canvas.draw()
        assert axes.get_title(loc="left").startswith("n" * 57 + "...")
        assert axes.get_window_extent().width > 0.5 * axes.figure.bbox.width


@pytest.mark.parametrize("call, error, message", [
    (lambda run, file: run.animate("donor", file.with_suffix(".avi")), ValueError, "that ends in .gif or .mp4"),
    (lambda run, file: run.animate("doner", file), KeyError, "no such column or field; did you mean donor"),
    (lambda run, file: repro.solve({"pore": {"width": "50 um"}}).plot(), KeyError, "no curves of flow"),
])
def test_a_wrong_request_is_refused_and_nothing_is_written(results, tmp_path, call, error, message):
    with pytest.raises(error, match=message):
        call(results, tmp_path / "film.gif")
    assert list(tmp_path.iterdir()) == []


def test_matplotlib_is_an_extra(results, monkeypatch, tmp_path, capsys):
    faults.remove_package(monkeypatch, "matplotlib.pyplot")
    message = "the package matplotlib is not installed; pip install matplotlib pillow"
    for draw in (results.plot, lambda: results.plot("donor"), lambda: results.animate("donor", tmp_path / "film.gif")):
        with pytest.raises(ImportError) as caught:
            draw()
        assert str(caught.value) == message
    assert message in refusal(tmp_path, capsys, "plot", results.folder, "--out", tmp_path / "curves.png")


def test_the_command_draws_the_same(results, tmp_path, capsys):
    timed = ["acceptor", "--time", "12 min"]
    for arguments, draw in (([], results.plot()[0]), (timed, results.plot("acceptor", time=0.2))):
        out = tmp_path / "picture.png"
        assert main(["plot", str(results.folder), *arguments, "--out", str(out)]) == 0
        expected = io.BytesIO()
        draw.figure.savefig(expected, dpi=150)
        expected.seek(0)
        assert np.array_equal(plt.imread(out), plt.imread(expected)) and str(out) in capsys.readouterr().out


@pytest.mark.parametrize("arguments, message", [
    (["doner", "--out", "x.png"], "did you mean donor"), (["--out", "x.gif"], "a film needs QUANTITY and accepts no"),
    (["donor", "--time", "1", "--out", "x.gif"], "no --time"),
    (["donor", "--time", "0.61 h", "--out", "x.png"], "0.61 h: outside the run, from 0 to 0.6 h"),
    (["donor", "--time", "12 um", "--out", "x.png"], "time: '12 um': a number of hours or a text such as"),
    (["--out", "x.txt"], "is not supported")])
def test_the_command_refuses_in_one_line(results, tmp_path, capsys, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    assert message in refusal(tmp_path, capsys, "plot", results.folder, *arguments) and not list(tmp_path.iterdir())


def test_the_command_lists_what_it_draws(capsys, tmp_path):
    """Names and words stand in two columns, also where a name is longer than those of one aggregate."""
    two = [{"radius": "4 um"}, {"radius": "4 um", "position": "40 um", "name": "downstream"}]
    repro.run({"pore": {"width": "50 um"}, "aggregate": two, "flow": {"head": "1e-3 cm"}}, tmp_path / "run")
    assert main(["plot", str(tmp_path / "run")]) == 0
    lines = capsys.readouterr().out.splitlines()
    drawable = repro.load_run(tmp_path / "run").drawable()
    starts = {line.index(words) for line, words in zip(lines, drawable.values(), strict=True)}
    assert starts == {max(map(len, drawable)) + 2} and [line.split()[0] for line in lines] == list(drawable)
