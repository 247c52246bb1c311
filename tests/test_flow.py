"""Stokes flow (1)-(6): equal flux through every section of any mesh, and permeable biomass.

The cases of the stage flow cover closed forms, other codes, energy, obstacles and mirrors. The case hard-17-units
covers units of length. `test_derived.py` covers the reported quantities of the pore.
"""
import numpy as np
import pytest
from skfem import MeshTri, MeshTri2

from reference import taylor_hood
from repro.fem.outline import polygon
from repro.fem.walls import channel_walls
from repro.march.simulation import simulate
from repro.model import flow, meshing
from repro.model.interface import interface_of
from repro.model.meshing import seeded
from repro.model.resistance import Viscous
from repro.scene import load_scene
from tests.strategies import in_um


def in_a_permeable_body(permeability, refinement):
    """Return the conductivity, and the ratio of the smallest to the largest velocity u_x in a half-disc of 20 um."""
    overrides = ["numerics.preset=fast", "aggregate.radius=20 um", "growth.end=0 h",
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


@pytest.mark.parametrize("overrides, expected", [
    (["numerics.contact_elements=1"], 2.0), (["numerics.contact_elements=0"], np.inf),
    (["numerics.contact_elements=1", "flow.permeability=1e-15 m^2"], 1.0),
    (["flow.permeability=1e-15 m^2", "numerics.contact_elements=4"], 0.5)])
def test_elements_beside_upper_contact_lines_of_a_permeable_body_are_half_the_least_film_or_less(overrides, expected):
    """Beside an impermeable body one contact element is as long as the least film, 2 um."""
    assert meshing.sized(load_scene("base", ["numerics.preset=fast", *overrides])).contact == pytest.approx(expected)


#: Drawn bodies (um) in a pore of 50 um; the last two span it.
BODIES = {
    "block": [(-10, 0), (-10, 40), (10, 40), (10, 0)],
    "trapezium": [(-25, 0), (-10, 35), (10, 35), (25, 0)],
    "overhanging": [(-8, 0), (-20, 35), (20, 35), (8, 0)],
    "tilted": [(-20, 0), (0, 38), (20, 38), (0, 0)],
    "spanning, tilted": [(-20, 0), (0, 50), (20, 50), (0, 0)],
    "spanning, with a waist": [(-20, 0), (-5, 25), (-20, 50), (20, 50), (5, 25), (20, 0)]}
#: Promised errors of the head loss.
PROMISED = {"fast": 0.02, "accurate": 0.005}


def drawn_body(body, preset, interface):
    return load_scene({"pore": {"width": "50 um"}, "aggregate": {"outline": in_um(BODIES[body])},
                       "flow": {"mean_velocity": "1 m/day"}, "numerics": {"preset": preset, "interface": interface}})


def meshed_loss(scene):
    """The loss (1/um) over the meshed part, for a mean velocity of one."""
    space = seeded(scene).space
    interface = interface_of(scene.numerics.interface)
    return flow.unit_flow(space, Viscous(scene.flow.viscosity_ratio), interface=interface).loss


def graded_loss(scene):
    """The loss (1/um) by the independent code on a mesh graded to every corner, with edges of W / 1000 at tips."""
    width = scene.pore.width
    outline = polygon(np.array(scene.aggregate.outline), channel_walls(width), 2, at_tips=width / 1000, bends=True)
    mesh = seeded(scene, outline=outline).mesh
    plane = MeshTri2.from_mesh(MeshTri(mesh.points[: mesh.corners].T.copy(), mesh.triangles.T.copy()))
    channel = taylor_hood.Channel(plane, mesh.biomass, width, mesh.ends)
    return taylor_hood.stokes(channel, scene.flow.viscosity_ratio, scene.numerics.interface).loss


@pytest.mark.parametrize("interface", ["laplacian", pytest.param("traction", marks=pytest.mark.thorough)])
@pytest.mark.parametrize("body", BODIES)
def test_drawn_bodies_have_the_promised_head_loss(body, interface):
    """The presets meet their bounds against an independent code, where the pressure may jump, on a graded mesh."""
    expected = graded_loss(drawn_body(body, "fast", interface))
    errors = {preset: meshed_loss(drawn_body(body, preset, interface)) / expected - 1 for preset in PROMISED}
    assert all(abs(error) <= PROMISED[preset] for preset, error in errors.items()), errors
