"""Slow answers that can be read off the paper: one triangle, one node, one difference at a time, nothing from `repro`.

Meshes are (points, triangles): (N, 2) um and (T, 3) nodes. Nothing here is vectorised, cached or clever.
"""
import math

import numpy as np
import shapely


def area(corners):
    """Area of a triangle, by the shoelace formula; positive counterclockwise."""
    (ax, ay), (bx, by), (cx, cy) = corners
    return 0.5 * ((bx - ax) * (cy - ay) - (by - ay) * (cx - ax))


def slopes(corners):
    """(3, 2) gradients of the three nodal functions: rows of the inverse of [1 x y] at the corners."""
    return np.linalg.inv(np.column_stack([np.ones(3), corners]))[1:].T


def diameter(corners):
    """Of the circumscribed circle: a / sin(alpha), with the angle opposite to the first side."""
    a, b, c = (math.dist(corners[i], corners[j]) for i, j in ((1, 2), (2, 0), (0, 1)))
    return a / math.sin(math.acos((b * b + c * c - a * a) / (2 * b * c)))


def nodal_areas(points, triangles):
    """[S_i]: a third of each triangle to each of its nodes."""
    found = [0.0] * len(points)
    for triangle in triangles:
        for node in triangle:
            found[node] += area(points[triangle]) / 3
    return found


def reprojected(points, moved, triangles, field):
    """(34) node by node: what lay at a node lies there still, on the area that it has now."""
    before, after = nodal_areas(points, triangles), nodal_areas(moved, triangles)
    return [x * s / t if t > 0 else 0.0 for x, s, t in zip(field, before, after)]


def mass(points, triangles, field):
    """Integral of a linear field: the area of each triangle times the mean of its three values."""
    return math.fsum(area(points[t]) * sum(field[i] for i in t) / 3 for t in triangles)


def at(corners, values, place):
    """A linear field on one triangle, at a place: areas of the three triangles that the place makes with the sides."""
    a, b, c = corners
    parts = area([place, b, c]), area([a, place, c]), area([a, b, place])
    return sum(part * value for part, value in zip(parts, values)) / area(corners)


def pieces(old, new):
    """(i, j, triangle) for each common piece of old triangle i and new triangle j, cut by shapely."""
    before, after = ([shapely.Polygon(points[t]) for t in triangles] for points, triangles in (old, new))
    for i, here in enumerate(before):
        for j, there in enumerate(after):
            polygon = here.intersection(there)
            if polygon.geom_type == "Polygon" and not polygon.is_empty:
                ring = shapely.get_coordinates(polygon)[:-1]
                for k in range(1, len(ring) - 1):
                    yield i, j, [ring[0], ring[k], ring[k + 1]]


def projected(old, field, new):
    """(K,) Galerkin projection: (X_new, N_i) = (X_old, N_i) for all new N_i, integrated piece by piece at the middles
    of its sides (exact for squares), and solved densely."""
    matrix, right = np.zeros((len(new[0]), len(new[0]))), np.zeros(len(new[0]))
    for i, j, (a, b, c) in pieces(old, new):
        nodes, corners = new[1][j], new[0][new[1][j]]
        for place in ((a + b) / 2, (b + c) / 2, (c + a) / 2):
            value = at(old[0][old[1][i]], field[old[1][i]], place)
            weights = [at(corners, unit, place) for unit in np.eye(3)]
            for m, N in zip(nodes, weights):
                right[m] += abs(area([a, b, c])) / 3 * N * value
                for n, M in zip(nodes, weights):
                    matrix[m, n] += abs(area([a, b, c])) / 3 * N * M
    return np.linalg.solve(matrix, right)


def derivative(function, place, step):
    """Derivative of ``function(array) -> number or array`` by each entry of the array: central differences of order 4.

    Error about step^4 times the fifth derivative over 30, and 1e-16 / step of the function's size.
    """
    rows = []
    for index in np.ndindex(place.shape):
        unit = np.zeros(place.shape)
        unit[index] = step
        f = [np.asarray(function(place + k * unit)) for k in (-2, -1, 1, 2)]
        rows.append((f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * step))
    return np.moveaxis(np.array(rows), 0, -1).reshape(*np.shape(rows[0]), *place.shape)


def rates(acceptor, donor, half_a, half_d, k, Y, b, f_d, d_c, F):
    """(F1, F2, F3, F4) / X_A as (7)-(10) print them, with d_c f_d b for d_f d_b [E3]."""
    m_a, m_d = acceptor / (acceptor + half_a), donor / (donor + half_d)
    return (-m_a * (k * F * m_d + d_c * f_d * b), -k * m_a * m_d, m_a * (k * Y * m_d - b), m_a * b * (1 - f_d))


def extent(places, width, length):
    """3.1 in words: as far as ten thicknesses or one and a half widths, whichever is less, before the first place and
    behind the last one, and never past the pore's ends, at half its length on both sides of the origin."""
    thickness = max(y for _, y in places)
    reach = 10 * thickness if 10 * thickness < 1.5 * width else 1.5 * width
    left, right = min(x for x, _ in places) - reach, max(x for x, _ in places) + reach
    return (left if left > -length / 2 else -length / 2), (right if right < length / 2 else length / 2)


def stokes(points, triangles, viscosity, tau, one, two, traction=False):
    """The stabilised Stokes form of two fields (u, p) and (v, q) of linear triangles, summed triangle by triangle:

        nu grad u : grad v - p div v - q div u - tau grad p . grad q

    with grad u + grad u^T in place of grad u for ``traction``; viscosity and tau are of each triangle.
    """
    (u, p), (v, q), total = one, two, 0.0
    for nodes, nu, t in zip(triangles, viscosity, tau):
        G = slopes(points[nodes])
        grad_u, grad_v, grad_p, grad_q = (field[nodes].T @ G for field in (u, v, p, q))
        strain = grad_u + grad_u.T if traction else grad_u
        density = nu * np.sum(strain * grad_v) - t * grad_p @ grad_q
        density -= p[nodes].mean() * np.trace(grad_v) + q[nodes].mean() * np.trace(grad_u)
        total += area(points[nodes]) * density
    return total


def energy(F, P, theta):
    """(17) with (21): 1/2 (J^(-2/3) tr C - 3) + P (J - theta), mu_L = 1, of the whole deformation with F33 = 1."""
    whole = np.zeros((3, 3))
    whole[:2, :2], whole[2, 2] = F, 1.0
    J, trace = np.linalg.det(whole), np.trace(whole.T @ whole)
    return (J ** (-2 / 3) * trace - 3) / 2 + P * (J - theta)


def functional(reference, triangles, shape, start, theta, position, pressure):
    """Pi of (27) with the signs of [E5] and the reading of [E6]: the energy at t = 0, P its mean over each triangle,
    less h^2 / (12 mu) |grad P|^2 / 2 on the last shape, with mu = start^(-2/3), start its growth in area."""
    total = 0.0
    for nodes, J_start, J in zip(triangles, start, theta):
        F = position[nodes].T @ slopes(reference[nodes])
        total += area(reference[nodes]) * energy(F, pressure[nodes].mean(), J)
        uneven = pressure[nodes] @ slopes(shape[nodes])
        h, mu = diameter(shape[nodes]), J_start ** (-2 / 3)
        total -= area(shape[nodes]) * h**2 / (12 * mu) * uneven @ uneven / 2
    return total


#: Places of the six nodes of a curved triangle on the unit triangle: corners, then middles of the edges 01, 12, 20.
SIX = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.0], [0.5, 0.5], [0.0, 0.5]])


def quadratic(s, t):
    """(6,) derivatives by s, and by t, of the functions of the six nodes: each is a polynomial of degree two that is
    one at its own node and zero at the others."""
    monomials = np.column_stack([np.ones(6), SIX[:, 0], SIX[:, 1], SIX[:, 0] ** 2, SIX.prod(axis=1), SIX[:, 1] ** 2])
    coefficients = np.linalg.inv(monomials)
    return np.array([0, 1, 0, 2 * s, t, 0]) @ coefficients, np.array([0, 0, 1, 0, s, 2 * t]) @ coefficients


def curved_functional(reference, cells, theta, position, pressure, rule, gamma):
    """Pi of curved triangles: the energy at t = 0, P linear between the corners, and gamma theta^(-5/3) (J - theta)^2
    / 2. rule: (s, t, weight) of each point of the quadrature, on the unit triangle; theta: of each triangle and point.
    """
    total = 0.0
    for nodes, of_cell in zip(cells, theta):
        for (s, t, weight), grown in zip(rule, of_cell):
            by = np.array(quadratic(s, t))
            before, now = by @ reference[nodes], by @ position[nodes]
            F = (np.linalg.inv(before) @ now).T
            P = np.array([1 - s - t, s, t]) @ pressure[nodes[:3]]
            grad_div = gamma * grown ** (-5 / 3) * (np.linalg.det(F) - grown) ** 2 / 2
            total += weight * np.linalg.det(before) * (energy(F, P, grown) + grad_div)
    return total
