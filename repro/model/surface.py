"""The elastic stretch along the aggregate's free surface.

It is the stretch of a material line along the surface, divided by J^(1/2). The stretch is relative
to the configuration from which strain counts. The division removes the growth, because growth alone
causes no stress. The limits of a smooth equilibrium belong to the energy
(:class:`repro.model.energies.Energy`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from repro.errors import GrowthError, failing_as
from repro.fem import elements
from repro.fem.brief import brief
from repro.fem.mesh import Mesh, Region
from repro.fem.outline import Outline
from repro.fem.walls import FREE
from repro.model.body import Body
from repro.model.pore import Pore

#: Stretches do not count if they are closer to a contact line than this fraction of the free
#: surface's length, because the stress at the line is singular.
BESIDE = 0.05
#: Definition of the stretch, for reports.
STRETCH = ("length along the surface over that in the configuration from which strain counts, over "
           "J^(1/2), in the middle of an edge")


@brief
@dataclass(frozen=True, eq=False)
class Surface:
    """The free edges of an aggregate's boundary.

    stretch: (e,) elastic stretch along each edge, at its middle; middles: (e, 2) um, of the edges;
    distance: (e,) along the surface from the nearer contact line to the middle, over the length
    from line to line; cells: (e,) indices of the triangles beside the edges among the aggregate's
    triangles.
    """

    stretch: np.ndarray
    middles: np.ndarray
    distance: np.ndarray
    cells: np.ndarray

    @cached_property
    def _least(self) -> int:
        return int(np.argmin(np.where(self.distance > BESIDE, self.stretch, np.inf)))

    @property
    def least(self) -> float:
        """The least stretch away from contact lines."""
        return float(self.stretch[self._least])

    @property
    def place(self) -> tuple[float, float]:
        """x, y (um) of the least stretch."""
        x, y = self.middles[self._least].tolist()
        return x, y


@lru_cache(maxsize=2)  # a row uses its own pore and the pore of the last step
@failing_as(GrowthError)
def surfaces(pore: Pore) -> tuple[Surface, ...]:
    """The free surfaces of a pore's aggregates. Raises GrowthError on a floating-point error."""
    return tuple(_surface(pore.mesh, *each)
                 for each in zip(pore.bodies, pore.mesh.regions, pore.outlines))


def surface(pore: Pore) -> Surface:
    """The free surface of the aggregate in focus, or of the only one."""
    return surfaces(pore)[pore.number]


def least_stretched(pore: Pore) -> Surface:
    """The free surface with the least stretch among all aggregates."""
    return min(surfaces(pore), key=lambda surface: surface.least)


def _surface(mesh: Mesh, body: Body, region: Region, outline: Outline) -> Surface:
    """The free surface of an aggregate."""
    cells, local = region.beside_loop
    nodes = region.own_cells[cells]
    present = mesh.points[region.nodes][nodes]
    before = body.unstrained[nodes]
    J = _expansion(present, local) / _expansion(before, local)
    lengths = _lengths(present, local)
    stretch = lengths / _lengths(before, local) / np.sqrt(J)
    free = outline.edge_wall == FREE
    arcs = outline.arcs(outline.points)
    return Surface(stretch[free], arcs[free, 1], _distances(lengths, free)[free], cells[free])


def _expansion(nodes: np.ndarray, local: np.ndarray) -> np.ndarray:
    """(edges,) um2, determinant of the map from the unit triangle, at the middle of an edge.

    nodes: (edges, 3 or 6, 2) um, of the triangle beside each edge; local: (edges,) number of the
    edge in this triangle.
    """
    derivatives = elements.derivatives(elements.order_of(nodes), elements.nodes(2)[3:])
    return elements.determinant(np.einsum("eai,eak->eik", nodes, derivatives[local]))


def _lengths(nodes: np.ndarray, local: np.ndarray) -> np.ndarray:
    """(edges,) um, lengths of the edges' chords; arguments as in :func:`_expansion`.

    Their ratio is the stretch in the middle of an edge, because there the tangent of a parabola is
    parallel to its chord.
    """
    every = np.arange(len(nodes))
    chords = nodes[every, np.take(elements.NEXT, local)] - nodes[every, local]
    return np.linalg.norm(chords, axis=1)


def _distances(lengths: np.ndarray, free: np.ndarray) -> np.ndarray:
    """(edges,) distance along a free surface from the middle of an edge to the nearer end of the
    surface, over the length of the surface."""
    first = int(np.argmin(free))
    on = np.roll(free, -first)
    lengths = np.where(on, np.roll(lengths, -first), 0.0)
    part = np.cumsum(~on) - 1
    ends = np.cumsum(lengths)
    along = ends - 0.5 * lengths - ends[~on][part]
    total = np.bincount(part, lengths)[part]
    nearer = np.minimum(along, total - along) / np.where(on, total, 1.0)
    return np.roll(nearer, first)
