"""Mesh motion (35) without its pressure, by quadratic elements on independent meshes of curved triangles.

The second equation of (35), gamma P = -div d, eliminates the pressure from the first:

    (grad d, grad v) + 1/gamma (div d, div v) = 0   for all v,

which needs no stabilisation. d is prescribed on the aggregate. d_y = 0 on the walls and d_x = 0 at inlet and outlet;
the other component is free. This is Navier's equation with (lambda + mu) / mu = 1/gamma: Kolosov's kappa is 1 + 2
gamma.

At inlet and outlet, and where the aggregate meets the wall at a right angle, reflections in the lines on which the
displacement slides extend it smoothly, so no corner is singular.

**Meshes.** The fluid around a half-disc on the lower wall is a grid of lines from the arc to the other three sides of
the channel, parts x parts squares to each side. Each square is halved; the same map places the midpoints of edges.
"""
from dataclasses import dataclass

import numpy as np
from skfem import Basis, BilinearForm, ElementTriP2, ElementVector, MeshTri, MeshTri2, condense, solve
from skfem.helpers import ddot, div, grad

#: Powers that grade the grid towards the aggregate, and towards the two points where it meets the wall.
TOWARDS_ARC, TOWARDS_WALL = 2.0, 3.0


@dataclass(frozen=True, eq=False)
class Motion:
    """Displacement (K, 2) at the quadrature points (K, 2) of the fluid, and their weights (K,)."""

    points: np.ndarray
    displacement: np.ndarray
    weights: np.ndarray


def follow(radius, width, end, parts, gamma, motion):
    """Compute the :class:`Motion` of the fluid in -end < x < end, 0 < y < width around a half-disc of ``radius`` on the
    lower wall. Its arc moves by motion(x, y), (2, n)."""
    basis = Basis(_mesh(radius, width, end, parts), ElementVector(ElementTriP2()), intorder=5)
    A = BilinearForm(lambda u, v, w: ddot(grad(u), grad(v)) + div(u) * div(v) / gamma).assemble(basis)
    constrained, value = _boundary(basis, radius, width, end, motion)
    solution = solve(*condense(A, x=value, D=constrained))
    points, field = (np.asarray(f).reshape(2, -1).T for f in (basis.global_coordinates(), basis.interpolate(solution)))
    return Motion(points, field, basis.dx.ravel())


def _mesh(radius, width, end, parts):
    """The strip 0 < t < 3, 0 < s < 1 in graded squares, halved, mapped by :func:`_map_strip` with edge midpoints."""
    side = np.linspace(0, 1, parts + 1)
    along = np.concatenate([side**TOWARDS_WALL, 1 + side[1:-1], 3 - side[::-1] ** TOWARDS_WALL])
    flat = MeshTri.init_tensor(along, side**TOWARDS_ARC)
    nodes = _map_strip(*Basis(flat, ElementTriP2()).doflocs, radius, width, end)
    return MeshTri2(nodes, flat.t)


def _map_strip(t, s, radius, width, end):
    """(2, n) places: s = 0 on the arc, s = 1 on the channel's sides, of which t from 0 to 1 is the right one, from 1 to
    2 the upper, from 2 to 3 the left one, and linear in s between."""
    turn = np.pi * np.interp(t, [0, 1, 2, 3], [0, 0.25, 0.75, 1])
    arc = radius * np.array([np.cos(turn), np.sin(turn)])
    arc[1, (t == 0) | (t == 3)] = 0.0
    rim = np.array([np.interp(t, [1, 2], [end, -end]), np.interp(t, [0, 1, 2, 3], [0, width, width, 0])])
    return (1 - s) * arc + s * rim


def _boundary(basis, radius, width, end, motion):
    """Numbers of the prescribed unknowns, and all values (zero elsewhere)."""
    x, y = basis.doflocs
    component = np.zeros(basis.N, int)
    near = 1e-9 * width
    component[np.concatenate([basis.nodal_dofs[1], basis.facet_dofs[1]])] = 1
    arc = np.abs(np.hypot(x, y) - radius) < near
    wall, ends = (y < near) | (y > width - near), np.abs(x) > end - near
    constrained = arc | np.where(component == 1, wall, ends)
    value = np.where(arc, np.choose(component, motion(x, y)), 0.0)
    return np.flatnonzero(constrained), value
