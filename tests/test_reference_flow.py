"""The references of the flow are right by themselves: strong forms by differences, jumps at interfaces, corners."""
import numpy as np
import pytest
from scipy.optimize import brentq

from reference import layered_channel, manufactured_flow, taylor_hood, viscous_inclusion

FORMS = ("traction", "laplacian")
STEP = 1e-4


def derivatives(field, x, y, h=STEP):
    """(gradient (..., 2), Laplacian (...)) of a field of places by central differences; components of it in front."""
    here, east, west, north, south = (np.moveaxis(field(x + a, y + b), -1, 0) if field(x, y).ndim > 1 else
                                      field(x + a, y + b) for a, b in ((0, 0), (h, 0), (-h, 0), (0, h), (0, -h)))
    return np.stack([east - west, north - south], axis=-1) / (2 * h), (east + west + north + south - 4 * here) / h**2


def stress(velocity, pressure, viscosity, interface, x, y):
    """(K, 2, 2): what the form makes continuous, times the normal."""
    gradient = np.moveaxis(derivatives(velocity, x, y)[0], 0, 1)
    viscous = gradient + np.swapaxes(gradient, 1, 2) if interface == "traction" else gradient
    return viscosity * viscous - pressure(x, y)[:, None, None] * np.eye(2)


def assert_stokes(velocity, pressure, viscosity, x, y, force=0.0):
    """nu lap u = grad p - f and div u = 0."""
    gradient, laplace = derivatives(velocity, x, y)
    assert gradient[0, :, 0] + gradient[1, :, 1] == pytest.approx(np.zeros(len(x)), abs=1e-7)
    assert viscosity * laplace.T == pytest.approx(derivatives(pressure, x, y)[0] - force, abs=1e-6 * max(viscosity, 10))


@pytest.mark.parametrize("ratio", [1.0, 10.0, 2000.0, 1e8])
def test_layers_carry_one_stress_and_a_mean_velocity_of_one(ratio):
    y, h = np.linspace(0.0, 50.0, 5001), 0.01
    u, G = layered_channel.velocity(y, 50.0, 12.5, ratio), layered_channel.gradient(50.0, 12.5, ratio)
    assert np.trapezoid(u, y) / 50 == pytest.approx(1.0, rel=1e-6)
    assert u[[0, -1]] == pytest.approx([0, 0], abs=1e-12)
    viscosity = np.where((y[1:] + y[:-1]) / 2 < 12.5, ratio, 1.0)
    assert np.diff(viscosity * np.diff(u) / h) / h == pytest.approx(np.full(4999, -G), rel=1e-4, abs=1e-7 * ratio)


RADIUS, ANGLE = 1.3, 0.4


def inclusion(ratio, interface):
    """(outside, inside), each (velocity, pressure) as functions of places."""
    def parts(side, *given):
        return tuple(lambda x, y, i=i: side(x, y, *given)[i] for i in (0, 1))

    return (parts(viscous_inclusion.outside, RADIUS, ratio, interface, ANGLE),
            parts(viscous_inclusion.inside, ratio, interface, ANGLE))


@pytest.mark.parametrize("interface", FORMS)
@pytest.mark.parametrize("ratio", [0.1, 10.0, 2000.0])
def test_the_inclusion_solves_stokes_and_its_velocity_and_stress_are_continuous(interface, ratio):
    out, within = inclusion(ratio, interface)
    angle, r = np.random.default_rng(1).uniform([0, 1], [6.28, 3], (40, 2)).T
    assert_stokes(*out, 1.0, r * RADIUS * np.cos(angle), r * RADIUS * np.sin(angle))
    x, y = RADIUS * np.cos(angle), RADIUS * np.sin(angle)
    assert_stokes(*within, ratio, 0.7 * x, 0.7 * y)
    assert out[0](x, y) == pytest.approx(within[0](x, y), abs=1e-12)
    normal = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    there, here = (np.einsum("kij,kj->ki", stress(*side, nu, interface, x, y), normal)
                   for side, nu in ((out, 1.0), (within, ratio)))
    assert there == pytest.approx(here, abs=1e-6)


@pytest.mark.parametrize("interface", FORMS)
@pytest.mark.parametrize("ratio", [10.0, 2000.0])
def test_the_manufactured_force_is_what_the_strong_form_lacks(interface, ratio):
    """By differences, on both sides."""
    velocity, pressure, force = manufactured_flow.evaluated(ratio, interface)
    t = np.linspace(-0.4, 0.4, 9)
    c, s = np.cos(manufactured_flow.ANGLE), np.sin(manufactured_flow.ANGLE)
    for across, viscosity in ((-0.2, 1.0), (0.3, ratio)):
        x, y = across * c - t * s, across * s + t * c
        assert_stokes(velocity, pressure, viscosity, x, y, force(x, y))


@pytest.mark.parametrize("interface", FORMS)
def test_the_three_phase_corner_is_as_singular_as_theory_says(interface):
    """The pressure in biomass held by the wall and free on the side of the water, an angle of 90 degrees: in the
    traction form like r^(z - 1) with cos(z pi / 2) = z (Williams 1952 for an incompressible solid); in the Laplacian
    form, whose components are harmonic but for the pressure, z = 1: bounded."""
    z = brentq(lambda z: np.cos(z * np.pi / 2) - z, 0.1, 0.9) if interface == "traction" else 1.0
    found = taylor_hood.stokes(taylor_hood.half_disc(50.0, (-75.0, 75.0), 25.0, 0, 16), 2000.0, interface)
    part = next(part for part in found.pressures if part.biomass)
    distance = np.hypot(part.points[:, 0] + 25, part.points[:, 1])
    near = [np.abs(part.values[(distance > r / 1.5) & (distance < 1.5 * r)]).max() for r in (2.0**-7, 2.0**-10)]
    assert np.log2(near[1] / near[0]) / 3 == pytest.approx(1 - z, abs=0.03)
