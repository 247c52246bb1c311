"""reference/ERRATA.md has every erratum with the present numbers; switches, measured once, and the audit, their other
reader: every choice is a scene that differs in what it says, and a row tells what it measures."""
import re

import pytest

from repro.scene import scene_tables
from verification import switches
from verification.claims import runs
from verification.claims.runs import BASE, PLATES
from verification.errata import ERRATA
from verification.errata.__main__ import REPORT, load
from verification.errata.scheme import HALF_STEP
from verification.errata.substrates import NO_D_C
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


# Switches.
@pytest.mark.parametrize("run", [*(switch.run for switch in (*CHOICES.values(), *NUMBERS)), HALF_STEP, NO_D_C],
                         ids=lambda run: run[1])
def test_a_choice_changes_what_it_names_and_nothing_else(run):
    """Against the paper's preset."""
    plain, changed = (scene_tables(runs.scene(*run)) for run in (PLATES, run))
    apart = [f"{name}.{key}" for name, table in plain.items() if isinstance(table, dict) for key in table
             if table[key] != changed[name][key]]
    assert apart == [run[1].partition("=")[0]] and plain["numerics"]["preset"] == "paper"


SHORT = (*BASE, "numerics.refinement=0.5", 'aggregate.radius="15 um"', 'growth.end="0.8 h"', 'growth.time_step="0.4 h"')


def short(*changes):
    """Base after two steps on a coarse mesh."""
    return switches.state((*SHORT, *changes), 0.8)


def test_one_state_tells_two_scenes_apart_on_one_mesh():
    """No difference to itself to the last bit; F changes the acceptor, fluid forces the shape alone."""
    found = short()
    assert set(switches.one_state(found, found.scene).values()) == {0.0}
    fluid = switches.one_state(found, runs.scene(*SHORT, 'growth.fluid_forces="included"'))
    assert fluid["velocity"] == fluid["acceptor leaving"] == 0 and 0 < abs(fluid["upstream"]) < 1e-4
    exact = switches.one_state(found, runs.scene(*SHORT, "kinetics.acceptor_to_donor_ratio=1.5138"))
    assert 1e-5 < exact["acceptor leaving"] < 1e-2 and exact["velocity"] == 0
