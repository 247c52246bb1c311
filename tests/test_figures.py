"""The paper's figures: they draw what a run holds, say its numbers, and the page about them is complete."""
import shlex
from importlib import import_module
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.collections import QuadMesh
from matplotlib.patches import Polygon

import paper_figures
from paper_figures import __main__ as figures
from paper_figures import claims, figure_2, figure_4, figure_6, overview, runs, states, style
from repro import cli, load_scene, results, run
from repro.fem.outline import TOP, polygon_area
from repro.scene import scene_hash
from verification.claims import report
from verification.claims.levels import converged

MODULES = {name: import_module(f"paper_figures.{name}") for name in paper_figures.FIGURES}
REQUESTS = list(dict.fromkeys(request for module in MODULES.values() for request in module.RUNS))
SHORT = {"base": ['growth.end="0.6 h"', 'output.times=["0.4 h", "0.6 h"]'], "wide": ['growth.end="0.4 h"'],
         "initial_mesh": []}
#: Runs of the figures that compute numbers of their own.
BRIEF = [(name, 'growth.end="0.4 h"', 'output.times=["0.4 h"]') for name in ("base", "wide")]


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """{scene: folder of a short run}."""
    folders = {name: tmp_path_factory.mktemp("runs") / name for name in SHORT}
    for name, folder in folders.items():
        run(load_scene(name, SHORT[name]), folder)
    return folders


@pytest.fixture
def quick(short, monkeypatch, tmp_path):
    """`python -m paper_figures` on short runs and few points, in coarse pictures, into a temporary folder."""
    transfer, tearing, layers = (MODULES[f"discussion_{name}"] for name in ("transfer", "tearing", "biomass"))
    changed = [(transfer, "RUN", BRIEF[0]), (tearing, "COURSES", tuple(BRIEF)), (tearing, "EVERY", 0.2),
               (figure_6, "EVERY", 0.2), (figures, "OUT", tmp_path / "out"), (style, "save", _coarse),
               (runs, "folders", lambda requests: [short[request.scene] for request in requests])]
    changed += [(module, points, getattr(module, points)[[0, -1]]) for module, points in (
        (layers, "TAKEN_UP"), (transfer, "HEADS"), (transfer, "SUPPLIES"), (transfer, "RADII"))]
    for module, name, value in changed:
        monkeypatch.setattr(module, name, value)
    return tmp_path / "out"


def _coarse(made, folder, name):
    """A small PNG in place of what is printed."""
    folder.mkdir(exist_ok=True)
    made.savefig(folder / f"{name}.png", dpi=40)


@pytest.mark.parametrize("request_", REQUESTS, ids=lambda request: request.name)
def test_the_command_told_is_the_run_that_is_drawn(request_):
    chosen = cli._parser().parse_args(shlex.split(request_.command())[1:])
    assert scene_hash(load_scene(chosen.scene, chosen.set)) == scene_hash(request_.load())


def test_everything_is_drawn_and_told(quick):
    """With the recorded verdicts beside the claims; a run has a name of its own; nothing is asked of the network."""
    figures.main()
    assert {p.name for p in quick.iterdir()} == {f"{n}.png" for n in MODULES} | {"index.html", "manifest.json"}
    root = ElementTree.fromstring((quick / "index.html").read_text(encoding="utf-8"))
    text = " ".join(" ".join(root.itertext()).split())
    verdicts = {each["id"]: each["verdict"] for each in report.read()}
    for module in MODULES.values():
        wanted = [module.TITLE, *(request.command() for request in module.RUNS)]
        for id in module.CLAIMS:
            wanted += [f"{id} {verdicts[id]}", f"{id} {claims.STATEMENTS[id]}: {verdicts[id]}"]
        assert [words for words in wanted if words not in text] == []
    assert len({request.name for request in REQUESTS}) == len(REQUESTS)
    links = [element.get(key, "") for element in root.iter() for key in ("src", "href")]
    assert not [link for link in links if link.startswith("http")]


def test_a_picture_is_the_same_bytes_each_time(short, tmp_path):
    made = []
    for folder in (tmp_path / "one", tmp_path / "two"):
        style.save(figure_4.draw(short["initial_mesh"]), folder, "figure_4")
        made.append([(folder / name).read_bytes() for name in ("figure_4.pdf", "figure_4.png")])
    assert made[0] == made[1] and b"CreationDate" not in made[0][0]


def test_a_state_agrees_with_the_time_series(short):
    state, row = states.last(short["base"]), states.row(short["base"], 0.6)
    assert polygon_area(state.rim) == pytest.approx(row["aggregate_area_um2"], rel=1e-12)
    assert np.ptp(state.ends) == pytest.approx(row["meshed_length_um"], rel=1e-12)
    for name in ("acceptor", "donor"):
        for end, place in enumerate(("inlet", "effluent")):
            assert state.carried(f"{name}_mg_per_L", end) == pytest.approx(row[f"{place}_{name}_mg_per_L"], rel=2e-4)


@pytest.mark.parametrize("name, panels", [("figure_5", 1), ("plate_1", 4)])
def test_the_shape_that_is_drawn_is_that_before_the_expansion(short, name, panels):
    """As the caption says, in every panel."""
    wanted = states.last(short["base"], "before_expansion").rim
    patches = [patch for axes in MODULES[name].draw(short["base"]).axes for patch in axes.patches]
    drawn = [patch.get_xy()[:-1] for patch in patches if isinstance(patch, Polygon)]
    assert sum(np.array_equal(one, wanted) for one in drawn) == panels


def test_the_colours_of_plate_1_are_in_the_units_of_their_labels(short):
    """From the least to the largest value of what is drawn: of biomass what has grown in 12 min from the density of
    before, X_A (e^(F3 t)), even to the growth's own differences, and not what reprojection has left."""
    plate_1, state = MODULES["plate_1"], states.last(short["base"], "before_expansion")
    bars = {axes.get_xlabel(): axes.get_xlim() for axes in plate_1.draw(short["base"]).axes}
    inert, active = (plate_1.since(short["base"], f"{kind}_biomass")[state.body] for kind in ("inert", "active"))
    wanted = {"$C_A$ (mg/L)": state.nodes["acceptor_mg_per_L"], "$C_D$ (mg/L)": state.nodes["donor_mg_per_L"],
              "$X_A / X_m$ (–)": active, "$X_I / X_m$ (10$^{-3}$)": 1000 * inert}
    for label, values in wanted.items():
        assert bars[label] == pytest.approx((values.min(), values.max()), rel=1e-9), label
    assert np.ptp(np.log(state.nodes["active_biomass"][state.body])) > np.ptp(np.log(active))
    rates = np.log(active + inert) / 0.2
    assert 0.18 < rates.min() and rates.max() < 0.195 and np.ptp(rates) < 1e-3


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


def test_a_curve_is_what_the_legends_call_it(unlike):
    """By the colour of its run and the line of its substrate."""
    module, folders = MODULES["time_series"], dict(zip(("Base", "Wide"), unlike))
    panels = module.draw(*folders.values()).axes
    told = [(line, text.get_text()) for k in (0, 2) for legend in [panels[k].get_legend()]
            for line, text in zip(legend.get_lines(), legend.get_texts())]
    tables = {line.get_color(): unlike[folders[name]] for line, name in told[:2]}
    kinds = {line.get_linestyle(): name for line, name in told[2:]}
    for axes, (column, *_) in zip(panels, module.CURVES, strict=True):
        lines = [line for line in axes.lines if line.get_linestyle() != ":"]
        assert len(lines) == (4 if "{}" in column else 2)
        for line in lines:
            table = tables[line.get_color()]
            wanted = table["time_h"], table[column.format(kinds[line.get_linestyle()])]
            assert np.array_equal(line.get_xydata().T, wanted)


def test_each_run_has_its_own_curve_in_every_discussion(unlike):
    """By its name: conductivities of runs that are laid over each other."""
    permeable, rheology, head = (MODULES[f"discussion_{name}"] for name in ("permeable", "rheology", "head"))
    folders, (one, other) = list(unlike), style.figure(3).subplots(2)
    rheology._conductivity(one, folders)
    head._fall(other, *folders[:2])
    for panel, labels, over in ((permeable.draw(*folders[:3]).axes[0], permeable.LABELS, 0), (one, rheology.LABELS, 0),
                                (other, ("Base (head)", "Wide (velocity)"), 1)):
        drawn = {line.get_label(): line.get_xydata().T for line in panel.lines}
        for label, folder in zip(labels, folders):
            now = unlike[folder]["conductivity_m_per_d"]
            assert drawn[label] == pytest.approx(np.array([unlike[folder]["time_h"], now / now[0] ** over]))


def test_the_outlines_of_figure_6_are_those_of_the_converged_solution(short, monkeypatch):
    """In the elements and steps by which the claims are judged; a row every tenth of an hour around contact; of the
    area covered anew half lies upstream at first."""
    said = figure_6.RUNS[0].load()
    assert said.numerics == load_scene("wide", converged(1.0)).numerics and said.growth.end == 45.0
    assert set(np.arange(5.0, 46.0, 5.0)) <= set(said.output.times)
    assert np.diff([time for time in said.output.times if 34 <= time <= 35]) == pytest.approx(0.1)
    monkeypatch.setattr(figure_6, "EVERY", 0.2)
    assert figure_6.upstream_share(short["wide"]) == pytest.approx(0.5, abs=0.01)


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


def test_the_picture_of_the_readme(short, monkeypatch):
    monkeypatch.setattr(figure_6, "EVERY", 0.2)
    assert len(overview.draw(short["base"], short["wide"]).axes) == 4
    content = Path(overview.TARGET).read_bytes()
    assert content[:8] == b"\x89PNG\r\n\x1a\n" and len(content) < 200_000
    assert abs(int.from_bytes(content[16:20], "big") - overview.PIXELS_WIDE) <= 1
