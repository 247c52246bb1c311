"""Weak forms as sums over tabulated points.

A :class:`Basis` has the functions of a space at the quadrature points. A stage computes the
coefficient, flux or stress of a term at these points, times dx. A form multiplies this value by the
test functions v and the trial functions u, and sums over the points of each triangle:

    (f, v)              load(f dx)              (q, grad v)     flux(q dx)
    (c u, v)            mass(c dx)              (S, grad v)     flux(S dx)
    (c grad u, grad v)  stiffness(c dx)         (u w, grad v)   advection(w dx)
    (c div u, div v)    product(div, c dx, div)
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from repro.fem import elements
from repro.fem.elements import Table


@dataclass(frozen=True, eq=False)
class Basis:
    """Functions on triangles, at the points where forms are integrated.

    cells: (T, k) nodes of each triangle; count: number of nodes of the mesh; values: (q, k) of the
    functions; dx: (T, q) um2, weights of the points; gradients: (T, q, 2, k) 1/um, empty if no form
    needs them.
    """

    cells: np.ndarray
    count: int
    values: np.ndarray
    dx: np.ndarray
    gradients: np.ndarray = field(default_factory=lambda: np.empty((0, 0, 2, 0)))

    @cached_property
    def weighted(self) -> Basis:
        """The same functions with gradients times dx, so that :meth:`flux` takes fluxes without dx.
        """
        rows = _scaled(self.dx, self.rows)
        return replace(self, gradients=rows.reshape(self.gradients.shape))

    @property
    def rows(self) -> np.ndarray:
        """(T, 2 q, k) gradients, one row for each point and direction."""
        return self.gradients.reshape(len(self.dx), -1, self.gradients.shape[3])

    @property
    def div(self) -> np.ndarray:
        """(T, q, 2k) divergence of vector functions: u_x of all nodes, then u_y."""
        return self.gradients.reshape(*self.dx.shape, -1)

    def evaluate(self, u: np.ndarray) -> np.ndarray:
        """(..., T, q) values of fields u (..., count)."""
        return u[..., self.cells] @ self.values.T

    def gradient(self, u: np.ndarray) -> np.ndarray:
        """(T, m, q, 2) gradient of each component of a field u (count, m)."""
        nodal = np.swapaxes(u[self.cells], 1, 2)
        return (nodal @ np.swapaxes(self.rows, 1, 2)).reshape(*nodal.shape[:2], -1, 2)

    def load(self, f: np.ndarray) -> np.ndarray:
        """(T, ..., k) of (f, v), from f dx (T, ..., q), in one matrix product."""
        flat = f.reshape(-1, f.shape[-1])
        return (flat @ self.values).reshape(*f.shape[:-1], self.values.shape[1])

    def flux(self, flux: np.ndarray) -> np.ndarray:
        """(T, m, k) of (q, grad v) for each of m fluxes, from q dx (T, m, q, 2)."""
        return flux.reshape(*flux.shape[:2], -1) @ self.rows

    def mass(self, c: np.ndarray) -> np.ndarray:
        """(..., T, k, k) of (c u, v), from c dx (..., T, q)."""
        points, k = self.values.shape
        products = self.values[:, :, None] * self.values[:, None, :]
        return (c @ products.reshape(points, k * k)).reshape(*c.shape[:-1], k, k)

    def stiffness(self, c: np.ndarray, u: Basis | None = None) -> np.ndarray:
        """(T, k, k) of (c grad u, grad v), from c dx (T, q); u: this basis by default."""
        return np.swapaxes(self.rows, 1, 2) @ _scaled(c, (u or self).rows)

    def advection(self, w: np.ndarray) -> np.ndarray:
        """(T, k, k) of (u w, grad v), from w dx (2, T, q)."""
        along = w[0][..., None] * self.gradients[:, :, 0]
        along += w[1][..., None] * self.gradients[:, :, 1]
        return self.load(np.swapaxes(along, 1, 2))

    def assembled(self, f: np.ndarray) -> np.ndarray:
        """(m count,) of (f, v) summed over the triangles, from f dx (T, q) or (T, m, q)."""
        return self.assemble(self.load(f))

    def assemble(self, loads: np.ndarray) -> np.ndarray:
        """(m count,) sums at the nodes of loads (T, m, k), component after component, or of (T, k).
        """
        parts = loads[:, None] if loads.ndim == 2 else loads
        first = self.count * np.arange(parts.shape[1])
        nodes = self.cells[:, None] + first[:, None]
        return np.bincount(nodes.ravel(), parts.ravel(), self.count * len(first))


def basis(cells: np.ndarray, count: int, corners: np.ndarray, of: Table) -> Basis:
    """Map the functions of a table to triangles. No triangle may be turned over.

    cells, count: as in :class:`Basis`; corners: (T, g, 2) um, nodes of the triangles' maps.
    """
    return Basis(cells, count, of.values, *elements.mapped(corners, of))


def product(v: np.ndarray, c: np.ndarray, u: np.ndarray) -> np.ndarray:
    """(T, a, b) of (c u, v), from c dx (T, q), functions v (T, q, a) or (q, a), and u (T, q, b)."""
    return np.swapaxes(v, -1, -2) @ each(c, u)


def each(coefficient: np.ndarray, matrices: np.ndarray) -> np.ndarray:
    """Multiply element matrices (T, a, b) by a coefficient per triangle (T,) or per row (T, a)."""
    return coefficient.reshape(len(coefficient), -1, 1) * matrices


def mass(areas: np.ndarray) -> np.ndarray:
    """(T, 3, 3) mass matrices of the linear nodal functions on triangles of areas (T,)."""
    return each(areas, (np.ones((1, 3, 3)) + np.eye(3)) / 12)


def _scaled(c: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Gradients in rows (T, 2 q, k) times a coefficient (T, q)."""
    return each(np.repeat(c, 2, axis=1), rows)
