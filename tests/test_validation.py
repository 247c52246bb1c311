"""The page of the validation has the recorded rows, and verdicts follow from numbers."""
import math
import re

import numpy as np
import pytest

from verification import validation
from verification.evidence.writing import load

PAGE, RECORD = validation.PAGE.read_text(encoding="utf-8"), load(validation.RECORD, {})
MARKS = re.findall(r"<!-- validation: begin (\w+) -->", PAGE)


def test_the_page_has_the_recorded_rows_of_every_section():
    """Each section of the record stands on the page once, and its words before the table state a criterion."""
    assert MARKS == ["summary", *validation.SECTIONS] and list(RECORD) == [*validation.SECTIONS]
    assert validation.within(PAGE, RECORD) == PAGE
    for name, text in zip(MARKS[1:], re.split(r"<!-- validation: begin \w+ -->", PAGE)[1:]):
        section = text.rpartition("\n## ")[2]
        assert all(f"**{word}.**" in section for word in ("Compared", "Criterion")), name


def test_a_changed_record_changes_the_page():
    changed = {**RECORD, "jiao": [["permeability", "1", "2", "disagrees"]]}
    page = validation.within(PAGE, changed)
    assert page != PAGE and "| permeability | 1 | 2 | disagrees |" in page and validation.within(page, RECORD) == PAGE


def test_verdicts_are_words_and_a_prediction_has_none():
    words = {*validation.VERDICTS.values(), *validation.EFFECTS.values()}
    assert {row[3] for rows in RECORD.values() for row in rows} <= words
    assert {row[3] for row in RECORD["figure_1"]} == {""}


def test_a_change_without_a_source_is_counted_without_a_verdict():
    record = {"jiao": [["q", "", "", word] for word in ("agrees", "disagrees", "", "does not matter", "matters")]}
    assert [counted[1:] for counted in validation.counts(PAGE, record)] == [(1, 1, 3)]


def test_no_number_of_the_record_is_missing():
    assert not any("nan" in cell or "inf" in cell for rows in RECORD.values() for row in rows for cell in row)


@pytest.mark.parametrize("exponents, verdict", [((3.0, 3.0), "disagrees"), ((3.0, 9.0), "agrees"),
                                                ((9.0, 3.0), "agrees")])
def test_two_exponentials_agree_with_the_columns_and_one_does_not(exponents, verdict):
    """Judge ln K of slopes that change at a loss of 50 %."""
    fraction = np.linspace(0, 2, 4001)
    half = math.log(2) / exponents[0]
    left = np.exp(-exponents[0] * np.minimum(fraction, half) - exponents[1] * np.maximum(fraction - half, 0))
    row = validation._exponential("made", fraction, left)
    assert row[3] == verdict and row[2] == f"1.00, {exponents[1] / exponents[0]:.2f}"


def test_only_a_factor_of_2000_that_is_reached_has_a_time():
    hours = np.array([0.0, 24.0, 48.0])
    assert validation._expanded(hours, np.array([1.0, 2000.0, 4e6])) == (pytest.approx(24.0), "24")
    time, words = validation._expanded(hours, np.array([1.0, 20.0, 400.0]))
    assert math.isnan(time) and words == "not until 48 h, 400 times"


def test_a_curve_that_bends_is_no_exponential():
    fraction = np.linspace(0, 0.999, 4001)
    assert validation._exponential("made", fraction, (1 - fraction**2) ** 3)[3] == "disagrees"


def test_a_layer_leaves_the_conductivity_of_the_gap_above_it():
    """Biomass 2000 times as viscous as water is nearly a wall; a filled pore has 1 / 2000 of the conductivity."""
    assert validation.layer_left(0.5) == pytest.approx(0.5**3, rel=0.01)
    assert validation.layer_left(1 - 1e-9) == pytest.approx(1 / 2000, rel=1e-3)

