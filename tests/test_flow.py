"""Stokes flow (1)-(6): equal flux through every section of any mesh, and permeable biomass.

The cases of the stage flow cover closed forms, other codes, energy, obstacles and mirrors. The cases coupling-units and
hard-17-units cover units of length. `test_derived.py` covers the reported quantities of the pore.
"""
import numpy as np
import pytest

from repro.march.simulation import simulate
from repro.model import flow, pore
from repro.scene import load_scene


def in_a_permeable_body(permeability, refinement):
    """Return the conductivity, and the ratio of the smallest to the largest velocity u_x in a half-disc of 20 um."""
    overrides = ["numerics.preset=fast", "aggregate.radius=20 um", "flow.biomass=brinkman", "growth.end=0 h",
                 f"flow.permeability={permeability} m^2", f"numerics.refinement={refinement}"]
    first = next(simulate(load_scene("base", overrides)))
    along = first.solved.flow.velocity[np.unique(first.pore.space.cells[first.pore.mesh.biomass]), 0]
    return first.solved.flow.conductivity, along.min() / along.max()


@pytest.mark.parametrize("permeability", [4e-12, 1e-12, 1e-14, 1e-16, 2.5e-20])
def test_velocities_in_a_permeable_body_do_not_turn_back_however_thin_its_layers(permeability):
    """In one dimension no node overshoots if a quadratic element is at most 6.3 times as long as the layer is thick;
    1 % allows for triangles. Elements half as large give the same conductivity to 1 %, the bound on a film's loss."""
    conductivity, backward = in_a_permeable_body(permeability, 0.45)
    assert backward > -0.01
    assert conductivity == pytest.approx(in_a_permeable_body(permeability, 0.9)[0], rel=1e-2)


def spanning(permeability, out, height):
    """Return the first instant of a pore of 100 um with a body from wall to wall. It has 16 um of contact in the middle
    and, on either side, points at 92 um times ``out`` and 100 um times ``height``."""
    right = [(f"{8 + 92 * x:.6g} um", f"{100 * y:.6g} um") for x, y in zip(out, height)]
    left = [(f"-{x}", y) for x, y in right[::-1]]
    outline = str([list(point) for point in left + right]).replace("'", '"')
    return next(simulate(load_scene("base", [
        "numerics.preset=fast", "pore.width=100 um", f"aggregate.outline={outline}", "flow.mean_velocity=5.06 m/day",
        "flow.biomass=brinkman", f"flow.permeability={permeability} m^2", "growth.end=0 h"],
        unset=["flow.head", "aggregate.radius"])))


def dome(permeability):
    """A body that has just touched the upper wall: a quarter of an ellipse on either side."""
    out = np.linspace(0.0, 1.0, 12)
    return spanning(permeability, out, np.sqrt(1 - out**2))


@pytest.mark.parametrize("permeability", [1e-15, 5.67e-17])
def test_water_that_must_pass_a_permeable_body_leaves_concentrations_within_their_bounds(permeability):
    """The flow enters beside the upper contact line. There a velocity with sources raises the donor from 10 mg/L to 11
    to 17. A hundredth is half of the accepted overshoot."""
    solved = dome(permeability).solved.concentrations
    for field in (solved.acceptor, solved.donor):
        assert 0 < field.min() and field.max() < 10.1


@pytest.mark.parametrize("overrides, expected", [
    ([], 2.0), (["numerics.contact_elements=0"], np.inf),
    (["flow.biomass=brinkman", "flow.permeability=1e-15 m^2"], 1.0),
    (["flow.biomass=brinkman", "flow.permeability=1e-15 m^2", "numerics.contact_elements=4"], 0.5)])
def test_elements_beside_upper_contact_lines_of_a_permeable_body_are_half_the_least_film_or_less(overrides, expected):
    """Beside an impermeable body fast has elements of the least film, 2 um."""
    assert pore.sized(load_scene("base", ["numerics.preset=fast", *overrides])).contact == pytest.approx(expected)


@pytest.mark.parametrize("element, setting", [
    (flow.Stabilised(12.0), "numerics.flow_stabilisation=12"), (flow.Bubble(), "numerics.flow_element=bubble")])
def test_the_elements_of_a_scene_reach_the_flow(element, setting):
    scene = load_scene("base", ["numerics.preset=paper", "numerics.refinement=0.4", setting])
    space = pore.seeded(scene).space
    unit = flow.unit_flow(space, scene.flow.viscosity_ratio, element=element)
    expected = flow.scaled(unit, space.mesh, scene.pore.length, scene.flow)
    assert np.array_equal(pore.solve_flow(space, scene.flow, scene.pore.length, scene.numerics).head, expected.head)
