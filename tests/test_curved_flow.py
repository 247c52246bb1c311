"""Taylor-Hood flow on curved triangles: what it prescribes, its work, and the scene's drive."""
import numpy as np
import pytest

from repro.curved import elements, flow, pore
from repro.fem.assembly import each
from repro.model.flow import poiseuille_loss
from tests.strategies import scene

FAST = {"preset": "fast"}


def around(radius="20 um", velocity="2.9 m/day", head=None):
    made = scene(radius, "50 um", velocity=velocity, head=head, numerics=FAST)
    return made, pore.seeded(made).mesh


def test_inlet_and_walls_are_as_prescribed():
    """(3) and (5), at middles too; mean one. Mutants: middles of the inlet left free, a parabola of mean two thirds."""
    _, grid = around()
    velocity, _, _ = flow.unit_flow(grid, 2000.0)
    share = grid.points[grid.inlet, 1] / 50
    assert np.allclose(velocity[grid.inlet], np.column_stack([6 * share * (1 - share), 0 * share]), atol=1e-15)
    assert np.abs(velocity[grid.walls]).max() == 0 and len(grid.inlet) % 2 == 1
    assert np.array_equal(grid.inlet, grid.inlet[np.argsort(grid.points[grid.inlet, 1])])


def test_water_is_conserved_in_every_linear_mean():
    """(q, div u) = 0 for each corner's function. Mutant: the divergence of one component."""
    _, grid = around()
    velocity, _, _ = flow.unit_flow(grid, 2000.0)
    div = np.einsum("tqia,tai->tq", grid.places.slopes, velocity[grid.cells])
    local = (grid.places.dx * div) @ elements.LINEAR
    total = np.bincount(grid.cells[:, :3].ravel(), local.ravel())
    size = np.bincount(grid.cells[:, :3].ravel(), ((grid.places.dx * np.abs(div)) @ elements.LINEAR).ravel())
    assert np.abs(total).max() < 1e-10 * size.max()


@pytest.mark.parametrize("ratio", [1.0, 10.0, 2000.0])
def test_the_loss_is_the_work_of_the_inlet(ratio):
    """It is what viscosity dissipates, and no less than the clean channel's (least dissipation). Mutants: the mean
    pressure of the inlet, work over the flux twice."""
    _, grid = around()
    velocity, _, loss = flow.unit_flow(grid, ratio)
    K = each(np.where(grid.biomass, ratio, 1.0), elements.stiffness(grid.places))
    work = sum(np.einsum("ta,tab,tb->", u, K, u) for u in (velocity[grid.cells, k] for k in (0, 1)))
    assert loss * 50.0 == pytest.approx(work, rel=1e-9)
    assert loss >= poiseuille_loss(grid.ends[1] - grid.ends[0], 50.0) * (1 - 1e-9)
    assert (loss > 1.01 * poiseuille_loss(grid.ends[1] - grid.ends[0], 50.0)) == (ratio > 1)


def test_the_loss_is_that_of_the_head_where_the_flow_is_developed():
    """(6): mean head of the inlet less that of the outlet, which is zero (4). Mutant: 12 L / W^2 for the mesh."""
    _, grid = around("10 um")
    _, pressure, loss = flow.unit_flow(grid, 2000.0)
    ends = [np.trapezoid(pressure[line[::2]], grid.points[line[::2], 1]) / 50 for line in (grid.inlet, grid.outlet)]
    assert ends[0] - ends[1] == pytest.approx(loss, rel=2e-4)
    assert ends[1] == pytest.approx(0.0, abs=1e-4 * ends[0])


@pytest.mark.parametrize("velocity, head", [("2.9 m/day", None), (None, "1e-3 cm")])
def test_the_scene_drives_it(velocity, head):
    """By a mean velocity, or by a head over the whole pore; conductivity u L / head either way. Mutants: the head over
    the mesh alone, viscosity in the velocity and not in the head."""
    made, grid = around(velocity=velocity, head=head)
    found = flow.solve(grid, made.flow, made.pore.length)
    assert found.head_loss == pytest.approx(made.flow.head, rel=1e-12) if head else True
    assert found.mean_velocity == made.flow.mean_velocity if velocity else True
    assert found.conductivity == pytest.approx(found.mean_velocity * made.pore.length / found.head_loss, rel=1e-12)
    rest = poiseuille_loss(made.pore.length - (grid.ends[1] - grid.ends[0]), 50.0)
    nu = made.flow.kinematic_viscosity / made.flow.gravity
    assert found.head_loss - found.meshed_loss == pytest.approx(nu * found.mean_velocity * rest, rel=1e-10)


def test_flow_is_reversible():
    """Stokes: the mirrored aggregate has the same loss, though the mesh is another. Mutant: something that knows
    upstream from downstream."""
    made, grid = around()
    mirrored = grid.points * [-1, 1]
    cells = grid.cells[:, [0, 2, 1, 5, 4, 3]]
    other = type(grid)(mirrored, cells, grid.corners, grid.biomass, grid.loop[::-1], grid.width,
                       (-grid.ends[1], -grid.ends[0]))
    assert flow.unit_flow(other, 2000.0)[2] == pytest.approx(flow.unit_flow(grid, 2000.0)[2], rel=1e-3)
