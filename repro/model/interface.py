"""The form of the viscous term. It determines what is continuous at the interface [E2].

``numerics.interface`` selects it by :func:`interface_of`. Both classes have

    a                   element matrices (T, 2k, 2k) of a(u, v), x before y in rows and columns; or
                        (T, k, k) for each component if they are not coupled. viscosity: (T,) nu_r
    rate                (..., 2, 2) viscous stress over nu, from grad u
    straight_outlet     is u_y = 0 at the outlet [E10]?
    bends               does the flow bend the aggregate about its contact lines? They then count as
                        tips of the outline.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, TypeAlias

import numpy as np

from repro.fem.forms import each, product
from repro.fem.space import Space


@dataclass(frozen=True)
class Laplacian:
    """(nu grad u, grad v): nu du/dn - phi n is continuous."""

    straight_outlet: ClassVar[bool] = False
    bends: ClassVar[bool] = False

    def a(self, velocity: Space, viscosity: np.ndarray) -> np.ndarray:
        """The same matrices (T, k, k) for both components."""
        return each(viscosity, velocity.stiffness)

    def rate(self, grad: np.ndarray) -> np.ndarray:
        """The gradient."""
        return grad


@dataclass(frozen=True)
class Traction:
    """(nu (grad u + grad u^T), grad v): the traction is continuous."""

    straight_outlet: ClassVar[bool] = True
    bends: ClassVar[bool] = True

    def a(self, velocity: Space, viscosity: np.ndarray) -> np.ndarray:
        """Matrices (T, 2k, 2k): the components are coupled."""
        laplace = each(viscosity, velocity.stiffness)
        at = velocity.gradients_at
        k = velocity.cells.shape[1]
        matrices = product(at.div, viscosity[:, None] * at.dx, at.div).reshape(-1, 2, k, 2, k)
        # nu u_j,i v_i,j is nu u_i,i v_j,j with its functions exchanged: (T, i, a, j, b).
        matrices = np.swapaxes(matrices, 2, 4).copy()
        for i in (0, 1):
            matrices[:, i, :, i] += laplace
        return matrices.reshape(-1, 2 * k, 2 * k)

    def rate(self, grad: np.ndarray) -> np.ndarray:
        """The gradient and its transpose."""
        return grad + np.swapaxes(grad, -1, -2)


Interface: TypeAlias = Laplacian | Traction
LAPLACIAN = Laplacian()
TRACTION = Traction()


def interface_of(word: str) -> Interface:
    """The form of a value of ``numerics.interface``."""
    forms: dict[str, Interface] = {"laplacian": LAPLACIAN, "traction": TRACTION}
    return forms[word]
