"""A permeable layer along the lower wall of a long channel: Brinkman's drag instead of a viscosity, exact for any drag.

Its boundary layers are sqrt(k) thick; where elements resolve these, errors fall as the elements' order says. Much
thinner ones (1e-15 m2 has 0.03 um) are not resolved: then the layer is nearly a wall, and what matters to the water
beside it is the pressure gradient.
"""

from __future__ import annotations

import numpy as np

from reference import brinkman_channel
from repro.fem.mesh import Mesh, curved
from repro.fem.space import Space
from repro.model import flow
from verification.flow.closed_forms import slope
from verification.kernel.case import Check, Outcome, Study, at_most, case, refine, study
from verification.problems import meshes, norms

WIDTH, LAYER, HALF, BEYOND, MIDDLE = 50.0, 12.5, 150.0, 15.0, 25.0
SIZES, DRAWS = LAYER / np.array([2.0, 3.0, 4.0, 6.0]), (4, 3, 2, 1)
#: um2: a boundary layer of ten micrometres, resolved by all sizes; one of three hundredths, by none.
RESOLVED, TIGHT = 100.0, 1e-3
#: On unrelated meshes by sizes 1.33 apart, orders scatter more than by sizes 2 apart.
BAND = 0.8
#: Cubic elements against quadratic ones of the same size: a hundredth was measured at a third of the layer.
CUBIC = 0.05


@case("flow-permeable-layers", kind="exact", slow=True, norm="middle of a long layer, root mean square over random "
      "meshes of a size: L2 of u; relative error of the pressure gradient",
      claim="Along a permeable layer the flow is that of a layer with Brinkman's drag: of third order with quadratic "
            "elements, and twenty times nearer with cubic ones; a layer too tight to be resolved acts as a wall to one "
            "percent",
      mutants=("drag-in-the-water", "drag-halved"), ways="2 3",
      because="linear elements are refused with a permeable body")
def permeable() -> Outcome:
    interfaces = ("laplacian", "traction")
    checks = [*map(_cubic, interfaces), *map(_tight, (2, 3))]
    return Outcome(tuple(checks), tuple(map(_study, interfaces)))


def _study(interface: str) -> Study:
    errors = refine(_errors, range(len(SIZES)), interface)
    return study(f"velocity, order 2, {interface}", SIZES, errors["velocity"], 3,
                 "quadratic elements: third order in L2", ceiling=2e-4, band=BAND)


def _errors(level: int, interface: str) -> dict[str, float]:
    return meshes.root_mean_square(lambda draw: _layered(2, RESOLVED, interface, level, draw), DRAWS[level])


def _cubic(interface: str) -> Check:
    cubic, quadratic = (_layered(order, RESOLVED, interface, 1, 0)["velocity"] for order in (3, 2))
    return at_most(f"velocity, order 3 over order 2, {interface}", cubic / quadratic, CUBIC, "the elements' orders")


def _tight(order: int) -> Check:
    errors = _layered(order, TIGHT, "laplacian", 2, 0)
    return at_most(f"gradient, order {order}, k = {TIGHT:g} um2", errors["gradient"], 1e-2,
                   "of a wall instead of the layer: 2.5e-3; what the elements beside it add is of that order")


def _grid(level: int, draw: int) -> Mesh:
    end = HALF + BEYOND
    return curved(meshes.cut((-end, end), WIDTH, SIZES[level], lambda x, y: (y < LAYER) & (np.abs(x) < HALF),
                                across=(-HALF, HALF), along=(LAYER,), seed=int(1000 * SIZES[level]) + draw), None)


def _layered(order: int, permeability: float, interface: str, level: int, draw: int) -> dict[str, float]:
    space = Space(_grid(level, draw), order)
    found = flow.unit_flow(space, interface=interface, permeability=permeability)
    middle = np.abs(space.mesh.points[space.mesh.triangles, 0].mean(axis=1)) < MIDDLE

    def exact(x, y):
        return np.stack([brinkman_channel.velocity(y, WIDTH, LAYER, permeability), 0 * y], axis=-1)

    gradient = brinkman_channel.gradient(WIDTH, LAYER, permeability)
    return {"velocity": norms.field_error(space, found.velocity, exact, middle),
            "gradient": abs(slope(flow.pressure_space(space), found.pressure, middle) / gradient - 1)}
