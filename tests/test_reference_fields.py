"""The references are right by themselves: closed forms and made-up fields obey their equations, by differences.

That the other codes (FiPy, py-pde, collocation, scikit-fem) and the dense transfer are what is said of them is judged
by the cases that compare them with ours.
"""
import numpy as np
import pytest

from reference import (
    layered_channel,
    manufactured_flow,
    manufactured_growth,
    manufactured_transport,
    neo_hookean,
    quadratic_mesh_motion,
    robin_channel,
    slab,
    sliding_waves,
    viscous_inclusion,
)
from reference.monod import sink, slopes, uptake

FORMS = ("traction", "laplacian")
STEP = 1e-4


def derivatives(field, x, y, h=STEP):
    """(gradient (..., 2), Laplacian (...)) of a field of places by central differences; components of it in front."""
    here, east, west, north, south = (np.moveaxis(field(x + a, y + b), -1, 0) if field(x, y).ndim > 1 else
                                      field(x + a, y + b) for a, b in ((0, 0), (h, 0), (-h, 0), (0, h), (0, -h)))
    return np.stack([east - west, north - south], axis=-1) / (2 * h), (east + west + north + south - 4 * here) / h**2


def divergence(field, x, y, h=STEP):
    """Of the last index."""
    gradient, _ = derivatives(field, x, y, h)
    return gradient[0, ..., 0] + gradient[1, ..., 1]


def along(function, x, step=1e-3):
    """(first, second) derivative of a function of one place."""
    return ((function(x + step) - function(x - step)) / (2 * step),
            (function(x + step) - 2 * function(x) + function(x - step)) / step**2)


def stress(velocity, pressure, viscosity, interface, x, y):
    """(K, 2, 2): what the form makes continuous, times the normal."""
    gradient = np.moveaxis(derivatives(velocity, x, y)[0], 0, 1)
    viscous = gradient + np.swapaxes(gradient, 1, 2) if interface == "traction" else gradient
    return viscosity * viscous - pressure(x, y)[:, None, None] * np.eye(2)


def assert_stokes(velocity, pressure, viscosity, x, y, force=0.0):
    """nu lap u = grad p - f and div u = 0."""
    assert divergence(velocity, x, y) == pytest.approx(np.zeros(len(x)), abs=1e-7)
    laplace, slope = derivatives(velocity, x, y)[1], derivatives(pressure, x, y)[0]
    assert viscosity * laplace.T == pytest.approx(slope - force, abs=1e-6 * max(viscosity, 10))


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


#: theta = a + c (R / R_0)^2 by a, c, R_0.
LAW = (12.0, 24.0, 20.0)


def test_the_cylinder_is_in_equilibrium_and_free_on_its_rim():
    """d sigma_rr / dr = (sigma_tt - sigma_rr) / r, and sigma_rr = 0 where R = R_0, by differences of the closed form's
    own numbers."""
    R = np.linspace(1.0, 20.0, 400)
    r, P = neo_hookean.cylinder_radius(R, *LAW), neo_hookean.cylinder_pressure(R, *LAW)
    theta, hoop = LAW[0] + LAW[1] * (R / LAW[2]) ** 2, r / R
    sigma = np.array([neo_hookean.cauchy(np.diag([t / h, h]), p) for t, h, p in zip(theta, hoop, P)])
    slope = np.gradient(sigma[:, 0, 0], r, edge_order=2)
    expected = (sigma[:, 1, 1] - sigma[:, 0, 0]) / r
    assert sigma[-1, 0, 0] == pytest.approx(0.0, abs=1e-14)
    assert slope == pytest.approx(expected, abs=1e-3 * np.abs(expected).max())


@pytest.mark.parametrize("name", manufactured_growth.PRESSURES)
def test_the_made_up_growth_is_held_by_its_loads(name):
    """theta is the determinant, S the closed form's stress, f = -Div S: by differences of step h, to h^2."""
    made, h = manufactured_growth.growth(name), 1e-5
    X, Y = np.random.default_rng(3).uniform(0.1, 0.9, (2, 20))
    F = np.moveaxis(derivatives(made.place, X, Y, h)[0], 0, 1)
    J = np.linalg.det(F)
    sigma = np.array([neo_hookean.cauchy(f, p)[:2, :2] for f, p in zip(F, made.pressure(X, Y))])
    assert made.theta(X, Y) == pytest.approx(J, rel=1e-9)
    assert made.stress(X, Y) @ np.swapaxes(F, 1, 2) / J[:, None, None] == pytest.approx(sigma, abs=1e-8)
    assert made.force(X, Y) == pytest.approx(-divergence(made.stress, X, Y, h), abs=1e-7)


@pytest.mark.parametrize("gamma", [0.1, 1.0, 10.0])
def test_sliding_waves_solve_35_and_slide_along_walls_and_end(gamma):
    """By differences."""
    def d(s, y):
        return sliding_waves.displacement(s, y, 20.0, gamma, 20.0).T

    s, y, h = *np.random.default_rng(2).uniform([1, 1], [19, 19], (30, 2)).T, 1e-3
    laplace = derivatives(d, s, y, h)[1]
    slope = derivatives(lambda s, y: divergence(d, s, y, h), s, y, h)[0]
    assert laplace.T == pytest.approx(-slope / gamma, abs=1e-6 * np.abs(laplace).max())
    for wall in (0.0, 20.0):
        assert np.abs(d(s, wall)[:, 1]).max() < 1e-12
        assert np.abs(d(s, wall + h)[:, 0] - d(s, wall - h)[:, 0]).max() < 1e-9
    assert np.abs(d(0.0, y)[:, 0]).max() == 0.0
    assert np.abs(d(h, y)[:, 1] - d(-h, y)[:, 1]).max() < 1e-9


@pytest.mark.parametrize("gamma", [0.1, 1.0, 10.0])
def test_the_corner_exponent_makes_the_displacement_vanish_on_the_held_side(gamma):
    """kappa s^z - z s conj(s)^(z-1) = B conj(s)^z with a real B; gamma without end: the Laplace operator's pi / (2 w).
    """
    w = np.radians(120)
    z, s = quadratic_mesh_motion.exponent(w, gamma), np.exp(1j * w)
    B = ((1 + 2 * gamma) * s**z - z * s * np.conj(s) ** (z - 1)) / np.conj(s) ** z
    assert abs(B.imag) < 1e-10 and 0.5 < z < 1
    assert quadratic_mesh_motion.exponent(w, 1e9) == pytest.approx(0.75)


RATES = {"k": 0.4, "F": 1.5, "decay": 0.006, "K_A": 1.0, "K_D": 2.0}
WATER, BIOMASS = 9e6, 7e6
HALF, SUPPLY = 40.0, 10.0


def test_uptake_is_dual_monod_and_its_slopes_are_its_derivative():
    """(7)-(8) written out."""
    q_a, q_d = uptake(3.0, 6.0, RATES)
    assert q_a == pytest.approx(0.75 * (0.4 * 1.5 * 0.75 + 0.006)) and q_d == pytest.approx(0.4 * 0.75 * 0.75)
    fields, load = np.array([3.0, 0.5, 6.0, 0.1]), np.array([2.0, 5.0])
    change = 1e-5 * np.array([1.0, -2.0, 3.0, 1.0])
    rise = sink(fields + change, load, RATES) - sink(fields - change, load, RATES)
    assert slopes(fields, load, RATES) @ (2 * change) == pytest.approx(rise, rel=1e-6)


def test_the_robin_channel_obeys_its_equation_and_its_conditions():
    """Strip, (26) upstream, flux u C_s at any inlet, flat downstream."""
    def c(x):
        return robin_channel.strip(x, 1e5, SUPPLY, WATER, BIOMASS, 2e4, HALF)
    inside, upstream = np.linspace(1.0, 39.0, 20), np.array([-300.0, -30.0, -1.0])
    slope, bend = along(c, inside)
    assert BIOMASS * bend == pytest.approx(1e5 * slope + 2e4 * c(inside), rel=1e-4)
    assert 1e5 * c(upstream) - WATER * along(c, upstream, STEP)[0] == pytest.approx(np.full(3, 1e5 * SUPPLY), rel=1e-6)
    before, after, last = (along(c, x, STEP)[0] for x in (-1e-3, 1e-3, HALF - 1e-3))
    assert BIOMASS * last == pytest.approx(0.0, abs=1e5) and c(60.0) == c(HALF)
    assert WATER * before == pytest.approx(BIOMASS * after, rel=1e-3)


@pytest.mark.parametrize("film", [0.0, 20.0])
@pytest.mark.parametrize("half_saturation", [0.1, 0.01])
def test_the_monod_slab_obeys_its_equation(half_saturation, film):
    sink_ = 6e5
    found, depth = slab.monod(0.0, SUPPLY, sink_, half_saturation, HALF, BIOMASS, film, WATER)
    def c(x):
        return slab.monod(x, SUPPLY, sink_, half_saturation, HALF, BIOMASS, film, WATER)[0]
    inside = np.linspace(HALF - 0.9 * depth, HALF - 0.1, 12)
    assert BIOMASS * along(c, inside, 1e-2)[1] == pytest.approx(
        sink_ * c(inside) / (c(inside) + half_saturation), rel=1e-2)
    assert BIOMASS * along(c, HALF - 1e-3, 5e-4)[0] == pytest.approx(sink_ * depth, rel=1e-3)
    assert c(HALF + film) == pytest.approx(SUPPLY) and found < 1e-5


@pytest.fixture(scope="module")
def chosen():
    return manufactured_transport.fields(50.0, 20.0, 1e5, (1e7, 4e6), (8e6, 3e6), 3e5, RATES)


@pytest.mark.parametrize("side, sample", [("fluid", (30.0, 25.0)), ("biomass", (-6.0, 9.0))])
def test_the_forcing_is_the_strong_form(chosen, side, sample):
    """By differences, with the uptake of reference.monod."""
    u, v = (float(manufactured_transport.function(part)(*sample))
            for part in manufactured_transport.velocity(50.0, 1e5))
    active = 3e5 * (1 + sample[0] / 60) if side == "biomass" else 0.0
    x, y = np.array(sample)
    sinks = uptake(*(float(chosen[side][k].value(x, y)) for k in (0, 1)), RATES)
    spreads = (8e6, 3e6) if side == "biomass" else (1e7, 4e6)
    for k in (0, 1):
        value = chosen[side][k].value
        slope, _ = derivatives(value, x, y)
        _, bend = derivatives(value, x, y, 1e-2)
        expected = -spreads[k] * bend + slope @ [u, v] + active * sinks[k]
        assert chosen[side][k].forcing(x, y) == pytest.approx(expected, rel=1e-4)
        assert chosen[side][k].flux(x, y)[0] == pytest.approx(spreads[k] * slope[0], rel=1e-6)
