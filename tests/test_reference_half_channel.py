"""The closed forms of a half channel (reference/half_channel.py) against a whole channel and an integrator of ODEs."""
import numpy as np
import pytest
from scipy.integrate import quad, solve_bvp
from skfem import Basis, ElementTriP2

from reference import half_channel, poiseuille, taylor_hood

HALF, LAYER = 50.0, 12.5
LAYERS = pytest.mark.parametrize("layers, parameter", [
    (half_channel.Viscous, 7.0), (half_channel.Viscous, 2000.0), (half_channel.Permeable, 100.0),
    (half_channel.Permeable, 4.0)])


@LAYERS
def test_half_of_a_channel_with_two_layers_is_that_channel(layers, parameter):
    """Both layers, and no symmetry: the stress and the velocity are integrated from wall to wall."""
    viscous = layers is half_channel.Viscous
    parts = np.array([0.0, LAYER, 2 * HALF - LAYER, 2 * HALF])

    def slopes(s, state):
        """Of velocity and stress in each part, over its length."""
        rates = []
        for k, length in enumerate(np.diff(parts)):
            velocity, stress = state[2 * k: 2 * k + 2]
            biomass = k != 1
            viscosity = parameter if viscous and biomass else 1.0
            drag = velocity / parameter if biomass and not viscous else 0.0 * velocity
            rates += [length * stress / viscosity, length * (drag - 1.0)]
        return np.array(rates)

    def ends(start, end):
        """No slip, and continuous velocity and stress."""
        return np.array([start[0], end[4], *(end[:4] - start[2:])])

    s = np.linspace(0, 1, 200)
    solution = solve_bvp(slopes, ends, s, np.zeros((6, len(s))), tol=1e-9, max_nodes=100_000)
    assert solution.success
    flux = sum(length * quad(lambda s, k=k: solution.sol(s)[2 * k], 0, 1, limit=200)[0]
               for k, length in enumerate(np.diff(parts)))
    assert layers.gradient(HALF, LAYER, parameter) == pytest.approx(2 * HALF / flux, rel=1e-6)
    for k, height in [(0, 0.3), (0, 0.9), (1, 0.0), (1, 0.2), (1, 0.5)]:
        y = parts[k] + height * (parts[k + 1] - parts[k])
        expected = 2 * HALF / flux * solution.sol(height)[2 * k]
        assert layers.velocity(y, HALF, LAYER, parameter) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("y", [0.0, 10.0, 20.0, 50.0])
def test_without_a_layer_it_is_half_of_poiseuilles_parabola(y):
    assert half_channel.Viscous.velocity(y, HALF, LAYER, 1.0) == pytest.approx(poiseuille.velocity(y, 2 * HALF))
    assert half_channel.Viscous.gradient(HALF, LAYER, 1.0) == pytest.approx(poiseuille.head_loss(1, 2 * HALF, 1, 1))


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
