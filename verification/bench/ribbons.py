"""This package's transport on right triangles that halve the square cells of a rectangle: the grids of other codes."""

from __future__ import annotations

import numpy as np

from repro.fem.mesh import Mesh, curved
from repro.fem.space import Space
from repro.model import transport
from repro.model.flow import Flow
from repro.model.kinetics import Sink
from repro.scene import parse_scene

#: um2/h of acceptor and donor, in fluid and biomass alike; mg/L.
DIFFUSIVITY, DENSITY = (8e6, 4e6), 3e4


def scene():
    """Substrates and kinetics of Table 1, but for the diffusivities."""
    kinds = {name: {"diffusivity": f"{d} um^2/h", "diffusivity_in_aggregate": f"{d} um^2/h"}
             for name, d in zip(("acceptor", "donor"), DIFFUSIVITY)}
    return parse_scene({"substrates": kinds, "aggregate": {}}, "ribbon", "ribbon.toml")


def straight(ends, width: float, cells: tuple[int, int], inside) -> Mesh:
    """cells (along, across) halved; ``inside(x, y)`` of the triangles' middles is biomass."""
    x, y = np.meshgrid(np.linspace(*ends, cells[0] + 1), np.linspace(0.0, width, cells[1] + 1), indexing="ij")
    number = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (part.ravel() for part in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    triangles = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    points = np.column_stack([x.ravel(), y.ravel()])
    biomass = inside(*points[triangles].mean(axis=1).T)
    return Mesh.of(points, triangles, biomass, np.empty(0, int), width, ends)


def solved(given, grid: Mesh, order: int, speed: float = 0.0):
    """(acceptor's, donor's) fluxes by linear (order 1), quadratic or cubic elements, in plug flow (um/h) or at rest."""
    space = Space(grid if order == 1 else curved(grid, None), order)
    flow = plug_flow(space, speed) if speed else None
    problem = transport.problem(space, flow, given.substrates, given.kinetics)
    sink = Sink(DENSITY * space.reaction.dx)
    return transport.fluxes(problem, sink, transport.steady(problem, sink))


def plug_flow(space: Space, speed: float) -> Flow:
    """The same speed (um/h) everywhere, without loss."""
    correction = np.zeros((len(space.cells), 2)) if space.order == 1 else None
    velocity = np.tile([speed, 0.0], (space.count, 1))
    return Flow(speed, velocity, np.zeros(space.mesh.corners), correction, 0.0, 0.0, 1.0)
