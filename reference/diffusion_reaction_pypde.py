"""Steady diffusion and dual Monod uptake in two dimensions, (7)-(8) without flow, by finite differences (py-pde).

    D lap C = X q(C_A, C_D),   C = supply at x = -a and x = a,   no flux through y = 0 and y = W

on a Cartesian grid that the biomass's boundary cuts: a cell takes up as much as the part of it that is biomass. D is
the same in fluid and biomass, so that py-pde's Laplacian applies. The fixed point C = (D lap)^-1 X q(C) is found by a
Newton-Krylov method whose preconditioner is py-pde's Poisson solver itself; nothing is compiled.
"""
import numpy as np
from pde import CartesianGrid
from pde.backends.registry import get_backend
from scipy.optimize import newton_krylov

from reference.channel_bvp import uptake

PARTS = 8


def half_disc(cells, half_length, width, radius, diffusivity, supply, density, rates):
    """(points (n, 2), C (2, n)) at the cells' centres; ``cells`` across the width; diffusivity, supply: pairs."""
    grid = CartesianGrid([[-half_length, half_length], [0.0, width]], [round(2 * half_length / width * cells), cells])
    points = np.moveaxis(np.array(grid.cell_coords), -1, 0).reshape(2, -1)
    sink = density * _share(points, width / cells, radius)
    solvers = [_poisson(grid, s) for s in supply]
    supply, shape = np.array(supply, float)[:, None], grid.shape

    def carried(fields):
        rates_now = uptake(*fields, rates)
        return np.stack([solve((sink * q / d).reshape(shape)) for solve, q, d in zip(solvers, rates_now, diffusivity)])

    found = newton_krylov(lambda part: part - carried(supply * part) / supply, np.ones((2, points.shape[1])),
                          f_tol=1e-9)
    return points.T, supply * found


def _share(points, cell, radius):
    """Part of each cell within the disc around the origin."""
    offsets = (np.arange(PARTS) + 0.5) / PARTS - 0.5
    within = [np.hypot(points[0] + a * cell, points[1] + b * cell) < radius for a in offsets for b in offsets]
    return np.mean(within, axis=0)


def _poisson(grid, supply):
    """f -> C with lap C = f and the boundary conditions, by py-pde."""
    bcs = grid.get_boundary_conditions([[{"value": supply}] * 2, [{"derivative": 0.0}] * 2])
    solver = get_backend("scipy").get_operator_info(grid, "poisson_solver").factory(bcs=bcs)

    def solve(right):
        out = np.empty(grid.shape)
        solver(right, out)
        return out.ravel()

    return solve
