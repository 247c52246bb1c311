"""The references of transfer and mesh motion are right by themselves: known integrals, equations, orders."""
import numpy as np
import pytest

from reference import galerkin_transfer, quadratic_mesh_motion, sliding_waves

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
RISING, FALLING = np.array([[0, 1, 2], [0, 2, 3]]), np.array([[0, 1, 3], [1, 2, 3]])


def test_two_diagonals_of_a_square_make_four_quarters():
    assert galerkin_transfer.overlaps(SQUARE, RISING, SQUARE, FALLING) == pytest.approx(np.full((2, 2), 0.25))


def test_products_of_linear_functions_are_integrated_exactly():
    """x^2, x y and y^2 over the lower triangle: 1/4, 1/8, 1/12."""
    corners = SQUARE[RISING[0]]
    exact = [[1 / 4, 1 / 8], [1 / 8, 1 / 12]]
    assert galerkin_transfer.product(corners, corners, corners) == pytest.approx(np.array(exact))


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


@pytest.mark.parametrize("contact", [np.pi / 2, np.pi / 3])
def test_the_quadratic_elements_cover_the_fluid_and_converge(contact):
    """Around a half-disc and a segment: area of the fluid; the displacement's square to third order, as quadratic
    elements do."""
    def measure(parts):
        found = quadratic_mesh_motion.follow(25.0, contact, 50.0, 50.0, parts, 1.0, lambda x, y: np.array([x, y]))
        return found.weights.sum(), np.sum(found.weights @ found.displacement**2)

    rows = np.array([measure(parts) for parts in (6, 12, 24)])
    assert rows[-1, 0] == pytest.approx(5000 - 625 * (contact - np.sin(contact) * np.cos(contact)), rel=1e-6)
    apart = np.abs(np.diff(rows[:, 1]))
    assert np.log2(apart[0] / apart[1]) > 2.7 and apart[1] < 1e-4 * rows[-1, 1]


def test_the_quadratic_elements_leave_the_ends_and_walls_on_their_lines():
    """And the arc moves as it is told."""
    found = quadratic_mesh_motion.follow(25.0, np.pi / 2, 50.0, 50.0, 6, 1.0, lambda x, y: np.array([x, 2 * y]))
    assert found.on_line[0] == pytest.approx(found.line[0] * [1, 2])
    assert found.line[-1] == pytest.approx([50.0, 50.0]) and np.abs(found.on_line[-1]).max() == 0.0
