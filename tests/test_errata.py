"""reference/ERRATA.md has every erratum with current numbers. Every switch is a scene that differs in exactly its
choice."""
import re

import pytest

from repro.scene import scene_tables
from verification.claims import runs
from verification.claims.runs import PLATES
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
    """Return one entry of the report, up to the next title."""
    return text[text.index(f"## {id}. "):].split("\n## ")[0]


def words_and_numbers(text):
    """Return a text without its numbers and line ends, and the numbers."""
    number = r"(?<![A-Za-z\d_.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?"
    return re.sub(number, "#", " ".join(text.split())), [float(digits) for digits in re.findall(number, text)]


@pytest.mark.parametrize("id", QUICK)
def test_a_quick_entry_prints_the_same_numbers(report, id):
    """They agree to 5 % or a last digit: processors round differently, and the mesher may choose another triangle."""
    words, numbers = words_and_numbers(section(report, id))
    again, computed = words_and_numbers(section(ERRATA[id].markdown(), id))
    assert again == words
    assert computed == pytest.approx(numbers, rel=0.05, abs=0.02)


# Switches.
@pytest.mark.parametrize("run", [*(switch.run for switch in (*CHOICES.values(), *NUMBERS)), HALF_STEP, NO_D_C],
                         ids=lambda run: run[1])
def test_a_choice_changes_only_its_key(run):
    """Every choice is compared with the paper's preset."""
    plain, changed = (scene_tables(runs.load_packaged(*run)) for run in (PLATES, run))
    apart = [f"{name}.{key}" for name, table in plain.items() if isinstance(table, dict) for key in table
             if table[key] != changed[name][key]]
    assert apart == [run[1].partition("=")[0]] and plain["numerics"]["preset"] == "paper"
