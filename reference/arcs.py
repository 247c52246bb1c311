"""Triangles of scikit-fem in and around a half-disc on the wall y = 0, whose edges follow its arc."""
import numpy as np
from skfem import Basis, ElementTriP2, MeshTri, MeshTri2

#: The largest distance of a node from a place that it is at, over the radius.
NEAR = 1e-9


def inside(mesh, radius):
    """(T,) is the triangle in the half-disc?"""
    return np.hypot(*mesh.p[:, mesh.t].mean(axis=1)) < radius


def arc(mesh, radius=np.inf):
    """Facets of the arc: those off the wall with a triangle of the half-disc, by default all triangles, on one side
    alone."""
    first, second = np.append(inside(mesh, radius), False)[mesh.f2t]
    return np.flatnonzero((first != second) & (mesh.p[1, mesh.facets].max(axis=0) > 0))


def rounded(mesh, radius):
    """The mesh with the nodes of the arc put onto it."""
    points, nodes = mesh.p.copy(), np.unique(mesh.facets[:, arc(mesh, radius)])
    points[:, nodes] *= radius / np.hypot(*points[:, nodes])
    return MeshTri(points, mesh.t)


def refined(mesh, radius, places, times):
    """The mesh refined ``times`` times around nodes at ``places`` (k, 2)."""
    for _ in range(times):
        near = np.any([np.hypot(*(mesh.p.T - place).T) < NEAR * radius for place in places], axis=0)
        mesh = rounded(mesh.refined(np.flatnonzero(near[mesh.t].any(axis=0))), radius)
    return mesh


def curved(mesh, radius):
    """Quadratic triangles, the middles of the arc's edges on it."""
    basis = Basis(mesh, ElementTriP2())
    places, middles = basis.doflocs.copy(), basis.facet_dofs[0, arc(mesh, radius)]
    places[:, middles] *= radius / np.hypot(*places[:, middles])
    return MeshTri2(places, mesh.t)
