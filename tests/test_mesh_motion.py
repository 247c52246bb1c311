"""Mesh motion (3.5), (35): the fluid's nodes follow the aggregate and stay on their lines, whatever the mesh; where
they go is in the cases of the stage mesh_motion."""
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from repro.fem.mesh import curved, triangle_areas
from repro.model import mesh_motion
from tests.strategies import meshed, meshes, seed

GAMMA, C = 1.0, 100.0
#: Straight triangles, or curved ones with middles half way.
with_aggregate = st.builds(lambda grid, bend: curved(grid, None) if bend else grid, meshes(clean=False), st.booleans())
growths = st.tuples(st.floats(0.95, 1.05), st.floats(0.95, 1.05))


def move(grid, body, gamma=GAMMA):
    return mesh_motion.move(grid, body, gamma, C)


def on_their_lines(grid, points):
    dofs = grid.topology.dofs(grid.geometry)
    ends = np.concatenate([dofs.inlet.ravel(), dofs.outlet.ravel()])
    return all((points[nodes, axis] == grid.points[nodes, axis]).all() for nodes, axis in ((dofs.walls, 1), (ends, 0)))


def test_edges_of_the_fluid_stay_straight_but_at_the_interface():
    """Corners move as those of the straight triangles do, those of the walls along them."""
    grid = meshed(seed(20.0, 1.0, 2))[0]
    body = grid.points[grid.body] * [1.05, 1.02]
    points = move(grid, body)
    middles = np.setdiff1d(np.arange(grid.corners, len(points)), grid.body)
    assert np.allclose(points[middles], grid.with_middles(points[: grid.corners])[middles], rtol=0, atol=1e-12)
    straight = grid.straight
    inside = grid.body < grid.corners
    assert np.allclose(points[: grid.corners], move(straight, body[inside]), rtol=0, atol=1e-12)
    assert (points[grid.body] == body).all() and grid.moved(points).acceptable()
    sliding = np.setdiff1d(grid.topology.walls, grid.body)
    assert np.abs(points - grid.points)[sliding, 0].max() > 0.5


@given(with_aggregate, growths)
def test_walls_inlet_and_outlet_keep_their_lines_and_the_body_its_place(grid, growth):
    """On any mesh, under any linear motion of the aggregate by up to 5 % (a step makes 4 %): to the last bit; triangles
    stay upright, and their areas add up to the pore's."""
    body = grown(grid, growth)
    points = move(grid, body)
    assert (points[grid.body] == body).all()
    assert on_their_lines(grid, points)
    after = triangle_areas(points, grid.triangles)
    assert after.min() > 0 and after.sum() == pytest.approx(grid.areas.sum(), rel=1e-12)
    assert not grid.moved(points).turned_over().any()


def grown(grid, growth):
    """Places of the aggregate's nodes: stretched about its middle along x and, while it has a film, along y."""
    places = grid.points[grid.body]
    middle = places[:, 0].mean()
    rise = 1.0 if (places[:, 1] == grid.width).any() else growth[1]
    return (places - [middle, 0.0]) * [growth[0], rise] + [middle, 0.0]
