"""The traction that keeps a sliding contact surface in place (2.3.3).

The middle point of each contact surface keeps its x. In plane strain a force at this point would
indent the aggregate without limit as the mesh is refined. The wall therefore exerts the force as a
traction along the contact surface. The traction is uniform per length in the configuration from
which strain counts. If growth has doubled a length, the traction there is half as large; the
modulus of this tissue has also decreased. (A traction uniform along the present surface would shear
the youngest and softest tissue most.) The resultant m of the traction is the multiplier of the
condition on x:

    R + sum_k m_k L_k = 0,    x_k = given

R are the nodal forces without the walls. L_k are the loads of a traction with the resultant 1 on
the surface k: the integrals of its shape functions, divided by its length. They do not depend on
the present shape. Row k gives m_k = -R_k / L_kk.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from repro.fem.elements import ELEMENTS


@dataclass(frozen=True, eq=False)
class Support:
    """The support of one contact surface.

    point: its fixed node; load: (n,) nodal forces along x of a traction with the resultant 1.
    """

    point: int
    load: np.ndarray

    @staticmethod
    def on(point: int, edges: np.ndarray, reference: np.ndarray) -> Support:
        """The support of a surface.

        point: its fixed node; edges: (e, 2 or 3) nodes of its edges; reference: (n, 2) um,
        positions in the configuration from which strain counts.
        """
        lengths = lengths_along(edges, reference)
        return Support(point, lengths / lengths.sum())


def lengths_along(edges: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """(n,) um, the integrals of the shape functions along edges; arguments of :meth:`Support.on`.
    """
    element = ELEMENTS[edges.shape[1] - 1]
    _, slopes = element.on_edge(np.arange(edges.shape[1]) / element.parts)
    lengths = np.linalg.norm(slopes @ reference[edges], axis=2) * element.edge_weights
    return np.bincount(edges.ravel(), lengths.ravel(), len(reference))


def balanced(supports: Sequence[Support], residual: np.ndarray) -> np.ndarray:
    """A residual (2n + corners,), x of all nodes first, plus the tractions of the supports. They
    balance the rows of the fixed points."""
    residual = residual.copy()
    for support in supports:
        multiplier = residual[support.point] / support.load[support.point]
        residual[: len(support.load)] -= multiplier * support.load
    return residual
