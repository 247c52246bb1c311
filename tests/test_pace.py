"""How long the steps of the midpoint rule are."""
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from repro.march.pace import EXCESS, FASTER, SAFETY, STRETCH, Pace, fitted, following
from repro.model.biomass import Rates, change

LENGTHS = st.floats(1e-3, 1e3)


def test_what_bounds_a_step_is_a_mean_over_the_area():
    """Of the size of the change: points of 1, 1, 6 and 2 um2 in which the rates change by 1, -1, 0.5 and 0 1/h."""
    first, second = (Rates(np.array(growth), np.full((2, 2), 0.25))
                     for growth in ([[0.0, 1.0], [0.5, 2.0]], [[1.0, 0.0], [1.0, 2.0]]))
    assert change(first, second, np.array([[1.0, 1.0], [6.0, 2.0]])) == pytest.approx(0.5, rel=1e-15)


@given(LENGTHS, st.floats(1e-6, 1e3), st.sampled_from([1.0, STRETCH]))
def test_a_step_leaves_no_crumb(length, left, stretch):
    """What remains is nothing, or at least half a step."""
    step = fitted(length, left, stretch)
    assert 0 < step <= left and step <= stretch * length * (1 + 2e-9)
    assert step == left or left - step >= step * (1 - 1e-9)


@given(st.floats(1e-6, 1e-3), st.floats(0.3, 3.0), st.floats(1.0, 3.0))
def test_steps_under_a_steady_rise_meet_the_tolerance(start, step, rise):
    """Where c of the estimate c h^2 rises by the same factor from step to step, the third step and all later ones have
    an estimate of SAFETY^2 tolerances and are taken."""
    pace, c = Pace(step), start
    estimates = []
    for _ in range(8):
        duration = pace.length
        estimates.append(c * duration**2)
        pace = following(pace, duration, estimates[-1], 0.01)
        c *= rise
    settled = [a for a, b in zip(estimates[3:], estimates[2:]) if b > 0.01 / FASTER]
    assert settled and all(0.3 * 0.01 < estimate <= EXCESS * 0.01 for estimate in settled)
    assert estimates[-1] == pytest.approx(SAFETY**2 * 0.01)


def test_a_step_cut_short_to_end_at_a_reported_time_says_little_against_a_long_one():
    """After 2 h were asked for and 0.01 h taken without error, 2 h are asked for again."""
    assert following(Pace(2.0), 0.01, 1e-9, 0.01).length == 2.0
