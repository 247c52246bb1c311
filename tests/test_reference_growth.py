"""The references of the growth stage themselves: against each other, against differences, and against what they say."""
import numpy as np
import pytest
from skfem import Basis, ElementTriP1, ElementTriP2, ElementVector, asm, bmat

from reference import manufactured_growth, neo_hookean, quadratic_growth
from reference.quadratic_growth import Contact

#: theta = a + c (R / R_0)^2 by a, c, R_0: three, and ten times as much on the rim as in the middle.
LAW, STEEP = (12.0, 24.0, 20.0), (3.6, 32.4, 20.0)
INSIDE = 20.0 * np.sqrt(np.random.default_rng(1).uniform(0, 1, 500)), np.random.default_rng(2).uniform(0, np.pi, 500)


def radial(x, y, law=LAW):
    return law[0] + law[1] * (x**2 + y**2) / law[2] ** 2


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


def test_the_cylinders_quadrature_is_done():
    R = np.linspace(0.01, 20.0, 50)
    assert neo_hookean.cylinder_pressure(R, *LAW) == pytest.approx(neo_hookean.cylinder_pressure(R, *LAW, points=200),
                                                                   abs=1e-13)


@pytest.mark.parametrize("theta", [0.5, 2.0, 2000.0])
def test_free_and_confined_growth_have_no_stress_on_their_free_sides(theta):
    """From the stress itself."""
    free = neo_hookean.cauchy(np.sqrt(theta) * np.eye(2), neo_hookean.free_growth_pressure(theta))
    confined = neo_hookean.cauchy(np.diag([1.0, theta]), neo_hookean.confined_growth_pressure(theta))
    assert free[:2, :2] == pytest.approx(np.zeros((2, 2)), abs=1e-13)
    assert confined[1, 1] == pytest.approx(0.0, abs=1e-13) and abs(confined[0, 0]) > 0.01


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


def test_one_of_the_made_up_pressures_is_flat_on_the_rim():
    along, h = np.linspace(0, 1, 9), 1e-6
    slopes = {}
    for name in manufactured_growth.PRESSURES:
        P = manufactured_growth.growth(name).pressure
        slopes[name] = max(np.abs(P(along, np.full(9, h)) - P(along, np.zeros(9))).max(),
                           np.abs(P(np.full(9, 1.0), along) - P(np.full(9, 1.0 - h), along)).max()) / h
    assert slopes["flat on the rim"] < 1e-4 < 0.1 < slopes["sloping"]


def test_the_half_disc_is_round_and_knows_where_its_points_are():
    """Area and arc to the fourth order; a field of the mesh's own places comes back everywhere, beyond chords too."""
    mesh = quadratic_growth.half_disc(20.0, 5, (np.pi / 2,), 2)
    basis = Basis(mesh, ElementTriP2(), intorder=5)
    assert basis.dx.sum() == pytest.approx(200 * np.pi, rel=2e-5)
    assert np.hypot(*mesh.doflocs).max() == pytest.approx(20.0, rel=1e-14) and mesh.doflocs[1].min() == 0.0
    rest = quadratic_growth.Grown(mesh, mesh.doflocs, mesh.doflocs[0, : mesh.t.max() + 1])
    x, y = places()
    x[:50], y[:50] = 20 * np.cos(np.linspace(0, np.pi, 50)), 20 * np.sin(np.linspace(0, np.pi, 50))
    place, pressure = rest.at(x.reshape(50, 10), np.maximum(y, 0.0).reshape(50, 10))
    assert place == pytest.approx(np.stack([x, y], axis=-1).reshape(50, 10, 2), abs=1e-9)
    assert pressure == pytest.approx(x.reshape(50, 10), abs=0.2)


def state(rings, law):
    """Bases, theta, and the exact cylinder on them; and what the forms need of it."""
    mesh = quadratic_growth.half_disc(20.0, rings)
    basis = Basis(mesh, ElementVector(ElementTriP2()), intorder=5)
    lower = basis.with_element(ElementTriP1())
    R = np.maximum(np.hypot(*mesh.doflocs), 1e-9)
    place = np.zeros(basis.N)
    place[quadratic_growth._numbers(basis)] = neo_hookean.cylinder_radius(R, *law) / R * mesh.doflocs
    pressure = neo_hookean.cylinder_pressure(np.maximum(np.hypot(*lower.doflocs), 1e-9), *law)
    theta = radial(*basis.global_coordinates(), law)
    return basis, lower, lambda move: quadratic_growth._state(basis, lower, theta, 1.0, place + move, pressure)


def test_the_quadratic_tangent_is_the_derivative_of_its_forces():
    """Central differences of step 1e-5, in a random direction."""
    basis, _, after = state(2, LAW)
    move = np.random.default_rng(5).standard_normal(basis.N)
    plus, minus = (asm(quadratic_growth._force, basis, **after(step * move)) for step in (1e-5, -1e-5))
    slope = asm(quadratic_growth._stiffness, basis, **after(0.0)) @ move
    assert slope == pytest.approx((plus - minus) / 2e-5, abs=1e-8)


@pytest.mark.parametrize("stiffening, stable", [(quadratic_growth.STIFFENING, True), (0.0, False)])
def test_the_added_term_takes_false_instabilities_away(stiffening, stable, monkeypatch):
    """A saddle point has one negative eigenvalue for each pressure; more of them mean that a motion that keeps volume,
    as linear pressures see it, lowers the energy. It should not: the hoop of this cylinder is compressed to 0.74, and
    Biot's surface instability needs 0.54."""
    monkeypatch.setattr(quadratic_growth, "STIFFENING", stiffening)
    basis, lower, after = state(6, STEEP)
    here = after(0.0)
    K, B = asm(quadratic_growth._stiffness, basis, **here), asm(quadratic_growth._coupling, basis, lower, **here)
    initial = np.zeros(basis.N)
    initial[quadratic_growth._numbers(basis)] = basis.mesh.doflocs
    free = np.setdiff1d(np.arange(basis.N), quadratic_growth._held(basis, None, initial)[0])
    saddle = bmat([[K[free][:, free], B[:, free].T], [B[:, free], None]]).toarray()
    negative = np.count_nonzero(np.linalg.eigvalsh(saddle) < 0)
    assert (negative == lower.N) == stable and negative >= lower.N


def test_uniform_growth_is_exact_and_the_modulus_drops_out():
    """Places sqrt(theta) X and the closed form's pressure times mu_L, to round-off."""
    mesh, theta = quadratic_growth.half_disc(20.0, 2), 7.0
    for mu in (1.0, 0.01):
        found = quadratic_growth.grow(mesh, lambda x, y: theta + 0 * x, theta, mu)
        assert found.place == pytest.approx(np.sqrt(theta) * mesh.doflocs, abs=1e-9)
        assert found.pressure / mu / neo_hookean.free_growth_pressure(theta) == pytest.approx(1.0, rel=1e-9)


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


def test_the_arc_in_contact_lies_on_its_wall_and_the_area_is_that_of_theta():
    """The places of the contact's nodes are the wall's to the last bit."""
    contact = Contact(np.pi / 4, 3 * np.pi / 4, 25.0)
    mesh = quadratic_growth.half_disc(20.0, 4)
    found = quadratic_growth.grow(mesh, lambda x, y: 3.0 + 0 * x, 3.0, contact=contact)
    angle, rim = np.arctan2(*mesh.doflocs[::-1]), np.isclose(np.hypot(*mesh.doflocs), 20.0)
    touching = rim & (angle > np.pi / 4 - 1e-9) & (angle < 3 * np.pi / 4 + 1e-9)
    assert touching.sum() == 17 and (found.place[1, touching] == 25.0).all()
    basis = Basis(mesh, ElementVector(ElementTriP2()), intorder=5)
    place = np.zeros(basis.N)
    place[quadratic_growth._numbers(basis)] = found.place
    F = basis.interpolate(place).grad
    area = np.sum((F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]) * basis.dx)
    assert area == pytest.approx(3 * basis.dx.sum(), rel=1e-10)
