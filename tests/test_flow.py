"""Stokes flow (1)-(6): the flux that every section of any mesh carries, conditions, and biomass that water passes.

Closed forms, other codes, energy, obstacles and mirrors are cases of the stage flow, units of length the cases
coupling-units and hard-17-units; what is told of the whole pore is in `test_derived.py`.
"""
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference import poiseuille
from repro.fem import elements, mesher
from repro.fem.sizing import Sizing
from repro.fem.space import Space
from repro.march.simulation import simulate
from repro.model import flow, pore
from repro.results import row
from repro.run.running import warned
from repro.scene import load_scene
from tests.strategies import ORDERS, between, meshes, seed, share, space_of


@share(0.4)
@given(meshes(), between(1.0, 1e4), st.sampled_from(["laplacian", "traction"]), st.integers(0, 2**32 - 1),
       st.sampled_from(list(ORDERS)))
def test_every_section_carries_the_flux_of_the_inlet(grid, ratio, interface, seed, order):
    """Any field that is one at the inlet and zero at the outlet is a section smeared out, and what carries the
    substrates, w = u - tau grad p or u itself, carries down it u_ave W."""
    space = space_of(grid, order)
    unit = flow.unit_flow(space, ratio, interface=interface)
    section = np.random.default_rng(seed).uniform(-1.0, 2.0, len(grid.points))
    section[grid.topology.inlet], section[grid.topology.outlet] = 1.0, 0.0
    mean = space.gradient_table.weights @ elements.values_on(order, space.gradient_table) * 2  # of each function
    w = np.einsum("a,tai->ti", mean, unit.velocity[space.cells])
    if unit.correction is not None:
        w = w - unit.correction
    slopes = np.einsum("tai,ta->ti", grid.gradients, section[grid.triangles])
    assert -grid.areas @ np.sum(w * slopes, axis=1) == pytest.approx(grid.width, rel=1e-11)


@pytest.mark.parametrize("left", [-1 / 3 * 100, -47.123456789012345, -0.1 * 487])
@pytest.mark.parametrize("order", ORDERS)
def test_nothing_slips_and_the_inlet_is_the_scaled_parabola(order, left):
    """(3), (5), at all nodes, also at ends that are no round numbers: the discrete flux at the inlet is u_ave W to
    round-off, the parabola's own where that is one of the functions, and leaves at the outlet."""
    geometry, refinement = min(order, 2), 1.0 if order == 1 else 0.3
    sizing = Sizing(7.123456, refinement, 2.0)
    grid, _ = mesher.generate(seed(1.0, refinement, geometry), (left, 0.7 - left / 7), sizing, geometry)
    space, W = Space(grid, order), grid.width
    unit, inlet = flow.unit_flow(space, 2000.0), space.end_nodes(space.dofs.inlet)
    on_walls = np.abs(space.points[:, [1]] - [0.0, W]).min(axis=1) < 1e-12 * W
    assert set(space.dofs.walls) == set(np.flatnonzero(on_walls))
    assert (unit.velocity[space.dofs.walls] == 0).all() and (unit.velocity[inlet, 1] == 0).all()
    y, u = space.points[inlet, 1], unit.velocity[inlet, 0]
    assert y[0] == 0.0 and y[-1] == W and (np.diff(y) > 0).all()
    for edges, bound in ((space.dofs.inlet, 1e-13), (space.dofs.outlet, 1e-10)):
        assert space.end_loads(edges, unit.velocity[:, 0]).sum() == pytest.approx(W, rel=bound)
    ratio = u[1:-1] / poiseuille.velocity(y[1:-1], W)
    assert ratio == pytest.approx(np.full(len(ratio), ratio[0]), rel=1e-12)
    assert order == 1 or ratio[0] == pytest.approx(1.0, rel=1e-13)


def in_a_permeable_body(permeability, refinement):
    """Conductivity, the least velocity along the pore in a half-disc of 20 um and 1 um or more from its interface, over
    the mean, and is that warned of?"""
    said = ["numerics.preset=fast", "aggregate.radius=20 um", "flow.biomass=brinkman", "growth.end=0 h",
            f"flow.permeability={permeability} m^2", f"numerics.refinement={refinement}"]
    scene = load_scene("base", said)
    first = next(simulate(scene))
    found = first.solved.flow
    inside = np.hypot(*first.pore.space.points.T) < 19.0
    keys = [each.key for each in warned(scene, found.mean_velocity)]
    return found.conductivity, found.velocity[inside, 0].min() / found.mean_velocity, "flow.permeability" in keys


def test_thin_layers_of_a_permeable_body_make_its_velocities_wiggle_and_are_warned_of():
    """The flow in the body turns back at nodes where (k)^1/2 = 0.1 um is resolved by elements of 4.4 um, and nowhere
    where 2 um is; conductivity is that of elements half as large to 0.1 % (measured 5e-4)."""
    conductivity, backward, told = in_a_permeable_body(1e-14, 0.45)
    assert backward < -1e-3 and told
    assert conductivity == pytest.approx(in_a_permeable_body(1e-14, 0.9)[0], rel=1e-3)
    _, backward, told = in_a_permeable_body(4e-12, 0.45)
    assert backward >= 0 and not told


def test_a_run_with_a_permeable_body():
    """A tight body is nearly a wall, as one of 2000 times the viscosity is: the same growth to a few parts in a
    thousand, and every balance closes."""
    said = ["numerics.preset=fast", "growth.end=15 h", 'output.times=["15 h"]']
    viscous, drag = (list(simulate(load_scene("base", [*said, *more])))[-1] for more in (
        [], ["flow.biomass=brinkman", "flow.permeability=1e-15 m^2"]))
    assert drag.pore.boundary.area == pytest.approx(viscous.pore.boundary.area, rel=2e-3)
    assert drag.solved.flow.conductivity == pytest.approx(viscous.solved.flow.conductivity, rel=1e-2)
    for step in drag.ledgers:
        assert step.supplied == pytest.approx(np.add(step.out, step.consumed), rel=1e-9)


def test_a_run_with_bubbles_balances_and_stays_near_the_stabilised_one():
    """The scene's word reaches the flow (the runs differ); substrates balance since w is divergence-free."""
    rows = {}
    for element in ("stabilised", "bubble"):
        said = load_scene("base", ['numerics.preset="paper"', 'growth.end="1 h"', f"numerics.flow_element={element}"])
        *_, last = simulate(said)
        rows[element] = row(said, last)
    assert abs(rows["bubble"]["donor_balance"]) < 1e-10
    speeds = [rows[name]["mean_velocity_m_per_d"] for name in rows]
    assert 0 < abs(speeds[1] / speeds[0] - 1) < 1e-4


@pytest.mark.parametrize("element, said", [
    (flow.Stabilised(12.0), "numerics.flow_stabilisation=12"), (flow.Bubble(), "numerics.flow_element=bubble")])
def test_what_a_scene_says_of_its_elements_reaches_the_flow(element, said):
    made = load_scene("base", ["numerics.preset=paper", "numerics.refinement=0.4", said])
    space = pore.seeded(made).space
    unit = flow.unit_flow(space, made.flow.viscosity_ratio, element=element)
    wanted = flow.scaled(unit, space.mesh, made.pore.length, made.flow)
    assert np.array_equal(pore.solve_flow(made, space).head, wanted.head)
