"""Stokes flow with the exact velocity prescribed all around a box, for exact solutions without inlet and outlet.

The element matrices of every form and order, the stabilisation, the assembly and the solver are those of ``repro``;
only the boundary conditions of :mod:`repro.model.flow` are replaced, and a force may act. One pressure is prescribed in
the place of the constant that the velocity leaves open, and the mean of the pressure is not compared.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from repro.fem.assembly import ElementSystem, saddle_system
from repro.fem.mesh import Mesh
from repro.fem.space import Space
from repro.model import flow
from verification.kernel.case import Profile, compared
from verification.problems import norms


@dataclass(frozen=True, eq=False)
class Problem:
    """Viscosity ratio, form of the interface and order of the velocity; exact(x, y) gives (velocity (..., 2), pressure
    (...)), force(x, y) (..., 2), all without unit."""

    ratio: float
    interface: str
    order: int
    exact: Callable
    force: Callable | None = None


def errors(grid: Mesh, problem: Problem) -> dict[str, float]:
    """Relative L2 errors of the velocity and, without its mean, of the pressure."""
    u, p = solve(grid, problem)
    space = Space(grid, problem.order)
    pressures = flow.pressure_space(space)
    where, weight, shape = norms.fine(space)
    x, y = np.moveaxis(where, -1, 0)
    truth, level = problem.exact(x, y)
    found = np.einsum("qa,tai->tqi", shape, u[space.cells])
    heads = p[pressures.cells] @ norms.fine(pressures)[2].T
    return {"velocity": norms.relative(found, truth, weight),
            "pressure": norms.relative(_centred(heads, weight), _centred(level, weight), weight)}


def profile(grid: Mesh, problem: Problem, s: np.ndarray, where: np.ndarray, along: np.ndarray, x_label: str) -> Profile:
    """The component ``along`` of the velocity at places (K, 2), drawn over s (K,)."""
    ours = norms.field_at(Space(grid, problem.order), solve(grid, problem)[0], where)
    return compared("velocity", x_label, "its component", s, ours @ along, problem.exact(*where.T)[0] @ along)


def _centred(values, weight):
    return values - np.sum(weight * values) / np.sum(weight)


def solve(grid: Mesh, problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Velocity (n, 2) and pressure (m,), both at the nodes of their orders."""
    space = Space(grid, problem.order)
    viscosity = np.where(grid.biomass, problem.ratio, 1.0)
    stabilised = problem.order == 1
    mobility = flow.Stabilised().mobility(grid, viscosity, problem.interface) if stabilised else None
    blocks = flow.stokes(space, viscosity, problem.interface, mobility)
    system = grid.topology.system(("box", problem.order), lambda: _system(space))
    right, value = np.zeros(len(system.held)), np.zeros(len(system.held))
    n = space.count
    velocity, _ = problem.exact(*space.points.T)
    value[: 2 * n] = _without_flux(space, velocity).T.ravel()
    if problem.force is not None:
        right[: 2 * n] = _load(space, problem.force).T.ravel()
    solution = system.solve(blocks, right, value)
    return solution[: 2 * n].reshape(2, n).T, solution[2 * n:]


def _rim(space: Space) -> np.ndarray:
    """(n,) True at the velocity's nodes on the boundary."""
    dofs, on = space.dofs, np.zeros(space.count, bool)
    for nodes in (dofs.walls, dofs.inlet, dofs.outlet):
        on[nodes] = True
    return on


def _system(space: Space) -> ElementSystem:
    """All velocities of the rim and the first pressure prescribed."""
    rim = _rim(space)
    system = saddle_system(space.cells, flow.pressure_space(space).cells, np.column_stack([rim, rim]))
    held = system.held.copy()
    held[2 * len(rim)] = True
    return system.holding(held)


def _without_flux(space: Space, velocity: np.ndarray) -> np.ndarray:
    """The rim's velocity (n, 2) less the part c (x, y), in the fluid, of what the interpolated values would pump in: a
    discrete incompressible flow can have none. c is of the order of the interpolation's error."""
    cells, rim, divergence = space.cells, _rim(space), flow.divergence(space)

    def flux(field):
        return np.einsum("tbi,ti->", divergence, np.concatenate([field[cells, 0], field[cells, 1]], axis=1))

    values = np.where(rim[:, None], velocity, 0.0)
    rim[cells[space.mesh.biomass]] = False
    outwards = np.where(rim[:, None], space.points, 0.0)
    return values - flux(values) / flux(outwards) * outwards


def _load(space: Space, force: Callable) -> np.ndarray:
    """(n, 2) integrals of the force times each nodal function."""
    where, weight, shape = norms.fine(space)
    at = force(*np.moveaxis(where, -1, 0))
    load = np.zeros((space.count, 2))
    np.add.at(load, space.cells, np.einsum("tq,tqi,qa->tai", weight, at, shape))
    return load
