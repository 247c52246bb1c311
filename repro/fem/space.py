"""Functions of order 1, 2 or 3 on a mesh: nodes, quadrature points, element matrices.

Every integral of a weak form is a sum over quadrature points. Element matrices equal those of
scikit-fem's assembly with the same quadrature. The reaction of the substrates is evaluated at the
points of a :class:`Reaction`: all quadrature points of the biomass, or the nodes for linear
functions (lumped, as in the paper).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from repro.fem import elements
from repro.fem.brief import brief
from repro.fem.elements import Points, Table
from repro.fem.mesh import Dofs, Mesh


@dataclass(frozen=True, eq=False)
class Reaction:
    """Points at which the reaction is integrated.

    cells: (r, k) nodes of each piece of biomass; values: (q, k) the functions at its points; dx:
    (r, q) um2, the weights of the points.
    """

    cells: np.ndarray
    values: np.ndarray
    dx: np.ndarray


@brief
@dataclass(frozen=True, eq=False)
class Space:
    """Continuous functions of an order on a mesh, by their values at the nodes of ``dofs``.

    Parameters
    ----------
    mesh : Mesh
        Triangles with straight or curved sides; coordinates in um.
    order : int
        Degree of the functions: 1, 2 or 3.

    Examples
    --------
    >>> import repro
    >>> scene = repro.load_scene("base", ['growth.end="0 h"', 'numerics.preset="fast"'])
    >>> space = next(repro.simulate(scene)).pore.space
    >>> space.points.shape == (space.count, 2)
    True
    """

    mesh: Mesh
    order: int

    @property
    def dofs(self) -> Dofs:
        """Nodes."""
        return self.mesh.topology.dofs(self.order)

    @property
    def cells(self) -> np.ndarray:
        """(T, k) nodes of each triangle."""
        return self.dofs.cells

    @property
    def count(self) -> int:
        """Number of nodes."""
        return self.dofs.count

    @cached_property
    def table(self) -> Table:
        """The functions at the quadrature points for products."""
        degree = max(elements.DEGREES[self.order], self._curved_degree)
        return elements.table(self.order, self.mesh.geometry, degree)

    @property
    def _curved_degree(self) -> int:
        return elements.DEGREES[2] if self.mesh.geometry == 2 else 1

    @cached_property
    def at(self) -> Points:
        """Quadrature points for products of functions."""
        return elements.points(self.mesh.points[self.mesh.cells], self.table)

    @property
    def gradient_degree(self) -> int:
        """Degree of the quadrature of gradients; it has one point on straight linear triangles."""
        return max(elements.GRADIENT_DEGREES[self.order], self._curved_degree)

    @cached_property
    def gradient_table(self) -> Table:
        """The functions at the quadrature points for gradients."""
        return elements.table(self.order, self.mesh.geometry, self.gradient_degree)

    @cached_property
    def gradients_at(self) -> Points:
        """Quadrature points for gradients."""
        if self.gradient_table is self.table:
            return self.at
        return elements.points(self.mesh.points[self.mesh.cells], self.gradient_table)

    @cached_property
    def stiffness(self) -> np.ndarray:
        """(T, k, k) element matrices of (grad u, grad v), without unit."""
        return np.swapaxes(self.gradients_at.rows, 1, 2) @ self.gradients_at.weighted

    @cached_property
    def points(self) -> np.ndarray:
        """(count, 2) um, places of the nodes."""
        return self.of_mesh(self.mesh.points)

    @cached_property
    def reaction(self) -> Reaction:
        """The points of the biomass at which uptake and growth are integrated."""
        biomass = self.mesh.biomass
        if self.order > 1:
            return Reaction(self.cells[biomass], self.table.values, self.at.dx[biomass])
        lumped = self.lumped(biomass)
        nodes = self.mesh.topology.body_corners
        return Reaction(nodes[:, None], np.ones((1, 1)), lumped[nodes, None])

    def lumped(self, where: np.ndarray | slice = slice(None)) -> np.ndarray:
        """(corners,) um2, a third of the area of the triangles ``where`` around each corner."""
        of = elements.vertex_table(1, self.mesh.geometry)
        dx = elements.weights(self.mesh.points[self.mesh.cells[where]], of)
        return np.bincount(self.mesh.triangles[where].ravel(), dx.ravel(), self.mesh.corners)

    def values_at(self, of: Table) -> np.ndarray:
        """(q, k) these functions at the points of another table."""
        return elements.values_on(self.order, of)

    def of_mesh(self, field: np.ndarray) -> np.ndarray:
        """(count, ...) values at the space's nodes, from a field (N, ...) at the mesh's own."""
        if self.order == self.mesh.geometry:
            return field
        up = elements.values(self.mesh.geometry, elements.nodes(self.order))
        all_values = np.empty((self.count, *field.shape[1:]))
        all_values[self.cells] = np.einsum("ab,tb...->ta...", up, field[self.mesh.cells])
        return all_values

    def to_mesh(self, field: np.ndarray) -> np.ndarray:
        """(N, ...) values of a field (count, ...) at the mesh's own nodes."""
        if self.order == self.mesh.geometry:
            return field
        down = elements.values(self.order, elements.nodes(self.mesh.geometry))
        nodal = np.empty((len(self.mesh.points), *field.shape[1:]))
        nodal[self.mesh.cells] = np.einsum("ab,tb...->ta...", down, field[self.cells])
        return nodal

    def at_points(self, field: np.ndarray) -> np.ndarray:
        """(..., T, q) fields (..., count) at the quadrature points."""
        return field[..., self.cells] @ self.table.values.T

    def mass(self, coefficient: np.ndarray) -> np.ndarray:
        """(T, k, k) element matrices of (c u, v), from c dx (T, q)."""
        k = self.cells.shape[1]
        return (coefficient @ self.table.products).reshape(-1, k, k)

    def load(self, coefficient: np.ndarray) -> np.ndarray:
        """(T, ..., k) element loads (c, v), from c dx (T, ..., q), in one matrix product."""
        flat = coefficient.reshape(-1, coefficient.shape[-1])
        return (flat @ self.table.values).reshape(*coefficient.shape[:-1], -1)

    def end_nodes(self, edges: np.ndarray) -> np.ndarray:
        """Nodes of an end's edges (E, order + 1), each once."""
        return np.append(edges[:, :-1].ravel(), edges[-1, -1])

    def end_lengths(self, edges: np.ndarray) -> np.ndarray:
        """(E,) lengths of the edges of an end, um."""
        return self.mesh.points[edges[:, -1], 1] - self.mesh.points[edges[:, 0], 1]

    def end_loads(self, edges: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """(E, e) integrals of u N_i over each edge of an end, for a speed (count,) um/h: um2/h."""
        along, weights = elements.edge_table(self.order)
        u = speed[edges] @ along.T
        return self.end_lengths(edges)[:, None] * ((u * weights) @ along)

    def end_masses(self, edges: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """(E, e, e) integrals of u N_i N_j over each edge of an end: um2/h."""
        along, weights = elements.edge_table(self.order)
        weight = (speed[edges] @ along.T) * weights * self.end_lengths(edges)[:, None]
        return (along.T * weight[:, None]) @ along

    def summed(self, edges: np.ndarray, loads: np.ndarray) -> np.ndarray:
        """(count,) sum of loads (E, e) on the edges of an end."""
        return np.bincount(edges.ravel(), loads.ravel(), self.count)

    def mean_over(self, edges: np.ndarray, field: np.ndarray) -> float:
        """Mean of a field (count,) over an end."""
        loads = self.end_loads(edges, np.ones(self.count))
        return float(np.sum(loads * field[edges]) / loads.sum())

