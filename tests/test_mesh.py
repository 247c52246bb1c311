"""The triangulation (3.1): what it covers, that prescribed nodes stay, and what is bent; and the motion of its nodes
(3.5), (35), whatever the mesh. When a mesh is acceptable is the case mesh_motion-criterion, how fine it is in
`test_sizing.py`, where moved nodes go in the cases of the stage mesh_motion."""
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from repro.errors import MeshError
from repro.model import pore
from tests.strategies import LENGTH, attached_aggregates, meshed, scene, seed, widths

both = pytest.mark.parametrize("geometry", [1, 2])


def fluid_regions(grid):
    """Number of pieces of fluid that hang together through edges."""
    edge = grid.topology.cell_edges[~grid.biomass]
    owner = np.repeat(np.arange(len(edge)), 3)
    link = coo_array((np.ones(edge.size), (owner, edge.ravel()))).tocsr()
    return connected_components(link @ link.T)[0]


@settings(max_examples=20)
@given(attached_aggregates(width=widths) | attached_aggregates(width=widths, geometry=2))
def test_any_outline_keeps_its_nodes_to_the_last_bit_and_its_edges(drawn):
    """The loop is the refined outline, bit for bit; every edge of it is an edge of the mesh, biomass on its left; the
    fluid is one piece, no node is to spare, and no triangle is poor."""
    outline, width = drawn
    grid, fine = meshed(outline, width)
    assert (grid.points[grid.loop] == fine.points).all()
    edges = {(a, b) for t in grid.triangles[grid.biomass] for a, b in zip(t, np.roll(t, -1))}
    corners = grid.straight.loop
    assert {(a, b) for a, b in zip(corners, np.roll(corners, -1))} <= edges
    assert grid.areas.sum() == pytest.approx(np.ptp(grid.ends) * width, rel=1e-12)
    assert grid.area() == pytest.approx(outline.area, rel=1e-12)
    assert fluid_regions(grid) == 1 and len(np.unique(grid.cells)) == len(grid.points) and grid.acceptable()


@both
def test_an_impossible_outline_is_refused_with_its_place(geometry):
    start = seed(5.0, 1.0, geometry)
    crossed = start.points.copy()
    crossed[[-3 * geometry, -2 * geometry]] = crossed[[-2 * geometry, -3 * geometry]]
    with pytest.raises(MeshError, match="crosses itself"):
        meshed(replace(start, points=crossed))
    with pytest.raises(MeshError, match="leaves the meshed part"):
        meshed(start, ends=(-4.0, 50.0))
    with pytest.raises(MeshError, match="leaves the meshed part"):
        meshed(start, width=4.9, ends=(-LENGTH / 2, LENGTH / 2))


def test_only_triangles_at_the_aggregate_are_bent():
    """In a mesh that was made, the others are straight, which ``acceptable`` stands on; and a bent one that is turned
    over is found, and refused."""
    made = pore.seeded(scene("20 um", numerics={"preset": "fast"})).mesh
    straight, others = made.moved(made.with_middles(made.points[: made.corners])), np.ones(len(made.cells), bool)
    bent = made.topology.bent
    others[bent] = False
    assert np.allclose(made.points[made.cells[others]], straight.points[made.cells[others]], rtol=0, atol=1e-12)
    apart = np.abs(made.points[made.cells] - straight.points[made.cells]).max(axis=(1, 2))
    assert not made.biomass[bent[apart[bent] > 0.01]].all() and made.acceptable()
    points = made.points.copy()
    middle = made.loop[np.flatnonzero(points[made.loop, 1] > 10)[0] // 2 * 2 + 1]
    points[middle, 1] += 10.0
    assert not made.moved(points).acceptable()
    with pytest.raises(MeshError, match="a triangle near .* is turned over"):
        made.moved(points).checked()
