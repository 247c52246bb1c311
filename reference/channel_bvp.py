"""Dual Monod uptake in a strip crossed by plug flow, (7)-(8) in one dimension, by scipy's collocation (solve_bvp).

    u C' = D_B C'' - X q(C_A, C_D) in the strip, 0 < x < l,      u C - D_B C' = u C_s at 0,      C' = 0 at l

The fluid upstream carries the flux u C_s unchanged and the fluid downstream keeps C(l), so the strip stands alone:
upstream C = C_s - (C_s - C(0)) exp(u x / D), (26). q_A = m_A (k F m_D + d_c f_d b), q_D = k m_A m_D.
"""
import numpy as np
from scipy.integrate import solve_bvp


def uptake(acceptor, donor, rates):
    """(q_A, q_D); rates: dict of k, F, decay = d_c f_d b, K_A, K_D. Below zero C / (C + K) goes on as C / K."""
    m_a, m_d = (c / (np.maximum(c, 0.0) + rates[key]) for c, key in ((acceptor, "K_A"), (donor, "K_D")))
    by_acceptor, by_donor = rates["k"] * np.maximum(m_a, 0.0), rates["k"] * rates["F"] * np.maximum(m_d, 0.0)
    return m_a * (by_donor + rates["decay"]), by_acceptor * m_d


def strip(x, velocity, supply, diffusivity, in_strip, density, rates, length, tolerance=1e-8):
    """(C_A, C_D) at x (n,); supply, diffusivity, in_strip: pairs, acceptor first; density: X."""
    supply, in_strip = np.array(supply, float), np.array(in_strip, float)

    def right(_, y):
        sink = density * np.stack(uptake(y[0], y[1], rates))
        return np.vstack([y[2:], (velocity * y[2:] + sink) / in_strip[:, None]])

    def ends(a, b):
        return np.concatenate([(velocity * (a[:2] - supply) - in_strip * a[2:]) / velocity, b[2:]])

    grid = np.linspace(0.0, length, 401)
    start = np.vstack([np.outer(supply, np.ones_like(grid)), np.zeros((2, len(grid)))])
    found = solve_bvp(right, ends, grid, start, tol=tolerance, max_nodes=200_000)
    if not found.success:
        raise RuntimeError(f"solve_bvp: {found.message}")
    inside = found.sol(np.clip(x, 0.0, length))[:2]
    first = found.sol(0.0)[:2]
    decay = np.exp(velocity * np.minimum(x, 0.0) / np.array(diffusivity, float)[:, None])
    return np.where(x < 0, supply[:, None] - (supply - first)[:, None] * decay, inside)
