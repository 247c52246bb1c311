"""Growth mechanics (14)-(27): the material law, exact solutions, walls, and what must be refused."""
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference import neo_hookean
from repro import growth, mesh
from repro.errors import GrowthError, LinearError
from tests.strategies import body_of, fitted_order, half_disc, lumped, meshed, plug

RNG = np.random.default_rng(7)
MANY_F = np.eye(2) + 0.35 * RNG.uniform(-1, 1, (40, 2, 2))
MANY_P = RNG.uniform(-2, 2, 40)
DISC = half_disc(10.0)[0]


def rotation(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def perturbed(F, i, k):
    """F with an imaginary step of 1e-30 in F[i, k]: the imaginary part of any result is its exact derivative."""
    moved = F.astype(complex)
    moved[:, i, k] += 1e-30j
    return moved


def uniform(body, theta, position=None, pressure=None):
    """Equilibrium at one theta everywhere."""
    n = len(body.reference)
    start = body.reference if position is None else position
    return growth.equilibrium(body, np.full(len(body.triangles), float(theta)), start,
                              np.zeros(n) if pressure is None else pressure, start)


def test_stress_is_the_derivative_of_the_energy():
    """S = d/dF [1/2 (J^(-2/3) tr C - 3) + P (J - theta)], (17), (21), by complex steps. Mutant: tr C without F33 = 1,
    the exponent -1 of two dimensions, P times J forgotten, the sign of P [E5]."""
    def potential(F):
        J = F[:, 0, 0] * F[:, 1, 1] - F[:, 0, 1] * F[:, 1, 0]
        return growth.energy(F) + MANY_P * J

    S = growth.piola(MANY_F, MANY_P)
    for i in (0, 1):
        for k in (0, 1):
            assert S[:, i, k] == pytest.approx(potential(perturbed(MANY_F, i, k)).imag / 1e-30, abs=1e-12)


def test_tangent_is_the_derivative_of_the_stress_and_symmetric():
    """By complex steps. Mutant: 2/9 for 2/3, H dF^T H untransposed, the P J term's sign."""
    moduli = growth.tangent(MANY_F, MANY_P)
    for j in (0, 1):
        for m in (0, 1):
            slope = growth.piola(perturbed(MANY_F, j, m), MANY_P).imag / 1e-30
            assert moduli[:, :, :, j, m] == pytest.approx(slope, abs=1e-11)
    assert moduli == pytest.approx(np.transpose(moduli, (0, 3, 4, 1, 2)), abs=1e-12)


def test_stress_agrees_with_the_closed_form():
    """Cauchy stress of homogeneous deformations, derived in `reference` in another way. Mutant: J^(-2/3) for
    J^(-5/3)."""
    found = growth.cauchy(MANY_F, MANY_P)
    for F, P, sigma in zip(MANY_F, MANY_P, found):
        exact = neo_hookean.cauchy(F, P)
        assert sigma == pytest.approx([exact[0, 0], exact[1, 1], exact[2, 2], exact[0, 1]], rel=1e-11, abs=1e-12)


def test_the_largest_principal_stress():
    """Eigenvalues of the whole tensor, the one across the plane among them. Mutant: the plane's alone."""
    found = growth.largest_principal(growth.cauchy(MANY_F, MANY_P))
    exact = [np.linalg.eigvalsh(neo_hookean.cauchy(F, P)).max() for F, P in zip(MANY_F, MANY_P)]
    assert found == pytest.approx(exact, rel=1e-10)


@given(st.floats(-np.pi, np.pi))
def test_the_law_is_objective_and_isotropic(angle):
    """Rotated before or after, the energy stays and the stress turns along. Mutant: tr F for tr C."""
    Q = rotation(angle)
    S = growth.piola(MANY_F, MANY_P)
    assert growth.energy(Q @ MANY_F) == pytest.approx(growth.energy(MANY_F), abs=1e-12)
    assert growth.energy(MANY_F @ Q) == pytest.approx(growth.energy(MANY_F), abs=1e-12)
    assert growth.piola(Q @ MANY_F, MANY_P) == pytest.approx(Q @ S, abs=1e-12)
    assert growth.piola(MANY_F @ Q, MANY_P) == pytest.approx(S @ Q, abs=1e-12)


def test_at_rest_there_is_no_stress_and_small_strains_are_linear():
    """sigma = 2 mu dev(eps) + P I to first order (C37), error of second order. Mutant: mu for mu / 2 in the energy."""
    rest = np.eye(2)[None]
    assert growth.energy(rest) == pytest.approx(0.0, abs=1e-15)
    assert growth.cauchy(rest, np.zeros(1)) == pytest.approx(0.0, abs=1e-15)
    strain = np.array([[0.3, 0.5], [0.5, -0.1]])
    gaps = []
    for size in (1e-3, 1e-4):
        eps = size * strain
        exact = 2 * (np.pad(eps, (0, 1)) - np.trace(eps) / 3 * np.eye(3)) + size * 0.7 * np.eye(3)
        found = growth.cauchy(rest + eps, np.array([size * 0.7]))[0]
        gaps.append(np.abs(found - [exact[0, 0], exact[1, 1], exact[2, 2], exact[0, 1]]).max())
    assert gaps[0] / gaps[1] == pytest.approx(100, rel=0.05)


@pytest.mark.parametrize("refinement", [0.7, 1.0, 1.3])
def test_uniform_growth_of_a_half_disc_stays_one_to_theta_2000(refinement):
    """Radius R sqrt(theta), P = -theta^(-5/3) (theta - 1) / 3, to round-off at every stage and on every mesh (C25,
    [E11]).

    Mutant: nodes stuck to the wall, plane stress, growth of R by theta^(1/3), a stabilisation that sees constants.
    """
    body, _, _ = half_disc(5.0, refinement)
    position, pressure = body.reference, None
    for theta in (1.3, 36.0, 300.0, 2000.0):
        found = uniform(body, theta, position, pressure)
        position, pressure = found.position, found.pressure
        assert position == pytest.approx(body.reference * np.sqrt(theta), abs=1e-11 * np.sqrt(theta))
        assert pressure == pytest.approx(np.full(len(pressure), neo_hookean.free_growth_pressure(theta)), rel=1e-9)
        assert (position[body.held] == body.reference[body.held]).all()


def test_one_step_of_growth_takes_few_iterations():
    """Newton's method converges quadratically with its tangent: 4 % growth in at most 5 (measured 4). Mutant: any
    wrong term of the tangent, whose answer would be right all the same."""
    body, _, _ = half_disc(20.0)
    c = body.reference[body.triangles].mean(axis=1)
    nothing = np.zeros(len(body.reference))
    found = growth.equilibrium(body, 1.04 + 0.001 * c[:, 0], body.reference, nothing, body.reference)
    assert found.iterations <= 5


def cylinder(refinement):
    """(nodes^-1/2, errors of rim, displacement, pressure) of a half-disc with theta = 1 + 3 (R / R_0)^2, R_0 = 10."""
    body, rim, outline = half_disc(10.0, refinement)
    X = body.reference
    corner = X[body.triangles]
    middles = 0.5 * (corner + np.roll(corner, 1, axis=1))
    theta = 1 + 0.03 * np.sum(middles**2, axis=(1, 2)) / 3  # its exact mean over each triangle
    found = growth.equilibrium(body, theta, X, np.zeros(len(X)), X)
    R, r = np.hypot(*X.T), np.hypot(*found.position.T)
    free = rim[outline.wall == 0]
    weight = lumped(X, body.triangles)

    def norm(field):
        return np.sqrt(weight @ field**2 / weight.sum())

    exact, pressure = neo_hookean.cylinder_radius(R, 1, 3, 10.0), neo_hookean.cylinder_pressure(R, 1, 3, 10.0)
    return (len(X) ** -0.5, np.abs(r[free] / exact[free] - 1).max(), norm(r - exact) / 10,
            norm(found.pressure - pressure) / norm(pressure))


def test_a_growing_half_cylinder_approaches_its_closed_form():
    """theta(R) from 1 to 4: radius and pressure. On unrelated meshes of 100 to 630 nodes the displacement has order 2
    (measured 1.9), the pressure 3/2 (measured 1.7); rim within 1.3e-3 at the default size, pressure 5 %.

    Mutant: the stabilisation's sign or none (pressure off by 25 % or no solution), P averaged with wrong weights,
    theta at nodes. """
    size, rim, displacement, pressure = np.transpose([cylinder(r) for r in (1.0, 1.5, 3.0, 4.0)])
    assert rim[0] < 2e-3 and rim[-1] < 5e-4
    assert displacement[0] < 4e-3 and 1.5 < fitted_order(size, displacement) < 2.4
    assert pressure[0] < 7e-2 and 1.3 < fitted_order(size, pressure) < 2.1


@pytest.mark.parametrize("factor", [-1.0, 0.0])
def test_the_stabilisation_is_needed_with_its_sign(factor, monkeypatch):
    """[E5]: without it the pressure is 25 % off where it should be 5 %, with the printed sign there is no answer.
    Mutant: h^2 / 12 lost in the stabilising matrix: this test then finds no difference."""
    right = growth.stabilisation
    monkeypatch.setattr(growth, "stabilisation", lambda *arguments: factor * right(*arguments))
    if factor < 0:
        with pytest.raises((GrowthError, LinearError)):
            cylinder(1.0)
    else:
        assert cylinder(1.0)[3] > 0.15


@given(st.floats(0.5, 10.0))
def test_the_stabilisation_grows_as_the_reading_of_E6(stretch):
    """On a body grown by J in area, h^2 |tau| |grad|^2 / mu is J * J^(2/3) times that at t = 0. Mutant: mu_L of t =
    0, the reference's h."""
    X, t = DISC.reference, DISC.triangles
    before = growth.stabilisation(X, t, np.ones(len(t)))
    after = growth.stabilisation(stretch * X, t, np.full(len(t), stretch**2))
    expected = stretch ** (10 / 3) * before
    assert after == pytest.approx(expected, rel=1e-10, abs=1e-14 * np.abs(expected).max())


def test_the_stabilisation_of_one_triangle():
    """Equilateral with side a: h = 2 a / sqrt(3), h^2 / 12 |tau| grad N_i . grad N_j. Mutant: the longest side for h,
    6 for 12."""
    a = 3.0
    corners = np.array([[0.0, 0.0], [a, 0.0], [a / 2, a * np.sqrt(3) / 2]])
    matrix = growth.stabilisation(corners, np.array([[0, 1, 2]]), np.ones(1))[0]
    area, slope = a**2 * np.sqrt(3) / 4, 2 / (a * np.sqrt(3))
    expected = area * (4 * a**2 / 3) / 12 * slope**2 * (1.5 * np.eye(3) - 0.5)
    assert matrix == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("theta", [1.5, 8.0])
def test_growth_between_two_walls_is_frictionless(theta):
    """A block from wall to wall can only widen: F = diag(theta, 1), sigma_xx = 0, to round-off. Mutant: x held on a
    wall, which makes the sides bulge."""
    grid, outline = meshed(plug(20.0, -10.0, 10.0), width=20.0)
    body, _ = body_of(grid, outline)
    found = uniform(body, theta)
    assert found.position == pytest.approx(body.reference * [theta, 1.0], abs=1e-10)
    F = np.diag([theta, 1.0])
    assert found.pressure == pytest.approx(np.full(len(found.pressure), -neo_hookean.cauchy(F, 0.0)[0, 0]), rel=1e-9)


def test_prescribed_coordinates_are_reached_to_the_last_bit():
    """Nodes lifted onto a wall lie on it exactly, y == W, in one step or many. Mutant: a penalty for the wall, the
    last sub-step short of its target."""
    body, rim, outline = half_disc(17.9, width=20.0)
    top = rim[(outline.wall == 0) & (outline.points[:, 1] > 17.0)]
    held = body.held.copy()
    held[top, 1] = True
    target = body.reference.copy()
    target[top, 1] = 20.0
    lifted = growth.Body(body.reference, body.triangles, held)
    n = len(target)
    found = growth.equilibrium(lifted, np.full(len(body.triangles), 1.04), body.reference, np.zeros(n), target)
    assert len(top) > 3 and (found.position[held] == target[held]).all()
    before, after = (mesh.triangle_areas(p, body.triangles) for p in (body.reference, found.position))
    assert after.min() > 0 and after.sum() == pytest.approx(1.04 * before.sum(), rel=1e-10)


def test_the_area_grows_by_the_mean_of_theta_exactly():
    """(24) in the mean, whatever theta's distribution: the sum of (J - theta) |tau| over the body is a row of the
    system, since the stabilisation does not see constants. Mutant: the pressure pinned at a node."""
    body, _, _ = half_disc(10.0)
    theta = 1 + np.random.default_rng(11).uniform(0.0, 0.5, len(body.triangles))
    found = growth.equilibrium(body, theta, body.reference, np.zeros(len(body.reference)), body.reference)
    areas = mesh.triangle_areas(body.reference, body.triangles)
    assert mesh.triangle_areas(found.position, body.triangles).sum() == pytest.approx(areas @ theta, rel=1e-12)


def test_the_rotation_of_the_body_does_not_matter():
    """A body turned by 90 degrees, with its supports, deforms as before. Mutant: x and y unlike in the assembly."""
    body, _, _ = half_disc(10.0)
    Q = rotation(np.pi / 2)
    turned = growth.Body(body.reference @ Q.T, body.triangles, body.held[:, ::-1])
    c = body.reference[body.triangles].mean(axis=1)
    theta = 1.2 + 0.02 * c[:, 0]
    n = np.zeros(len(body.reference))
    here = growth.equilibrium(body, theta, body.reference, n, body.reference)
    there = growth.equilibrium(turned, theta, turned.reference, n, turned.reference)
    assert there.position == pytest.approx(here.position @ Q.T, abs=1e-9)
    assert there.pressure == pytest.approx(here.pressure, abs=1e-9)


def test_a_start_that_is_turned_over_is_refused():
    """det F <= 0 in the start, or theta <= 0. Mutant: |det F|."""
    body, rim, _ = half_disc(5.0)
    n = len(body.reference)
    inner = np.setdiff1d(np.arange(n), rim)[0]
    folded = body.reference.copy()
    folded[inner] += 100.0
    with pytest.raises(GrowthError, match="turned over"):
        growth.equilibrium(body, np.ones(len(body.triangles)), folded, np.zeros(n), folded)
    with pytest.raises(GrowthError, match="theta"):
        uniform(body, -1.0)


def test_no_step_leaves_a_triangle_turned_over():
    """A wall pushed 80 % into the body at once: reached with det F > 0 everywhere, or refused, never folded. Mutant:
    a line search that looks at the residual alone."""
    body, rim, outline = half_disc(10.0)
    top = rim[outline.points[:, 1] > 8.0]
    held = body.held.copy()
    held[top, 1] = True
    target = body.reference.copy()
    target[top, 1] = 2.0
    squeezed = growth.Body(body.reference, body.triangles, held)
    n = len(target)
    try:
        found = growth.equilibrium(squeezed, np.ones(len(body.triangles)), body.reference, np.zeros(n), target)
    except GrowthError as error:
        assert "try" in str(error)
    else:
        assert mesh.triangle_areas(found.position, body.triangles).min() > 0
        assert (found.position[top, 1] == 2.0).all()
