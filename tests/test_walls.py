"""Each rule of a wall holds on either wall of the pore, and a wall does what its fields say."""
from dataclasses import replace

import numpy as np
import pytest

from repro.fem import mesher, sizing
from repro.fem.outline import half_disc
from repro.fem.sizing import Sizing
from repro.fem.space import Space
from repro.fem.walls import FREE, channel_walls
from repro.model import contact, flow, pore
from repro.scene import load_scene
from tests.strategies import EVERY_ORDER, coarse_base

WIDTH = 50.0
WALLS = pytest.mark.parametrize("on", channel_walls(WIDTH), ids=["lower", "upper"])


def with_wall(at, number, **fields):
    """A pore in which one of the walls has other fields."""
    walls = tuple(replace(wall, **fields) if wall.number == number else wall for wall in at.mesh.walls)
    return replace(at, space=Space(replace(at.mesh, walls=walls)))


@WALLS
def test_a_wall_measures_gaps_into_the_pore(on):
    """Both walls have the gap zero at themselves, and W at the opposite wall."""
    points = np.array([[3.0, 0.0], [3.0, 0.25 * WIDTH], [3.0, WIDTH]])
    expected = np.array([0.0, 0.25, 1.0]) * WIDTH
    assert on.gap(points if on.y == 0 else points * [1, -1] + [0, WIDTH]) == pytest.approx(expected)
    assert on.holds(points).tolist() == [on.y == 0, False, on.y == WIDTH]


@WALLS
@EVERY_ORDER
def test_a_seed_on_either_wall_has_the_same_boundary_sizes_and_mesh(order, on):
    """The boundary is counterclockwise, the paper's R is the radius, and films face the other wall."""
    walls = channel_walls(WIDTH)
    (other,) = [wall for wall in walls if wall != on]
    seed = half_disc(20.0, 6.0, order, 3.0, on)
    assert seed.area == pytest.approx(np.pi / 2 * 20.0**2, rel=0.02) and seed.thickness == pytest.approx(20.0)
    assert (on.holds(seed.points) == (seed.wall == on.number)).all()
    assert seed.points[seed.fixed].tolist() == [[3.0, on.y]]
    assert seed.untouched(walls) == (other,) and seed.gap(walls) == pytest.approx(WIDTH - 20.0)
    assert seed.nearest(other)[1] == pytest.approx(3.0, abs=0.1)
    sizes = Sizing(walls, 0.5, 2.0, seed=3.0)
    points, _ = sizing.size_sources(seed, sizes)
    assert np.count_nonzero(other.holds(points)) == np.count_nonzero(seed.wall == FREE)
    mesh, split = mesher.generate(seed, sizing.meshed_extent(seed, WIDTH, 600.0), sizes, order)
    assert mesh.area() == pytest.approx(seed.area, rel=1e-9)
    assert mesh.areas.sum() == pytest.approx(WIDTH * np.diff(mesh.ends)[0], rel=1e-3)
    radius = np.hypot(*(split.origin - [3.0, on.y])[split.wall == FREE].T)
    assert radius == pytest.approx(np.full(len(radius), 20.0), rel=1e-3 if order == 2 else 1e-12)


@pytest.mark.parametrize("number", [1, 2])
@EVERY_ORDER
def test_water_slips_only_along_a_wall_that_lets_it(order, number):
    """No water crosses the wall. The other wall has no slip."""
    _, seed = coarse_base(order)
    at = with_wall(seed, number, no_slip=False)
    velocity = flow.unit_flow(at.space).velocity
    for wall in at.mesh.walls:
        nodes = np.setdiff1d(at.mesh.nodes_on(wall), at.space.dofs.inlet)
        assert (velocity[nodes, 1] == 0).all() and velocity[nodes, 0].any() == (wall.number == number)


def grown_plug(order):
    """(mechanics, pore): a block from wall to wall after uneven growth, before its new shape."""
    points = ", ".join(f'["{x} um", "{y} um"]' for x, y in [(-14, 0), (-11, 20), (10, 20), (16, 0)])
    preset = {1: "paper", 2: "fast"}[order]
    scene = load_scene("base", [f"numerics.preset={preset}", f"aggregate.outline=[{points}]", "pore.width=20 um",
                                "numerics.refinement=0.3"], unset=["aggregate.radius"])
    seed = pore.seeded(scene)
    x = seed.mesh.points[seed.mesh.cells[seed.mesh.biomass, :3], 0].mean(axis=1)
    seed = replace(seed, theta=seed.theta * (1.2 + 0.01 * x)[:, None])
    return contact.Mechanics.of(scene), seed


@pytest.mark.parametrize("number", [1, 2])
@EVERY_ORDER
def test_a_surface_keeps_its_place_on_a_bonded_wall_alone(order, number):
    mechanics, seed = grown_plug(order)
    seed = with_wall(seed, number, bonded=True)
    moved = contact.expand(mechanics, seed, seed.theta).position[seed.mesh.loop] - seed.boundary.points
    for wall in seed.mesh.walls:
        along = np.abs(moved[seed.wall == wall.number, 0]).max()
        assert along == 0.0 if wall.number == number else along > 0.1


@pytest.mark.parametrize("number", [1, 2])
def test_a_new_surface_keeps_a_point_unless_its_wall_keeps_none(number):
    _, seed = grown_plug(2)
    lost = replace(seed, fixed=np.zeros_like(seed.fixed))
    on = lost.wall == number
    kept = contact._with_new_surface(lost.boundary, lost.mesh.walls)
    assert np.count_nonzero(kept & on) == 1 and np.count_nonzero(kept) == 2
    slack = with_wall(lost, number, keeps_point=False)
    kept = contact._with_new_surface(slack.boundary, slack.mesh.walls)
    assert np.count_nonzero(kept & on) == 0 and np.count_nonzero(kept) == 1


@pytest.mark.parametrize("wall", ["sliding", "bonded"])
def test_a_scene_bonds_the_wall_of_its_seed_alone(wall):
    walls = pore.walls_of(load_scene("base", [f"growth.wall={wall}"]))
    assert [each.bonded for each in walls] == [wall == "bonded", False]
