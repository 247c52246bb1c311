"""Meshes of scikit-fem for a half-disc on the wall y = 0. Edges of the triangles follow its arc."""
import numpy as np
from skfem import Basis, ElementTriP2, MeshTri, MeshTri2

#: Tolerance, relative to the radius, for a node to coincide with a point.
NEAR = 1e-9


def inside(mesh, radius):
    """Whether each triangle lies in the half-disc, (T,)."""
    return np.hypot(*mesh.p[:, mesh.t].mean(axis=1)) < radius


def arc(mesh, radius=np.inf):
    """Facets of the arc: they lie off the wall and have a triangle of the half-disc on exactly one side. By default,
    every triangle belongs to the half-disc."""
    first, second = np.append(inside(mesh, radius), False)[mesh.f2t]
    return np.flatnonzero((first != second) & (mesh.p[1, mesh.facets].max(axis=0) > 0))


def rounded(mesh, radius):
    """The mesh with the nodes of the arc moved onto the circle."""
    points = mesh.p.copy()
    nodes = np.unique(mesh.facets[:, arc(mesh, radius)])
    points[:, nodes] *= radius / np.hypot(*points[:, nodes])
    return MeshTri(points, mesh.t)


def refined(mesh, radius, places, times):
    """The mesh refined ``times`` times around nodes at ``places`` (k, 2)."""
    for _ in range(times):
        near = np.any([np.hypot(*(mesh.p.T - place).T) < NEAR * radius for place in places], axis=0)
        mesh = rounded(mesh.refined(np.flatnonzero(near[mesh.t].any(axis=0))), radius)
    return mesh


def curved(mesh, radius):
    """Quadratic triangles; the midpoints of the arc's edges lie on the circle."""
    basis = Basis(mesh, ElementTriP2())
    places = basis.doflocs.copy()
    middles = basis.facet_dofs[0, arc(mesh, radius)]
    places[:, middles] *= radius / np.hypot(*places[:, middles])
    return MeshTri2(places, mesh.t)
