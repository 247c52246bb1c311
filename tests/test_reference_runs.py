"""The references of whole runs, against what is known without them: the averaged pore, and the independent
solver of base.

Their flow and transport are judged by the cases that compare them with ours, to 1e-4 in coupling-presets.
"""
import numpy as np
import pytest

from reference import whole_run
from reference.averaged_pore import Averaged, Pore, half_ellipse
from reference.whole_run import Run

RATES = {"k": 0.4, "F": 1.5, "decay": 0.006, "K_A": 1.0, "K_D": 1.0, "Y": 0.6, "b": 0.005, "remains": 0.001}
PORE = whole_run.Pore()


def pore(density=3e4):
    return Pore(50.0, 600.0, 2000.0, (10.0, 8.0), (1e7, 4e6), (8e6, 3e6), density, RATES, lambda loss, reach: 1e5)


def grown(time):
    """(X_A + X_I) over that at the start, at the supply throughout."""
    m_a, m_d = 10 / 11, 8 / 9
    rise, left = m_a * (0.4 * 0.6 * m_d - 0.005), m_a * 0.001
    return np.exp(rise * time) + left / rise * np.expm1(rise * time)


@pytest.mark.parametrize("keeps_shape", [True, False])
def test_where_nothing_is_scarce_growth_is_the_closed_form(keeps_shape):
    """Both kinds of growth stretch alike."""
    quick = pore(density=1e-3)
    found = Averaged(quick, *half_ellipse(20.0, 5.0, 10), 20, keeps_shape).run((1.0, 3.0), accuracy=1e-5)
    for moment in found:
        right = 20 * np.sqrt(grown(moment.time))
        assert moment.area == pytest.approx(np.pi / 2 * 100 * grown(moment.time), rel=1e-5)
        assert moment.ends == pytest.approx((-right, right), rel=1e-5)
    assert [moment.time for moment in found] == [1.0, 3.0]


def test_the_defaults_are_table_1():
    """Each from the units of Table 1."""
    assert PORE.viscosity * 3600 == pytest.approx(0.01003e-4 / 9.81 * 1e6)  # nu / g is 1.02e-7 m s
    assert [24 * D / 1e8 for D in PORE.diffusivity] == pytest.approx([2.32, 1.01])
    assert [24 * D / 1e8 for D in PORE.in_biomass] == pytest.approx([1.85, 0.81])
    assert [24 * PORE.k, 24 * PORE.b, 24 * PORE.rates["decay"]] == pytest.approx([9.3, 0.12, 0.13632])


def test_a_step_in_time_is_of_fourth_order():
    """A step and two halves differ as the fifth power."""
    run = Run(PORE, 2)
    one, half = run.step(run.seed, 4.0), run.step(run.seed, 2.0)
    two, four = run.step(half, 2.0), run.step(run.step(run.seed, 1.0), 1.0)
    first, second = (np.abs(a - b).max() for a, b in ((one, two), (half, four)))
    assert 4.5 < np.log2(first / second) < 5.5


def test_three_runs_are_extrapolated(monkeypatch):
    """Errors 54 / rings^3 and 32 / steps^4 are found."""
    monkeypatch.setattr(whole_run, "numbers", lambda pore, rings, steps, _: 7.0 + 54 / rings**3 + 32 / steps**4)
    found = whole_run.converged(PORE, (), rings=(2, 3), steps=(1, 2))
    assert [found.values, found.space, found.time] == pytest.approx([7.0, -2.0, -2.0])
