"""Mesh motion (3.5), (35): the fluid's nodes follow the aggregate and stay on their lines."""
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skfem import Basis, BilinearForm, ElementTriP1, MeshTri
from skfem.helpers import dot, grad

from repro import geometry, mesh, mesh_motion
from tests.strategies import body_of, meshed, plug, reversed_mesh

GAMMA, C = 1.0, 100.0
SEED, OUTLINE = meshed(geometry.seed(20.0))


def move(grid, body, gamma=GAMMA):
    return mesh_motion.move(grid, body, gamma, C)


def on_their_lines(grid, points):
    ends = np.concatenate([grid.inlet, grid.outlet])
    return all((points[nodes, axis] == grid.points[nodes, axis]).all() for nodes, axis in ((grid.walls, 1), (ends, 0)))


def test_nothing_moves_where_the_aggregate_rests():
    """To the last bit. Mutant: nodes smoothed, a right-hand side that is not the boundary's."""
    assert (move(SEED, SEED.points[SEED.body]) == SEED.points).all()


@settings(max_examples=8)
@given(st.floats(0.9, 1.1), st.floats(-2.0, 2.0), st.floats(0.95, 1.1))
def test_walls_inlet_and_outlet_keep_their_lines_and_the_body_its_place(stretch, shift, rise):
    """Under any linear motion of the aggregate, to the last bit; triangles stay upright.

    Mutant: inlet nodes free across their line, wall nodes held along it, body nodes solved for.
    """
    body = SEED.points[SEED.body] * [stretch, rise] + [shift, 0.0]
    points = move(SEED, body)
    assert (points[SEED.body] == body).all()
    assert on_their_lines(SEED, points)
    assert SEED.moved(points).areas.min() > 0


def test_nodes_of_walls_slide_with_the_aggregate():
    """Wall nodes next to the aggregate go along, those at the inlet's corner stay. Mutant: walls held in both
    directions."""
    points = move(SEED, SEED.points[SEED.body] + [2.0, 0.0])
    wall = np.setdiff1d(SEED.walls[SEED.points[SEED.walls, 1] == 0], SEED.body)
    near = wall[np.argsort(np.abs(SEED.points[wall, 0]))[:2]]
    assert (points[near, 0] - SEED.points[near, 0]).min() > 1.0
    corners = np.concatenate([SEED.inlet[[0, -1]], SEED.outlet[[0, -1]]])
    assert (points[corners] == SEED.points[corners]).all()


@pytest.mark.parametrize("radius, width", [(5.0, 50.0), (27.0, 50.0), (42.0, 50.0)])
def test_five_percent_of_growth_turns_no_triangle_over(radius, width):
    """More than a step of 12 min makes (4 %): the mesh still passes the paper's criterion (3.5). Mutant: fluid nodes
    stay put."""
    grid, outline = meshed(geometry.seed(radius), width)
    points = move(grid, grid.points[grid.body] * np.sqrt(1.05))
    moved = grid.moved(points)
    assert moved.acceptable() and moved.areas.min() > 0
    assert moved.quality.min() > 0.9 * grid.quality.min()
    assert moved.areas[grid.biomass].sum() == pytest.approx(1.05 * outline.area, rel=1e-12)
    assert moved.areas.sum() == pytest.approx(grid.areas.sum(), rel=1e-12)


def test_the_motion_is_linear_in_the_aggregates():
    """Mutant: the stabilisation or the sizes taken from the moved mesh."""
    body = SEED.points[SEED.body]
    once, twice = (move(SEED, body * [1 + s, 1 + 2 * s]) - SEED.points for s in (0.01, 0.02))
    assert twice == pytest.approx(2 * once, abs=1e-11)


@pytest.mark.parametrize("gamma", [0.2, 1e9])
def test_the_motion_solves_35(gamma):
    """Without stabilisation P = -(div d) / gamma, projected, so that d makes |grad d|^2 + |P|^2 gamma least: solved
    anew, densely, with forms of its own. gamma -> infinity: each component harmonic. Mutant: the sign of gamma, 1 /
    gamma, a factor of two."""
    found = mesh_motion.move(SEED, SEED.points[SEED.body] * [1.05, 1.0], gamma, 1e14) - SEED.points
    fluid, local = SEED.fluid, np.full(len(SEED.points), -1)
    local[fluid] = np.arange(len(fluid))
    basis = Basis(MeshTri(SEED.points[fluid].T.copy(), local[SEED.triangles[~SEED.biomass]].T.copy()), ElementTriP1())
    laplace, mass = ((BilinearForm(form).assemble(basis).toarray()) for form in (lambda u, v, w: dot(grad(u), grad(v)),
                                                                                lambda u, v, w: u * v))
    divergence = np.hstack([BilinearForm(lambda u, v, w, i=i: grad(u)[i] * v).assemble(basis).toarray()
                            for i in (0, 1)])
    matrix = np.kron(np.eye(2), laplace) + divergence.T @ np.linalg.solve(mass, divergence) / gamma
    held = np.zeros((2, len(fluid)), bool)
    held[0, local[np.concatenate([SEED.inlet, SEED.outlet])]] = True
    held[1, local[np.setdiff1d(SEED.walls, np.setdiff1d(SEED.body, fluid))]] = True
    held[:, local[np.intersect1d(SEED.body, fluid)]] = True
    held, exact = held.ravel(), found[fluid].T.ravel().copy()
    exact[~held] = np.linalg.solve(matrix[~held][:, ~held], -matrix[~held][:, held] @ exact[held])
    assert np.abs(exact).max() > 0.9
    assert found[fluid].T.ravel() == pytest.approx(exact, abs=1e-8)


def test_the_motion_mirrors():
    """The same triangles in a mirror move as the mirror image. Mutant: x and y blocks of the divergence exchanged."""
    body = SEED.points[SEED.body] * [1.04, 1.02] + [1.0, 0.0]
    there = move(SEED, body)
    back = move(reversed_mesh(SEED), body * [-1, 1])
    assert back * [-1, 1] == pytest.approx(there, abs=1e-10)


def test_both_sides_of_a_plug_follow_it():
    """Mutant: one of the two pieces of fluid left out."""
    grid, outline = meshed(plug(50.0, -20.0, 15.0, 5.0))
    body, _ = body_of(grid, outline)
    points = move(grid, body.reference * [1.05, 1.0])
    assert on_their_lines(grid, points)
    assert mesh.triangle_areas(points, grid.triangles).min() > 0
    x = grid.points[:, 0]
    sides = [np.setdiff1d(np.flatnonzero(side), grid.body) for side in (x < -21, x > 21)]
    assert all(np.abs(points[nodes] - grid.points[nodes]).max() > 0.1 for nodes in sides)
