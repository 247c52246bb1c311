"""Closed forms and manufactured fields of the references obey their equations, by finite differences.

The cases that compare them with `repro` judge the other codes (FiPy, py-pde, collocation, scikit-fem) and the dense
transfer.
"""
import numpy as np
import pytest

from reference import (
    half_cylinder,
    neo_hookean,
    quadratic_growth,
    robin_channel,
)

STEP = 1e-4


def derivatives(field, x, y, h=STEP):
    """(gradient (n, ..., 2), Laplacian (n, ...)) of a field (n, ...) of points by central differences."""
    centre, east, west, north, south = (field(x + a, y + b) for a, b in ((0, 0), (h, 0), (-h, 0), (0, h), (0, -h)))
    return np.stack([east - west, north - south], axis=-1) / (2 * h), (east + west + north + south - 4 * centre) / h**2


def first_and_second(function, x, step=1e-3):
    """(first, second) derivative of a function of x."""
    gradient, laplace = derivatives(lambda x, _: function(x), x, 0.0, step)
    return gradient[..., 0], laplace


def test_the_cylinder_is_in_equilibrium_and_free_on_its_rim():
    """theta = a + c (R / R_0)^2: d sigma_rr / dr = (sigma_tt - sigma_rr) / r, and sigma_rr = 0 where R = R_0."""
    law, R = (12.0, 24.0, 20.0), np.linspace(1.0, 20.0, 400)
    r, P = neo_hookean.cylinder_radius(R, *law), neo_hookean.cylinder_pressure(R, *law)
    theta, hoop = 12.0 + 24.0 * (R / 20.0) ** 2, r / R
    sigma = np.array([neo_hookean.cauchy(np.diag([t / h, h]), p) for t, h, p in zip(theta, hoop, P)])
    expected = (sigma[:, 1, 1] - sigma[:, 0, 0]) / r
    assert abs(sigma[-1, 0, 0]) < 1e-14
    assert np.gradient(sigma[:, 0, 0], r, edge_order=2) == pytest.approx(expected, abs=1e-3 * np.abs(expected).max())


WATER, BIOMASS = 9e6, 7e6
HALF, SUPPLY = 40.0, 10.0


def test_the_robin_channel_obeys_its_equation_and_its_conditions():
    """The strip, (26) upstream, the flux u C_s at any inlet, and a zero gradient downstream."""
    def c(x):
        return robin_channel.strip(x, 1e5, SUPPLY, WATER, BIOMASS, 2e4, HALF)

    inside, upstream = np.linspace(1.0, 39.0, 20), np.array([-300.0, -30.0, -1.0])
    gradient, curvature = first_and_second(c, inside)
    assert BIOMASS * curvature == pytest.approx(1e5 * gradient + 2e4 * c(inside), rel=1e-4)
    inflow = 1e5 * c(upstream) - WATER * first_and_second(c, upstream, STEP)[0]
    assert inflow == pytest.approx(np.full(3, 1e5 * SUPPLY), rel=1e-6)
    before, after, last = first_and_second(c, np.array([-1e-3, 1e-3, HALF - 1e-3]), STEP)[0]
    assert abs(BIOMASS * last) < 1e5 and c(60.0) == c(HALF)
    assert WATER * before == pytest.approx(BIOMASS * after, rel=1e-3)


def test_quadratic_growth_of_a_half_disc_is_the_closed_form():
    """theta = 4 everywhere doubles every distance and leaves one pressure, which no edge of the mesh disturbs. A wall
    at 15 um keeps the nodes between the ends of a contact at its height."""
    mesh = quadratic_growth.half_disc(10.0, 4)
    free = quadratic_growth.grow(mesh, lambda x, y: np.full_like(x, 4.0), 4.0)
    assert free.place == pytest.approx(2 * mesh.doflocs, abs=1e-12)
    assert np.ptp(free.pressure) < 1e-12
    inside = free.at(np.array([0.0, 3.0]), np.array([5.0, 4.0]))[0]
    assert inside == pytest.approx(np.array([[0, 10], [6, 8]]), abs=1e-9)
    contact = quadratic_growth.Contact(np.pi / 4, 3 * np.pi / 4, 15.0)
    pressed = quadratic_growth.grow(mesh, lambda x, y: np.full_like(x, 4.0), 4.0, contact=contact)
    angle = np.arctan2(*mesh.doflocs[::-1])
    on = np.isclose(np.hypot(*mesh.doflocs), 10.0, atol=0.1) & (angle > 0.8) & (angle < 2.3)
    assert pressed.place[1, on] == pytest.approx(15.0, abs=1e-12)


@pytest.mark.parametrize("curvature", [0.0, 0.2])
def test_the_flow_over_a_half_cylinder_obeys_its_equations(curvature):
    """No slip on the wall and on r = 1; vorticity and pressure follow from the stream function. The case
    coupling-half-cylinder tests the load."""
    flow = half_cylinder.solve(curvature)
    t = np.linspace(0.0, np.pi, 400)[1:-1]
    x, y = np.cos(t), np.sin(t)
    assert np.abs(flow.stream(x, y)).max() < 1e-6
    assert np.abs(flow.stream((1 + 1e-5) * x, (1 + 1e-5) * y)).max() < 1e-6
    wall = np.linspace(1.01, 3.0, 50)
    assert np.abs(derivatives(flow.stream, wall, 0 * wall)[0]).max() < 1e-7
    r = 1.7
    _, laplace = derivatives(flow.stream, r * x, r * y)
    assert flow.vorticity(r, t) == pytest.approx(-laplace, abs=1e-5)
    p, w = (derivatives(lambda a, b, f=f: f(np.hypot(a, b), np.arctan2(b, a)), r * x, r * y)[0]
            for f in (flow.pressure, flow.vorticity))
    assert p[:, 0] == pytest.approx(-w[:, 1], abs=1e-5) and p[:, 1] == pytest.approx(w[:, 0], abs=1e-5)
