"""Flow below a plane of symmetry: half of a channel of twice the width, with its mirror image beyond the plane.

Closed forms: half of Poiseuille's parabola, and of the profile between two layers of biomass. The remainder of the
layers' ends decays more slowly than with one layer (:mod:`verification.cases.flow`), because the water between the
layers is three times as wide: like exp(-2.1 x / 37.5), 3e-6 over the 225 um that are left here.
"""
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from reference import half_channel, poiseuille
from repro.fem import mesher
from repro.fem.mesh import Mesh
from repro.fem.sizing import Sizing
from repro.fem.space import Space
from repro.fem.walls import channel_walls
from repro.model import flow
from repro.model.interface import interface_of
from repro.model.resistance import Viscous
from verification.cases import flow as flow_cases
from verification.cases.flow import ENDS, ENDS_FIRST, FORMS, LENGTH, MEAN, RATIO, SECOND, VISCOSITY, WIDTH, viscous
from verification.evidence.cases import combined, parametrize
from verification.evidence.checks import each_at_most, refine, studies
from verification.problems import meshes

WALLS = channel_walls(WIDTH, upper="symmetry")


def below(grid: Mesh) -> Mesh:
    """A mesh whose upper wall is a plane of symmetry. A topology keeps its systems, with their walls, so it is new."""
    return replace(grid, walls=WALLS, topology=replace(grid.topology))


@pytest.mark.case(
    "flow-symmetry-poiseuille", kind="exact", references=("poiseuille",),
    mutants=("plane-is-a-wall", "inlet-without-the-mirror-image", "unmeshed-without-the-mirror-image"))
@parametrize("order, interface", combined(flow_cases.ORDERS, FORMS), slow=("traction",))
def test_poiseuille(order, interface, record):
    """Below a plane of symmetry a clean channel has half of Poiseuille's parabola between walls twice as far apart,
    its loss, and the conductivity of that pore.

    Norm: L2 of u over the mesh, relative error of the head loss over it, and of the conductivity of a pore of 600 um.
    """
    if order == 1:
        record(studies(refine(_poiseuille, (0.7, 1.25, 2.2, 3.9), 1, interface), {
            "velocity": (2, SECOND, 3e-4), "head loss": (1, ENDS_FIRST, 6e-3),
            "conductivity": (1, ENDS_FIRST, 1.5e-3)}))
        return
    errors = _poiseuille(0.7, 2, interface)
    record(each_at_most({name: errors[name] for name in ("velocity", "head loss", "conductivity")}, 1e-10,
                        flow_cases.ROUND_OFF))


def _poiseuille(refinement: float, order: int, interface: str) -> dict[str, float]:
    grid, _ = mesher.generate_around([], ENDS, Sizing(WALLS, refinement, 2.0), order)
    space = Space(grid)
    solution = flow.solve(space, flow_cases.drive(mean_velocity=MEAN), LENGTH, interface=interface_of(interface))
    exact = poiseuille.head_loss(np.ptp(ENDS), 2 * WIDTH, MEAN, VISCOSITY)
    return {"size": meshes.mean_size(grid), "velocity": meshes.field_error(space, solution.velocity / MEAN, _velocity),
            "head loss": abs(solution.meshed_loss / exact - 1),
            "conductivity": abs(solution.conductivity / poiseuille.conductivity(2 * WIDTH, VISCOSITY) - 1)}


def _velocity(x, y):
    return np.stack([poiseuille.velocity(y, 2 * WIDTH), 0 * y], axis=-1)


#: Element sizes (um) with the number of meshes of each, for linear elements.
SIZES = dict(zip(flow_cases.LAYER / np.array([1.25, 2.5, 5.0, 10.0]), (16, 8, 3, 1)))
LINEAR = {"velocity": (2, SECOND, 3e-3), "gradient": (2, SECOND, 5e-3)}


@pytest.mark.slow
@pytest.mark.case(
    "flow-symmetry-layers", kind="exact", mutants=("plane-is-a-wall", "inlet-without-the-mirror-image"),
    references=("half_channel",))
@parametrize("order, ratio, interface", combined(flow_cases.ORDERS, viscous(10.0, RATIO), FORMS))
def test_layers(order, ratio, interface, record):
    """Below a plane of symmetry the flow along a layer is that between two layers, lambda = 10 and 2000, to second
    order with linear elements and on any mesh with quadratic ones.

    Norm: middle of a long layer, root mean square over random meshes of a size: L2 of u, relative error of the pressure
    gradient.
    """
    if order == 1:
        record(studies(refine(_viscous_layer, SIZES, ratio, interface), LINEAR))
        return
    errors = _in_the_middle(flow_cases.long_layer(), ratio, interface)
    record(each_at_most(errors, 1e-5, "remainder of the layer's ends"))


def _viscous_layer(size: float, draw: int, ratio: float, interface: str) -> dict[str, float]:
    grid = _long(size, draw)
    return {"size": size, **_in_the_middle(grid, ratio, interface)}


@cache
def _long(size: float, draw: int) -> Mesh:
    return flow_cases._layered(flow_cases.LONG, size, draw)


def _in_the_middle(grid: Mesh, ratio: float, interface: str) -> dict[str, float]:
    space = Space(below(grid))
    solution = flow.unit_flow(space, Viscous(ratio), interface=interface_of(interface))
    return flow_cases.in_the_middle(space, solution, half_channel, ratio)
