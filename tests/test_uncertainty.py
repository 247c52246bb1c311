"""Error bars from values on several sizes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from verification.uncertainty import OBSERVED, estimate

SIZES = np.array([1.0, 2**0.5, 2**-0.5, 0.5])


def test_the_example_of_celik_et_al():
    """J. Fluids Eng. 130 (2008) 078001, Table 1: 18000, 8000 and 4500 cells, p = 1.53, GCI = 2.2 %."""
    result = estimate([1.0, 1.5, 2.0], [6.063, 5.972, 5.863], (2.0, 2.0))
    assert result.order == pytest.approx(1.53, abs=0.005)
    assert 100 * result.bar / 6.063 == pytest.approx(2.2, abs=0.05)


# The bar of a number on several sizes: the law's error, the scatter about the law, and the number's distance from it.
def parts(sizes, values, order):
    """The three terms of a bar with an order, by NumPy's least squares."""
    law = np.column_stack([np.ones(len(sizes)), sizes**order])
    coefficients = np.linalg.lstsq(law, values, rcond=None)[0]
    residual = values - law @ coefficients
    scatter = (residual @ residual / max(len(sizes) - 3, 1)) ** 0.5
    return OBSERVED * abs(coefficients[1]) * sizes[0] ** order, scatter, abs(residual[0])


@given(st.lists(st.floats(-0.15, 0.15), min_size=4, max_size=4), st.floats(0.6, 2.0), st.sampled_from([1.0, -1.0]))
def test_a_bar_is_the_sum_of_its_three_terms(noise, order, sign):
    """This holds for a law with any noise, if the observed order is accepted."""
    values = 7.0 + sign * (SIZES**order + noise)
    result = estimate(SIZES, values, (1.0, 2.0))
    if result.factor == OBSERVED:
        assert result.bar == pytest.approx(sum(parts(SIZES, values, min(result.order, 1.0))), rel=1e-6)
