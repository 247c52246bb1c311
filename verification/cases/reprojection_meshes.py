"""Accuracy of transfers between meshes: one transfer of a smooth field.

The common pieces of two meshes, and the projection integrated over them, are compared with shapely's pieces.
"""

import numpy as np
import pytest

from reference import galerkin_transfer
from repro.fem import transfer
from repro.fem.mesh import triangle_areas
from verification.evidence.cases import parametrize
from verification.evidence.checks import each_at_most, largest, refine, studies
from verification.problems import meshes, pairs, runs

SIZES = dict.fromkeys((5.0, 2.5, 1.25, 0.625), 3)
def smooth(x, y):
    """About two waves over the rectangle."""
    return 2 + np.sin(0.3 * x) * np.cos(0.2 * y)


#: The reason why transfers of fields run with linear elements alone.
MASSES = "order 2 carries masses, not fields: reprojection-growing"


def _located_errors(size: float, seed: int, order: int) -> dict[str, float]:
    """Error of a field of an order, interpolated at random points."""
    where = np.random.default_rng(8).uniform((0.0, 0.0), (pairs.ENDS[1], pairs.WIDTH), (1000, 2))
    mesh = meshes.space_on(meshes.channel(pairs.ENDS, pairs.WIDTH, size, lambda x, y: x < 0, seed=seed), order).mesh
    computed = transfer.located(mesh.points, mesh.cells, where).field(smooth(*mesh.points.T), mesh.cells)
    return {"located": np.sqrt(np.mean((computed - smooth(*where.T)) ** 2))}


def _carried_errors(size: float, seed: int, carry) -> dict[str, float]:
    """Error of a field after one transfer."""
    old, new = pairs.grid(size, 2 * seed), pairs.grid(0.9 * size, 2 * seed + 1)
    computed = carry(*old, smooth(*old[0].T)[:, None], *new)
    return {"carried": meshes.l2_error(*new, computed[:, 0], smooth)}


#: Transfers with bounds of the error on the finest mesh; those bounds for fields, by their order.
CARRIERS = {"projection": (transfer.project, 2e-3), "interpolation": (transfer.interpolated, 4e-3)}
LOCATED = {1: 4e-3, 2: 1e-4}


@pytest.mark.case(
    "reprojection-order", kind="manufactured", mutants=("corners-for-middles", "nearest-corner"))
@parametrize(
    "field, measure, method, *expected",
    {**{f"{name}, order 1": ("carried", _carried_errors, carry, 2, "linear elements: second order", ceiling)
        for name, (carry, ceiling) in CARRIERS.items()},
     **{f"fields of order {k}, order {k}": ("located", _located_errors, k, k + 1,
                                            "interpolation: one order more than the elements'", ceiling)
        for k, ceiling in LOCATED.items()}})
def test_order(field, measure, method, expected, record):
    """No transfer loses the accuracy of linear elements, and fields of each order are interpolated to their order.

    Norm: L2 of a smooth field, interpolated on one mesh and carried to another, root mean square over three pairs a
    size; root mean square error at a thousand places of fields of order 1 and 2, and over three meshes a size.
    """
    record(studies(refine(measure, SIZES, method), {field: expected}))


ROUND_OFF = "round-off; over eight pairs of meshes"
#: Degree of the polynomials that the pieces integrate: that of the quadrature in :mod:`verification.problems.meshes`.
DEGREE = 6


@pytest.mark.case(
    "reprojection-supermesh", kind="exact", mutants=("clip-two-sides", "fans-cut-short"),
    references=("galerkin_transfer",), runs_with="1", omitted=MASSES)
def test_supermesh(record):
    """The common pieces of two meshes are shapely's, cover every triangle of both once, and integrate polynomials
    exactly, for unrelated meshes, shared nodes and edges, equal meshes and slivers.

    Norm: largest difference of the area that two triangles share, and between a triangle and its pieces, over the
    largest area; largest relative error of the integrals of x^a y^b, a + b up to 6.
    """
    record(each_at_most(runs.worst([_pieces(old, new) for _, old, new in pairs.pairs()]), 1e-12, ROUND_OFF))


def _pieces(old: pairs.Grid, new: pairs.Grid) -> dict[str, float]:
    """Errors of the common pieces of a pair of meshes."""
    corners, of_old, of_new = transfer.supermesh(*old, *new)
    rim = corners.reshape(-1, 2), np.arange(3 * len(corners)).reshape(-1, 3)
    expected = galerkin_transfer.overlaps(*old, *new)
    shared = np.zeros_like(expected)
    np.add.at(shared, (of_old, of_new), np.abs(triangle_areas(*rim)))
    gaps = [largest(shared.sum(axis=1 - axis) - triangle_areas(*mesh)) for axis, mesh in ((0, old), (1, new))]
    return {"shared areas": largest(shared - expected) / expected.max(),
            "triangles less their pieces": max(gaps) / expected.max(), "polynomials": _polynomials(rim)}


def _polynomials(pieces: pairs.Grid) -> float:
    """Largest relative error of the integrals of monomials over the rectangle."""
    where, weight, _ = meshes.quadrature(*pieces)
    power = np.arange(DEGREE + 1)
    along, across = np.moveaxis(where[..., None] ** power, 2, 0)
    exact = np.outer(*(side ** (power + 1) / (power + 1) for side in (pairs.ENDS[1], pairs.WIDTH)))
    errors = np.einsum("tq,tqa,tqb->ab", weight, along, across) / exact - 1
    return largest(errors[np.add.outer(power, power) <= DEGREE])


@pytest.mark.case(
    "reprojection-projection", kind="cross-code", mutants=("lumped-mass", "corners-for-middles", "contributions-lost"),
    references=("galerkin_transfer",), runs_with="1", omitted=MASSES)
def test_projection(record):
    """The projection of a random field is that of a dense code on shapely's pieces. It keeps linear fields, the field's
    integral and its centre, and the square decreases by the square of the difference.

    Norm: largest difference of nodal values over the field's largest; integrals of the field, of the field times x and
    y, and of its square, relative.
    """
    random = np.random.default_rng(6)
    rows = [_projection_errors(old, new, random.uniform(0.0, 1.0, len(old[0]))) for _, old, new in pairs.pairs()]
    record(each_at_most(runs.worst(rows), 1e-11, ROUND_OFF))


def _projection_errors(old: pairs.Grid, new: pairs.Grid, rough: np.ndarray) -> dict[str, float]:
    """Errors of a rough and of a linear field on a pair of meshes."""
    projected = transfer.project(*old, np.column_stack([rough, _plane(old)]), *new)
    expected = galerkin_transfer.project(*old, rough[:, None], *new)[:, 0]
    drifts = {name: abs(pairs.integral(new, projected[:, 0], weight) / pairs.integral(old, rough, weight) - 1)
              for name, weight in (("integral", lambda x, y: 1 + 0 * x), ("centre, x", lambda x, y: x),
                                   ("centre, y", lambda x, y: y))}
    return {"against the dense code": largest(projected[:, 0] - expected),
            "linear field": _plane_error(projected[:, 1], new), **drifts,
            "square": _pythagoras(old, rough, new, projected[:, 0])}


def _plane(mesh: pairs.Grid) -> np.ndarray:
    return 3 + 2 * mesh[0][:, 0] - mesh[0][:, 1]


def _plane_error(computed: np.ndarray, mesh: pairs.Grid) -> float:
    """Largest error of a transferred plane, over its range."""
    return largest(computed - _plane(mesh)) / np.ptp(_plane(mesh))


def _pythagoras(old: pairs.Grid, before: np.ndarray, new: pairs.Grid, after: np.ndarray) -> float:
    """|X_old|^2 - |X_new|^2 - |X_old - X_new|^2 over the first: zero if the difference is orthogonal to X_new."""
    corners, of_old, of_new = transfer.supermesh(*old, *new)
    difference = 0.0
    for (points, triangles), field, owner, sign in ((old, before, of_old, 1), (new, after, of_new, -1)):
        nodes = triangles[owner][:, None]
        difference = difference + sign * np.sum(transfer.barycentric(points[nodes], corners) * field[nodes], axis=2)
    pieces = corners.reshape(-1, 2), np.arange(difference.size).reshape(-1, 3)
    defect = pairs.square(old, before) - pairs.square(new, after) - pairs.square(pieces, difference.ravel())
    return abs(defect) / pairs.square(old, before)
