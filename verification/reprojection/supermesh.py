"""The common pieces of two meshes, and the projection that is integrated over them, against shapely's pieces."""

from __future__ import annotations

import numpy as np

from reference import galerkin_transfer
from repro.fem import transfer
from repro.fem.mesh import triangle_areas
from verification import norms
from verification.case import Outcome, at_most, case
from verification.reprojection import grids

ROUND_OFF = "round-off; over eight pairs of meshes"
#: Degree of the polynomials that the pieces must integrate: that of the rule in :mod:`verification.norms`.
DEGREE = 6


@case("reprojection-supermesh", kind="exact",
      norm="largest difference of the area that two triangles share, and between a triangle and its pieces, over the "
           "largest area; largest relative error of the integrals of x^a y^b, a + b up to 6",
      claim="The common pieces of two meshes are shapely's, cover every triangle of both once, and integrate "
            "polynomials exactly, for unrelated meshes, shared nodes and edges, equal meshes and slivers",
      mutants=("clip-two-sides", "fans-cut-short"))
def supermesh() -> Outcome:
    return _worst([_pieces(old, new) for _, old, new in grids.pairs()], 1e-12)


def _worst(rows: list[dict[str, float]], bound: float) -> Outcome:
    """The largest of each number over all pairs of meshes."""
    return Outcome(tuple(at_most(name, max(row[name] for row in rows), bound, ROUND_OFF) for name in rows[0]))


def _pieces(old: grids.Grid, new: grids.Grid) -> dict[str, float]:
    """The errors of one pair of meshes."""
    corners, of_old, of_new = transfer.supermesh(*old, *new)
    rim = corners.reshape(-1, 2), np.arange(3 * len(corners)).reshape(-1, 3)
    expected = galerkin_transfer.overlaps(*old, *new)
    shared = np.zeros_like(expected)
    np.add.at(shared, (of_old, of_new), np.abs(triangle_areas(*rim)))
    gaps = [np.abs(shared.sum(axis=1 - axis) - triangle_areas(*mesh)).max() for axis, mesh in ((0, old), (1, new))]
    return {"shared areas": np.abs(shared - expected).max() / expected.max(),
            "triangles less their pieces": max(gaps) / expected.max(), "polynomials": _polynomials(rim)}


def _polynomials(pieces: grids.Grid) -> float:
    """Largest relative error of the integrals of monomials over the rectangle."""
    where, weight, _ = norms.quadrature(*pieces)
    length, errors = grids.ENDS[1], []
    for a in range(DEGREE + 1):
        for b in range(DEGREE + 1 - a):
            exact = length ** (a + 1) / (a + 1) * grids.WIDTH ** (b + 1) / (b + 1)
            errors.append(abs(np.sum(weight * where[..., 0] ** a * where[..., 1] ** b) / exact - 1))
    return max(errors)


@case("reprojection-projection", kind="cross-code",
      norm="largest difference of nodal values over the field's largest; integrals of the field, of the field times x "
           "and y, and of its square, relative",
      claim="The projection of a random field is that of a dense code on shapely's pieces; it keeps linear fields, "
            "the field's integral and centre, and what it takes from the square is the square of the difference",
      mutants=("lumped-mass", "corners-for-middles", "contributions-lost"))
def projection() -> Outcome:
    random = np.random.default_rng(6)
    return _worst([_projected(old, new, random.uniform(0.0, 1.0, len(old[0]))) for _, old, new in grids.pairs()], 1e-11)


def _projected(old: grids.Grid, new: grids.Grid, rough: np.ndarray) -> dict[str, float]:
    """The errors of a rough field, and of a linear one, on one pair of meshes."""
    found = transfer.project(*old, np.column_stack([rough, _plane(old)]), *new)
    expected = galerkin_transfer.project(*old, rough[:, None], *new)[:, 0]
    drifts = {name: abs(grids.integral(new, found[:, 0], weight) / grids.integral(old, rough, weight) - 1)
              for name, weight in (("integral", lambda x, y: 1 + 0 * x), ("centre, x", lambda x, y: x),
                                   ("centre, y", lambda x, y: y))}
    return {"against the dense code": np.abs(found[:, 0] - expected).max(),
            "linear field": np.abs(found[:, 1] - _plane(new)).max() / np.ptp(_plane(new)), **drifts,
            "square": _pythagoras(old, rough, new, found[:, 0])}


def _plane(mesh: grids.Grid) -> np.ndarray:
    return 3 + 2 * mesh[0][:, 0] - mesh[0][:, 1]


def _pythagoras(old: grids.Grid, before: np.ndarray, new: grids.Grid, after: np.ndarray) -> float:
    """|X_old|^2 - |X_new|^2 - |X_old - X_new|^2 over the first: zero where the difference is at right angles to X_new.
    """
    corners, of_old, of_new = transfer.supermesh(*old, *new)
    gap = 0.0
    for (points, triangles), field, owner, sign in ((old, before, of_old, 1), (new, after, of_new, -1)):
        nodes = np.repeat(triangles[owner][:, None], 3, axis=1)
        gap = gap + sign * np.sum(transfer.barycentric(points[nodes], corners) * field[nodes], axis=2)
    pieces = corners.reshape(-1, 2), np.arange(gap.size).reshape(-1, 3)
    left = grids.square(old, before) - grids.square(new, after) - grids.square(pieces, gap.ravel())
    return abs(left) / grids.square(old, before)
