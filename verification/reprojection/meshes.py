"""What a transfer costs in accuracy: one transfer of a smooth field, and forty of a steep one.

The projection limited by flux-corrected transport: conserves like the projection, bounded like interpolation.

The common pieces of two meshes, and the projection that is integrated over them, against shapely's pieces.
"""

from __future__ import annotations

import numpy as np

from reference import galerkin_transfer
from repro.fem import transfer
from repro.fem.mesh import Mesh, triangle_areas
from repro.fem.space import Space
from verification.kernel.case import Outcome, Profile, at_least, at_most, between, case, refine, study
from verification.problems import meshes, pairs

SIZES, SEEDS = (5.0, 2.5, 1.25, 0.625), range(3)
REMESHES = 40


def smooth(x, y):
    """About two waves over the rectangle."""
    return 2 + np.sin(0.3 * x) * np.cos(0.2 * y)


def steep(x, y):
    """A hill twenty times narrower than the domain, from 0 to 1."""
    return np.exp(-((x - 18) ** 2 + (y - 10) ** 2) / 6)


def sampled(points, triangles, fields, new_points, new_triangles):
    """The paper's transfer, with the arguments of the projection."""
    return transfer.interpolate(points, triangles, fields, new_points)


CARRIERS = {"projection": transfer.project, "interpolation": sampled}


@case("reprojection-order", kind="manufactured",
      norm="L2 of a smooth field, interpolated on one mesh and carried to another, mean of three pairs a size; root "
           "mean square error at a thousand places of fields of order 1, 2 and 3, mean of three meshes a size",
      claim="Neither transfer loses the accuracy of linear elements, and fields of each order are found to their order",
      mutants=("corners-for-middles", "nearest-corner"), ways="1 2 3")
def order() -> Outcome:
    errors = refine(_carried_errors, SIZES)
    studies = [study(name, SIZES, errors[name], 2, "linear elements: second order", ceiling=ceiling)
               for name, ceiling in (("projection", 2e-3), ("interpolation", 4e-3))]
    located = refine(_located_errors, SIZES)
    studies += [study(f"fields of order {k}", SIZES, located[f"{k}"], k + 1, "interpolation: one order more than the "
                      "elements'", ceiling=ceiling) for k, ceiling in LOCATED.items()]
    return Outcome(studies=tuple(studies), profiles=(_across_the_hill(),))


#: Errors on the finest mesh may reach this, by the order of the field.
LOCATED = {1: 4e-3, 2: 1e-4, 3: 2e-6}


def _located_errors(size: float) -> dict[str, float]:
    """Mean over meshes of the error of the field interpolated by each order."""
    where = np.random.default_rng(8).uniform((0.0, 0.0), (pairs.ENDS[1], pairs.WIDTH), (1000, 2))
    errors = {f"{k}": [] for k in LOCATED}
    for seed in SEEDS:
        points, triangles = pairs.grid(size, seed)
        mesh = Mesh.of(points, triangles, np.zeros(len(triangles), bool), np.empty(0, int), pairs.WIDTH, pairs.ENDS)
        at = transfer.located(points, triangles, where)
        for k in LOCATED:
            space = Space(mesh, k)
            found = at.field(smooth(*space.points.T), space.cells, k)
            errors[f"{k}"].append(np.sqrt(np.mean((found - smooth(*where.T)) ** 2)))
    return {name: float(np.mean(row)) for name, row in errors.items()}


def _carried_errors(size: float) -> dict[str, float]:
    """Mean error of each transfer."""
    errors = {name: [] for name in CARRIERS}
    for seed in SEEDS:
        old, new = pairs.grid(size, 2 * seed), pairs.grid(0.9 * size, 2 * seed + 1)
        for name, carry in CARRIERS.items():
            found = carry(*old, smooth(*old[0].T)[:, None], *new)
            errors[name].append(meshes.l2_error(*new, found[:, 0], smooth))
    return {name: float(np.mean(row)) for name, row in errors.items()}


def _across_the_hill() -> Profile:
    """A steep field along a line, carried by both transfers and by the dense code."""
    old, new = pairs.grid(5.0, 1), pairs.grid(4.0, 2)
    field, x = steep(*old[0].T)[:, None], np.linspace(*pairs.ENDS, 201)[1:-1]
    line = np.column_stack([x, 0 * x + 10.0])
    curves = [(name, "ours", x, meshes.sample(*new, carry(*old, field, *new)[:, 0], line))
              for name, carry in CARRIERS.items()]
    dense = meshes.sample(*new, galerkin_transfer.project(*old, field, *new)[:, 0], line)
    return Profile("a hill carried to another mesh", "x (um)", "field",
                   (*curves, ("dense code", "reference", x, dense),
                    ("before", "exact", x, meshes.sample(*old, field[:, 0], line))))


@case("reprojection-chain", kind="property",
      norm="change of the integral of a steep field over 40 remeshes, and of its square in each, relative; largest "
           "and least nodal value",
      claim="Forty remeshes of a steep field keep its integral to round-off and never raise its square by projection; "
            "by linear interpolation they stay within its bounds and change what it integrates to",
      mutants=("linear-transfer",), ways="1", because="orders 2 and 3 carry masses, not fields: reprojection-growing")
def chain() -> Outcome:
    kept, paper = (_remeshed(carry) for carry in CARRIERS.values())
    count = np.arange(REMESHES + 1)
    profile = Profile("integral of a hill", "remeshes", "over that at the start",
                      (("projection", "ours", count, kept["integral"]),
                       ("interpolation", "ours", count, paper["integral"]),
                       ("kept", "exact", count, np.ones(len(count)))))
    rise = (kept["square"][1:] / kept["square"][:-1]).max()
    return Outcome((at_most("integral by projection", np.abs(kept["integral"] - 1).max(), 1e-12, "round-off"),
                    at_most("square by projection, after over before", rise, 1.0, "a projection makes nothing longer"),
                    at_most("largest value by interpolation", paper["largest"].max(), paper["largest"][0],
                            "weights between 0 and 1"),
                    at_least("least value by interpolation", paper["least"].min(), paper["least"][0],
                             "weights between 0 and 1"),
                    at_least("integral by interpolation, change", abs(paper["integral"][-1] - 1), 0.02,
                             "not conserving: the case would see it")), (), (profile,))


def _remeshed(carry) -> dict[str, np.ndarray]:
    """Integral (over the first), square, least and largest value (k + 1,) of the hill before and after each remesh."""
    grids_in_turn = [pairs.grid(2.0, 1), pairs.grid(2.0, 2), pairs.grid(2.4, 3)]
    mesh, rows = grids_in_turn[0], []
    field = steep(*mesh[0].T)[:, None]
    for k in range(REMESHES + 1):
        rows.append((pairs.integral(mesh, field[:, 0]), pairs.square(mesh, field[:, 0]), field.min(), field.max()))
        new = grids_in_turn[(k + 1) % 3]
        mesh, field = new, carry(*mesh, field, *new)
    found = dict(zip(("integral", "square", "least", "largest"), np.array(rows).T))
    return {**found, "integral": found["integral"] / found["integral"][0]}


FIELDS = {"hill": steep, "cylinder": lambda x, y: 1.0 * (np.hypot(x - 18, y - 10) < 6)}
BOUNDED_CARRIERS = {"bounded": transfer.project_bounded, "projection": transfer.project}


@case("reprojection-bounded-chain", kind="property",
      norm="change of the integral of a hill and of a cylinder (a jump from 0 to 1) over 40 remeshes, relative; by how "
           "much values leave their range, over it; L2 error over that of the unlimited projection",
      claim="Forty remeshes of a steep field keep its integral to round-off and every value in the range of the first; "
            "the unlimited projection leaves it, and is hardly more accurate",
      mutants=("bounded-lumped", "bounded-unlimited", "bounded-one-sided"),
      ways="1", because="orders 2 and 3 carry masses, not fields: reprojection-growing")
def bounded_chain() -> Outcome:
    checks, profiles = [], []
    for name, field in FIELDS.items():
        ours, free = (_bounded_remeshed(carry, field) for carry in BOUNDED_CARRIERS.values())
        checks += [at_most(f"integral, {name}", np.abs(ours["integral"] - 1).max(), 1e-12, "round-off"),
                   at_most(f"outside the range, {name}", ours["outside"].max(), 1e-14, "Zalesak's limiter: round-off"),
                   between(f"error over the projection's, {name}", ours["error"][-1] / free["error"][-1], 0.9, 1.15,
                           "limited at few nodes; the lumped projection alone: over 2"),
                   at_least(f"outside the range by projection, {name}", free["outside"].max(), 0.02,
                            "else there is nothing to limit")]
        count = np.arange(REMESHES + 1)
        profiles.append(Profile(f"values outside their range, {name}", "remeshes", "over the range",
                                (("bounded", "ours", count, ours["outside"]),
                                 ("projection", "ours", count, free["outside"]),
                                 ("none", "exact", count, np.zeros(len(count))))))
    return Outcome(tuple(checks), (), tuple(profiles))


def _bounded_remeshed(carry, field) -> dict[str, np.ndarray]:
    """Integral (over the first), excess of the range (over it) and L2 error (k + 1,) before and after each remesh."""
    meshes = [pairs.grid(2.0, 1), pairs.grid(2.0, 2), pairs.grid(2.4, 3)]
    mesh, rows = meshes[0], []
    values = field(*mesh[0].T)[:, None]
    least, most = values.min(), values.max()
    for k in range(REMESHES + 1):
        rows.append((pairs.integral(mesh, values[:, 0]), max(0.0, least - values.min(), values.max() - most),
                     meshes.l2_error(*mesh, values[:, 0], field)))
        new = meshes[(k + 1) % 3]
        mesh, values = new, carry(*mesh, values, *new)
    integral, outside, error = np.array(rows).T
    return {"integral": integral / integral[0], "outside": outside / (most - least), "error": error}


@case("reprojection-bounded-order", kind="manufactured",
      norm="L2 of a smooth field, interpolated on one mesh and carried to another, mean of three pairs a size; largest "
           "error of a linear field over nine pairs of meshes, over its range",
      claim="The limiter leaves linear fields alone, and a smooth one its second order",
      mutants=("bounded-lumped", "bounds-of-one-piece"),
      ways="1", because="orders 2 and 3 carry masses, not fields: reprojection-growing")
def bounded_order() -> Outcome:
    errors = refine(_carried, SIZES)
    linear = max(_linear(old, new) for _, old, new in pairs.pairs())
    return Outcome((at_most("linear field", linear, 1e-12, "within its bounds at every node: round-off"),),
                   (study("smooth field", SIZES, errors["bounded"], 2, "linear elements: second order",
                          ceiling=2e-3),))


def _carried(size: float) -> dict[str, float]:
    errors = []
    for seed in SEEDS:
        old, new = pairs.grid(size, 2 * seed), pairs.grid(0.9 * size, 2 * seed + 1)
        found = transfer.project_bounded(*old, smooth(*old[0].T)[:, None], *new)
        errors.append(meshes.l2_error(*new, found[:, 0], smooth))
    return {"bounded": float(np.mean(errors))}


def _linear(old: pairs.Grid, new: pairs.Grid) -> float:
    before, wanted = (3 + 2 * mesh[0][:, 0] - mesh[0][:, 1] for mesh in (old, new))
    found = transfer.project_bounded(*old, before[:, None], *new)[:, 0]
    return float(np.abs(found - wanted).max() / np.ptp(wanted))


ROUND_OFF = "round-off; over eight pairs of meshes"
#: Degree of the polynomials that the pieces must integrate: that of the rule in :mod:`verification.problems.meshes`.
DEGREE = 6


@case("reprojection-supermesh", kind="exact",
      norm="largest difference of the area that two triangles share, and between a triangle and its pieces, over the "
           "largest area; largest relative error of the integrals of x^a y^b, a + b up to 6",
      claim="The common pieces of two meshes are shapely's, cover every triangle of both once, and integrate "
            "polynomials exactly, for unrelated meshes, shared nodes and edges, equal meshes and slivers",
      mutants=("clip-two-sides", "fans-cut-short"),
      ways="1", because="orders 2 and 3 carry masses, not fields: reprojection-growing")
def supermesh() -> Outcome:
    return _worst([_pieces(old, new) for _, old, new in pairs.pairs()], 1e-12)


def _worst(rows: list[dict[str, float]], bound: float) -> Outcome:
    """The largest of each number over all pairs of meshes."""
    return Outcome(tuple(at_most(name, max(row[name] for row in rows), bound, ROUND_OFF) for name in rows[0]))


def _pieces(old: pairs.Grid, new: pairs.Grid) -> dict[str, float]:
    """The errors of one pair of meshes."""
    corners, of_old, of_new = transfer.supermesh(*old, *new)
    rim = corners.reshape(-1, 2), np.arange(3 * len(corners)).reshape(-1, 3)
    expected = galerkin_transfer.overlaps(*old, *new)
    shared = np.zeros_like(expected)
    np.add.at(shared, (of_old, of_new), np.abs(triangle_areas(*rim)))
    gaps = [np.abs(shared.sum(axis=1 - axis) - triangle_areas(*mesh)).max() for axis, mesh in ((0, old), (1, new))]
    return {"shared areas": np.abs(shared - expected).max() / expected.max(),
            "triangles less their pieces": max(gaps) / expected.max(), "polynomials": _polynomials(rim)}


def _polynomials(pieces: pairs.Grid) -> float:
    """Largest relative error of the integrals of monomials over the rectangle."""
    where, weight, _ = meshes.quadrature(*pieces)
    length, errors = pairs.ENDS[1], []
    for a in range(DEGREE + 1):
        for b in range(DEGREE + 1 - a):
            exact = length ** (a + 1) / (a + 1) * pairs.WIDTH ** (b + 1) / (b + 1)
            errors.append(abs(np.sum(weight * where[..., 0] ** a * where[..., 1] ** b) / exact - 1))
    return max(errors)


@case("reprojection-projection", kind="cross-code",
      norm="largest difference of nodal values over the field's largest; integrals of the field, of the field times x "
           "and y, and of its square, relative",
      claim="The projection of a random field is that of a dense code on shapely's pieces; it keeps linear fields, "
            "the field's integral and centre, and what it takes from the square is the square of the difference",
      mutants=("lumped-mass", "corners-for-middles", "contributions-lost"),
      ways="1", because="orders 2 and 3 carry masses, not fields: reprojection-growing")
def projection() -> Outcome:
    random = np.random.default_rng(6)
    return _worst([_projected(old, new, random.uniform(0.0, 1.0, len(old[0]))) for _, old, new in pairs.pairs()], 1e-11)


def _projected(old: pairs.Grid, new: pairs.Grid, rough: np.ndarray) -> dict[str, float]:
    """The errors of a rough field, and of a linear one, on one pair of meshes."""
    found = transfer.project(*old, np.column_stack([rough, _plane(old)]), *new)
    expected = galerkin_transfer.project(*old, rough[:, None], *new)[:, 0]
    drifts = {name: abs(pairs.integral(new, found[:, 0], weight) / pairs.integral(old, rough, weight) - 1)
              for name, weight in (("integral", lambda x, y: 1 + 0 * x), ("centre, x", lambda x, y: x),
                                   ("centre, y", lambda x, y: y))}
    return {"against the dense code": np.abs(found[:, 0] - expected).max(),
            "linear field": np.abs(found[:, 1] - _plane(new)).max() / np.ptp(_plane(new)), **drifts,
            "square": _pythagoras(old, rough, new, found[:, 0])}


def _plane(mesh: pairs.Grid) -> np.ndarray:
    return 3 + 2 * mesh[0][:, 0] - mesh[0][:, 1]


def _pythagoras(old: pairs.Grid, before: np.ndarray, new: pairs.Grid, after: np.ndarray) -> float:
    """|X_old|^2 - |X_new|^2 - |X_old - X_new|^2 over the first: zero where the difference is at right angles to X_new.
    """
    corners, of_old, of_new = transfer.supermesh(*old, *new)
    gap = 0.0
    for (points, triangles), field, owner, sign in ((old, before, of_old, 1), (new, after, of_new, -1)):
        nodes = np.repeat(triangles[owner][:, None], 3, axis=1)
        gap = gap + sign * np.sum(transfer.barycentric(points[nodes], corners) * field[nodes], axis=2)
    pieces = corners.reshape(-1, 2), np.arange(gap.size).reshape(-1, 3)
    left = pairs.square(old, before) - pairs.square(new, after) - pairs.square(pieces, gap.ravel())
    return abs(left) / pairs.square(old, before)
