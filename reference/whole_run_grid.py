"""One structured mesh topology for a whole run: a half-disc that grows on the lower wall of a channel.

In the plane of polar coordinates (r, a) the aggregate at t = 0 is r < 1, 0 < a < pi, in rings of 4 k edges. The fluid
is the layers 1 < r < 2, from the aggregate's outline to a box around it over the channel's whole height, and, on both
sides of the box, the layers 2 < r < 3 to the ends of the mesh. Triangles at the two corners where fluid, aggregate and
wall meet, (1, 0) and (1, pi), are refined CORNER times. The outline determines the positions of the fluid's nodes:

    (1 - w) A(a) + w B(a),    w = (g^(r - 1) - 1) / (g - 1),    g = 1 + W / (2 thickness)         for 1 < r < 2

where A is the outline, a spline in a, and B the box. Triangles near a small aggregate are small.
"""
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from skfem import MeshTri, MeshTri2

from reference import arcs

CORNER, TOLERANCE = 2, 1e-9


@dataclass(frozen=True, eq=False)
class Grid:
    """triangles (3, T); body (T,): True in the aggregate; polar (2, K): r and a of the quadratic nodes, corners first;
    seed (2, K): their positions at t = 0 over the seed's radius (meaningful in the aggregate); rim: nodes of the
    outline from a = 0 to pi."""

    triangles: np.ndarray
    body: np.ndarray
    polar: np.ndarray
    seed: np.ndarray
    rim: np.ndarray

    def mesh(self, places):
        """Curved triangles with quadratic nodes at ``places`` (2, K)."""
        return MeshTri2(places, self.triangles)

    def outline(self, places):
        """The outline of an aggregate with nodes at ``places`` (2, K) um: the spline a -> (x, y)."""
        return CubicSpline(self.polar[1, self.rim], places[:, self.rim].T)

    def around(self, places, width, ends):
        """Complete ``places`` (2, K) um of the aggregate's nodes by those of the fluid's nodes, in a channel of the
        given width (um) between two ends (um)."""
        r, a = self.polar
        spline = self.outline(places)
        thickness = places[1, self.rim].max()
        beyond = (width + thickness) / 2
        right, left = spline(0.0)[0] + beyond, spline(np.pi)[0] - beyond
        stretch = np.log1p(width / (2 * thickness))
        w = np.expm1(stretch * np.clip(r - 1, 0, 1)) / np.expm1(stretch)
        positions = (1 - w) * spline(a).T + w * _box(a, width, right, left)
        positions[0] += np.clip(r - 2, 0, 1) * np.where(a < np.pi / 2, ends[1] - right, ends[0] - left)
        return np.where(r < 1 + TOLERANCE, places, positions)


def _box(a, width, right, left):
    """Points (2, K) on the box's sides and top, by angle; its corners are at 45 and 135 degrees."""
    part = a / (np.pi / 4)
    x = right + (left - right) * np.clip((part - 1) / 2, 0, 1)
    return np.array([x, width * np.clip(np.minimum(part, 4 - part), 0, 1)])


def grid(rings):
    """:class:`Grid` of two or more rings in the aggregate, and as many layers to the box and from there to the ends."""
    (nodes, body), (outer, fluid) = _disc(rings), _layers(rings)
    shared = 4 * rings + 1
    mesh = MeshTri(np.hstack([nodes, outer[:, shared:]]), np.hstack([body, fluid + nodes.shape[1] - shared]))
    return _quadratic(arcs.refined(mesh, 1.0, [(1.0, 0.0), (-1.0, 0.0)], CORNER))


def _disc(rings):
    """Nodes (2, n) and triangles (3, t) of the rings: four sectors of k edges each on the k-th."""
    first = np.concatenate([[0], np.cumsum(4 * np.arange(rings + 1) + 1)])
    triangles = []
    for k in range(rings):
        for sector in range(4):
            inner, outer = first[k] + sector * k, first[k + 1] + sector * (k + 1)
            triangles += [(inner + i, outer + i, outer + i + 1) for i in range(k + 1)]
            triangles += [(inner + i, outer + i + 1, inner + i + 1) for i in range(k)]
    return np.hstack([_half_circle(k / rings, 4 * k) for k in range(rings + 1)]), np.array(triangles).T


def _half_circle(r, edges):
    """(2, edges + 1) equally spaced nodes; the first and the last are exactly on the wall."""
    a = np.linspace(0.0, np.pi, edges + 1)
    return r * np.array([np.cos(a), np.sin(a) * (a < np.pi)])


def _layers(rings):
    """Nodes (2, n) and triangles (3, t) of the fluid; its first 4 rings + 1 nodes are those of the outline."""
    points = np.hstack([_half_circle(1 + j / rings, 4 * rings) for j in range(2 * rings + 1)])
    number = np.arange(points.shape[1]).reshape(2 * rings + 1, -1)
    j, i = np.indices((2 * rings, 4 * rings)).reshape(2, -1)
    j, i = np.array([j, i])[:, (j < rings) | (i < rings) | (i >= 3 * rings)]
    a, b = number[j, i], number[j + 1, i]
    c, d = number[j + 1, i + 1], number[j, i + 1]
    right = i < 2 * rings  # the two halves are mirror images
    numbered = np.hstack([np.where(right, [a, b, c], [a, b, d]), np.where(right, [a, c, d], [b, c, d])])
    used, triangles = np.unique(numbered, return_inverse=True)
    return points[:, used], triangles.reshape(3, -1)


def _quadratic(mesh):
    """:class:`Grid` of straight triangles."""
    rim = arcs.arc(mesh, 1.0)
    corners = np.array([np.hypot(*mesh.p), np.arctan2(mesh.p[1], mesh.p[0])])
    polar = np.hstack([corners, corners[:, mesh.facets].mean(axis=1)])
    nodes = np.concatenate([np.unique(mesh.facets[:, rim]), mesh.nvertices + rim])
    seed = arcs.curved(mesh, 1.0).doflocs
    return Grid(mesh.t, arcs.inside(mesh, 1.0), polar, seed, nodes[np.argsort(polar[1, nodes])])
