"""The aggregate's boundary of straight edges or parabolic arcs. `test_rows.py` tests its measures, `test_sizing.py`
its splits."""
import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from repro.fem import outline as of
from repro.fem.walls import FREE, channel_walls
from tests.strategies import plug, seed


def test_the_interface_consists_of_the_edges_at_the_fluid():
    sides = plug(50.0, -10.0, 10.0)
    assert sides.interface_edges().tolist() == [False, False, True, False, False, True]
    assert (sides.edge_wall != FREE).tolist() == [True, True, False, True, True, False]
    for geometry in (1, 2):
        start = seed(5.0, 1.0, geometry)
        assert start.interface_edges().sum() == (start.wall == FREE).sum() + 1
        edges = start.corners.interface_edges()
        assert np.array_equal(edges, start.edge_wall == FREE)


def test_slopes_of_arcs_are_those_of_their_parabolas():
    """An arc follows from its value, slope and second derivative at its start, to round-off, at every t."""
    nodes = np.random.default_rng(7).uniform(-9.0, 9.0, (5, 3, 2))
    first, second = of.arc_derivatives(nodes)
    for t in (0.3, 0.5, 1.0):
        assert nodes[:, 0] + t * first + 0.5 * t**2 * second == pytest.approx(of.parabola(t) @ nodes, abs=1e-12)


@pytest.mark.parametrize("contact", [False, True])
def test_a_smooth_seed_is_a_natural_spline_through_its_points(contact):
    """Knots are spaced as the square roots of the chords, and each piece has eight edges. Between two points on the
    upper wall the outline is straight, with a node in the middle."""
    top = [(-3.0, 20.0), (2.0, 20.0)] if contact else [(-3.0, 17.0), (2.0, 12.0)]
    given = np.array([(-16.0, 0.0), (-14.0, 9.0), *top, (4.0, 11.0), (11.0, 0.0)])
    knots = np.cumsum([0.0, *np.linalg.norm(np.diff(given, axis=0), axis=1) ** 0.5])
    spline = CubicSpline(knots, given, bc_type="natural")
    pieces = [spline(np.linspace(start, end, 9)[:-1]) for start, end in zip(knots, knots[1:])]
    if contact:
        pieces[2] = [top[0], (-0.5, 20.0)]
    loop = of.polygon(given, channel_walls(20.0), smooth=True).points
    assert np.vstack([loop[2:], loop[:1]])[::-1] == pytest.approx(np.vstack([*pieces, given[-1]]), abs=1e-12)
