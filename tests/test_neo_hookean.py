"""The material law (14)-(22) and the functional (27): energy, stress and tangent against differences of the printed."""
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from skfem.quadrature import get_quadrature_tri

from reference import neo_hookean
from repro.model import growth
from repro.model.growth import Strained
from tests import oracles
from tests.strategies import admissible_F, angles, between, half_disc, rotation, share

pressures = st.floats(-2.0, 2.0)


def scale(F, P):
    """Largest size of the terms of the stress: that of J^(-2/3) F, of its volume part, and of P J F^-T."""
    J, inverse = np.linalg.det(F), np.abs(np.linalg.inv(F)).max()
    return J ** (-2 / 3) * (np.abs(F).max() + (np.sum(F**2) + 1) * inverse) + abs(P) * J * inverse


def step(F):
    """A step of differences well inside the admissible deformations."""
    return 1e-3 * np.linalg.svd(F)[1].min()


def piola(F, P):
    """First Piola-Kirchhoff stress (2, 2) of F (2, 2)."""
    return Strained(F).piola(np.array(P))


@cache
def one_triangle(geometry):
    """growth.Body of a right triangle of area 1/2."""
    places, degree = (oracles.SIX[:3], 1) if geometry == 1 else (oracles.SIX, 6)
    return growth.Body(growth.Shape(np.arange(len(places))[None], 3, degree), places)


def in_one_triangle(geometry, F, P, theta):
    """Stress (2, 2) and moduli d S / d F (2, 2, 2, 2) that residual and element matrix of a triangle hold, deformed by
    F all over: force and stiffness for the four linear displacements, over the area."""
    body = one_triangle(geometry)
    X = body.reference
    free, none = np.zeros(X.shape, bool), np.zeros((1, 3, 3)) if geometry == 1 else None
    system = growth.System(body, free, stabilising=none)
    at = X @ F.T, np.full(3, float(P))
    system.under(np.full(body.at.dx.shape, theta), X, *at)
    zero = np.zeros(len(X))
    unit = np.array([[np.concatenate([X[:, K], zero]), np.concatenate([zero, X[:, K]])] for K in (0, 1)])
    unit = np.swapaxes(unit, 0, 1)  # unit[i, K]: u = X_K e_i
    n = 2 * len(X)
    force, stiffness = system.residual(*at)[:n], system.tangent(*at)[0, :n, :n]
    return 2 * unit @ force, 2 * np.einsum("iKa,ab,jLb->iKjL", unit, stiffness, unit)


@given(admissible_F(), pressures)
def test_energy_and_stress_are_those_of_the_paper(F, P):
    """(17), and S = d/dF [1/2 (J^(-2/3) tr C - 3) + P (J - theta)], (21), by differences (1e-11 of the terms); no
    deformation has less energy than rest."""
    assert growth.energy(F) == pytest.approx(oracles.energy(F, 0.0, 1.0), rel=1e-12, abs=1e-12)
    assert growth.energy(F) >= -1e-13
    exact = oracles.derivative(lambda G: oracles.energy(G, P, 1.0), F, step(F))
    assert piola(F, P) == pytest.approx(exact, abs=1e-9 * scale(F, P))


@pytest.mark.parametrize("geometry", [1, 2])
@given(admissible_F(), pressures, between(0.5, 2.0))
def test_the_tangent_is_the_derivative_of_the_stress_and_symmetric(geometry, F, P, theta):
    """In a triangle that is deformed alike all over, straight or curved; there with P + gamma theta^(-5/3) (J - theta)
    for P. By differences."""
    theta *= np.linalg.det(F)
    stiff = growth.GAMMA * theta ** (-5 / 3) if geometry == 2 else 0.0

    def pressed(G):
        return P + stiff * (np.linalg.det(G) - theta)

    stress, moduli = in_one_triangle(geometry, F, P, theta)
    grown = scale(F, pressed(F)) + stiff * np.linalg.det(F) ** 2 * np.abs(np.linalg.inv(F)).max()
    assert stress == pytest.approx(piola(F, pressed(F)), abs=1e-12 * grown)
    size = grown * np.abs(np.linalg.inv(F)).max()
    exact = oracles.derivative(lambda G: piola(G, pressed(G)), F, step(F))
    assert moduli == pytest.approx(exact, abs=1e-9 * size)
    assert moduli == pytest.approx(np.transpose(moduli, (2, 3, 0, 1)), abs=1e-12 * size)


@given(admissible_F(), pressures)
def test_the_true_stress_is_the_closed_form(F, P):
    """Cauchy stress, derived in `reference` in another way, and its largest principal value, the one across the plane
    among them."""
    exact = neo_hookean.cauchy(F, P)
    found = growth.cauchy(F[None], np.array([P]))[0]
    size = np.linalg.det(F) ** (-5 / 3) * (np.sum(F**2) + 1) + abs(P)
    assert found == pytest.approx([exact[0, 0], exact[1, 1], exact[2, 2], exact[0, 1]], abs=1e-12 * size)
    assert growth.largest_principal(found) == pytest.approx(np.linalg.eigvalsh(exact).max(), abs=1e-12 * size)


@given(admissible_F(), pressures, angles)
def test_the_law_is_objective_and_isotropic(F, P, angle):
    """Turned before or after, the energy stays and the stress turns along."""
    Q, S, size = rotation(angle), piola(F, P), scale(F, P)
    assert growth.energy(Q @ F) == pytest.approx(growth.energy(F), rel=1e-12, abs=1e-13)
    assert growth.energy(F @ Q) == pytest.approx(growth.energy(F), rel=1e-12, abs=1e-13)
    assert piola(Q @ F, P) == pytest.approx(Q @ S, abs=1e-12 * size)
    assert piola(F @ Q, P) == pytest.approx(S @ Q, abs=1e-12 * size)


def split(x, count):
    """(n, 2) positions and pressures of all unknowns, of ``count`` nodes."""
    return x[: 2 * count].reshape(2, count).T, x[2 * count:]


def assert_derivatives(system, functional, position, pressure):
    """The residual is the derivative of a functional of all unknowns, and the tangent that of the residual, by every
    unknown and dense."""
    n, x = len(position), np.concatenate([*position.T, pressure])
    residual = system.residual(position, pressure)
    assert residual == pytest.approx(oracles.derivative(functional, x, 1e-2), abs=1e-7 * np.abs(residual).max())
    dense = np.zeros((len(x), len(x)))
    for unknowns, element in zip(system.unknowns, system.tangent(position, pressure)):
        dense[np.ix_(unknowns, unknowns)] += element
    exact = oracles.derivative(lambda y: system.residual(*split(y, n)), x, 1e-2)
    assert dense == pytest.approx(exact, abs=1e-7 * np.abs(dense).max())


@share(0.1)
@given(st.floats(1.0, 30.0), st.integers(0, 2**32 - 1))
def test_residual_and_tangent_are_derivatives_of_the_functional(grown, seed):
    """(27) of a small body, by every coordinate and every pressure, dense: Pi in a loop over triangles, and its
    derivatives by differences."""
    body, rng = half_disc(5.0, 0.25)[0], np.random.default_rng(seed)
    X, t = body.reference, body.shape.triangles
    n, start = len(X), np.full(len(t), grown)
    shape = np.sqrt(grown) * X
    position = shape + 0.05 * np.sqrt(grown) * rng.uniform(-1.0, 1.0, (n, 2))
    pressure, theta = rng.uniform(-1.0, 1.0, n), start * rng.uniform(0.9, 1.1, len(t))
    free = np.zeros((n, 2), bool)
    system = growth.System(body, free, stabilising=growth.gradient_stabilisation(shape, t, start))
    system.under(theta[:, None], X, position, pressure)

    def functional(x):
        return oracles.functional(X, t, shape, start, theta, *split(x, n))

    assert_derivatives(system, functional, position, pressure)


def curved_pair():
    """Nodes (9, 2) um and cells (2, 6) of two triangles that share an edge, all their edges bent."""
    corners = np.array([[0.0, 0.0], [4.0, 0.3], [3.6, 3.2], [-0.3, 2.8]])
    middles = np.array([[2.0, -0.1], [4.0, 1.7], [1.7, 1.7], [1.6, 3.3], [-0.4, 1.4]])
    return np.vstack([corners, middles]), np.array([[0, 1, 2, 4, 5, 6], [0, 2, 3, 6, 7, 8]])


@share(0.1)
@given(st.floats(1.0, 30.0), st.integers(0, 2**32 - 1))
def test_on_curved_triangles_too(grown, seed):
    """Pi with quadratic places, a linear pressure and gamma theta^(-5/3) (J - theta)^2 / 2."""
    (X, cells), rng = curved_pair(), np.random.default_rng(seed)
    where, weights = get_quadrature_tri(6)
    body = growth.Body(growth.Shape(cells, 4, 6), X)
    position = np.sqrt(grown) * (X + 0.05 * rng.uniform(-1.0, 1.0, X.shape))
    pressure, theta = rng.uniform(-1.0, 1.0, 4), grown * rng.uniform(0.9, 1.1, body.at.dx.shape)
    system = growth.System(body, np.zeros(X.shape, bool))
    system.under(theta, X, position, pressure)
    rule = np.column_stack([where.T, weights])

    def functional(x):
        return oracles.curved_functional(X, cells, theta, *split(x, len(X)), rule, growth.GAMMA)

    assert_derivatives(system, functional, position, pressure)


def test_at_rest_there_is_no_stress_and_small_strains_are_linear():
    """sigma = 2 mu dev(eps) + P I to first order (C37), error of second order."""
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
