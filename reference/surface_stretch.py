"""The elastic stretch along an aggregate's free surface, from the fields of a ``.vtu`` file alone.

The position X(x) at t = 0 is a field on the present triangles, straight or curved. A surface with the unit tangent s
has the stretch 1 / |grad X s|. The material has the volume ratio J = 1 / det(grad X). The elastic stretch is
det(grad X)^(1/2) / |grad X s|. It is evaluated at three Gauss points of each edge between the aggregate and the fluid.
The second of them is the middle of the edge. If the stretch varies within an edge, its mean differs from its value in
the middle, so this difference shows how well the mesh resolves the stretch.
"""
import numpy as np

#: Corners of the edges 01, 12 and 20, and the node in their middle.
EDGES = np.array([[0, 1, 3], [1, 2, 4], [2, 0, 5]])
CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
GAUSS, WEIGHTS = np.polynomial.legendre.leggauss(3)


def surface_stretch(points, cells, aggregate, before, others=None):
    """Compute (stretch, distance, midpoints) of the free edges, (e, 2), (e,) and (e, 2).

    The columns of the stretch are its mean over an edge and its value in the middle. The distance is that to the nearer
    end of the free surface, along the chords of its edges and relative to their length. points: (N, 2); cells: (T, 3 or
    6), corners counterclockwise, then the midpoints of the edges 01, 12 and 20; aggregate: (T,) True in the aggregate;
    before: (N, 2) positions at t = 0; others: (T,) True in other aggregates. Nodes of a weld have another position at
    t = 0 in the other aggregate, so edges of triangles with such a node are left out.
    """
    others = np.zeros(len(cells), bool) if others is None else others
    welded = np.isin(cells, cells[others]).any(axis=1)
    ends = np.sort(cells[:, EDGES[:, :2]], axis=2)
    fluid_edges = {tuple(pair) for pair in ends[~(aggregate | others)].reshape(-1, 2).tolist()}
    free = {}
    for cell in np.flatnonzero(aggregate & ~welded):
        for local in range(3):
            if tuple(ends[cell, local].tolist()) in fluid_edges:
                free[int(cells[cell, EDGES[local, 0]])] = (cell, local)
    edges = []
    for start in free.keys() - {int(cells[cell, EDGES[local, 1]]) for cell, local in free.values()}:
        edges += _along(start, free, points, cells, before)
    columns = np.array(edges)
    return columns[:, :2], columns[:, 2], columns[:, 3:]


def _along(start, free, points, cells, before):
    """(mean stretch, stretch in the middle, distance, x, y) of each edge from one contact line to the next."""
    edges = []
    while start in free:
        edges.append(free[start])
        start = int(cells[edges[-1][0], EDGES[edges[-1][1], 1]])
    values = [_edge(points[cells[cell]], before[cells[cell]], local) for cell, local in edges]
    length = np.array([value[1] for value in values])
    along = np.cumsum(length) - length / 2
    nearer = np.minimum(along, length.sum() - along) / length.sum()
    return [(*value[0], distance, *value[2]) for value, distance in zip(values, nearer)]


def _edge(present, before, local):
    """((mean, middle) stretch, chord, middle) of an edge of a triangle with nodes (3 or 6, 2) now and at t = 0."""
    first, last = CORNERS[EDGES[local, :2]]
    places = first + (GAUSS[:, None] + 1) / 2 * (last - first)
    shape_gradients = _shape_gradients(len(present), places)
    present_jacobian = np.einsum("ai,qak->qik", present, shape_gradients)
    initial_jacobian = np.einsum("ai,qak->qik", before, shape_gradients)
    tangent = present_jacobian @ (last - first)
    speed = np.linalg.norm(tangent, axis=1)
    gradient = initial_jacobian @ np.linalg.inv(present_jacobian)
    stretched = np.linalg.norm(np.einsum("qij,qj->qi", gradient, tangent / speed[:, None]), axis=1)
    stretch = np.sqrt(np.linalg.det(gradient)) / stretched
    weight = WEIGHTS / 2 * speed
    middle = present[EDGES[local, 2]] if len(present) == 6 else present[EDGES[local, :2]].mean(axis=0)
    chord = np.linalg.norm(np.diff(present[EDGES[local, :2]], axis=0))
    return (weight @ stretch / weight.sum(), stretch[1]), chord, middle


def _shape_gradients(count, places):
    """(q, 3 or 6, 2) derivatives of the shape functions at places (q, 2) of the unit triangle."""
    s, t = places.T
    linear = np.array([1 - s - t, s, t])
    linear_gradients = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    if count == 3:
        return np.broadcast_to(linear_gradients, (len(places), 3, 2))
    corners = [(4 * linear[a] - 1)[:, None] * linear_gradients[a] for a in range(3)]
    middles = [4 * (linear[a][:, None] * linear_gradients[b] + linear[b][:, None] * linear_gradients[a])
               for a, b in EDGES[:, :2]]
    return np.stack([*corners, *middles], axis=1)


def least(stretch, distance, beside):
    """(2,) least mean, and least value in the middle, of edges farther from contact lines than ``beside`` of the
    surface's length."""
    return stretch[distance > beside].min(axis=0)
