"""A layer of biomass along the lower wall of a long channel: two viscous layers, exact for any ratio of viscosities.

The inlet's parabola turns into the layered profile within a few layers' thicknesses (like exp(-1.1 x / h) in biomass);
the middle of the layer is ten of them away from its ends, where what is left is under 1e-4. The layers meet in a shear
that both forms of [E2] have alike, but in the traction form a layer that is held below and free above forgets its ends
more slowly, like exp(-z x / h) with cos z = z, z = 0.739. Elements of order 2 and 3 hold both parabolas: a coarse mesh
of a longer layer shows that they err by what is left alone.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from reference import layered_channel
from repro.fem.mesh import Mesh, curved
from repro.fem.space import Space
from repro.model import flow
from verification import norms
from verification.case import Check, Outcome, Profile, at_most, case
from verification.convergence import Study, refine, study
from verification.flow import grids

WIDTH, LAYER, LAYER_END, BEYOND, MIDDLE = 50.0, 12.5, 125.0, 15.0, 25.0
RATIOS = (1.0, 10.0, 100.0, 2000.0, 1e5, 1e8)
SIZES, DRAWS = LAYER / np.array([1.5, 3.0, 6.0, 12.0]), (16, 12, 6, 1)
SECOND = "linear elements: second order in L2"
#: Errors of the finest meshes may reach this.
CEILINGS = {"velocity": 1e-3, "velocity in the layer": 1e-3, "gradient": 1.2e-3}


#: Half length (um) of the layer of orders 2 and 3, and what is left of its ends in its middle: exp(-0.739 * 18).
LONG, LEFT = 250.0, 2e-6


@case("flow-layers", kind="exact", slow=True, norm="middle of a long layer, root mean square over random meshes of a "
      "size: L2 of u, of u within the layer (relative to that), and relative error of the pressure gradient",
      claim="Along a layer of biomass the flow is that of two viscous layers, for lambda from 1 to 1e8, to second "
            "order with linear elements in both forms and on any mesh with quadratic and cubic ones",
      mutants=("tau-of-water", "viscosity-swapped"))
def layers() -> Outcome:
    studies = [part for ratio in RATIOS for part in _studies(ratio, "laplacian")]
    studies += _studies(2000.0, "traction")[:1]  # what is left of the ends rules in the layer
    checks = [check for order in (2, 3) for ratio in RATIOS for interface in ("laplacian", "traction")
              for check in _held(order, ratio, interface)]
    return Outcome(tuple(checks), tuple(studies), tuple(_profile(ratio) for ratio in RATIOS))


def _studies(ratio: float, interface: str) -> list[Study]:
    """Of linear elements."""
    errors = refine(_errors, range(len(SIZES)), ratio, interface)
    return [study(f"{name}, lambda = {ratio:g}, {interface}", SIZES, errors[name], 2, SECOND, ceiling=ceiling)
            for name, ceiling in CEILINGS.items()]


def _held(order: int, ratio: float, interface: str) -> list[Check]:
    """Of higher ones."""
    errors = _layered(Space(_long_layer(), order), ratio, interface)
    return [at_most(f"{name}, order {order}, lambda = {ratio:g}, {interface}", error, LEFT,
                    "what is left of the layer's ends") for name, error in errors.items()]


def _errors(level: int, ratio: float, interface: str) -> dict[str, float]:
    return grids.root_mean_square(lambda draw: _layered(Space(_grid(level, draw), 1), ratio, interface), DRAWS[level])


@cache
def _grid(level: int, draw: int) -> Mesh:
    return _channel(LAYER_END, level, draw)


@cache
def _long_layer() -> Mesh:
    """Of six-node triangles."""
    return curved(_channel(LONG, 0, 0), None)


def _channel(half: float, level: int, draw: int) -> Mesh:
    """The layer from -half to half (um), and clean water beyond."""
    end = half + BEYOND
    return grids.channel((-end, end), WIDTH, SIZES[level], lambda x, y: (y < LAYER) & (np.abs(x) < half),
                         across=(-half, half), along=(LAYER,), seed=int(1000 * SIZES[level]) + draw)


def _layered(space: Space, ratio: float, interface: str) -> dict[str, float]:
    grid, found = space.mesh, flow.unit_flow(space, ratio, interface=interface)
    middle = np.abs(grid.points[grid.triangles, 0].mean(axis=1)) < MIDDLE

    def exact(x, y):
        return np.stack([layered_channel.velocity(y, WIDTH, LAYER, ratio), 0 * y], axis=-1)

    gradient = layered_channel.gradient(WIDTH, LAYER, ratio)
    return {"velocity": norms.field_error(space, found.velocity, exact, middle),
            "velocity in the layer": norms.field_error(space, found.velocity, exact, middle & grid.biomass),
            "gradient": abs(slope(flow.pressure_space(space), found.pressure, middle) / gradient - 1)}


def slope(space: Space, pressure: np.ndarray, chosen: np.ndarray) -> float:
    """-dp/dx by least squares over some triangles."""
    where, weight, shape = norms.fine(space, chosen)
    x, p = where[..., 0], pressure[space.cells[chosen]] @ shape.T
    x = x - np.sum(weight * x) / weight.sum()
    return float(-np.sum(weight * p * x) / np.sum(weight * x**2))


def _profile(ratio: float) -> Profile:
    grid, y = _grid(1, 0), np.linspace(0.0, WIDTH, 101)
    where = np.column_stack([np.zeros_like(y), y])
    ours = norms.sample(grid.points, grid.triangles, flow.unit_flow(Space(grid, 1), ratio).velocity[:, 0], where)
    exact = layered_channel.velocity(y, WIDTH, LAYER, ratio)
    return Profile(f"lambda = {ratio:g}", "y (um)", "u_x / u_ave",
                   (("ours", "ours", y, ours), ("exact", "exact", y, exact)))
