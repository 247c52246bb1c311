"""The boundaries of the aggregates, from the fields of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from repro.fem.elements import ON_ARC, element_of
from repro.fem.outline import parabola, polygon_area

if TYPE_CHECKING:
    from shapely import Polygon

#: A node this close to its wall, over the width of the pore, is on it: round-off.
ON_WALL = 1e-9


@dataclass(frozen=True, eq=False)
class Outline:
    """The boundary of an aggregate off its wall; NumPy reads it as an (n, 2) array in um.

    Parameters
    ----------
    points : (n, 2) array
        um, from the upstream end on its wall to the downstream one; 16 straight lines are in place
        of a curved edge, and err by up to 1/256 of its sag. The wall closes it.
    time : float
        Time, h.

    Notes
    -----
    It has ``magnitude`` and ``units``, so that a scene takes it as ``aggregate.outline``.

    Examples
    --------
    >>> import numpy as np, repro
    >>> outline = repro.solve("base", {"growth.end": "0 h"}).outline(0)
    >>> np.asarray(outline).shape[1], round(outline.to_shapely().area, 1)
    (2, 39.3)
    """

    points: np.ndarray
    time: float
    units: ClassVar[str] = "um"

    @property
    def magnitude(self) -> np.ndarray:
        """(n, 2) um, the points."""
        return self.points

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.array(self.points, dtype=dtype)

    def __len__(self) -> int:
        return len(self.points)

    def to_shapely(self) -> Polygon:
        """Return the aggregate as a ``shapely.Polygon`` in um."""
        from shapely import Polygon

        return Polygon(self.points)


def curved(edges: np.ndarray) -> np.ndarray:
    """(e, n, 2) points along edges, from their ends (e, 2, 2), or ends and middles (e, 3, 2)."""
    if edges.shape[1] == 2:
        return edges
    t = np.linspace(0, 1, ON_ARC + 1)
    return np.einsum("ta,eai->eti", parabola(t), edges)


def boundary(cells: np.ndarray, inside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (e, 2 or 3) of the edges between triangles ``inside`` (T,) and no other of them, and
    (e,) whether a triangle outside shares each."""
    edges = cells[:, element_of(cells).sides]
    owned = np.repeat(inside, 3)
    edges = edges.reshape(-1, edges.shape[2])
    ends = np.sort(edges[:, [0, -1]], axis=1)
    _, edge = np.unique(ends, axis=0, return_inverse=True)
    edge = edge.ravel()
    single = np.bincount(edge[owned], minlength=edge.max() + 1) == 1
    chosen = owned & single[edge]
    return edges[chosen], np.bincount(edge)[edge[chosen]] == 2


def outline(fields: Mapping[str, np.ndarray], number: int, upper: bool, time: float) -> Outline:
    """Return the boundary of the aggregate with a number from 1, whose wall is the upper one or
    not. Raises KeyError if it is not in the pore."""
    inside = fields["region"].round() == number
    if not inside.any():
        raise KeyError(f"outline: there is no aggregate {number} at t = {time:g} h")
    points = fields["places_um"]
    loop = _largest_loop(points, boundary(fields["triangles"], inside)[0])
    bottom, top = points[:, 1].min(), points[:, 1].max()
    on = np.flatnonzero(abs(loop[:, 1] - (top if upper else bottom)) < ON_WALL * (top - bottom))
    upstream, downstream = (on[choose(loop[on, 0])] for choose in (np.argmin, np.argmax))
    start, end = (upstream, downstream) if upper else (downstream, upstream)
    line = np.roll(loop, -start, axis=0)[:(end - start) % len(loop) + 1]
    return Outline(line if upper else line[::-1], time)


def _largest_loop(points: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """(n, 2) um, the points of the counterclockwise loop of edges with the largest area."""
    after = dict(zip(edges[:, 0].tolist(), edges))
    loops = []
    while after:
        node = next(iter(after))
        chain = []
        while node in after:
            chain.append(after.pop(node))
            node = int(chain[-1][-1])
        loops.append(curved(points[np.array(chain)])[:, :-1].reshape(-1, 2))
    return max(loops, key=polygon_area)
