"""A reversed trend in a sweep. test_sweep.py has rows whose conductivity rises, test_derived.py charts of a decay."""
import numpy as np
import pytest

from repro.sweeps import table


@pytest.mark.parametrize("relative, expected", [
    ([1.0, 1.4, 1.2, 0.9, 0.45, 0.2], 3 + np.log(0.9 / 0.5) / np.log(2)), ([1.0, 2.0, 3.0], np.nan),
    ([1.0, 0.8, 1.5, 0.75, 0.375, 3.0], 3 + np.log(0.75 / 0.5) / np.log(2))])
def test_a_pore_that_first_conducts_more_clogs_at_half_of_the_start(relative, expected):
    """The limit is half of the initial conductivity, not of the largest."""
    times = np.arange(float(len(relative)))
    clogged = table.clogging(times, np.array(relative), 10 - times, 0.5)
    assert clogged == pytest.approx((expected, 10 - expected), rel=1e-12, nan_ok=True)
