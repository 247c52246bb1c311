"""Dual Monod uptake in a strip crossed by plug flow, (7)-(8) in one dimension, by scipy's collocation (solve_bvp).

    u C' = D_B C'' - X q(C_A, C_D) in the strip, 0 < x < l,      u C - D_B C' = u C_s at 0,      C' = 0 at l

The fluid upstream carries the flux u C_s unchanged and the fluid downstream keeps C(l), so it suffices to solve in the
strip. Upstream C = C_s - (C_s - C(0)) exp(u x / D), (26). :mod:`reference.monod` defines q_A and q_D. Units are
consistent, for instance um, h and mg/L.
"""
import numpy as np
from scipy.integrate import solve_bvp

from reference.monod import uptake


def solve(velocity, supply, diffusivity, in_strip, density, rates, length, tolerance=1e-8):
    """Return the function x (...,) -> (C_A, C_D) (2, ...). supply, diffusivity, in_strip: pairs, acceptor first;
    density: X; tolerance: relative residual of the collocation. Raises RuntimeError if scipy does not converge."""
    supply, in_strip = np.array(supply, float), np.array(in_strip, float)

    def derivative(_, y):
        sink = density * np.stack(uptake(y[0], y[1], rates))
        return np.vstack([y[2:], (velocity * y[2:] + sink) / in_strip[:, None]])

    def boundary_residual(a, b):
        return np.concatenate([(velocity * (a[:2] - supply) - in_strip * a[2:]) / velocity, b[2:]])

    grid = np.linspace(0.0, length, 401)
    start = np.vstack([np.outer(supply, np.ones_like(grid)), np.zeros((2, len(grid)))])
    collocation = solve_bvp(derivative, boundary_residual, grid, start, tol=tolerance, max_nodes=200_000)
    if not collocation.success:
        raise RuntimeError(f"solve_bvp: {collocation.message}")
    return lambda x: _extend(np.asarray(x, float), collocation.sol, velocity, supply, diffusivity, length)


def _extend(x, inside, velocity, supply, diffusivity, length):
    """Extend the strip's C by (26) upstream and by C(l) downstream."""
    strip = inside(np.clip(x, 0.0, length).ravel())[:2].reshape(2, *x.shape)
    behind = np.minimum(x, 0.0)
    upstream = [s - (s - first) * np.exp(velocity * behind / d)
                for s, first, d in zip(supply, inside(0.0)[:2], diffusivity)]
    return np.where(x < 0, np.stack(upstream), strip)
