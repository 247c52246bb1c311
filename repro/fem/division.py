"""Division of arcs of the aggregate's boundary at any point.

A contact line may lie within an arc. Then it divides the arc and the two triangles beside the arc.
Each triangle is cut along the straight line, on the unit triangle, from the contact line to the
opposite corner. Both pieces keep the map of the triangle, so a division changes no shape and no
field.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from repro.fem import elements
from repro.fem.elements import Table
from repro.fem.mesh import Mesh, Topology
from repro.fem.outline import parabola


@dataclass(frozen=True)
class DividedTriangle:
    """A triangle beside a divided arc.

    cell: number of the triangle; edge: number of its edge on the arc; arc: index of the arc in
    :attr:`Division.arcs`; forward: does the edge run in the direction of the loop?; t: where the
    edge is divided, from zero at its first corner to one.
    """

    cell: int
    edge: int
    arc: int
    forward: bool
    t: float

    @property
    def corners(self) -> np.ndarray:
        """(3, 2) start and end of the edge and the opposite corner, on the unit triangle."""
        return elements.nodes(1)[self.rotation]

    @property
    def rotation(self) -> np.ndarray:
        """(3,) corners of the triangle, the start of the edge first."""
        return (np.arange(3) + self.edge) % 3

    @property
    def place(self) -> np.ndarray:
        """(2,) point that divides the edge, on the unit triangle."""
        start, end, _ = self.corners
        return start + self.t * (end - start)

    @property
    def parts(self) -> tuple[np.ndarray, np.ndarray]:
        """(3, 2) corners of both parts on the unit triangle."""
        start, end, opposite = self.corners
        return np.array([start, self.place, opposite]), np.array([self.place, end, opposite])

    def divided_at(self, t: float) -> DividedTriangle:
        """The triangle with its arc divided at another t."""
        return replace(self, t=t if self.forward else 1 - t)

    def nodes(self, values: np.ndarray) -> np.ndarray:
        """(2, 6, ...) values at the nodes of both parts, from values (6, ...) at the nodes of the
        triangle."""
        corners = np.stack(self.parts)
        where = np.concatenate([corners, (corners + np.roll(corners, -1, axis=1)) / 2], axis=1)
        shapes = quadratic(where.reshape(-1, 2))
        return np.tensordot(shapes, values, 1).reshape(2, 6, *values.shape[1:])


@dataclass(frozen=True, eq=False)
class Division:
    """A mesh of curved triangles with some arcs of an aggregate's loop divided.

    Parameters
    ----------
    parent : Mesh
        The mesh before the division.
    arcs : (d,) int
        Numbers of the divided arcs, ascending; no two of them bound one triangle.
    t : (d,) float
        Where each arc is divided, in (0, 1) along the loop.
    number : int
        Index of the aggregate whose loop is divided.
    """

    parent: Mesh
    arcs: np.ndarray
    t: np.ndarray
    number: int = 0

    @property
    def loop(self) -> np.ndarray:
        """(M,) loop of the aggregate in the parent."""
        return self.parent.topology.loops[self.number]

    @property
    def divided_loop(self) -> np.ndarray:
        """(M + 2 d,) loop of the aggregate in the divided mesh."""
        return self.topology.loops[self.number]

    @property
    def region(self) -> np.ndarray:
        """(T,) True for the parent's triangles in the aggregate."""
        return self.parent.topology.region == self.number + 1

    @property
    def _middles(self) -> np.ndarray:
        """(d,) nodes of the parent in the middle of the divided arcs."""
        return self.loop[2 * self.arcs + 1]

    @cached_property
    def triangles(self) -> list[DividedTriangle]:
        """The divided triangles, arc by arc."""
        cells = self.parent.cells
        divided = []
        for arc, (middle, t) in enumerate(zip(self._middles, self.t)):
            start = self.loop[2 * self.arcs[arc]]
            for cell, edge in np.argwhere(cells[:, 3:] == middle):
                forward = bool(cells[cell, edge] == start)
                divided.append(DividedTriangle(cell, edge, arc, forward, t if forward else 1 - t))
        return divided

    @property
    def mesh(self) -> Mesh:
        """The divided mesh."""
        return replace(self.parent, points=self.nodal(self.parent.points), topology=self.topology)

    def at(self, t: np.ndarray) -> Division:
        """The same arcs divided at other ``t``, with the same connections."""
        moved = replace(self, t=t)
        moved.__dict__["topology"] = self.topology
        return moved

    @cached_property
    def topology(self) -> Topology:
        """Connections of the divided mesh.

        New corners follow the old corners. New middles follow the old middles: first the middles of
        the second halves of the arcs, then one inside each divided triangle. The first part of a
        divided triangle keeps its number. The second parts follow all other triangles.
        """
        topology = self.parent.topology
        count = len(self.arcs)
        corner = topology.corners + np.arange(count)
        half = len(self.parent.points) + count + np.arange(count)
        cells = self._renumbered(topology.cells)
        second_parts = []
        for number, triangle in enumerate(self.triangles):
            p, q, v = cells[triangle.cell, :3][triangle.rotation]
            pq, qv, vp = cells[triangle.cell, 3:][triangle.rotation]
            s = corner[triangle.arc]
            sv = half[-1] + 1 + number
            ps, sq = (pq, half[triangle.arc]) if triangle.forward else (half[triangle.arc], pq)
            cells[triangle.cell] = p, s, v, ps, sv, vp
            second_parts.append([s, q, v, sq, qv, sv])
        region = [topology.region[triangle.cell] for triangle in self.triangles]
        loops = [self._renumbered(loop) for loop in topology.loops]
        loops[self.number] = self.along_loop(loops[self.number], corner, half)
        return replace(topology, cells=np.vstack([cells, second_parts]),
                       corners=topology.corners + count,
                       region=np.concatenate([topology.region, region]), loops=tuple(loops))

    def _renumbered(self, nodes: np.ndarray) -> np.ndarray:
        """Numbers in the divided mesh of the parent's ``nodes``."""
        return np.where(nodes >= self.parent.corners, nodes + len(self.arcs), nodes)

    def along_loop(self, values: np.ndarray, corners: np.ndarray,
                   halves: np.ndarray) -> np.ndarray:
        """(M + 2 d,) values along the divided loop, from values (M,) at the loop's nodes, (d,) at
        the new corners and (d,) at the middles of the second halves."""
        added = np.column_stack([corners, halves]).ravel()
        return np.insert(values, np.repeat(2 * self.arcs + 2, 2), added)

    def nodal(self, values: np.ndarray) -> np.ndarray:
        """Values at all nodes, from values (N, ...) at the parent's nodes."""
        shape = (len(self.arcs), *values.shape[1:])
        places, first_halves, second_halves = (np.empty(shape) for _ in range(3))
        inside = []
        for triangle in self.triangles:
            start, end, opposite = triangle.corners
            s = triangle.place
            where = np.array([s, (start + s) / 2, (s + end) / 2, (s + opposite) / 2])
            nodes = values[self.parent.cells[triangle.cell]]
            at, near, far, inner = np.tensordot(quadratic(where), nodes, 1)
            places[triangle.arc] = at
            first_halves[triangle.arc] = near if triangle.forward else far
            second_halves[triangle.arc] = far if triangle.forward else near
            inside.append(inner)
        old_nodes = values.copy()
        old_nodes[self._middles] = first_halves
        corners = self.parent.corners
        return np.concatenate([old_nodes[:corners], places, old_nodes[corners:], second_halves,
                               inside])

    def at_corners(self, values: np.ndarray) -> np.ndarray:
        """(corners + d,) values at all corners, from a linear field (corners,) at the parent's
        corners."""
        loop = self.loop
        start = loop[2 * self.arcs]
        end = loop[(2 * self.arcs + 2) % len(loop)]
        return np.concatenate([values, (1 - self.t) * values[start] + self.t * values[end]])

    def restricted(self, values: np.ndarray) -> np.ndarray:
        """(N, ...) values at the parent's nodes, from values at all nodes of the divided mesh."""
        corners = self.parent.corners
        first_middle = corners + len(self.arcs)
        last_middle = first_middle + len(self.parent.points) - corners
        restricted = np.concatenate([values[:corners], values[first_middle:last_middle]])
        loop = self.divided_loop
        for number, (arc, t) in enumerate(zip(self.arcs, self.t)):
            nodes = loop[(2 * (arc + number) + np.arange(5)) % len(loop)]
            half, s = (nodes[:3], 0.5 / t) if t >= 0.5 else (nodes[2:], (0.5 - t) / (1 - t))
            restricted[self._middles[number]] = np.tensordot(parabola(np.array(s)), values[half], 1)
        return restricted

    def divided_loads(self, loads: np.ndarray) -> np.ndarray:
        """Nodal loads on the divided mesh, from loads (N, 2) on the parent's nodes.

        The load at the middle of a divided arc is taken as the load of a uniform traction.
        """
        corners = self.parent.corners
        loop = self.loop
        start = loop[2 * self.arcs]
        end = loop[(2 * self.arcs + 2) % len(loop)]
        middle = loads[self._middles]
        t = self.t[:, None]
        old_loads = loads.copy()
        np.add.at(old_loads, start, -(1 - t) * middle / 4)
        np.add.at(old_loads, end, -t * middle / 4)
        old_loads[self._middles] = t * middle
        inside = np.zeros((len(self.triangles), loads.shape[1]))
        half = (1 - t) * middle
        return np.concatenate([old_loads[:corners], middle / 4, old_loads[corners:], half, inside])

    def gathered_loads(self, loads: np.ndarray) -> np.ndarray:
        """(N, 2) nodal loads on the parent's nodes, from loads on all nodes of the divided mesh.

        Both sets of loads do the same work in every displacement of the parent.
        """
        corners = self.parent.corners
        first_middle = corners + len(self.arcs)
        last_middle = first_middle + len(self.parent.points) - corners
        gathered = np.concatenate([loads[:corners], loads[first_middle:last_middle]])
        gathered[self._middles] = 0.0
        loop = self.divided_loop
        ends = self.loop
        for number, (arc, t) in enumerate(zip(self.arcs, self.t)):
            nodes = loop[(2 * (arc + number) + np.arange(1, 4)) % len(loop)]
            weights = parabola(np.array([t / 2, t, (1 + t) / 2]))
            arc_nodes = ends[(2 * arc + np.arange(3)) % len(ends)]
            np.add.at(gathered, arc_nodes, weights.T @ loads[nodes])
        return gathered

    def halves(self, arc: int) -> tuple[np.ndarray, DividedTriangle]:
        """The aggregate's triangle beside the divided arc ``arc``, and the indices (2,) of both of
        its parts among the aggregate's triangles."""
        region = self.region
        inside = [triangle for triangle in self.triangles if region[triangle.cell]]
        number = next(k for k, triangle in enumerate(inside) if triangle.arc == arc)
        first = np.count_nonzero(region[: inside[number].cell])
        return np.array([first, np.count_nonzero(region) + number]), inside[number]

    def amounts(self, amounts: np.ndarray, table: Table) -> np.ndarray:
        """(r + d, q) amounts at the quadrature points of the divided aggregate.

        A linear function is fitted to the amounts per area of the unit triangle in a divided
        triangle, and is limited to their range. Both parts get its values, scaled so that the
        triangle's total stays the same.

        Parameters
        ----------
        amounts : (r, q) float
            At the quadrature points of the parent's aggregate.
        table : Table
            Functions at the quadrature points.
        """
        region = self.region
        rows = np.cumsum(region) - 1
        divided = amounts.copy()
        second_parts = []
        for triangle in self.triangles:
            if region[triangle.cell]:
                row = rows[triangle.cell]
                divided[row], second = split(amounts[row], triangle, table)
                second_parts.append(second)
        return np.vstack([divided, *second_parts])


def barycentric(where: np.ndarray) -> np.ndarray:
    """(q, 3) linear shape functions at points (q, 2) of the unit triangle."""
    return np.column_stack([1 - where[:, 0] - where[:, 1], where])


def quadratic(where: np.ndarray) -> np.ndarray:
    """(q, 6) quadratic shape functions at points (q, 2) of the unit triangle.

    :func:`elements.values` gives the same, but takes longer for a few points.
    """
    linear = barycentric(where)
    return np.hstack([linear * (2 * linear - 1), 4 * linear * linear[:, [1, 2, 0]]])


def split(amount: np.ndarray, triangle: DividedTriangle,
          table: Table) -> tuple[np.ndarray, np.ndarray]:
    """(q,) amounts in both parts of a triangle with amounts (q,)."""
    density = amount / table.weights
    at_corners = elements.linear_fit(table) @ density
    halves = []
    for corners, share in zip(triangle.parts, (triangle.t, 1 - triangle.t)):
        fitted = barycentric(table.linear @ corners) @ at_corners
        halves.append(share * table.weights * np.clip(fitted, density.min(), density.max()))
    total = halves[0].sum() + halves[1].sum()
    scale = amount.sum() / total if total > 0 else 1.0
    return scale * halves[0], scale * halves[1]
