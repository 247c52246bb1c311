"""The closed forms of a half channel (reference/half_channel.py) obey their equations; a mesh and its mirror image."""
import numpy as np
import pytest
from scipy.integrate import quad
from skfem import Basis, ElementTriP2

from reference import half_channel, poiseuille, taylor_hood
from tests.test_reference_fields import first_and_second

HALF, LAYER = 50.0, 12.5


@pytest.mark.parametrize("layers, parameter", [
    (half_channel.Viscous, 7.0), (half_channel.Viscous, 2000.0), (half_channel.Permeable, 100.0),
    (half_channel.Permeable, 4.0)])
def test_a_half_channel_obeys_its_equations(layers, parameter):
    """No slip at the wall, the balance of forces in both layers, a continuous stress between them, none in the middle,
    and a mean velocity of one."""
    G = layers.gradient(HALF, LAYER, parameter)
    ratio, drag = (parameter, 0.0) if layers is half_channel.Viscous else (1.0, 1 / parameter)

    def u(y):
        return layers.velocity(y, HALF, LAYER, parameter)

    inside, above = np.linspace(0.5, LAYER - 0.5, 9), np.linspace(LAYER + 0.5, HALF - 0.5, 9)
    for y, viscosity, of_velocity in ((inside, ratio, drag), (above, 1.0, 0.0)):
        assert viscosity * first_and_second(u, y)[1] == pytest.approx(of_velocity * u(y) - G, abs=1e-3 * G)
    below, beyond, middle = first_and_second(u, np.array([LAYER - 1e-3, LAYER + 1e-3, HALF - 1e-3]), 1e-4)[0]
    assert ratio * below == pytest.approx(beyond, rel=1e-3) and abs(middle) < 1e-2 * G
    assert u(0.0) == pytest.approx(0.0, abs=1e-12) and u(LAYER - 1e-9) == pytest.approx(u(LAYER + 1e-9), rel=1e-6)
    assert quad(u, 0, HALF, points=[LAYER], limit=200)[0] / HALF == pytest.approx(1.0, rel=1e-8)


def test_a_mirrored_channel_has_both_half_discs_and_poiseuilles_loss_with_water_in_them():
    """Curved edges of the image lie on its arc, so areas double to the last digits of the half. Triangles beside the
    arc are curved, so they do not contain a parabola to round-off."""
    half = taylor_hood.half_disc(50.0, (-60.0, 70.0), 20.0, 0, corner=1)
    whole = taylor_hood.mirrored(half)
    areas = [Basis(channel.mesh, ElementTriP2(), intorder=6).dx.sum(axis=1) for channel in (half, whole)]
    assert whole.width == 100.0 and areas[1].sum() == pytest.approx(100 * 130, rel=1e-12)
    assert areas[1][whole.biomass].sum() == pytest.approx(2 * areas[0][half.biomass].sum(), rel=1e-12)
    assert areas[1][whole.biomass].sum() == pytest.approx(np.pi * 20.0**2, rel=1e-3)
    assert taylor_hood.stokes(whole, 1.0).loss == pytest.approx(poiseuille.head_loss(130, 100.0, 1, 1), rel=1e-5)
