"""reference/ERRATA.md has every erratum with the present numbers; switches, measured once, and the audit, their other
reader: every choice is a scene that differs in what it says, and a row tells what it measures."""
import re
from collections import Counter
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from repro.march.loop import Instant
from repro.model import pore
from repro.scene import load_scene, scene_tables
from verification import audit, switches
from verification.claims import levels, runs
from verification.claims.runs import BASE, PLATES, WIDE
from verification.errata import ERRATA, percent
from verification.errata.__main__ import REPORT, entry, load
from verification.kernel.writing import markdown
from verification.switches import CHOICES, NUMBERS

IDS = load()
QUICK = [id for id in IDS if ERRATA[id].quick]


@pytest.fixture(scope="module")
def report():
    return REPORT.read_text(encoding="utf-8")


def test_the_report_has_every_entry_once_and_in_order_and_no_number_is_missing(report):
    assert re.findall(r"^## (E\d+)\. ", report, re.M) == IDS
    assert IDS[:13] == [f"E{number}" for number in range(1, 14)]
    assert re.findall(r"\{\w*\}|\bnan\b|\binf\b", report) == []


def section(text, id):
    """One entry of the report, from its title to the next one's."""
    return text[text.index(f"## {id}. "):].split("\n## ")[0]


def words_and_numbers(text):
    """The text without its numbers and table rules, and the numbers; line ends do not count."""
    number = r"(?<![A-Za-z\d_.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?"
    return re.sub(number, "#", " ".join(text.split())), [float(found) for found in re.findall(number, text)]


@pytest.mark.parametrize("id", QUICK)
def test_a_quick_entry_prints_the_same_numbers(report, id):
    """To 5 % or a last digit: another processor rounds otherwise, and the mesher may then choose another triangle."""
    words, numbers = words_and_numbers(section(report, id))
    again, found = words_and_numbers(section(ERRATA[id].markdown(), id))
    assert again == words
    assert found == pytest.approx(numbers, rel=0.05, abs=0.02)


def test_the_text_of_a_slow_entry_is_the_programs(report):
    """Its numbers are not computed here; the words around them must be those of the program."""
    for id in set(IDS) - set(QUICK):
        told = " ".join(section(report, id).split())
        parts = (ERRATA[id].printed, ERRATA[id].reading, *re.split(r"\{\w+\}", ERRATA[id].consequence))
        assert [part for part in parts if " ".join(part.split()) not in told] == [], id


# Switches and audit.
@pytest.mark.parametrize("switch", [*CHOICES.values(), *NUMBERS], ids=lambda switch: switch.change)
def test_a_choice_changes_what_it_names_and_nothing_else(switch):
    """Against the paper's preset."""
    plain, changed = (scene_tables(runs.scene(*run)) for run in (PLATES, switch.run))
    apart = [f"{name}.{key}" for name, table in plain.items() if isinstance(table, dict) for key in table
             if table[key] != changed[name][key]]
    assert apart == [switch.change.partition("=")[0]]


def test_the_default_is_the_papers():
    said = runs.scene(*PLATES)
    assert said.numerics == load_scene("base", ['numerics.preset="paper"']).numerics and said.growth.time_step == 0.2


@pytest.fixture()
def counted(monkeypatch):
    """Runs that are made up: the seed, larger in the run with the change; how often each is computed."""
    calls = Counter()

    @levels.cached
    def history(*run):
        calls[run] += 1
        said = load_scene("base", [f"aggregate.radius={11 if run[1:] else 10} um"])
        now = pore.seeded(said)
        solved = pore.solve(said, now)
        times = (0.0, switches.PLOTTED, 45.0)
        return runs.History(said, tuple(Instant(replace(now, time=time), solved, None, (), 0, {}) for time in times),
                            (), None)

    levels.forget(levels.DEFAULT)
    monkeypatch.setattr(runs, "history", history)
    yield calls
    levels.forget(levels.DEFAULT)


def test_errata_and_audit_read_one_run(counted):
    """Both tell the same difference, of runs that are computed once."""
    switch = CHOICES["rechosen"]
    told = audit.measured(switch, 1.0)["effect"]
    line = re.search(r"^\| base, 19.2 h, rechosen \|(.*)\|$", entry("E20"), re.M)[1]
    assert percent(1 + told["area"], 1) in line.split("|")[-1]
    assert told["area"] == pytest.approx(0.21, rel=1e-3) and told["upstream"] == pytest.approx(0.1, rel=1e-3)
    assert percent(1 + told["upstream"], 1) in line.split("|")[2]
    assert counted == {BASE: 1, switch.run: 1, WIDE: 1, (*WIDE, switch.change): 1}


def test_errata_and_audit_march_once_where_no_scene_can_say_it(counted, monkeypatch):
    """What a restart as J drifts by, of two steps."""
    marches, march = Counter(), switches._march

    def counting(said, step, now):
        marches[step.__name__] += 1
        return march(said, step, now)

    monkeypatch.setattr(switches, "_march", counting)
    monkeypatch.setattr(runs, "scene", lambda *run: load_scene("base", ["numerics.refinement=0.5", "growth.end=0.4 h"]))
    told = audit.drift()
    line = re.search(r"^\| base, before contact \|(.*)\|$", entry("E7"), re.M)[1]
    assert line.split("|")[-1].strip() == f"{100 * told['drift']['alternative']:.2g} %" != "0 %"
    assert marches == {"restarting_as_j": 2}  # of base and of wide


SHORT = (*BASE, "numerics.refinement=0.5", 'aggregate.radius="15 um"', 'growth.end="0.8 h"', 'growth.time_step="0.4 h"')


def short(*changes):
    """Base after two steps on a coarse mesh."""
    return switches.state((*SHORT, *changes), 0.8)


def test_effects_are_relative_and_effluents_over_the_supply():
    said = runs.scene(*SHORT)
    relative = ("velocity", "conductivity", "area", "thickness", "upstream", "downstream")
    default = dict.fromkeys((*relative, *switches.EFFLUENTS), 4.0)
    found = switches.effect(said, default, {name: 5.0 for name in default})
    assert found == {**dict.fromkeys(relative, 0.25), **dict.fromkeys(switches.EFFLUENTS, 0.1)}
    assert audit.largest({"a": -2.0, "b": 1.0}) == "a" and audit.largest({}) == ""


def test_one_state_tells_two_scenes_apart_on_one_mesh():
    """No difference to itself to the last bit; F changes the acceptor, fluid forces the shape alone."""
    found = short()
    assert set(switches.one_state(found, found.scene).values()) == {0.0}
    fluid = switches.one_state(found, runs.scene(*SHORT, 'growth.fluid_forces="included"'))
    assert fluid["velocity"] == fluid["acceptor leaving"] == 0 and 0 < abs(fluid["upstream"]) < 1e-4
    exact = switches.one_state(found, runs.scene(*SHORT, "kinetics.acceptor_to_donor_ratio=1.5138"))
    assert 1e-5 < exact["acceptor leaving"] < 1e-2 and exact["velocity"] == 0


def test_reshaping_to_its_own_outline_changes_nothing_and_to_a_finer_one_hardly_anything():
    """The mesh stays the default's; the flow is that of the other shape: a larger aggregate of the same shape."""
    default, finer = short(), short("numerics.refinement=0.52")
    wide = short('aggregate.radius="15.15 um"')
    own = switches.reshaped(default.pore, default.pore.outline)
    assert np.array_equal(own.mesh.points, default.pore.mesh.points)
    one, two = (each(default, finer) for each in (switches.whole_run, switches.two_meshes))
    assert abs(one["velocity"]) < 0.3 * abs(two["velocity"]) and one["area"] == two["area"]
    before, after = default.pore.outline, switches.reshaped(default.pore, wide.pore.outline).outline
    assert after.area / before.area == pytest.approx((wide.pore.outline.thickness / before.thickness) ** 2, rel=1e-4)
    assert switches.whole_run(default, wide)["velocity"] < -1e-3


def test_what_two_meshes_differ_by_is_no_effect_of_the_extent(monkeypatch):
    """Of the full pore the velocity is 1e-5 more, and on coarser meshes 1e-3 and 2e-3 of their size: not resolved."""
    said = runs.scene(*SHORT)

    def state(run):
        size, full = levels.current().size, any("extent" in change for change in run)
        return SimpleNamespace(scene=said, quantities={"velocity": 100 * (1 + full * (1e-5 + 2e-3 * (size - 0.5))),
                                                       "area": 1 + 1e-4 * full})

    monkeypatch.setattr(switches, "state", state)
    monkeypatch.setattr(audit, "state", None)
    told = audit.measured(CHOICES["full pore"], 3.0)
    assert told["effect"] == pytest.approx({"velocity": 1e-5, "area": 1e-4}, rel=1e-6)
    assert told["noise"] == pytest.approx({"velocity": 1e-3, "area": 0.0}, rel=1e-6, abs=1e-12)
    assert audit.resolved(told["effect"], told["noise"]) == ["area"] and told["one_state"] == {}


def test_marching_is_the_run():
    """Our own loop and the package's make the same steps, and tell the same of them."""
    found, rows = switches.course(SHORT, switches.as_it_is), switches.columns(SHORT)
    assert {len(column) for column in found.columns.values()} == {3} and found.columns["drift"].max() < 0.01
    assert abs(found.columns["lean"]).max() < 1e-2 and found.seconds > 0
    assert found.plotted.quantities == short().quantities
    for name, column in found.columns.items():
        assert rows[name] == pytest.approx(column, rel=1e-12, abs=1e-12)
    assert switches.near(rows, "time", [0.79, 0.0]) == pytest.approx([0.8, 0.0])


@pytest.mark.parametrize("seed, downstream, upstream", [
    (switches.longer_downstream, 5.05, -4.95), (switches.longer_upstream, 4.95, -5.05)])
def test_an_uneven_seed_is_one_percent_off(seed, downstream, upstream):
    """And not a half-disc that has moved; of the same area and density."""
    said = runs.scene(*BASE)
    plain, bulging = pore.seeded(said), seed(said)
    assert (bulging.outline.downstream, bulging.outline.upstream) == pytest.approx((downstream, upstream))
    middle = [(downstream + upstream) / 2, 0.0]
    apart = np.hypot(*(bulging.outline.points[bulging.wall == 0] - middle).T) / 5 - 1
    assert np.ptp(apart) > 0.02 and bulging.outline.area == pytest.approx(plain.outline.area, rel=1e-4)
    assert np.array_equal(bulging.origin, bulging.mesh.points) and bulging.fixed.sum() == 1
    assert (bulging.active == said.kinetics.maximum_density * bulging.space.reaction.dx).all()


def test_the_table_names_every_row_and_what_is_resolved():
    row = {"choice": "extent", "default": "central", "alternative": "full", "cost_ratio": 2.5,
           "effect": {"velocity": -0.01, "area": 0.001}, "one_state": {}, "note": ""}
    text = markdown(audit.blocks({"method": "one changed at a time", "rows": [row]}))
    assert "| extent | central | full | 2.50 | -1 % | +0.1 % |  | -1 % (velocity) |  |  |" in text
    assert audit.resolved(row["effect"], {"velocity": 0.0049, "area": -0.0006}) == ["velocity"]
