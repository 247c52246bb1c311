"""The references of whole runs, against what is known without them: the averaged pore, and the independent
solver of base.

Their flow and transport are judged by the cases that compare them with ours, to 1e-4 in coupling-presets.
"""
import numpy as np
import pytest

from reference import whole_run
from reference.averaged_pore import Averaged, Pore, half_ellipse

RATES = {"k": 0.4, "F": 1.5, "decay": 0.006, "K_A": 1.0, "K_D": 1.0, "Y": 0.6, "b": 0.005, "remains": 0.001}


def grown(time):
    """(X_A + X_I) over that at the start, at the supply throughout."""
    m_a, m_d = 10 / 11, 8 / 9
    rise, left = m_a * (0.4 * 0.6 * m_d - 0.005), m_a * 0.001
    return np.exp(rise * time) + left / rise * np.expm1(rise * time)


@pytest.mark.parametrize("keeps_shape", [True, False])
def test_where_nothing_is_scarce_growth_is_the_closed_form(keeps_shape):
    """Both kinds of growth stretch alike."""
    thin = Pore(50.0, 600.0, 2000.0, (10.0, 8.0), (1e7, 4e6), (8e6, 3e6), 1e-3, RATES, lambda loss, reach: 1e5)
    found = Averaged(thin, *half_ellipse(20.0, 5.0, 10), 20, keeps_shape).run((1.0, 3.0), accuracy=1e-5)
    for moment, time in zip(found, (1.0, 3.0), strict=True):
        right = 20 * np.sqrt(grown(time))
        assert moment.time == time and moment.area == pytest.approx(np.pi / 2 * 100 * grown(time), rel=1e-5)
        assert moment.ends == pytest.approx((-right, right), rel=1e-5)


def test_a_step_in_time_is_of_fourth_order():
    """A step and two halves differ as the fifth power."""
    run = whole_run.Run(whole_run.Pore(), 2)
    one, half = run.step(run.seed, 4.0), run.step(run.seed, 2.0)
    two, four = run.step(half, 2.0), run.step(run.step(run.seed, 1.0), 1.0)
    first, second = (np.abs(a - b).max() for a, b in ((one, two), (half, four)))
    assert 4.5 < np.log2(first / second) < 5.5
