"""The material law (14)-(22): energy and stress against differences of the printed energy, and small strains.

That the discrete residual and tangent are those of (27) is in `test_weak_forms.py`, that the law is objective and
isotropic in the case growth-stress.
"""
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference import neo_hookean
from repro.model import growth
from repro.model.growth import Strained
from tests import oracles
from tests.strategies import admissible_F

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
    deformation has less energy than rest."""
    assert growth.energy(F) == pytest.approx(oracles.energy(F, 0.0, 1.0), rel=1e-12, abs=1e-12)
    assert growth.energy(F) >= -1e-13
    exact = oracles.derivative(lambda G: oracles.energy(G, P, 1.0), F, step(F))
    assert Strained(F).piola(np.array(P)) == pytest.approx(exact, abs=1e-9 * scale(F, P))


@given(admissible_F(), pressures)
def test_the_true_stress_is_the_closed_form(F, P):
    """Cauchy stress, derived in `reference` in another way, and its largest principal value, the one across the plane
    among them."""
    exact = neo_hookean.cauchy(F, P)
    found = growth.cauchy(F[None], np.array([P]))[0]
    size = np.linalg.det(F) ** (-5 / 3) * (np.sum(F**2) + 1) + abs(P)
    assert found == pytest.approx([exact[0, 0], exact[1, 1], exact[2, 2], exact[0, 1]], abs=1e-12 * size)
    assert growth.largest_principal(found) == pytest.approx(np.linalg.eigvalsh(exact).max(), abs=1e-12 * size)


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
