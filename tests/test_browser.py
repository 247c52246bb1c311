"""Pages in a real browser: scripts run, the slider and its keys change the picture, and nothing else is loaded."""

import json
import time
from xml.etree import ElementTree

import pytest

from tests import browser
from tests.pages import FAST, page_data, run

pytestmark = [pytest.mark.thorough,
              pytest.mark.skipif(browser.CHROMIUM is None, reason="Chromium is not installed")]


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """{name: folder} of runs of every kind."""
    kinds = {"fast": ("base", FAST, 'growth.end="19.4 h"'), "paper": ("base", 'growth.end="1 h"'),
             "flow": ("flow_only",), "mesh": ("initial_mesh",)}
    return {name: run(tmp_path_factory.mktemp(name), *arguments) for name, arguments in kinds.items()}


def show(window, out, fragment="", **look):
    """Open a run's page without an error or further requests; return the script's data of the picture."""
    page = out if out.suffix else out / "report.html"
    window.show(page, fragment, **look)
    assert window.run("document.getElementById('errors').textContent") == ""
    assert window.requests == [page.resolve().as_uri() + fragment.partition("#")[0]]
    return picture(window)


def picture(window):
    return json.loads(window.run("JSON.stringify({...(document.getElementById('picture') ?? {dataset: {}}).dataset})"))


@pytest.mark.parametrize("width, dark", [(1200, False), (375, True)])
@pytest.mark.parametrize("name", ["fast", "paper", "flow", "mesh"])
def test_pages_open_from_disk_without_error(window, runs, name, width, dark):
    """Nothing is cut off at a phone's width."""
    state = show(window, runs[name], width=width, dark=dark)
    assert state["frame"] == str(len(page_data(runs[name])["frames"]) - 1) and float(state["filled"]) > 0.9
    charts = int(window.run("document.documentElement.dataset.charts"))
    assert (charts > 10) == (name in ("fast", "paper"))
    window.check_look(width, dark)


def test_the_keyboard_alone_is_enough(window, runs):
    """Tab reaches every control, which is native and shows its focus. The slider has its keys."""
    last = show(window, runs["fast"])
    controls = ["field", "lines", "outline", "fixed", "whole", "save", "play", "frame"]
    assert window.run("document.querySelectorAll('select, input, button, summary').length") == len(controls) + 1
    charts = int(window.run("document.documentElement.dataset.charts"))
    for control in [*controls, "picture", *["svg"] * charts, "summary"]:
        window.press("Tab")
        assert window.run("document.activeElement.id || document.activeElement.localName") == control
        assert window.run("getComputedStyle(document.activeElement).outlineStyle") == "solid", control
    window.run("document.getElementById('picture').focus()")
    for key in ("ArrowUp", "ArrowLeft"):
        window.press(key)
        assert "um: Acceptor" in window.run("document.getElementById('probe').textContent")
    window.run("document.querySelector('.chart > svg').focus()")
    window.press("ArrowLeft")
    assert " h: " in window.run("document.querySelector('.chart output').textContent")
    window.run("document.getElementById('fixed').click()")
    last = picture(window)
    window.run("document.getElementById('frame').focus()")
    window.press("ArrowLeft")
    before = picture(window)
    assert int(before["frame"]) == int(last["frame"]) - 1 and before["seen"] != last["seen"]
    assert (before["low"], before["high"]) == (last["low"], last["high"])  # one colour scale for all times
    window.press("Home")
    assert picture(window)["frame"] == "0" and "t = 0 h" in window.run("document.getElementById('now').textContent")


def test_the_button_saves_the_picture_of_the_page(window, runs, tmp_path):
    """The file has the parts that the page shows, in its colours. Its name states the field and the time."""
    show(window, runs["paper"], "#frame=0&field=donor_mg_per_L", width=600)
    window.call("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path))
    window.run("document.getElementById('save').click()")
    file, end = tmp_path / "donor_mg_per_L_0h.svg", time.monotonic() + 30
    while not file.exists():
        assert time.monotonic() < end, f"the button saves no {file.name}, but {[*tmp_path.iterdir()]}"
        time.sleep(0.05)
    background, *saved = [*ElementTree.parse(file).getroot().iter()][1:]
    parts = window.run("[...document.querySelectorAll('#picture *')].map(part => part.getAttribute('d'))")
    assert background.get("fill") == "#ffffff" and [part.get("d") for part in saved] == parts
    assert "var(" not in file.read_text(encoding="utf-8") and len({part.get("fill") for part in saved}) > 50
