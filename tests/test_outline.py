"""The aggregate's boundary, of straight edges or of parabolic arcs: measures, and splits that change nothing."""
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given

from repro.fem import outline as of
from repro.fem import sizing
from repro.fem.outline import BOTTOM, FREE
from tests.strategies import attached_aggregates, plug, seed, widths, with_arcs

both = pytest.mark.parametrize("geometry", [1, 2])


def wavy(radius=20.0, refinement=0.5, bend=0.03):
    """A seed with its free nodes pushed about, so that its arcs are bent unevenly; places at t = 0 as the half-disc."""
    start = seed(radius, refinement, 2)
    random = np.random.default_rng(7)
    free = (start.wall == FREE)[:, None]
    points = start.points + free * random.uniform(-bend, bend, start.points.shape) * radius
    return replace(start, points=points)


def sampled(shape, per_edge=2000):
    """Points of the edges, densely."""
    t = np.linspace(0, 1, per_edge, endpoint=False)
    return np.einsum("ta,mai->mti", of.parabola(t), shape.arcs(shape.points)).reshape(-1, 2)


@both
@pytest.mark.parametrize("refinement", [0.25, 0.5, 1.0, 2.5])
def test_the_seed_is_a_half_disc_on_the_wall_centred_at_its_fixed_point(refinement, geometry):
    """Middles on the arc too; only the middle of the base is fixed. n chords cut a half-disc to n R^2 sin(pi/n) / 2;
    arcs have its area to (edge / R)^4."""
    start, elsewhere = (of.half_disc(5.0, 10 * refinement, geometry, x) for x in (0.0, -30.0))
    free = start.wall == FREE
    assert np.hypot(*start.points[free].T) == pytest.approx(5.0, rel=1e-15)
    assert (start.points[free, 1] > 0).all() and (start.points[~free, 1] == 0).all()
    assert (start.wall[~free] == BOTTOM).all()
    bounds = start.upstream, start.downstream, start.thickness
    assert bounds == ((-5.0, 5.0, 5.0) if geometry == 1 else pytest.approx((-5.0, 5.0, 5.0), rel=1e-4))
    assert start.highest == pytest.approx(0.0, abs=1e-12)
    chords = free.sum() + 1
    exact = chords * 12.5 * np.sin(np.pi / chords) if geometry == 1 else np.pi * 12.5
    assert start.area == pytest.approx(exact, rel=1e-14 if geometry == 1 else 2e-4 if refinement < 1 else 1e-5)
    assert start.points[start.fixed].tolist() == [[0.0, 0.0]] and start.geometry == geometry
    assert np.allclose(elsewhere.points, start.points + [-30.0, 0.0], rtol=0, atol=1e-13)
    assert elsewhere.points[elsewhere.fixed].tolist() == [[-30.0, 0.0]]
    assert all((one.origin == one.points).all() for one in (start, elsewhere))
    assert len(start.points) % (2 * geometry) == 0


def test_the_interface_is_what_borders_the_fluid():
    sides = plug(50.0, -10.0, 10.0)
    assert sides.interface_edges().tolist() == [False, False, True, False, False, True]
    assert (sides.edge_wall != FREE).tolist() == [True, True, False, True, True, False]
    for geometry in (1, 2):
        start = seed(5.0, 1.0, geometry)
        assert start.interface_edges().sum() == (start.wall == FREE).sum() + 1
        edges = start.corners.interface_edges()
        assert np.array_equal(edges, start.edge_wall == FREE)


def test_area_and_extremes_are_those_of_the_arcs():
    """Against a polygon of 2000 points an arc; the largest y is between nodes."""
    shape = wavy(bend=0.1)
    x = sampled(shape)
    assert shape.area == pytest.approx(of.polygon_area(x), rel=1e-6)
    assert shape.upstream == pytest.approx(x[:, 0].min(), abs=1e-5)
    assert shape.downstream == pytest.approx(x[:, 0].max(), abs=1e-5)
    assert shape.thickness == pytest.approx(x[:, 1].max(), abs=1e-5)
    assert shape.highest == pytest.approx(x[x[:, 1].argmax(), 0], abs=1e-2)
    assert shape.thickness > shape.points[:, 1].max() + 1e-3, "else nothing is tested"


@given(attached_aggregates(width=widths))
def test_arcs_with_middles_half_way_are_the_polygon(drawn):
    """What both kinds of outlines say of the same curve."""
    straight, _ = drawn
    arcs = with_arcs(straight)
    assert arcs.area == pytest.approx(straight.area, rel=1e-13)
    for name in ("upstream", "downstream", "thickness"):
        assert getattr(arcs, name) == pytest.approx(getattr(straight, name), rel=1e-13)
    assert np.array_equal(arcs.edge_wall, straight.edge_wall)
    assert np.array_equal(arcs.corners.points, straight.points) and arcs.corners.geometry == 1
    assert straight.corners is straight
    assert np.allclose(arcs.arcs(arcs.points), straight.arcs(straight.points), rtol=0, atol=1e-13)


def test_halved_arcs_are_the_same_curve():
    """Only those asked for; twice as many nodes there."""
    shape = wavy()
    which = np.zeros(len(shape.points) // 2, bool)
    which[[2, -1]] = True
    cut = sizing.halved(shape, which)
    assert len(cut.points) == len(shape.points) + 4 and cut.area == pytest.approx(shape.area, rel=1e-13)
    kept = (shape.points[:, None] == cut.points[None]).all(axis=2).any(axis=1)
    assert kept.all()


def test_slopes_of_arcs_are_those_of_their_parabolas():
    """An arc is its value, slope and second derivative at its start, to round-off, at every t."""
    nodes = np.random.default_rng(7).uniform(-9.0, 9.0, (5, 3, 2))
    first, second = of.slopes(nodes)
    for t in (0.3, 0.5, 1.0):
        assert nodes[:, 0] + t * first + 0.5 * t**2 * second == pytest.approx(of.parabola(t) @ nodes, abs=1e-12)


def values(functions, place):
    return [function(place) for function in functions]



@pytest.mark.parametrize("contact", [False, True])
def test_a_smooth_seed_is_a_natural_spline_through_its_points(contact):
    """Over knots apart as the roots of the chords: cubic between two points, with two derivatives that go on at a point
    and the second zero at either end; straight where both points are on the upper wall, and nowhere else."""
    top = [(-3.0, 20.0), (2.0, 20.0)] if contact else [(-3.0, 17.0), (2.0, 12.0)]
    given = np.array([(-16.0, 0.0), (-14.0, 9.0), *top, (4.0, 11.0), (11.0, 0.0)])
    loop = of.polygon(given, 20.0, smooth=True).points
    rim = np.vstack([loop[2:], loop[:1]])[::-1]
    at = np.array([np.flatnonzero((rim == point).all(axis=1)) for point in given]).ravel()
    pieces = [(rim[a: b + 1], np.sqrt(np.linalg.norm(rim[b] - rim[a]))) for a, b in zip(at, at[1:])]
    ends = []
    for piece, apart in pieces:
        if contact and (piece[:, 1] == 20).all():
            ends.append(None)
            continue
        t = np.linspace(0.0, apart, len(piece))
        fit = [np.polynomial.Polynomial.fit(t, x, 3) for x in piece.T]
        assert len(t) == 9 and np.abs([f(t) for f in fit] - piece.T).max() < 1e-12
        slopes = [f.deriv() for f in fit]
        bends = [f.deriv(2) for f in fit]
        ends.append([(values(slopes, place), values(bends, place)) for place in (0.0, apart)])
    assert np.abs([ends[0][0][1], ends[-1][1][1]]).max() < 1e-10
    joined = [(one[1], other[0]) for one, other in zip(ends, ends[1:]) if one and other]
    assert len(joined) == 2 + 2 * (not contact) and all(np.allclose(*both, rtol=0, atol=1e-9) for both in joined)
