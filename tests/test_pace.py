"""How long the steps of the midpoint rule are."""
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from repro.march.step_control import EXCESS, FASTER, SAFETY, STRETCH, StepControl, fit_to_interval, next_step_size
from repro.model.biomass import Rates, change

LENGTHS = st.floats(1e-3, 1e3)


def test_the_change_that_bounds_a_step_is_a_mean_over_the_area():
    """The mean is that of the absolute change: by 1, -1, 0.5 and 0 1/h in points of 1, 1, 6 and 2 um2."""
    first, second = (Rates(np.array(growth), np.full((2, 2), 0.25))
                     for growth in ([[0.0, 1.0], [0.5, 2.0]], [[1.0, 0.0], [1.0, 2.0]]))
    assert change(first, second, np.array([[1.0, 1.0], [6.0, 2.0]])) == pytest.approx(0.5, rel=1e-15)


@given(LENGTHS, st.floats(1e-6, 1e3), st.sampled_from([1.0, STRETCH]))
def test_a_step_leaves_no_tiny_rest(length, remaining, stretch):
    """The remaining time is zero, or at least half a step."""
    step = fit_to_interval(length, remaining, stretch)
    assert 0 < step <= remaining and step <= stretch * length * (1 + 2e-9)
    assert step == remaining or remaining - step >= step * (1 - 1e-9)


@given(st.floats(1e-6, 1e-3), st.floats(0.3, 3.0), st.floats(1.0, 3.0))
def test_steps_under_a_steady_rise_meet_the_tolerance(start, step, rise):
    """The estimate is c h^2, and c rises by the same factor in each step. From the third step on, the estimate is
    SAFETY^2 tolerances and the steps are accepted."""
    control, c = StepControl(step), start
    estimates = []
    for _ in range(8):
        duration = control.length
        estimates.append(c * duration**2)
        control = next_step_size(control, duration, estimates[-1], 0.01)
        c *= rise
    later = [a for a, b in zip(estimates[3:], estimates[2:]) if b > 0.01 / FASTER]
    assert later and all(0.3 * 0.01 < estimate <= EXCESS * 0.01 for estimate in later)
    assert estimates[-1] == pytest.approx(SAFETY**2 * 0.01)


def test_a_step_cut_short_at_a_reported_time_does_not_shorten_the_next():
    """The control proposes 2 h. A step of 0.01 h without error follows, and the next proposal is 2 h again."""
    assert next_step_size(StepControl(2.0), 0.01, 1e-9, 0.01).length == 2.0
