"""The traction that keeps a contact surface in place on a wall along which it slides (2.3.3).

The middle point of each contact surface keeps its x. In plane strain a force at that point would
indent the aggregate without limit as the mesh is refined. The wall therefore bears the force as a
uniform traction along the present contact surface. The traction's resultant m is the multiplier of
the condition on x:

    R + sum_k m_k L_k = 0,    x_k = given

R are the nodal forces without the walls. L_k are those of a uniform traction with the resultant 1
on the surface k: its shape functions, integrated over its present length and divided by this
length. Row k gives m_k = -R_k / L_kk.

Newton's method ignores the derivative of L_k by the shape.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

#: (k, k) integrals of N_a dN_b / ds along an edge with k nodes.
ALONG = {2: np.array([[-3.0, 3.0], [-3.0, 3.0]]) / 6,
         3: np.array([[-3.0, 4.0, -1.0], [-4.0, 0.0, 4.0], [1.0, -4.0, 3.0]]) / 6}


@dataclass(frozen=True, eq=False)
class Support:
    """The support of one contact surface.

    point: its fixed node; edges: (e, 2 or 3) nodes of its edges, in one direction. Nodes are
    numbered as the aggregate's.
    """

    point: int
    edges: np.ndarray

    def load(self, position: np.ndarray, count: int) -> np.ndarray:
        """(count,) forces of a uniform traction along x with the resultant 1, for nodes at
        ``position`` (n, 2) um; zero beyond x of the nodes."""
        forces = position[self.edges, 0] @ ALONG[self.edges.shape[1]].T
        load = np.bincount(self.edges.ravel(), forces.ravel(), count)
        return load / load.sum()


def balanced(supports: Sequence[Support], position: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """A residual (2n + corners,) with the tractions that balance the rows of the fixed points."""
    for support in supports:
        load = support.load(position, len(residual))
        residual = residual - load * (residual[support.point] / load[support.point])
    return residual
