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
        tables[Path(f"run {k}")] = columns | {"time_h": hours, "contact": 1.0 * (np.arange(len(hours)) > 0) * (k < 2)}
    monkeypatch.setattr(states, "series", tables.__getitem__)
    return tables


def test_a_curve_matches_its_legends(unlike):
    """The colour marks the run, and the line style marks the substrate."""
    module, folders = MODULES["time_series"], dict(zip(("Base", "Wide"), unlike))
    panels = module.draw(*folders.values()).axes
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
