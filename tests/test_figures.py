"""The paper's figures show the data and numbers of a run, and their page is complete."""
import shlex
from importlib import import_module
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import paper_figures
from paper_figures import __main__ as figures
from paper_figures import claims, figure_6, runs, states, style
from reference import layered_channel
from repro import cli, load_scene, results, run
from repro.scene import scene_hash
from verification.claims import report

MODULES = {name: import_module(f"paper_figures.{name}") for name in paper_figures.FIGURES}
REQUESTS = list(dict.fromkeys(request for module in MODULES.values() for request in module.RUNS))
SHORT = {"base": ['growth.end="0.6 h"', 'output.times=["0.4 h", "0.6 h"]'], "wide": ['growth.end="0.4 h"'],
         "initial_mesh": []}
#: Short runs for the figures that compute further numbers.
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
    changed = [(transfer, "RUN", BRIEF[0]), (tearing, "RUN_OVERRIDES", tuple(BRIEF)), (tearing, "EVERY", 0.2),
               (figure_6, "EVERY", 0.2), (figures, "OUT", tmp_path / "out"), (style, "save", _coarse),
               (runs, "folders", lambda requests: [short[request.scene] for request in requests])]
    changed += [(module, points, getattr(module, points)[[0, -1]]) for module, points in (
        (layers, "UPTAKE_SHARES"), (transfer, "HEADS"), (transfer, "SUPPLIES"), (transfer, "RADII"))]
    for module, name, value in changed:
        monkeypatch.setattr(module, name, value)
    return tmp_path / "out"


def _coarse(figure, folder, name):
    """Save a small PNG instead of the printed files."""
    folder.mkdir(exist_ok=True)
    figure.savefig(folder / f"{name}.png", dpi=40)


@pytest.mark.parametrize("request_", REQUESTS, ids=lambda request: request.name)
def test_the_printed_command_makes_the_drawn_run(request_):
    chosen = cli._parser().parse_args(shlex.split(request_.command())[1:])
    assert scene_hash(load_scene(chosen.scene, chosen.set)) == scene_hash(request_.load())


@pytest.mark.thorough
def test_every_figure_is_drawn_and_described(quick):
    """The page has the recorded verdicts beside the claims, every run has its own name, and no link leaves the page."""
    figures.main()
    assert {p.name for p in quick.iterdir()} == {f"{n}.png" for n in MODULES} | {"index.html", "manifest.json"}
    root = ElementTree.fromstring((quick / "index.html").read_text(encoding="utf-8"))
    text = " ".join(" ".join(root.itertext()).split())
    verdicts = {claim["id"]: claim["verdict"] for claim in report.read()}
    for module in MODULES.values():
        expected = [module.TITLE, *(request.command() for request in module.RUNS)]
        for id in module.CLAIMS:
            expected += [f"{id} {verdicts[id]}", f"{id} {claims.STATEMENTS[id]}: {verdicts[id]}"]
        assert [words for words in expected if words not in text] == []
    assert len({request.name for request in REQUESTS}) == len(REQUESTS)
    links = [element.get(key, "") for element in root.iter() for key in ("src", "href")]
    assert not [link for link in links if link.startswith("http")]


@pytest.fixture
def unlike(monkeypatch):
    """Tables of runs that differ in every number. The first two touch the opposite wall in their second row."""
    tables = {}
    for k in range(7):
        hours = np.linspace(0.0, 50.0 + k, 5 + k)
        columns = {name: (2.0 + k + j) * np.exp(-hours / (20.0 + 3 * k + j)) for j, name in enumerate(results.COLUMNS)}
        columns["aggregate_area_um2"] = 1500 * columns["aggregate_area_um2"]
        tables[Path(f"run {k}")] = columns | {"time_h": hours, "contact": 1.0 * (np.arange(len(hours)) > 0) * (k < 2)}
    monkeypatch.setattr(states, "series", tables.__getitem__)
    return tables


def test_a_curve_matches_its_legends(unlike, monkeypatch):
    """The colour marks the run, and the line style marks the substrate. Circles mark the state that is compared."""
    module, folders = MODULES["time_series"], dict(zip(("Base", "Wide"), unlike))
    monkeypatch.setattr(module, "compared_effluents", lambda folder: [4.5, 6.5])
    panels = module.draw(*folders.values()).axes
    end = unlike[folders["Base"]]["time_h"][-1]
    assert [[end, 4.5], [end, 6.5]] in [drawn.get_offsets().tolist() for drawn in panels[2].collections]
    entries = [(line, text.get_text()) for k in (0, 2) for legend in [panels[k].get_legend()]
            for line, text in zip(legend.get_lines(), legend.get_texts())]
    tables = {line.get_color(): unlike[folders[name]] for line, name in entries[:2]}
    kinds = {line.get_linestyle(): name for line, name in entries[2:]}
    for axes, (column, *_) in zip(panels, module.CURVES, strict=True):
        lines = [line for line in axes.lines if line.get_linestyle() != ":"]
        assert len(lines) == (4 if "{}" in column else 2)
        for line in lines:
            table = tables[line.get_color()]
            expected = table["time_h"], table[column.format(kinds[line.get_linestyle()])]
            assert np.array_equal(line.get_xydata().T, expected)


def value(k, name, hours):
    """The value of a column in run k of ``unlike`` at a time (h)."""
    j = results.COLUMNS.index(name)
    return (1500 if name == "aggregate_area_um2" else 1) * (2.0 + k + j) * np.exp(-hours / (20.0 + 3 * k + j))


def fall(k):
    return f"{value(k, K, 0.0) / value(k, K, 50.0 + k):.3g}"


def area_rate(k):
    """The constant rate (1/h) at which the area of run k falls."""
    return -1 / (20.0 + 3 * k + results.COLUMNS.index("aggregate_area_um2"))


K, U = "conductivity_m_per_d", "mean_velocity_m_per_d"
FILLED = value(0, "aggregate_area_um2", 50.0) / (100 * 600)
#: {figure: (number of runs, numbers of its caption in their order)}. Contact is at the second row: 12.5 h in the first
#: run, 10.2 h in the second.
CAPTIONS = {
    "time_series": (2, ["50 h", "51 h", f"a factor of {fall(0)} in Base and {fall(1)} in Wide",
                        "at 12.5 h and 10.2 h."]),
    "discussion_biomass": (1, ["from 0 to 50 h", f"fills {100 * FILLED:.1f} %", f"by a factor of {fall(0)};",
                               f"by a factor of {layered_channel.gradient(1.0, FILLED, 2000.0) / 12:.2g}.",
                               f"takes up {100 * (1 - value(0, 'effluent_acceptor_mg_per_L', 50.0) / 10):.0f} %"]),
    "discussion_head": (2, ["continued to 50 h", "is that of 12.5 h",
                            f"from {value(0, U, 0.0):.3g} to {value(0, U, 50.0):.2g} m/d",
                            f"from {area_rate(0):.2g} to {area_rate(0):.2g} 1/h"]),
    "discussion_permeable": (3, ["; ".join("{:.3g}, {:.3g}, {:.3g} m/d at {:g} h".format(
        *(value(k, K, hours) for k in range(3)), hours) for hours in (20, 34, 40))]),
    "discussion_rheology": (6, ["to 50 h", *(f"{time} h and {value(k, K, 50.0 + k):.3g} m/d" for k, time in enumerate(
        ["12.5", "10.2", *4 * ["inf"]]))]),
}
#: Figures whose captions have numbers of the model alone, or of records with tests of their own.
OF_MODEL = {"figure_2", "figure_3", "discussion_folds", "discussion_tearing", "discussion_transfer", "network",
            "where_biomass_sits", "settle_or_plug"}


def test_the_caption_about_arrangements_has_the_losses_of_their_runs(tmp_path, monkeypatch):
    """Run k loses k / 20 of its conductivity at the compared area. One of them ends at a meeting, or none does."""
    module = MODULES["where_biomass_sits"]
    monkeypatch.setattr(module, "_course", lambda folder: (np.array([0.0, 1.2]), np.array([0.0, int(folder) / 10])))
    meets = {"2": "aggregates 1 and 2 meet at t"}
    monkeypatch.setattr(module.states, "status", lambda folder: meets.get(folder, "completed"))
    caption = module.caption(*map(str, range(10)))
    assert missing(["before the last hour: two facing (constant head). ", "0.6 W²",
                    "one 0 %, two facing 10 %, two staggered 20 %", "pairs 30 %, eight alternating 40 %",
                    "leaves 1.7 times", "conductivity as one than as eight", "by 5.0 percentage points"],
                   caption) is None
    meets.clear()
    assert "last hour" not in module.caption(*map(str, range(10)))


HOURS = np.linspace(0.0, 60.0, 13)


@pytest.mark.parametrize("share, gone, name", [
    (np.interp(HOURS, [0, 20, 40], [1, 0.8, 0.2]), False, "settles"),
    (np.interp(HOURS, [0, 20, 60], [1, 0.8, 0.2]), False, "undecided"),
    (np.interp(HOURS, [0, 20, 40], [1, 0.8, 0.04]), False, "plugs"),
    (np.interp(HOURS, [0, 20, 25, 50], [1, 0.5, 1, 1]), False, "settles"),
    (np.interp(HOURS, [0, 20, 25, 50], [1, 0.5, 1, 1]), True, "washes out"),
    (np.interp(HOURS, [0, 20, 25, 50], [1, 0.5, 0.62, 0.51]), True, "oscillates"),
    (np.interp(HOURS, [0, 20, 25, 50], [1, 0.5, 0.62, 0.52]), False, "settles"),
    (np.interp(HOURS, [0, 20, 25, 50], [1, 0.5, 0.59, 0.4]), False, "settles")])
def test_a_behaviour_follows_from_its_criterion(share, gone, name):
    assert MODULES["settle_or_plug"].behaviour(HOURS, share, gone, 60.0) == name


def test_a_run_that_ends_before_the_horizon_does_not_settle():
    assert MODULES["settle_or_plug"].behaviour(HOURS[:-1], np.full(12, 0.5), False, 60.0) == "undecided"


def test_the_mean_conductivity_is_that_of_the_second_half():
    """Its begin lies between two rows."""
    mean = MODULES["settle_or_plug"].mean_share(np.array([0.0, 10, 50, 60]), np.array([1.0, 1, 0.2, 0]))
    assert mean == pytest.approx((0.4 * 20 + 0.1 * 10) / 30)


def test_the_caption_about_behaviours_counts_them(monkeypatch):
    """Every run but the last loses 99 %."""
    module = MODULES["settle_or_plug"]
    monkeypatch.setattr(module, "_course", lambda folder: (2 * HOURS, np.linspace(1.0, folder, 13)))
    monkeypatch.setattr(module, "_gone", lambda folder: False)
    count = len(module.RUNS)
    caption = module.caption(*[0.01] * (count - 1), 1.0)
    assert f"washes out 0, plugs {count - 1}, settles 1, undecided 0. Dotted: a plug, K / K_0 = 0.05" in caption


def missing(expected, caption):
    """Return the first words that do not follow those before them in a caption, and the rest of it; or None."""
    for words in expected:
        if words not in caption:
            return words, caption
        caption = caption.partition(words)[2]
    return None


@pytest.mark.parametrize("name", CAPTIONS)
def test_the_numbers_of_a_caption_are_those_of_its_runs(name, unlike):
    count, expected = CAPTIONS[name]
    assert missing(expected, MODULES[name].caption(*[*unlike][:count])) is None


def test_the_course_of_a_run_names_its_contact(unlike, monkeypatch):
    """Between its rows."""
    monkeypatch.setattr(figure_6, "upstream_share", lambda folder: 0.625)
    ends = [value(1, f"{end}_um", 51.0) for end in ("upstream", "downstream")]
    expected = ["contact between 0 and 10.2 h", "from {:.0f} to {:.0f} µm at 51 h".format(*ends), "62.5 % of the area"]
    assert missing(expected, figure_6._course([*unlike][1])) is None


def row_at(folder, time):
    """A row whose numbers differ by column and time (h)."""
    return {name: 1 + k + 0.1 * time for k, name in enumerate(results.COLUMNS)}


def of_fields(short):
    """{figure: (folders, numbers of its caption in their order)} of captions with numbers of fields, from the rows."""
    last = {name: values[-1] for name, values in results.read_table(short["base"] / "timeseries.csv").items()}
    first, shaped, end = (row_at(None, time) for time in (0.0, 0.4, 0.6))
    wide = results.read_table(short["wide"] / "timeseries.csv")
    start = {name: values[0] for name, values in results.read_table(short["initial_mesh"] / "timeseries.csv").items()}
    course = f"no contact, from {wide['upstream_um'][-1]:.0f} to {wide['downstream_um'][-1]:.0f} µm at 0.4 h"
    return {
        "figure_4": (["initial_mesh"], [f"{start['meshed_length_um']:.0f} µm between",
                                        f"of {start['downstream_um'] - start['upstream_um']:.0f} µm",
                                        f"{start['nodes']:.0f} nodes"]),
        "figure_5": (["base"], ["at t = 0.6 h", "shape of 0.4 h",
                                *(f"{row[U]:.2f} m/d" for row in (first, shaped, end))]),
        "figure_6": (3 * ["wide"], [f"({letter}) {supply} K_s: {course}" for letter, supply in
                                    zip("abc", (5, 10, 40))]),
        "plate_1": (["base"], ["at t = 0.6 h", "that of 0.4 h", f"at 0.4 h, with less biomass in the same shape, "
                    f"{shaped['effluent_acceptor_mg_per_L']:.2f} and {shaped['effluent_donor_mg_per_L']:.2f} mg/L"]),
        "plate_2": (["base"], ["from 0.4 to 0.6 h", f"is {last['meshed_length_um']:.0f} µm long",
                               f"{-last['upstream_um']:.2f} µm upstream and {last['downstream_um']:.2f} µm"])}


def test_the_numbers_of_captions_about_fields_are_those_of_rows(short, monkeypatch):
    """Every figure is here, above, or has numbers of the model alone."""
    monkeypatch.setattr(figure_6, "EVERY", 0.2)
    monkeypatch.setattr(states, "row", row_at)
    captions = of_fields(short)
    assert {*captions, *CAPTIONS, *OF_MODEL} == {*MODULES}
    for name, (scenes, expected) in captions.items():
        assert missing(expected, MODULES[name].caption(*(short[scene] for scene in scenes))) is None
