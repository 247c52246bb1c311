"""Dual Monod uptake of both substrates, (7)-(8), for the references that solve for C_A and C_D.

    q_A = m_A (k F m_D + d_c f_d b),      q_D = k m_A m_D,      m = C / (C + K_s)

Below zero, where only an iterate can be, C / (C + K_s) goes on as C / K_s, and the other substrate counts as zero.
"""
import numpy as np
import scipy.sparse as sp

#: mg/L, of the differences.
NUDGE = 1e-6
#: Newton's method is given up after so many steps.
MOST = 100


def uptake(acceptor, donor, rates):
    """(q_A, q_D) in the shape of the concentrations; rates: dict of k, F, decay = d_c f_d b, K_A, K_D."""
    m_a, m_d = (c / (np.maximum(c, 0.0) + rates[key]) for c, key in ((acceptor, "K_A"), (donor, "K_D")))
    by_acceptor, by_donor = rates["k"] * np.maximum(m_a, 0.0), rates["k"] * rates["F"] * np.maximum(m_d, 0.0)
    return m_a * (by_donor + rates["decay"]), by_acceptor * m_d


def sink(fields, load, rates):
    """(2n,) load q of all C_A and then all C_D in ``fields`` (2n,), ``load`` (n,)."""
    return (load * np.stack(uptake(*fields.reshape(2, -1), rates))).ravel()


def derivatives(fields, rates):
    """(2, 2, ...) derivatives of (q_A, q_D), the rows, by (C_A, C_D), fields (2, ...), by central differences."""
    shifts = NUDGE * np.eye(2).reshape(2, 2, *[1] * (fields.ndim - 1))
    columns = [np.stack(uptake(*(fields + d), rates)) - np.stack(uptake(*(fields - d), rates)) for d in shifts]
    return np.stack(columns, axis=1) / (2 * NUDGE)


def slopes(fields, load, rates):
    """(2n, 2n) derivative of :func:`sink`, place by place."""
    rows = load * derivatives(fields.reshape(2, -1), rates)
    return sp.block_array([[*map(sp.diags_array, row)] for row in rows], format="csc")


def at_rest(rise, derivative, fields, small, solved):
    """The zero (n,) of ``rise``, smaller than ``small``, by Newton's method with halved steps from ``fields`` (n,);
    solved(matrix, right): its linear solver. Raises RuntimeError where it does not converge."""
    for _ in range(MOST):
        now = rise(fields)
        if np.abs(now).max() < small:
            return fields
        step, length = solved(derivative(fields), -now), 1.0
        while np.linalg.norm(rise(fields + length * step)) > np.linalg.norm(now) and length > 1e-3:
            length /= 2
        fields = fields + length * step
    raise RuntimeError(f"the concentrations do not come to rest: {np.abs(now).max():.2g}")
