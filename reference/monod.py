"""Dual Monod uptake of both substrates, (7)-(8), for the references that solve for C_A and C_D.

    q_A = m_A (k F m_D + d_c f_d b),      q_D = k m_A m_D,      m = C / (C + K_s)

Iterates can be negative. There C / K_s replaces C / (C + K_s), and the factor of the other substrate counts as zero.
"""
import numpy as np
import scipy.sparse as sp

#: Step of the central differences of the uptake, mg/L.
DIFFERENCE_STEP = 1e-6
#: Newton's method stops with an error after this number of steps.
MAX_ITERATIONS = 100


def uptake(acceptor, donor, rates):
    """(q_A, q_D) in the shape of the concentrations; rates: dict of k, F, decay = d_c f_d b, K_A, K_D."""
    m_a, m_d = (c / (np.maximum(c, 0.0) + rates[key]) for c, key in ((acceptor, "K_A"), (donor, "K_D")))
    by_acceptor, by_donor = rates["k"] * np.maximum(m_a, 0.0), rates["k"] * rates["F"] * np.maximum(m_d, 0.0)
    return m_a * (by_donor + rates["decay"]), by_acceptor * m_d


def sink(fields, load, rates):
    """Uptake (2n,): load times q_A, then load times q_D. fields (2n,): all C_A, then all C_D; load: (n,)."""
    return (load * np.stack(uptake(*fields.reshape(2, -1), rates))).ravel()


def derivatives(fields, rates):
    """Derivatives of (q_A, q_D), the rows, by (C_A, C_D), (2, 2, ...), from central differences; fields (2, ...)."""
    shifts = DIFFERENCE_STEP * np.eye(2).reshape(2, 2, *[1] * (fields.ndim - 1))
    columns = [np.stack(uptake(*(fields + d), rates)) - np.stack(uptake(*(fields - d), rates)) for d in shifts]
    return np.stack(columns, axis=1) / (2 * DIFFERENCE_STEP)


def sink_derivative(fields, load, rates):
    """Derivative of :func:`sink`, (2n, 2n), point by point."""
    rows = load * derivatives(fields.reshape(2, -1), rates)
    return sp.block_array([[*map(sp.diags_array, row)] for row in rows], format="csc")


def solve_steady(balance, derivative, fields, tolerance, solve_linear):
    """Find the zero (n,) of ``balance`` by Newton's method with halved steps from ``fields`` (n,).

    solve_linear(matrix, right) solves the linear systems. Raises RuntimeError if Newton's method does not converge."""
    for _ in range(MAX_ITERATIONS):
        defect = balance(fields)
        if np.abs(defect).max() < tolerance:
            return fields
        step = solve_linear(derivative(fields), -defect)
        length = 1.0
        while np.linalg.norm(balance(fields + length * step)) > np.linalg.norm(defect) and length > 1e-3:
            length /= 2
        fields = fields + length * step
    raise RuntimeError(f"the steady concentrations did not converge: residual {np.abs(defect).max():.2g}")
