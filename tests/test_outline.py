"""The aggregate's boundary, of straight edges or of parabolic arcs; its measures are in `test_unseen.py`, its splits in
`test_sizing.py`."""
import numpy as np
import pytest

from repro.fem import outline as of
from repro.fem.outline import FREE
from tests.strategies import plug, seed


def test_the_interface_is_what_borders_the_fluid():
    sides = plug(50.0, -10.0, 10.0)
    assert sides.interface_edges().tolist() == [False, False, True, False, False, True]
    assert (sides.edge_wall != FREE).tolist() == [True, True, False, True, True, False]
    for geometry in (1, 2):
        start = seed(5.0, 1.0, geometry)
        assert start.interface_edges().sum() == (start.wall == FREE).sum() + 1
        edges = start.corners.interface_edges()
        assert np.array_equal(edges, start.edge_wall == FREE)


def test_slopes_of_arcs_are_those_of_their_parabolas():
    """An arc is its value, slope and second derivative at its start, to round-off, at every t."""
    nodes = np.random.default_rng(7).uniform(-9.0, 9.0, (5, 3, 2))
    first, second = of.slopes(nodes)
    for t in (0.3, 0.5, 1.0):
        assert nodes[:, 0] + t * first + 0.5 * t**2 * second == pytest.approx(of.parabola(t) @ nodes, abs=1e-12)


@pytest.mark.parametrize("contact", [False, True])
def test_a_smooth_seed_is_a_natural_spline_through_its_points(contact):
    """Over knots apart as the roots of the chords: between two points second differences are linear, and so is the
    curvature, which goes on at a point and is zero at either end; straight where both points are on the upper wall."""
    top = [(-3.0, 20.0), (2.0, 20.0)] if contact else [(-3.0, 17.0), (2.0, 12.0)]
    given = np.array([(-16.0, 0.0), (-14.0, 9.0), *top, (4.0, 11.0), (11.0, 0.0)])
    loop = of.polygon(given, 20.0, smooth=True).points
    rim = np.vstack([loop[2:], loop[:1]])[::-1]
    at = [np.flatnonzero((rim == point).all(axis=1))[0] for point in given]
    pieces = [rim[a: b + 1] for a, b in zip(at, at[1:])]
    bent = [piece for piece in pieces if (piece[:, 1] < 20).any()]
    assert len(bent) == 5 - contact and all(len(piece) == 9 for piece in bent)
    curvatures = [64 * np.diff(piece, 2, axis=0) / np.linalg.norm(piece[-1] - piece[0]) for piece in bent]
    assert max(np.abs(np.diff(each, 2, axis=0)).max() for each in curvatures) < 1e-11
    ends = [(2 * each[0] - each[1], 2 * each[-1] - each[-2]) for each in curvatures]
    assert np.abs([ends[0][0], ends[-1][1]]).max() < 1e-10
    assert contact or all(np.allclose(one[1], other[0], rtol=0, atol=1e-9) for one, other in zip(ends, ends[1:]))
