"""Galerkin projection of nodal fields between two triangulations of one polygon, by direct formulas.

    (X_new, N_i) = (X_old, N_i)  for every nodal function N_i of the new mesh.

shapely cuts every old triangle with every new one; on the pieces both fields are linear, and the product of two linear
functions f, g over a triangle of area A is A / 12 (sum f sum g + sum f g), sums over its corners. The mass matrix is
dense. The code uses no quadrature points, no clipping algorithm and no sparse solver.
"""
import numpy as np
import shapely


def overlaps(points, triangles, new_points, new_triangles):
    """Area of the intersection of each old triangle (T, 3) with each new one (S, 3), (T, S)."""
    return shapely.area(_intersections(points, triangles, new_points, new_triangles))


def project(points, triangles, fields, new_points, new_triangles):
    """(K, m) nodal values on the new mesh of nodal fields (N, m) on the old one."""
    pieces = _intersections(points, triangles, new_points, new_triangles)
    right = np.zeros((len(new_points), fields.shape[1]))
    for old, new in np.argwhere(shapely.area(pieces) > 0):
        for corners in _fan(pieces[old, new]):
            values = linear(points[triangles[old]], fields[triangles[old]], corners)
            shape = linear(new_points[new_triangles[new]], np.eye(3), corners)
            right[new_triangles[new]] += product(corners, shape, values)
    return np.linalg.solve(mass(new_points, new_triangles), right)


def mass(points, triangles):
    """(N, N) integrals of products of the nodal functions."""
    matrix = np.zeros((len(points), len(points)))
    for nodes in triangles:
        matrix[np.ix_(nodes, nodes)] += product(points[nodes], np.eye(3), np.eye(3))
    return matrix


def linear(corners, values, places):
    """Values (k, m) at points (k, 2) of the linear functions that take ``values`` (3, m) at ``corners`` (3, 2)."""
    coefficients = np.linalg.solve(np.column_stack([np.ones(3), corners - corners[0]]), values)
    return np.column_stack([np.ones(len(places)), places - corners[0]]) @ coefficients


def product(corners, f, g):
    """(a, b) integrals over a triangle of products of linear functions with corner values f (3, a) and g (3, b)."""
    area = 0.5 * abs(np.linalg.det(corners[1:] - corners[0]))
    return area / 12 * (np.outer(f.sum(axis=0), g.sum(axis=0)) + f.T @ g)


def _intersections(points, triangles, new_points, new_triangles):
    """(T, S) intersections: convex polygons, or lines, points or nothing."""
    old, new = shapely.polygons(points[triangles]), shapely.polygons(new_points[new_triangles])
    return shapely.intersection(old[:, None], new[None])


def _fan(piece):
    """Corners (3, 2) of the triangles of a convex polygon."""
    rim = shapely.get_coordinates(shapely.convex_hull(piece))[:-1]
    return [rim[[0, k, k + 1]] for k in range(1, len(rim) - 1)]
