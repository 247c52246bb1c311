"""The traction that keeps a sliding contact surface in place: a closed form on both walls, and where it acts.
`test_derived.py` tests the traction that a run reports."""

from dataclasses import replace

import numpy as np
import pytest

from repro.fem.walls import BOTTOM, FREE, TOP
from repro.model import growth, mechanics
from repro.model.mechanics import supports_of
from repro.model.meshing import seeded
from tests.strategies import EVERY_ORDER, ORDERS, coarse_base, in_um
from verification.problems.schemes import exchange, load_scene


def block(order, *changes):
    """(scene, seed): a block of 20 by 20 um from wall to wall."""
    outline = in_um([(-10, 0), (-10, 20), (10, 20), (10, 0)])
    scene = load_scene("base", [f"aggregate.outline={outline}", 'pore.width="20 um"', "numerics.refinement=0.3",
                                exchange(elements=ORDERS[order]), *changes],
                       unset=["aggregate.radius"])
    return scene, seeded(scene)


def nodes_of(seed, wall):
    """Nodes of the aggregate on a wall."""
    return seed.region.own_loop[seed.body.wall == wall]


def on_sides(seed, traction):
    """(n, 2) nodal forces of a traction upwards on the downstream side, and downwards on the upstream one."""
    outline, rim = seed.boundary, seed.region.own_loop
    forces = np.zeros((len(seed.mesh.body), 2))
    weights = {1: [1 / 2, 1 / 2], 2: [1 / 6, 4 / 6, 1 / 6]}[outline.geometry]
    for edge in outline.edges_on(FREE):
        rise = outline.points[edge[-1], 1] - outline.points[edge[0], 1]  # the loop is counterclockwise
        forces[rim[edge], 1] += traction * rise * np.array(weights)
    return forces


@EVERY_ORDER
def test_simple_shear_between_two_walls_is_exact(order):
    """F = [[1, g], [0, 1]] at P = g^2 / 3 has the traction g along both walls, and g upwards and downwards on the
    sides. The fixed points move apart by g times the width. A force at a point could not give this shape. The
    derivative is exact, so each step of Newton's method squares the defect (measured 2 steps)."""
    scene, seed = block(order)
    g, X = 0.3, seed.body.reference
    prescribed = X.copy()
    upper = nodes_of(seed, TOP)
    fixed = seed.region.own_loop[seed.body.fixed & (seed.body.wall == TOP)]
    prescribed[fixed, 0] += g * 20.0
    rim = seed.region.own_loop
    constrained = mechanics.constrained(len(X), rim, seed.body.wall, seed.body.fixed)
    forces = on_sides(seed, g)
    supports = supports_of(seed.body.solid, seed, forces)
    solid, theta = seed.body.solid, seed.body.theta
    shapes = [growth.equilibrium(solid, theta, X, np.zeros(solid.shape.corners), constrained, prescribed,
                                 forces=forces, supports=each) for each in (supports, [])]
    exact = X + g * X[:, 1:] * [1.0, 0.0]
    assert shapes[0].position == pytest.approx(exact, abs=1e-8)
    assert shapes[0].pressure == pytest.approx(np.full(seed.body.solid.shape.corners, g**2 / 3), abs=1e-8)
    assert shapes[0].iterations <= 3
    assert np.abs(shapes[1].position - exact)[upper].max() > 0.1


@EVERY_ORDER
def test_an_equilibrium_a_metre_from_the_origin_stops_at_round_off(order):
    """There stored positions are rounded by 1e-10 um, and Newton's method cannot reach its tolerance. Its last residual
    is within the rounding error of every row, with supports too. If one corner moves by a hundred roundings, it is not.
    """
    _, seed = block(order)
    g, shift = 0.3, np.array([1e6, 0.0])
    solid = replace(seed.body.solid, reference=seed.body.reference + shift)
    X = solid.reference
    prescribed = X.copy()
    rim = seed.region.own_loop
    prescribed[rim[seed.body.fixed & (seed.body.wall == TOP)], 0] += g * 20.0
    constrained = mechanics.constrained(len(X), rim, seed.body.wall, seed.body.fixed)
    forces = on_sides(seed, g)
    supports = supports_of(seed.body.solid, seed, forces)
    rest = growth.equilibrium(solid, seed.body.theta, X, np.zeros(solid.shape.corners), constrained, prescribed,
                              forces=forces, supports=supports)
    assert rest.position == pytest.approx(X + g * seed.body.reference[:, 1:] * [1.0, 0.0], abs=1e-7)
    system = growth.System(solid, constrained, forces=forces, supports=supports,
                           stabilisation=growth.STABILISATIONS[solid.shape.geometry].on(solid, X))
    last = system.under(seed.body.theta, rest.position, rest.position, rest.pressure)
    assert last.defect > growth.NEWTON and system.at_round_off(last)
    moved = rest.position.copy()
    moved[np.flatnonzero(~constrained.any(axis=1))[0]] += 1e-8
    assert not system.at_round_off(system.under(seed.body.theta, moved, moved, rest.pressure))


@pytest.mark.parametrize("wall, walls", [("sliding", [BOTTOM, TOP]), ("bonded", [TOP])])
@EVERY_ORDER
def test_a_traction_acts_on_each_surface_that_slides(order, walls, wall):
    """On its own nodes alone, with the resultant 1. A bonded surface has none: each of its points bears its force."""
    scene, seed = block(order, f'growth.wall="{wall}"')
    seed = seed.with_body(fixed=seed.body.fixed & ~seed.boundary.contact_ends)
    position = seed.mesh.points[seed.mesh.body]
    supports = supports_of(seed.body.solid, seed, None)
    points = position[[each.point for each in supports]]
    assert points == pytest.approx(np.array([[0.0, 20.0 * (wall == TOP)] for wall in walls]))
    for wall, each in zip(walls, supports):
        on = nodes_of(seed, wall)
        assert each.load.sum() == pytest.approx(1.0) and (each.load[on] > 0).all()
        assert not np.delete(each.load, on).any()
        assert position[:, 0] @ each.load == pytest.approx(0.0, abs=1e-9)


@EVERY_ORDER
def test_the_traction_is_uniform_per_length_of_the_reference(order):
    """Growth that is larger downstream stretches this part, and its traction is smaller there. With stress-free biomass
    the present configuration is the reference."""
    def loaded(*changes):
        scene, seed = block(order, *changes)
        X = seed.mesh.points
        grown = seed.moved(X + [0.02, 0.0] * X**2)
        positions = grown.mesh.points[grown.mesh.body]
        body, _ = grown.body.configuration.restarted(positions).strained(grown.body.solid, grown.body.theta)
        position = positions[:, 0]
        return [(seed.body.reference[:, 0] @ each.load, position @ each.load)
                for each in supports_of(body, grown, None)]

    mean_square = 0.02 * 10.0**2 / 3  # of X; the trapezoidal rule of linear edges, 2.5 um long, adds 0.02 * 2.5^2 / 6
    for reference, present in loaded():
        assert reference == pytest.approx(0.0, abs=1e-9)
        assert present == pytest.approx(mean_square, abs=0.1)
    for _, present in loaded('growth.new_biomass="stress_free"'):
        assert present == pytest.approx(0.02 * 10.0**2, abs=5e-3)  # the middle of the present surface


def test_a_surface_of_one_node_bears_its_force_there():
    """It has no length. On straight edges a film may close at one node."""
    scene, seed = coarse_base(1)
    wall = seed.body.wall.copy()
    wall[seed.boundary.points[:, 1].argmax()] = TOP
    touching = seed.with_body(wall=wall, fixed=seed.body.fixed | (wall == TOP))
    supports = supports_of(seed.body.solid, touching, np.zeros((len(seed.mesh.body), 2)))
    assert [seed.mesh.points[seed.mesh.body][each.point, 1] for each in supports] == [0.0]
