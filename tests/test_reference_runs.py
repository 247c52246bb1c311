"""The references of complete runs, the averaged pore and the independent solver of base, against closed forms.

The cases that compare them with `repro` judge their flow and transport, to 1e-4 in coupling-presets.
"""
import numpy as np
import pytest

from reference.averaged_pore import Averaged, Pore, half_ellipse

RATES = {"k": 0.4, "F": 1.5, "decay": 0.006, "K_A": 1.0, "K_D": 1.0, "Y": 0.6, "b": 0.005, "remains": 0.001}


def growth_factor(time):
    """X_A + X_I over its initial value, with the supply everywhere."""
    m_a, m_d = 10 / 11, 8 / 9
    rise, left = m_a * (0.4 * 0.6 * m_d - 0.005), m_a * 0.001
    return np.exp(rise * time) + left / rise * np.expm1(rise * time)


@pytest.mark.parametrize("keeps_shape", [True, False])
def test_growth_at_the_supply_is_the_closed_form(keeps_shape):
    """Growth with a fixed shape and free growth have the same area and ends."""
    thin = Pore(50.0, 600.0, 2000.0, (10.0, 8.0), (1e7, 4e6), (8e6, 3e6), 1e-3, RATES, lambda loss, reach: 1e5)
    states = Averaged(thin, *half_ellipse(20.0, 5.0, 10), 20, keeps_shape).run((1.0, 3.0), accuracy=1e-5)
    for state, time in zip(states, (1.0, 3.0), strict=True):
        right = 20 * np.sqrt(growth_factor(time))
        assert state.time == time and state.area == pytest.approx(np.pi / 2 * 100 * growth_factor(time), rel=1e-5)
        assert state.ends == pytest.approx((-right, right), rel=1e-5)
