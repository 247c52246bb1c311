"""The aggregate's boundary of straight edges or parabolic arcs. `test_unseen.py` tests its measures, `test_sizing.py`
its splits."""
import numpy as np
import pytest

from repro.fem import outline as of
from repro.fem.outline import FREE
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
    first, second = of.slopes(nodes)
    for t in (0.3, 0.5, 1.0):
        assert nodes[:, 0] + t * first + 0.5 * t**2 * second == pytest.approx(of.parabola(t) @ nodes, abs=1e-12)


@pytest.mark.parametrize("contact", [False, True])
def test_a_smooth_seed_is_a_natural_spline_through_its_points(contact):
    """Knots are spaced as the square roots of the chords. Between two points the second differences, and so the
    curvature, are linear. The curvature is continuous at points, and zero at both ends. Between two points on the
    upper wall the outline is straight."""
    top = [(-3.0, 20.0), (2.0, 20.0)] if contact else [(-3.0, 17.0), (2.0, 12.0)]
    knots = np.array([(-16.0, 0.0), (-14.0, 9.0), *top, (4.0, 11.0), (11.0, 0.0)])
    loop = of.polygon(knots, 20.0, smooth=True).points
    rim = np.vstack([loop[2:], loop[:1]])[::-1]
    indices = [np.flatnonzero((rim == point).all(axis=1))[0] for point in knots]
    pieces = [rim[a: b + 1] for a, b in zip(indices, indices[1:])]
    bent = [piece for piece in pieces if (piece[:, 1] < 20).any()]
    assert len(bent) == 5 - contact and all(len(piece) == 9 for piece in bent)
    curvatures = [64 * np.diff(piece, 2, axis=0) / np.linalg.norm(piece[-1] - piece[0]) for piece in bent]
    assert max(np.abs(np.diff(curvature, 2, axis=0)).max() for curvature in curvatures) < 1e-11
    ends = [(2 * curvature[0] - curvature[1], 2 * curvature[-1] - curvature[-2]) for curvature in curvatures]
    assert np.abs([ends[0][0], ends[-1][1]]).max() < 1e-10
    assert contact or all(np.allclose(one[1], other[0], rtol=0, atol=1e-9) for one, other in zip(ends, ends[1:]))
