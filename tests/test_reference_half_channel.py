"""The closed form of a half channel (reference/half_channel.py) obeys its equations."""
import numpy as np
import pytest
from scipy.integrate import quad

from reference import half_channel
from tests.test_reference_fields import first_and_second

HALF, LAYER = 50.0, 12.5


@pytest.mark.parametrize("ratio", [7.0, 2000.0])
def test_a_half_channel_obeys_its_equations(ratio):
    """No slip at the wall, the balance of forces in both layers, a continuous stress between them, none in the middle,
    and a mean velocity of one."""
    G = half_channel.gradient(HALF, LAYER, ratio)

    def u(y):
        return half_channel.velocity(y, HALF, LAYER, ratio)

    inside, above = np.linspace(0.5, LAYER - 0.5, 9), np.linspace(LAYER + 0.5, HALF - 0.5, 9)
    for y, viscosity in ((inside, ratio), (above, 1.0)):
        assert viscosity * first_and_second(u, y)[1] == pytest.approx(-G, abs=1e-3 * G)
    below, beyond, middle = first_and_second(u, np.array([LAYER - 1e-3, LAYER + 1e-3, HALF - 1e-3]), 1e-4)[0]
    assert ratio * below == pytest.approx(beyond, rel=1e-3) and abs(middle) < 1e-2 * G
    assert u(0.0) == pytest.approx(0.0, abs=1e-12) and u(LAYER - 1e-9) == pytest.approx(u(LAYER + 1e-9), rel=1e-6)
    assert quad(u, 0, HALF, points=[LAYER], limit=200)[0] / HALF == pytest.approx(1.0, rel=1e-8)
