"""The pages in a real browser: the scripts run, the slider and its keys change the picture, nothing is asked for."""

import json
import re
import socket
import threading

import meshio
import numpy as np
import pytest

from repro import results
from repro.cli import main
from repro.report import fields
from tests import browser
from tests.pages import FAST, hostile, run, stored

pytestmark = [pytest.mark.thorough,
              pytest.mark.skipif(browser.CHROMIUM is None, reason="there is no Chromium here to look at pages with")]


@pytest.fixture(scope="module")
def window():
    with browser.Browser() as found:
        yield found


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """{name: folder} of runs of every kind."""
    kinds = {"fast": ("base", FAST, 'growth.end="19.4 h"'), "paper": ("base", 'growth.end="1 h"'),
             "flow": ("flow_only",), "mesh": ("initial_mesh",), "wide": ("wide", FAST, 'growth.end="2 h"')}
    made = {name: run(tmp_path_factory.mktemp(name), *given) for name, given in kinds.items()}
    scene = tmp_path_factory.mktemp("transport") / "transport.toml"
    scene.write_text('[flow]\nhead = "1e-3 cm"\n[substrates.acceptor]\n[substrates.donor]\n')
    return made | {"transport": run(scene.parent, scene)}


def show(window, out, fragment="", **look):
    """Open a run's page; what its script says of the picture. No error, no request but for the page itself."""
    page = out if out.suffix else out / "report.html"
    window.show(page, fragment, **look)
    assert window.run("document.getElementById('errors').textContent") == ""
    assert window.requests == [page.resolve().as_uri() + fragment.partition("#")[0]]
    return picture(window)


def picture(window):
    return json.loads(window.run("JSON.stringify({...(document.getElementById('picture') ?? {dataset: {}}).dataset})"))


@pytest.mark.parametrize("width, dark", [(1200, False), (375, True)])
@pytest.mark.parametrize("name", ["fast", "paper", "flow", "mesh", "wide", "transport"])
def test_pages_open_from_disk_without_error(window, runs, name, width, dark):
    """At a phone's width nothing is cut off."""
    found = show(window, runs[name], width=width, dark=dark)
    assert found["frame"] == str(len(stored(runs[name])["frames"]) - 1) and float(found["filled"]) > 0.9
    charts = int(window.run("document.documentElement.dataset.charts"))
    assert (charts > 10) == (name in ("fast", "paper", "wide"))
    assert window.run("document.documentElement.scrollWidth") <= width
    colour = window.run("getComputedStyle(document.body).backgroundColor")
    assert (max(map(int, re.findall(r"\d+", colour))) < 128) == dark


def test_the_slider_shows_other_times(window, runs):
    """By its keys, and by a click on a chart."""
    last = show(window, runs["fast"])
    window.run("document.getElementById('frame').focus()")
    window.press("ArrowLeft")
    before = picture(window)
    assert int(before["frame"]) == int(last["frame"]) - 1 and before["seen"] != last["seen"]
    assert (before["low"], before["high"]) == (last["low"], last["high"])  # one colour scale for all times
    window.press("Home")
    first = picture(window)
    assert first["frame"] == "0" and "t = 0 h" in window.run("document.getElementById('now').textContent")
    window.press("End")
    assert picture(window) == last
    window.run("document.querySelector('figure svg').scrollIntoView()")
    box = json.loads(window.run("JSON.stringify(document.querySelector('figure > svg').getBoundingClientRect())"))
    for kind in ("mousePressed", "mouseReleased"):
        window.call("Input.dispatchMouseEvent", type=kind, x=box["x"] + box["width"] * 0.168, y=box["y"] + 80,
                    button="left", clickCount=1)
    assert picture(window) == first


def test_every_field_has_its_own_picture(window, runs):
    """As the fragment asks."""
    found = {}
    for field in stored(runs["fast"])["fields"]:
        told = show(window, runs["fast"], f"#frame=3&field={field['name']}")
        assert (told["field"], told["frame"]) == (field["name"], "3")
        found[field["name"]] = told["seen"]
    assert len(set(found.values())) >= len(found) - 1 and len(found) == 16  # theta is J


@pytest.mark.parametrize("name", ["fast", "paper"])
def test_the_picture_is_the_field(window, runs, name):
    """Pixels at the nodes, and the area that is coloured for the aggregate: on curved triangles too."""
    out = runs[name]
    show(window, out, "#field=acceptor_mg_per_L", width=1400)
    _, path = fields.index(out)[-1]
    grid = meshio.vtu.read(path)
    x, y = grid.points[:, :2].T
    inside = (np.abs(x) < 40) & (y > 1) & (y < y.max() - 1)
    value = "(x, y) => shown.all[Math.floor((shown.tall - (y - shown.box[2]) * shown.scale) * shown.ratio) * " \
            "shown.size[0] + Math.floor((x - shown.box[0]) * shown.scale * shown.ratio)]"
    places = grid.points[inside, :2].tolist()
    drawn = np.array(window.run(f"{json.dumps(places)}.map(([x, y]) => ({value})(x, y))"))
    wanted = grid.point_data["acceptor_mg_per_L"][inside]
    assert np.abs(drawn - wanted).max() < 0.02 * np.ptp(wanted)
    show(window, out, "#field=theta", width=1400)
    share, box = float(picture(window)["filled"]), stored(out)["box"]
    area = results.read_table(out / "timeseries.csv")["aggregate_area_um2"][-1]
    assert share * (box[1] - box[0]) * (box[3] - box[2]) == pytest.approx(area, rel=0.004 if name == "fast" else 0.02)


def test_a_pointer_is_told_values(window, runs):
    show(window, runs["fast"])
    window.run("document.getElementById('picture').scrollIntoView()")
    box = json.loads(window.run("JSON.stringify(document.getElementById('picture').getBoundingClientRect())"))
    window.point(box["x"] + box["width"] / 2, box["y"] + 40)
    told = window.run("document.getElementById('probe').textContent")
    assert re.fullmatch(r"x = -?[\d.]+ um, y = [\d.]+ um: Velocity \(magnitude\) [\d.]+ m/day", told)
    window.run("document.querySelector('figure > svg').scrollIntoView()")
    box = json.loads(window.run("JSON.stringify(document.querySelector('figure > svg').getBoundingClientRect())"))
    window.point(box["x"] + 0.95 * box["width"], box["y"] + 80)
    told = window.run("document.querySelector('figure output').textContent")
    last = results.read_table(runs["fast"] / "timeseries.csv")["conductivity_m_per_d"][-1]
    assert told == f"19.4 h: {last:.5g}"


def test_mesh_lines_and_scales_are_switches(window, runs):
    show(window, runs["fast"], "#frame=0&field=theta")
    image = "document.getElementById('picture').toDataURL()"
    plain, told = window.run(image), picture(window)
    window.run("document.getElementById('lines').click()")
    assert window.run(image) != plain and picture(window) == told
    window.run("document.getElementById('fixed').click()")
    assert float(picture(window)["high"]) < float(told["high"])


def test_a_run_that_stops_before_its_first_row(window, tmp_path, monkeypatch):
    from repro.errors import SimulationError
    from repro.run import running

    def stops(scene, state=None):
        raise SimulationError("no")
        yield

    monkeypatch.setattr(running, "steps", stops)
    assert show(window, run(tmp_path, "base", status=1)) == {}


def test_hostile_names_run_nothing(window, tmp_path):
    """Neither from a scene and its status, nor through the policy."""
    out = hostile(run(tmp_path, "base", FAST, 'growth.end="1 h"'))
    from repro import report

    report.write(out)
    report.compare([out, out], tmp_path / "both.html")
    for page in (out, tmp_path / "both.html"):
        show(window, page)
        assert window.run("typeof pwned") == "undefined" and window.run("document.images.length") == 0
    window.run("document.body.append(Object.assign(document.createElement('script'), {textContent: 'pwned = 1'}))")
    assert window.run("typeof pwned") == "undefined"


def test_the_policy_lets_nothing_out(window, runs):
    """A listener on the loopback hears nothing of what a script in the page tries."""
    heard = []
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(2)
        thread = threading.Thread(target=lambda: heard.append(_accepted(server)))
        thread.start()
        show(window, runs["flow"])
        there = f"http://127.0.0.1:{server.getsockname()[1]}/"
        tried = f"fetch('{there}').then(() => 'through', () => 'stopped')"
        assert window.run(tried) == "stopped"
        window.run(f"new Image().src = '{there}'")
        thread.join()
    assert heard == [False]


def _accepted(server):
    try:
        server.accept()[0].close()
        return True
    except TimeoutError:
        return False


@pytest.mark.parametrize("width", [1200, 375])
def test_a_comparison_opens(window, runs, tmp_path, width):
    target = tmp_path / "both.html"
    assert main(["compare", *map(str, (runs["fast"], runs["paper"], runs["flow"])), "--out", str(target)]) == 0
    show(window, target, width=width)
    assert int(window.run("document.documentElement.dataset.charts")) > 20
    assert window.run("document.documentElement.scrollWidth") <= width
    assert window.run("document.querySelectorAll('figure:first-of-type .legend > span').length") == 3
