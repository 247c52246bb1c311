"""Times of clogging of runs whose conductivity falls, or rises first."""
import math

import numpy as np
import pytest

from repro.sweeps import table

#: K / K_0 = exp(-t / 3).
TIMES = np.array([0.0, 0.7, 2.0, 5.0, 9.0, 20.0])
FALLING = np.exp(-TIMES / 3)


@pytest.mark.parametrize("times, relative, part, expected", [
    *((TIMES, FALLING, part, -3 * math.log(part)) for part in (0.5, 0.1, 0.013)), (TIMES, FALLING, 1e-3, math.nan),
    (np.arange(4.0), [1, 0.25, 1, 0.25], 0.5, 0.5),
    (np.arange(6.0), [1.0, 1.4, 1.2, 0.9, 0.45, 0.2], 0.5, 3 + math.log(0.9 / 0.5) / math.log(2)),
    (np.arange(6.0), [1.0, 0.8, 1.5, 0.75, 0.375, 3.0], 0.5, 3 + math.log(0.75 / 0.5) / math.log(2)),
    (np.arange(3.0), [1.0, 2.0, 3.0], 0.5, math.nan)])
def test_the_clogging_time_of_an_exponential_fall_is_exact(times, relative, part, expected):
    """For any rows it is the first time at which a part of the initial conductivity, not of the largest, is left. The
    biomass is 1 + t / 10."""
    computed = table.clogging(times, np.array(relative, float), 1 + times / 10, part)
    assert computed == pytest.approx((expected, 1 + expected / 10), rel=1e-12, nan_ok=True)
