"""Stokes flow with the exact velocity prescribed all around a box, for exact solutions without inlet and outlet.

The element matrices of every form, the stabilisation, the assembly and the solver are those of ``repro``; only the
boundary conditions of :mod:`repro.model.flow` are replaced, and a force may act. One pressure is prescribed in the
place of the constant that the velocity leaves open, and the mean of the pressure is not compared.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from skfem import Basis

from repro.fem.assembly import ElementSystem, each, saddle_blocks, saddle_system
from repro.fem.mesh import PoreMesh
from repro.model import flow

QUADRATURE = 6


@dataclass(frozen=True, eq=False)
class Problem:
    """Viscosity ratio, form of the interface and order of the elements; exact(x, y) gives (velocity (..., 2), pressure
    (...)), force(x, y) (..., 2), all without unit."""

    ratio: float
    interface: str
    order: int
    exact: Callable
    force: Callable | None = None


def errors(grid: PoreMesh, problem: Problem) -> dict[str, float]:
    """Relative L2 errors of the velocity and, without its mean, of the pressure; of the pressure over the fluid too."""
    u, p = solve(grid, problem)
    basis = _fine(grid, problem.order, 0)
    x, y = basis.global_coordinates()
    found = np.stack([np.asarray(basis.interpolate(u[:, i])) for i in (0, 1)], axis=-1)
    (truth, level), weight = problem.exact(x, y), basis.dx
    apart = _centred(np.asarray(_fine(grid, problem.order, 1).interpolate(p)) - level, weight)
    size, wet = np.sum(weight * _centred(level, weight) ** 2), ~grid.biomass
    return {"velocity": np.sqrt(np.sum(weight[..., None] * (found - truth) ** 2)
                                / np.sum(weight[..., None] * truth**2)),
            "pressure": np.sqrt(np.sum(weight * apart**2) / size),
            "pressure in the fluid": np.sqrt(np.sum((weight * apart**2)[wet]) / size)}


def _centred(values, weight):
    return values - np.sum(weight * values) / np.sum(weight)


def _fine(grid: PoreMesh, order: int, which: int) -> Basis:
    """The basis of the velocity (0) or the pressure (1) at the points of a fine quadrature."""
    return Basis(grid.fem, flow.ELEMENTS[order][which](), intorder=QUADRATURE)


def solve(grid: PoreMesh, problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Velocity (n, 2) and pressure (N,)."""
    found = flow.forms(grid, problem.order)
    viscosity = np.where(grid.biomass, problem.ratio, 1.0)
    tau = grid.circumdiameter**2 / (100.0 * viscosity) if problem.order == 1 else 0 * viscosity
    elements = saddle_blocks(flow._viscous(found, viscosity, problem.interface), found.divergence,
                             each(tau, found.pressure_laplace))
    system = grid.once(("box", problem.order), lambda: _system(found))
    right, value = np.zeros(len(system.held)), np.zeros(len(system.held))
    n = found.basis.N
    value[: 2 * n] = _without_flux(grid, found, problem.exact(*found.basis.doflocs)[0]).T.ravel()
    if problem.force is not None:
        right[: 2 * n] = _load(_fine(grid, problem.order, 0), problem.force).T.ravel()
    solution = system.solve(elements, right, value)
    return solution[: 2 * n].reshape(2, n).T, solution[2 * n:]


def _rim(found: flow.Forms) -> np.ndarray:
    """(n,) True at the velocity's nodes on the boundary."""
    return np.isin(np.arange(found.basis.N), found.basis.get_dofs().all())


def _system(found: flow.Forms) -> ElementSystem:
    """All velocities of the rim and the first pressure prescribed."""
    rim = _rim(found)
    system = saddle_system(found.cells, found.mesh.triangles,
                           np.column_stack([rim, rim]))
    held = system.held.copy()
    held[2 * len(rim)] = True
    return system.holding(held)


def _without_flux(grid: PoreMesh, found: flow.Forms, velocity: np.ndarray) -> np.ndarray:
    """The rim's velocity (n, 2) less the part c (x, y), in the fluid, of what the interpolated values would pump in: a
    discrete incompressible flow can have none. c is of the order of the interpolation's error."""
    dofs, rim = found.cells, _rim(found)

    def flux(field):
        return np.einsum("tbi,ti->", found.divergence, np.concatenate([field[dofs, 0], field[dofs, 1]], axis=1))

    values = np.where(rim[:, None], velocity, 0.0)
    rim[dofs[grid.biomass]] = False
    outwards = np.where(rim[:, None], found.basis.doflocs.T, 0.0)
    return values - flux(values) / flux(outwards) * outwards


def _load(basis: Basis, force: Callable) -> np.ndarray:
    """(n, 2) integrals of the force times each nodal function."""
    load, at = np.zeros((basis.N, 2)), force(*basis.global_coordinates())
    for nodes, shape in zip(basis.element_dofs, basis.basis):
        np.add.at(load, nodes, np.einsum("tqi,tq->ti", at, np.asarray(shape[0]) * basis.dx))
    return load
