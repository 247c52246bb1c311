"""The reference for erosion, against its differential equations by differences, and limits known without them."""
import numpy as np
import pytest

from reference import erosion

MU, SPEED, K = 0.1, 0.3, 0.02


@pytest.mark.parametrize("solution, rate", [
    (lambda t: erosion.half_disc(10.0, MU, SPEED, t), lambda R: MU * R / 2 - SPEED),
    (lambda t: erosion.layer(4.0, MU, K, t), lambda H: MU * H - K * H**2)], ids=["half-disc", "layer"])
def test_a_closed_form_solves_its_equation(solution, rate):
    for time in (0.0, 1.0, 7.0):
        slope = (solution(time + 1e-4) - solution(time - 1e-4)) / 2e-4
        assert slope == pytest.approx(rate(solution(time)), rel=1e-6)


def test_initial_and_steady_states():
    assert erosion.half_disc(10.0, MU, SPEED, 0.0) == 10.0 and erosion.layer(4.0, MU, K, 0.0) == pytest.approx(4.0)
    assert erosion.half_disc(2 * SPEED / MU, MU, SPEED, 50.0) == pytest.approx(2 * SPEED / MU)
    assert erosion.layer(1.0, MU, K, 500.0) == pytest.approx(MU / K)


@pytest.mark.parametrize("shear, expected", [(lambda H: 0.5, 4 * np.exp(0.5)), (lambda H: 0.0, 4 * np.exp(0.5)),
                                             (lambda H: 2.0, 10 - 6 * np.exp(0.5))])
def test_constant_shear_below_and_above_the_critical_one(shear, expected):
    assert erosion.sheared_layer(4.0, MU, 1.0, 1.0, shear, 5.0) == pytest.approx(expected, rel=1e-8)


def test_shear_of_a_layer_is_that_of_a_narrower_channel():
    """The pressure of a covered channel balances the shear of both walls; a thin cover changes neither."""
    width, viscosity, pressure, length = 50.0, 2.0, 7.0, 300.0
    covered = erosion.at_head(width, viscosity, pressure, length, length)(10.0)
    assert covered == pytest.approx(pressure / length * 40.0 / 2)
    bare = erosion.at_head(width, viscosity, pressure, length, 0.0)(0.0)
    speed = pressure * width**2 / (12 * viscosity * length)
    assert bare == pytest.approx(erosion.at_velocity(width, viscosity, speed)(0.0)) == pytest.approx(
        pressure / length * width / 2)
