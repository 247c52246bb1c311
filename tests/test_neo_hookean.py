"""The material law (14)-(22) and the functional (27): energy, stress and tangent against differences of the printed."""
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference import neo_hookean
from repro.model import growth
from tests import oracles
from tests.strategies import admissible_F, angles, half_disc, rotation, share

pressures = st.floats(-2.0, 2.0)


def scale(F, P):
    """Largest size of the terms of the stress: that of J^(-2/3) F, of its volume part, and of P J F^-T."""
    J, inverse = np.linalg.det(F), np.abs(np.linalg.inv(F)).max()
    return J ** (-2 / 3) * (np.abs(F).max() + (np.sum(F**2) + 1) * inverse) + abs(P) * J * inverse


def step(F):
    """A step of differences well inside the admissible deformations."""
    return 1e-3 * np.linalg.svd(F)[1].min()


@given(admissible_F(), pressures)
def test_energy_and_stress_are_those_of_the_paper(F, P):
    """(17), and S = d/dF [1/2 (J^(-2/3) tr C - 3) + P (J - theta)], (21), by differences (1e-11 of the terms); no
    deformation has less energy than rest. Mutant: tr C without F33 = 1, the exponent -1 of two dimensions, P times J
    forgotten, the sign of P [E5]."""
    assert growth.energy(F) == pytest.approx(oracles.energy(F, 0.0, 1.0), rel=1e-12, abs=1e-12)
    assert growth.energy(F) >= -1e-13
    exact = oracles.derivative(lambda G: oracles.energy(G, P, 1.0), F, step(F))
    assert growth.piola(F, np.array(P)) == pytest.approx(exact, abs=1e-9 * scale(F, P))


@given(admissible_F(), pressures)
def test_the_tangent_is_the_derivative_of_the_stress_and_symmetric(F, P):
    """By differences. Mutant: 2/9 for 2/3, H dF^T H untransposed, the P J term's sign."""
    moduli = growth.tangent(F, np.array(P))
    size = scale(F, P) * np.abs(np.linalg.inv(F)).max()
    exact = oracles.derivative(lambda G: growth.piola(G, np.array(P)), F, step(F))
    assert moduli == pytest.approx(exact, abs=1e-9 * size)
    assert moduli == pytest.approx(np.transpose(moduli, (2, 3, 0, 1)), abs=1e-13 * size)


@given(admissible_F(), pressures)
def test_the_true_stress_is_the_closed_form(F, P):
    """Cauchy stress, derived in `reference` in another way, and its largest principal value, the one across the plane
    among them. Mutant: J^(-2/3) for J^(-5/3), the plane's eigenvalues alone."""
    exact = neo_hookean.cauchy(F, P)
    found = growth.cauchy(F[None], np.array([P]))[0]
    size = np.linalg.det(F) ** (-5 / 3) * (np.sum(F**2) + 1) + abs(P)
    assert found == pytest.approx([exact[0, 0], exact[1, 1], exact[2, 2], exact[0, 1]], abs=1e-12 * size)
    assert growth.largest_principal(found) == pytest.approx(np.linalg.eigvalsh(exact).max(), abs=1e-12 * size)


@given(admissible_F(), pressures, angles)
def test_the_law_is_objective_and_isotropic(F, P, angle):
    """Turned before or after, the energy stays and the stress turns along. Mutant: tr F for tr C."""
    Q, P = rotation(angle), np.array(P)
    S, size = growth.piola(F, P), scale(F, P)
    assert growth.energy(Q @ F) == pytest.approx(growth.energy(F), rel=1e-12, abs=1e-13)
    assert growth.energy(F @ Q) == pytest.approx(growth.energy(F), rel=1e-12, abs=1e-13)
    assert growth.piola(Q @ F, P) == pytest.approx(Q @ S, abs=1e-12 * size)
    assert growth.piola(F @ Q, P) == pytest.approx(S @ Q, abs=1e-12 * size)


@share(0.1)
@given(st.floats(1.0, 30.0), st.integers(0, 2**32 - 1))
def test_residual_and_tangent_are_derivatives_of_the_functional(grown, seed):
    """(27) of a small body, by every coordinate and every pressure, dense: Pi in a loop over triangles, and its
    derivatives by differences. Mutant: the stabilisation's sign [E5], its modulus or its shape those of t = 0 [E6], P
    at a node for its mean, theta beside J forgotten."""
    body, rng = half_disc(5.0, 0.25)[0], np.random.default_rng(seed)
    n, t, start = len(body.reference), body.triangles, np.full(len(body.triangles), grown)
    shape = np.sqrt(grown) * body.reference
    position = shape + 0.05 * np.sqrt(grown) * rng.uniform(-1.0, 1.0, (n, 2))
    pressure, theta = rng.uniform(-1.0, 1.0, n), start * rng.uniform(0.9, 1.1, len(t))
    system = growth.System(body, growth.stabilisation(shape, t, start))

    def split(x):
        return x[: 2 * n].reshape(2, n).T, x[2 * n:]

    def functional(x):
        return oracles.functional(body.reference, t, shape, start, theta, *split(x))

    x = np.concatenate([*position.T, pressure])
    residual = system.residual(position, pressure, theta)[0]
    assert residual == pytest.approx(oracles.derivative(functional, x, 1e-2), abs=1e-7 * np.abs(residual).max())
    dense = np.zeros((3 * n, 3 * n))
    for unknowns, element in zip(system.unknowns, system.tangent(position, pressure)):
        dense[np.ix_(unknowns, unknowns)] += element
    exact = oracles.derivative(lambda y: system.residual(*split(y), theta)[0], x, 1e-2)
    assert dense == pytest.approx(exact, abs=1e-7 * np.abs(dense).max())


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
