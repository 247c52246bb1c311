"""The reference for growth into the opposite wall, against prescribed wedges, the rule itself, symmetry and area."""
from functools import cache

import numpy as np
import pytest
from skfem import Basis, ElementTriP2

from reference import contact_growth
from reference.arcs import curved
from reference.contact_growth import Walls
from reference.quadratic_growth import Equilibrium

RADIUS, WALLS = 1.0, Walls(2.4, 0.1, 0.3)
GUESS = np.radians([75.0, 105.0])


def even(x, y):
    """theta: the same in the mirrored body."""
    return 5.0 + x**2 + y


def uneven(x, y):
    """theta: larger upstream."""
    return 5.0 - 2.0 * x + y


@cache
def touching(theta, mirrored=False):
    mesh = contact_growth.half_disc(RADIUS, 4, 1)
    field = (lambda x, y: theta(-x, y)) if mirrored else theta
    return contact_growth.grow(mesh, RADIUS, field, 8.0, WALLS, GUESS)


@pytest.mark.parametrize("slope, expected", [(0.15, 0.1 * (1 - 0.15 / 0.3)), (0.3, 0.0), (0.6, 0.1 * 0.1 * (1 - 2))])
def test_a_straight_wedge_lacks_what_its_slope_lacks(slope, expected):
    """In a wedge that is too narrow the gap falls short most at the distance film / tan(angle); in one that is too wide
    the least excess is beside the line, where the test begins."""
    mesh = curved(contact_growth.half_disc(RADIUS, 16, 0), RADIUS)
    angle = np.arctan2(*mesh.doflocs[::-1])
    beyond = np.maximum(np.abs(angle - np.pi / 2) - np.pi / 4, 0.0)
    place = np.array([np.pi / 2 - angle, WALLS.height - slope * beyond])
    angles = np.pi * np.array([0.25, 0.75])
    missing = contact_growth.missing_gap(Equilibrium(mesh, place, np.zeros(0)), angles, WALLS)
    assert missing == pytest.approx([expected, expected], abs=2e-3)


@pytest.mark.parametrize("theta", [pytest.param(even, marks=pytest.mark.thorough), uneven])
def test_the_gap_is_as_large_as_required_everywhere_and_no_larger_at_one_place(theta):
    """The gap is compared on a denser set of points than that of the solution."""
    angle, (x, y) = contact_growth.outline(touching(theta).equilibrium, 500)
    for line, begin, outwards in zip(touching(theta).lines, touching(theta).angles, (1, -1)):
        distance = outwards * (x - line)
        required = np.minimum(WALLS.film, WALLS.slope * distance)
        free = (outwards * (begin - angle) > 0) & (distance > 0.1 * WALLS.film / WALLS.slope)
        spare = (WALLS.height - y - required)[free]
        assert spare.min() == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize("theta", [pytest.param(even, marks=pytest.mark.thorough), uneven])
def test_the_area_is_that_of_the_growth(theta):
    equilibrium = touching(theta).equilibrium
    _, (x, y) = contact_growth.outline(equilibrium)
    area = np.sum(0.5 * (x[:-1] * y[1:] - x[1:] * y[:-1]))
    basis = Basis(equilibrium.mesh, ElementTriP2(), intorder=6)
    assert area == pytest.approx(np.sum(theta(*basis.global_coordinates()) * basis.dx), rel=1e-3)


@pytest.mark.parametrize("theta", [pytest.param(even, marks=pytest.mark.thorough), uneven])
def test_a_mirrored_growth_has_mirrored_contact_lines(theta):
    """Even growth has symmetric contact lines, uneven growth has not."""
    growth, mirrored = touching(theta), touching(theta, mirrored=True)
    for one, other in ((growth.lines, mirrored.lines), (growth.tips, mirrored.tips)):
        assert other == pytest.approx(-one[::-1], abs=1e-4)
    assert (abs(growth.lines.sum()) > 0.1) == (theta is uneven)
