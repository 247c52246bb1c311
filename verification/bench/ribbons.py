"""This package's transport on right triangles that halve the square cells of a rectangle: the grids of other codes."""

from __future__ import annotations

import numpy as np

from repro.curved import fields
from repro.curved import mesh as curved_mesh
from repro.curved import transport as curved_transport
from repro.fem.mesh import PoreMesh
from repro.model import transport
from repro.model.flow import Flow
from repro.scene import parse_scene

#: um2/h of acceptor and donor, in fluid and biomass alike; mg/L.
DIFFUSIVITY, DENSITY = (8e6, 4e6), 3e4


def scene():
    """Substrates and kinetics of Table 1, but for the diffusivities."""
    kinds = {name: {"diffusivity": f"{d} um^2/h", "diffusivity_in_aggregate": f"{d} um^2/h"}
             for name, d in zip(("acceptor", "donor"), DIFFUSIVITY)}
    return parse_scene({"substrates": kinds, "aggregate": {}}, "ribbon", "ribbon.toml")


def straight(ends, width: float, cells: tuple[int, int], inside) -> PoreMesh:
    """cells (along, across) halved; ``inside(x, y)`` of the triangles' middles is biomass."""
    x, y = np.meshgrid(np.linspace(*ends, cells[0] + 1), np.linspace(0.0, width, cells[1] + 1), indexing="ij")
    number = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (part.ravel() for part in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    triangles = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    points = np.column_stack([x.ravel(), y.ravel()])
    biomass = inside(*points[triangles].mean(axis=1).T)
    return PoreMesh(points, triangles, biomass, np.empty(0, int), width, ends)


def solved(given, grid: PoreMesh, order: int, speed: float = 0.0):
    """(acceptor's, donor's) fluxes by linear (order 1), quadratic or cubic elements, in plug flow (um/h) or at rest."""
    stage = transport if order == 1 else curved_transport
    mesh = grid if order == 1 else curved_mesh.curved(grid, None)
    count = len(mesh.points)
    nodes = count if order == 1 else fields.space(mesh, order).count
    flow = Flow(speed, np.tile([speed, 0.0], (nodes, 1)), np.zeros(len(grid.points)),
                np.zeros((len(grid.triangles), 2)), 0.0, 0.0, 1.0) if speed else None
    more = {} if order == 1 else {"order": order}
    problem = stage.problem(mesh, flow, given.substrates, given.kinetics, **more)
    active = np.zeros(count)
    active[mesh.body] = DENSITY
    return stage.fluxes(problem, active, stage.steady(problem, active))
