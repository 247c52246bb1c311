"""The functions of a mesh: nodes, and bases for the forms of :mod:`repro.fem.forms`.

Every integral of a weak form is a sum over quadrature points. Element matrices equal those of
scikit-fem's assembly with the same quadrature. The reaction of the substrates is integrated by one
of two rules: :class:`Lumped` for linear functions, as in the paper, or :class:`Quadrature`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from repro.fem import elements
from repro.fem.brief import brief
from repro.fem.elements import Table
from repro.fem.forms import Basis, basis, each
from repro.fem.mesh import Dofs, Mesh, Region


@brief
@dataclass(frozen=True, eq=False)
class Space:
    """Continuous functions on a mesh, by their values at its nodes.

    They are linear on straight triangles and quadratic on curved ones.

    Parameters
    ----------
    mesh : Mesh
        Triangles with straight or curved sides; coordinates in um.

    Examples
    --------
    >>> import repro
    >>> scene = repro.load_scene("base", ['growth.end="0 h"', 'numerics.preset="fast"'])
    >>> space = next(repro.simulate(scene)).pore.space
    >>> space.points.shape == (space.count, 2)
    True
    """

    mesh: Mesh

    @property
    def order(self) -> int:
        """Degree of the functions: 1 or 2."""
        return self.mesh.geometry

    @property
    def dofs(self) -> Dofs:
        """Nodes of the ends and of the walls."""
        return self.mesh.topology.dofs

    @property
    def cells(self) -> np.ndarray:
        """(T, k) nodes of each triangle."""
        return self.mesh.cells

    @property
    def points(self) -> np.ndarray:
        """(count, 2) um, coordinates of the nodes."""
        return self.mesh.points

    @property
    def count(self) -> int:
        """Number of nodes."""
        return len(self.mesh.points)

    @cached_property
    def table(self) -> Table:
        """The functions at the quadrature points for products."""
        return elements.table(self.order, self.mesh.element.degree)

    @cached_property
    def at(self) -> Basis:
        """The functions at the quadrature points for products."""
        return self._mapped(self.table)

    @property
    def gradient_degree(self) -> int:
        """Degree of the quadrature for gradients; straight triangles need one point."""
        return self.mesh.element.gradient_degree

    @cached_property
    def gradient_table(self) -> Table:
        """The functions at the quadrature points for gradients."""
        return elements.table(self.order, self.gradient_degree)

    @cached_property
    def gradients_at(self) -> Basis:
        """The functions at the quadrature points for gradients."""
        if self.gradient_table is self.table:
            return self.at
        return self._mapped(self.gradient_table)

    def _mapped(self, of: Table) -> Basis:
        return basis(self.cells, self.count, self.points[self.cells], of)

    @cached_property
    def stiffness(self) -> np.ndarray:
        """(T, k, k) of (grad u, grad v), without unit."""
        return self.gradients_at.stiffness(self.gradients_at.dx)

    @property
    def integration(self) -> Lumped | Quadrature:
        """The rule that integrates the reaction."""
        return self.mesh.element.integration(self)

    @property
    def at_nodes(self) -> Lumped:
        """Integration at the nodes of linear functions."""
        return Lumped(self)

    @property
    def at_points(self) -> Quadrature:
        """Integration at the quadrature points."""
        return Quadrature(self)

    @cached_property
    def reaction(self) -> Basis:
        """The functions at the points in the biomass where uptake and growth are integrated."""
        return self.integration.reaction()

    def lumped(self, where: np.ndarray | slice = slice(None)) -> np.ndarray:
        """(corners,) um2: each corner has a third of the area of its triangles in ``where``."""
        of = elements.vertex_table(self.order)
        dx = elements.weights(self.mesh.points[self.mesh.cells[where]], of)
        return np.bincount(self.mesh.triangles[where].ravel(), dx.ravel(), self.mesh.corners)

    @cached_property
    def inlet(self) -> End:
        """The functions along the inlet."""
        return self._end(self.dofs.inlet)

    @cached_property
    def outlet(self) -> End:
        """The functions along the outlet."""
        return self._end(self.dofs.outlet)

    def _end(self, edges: np.ndarray) -> End:
        y = self.mesh.points[:, 1]
        lengths = y[edges[:, -1]] - y[edges[:, 0]]
        return End(edges, self.count, lengths, *elements.edge_table(self.order))


@dataclass(frozen=True, eq=False)
class End:
    """Functions along an end of the mesh, and its forms <., v>.

    edges: (E, e) nodes of each edge, from the lower wall up; count: number of nodes of the mesh;
    lengths: (E,) um; values: (p, e) of an edge's functions at its quadrature points; weights: (p,)
    of these points.
    """

    edges: np.ndarray
    count: int
    lengths: np.ndarray
    values: np.ndarray
    weights: np.ndarray

    @property
    def nodes(self) -> np.ndarray:
        """Nodes of the edges, each once."""
        return np.append(self.edges[:, :-1].ravel(), self.edges[-1, -1])

    def load(self, u: np.ndarray) -> np.ndarray:
        """(E, e) of <u, v> for a speed u (count,) um/h: um2/h."""
        return self.lengths[:, None] * ((self._speed(u) * self.weights) @ self.values)

    def mass(self, u: np.ndarray) -> np.ndarray:
        """(E, e, e) of <u C, v> for a speed u (count,) um/h: um2/h."""
        c = self._speed(u) * self.weights * self.lengths[:, None]
        return (self.values.T * c[:, None]) @ self.values

    def _speed(self, u: np.ndarray) -> np.ndarray:
        return u[self.edges] @ self.values.T

    def assembled(self, u: np.ndarray) -> np.ndarray:
        """(count,) sum of the loads of a speed u (count,)."""
        return np.bincount(self.edges.ravel(), self.load(u).ravel(), self.count)

    def mean(self, field: np.ndarray) -> float:
        """Mean of a field (count,)."""
        loads = self.load(np.ones(self.count))
        return float(np.sum(loads * field[self.edges]) / loads.sum())


@dataclass(frozen=True, eq=False)
class Lumped:
    """Integration at the nodes, as in the paper. A node has a third of its triangles' area."""

    space: Space

    def reaction(self) -> Basis:
        """Return the nodes of the biomass, each with its nodal function."""
        mesh = self.space.mesh
        lumped = self.space.lumped(mesh.biomass)
        nodes = mesh.topology.body_corners
        return Basis(nodes[:, None], self.space.count, np.ones((1, 1)), lumped[nodes, None])

    def mass(self) -> np.ndarray:
        """(T, 3, 3) um2 of (u, v)."""
        return each(self.space.mesh.areas / 3, np.eye(3)[None])

    def to_nodes(self, field: np.ndarray) -> np.ndarray:
        """(N,) values at the mesh's nodes, from values (r, 1) at the points; zero in the fluid."""
        mesh = self.space.mesh
        nodal = np.zeros(mesh.corners)
        nodal[mesh.topology.body_corners] = field[:, 0]
        return mesh.with_middles(nodal)

    def to_points(self, nodal: np.ndarray) -> np.ndarray:
        """(r, 1) values at the points, from a field (N,) at the mesh's nodes."""
        return nodal[self.space.reaction.cells]

    def rows(self, region: Region) -> np.ndarray:
        """Return the indices (r,) of one aggregate's points among the points of all aggregates."""
        return np.searchsorted(self.space.mesh.topology.body_corners, region.corner_nodes)

    def to_growth_points(self, region: Region, field: np.ndarray) -> np.ndarray:
        """Return (t, 1) means of a field (r, 1) over the nodes of an aggregate's triangles (29)."""
        return field[region.own_cells, 0].mean(axis=1, keepdims=True)

    def gain(self, region: Region, before: np.ndarray, after: np.ndarray,
             maximum_density: float) -> np.ndarray:
        """Return the factor (t, 1) by which an aggregate with masses (r, 1) expands in a step.

        New mass takes the area that it needs at the maximum density (X_m, mg/L).
        """
        dx = self.space.reaction.dx[self.rows(region)]
        more = (after - before) / dx / maximum_density
        return 1 + self.to_growth_points(region, more)

    def finer(self, degrees: int) -> tuple[Basis, np.ndarray]:
        """Return the same points for every degree, and the identity (1, 1) for densities."""
        return self.space.reaction, np.ones((1, 1))


@dataclass(frozen=True, eq=False)
class Quadrature:
    """Integration at the quadrature points for products."""

    space: Space

    def reaction(self) -> Basis:
        """Return the quadrature points of the biomass."""
        at = self.space.at
        biomass = self.space.mesh.biomass
        return Basis(at.cells[biomass], at.count, at.values, at.dx[biomass])

    def mass(self) -> np.ndarray:
        """(T, k, k) um2 of (u, v)."""
        return self.space.at.mass(self.space.at.dx)

    def to_nodes(self, field: np.ndarray) -> np.ndarray:
        """(N,) values at the mesh's nodes, from values (r, q) at the points; zero in the fluid.

        A linear function is fitted to the points of each triangle. A node gets the mean over its
        triangles.
        """
        mesh = self.space.mesh
        nodal = np.zeros(len(mesh.points))
        corners = elements.values(1, elements.nodes(mesh.geometry))
        fitted = field @ (corners @ elements.linear_fit(self.space.table)).T
        cells = mesh.cells[mesh.biomass]
        count = np.bincount(cells.ravel(), minlength=len(nodal))
        summed = np.bincount(cells.ravel(), fitted.ravel(), len(nodal))
        return np.divide(summed, count, out=nodal, where=count > 0)

    def to_points(self, nodal: np.ndarray) -> np.ndarray:
        """(r, q) values at the points, from a field (N,) at the mesh's nodes."""
        mesh = self.space.mesh
        return nodal[mesh.cells[mesh.biomass]] @ self.space.table.values.T

    def rows(self, region: Region) -> np.ndarray:
        """Return the indices (r,) of one aggregate's triangles among those of all aggregates."""
        return np.searchsorted(np.flatnonzero(self.space.mesh.biomass), region.triangles)

    def to_growth_points(self, region: Region, field: np.ndarray) -> np.ndarray:
        """Return an aggregate's field (r, q) itself: growth is integrated at the same points."""
        return field

    def gain(self, region: Region, before: np.ndarray, after: np.ndarray,
             maximum_density: float) -> np.ndarray:
        """Return the factor (t, q) by which an aggregate with masses (r, q) expands in a step.

        Each point expands as its mass grows.
        """
        return after / before

    def finer(self, degrees: int) -> tuple[Basis, np.ndarray]:
        """Return the functions in the biomass at the p points of a more exact quadrature.

        Its degree is larger by ``degrees``. Also returns a matrix (q, p): it maps a density at the
        present points to a linear fit in each triangle, at the new points.
        """
        space = self.space
        mesh = space.mesh
        biomass = mesh.biomass
        of = elements.table(space.order, mesh.element.degree + degrees)
        dx = elements.weights(mesh.points[mesh.cells[biomass]], of)
        fit = elements.linear_fit(space.table).T @ of.linear.T
        return Basis(space.cells[biomass], space.count, of.values, dx), fit
