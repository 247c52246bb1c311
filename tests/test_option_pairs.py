"""Options of the flow in pairs: form of the interface, and viscous or permeable body.

Each pair conserves power: the work of the head is the dissipation by viscosity and drag. `test_derived.py` tests the
force of the water in both forms, the case transport-balance the substrates, and coupling-seepage-plug the force on a
permeable aggregate.
"""
from functools import cache

import numpy as np
import pytest

from repro.model import solving
from repro.model.meshing import seeded
from verification.problems.schemes import exchange, load_scene

#: An aggregate that leans downstream, beside the middle of the pore.
POINTS = '[["-10 um", "0 um"], ["-4 um", "18 um"], ["12 um", "28 um"], ["25 um", "14 um"], ["22 um", "0 um"]]'
BODIES = {"viscous": "flow.viscosity_ratio=20", "permeable": "flow.permeability=40 um^2"}
INTERFACES = pytest.mark.parametrize("interface", ["laplacian", "traction"])


@cache
def solved(body, interface):
    """(scene, pore, its solution) on a coarse mesh of elements without stabilisation."""
    scene = load_scene("base", [f"aggregate.outline={POINTS}", exchange(elements="quadratic"), body,
                                f"numerics.interface={interface}", "numerics.refinement=0.2"],
                       unset=["aggregate.radius"])
    state = seeded(scene)
    return scene, state, solving.solve(scene, state)


@pytest.mark.parametrize("body", BODIES)
@INTERFACES
def test_viscosity_and_drag_dissipate_the_work_of_the_head(body, interface):
    """Dissipation is g times head loss times flow, to round-off."""
    scene, state, solution = solved(BODIES[body], interface)
    space, stream = state.space, solution.flow
    gradient = np.einsum("tai,tqka->tqik", stream.velocity[space.cells], space.gradients_at.gradients)
    rate = gradient + np.swapaxes(gradient, 2, 3) * (interface == "traction")
    ratio = np.where(state.mesh.biomass & (body == "viscous"), 20.0, 1.0)
    dissipated = np.einsum("t,tq,tqik,tqik->", ratio, space.gradients_at.dx, rate, gradient)
    if body == "permeable":
        speed = space.at.evaluate(stream.velocity.T)[:, state.mesh.biomass]
        dissipated += np.einsum("tq,itq,itq->", space.at.dx[state.mesh.biomass], speed, speed) / 40.0
    work = scene.flow.gravity * stream.meshed_loss * stream.mean_velocity * scene.pore.width
    assert work == pytest.approx(scene.flow.kinematic_viscosity * dissipated, rel=1e-9)
