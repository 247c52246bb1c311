"""Options of the flow in pairs: form of the interface, order of the elements, viscous or permeable body, fluid forces.

Each pair conserves power (the work of the head is the dissipation by viscosity and drag) and momentum (the forces on
the fluid between the aggregate and the other boundaries are in equilibrium). The case transport-balance tests the
substrates, and coupling-seepage-plug the force on a permeable aggregate.
"""
from functools import cache
from itertools import product

import numpy as np
import pytest

from repro.model import solving, traction
from repro.model.meshing import seeded
from tests.strategies import ORDERS
from verification.problems.schemes import exchange, load_scene

#: An aggregate that leans downstream, beside the middle of the pore.
POINTS = '[["-10 um", "0 um"], ["-4 um", "18 um"], ["12 um", "28 um"], ["25 um", "14 um"], ["22 um", "0 um"]]'
BODIES = {"viscous": ["flow.viscosity_ratio=20", "growth.fluid_forces=included"],
          "permeable": ["flow.permeability=40 um^2"]}
INTERFACES = ("laplacian", "traction")
#: Linear elements take no permeable body.
COMBINATIONS = [each for each in product(BODIES, INTERFACES, ORDERS) if each[::2] != ("permeable", 1)]


@cache
def solved(body, interface, order, *changes):
    """(scene, pore, its solution) on a coarse mesh."""
    scene = load_scene("base", [
        f"aggregate.outline={POINTS}", exchange(elements=ORDERS[order]), f"numerics.interface={interface}",
        f"numerics.refinement={0.5 if order == 1 else 0.2}",
        "growth.shear_modulus=1e-3 MPa", *BODIES[body], *changes], unset=["aggregate.radius"])
    state = seeded(scene)
    return scene, state, solving.solve(scene, state)


def strain(space, velocity, interface):
    """(T, q, 2, 2) 1/h: the rate that viscosity multiplies, grad u (+ grad u^T in the traction form), and grad u."""
    shape_gradients = space.gradients_at.gradients
    gradient = np.einsum("tai,tqka->tqik", velocity[space.cells], shape_gradients)
    return gradient + np.swapaxes(gradient, 2, 3) * (interface == "traction"), gradient


@pytest.mark.parametrize("body, interface, order", [each for each in COMBINATIONS if each[2] > 1])
def test_viscosity_and_drag_dissipate_the_work_of_the_head(body, interface, order):
    """Dissipation is g times head loss times flow, to round-off, for elements without stabilisation."""
    scene, state, solution = solved(body, interface, order)
    space, stream = state.space, solution.flow
    symmetrised, gradient = strain(space, stream.velocity, interface)
    ratio = np.where(state.mesh.biomass & (body == "viscous"), 20.0, 1.0)
    dissipated = np.einsum("t,tq,tqik,tqik->", ratio, space.gradients_at.dx, symmetrised, gradient)
    if body == "permeable":
        speed = space.at.evaluate(stream.velocity.T)[:, state.mesh.biomass]
        dissipated += np.einsum("tq,itq,itq->", space.at.dx[state.mesh.biomass], speed, speed) / 40.0
    work = scene.flow.gravity * stream.meshed_loss * stream.mean_velocity * scene.pore.width
    assert work == pytest.approx(scene.flow.kinematic_viscosity * dissipated, rel=1e-9)


@pytest.mark.parametrize("interface, order", [*product(INTERFACES, ORDERS)])
def test_the_force_on_the_aggregate_comes_through_every_section_of_the_fluid(interface, order):
    """The force on the aggregate equals the momentum flux through any section around it, to round-off, if forces and
    flow use the same form. A random field that is one on the aggregate and zero on the other boundaries stands for the
    section."""
    scene, state, solution = solved("viscous", interface, order)
    space, stream, mesh = state.space, solution.flow, state.mesh
    symmetrised, _ = strain(space, stream.velocity, interface)
    head = stream.head[mesh.triangles] @ space.gradient_table.linear.T
    drive = scene.flow
    stress = drive.kinematic_viscosity / drive.gravity * symmetrised - head[..., None, None] * np.eye(2)
    section = np.random.default_rng(1).uniform(-1.0, 2.0, space.count)
    dofs = space.dofs
    around = np.concatenate([dofs.walls, dofs.inlet.ravel(), dofs.outlet.ravel(), space.cells[mesh.biomass].ravel()])
    section[around] = np.isin(around, mesh.body)
    slope = np.einsum("ta,tqka->tqk", section[space.cells], space.gradients_at.gradients)
    wet = ~mesh.biomass
    force = -np.einsum("tq,tqik,tqk->i", space.gradients_at.dx[wet], stress[wet], slope[wet])
    pascals = (drive.density * 1e-3) * (drive.gravity * 1e-6 / 3600**2) * 1e-6
    expected = pascals / (scene.growth.shear_modulus * 1e6) * force
    fluid = traction.Fluid.of(scene)
    forces = traction.forces(fluid, traction.surroundings(fluid.meshing, state, state), state).sum(axis=0)
    assert np.abs(forces).max() > 0 and forces == pytest.approx(expected, rel=1e-8, abs=1e-8 * np.abs(expected).max())


@pytest.mark.parametrize("interface", INTERFACES)
def test_a_permeable_body_lies_between_open_water_and_a_wall(interface):
    """The tighter the body, the less the pore conducts."""
    conductivity = [solved("permeable", interface, 2, f"flow.permeability={permeability} um^2")[2].flow.conductivity
                    for permeability in (1e12, 1e3, 40.0, 1.0)]
    clean = load_scene("base").flow.gravity * 50.0**2 / 12 / load_scene("base").flow.kinematic_viscosity
    assert conductivity[0] == pytest.approx(clean, rel=1e-6) and (np.diff(conductivity) < -1e-3 * clean).all()
