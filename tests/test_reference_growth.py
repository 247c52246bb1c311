"""The references of the growth stage: the closed form against its equation, made-up growth against differences, and
quadratic elements against the closed form."""
import numpy as np
import pytest

from reference import manufactured_growth, neo_hookean, quadratic_growth

#: theta = a + c (R / R_0)^2 by a, c, R_0.
LAW = (12.0, 24.0, 20.0)
INSIDE = 20.0 * np.sqrt(np.random.default_rng(1).uniform(0, 1, 500)), np.random.default_rng(2).uniform(0, np.pi, 500)


def radial(x, y):
    return LAW[0] + LAW[1] * (x**2 + y**2) / LAW[2] ** 2


def places():
    r, angle = INSIDE
    return r * np.cos(angle), r * np.sin(angle)


def spread(values):
    return np.sqrt(np.mean(np.square(values)))


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
    F = np.stack([(made.place(X + h, Y) - made.place(X - h, Y)) / (2 * h),
                  (made.place(X, Y + h) - made.place(X, Y - h)) / (2 * h)], axis=-1)
    J = np.linalg.det(F)
    sigma = np.array([neo_hookean.cauchy(f, p)[:2, :2] for f, p in zip(F, made.pressure(X, Y))])
    divergence = (made.stress(X + h, Y) - made.stress(X - h, Y))[..., 0] + (
        made.stress(X, Y + h) - made.stress(X, Y - h))[..., 1]
    assert made.theta(X, Y) == pytest.approx(J, rel=1e-9)
    assert made.stress(X, Y) @ np.swapaxes(F, 1, 2) / J[:, None, None] == pytest.approx(sigma, abs=1e-8)
    assert made.force(X, Y) == pytest.approx(-divergence / (2 * h), abs=1e-7)


def test_the_quadratic_cylinder_approaches_its_closed_form():
    """Order 3 in places and 2 in pressure, between five and ten rings; from the coarser solution as from t = 0."""
    (x, y), coarse = places(), None
    errors = []
    R = np.hypot(x, y)
    exact = np.stack([x, y], axis=-1) * (neo_hookean.cylinder_radius(R, *LAW) / R)[:, None]
    for rings in (5, 10):
        coarse = quadratic_growth.grow(quadratic_growth.half_disc(20.0, rings), radial, 36.0, start=coarse)
        place, pressure = coarse.at(x, y)
        level = neo_hookean.cylinder_pressure(R, *LAW)
        errors.append((spread(place - exact) / spread(exact), spread(pressure - level) / spread(level)))
    assert errors[0][0] < 2e-4
    assert np.log2(np.divide(*errors)) == pytest.approx([3.0, 2.0], abs=0.3)
