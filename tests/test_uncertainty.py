"""Error bars from values on several sizes; and the levels for them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from verification import claims
from verification.claims import evaluate
from verification.claims.levels import ALONE, CONVERGED, DEFAULT, SCHEME, WIDE_FINE
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


# Levels.
#: Claims with fewer than three sizes of the scheme of 2001: linear elements have no permeable body (C42), and
#: comparisons of many or long runs would take minutes (C32, C41, C43). Claims about wide have two.
FEWER_OF_SCHEME = {"C32": 1, "C41": 1, "C43": 1, "C48": 1, "C49": 1, "C50": 0, "C52": 0, "C53": 0}


def test_every_claim_has_three_meshes_and_three_steps_or_a_reason():
    """A claim about the model is also computed with the scheme; one that is not judged has a single level."""
    evaluate.register_all()
    for claim in claims.CLAIMS.values():
        kinds = [level.kind for level in claim.levels]
        if claim.unjudged:
            assert claim.levels == (claim.judged,), claim.id
        elif claim.about == claims.MODEL:
            scheme = FEWER_OF_SCHEME.get(claim.id, 2 if claim.fine == WIDE_FINE else 3)
            assert (kinds.count(CONVERGED), kinds.count(SCHEME)) == (3, scheme), claim.id
            assert claim.judged == claim.levels[0] and claim.judged.size == min(claim.fine), claim.id
        elif claim.about == claims.OF_SCHEME:
            assert len(claim.sizes) >= 3 and claim.sizes[0] == claim.steps[0] == 1.0, claim.id
            assert len(claim.steps) >= 3 or claim.steps == ALONE and claim.fixed, claim.id
        else:
            assert claim.about == claims.CLOSED and claim.levels == (DEFAULT,), claim.id
