"""What a transfer costs in accuracy: one transfer of a smooth field, and forty of a steep one."""

from __future__ import annotations

import numpy as np

from reference import galerkin_transfer
from repro.fem import transfer
from repro.fem.mesh import Mesh
from repro.fem.space import Space
from verification import norms
from verification.case import Outcome, Profile, at_least, at_most, case
from verification.convergence import refine, study
from verification.reprojection import grids

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
      mutants=("corners-for-middles", "nearest-corner"))
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
    where = np.random.default_rng(8).uniform((0.0, 0.0), (grids.ENDS[1], grids.WIDTH), (1000, 2))
    errors = {f"{k}": [] for k in LOCATED}
    for seed in SEEDS:
        points, triangles = grids.grid(size, seed)
        mesh = Mesh.of(points, triangles, np.zeros(len(triangles), bool), np.empty(0, int), grids.WIDTH, grids.ENDS)
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
        old, new = grids.grid(size, 2 * seed), grids.grid(0.9 * size, 2 * seed + 1)
        for name, carry in CARRIERS.items():
            found = carry(*old, smooth(*old[0].T)[:, None], *new)
            errors[name].append(norms.l2_error(*new, found[:, 0], smooth))
    return {name: float(np.mean(row)) for name, row in errors.items()}


def _across_the_hill() -> Profile:
    """A steep field along a line, carried by both transfers and by the dense code."""
    old, new = grids.grid(5.0, 1), grids.grid(4.0, 2)
    field, x = steep(*old[0].T)[:, None], np.linspace(*grids.ENDS, 201)[1:-1]
    line = np.column_stack([x, 0 * x + 10.0])
    curves = [(name, "ours", x, norms.sample(*new, carry(*old, field, *new)[:, 0], line))
              for name, carry in CARRIERS.items()]
    dense = norms.sample(*new, galerkin_transfer.project(*old, field, *new)[:, 0], line)
    return Profile("a hill carried to another mesh", "x (um)", "field",
                   (*curves, ("dense code", "reference", x, dense),
                    ("before", "exact", x, norms.sample(*old, field[:, 0], line))))


@case("reprojection-chain", kind="property",
      norm="change of the integral of a steep field over 40 remeshes, and of its square in each, relative; largest "
           "and least nodal value",
      claim="Forty remeshes of a steep field keep its integral to round-off and never raise its square by projection; "
            "by linear interpolation they stay within its bounds and change what it integrates to",
      mutants=("linear-transfer",))
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
    grids_in_turn = [grids.grid(2.0, 1), grids.grid(2.0, 2), grids.grid(2.4, 3)]
    mesh, rows = grids_in_turn[0], []
    field = steep(*mesh[0].T)[:, None]
    for k in range(REMESHES + 1):
        rows.append((grids.integral(mesh, field[:, 0]), grids.square(mesh, field[:, 0]), field.min(), field.max()))
        new = grids_in_turn[(k + 1) % 3]
        mesh, field = new, carry(*mesh, field, *new)
    found = dict(zip(("integral", "square", "least", "largest"), np.array(rows).T))
    return {**found, "integral": found["integral"] / found["integral"][0]}
