"""Dual Monod uptake of both substrates, (7)-(8), for the references that solve for C_A and C_D.

    q_A = m_A (k F m_D + d_c f_d b),      q_D = k m_A m_D,      m = C / (C + K_s)

Below zero, where only an iterate can be, C / (C + K_s) goes on as C / K_s, and the other substrate counts as zero.
"""
import numpy as np
import scipy.sparse as sp

NUDGE = 1e-6


def uptake(acceptor, donor, rates):
    """(q_A, q_D) in the shape of the concentrations; rates: dict of k, F, decay = d_c f_d b, K_A, K_D."""
    m_a, m_d = (c / (np.maximum(c, 0.0) + rates[key]) for c, key in ((acceptor, "K_A"), (donor, "K_D")))
    by_acceptor, by_donor = rates["k"] * np.maximum(m_a, 0.0), rates["k"] * rates["F"] * np.maximum(m_d, 0.0)
    return m_a * (by_donor + rates["decay"]), by_acceptor * m_d


def sink(fields, load, rates):
    """(2n,) load q of all C_A and then all C_D in ``fields`` (2n,), ``load`` (n,)."""
    return (load * np.stack(uptake(*fields.reshape(2, -1), rates))).ravel()


def slopes(fields, load, rates):
    """(2n, 2n) derivative of :func:`sink`, place by place, by central differences of NUDGE mg/L."""
    both = fields.reshape(2, -1)
    columns = [load * (np.stack(uptake(*(both + d), rates)) - np.stack(uptake(*(both - d), rates))) / (2 * NUDGE)
               for d in NUDGE * np.eye(2)[:, :, None]]
    return sp.block_array([[sp.diags_array(columns[s][k]) for s in (0, 1)] for k in (0, 1)], format="csc")
