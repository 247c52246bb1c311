"""A half-disc that has grown into the opposite wall: its shape and its contact lines, by scikit-fem.

The mechanics are those of :mod:`reference.quadratic_growth`. The arc between two angles lies on the wall, on which it
slides. Both angles are unknowns. The mesh at t = 0 has a node at each of them and slides along the arc with them.

The paper states a least film and a least angle of a wedge (2.3.3). Together they require a gap of at least
min(film, tan(angle) d) at the distance d from a contact line, along the wall. The missing gap of a line is the largest
value (um) of

    min(film, tan(angle) d) - gap

on the free surface beyond it. It is zero for both lines. At a line itself both terms are zero, and beside it the
surface opens like the root of d. The first tenth of the distance film / tan(angle) is therefore left out: a converged
surface comes nearest to the wall beyond it. MINPACK's hybrid method solves for the angles.
"""
from dataclasses import dataclass

import numpy as np
from scipy.optimize import root
from skfem import MeshTri

from reference import quadratic_growth
from reference.arcs import arc, curved, refined
from reference.quadratic_growth import Contact, Equilibrium

#: Angles (rad) of the nodes that become the contact lines, and of the ends of the arc.
NODES = np.pi * np.array([0.0, 0.25, 0.75, 1.0])
#: The part of film / tan(angle) beside a line that is left out, and places on each edge of the arc.
BESIDE, PER_EDGE = 0.1, 40
#: Accuracy of both angles (rad), and the smallest change for their derivatives.
ACCURACY, CHANGE = 1e-7, 1e-3
#: The first step of the search over the angles, at most.
FIRST_STEP = 0.1


@dataclass(frozen=True)
class Walls:
    """height: of the opposite wall; film: the least one (both um); slope: tan of the least angle."""

    height: float
    film: float
    slope: float


@dataclass(frozen=True, eq=False)
class Touching:
    """An aggregate in contact: the angles (rad) at t = 0 of its contact lines, downstream first; its equilibrium."""

    angles: np.ndarray
    equilibrium: Equilibrium

    @property
    def lines(self):
        """(2,) x of the contact lines, downstream first."""
        angle, place = outline(self.equilibrium)
        return place[0, np.abs(angle[:, None] - self.angles).argmin(axis=0)]

    @property
    def tips(self):
        """(2,) the largest and the smallest x."""
        _, (x, _) = outline(self.equilibrium)
        return np.array([x.max(), x.min()])


def outline(equilibrium, per_edge=PER_EDGE):
    """Angles (n,) at t = 0, rising, and places (2, n) of points of the arc."""
    mesh = equilibrium.mesh
    facets = arc(mesh)
    first, last = mesh.facets[:, facets]
    middle = mesh.t.max() + 1 + facets
    angle = np.arctan2(*mesh.doflocs[::-1])
    reversed_edges = angle[first] > angle[last]
    first, last = np.where(reversed_edges, last, first), np.where(reversed_edges, first, last)
    t = np.linspace(0, 1, per_edge + 1)
    functions = np.array([(1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)])
    nodes = np.array([first, middle, last])[:, np.argsort(angle[middle])]
    node_angles, places = angle[nodes], equilibrium.place[:, nodes]
    angles = node_angles[0][:, None] * (1 - t) + node_angles[2][:, None] * t
    points = np.einsum("iak,at->ikt", places, functions)
    return angles.ravel(), points.reshape(2, -1)


def missing_gap(equilibrium, angles, walls):
    """(2,) um by which the gap beyond the contact lines is too small at worst, downstream first; negative if it is
    larger than required."""
    angle, (x, y) = outline(equilibrium)
    line = x[np.abs(angle[:, None] - angles).argmin(axis=0)]
    distance = [1, -1] * (x[:, None] - line)
    beyond = [1, -1] * (angles - angle[:, None]) > 0
    required = np.minimum(walls.film, walls.slope * distance)
    worst = np.where(beyond & (required > BESIDE * walls.film), required - walls.height + y[:, None], -np.inf)
    return worst.max(axis=0)


def half_disc(radius, rings, times):
    """A straight mesh of ``rings`` rings, refined ``times`` times at the inner ones of NODES."""
    tips = radius * np.column_stack([np.cos(NODES[1:3]), np.sin(NODES[1:3])])
    return refined(quadratic_growth.in_rings(radius, rings), radius, tips, times)


def slid(mesh, angles):
    """The straight mesh with the nodes of NODES at ``angles``."""
    turned = np.interp(np.arctan2(*mesh.p[::-1]), NODES, [0.0, *angles, np.pi])
    points = np.hypot(*mesh.p) * np.array([np.cos(turned), np.sin(turned)])
    points[1, mesh.p[1] == 0] = 0.0
    points[0, (mesh.p == 0).all(axis=0)] = 0.0
    return MeshTri(points, mesh.t)


def grow(mesh, radius, theta, top, walls, angles, start=None):
    """Compute the aggregate in contact (:class:`Touching`) under the expansion theta(x, y), at most ``top``.

    mesh: a :func:`half_disc`; angles: (2,) first guess; start: an
    equilibrium on this mesh or another. Raises RuntimeError if there is none.
    """
    last = [start]

    def solve_at(pair):
        contact = Contact(*pair, walls.height)
        last[0] = quadratic_growth.grow(curved(slid(mesh, pair), radius), theta, top, contact=contact, start=last[0])
        return missing_gap(last[0], pair, walls)

    solution = root(solve_at, angles, tol=ACCURACY, options={"eps": CHANGE**2, "factor": FIRST_STEP})
    if not solution.success:
        raise RuntimeError(f"no contact lines: {solution.message}")
    solve_at(solution.x)
    return Touching(solution.x, last[0])
