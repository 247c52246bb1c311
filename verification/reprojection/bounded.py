"""The projection limited by flux-corrected transport: conserves like the projection, bounded like interpolation."""

from __future__ import annotations

import numpy as np

from repro.fem import transfer
from verification import norms
from verification.case import Outcome, Profile, at_least, at_most, between, case
from verification.convergence import refine, study
from verification.reprojection import grids, orders

FIELDS = {"hill": orders.steep, "cylinder": lambda x, y: 1.0 * (np.hypot(x - 18, y - 10) < 6)}
CARRIERS = {"bounded": transfer.project_bounded, "projection": transfer.project}


@case("reprojection-bounded-chain", kind="property",
      norm="change of the integral of a hill and of a cylinder (a jump from 0 to 1) over 40 remeshes, relative; by how "
           "much values leave their range, over it; L2 error over that of the unlimited projection",
      claim="Forty remeshes of a steep field keep its integral to round-off and every value in the range of the first; "
            "the unlimited projection leaves it, and is hardly more accurate",
      mutants=("bounded-lumped", "bounded-unlimited", "bounded-one-sided"))
def chain() -> Outcome:
    checks, profiles = [], []
    for name, field in FIELDS.items():
        ours, free = (_remeshed(carry, field) for carry in CARRIERS.values())
        checks += [at_most(f"integral, {name}", np.abs(ours["integral"] - 1).max(), 1e-12, "round-off"),
                   at_most(f"outside the range, {name}", ours["outside"].max(), 1e-14, "Zalesak's limiter: round-off"),
                   between(f"error over the projection's, {name}", ours["error"][-1] / free["error"][-1], 0.9, 1.15,
                           "limited at few nodes; the lumped projection alone: over 2"),
                   at_least(f"outside the range by projection, {name}", free["outside"].max(), 0.02,
                            "else there is nothing to limit")]
        count = np.arange(orders.REMESHES + 1)
        profiles.append(Profile(f"values outside their range, {name}", "remeshes", "over the range",
                                (("bounded", "ours", count, ours["outside"]),
                                 ("projection", "ours", count, free["outside"]),
                                 ("none", "exact", count, np.zeros(len(count))))))
    return Outcome(tuple(checks), (), tuple(profiles))


def _remeshed(carry, field) -> dict[str, np.ndarray]:
    """Integral (over the first), excess of the range (over it) and L2 error (k + 1,) before and after each remesh."""
    meshes = [grids.grid(2.0, 1), grids.grid(2.0, 2), grids.grid(2.4, 3)]
    mesh, rows = meshes[0], []
    values = field(*mesh[0].T)[:, None]
    least, most = values.min(), values.max()
    for k in range(orders.REMESHES + 1):
        rows.append((grids.integral(mesh, values[:, 0]), max(0.0, least - values.min(), values.max() - most),
                     norms.l2_error(*mesh, values[:, 0], field)))
        new = meshes[(k + 1) % 3]
        mesh, values = new, carry(*mesh, values, *new)
    integral, outside, error = np.array(rows).T
    return {"integral": integral / integral[0], "outside": outside / (most - least), "error": error}


@case("reprojection-bounded-order", kind="manufactured",
      norm="L2 of a smooth field, interpolated on one mesh and carried to another, mean of three pairs a size; largest "
           "error of a linear field over nine pairs of meshes, over its range",
      claim="The limiter leaves linear fields alone, and a smooth one its second order",
      mutants=("bounded-lumped", "bounds-of-one-piece"))
def order() -> Outcome:
    errors = refine(_carried, orders.SIZES)
    linear = max(_linear(old, new) for _, old, new in grids.pairs())
    return Outcome((at_most("linear field", linear, 1e-12, "within its bounds at every node: round-off"),),
                   (study("smooth field", orders.SIZES, errors["bounded"], 2, "linear elements: second order",
                          ceiling=2e-3),))


def _carried(size: float) -> dict[str, float]:
    errors = []
    for seed in orders.SEEDS:
        old, new = grids.grid(size, 2 * seed), grids.grid(0.9 * size, 2 * seed + 1)
        found = transfer.project_bounded(*old, orders.smooth(*old[0].T)[:, None], *new)
        errors.append(norms.l2_error(*new, found[:, 0], orders.smooth))
    return {"bounded": float(np.mean(errors))}


def _linear(old: grids.Grid, new: grids.Grid) -> float:
    before, wanted = (3 + 2 * mesh[0][:, 0] - mesh[0][:, 1] for mesh in (old, new))
    found = transfer.project_bounded(*old, before[:, None], *new)[:, 0]
    return float(np.abs(found - wanted).max() / np.ptp(wanted))
