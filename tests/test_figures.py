"""The paper's figures: they draw what a run holds, say its numbers, and the page about them is complete."""
import dataclasses
import shlex
import shutil
from importlib import import_module
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.collections import QuadMesh
from matplotlib.patches import Polygon
from matplotlib.quiver import Quiver

import paper_figures
from paper_figures import __main__ as figures
from paper_figures import claims, overview, page, runs, states, style
from repro import cli, load_scene, results, run
from repro.fem.outline import TOP, polygon_area
from repro.scene import scene_hash
from verification.claims.base_run import upstream_means
from verification.claims.levels import at_level, converged
from verification.claims.runs import grown_anew

MODULES = {name: import_module(f"paper_figures.{name}") for name in paper_figures.FIGURES}
SHORT = {"base": ['growth.end="0.6 h"', 'output.times=["0.4 h", "0.6 h"]'], "wide": ['growth.end="0.4 h"'],
         "initial_mesh": []}
figure_2, figure_3, figure_4, figure_5, figure_6, plate_2 = (
    MODULES[name] for name in ("figure_2", "figure_3", "figure_4", "figure_5", "figure_6", "plate_2"))


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """{scene: folder of a short run}."""
    folders = {name: tmp_path_factory.mktemp("runs") / name for name in SHORT}
    for name, folder in folders.items():
        run(load_scene(name, SHORT[name]), folder)
    return folders


#: The same for the figures that compute numbers of their own.
HALF_AN_HOUR = [(name, f'growth.end="{hours} h"', f'output.times=["{hours} h"]')
                for name, hours in (("base", 0.4), ("wide", 0.4))]


@pytest.fixture
def brief(monkeypatch):
    """Figures that compute numbers of their own do so for short runs and few points."""
    transfer, tearing = MODULES["discussion_transfer"], MODULES["discussion_tearing"]
    monkeypatch.setattr(transfer, "RUN", HALF_AN_HOUR[0])
    monkeypatch.setattr(tearing, "COURSES", tuple(HALF_AN_HOUR))
    monkeypatch.setattr(tearing, "EVERY", 0.2)
    layers = MODULES["discussion_biomass"]
    monkeypatch.setattr(layers, "TAKEN_UP", layers.TAKEN_UP[[0, -1]])
    for points in ("HEADS", "SUPPLIES", "RADII"):
        monkeypatch.setattr(transfer, points, getattr(transfer, points)[[0, -1]])


@pytest.fixture
def quick(short, brief, monkeypatch, tmp_path):
    """`python -m paper_figures` on the short runs, in coarse pictures, into a temporary folder."""
    monkeypatch.setattr(runs, "folders", lambda requests: [short[request.scene] for request in requests])
    monkeypatch.setattr(figures, "OUT", tmp_path / "out")
    monkeypatch.setattr(figure_6, "EVERY", 0.2)
    monkeypatch.setattr(style, "save", _coarse)
    return tmp_path / "out"


def _coarse(made, folder, name):
    """A small PNG in place of what is printed."""
    folder.mkdir(exist_ok=True)
    made.savefig(folder / f"{name}.png", dpi=40)


@pytest.mark.parametrize("name", MODULES)
def test_a_figure_says_what_it_is(name):
    module = MODULES[name]
    kind, _, number = name.partition("_")
    assert module.TITLE.startswith(f"{kind.title()} {number}. " if kind in ("figure", "plate") else "Addition. ")
    assert module.CLAIMS and set(module.CLAIMS) <= set(claims.STATEMENTS)


def test_every_figure_of_the_folder_is_drawn():
    there = {path.stem for path in figures.OUT.parent.glob("*.py")
             if path.stem.startswith(("figure_", "plate_", "discussion_"))}
    assert there == set(paper_figures.FIGURES) - {"time_series", "network"}


REQUESTS = list(dict.fromkeys(request for module in MODULES.values() for request in module.RUNS))


def test_no_two_runs_have_one_name():
    assert len({request.name for request in REQUESTS}) == len(REQUESTS) >= 13


@pytest.mark.parametrize("request_", REQUESTS, ids=lambda request: request.name)
def test_the_command_told_is_the_run_that_is_drawn(request_):
    chosen = cli._parser().parse_args(shlex.split(request_.command())[1:])
    assert scene_hash(load_scene(chosen.scene, chosen.set)) == scene_hash(request_.load())


def test_everything_is_drawn_and_told(quick, capsys):
    figures.main()
    told = capsys.readouterr().out.splitlines()
    assert [line.partition(":")[0] for line in told[1:-1]] == list(MODULES)
    assert {p.name for p in quick.iterdir()} == {f"{n}.png" for n in MODULES} | {"index.html", "manifest.json"}
    root = ElementTree.fromstring((quick / "index.html").read_text(encoding="utf-8"))
    assert [image.get("src") for image in root.iter("img")] == [f"{name}.png" for name in MODULES]
    text = " ".join(root.itertext())
    assert all(module.TITLE in text for module in MODULES.values())
    assert all(request.command() in text for module in MODULES.values() for request in module.RUNS)
    assert all(f"python -m verification.claims {id}" in text for id in ("C39", "C40", "C45", "C46"))
    assert "Figure 1" in text and "base: completed" in text
    assert all(element.get(key, "").partition(":")[0] not in ("http", "https") for element in root.iter()
               for key in ("src", "href"))


def test_a_picture_is_the_same_bytes_each_time(short, tmp_path):
    for folder in (tmp_path / "one", tmp_path / "two"):
        style.save(figure_4.draw(short["initial_mesh"]), folder, "figure_4")
    for name in ("figure_4.pdf", "figure_4.png"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()
    assert b"CreationDate" not in (tmp_path / "one" / "figure_4.pdf").read_bytes()


def test_the_page_escapes_text():
    hostile = "1 < 2 & \"3\" > '0' <script>"
    entry = page.Entry("figure_9", hostile, hostile, (hostile,), ("C01",))
    section = ElementTree.fromstring(page.page([entry], [hostile])).find("body/section")
    assert section.find("h2").text == section.find("pre").text == hostile
    assert section.find("p").text.startswith(hostile) and section.find(".//script") is None


@pytest.mark.parametrize("changes, told, drawn", [
    ([], "210 µm in all", "75 µm"), (['pore.width="30 um"', 'pore.length="90 um"'], "90 µm in all", "27 µm"),
    (['pore.width="30 um"'], "126 µm in all", "45 µm")])
def test_the_schematics_follow_the_model(changes, told, drawn):
    """Around a half-disc 0.6 W thick 1.5 W are meshed on both sides, unless the pore ends before."""
    said = load_scene("base", changes)
    assert told in figure_3.caption(said)
    assert drawn in {text.get_text() for axes in figure_3.draw(said).axes for text in axes.texts}
    assert "110 µm around the seed" in figure_3.caption() and "16.7°" in figure_2.caption()


def test_figure_4_shows_every_triangle(short):
    state = states.first(short["initial_mesh"])
    lines = figure_4.draw(short["initial_mesh"]).axes[0].lines
    drawn = {point for line in lines for point in zip(*line.get_data())}
    assert set(map(tuple, state.points)) <= drawn
    assert f"{len(state.triangles)} triangles" in figure_4.caption(short["initial_mesh"])


def test_a_state_agrees_with_the_time_series(short):
    state, row = states.last(short["base"]), states.row(short["base"], 0.6)
    assert polygon_area(state.rim) == pytest.approx(row["aggregate_area_um2"], rel=1e-12)
    assert np.ptp(state.ends) == pytest.approx(row["meshed_length_um"], rel=1e-12)
    for name in ("acceptor", "donor"):
        for end, place in enumerate(("inlet", "effluent")):
            assert state.carried(f"{name}_mg_per_L", end) == pytest.approx(row[f"{place}_{name}_mg_per_L"], rel=2e-4)


def test_the_captions_read_the_run(short, tmp_path):
    """A missing time is told."""
    folder = shutil.copytree(short["base"], tmp_path / "changed")
    velocity, table = states.row(folder, 0.6)["mean_velocity_m_per_d"], folder / "timeseries.csv"
    table.write_text(table.read_text(encoding="utf-8").replace(repr(velocity), "9.87"), encoding="utf-8")
    assert "9.87 m/d" in figure_5.caption(folder) and "9.87 m/d" not in figure_5.caption(short["base"])
    with pytest.raises(LookupError, match="0.5 h"):
        states.row(folder, 0.5)


@pytest.mark.parametrize("name", ["figure_5", "plate_1"])
def test_the_shape_that_is_drawn_is_that_before_the_expansion(short, name):
    """As the caption says, in every panel."""
    wanted, made = states.last(short["base"], "before_expansion").rim, MODULES[name].draw(short["base"])
    panels = [axes for axes in made.axes if axes.get_title(loc="left") or name == "figure_5" and axes is made.axes[0]]
    assert len(panels) == (1 if name == "figure_5" else 4)
    for axes in panels:
        (drawn,) = (patch.get_xy()[:-1] for patch in axes.patches if isinstance(patch, Polygon))
        assert np.array_equal(drawn, wanted)


def test_the_colours_of_plate_1_are_in_the_units_of_their_labels(short):
    """From the least to the largest value of what is drawn."""
    plate_1, state = MODULES["plate_1"], states.last(short["base"], "before_expansion")
    made = plate_1.draw(short["base"])
    bars = {axes.get_xlabel(): axes.get_xlim() for axes in made.axes if axes.get_xlabel() != style.X_LABEL}
    inert, active = (plate_1.since(short["base"], f"{kind}_biomass")[state.body] for kind in ("inert", "active"))
    wanted = {"$C_A$ (mg/L)": state.nodes["acceptor_mg_per_L"], "$C_D$ (mg/L)": state.nodes["donor_mg_per_L"],
              "$X_A / X_m$ (–)": active, "$X_I / X_m$ (10$^{-3}$)": 1000 * inert}
    assert bars.keys() == wanted.keys()
    for label, values in wanted.items():
        assert bars[label] == pytest.approx((values.min(), values.max()), rel=1e-9), label


def test_a_curve_is_what_the_legends_call_it(short):
    """By the colour of its run and the line of its substrate."""
    module, folders = MODULES["time_series"], {"Base": short["base"], "Wide": short["wide"]}
    panels = module.draw(*folders.values()).axes
    runs_, names = (panels[k].get_legend() for k in (0, 2))
    tables = {line.get_color(): states.series(folders[text.get_text()])
              for line, text in zip(runs_.get_lines(), runs_.get_texts())}
    kinds = {line.get_linestyle(): text.get_text() for line, text in zip(names.get_lines(), names.get_texts())}
    assert kinds.keys() == {"-", "--"} and len(tables) == 2
    for axes, (column, *_) in zip(panels, module.CURVES, strict=True):
        assert len(axes.lines) == (4 if "{}" in column else 2)
        for line in axes.lines:
            table = tables[line.get_color()]
            assert np.array_equal(line.get_xdata(), table["time_h"])
            assert np.array_equal(line.get_ydata(), table[column.format(kinds[line.get_linestyle()])])


@pytest.fixture
def unlike(monkeypatch):
    """Tables of runs that differ in every number, the first of which touch the opposite wall in their second row."""
    tables = {}
    for k in range(7):
        hours = np.linspace(0.0, 50.0 + k, 5 + k)
        columns = {name: (2.0 + k + j) * np.exp(-hours / (20.0 + 3 * k + j)) for j, name in enumerate(results.COLUMNS)}
        tables[Path(f"run {k}")] = columns | {"time_h": hours, "contact": 1.0 * (np.arange(len(hours)) > 0) * (k < 2)}
    monkeypatch.setattr(states, "series", tables.__getitem__)
    return tables


def test_each_run_has_its_own_curve_in_every_discussion(unlike):
    """In its colour and by its name: conductivities of runs that are laid over each other."""
    permeable, rheology, head = (MODULES[f"discussion_{name}"] for name in ("permeable", "rheology", "head"))
    folders, made = list(unlike), style.figure(3).subplots(2)
    alone, ratios = permeable.draw(*folders[:3]).axes
    rheology._conductivity(made[0], folders)
    for panel, module in ((alone, permeable), (made[0], rheology)):
        lines = panel.lines[:len(module.LABELS)]
        assert [line.get_label() for line in lines] == list(module.LABELS)
        assert len({line.get_color() for line in lines}) == len(lines)
        for line, folder in zip(lines, folders):
            wanted = [unlike[folder][name] for name in ("time_h", "conductivity_m_per_d")]
            assert np.array_equal(line.get_xydata().T, wanted)
    looks = [(line.get_color(), line.get_linestyle()) for line in alone.lines[:3]]
    assert looks == [(style.BLACK, "-"), (style.RED, "-"), (style.BLUE, "--")]  # as the caption says
    first = unlike[folders[0]]
    for line, folder in zip(ratios.lines, folders[:3]):
        now = unlike[folder]
        told = np.interp(now["time_h"], first["time_h"], np.log(first["conductivity_m_per_d"]))
        assert np.log(line.get_ydata()) == pytest.approx(np.log(now["conductivity_m_per_d"]) - told)
    head._fall(made[1], *folders[:2])
    curves, marks = made[1].lines[::2], made[1].lines[1::2]
    for curve, mark, folder, name in zip(curves, marks, folders, ("Base (head)", "Wide (velocity)")):
        now = unlike[folder]
        assert curve.get_label() == name and curve.get_color() == mark.get_color()
        assert curve.get_ydata() == pytest.approx(now["conductivity_m_per_d"] / now["conductivity_m_per_d"][0])
        assert np.array_equal(curve.get_xdata(), now["time_h"]) and mark.get_xdata()[0] == now["time_h"][1]


def test_captions_tell_each_run_of_its_own(unlike):
    """Falls, last values, and times of contact."""
    folders = list(unlike)
    last = [unlike[folder]["conductivity_m_per_d"][-1] for folder in folders]
    falls = [unlike[folder]["conductivity_m_per_d"][0] / end for folder, end in zip(folders, last)]
    touch = [unlike[folder]["time_h"][1] for folder in folders]
    said = MODULES["time_series"].caption(*folders[:2])
    assert f"factor of {falls[0]:.3g} in Base and {falls[1]:.3g} in Wide" in said
    assert "to 50 h) and Wide" in said and "to 51 h)" in said and f"{touch[0]:g} h and {touch[1]:g} h." in said
    rheology = MODULES["discussion_rheology"]
    for label, folder, end, hours in zip(rheology.LABELS, folders, last, touch):
        hours = hours if unlike[folder]["contact"].any() else np.inf
        assert f"{label}: {hours:g} h and {end:.3g} m/d" in rheology.caption(*folders)
    permeable, table = MODULES["discussion_permeable"], unlike[folders[2]]
    for hours in permeable.MOMENTS:
        told = np.exp(np.interp(hours, table["time_h"], np.log(table["conductivity_m_per_d"])))
        assert f", {told:.3g} m/d at {hours:g} h" in permeable.caption(*folders[:3])


def test_plate_2_goes_from_the_dashed_shape_to_the_full_one_by_its_arrows(short):
    """LENGTHENED times as long as what the nodes move by, in both panels."""
    before, after = states.last(short["base"], "before_expansion"), states.last(short["base"])
    for axes in plate_2.draw(short["base"]).axes[:2]:
        rims = [patch for patch in axes.patches if isinstance(patch, Polygon)]
        shapes = {patch.get_linestyle() == "--": patch.get_xy()[:-1] for patch in rims}
        assert np.array_equal(shapes[True], before.rim) and np.array_equal(shapes[False], after.rim)
        (arrows,) = (part for part in axes.collections if isinstance(part, Quiver))
        assert np.array_equal(arrows.get_offsets(), before.points) and arrows.scale == 1 and arrows.scale_units == "xy"
        moved = plate_2.LENGTHENED * (after.points - before.points)
        assert np.column_stack([arrows.U, arrows.V]) == pytest.approx(moved)


def test_rates_are_drawn_between_the_rows_that_they_are_of(short):
    """And flow and uptake at the rows."""
    head, table = MODULES["discussion_head"], states.series(short["base"])
    panels = head.draw(short["base"], short["wide"]).axes
    (panel,) = (axes for axes in panels if "over the largest" in axes.get_title("left"))
    hours = {line.get_label(): line.get_xdata() for line in panel.lines}
    assert hours["growth rate of the area"] == pytest.approx((table["time_h"][1:] + table["time_h"][:-1]) / 2)
    for name in ("velocity", "acceptor taken up"):
        assert np.array_equal(hours[name], table["time_h"])


def test_the_colours_of_outlines_are_those_beside_their_times(short):
    """Each in the middle of its part of the scale."""
    made = style.figure(2.75)
    figure_6.outlines(made.subplots(), short["wide"], 0.2)
    axes, bar = made.axes
    shapes = [patch for patch in axes.patches if isinstance(patch, Polygon)]
    (scale,) = (part for part in bar.collections if isinstance(part, QuadMesh))
    edges = np.linspace(*bar.get_xlim(), len(shapes) + 1)
    assert bar.get_xticks() == pytest.approx((edges[1:] + edges[:-1]) / 2)
    beside = scale.to_rgba(scale.get_array().ravel())
    assert np.array([patch.get_facecolor() for patch in reversed(shapes)]) == pytest.approx(beside)


def test_most_of_the_flow_goes_around_the_aggregate(short):
    state = states.last(short["base"], "before_expansion")
    assert 0 < figure_5.share_through(state) < 1e-3


def test_streamlines_part_the_flow(short):
    x, y, share = overview.stream(states.first(short["base"]))
    assert (share[0] == 0).all() and (share[-1] == 1).all()
    parabola = 3 * (y / 50) ** 2 - 2 * (y / 50) ** 3
    assert np.abs(share[:, 0] - parabola).max() < 5e-3


def test_displacements_survive_a_new_mesh(short):
    before, after = states.last(short["base"], "before_expansion"), states.last(short["base"])
    order = np.random.default_rng(1).permutation(len(after.points))
    remade = dataclasses.replace(after, points=after.points[order], triangles=np.argsort(order)[after.triangles],
                                 nodes={name: values[order] for name, values in after.nodes.items()})
    assert plate_2.same_mesh(before, after) and not plate_2.same_mesh(before, remade)
    nodes, moved = plate_2.displaced(before, remade)
    assert (nodes == before.body).all() and np.abs(moved - after.points[nodes]).max() < 1e-9
    assert np.abs(moved - before.points[nodes]).max() > 0.01


def test_plate_1_shows_what_has_grown_and_not_what_reprojection_left(short):
    """What grows in 12 min from the density of before: X_A (e^(F3 t)), even to the growth's own differences."""
    plate_1, state = MODULES["plate_1"], states.last(short["base"], "before_expansion")
    active, inert = (plate_1.since(short["base"], f"{kind}_biomass")[state.body] for kind in ("active", "inert"))
    rates = np.log(active + inert) / 0.2
    assert 0.18 < rates.min() and rates.max() < 0.195 and np.ptp(rates) < 1e-3
    assert np.ptp(np.log(state.nodes["active_biomass"][state.body])) > np.ptp(np.log(active))


def test_outlines_are_smooth_between_the_walls_and_keep_their_nodes():
    """A flattened disc of 51 um: straight on both walls, a spline between them."""
    outline = figure_2.flattened(50.0)
    line = figure_6.smooth(outline.points, 50.0)
    apart = np.linalg.norm(line[:, None] - outline.points[None], axis=2).min(axis=0)
    assert apart.max() < 1e-9 and len(line) > 4 * len(outline.points)
    assert line[:, 1].min() >= 0 and line[:, 1].max() <= 50 + 1e-9
    contact = outline.points[outline.wall == TOP, 0].max()
    assert contact > 5 and (line[(np.abs(line[:, 0]) < contact) & (line[:, 1] > 25), 1] == 50).all()
    free = line[(line[:, 1] > 1) & (line[:, 1] < 45)]
    assert np.abs(np.hypot(*free.T) / 51.0 - 1).max() < 1e-3


def test_the_outlines_of_figure_6_are_those_of_the_converged_solution(short, monkeypatch):
    """In the elements and steps by which the claims are judged, which the caption says; a row every tenth of an hour
    around contact."""
    (asked,) = figure_6.RUNS
    said = asked.load()
    assert said.numerics == load_scene("wide", converged(1.0)).numerics and said.numerics.order == 2
    assert set(np.arange(5.0, 46.0, 5.0)) <= set(said.output.times) and said.growth.end == 45.0
    around = [time for time in said.output.times if 34 <= time <= 35]
    assert np.diff(around) == pytest.approx(0.1)
    monkeypatch.setattr(figure_6, "EVERY", 0.2)
    assert "the converged solution by which the claims are judged" in figure_6.caption(short["wide"])


def test_the_first_outline_in_contact_is_drawn(short, monkeypatch):
    """Dashed, over those of equal times."""
    head = MODULES["discussion_head"]
    monkeypatch.setattr(head, "EVERY", 0.2)
    plain = head.draw(short["base"], short["wide"]).axes[0]
    monkeypatch.setattr(head, "contact", lambda folder: 0.4)
    axes = head.draw(short["base"], short["wide"]).axes[0]
    assert plain.get_legend() is None and len(axes.patches) == len(plain.patches) + 1
    (dashed,) = (patch for patch in axes.patches if patch.get_linestyle() == "--")
    rim = states.near(short["base"], 0.4).rim
    assert np.ptp(dashed.get_xy()[:, 0]) == pytest.approx(np.ptp(rim[:, 0]), rel=1e-9)
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["in contact, 0.4 h"]


def test_the_pull_is_that_of_the_state_which_the_paper_tells_of(brief):
    """The shape with what has grown in 12 min, whose uptake is larger: less is left upstream than without it."""
    transfer = MODULES["discussion_transfer"]
    made = transfer.draw()
    (panel,) = (axes for axes in made.axes if "the pull upstream" in axes.get_title(loc="left"))
    assert panel.get_title(loc="left") == "(b) the pull upstream at 0.6 h"
    with at_level(transfer.LEVEL):
        last = transfer.early()[-1]
        ours, theirs = (upstream_means(*state, 60.0)[0] for state in
                        (grown_anew(transfer.RUN, 0.4), (last.pore, last.solved)))
    drawn = np.interp(60.0, *panel.lines[0].get_data())
    assert drawn == pytest.approx(ours, rel=1e-6) and drawn < theirs - 1e-4


def test_page_and_captions_tell_the_recorded_verdicts(monkeypatch):
    known = {"C01": "reproduced", "C02": "undecided"}
    monkeypatch.setattr(claims, "verdicts", lambda: known)
    monkeypatch.setattr(page, "verdicts", lambda: known)
    entry = page.Entry("figure_9", "Figure 9. T", "A caption.", (), ("C01", "C02", "C30"))
    text = " ".join(ElementTree.fromstring(page.page([entry], [])).itertext())
    assert "A caption. Claims: C01 reproduced; C02 undecided; C30 not judged." in text
    assert "by 19.4 h: undecided" in " ".join(text.split())


def test_the_upstream_share_of_new_area(short, monkeypatch):
    monkeypatch.setattr(figure_6, "EVERY", 0.2)
    assert figure_6.upstream_share(short["wide"]) == pytest.approx(0.5, abs=0.01)


def test_the_picture_of_the_readme(short, monkeypatch):
    monkeypatch.setattr(figure_6, "EVERY", 0.2)
    assert len(overview.draw(short["base"], short["wide"]).axes) == 4
    content = Path(overview.TARGET).read_bytes()
    assert content[:8] == b"\x89PNG\r\n\x1a\n" and len(content) < 200_000
    assert abs(int.from_bytes(content[16:20], "big") - overview.PIXELS_WIDE) <= 1
