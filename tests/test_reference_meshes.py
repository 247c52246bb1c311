"""The references of transfer and mesh motion are right by themselves: integrals, equations."""
import numpy as np
import pytest

from reference import galerkin_transfer, quadratic_mesh_motion, sliding_waves

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
RISING, FALLING = np.array([[0, 1, 2], [0, 2, 3]]), np.array([[0, 1, 3], [1, 2, 3]])


def test_the_dense_projection_keeps_linear_fields_and_every_integral():
    random = np.random.default_rng(1)
    rough, plane = random.uniform(0, 1, 4), 1 + SQUARE @ [2.0, -3.0]
    found = galerkin_transfer.project(SQUARE, RISING, np.column_stack([rough, plane]), SQUARE, FALLING)
    assert found[:, 1] == pytest.approx(plane)
    sums = [galerkin_transfer.mass(SQUARE, t).sum(axis=0) for t in (RISING, FALLING)]
    assert sums[1] @ found[:, 0] == pytest.approx(sums[0] @ rough)


@pytest.mark.parametrize("gamma", [0.1, 1.0, 10.0])
def test_sliding_waves_solve_35_and_slide_along_walls_and_end(gamma):
    """By differences."""
    def d(s, y):
        return sliding_waves.displacement(s, y, 20.0, gamma, 20.0)

    def div(s, y):
        return (d(s + h, y)[0] - d(s - h, y)[0] + d(s, y + h)[1] - d(s, y - h)[1]) / (2 * h)

    s, y, h = *np.random.default_rng(2).uniform([1, 1], [19, 19], (30, 2)).T, 1e-3
    laplace = (d(s + h, y) + d(s - h, y) + d(s, y + h) + d(s, y - h) - 4 * d(s, y)) / h**2
    slope = np.array([div(s + h, y) - div(s - h, y), div(s, y + h) - div(s, y - h)]) / (2 * h)
    assert laplace == pytest.approx(-slope / gamma, abs=1e-6 * np.abs(laplace).max())
    for wall in (0.0, 20.0):
        assert np.abs(d(s, wall)[1]).max() < 1e-12
        assert np.abs(d(s, wall + h)[0] - d(s, wall - h)[0]).max() < 1e-9
    assert np.abs(d(0.0, y)[0]).max() == 0.0
    assert np.abs(d(h, y)[1] - d(-h, y)[1]).max() < 1e-9


@pytest.mark.parametrize("gamma", [0.1, 1.0, 10.0])
def test_the_corner_exponent_makes_the_displacement_vanish_on_the_held_side(gamma):
    """kappa s^z - z s conj(s)^(z-1) = B conj(s)^z with a real B; gamma without end: the Laplace operator's pi / (2 w).
    """
    w = np.radians(120)
    z, s = quadratic_mesh_motion.exponent(w, gamma), np.exp(1j * w)
    B = ((1 + 2 * gamma) * s**z - z * s * np.conj(s) ** (z - 1)) / np.conj(s) ** z
    assert abs(B.imag) < 1e-10 and 0.5 < z < 1
    assert quadratic_mesh_motion.exponent(w, 1e9) == pytest.approx(0.75)
