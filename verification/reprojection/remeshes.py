"""A new mesh around the aggregate: what it carries over, and what it starts from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from repro.fem.outline import FREE
from verification import norms
from verification.case import Outcome, Profile, at_least, at_most, case
from verification.convergence import refine, study
from verification.reprojection import bodies

#: A motion that is linear in the place and keeps the lower wall; det = 1.17.
MOTION = np.array([[1.3, 0.2], [0.0, 0.9]])
RADIUS, REFINEMENTS = 20.0, (0.75, 1.3, 2.3, 4.0)
#: Refinements of the meshes before the remesh over that of the new one: three unrelated pairs of meshes a size.
OLD = (0.7, 0.8, 0.9)
TRANSFERS = ("conserving", "bounded", "linear")


@case("reprojection-remesh-linear", kind="exact",
      norm="largest relative difference over all nodes or points of the new mesh",
      claim="Through a remesh of an aggregate that was moved linearly, places at t = 0, densities and pressure that "
            "are linear stay so, and theta is det F times the density over X_m, with every transfer; with higher "
            "orders both kinds are X_m together, and a share of X_I that is linear stays so",
      mutants=("theta-without-density", "kinds-exchanged", "jacobian-inverted", "curved-mass-lost"))
def linear() -> Outcome:
    checks = [at_most(f"{name}, {transfer}", error, 1e-12, "linear fields: round-off")
              for transfer in TRANSFERS for name, error in _carried_errors(1, transfer, KINDS).items()]
    for order in (2, 3):
        checks += [at_most(f"{name}, {bodies.ORDERS[order]}", error, 1e-12, "linear fields: round-off")
                   for name, error in _carried_errors(order, "conserving", SHARES).items()]
    return Outcome(tuple(checks))


#: mg/L, as a + b x + c y, of linear elements; and of both kinds X_m together. The pressure's, over mu_L.
KINDS = {"active": (25000.0, 100.0, -200.0), "inert": (3000.0, -20.0, 50.0)}
SHARES = {"active": (27000.0, 20.0, -50.0), "inert": (3000.0, -20.0, 50.0)}
PRESSURE = (0.1, 0.01, 0.02)


def _plane(coefficients, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    a, b, c = coefficients
    return a + b * x + c * y


def _moved_linearly(order: int, kinds: dict):
    """An aggregate that is no half-disc, moved by MOTION; its arcs are straight, so that linear fields are linear in
    all triangles' own coordinates too."""
    outline = bodies.half_disc(15.0, order=order)
    flat = outline.points * [1.2, 1.0]
    if order > 1:
        flat[1::2] = 0.5 * (flat[::2] + np.roll(flat, -2, axis=0)[::2])
    now = bodies.placed(replace(outline, points=flat, origin=flat), 1.0, order=order)
    points = now.mesh.points.copy()
    points[now.mesh.body] = points[now.mesh.body] @ MOTION.T
    moved = now.moved(points)
    masses = {name: _plane(of, *bodies.places(moved.space)) * moved.space.reaction.dx for name, of in kinds.items()}
    inside = moved.mesh.topology.body_corners
    pressure = np.zeros(moved.mesh.corners)
    pressure[inside] = _plane(PRESSURE, *moved.mesh.points[inside].T)
    return replace(moved, pressure=pressure, **masses)


def _carried_errors(order: int, transfer: str, kinds: dict) -> dict[str, float]:
    """Relative errors of everything that a remesh makes."""
    given = bodies.scene(f'numerics.transfer="{transfer}"', "numerics.refinement=1.2", order=order)
    new = bodies.remeshed(given, _moved_linearly(order, kinds))
    mesh, inside = new.mesh, new.mesh.topology.body_corners
    densities = dict(zip(kinds, bodies.densities(new)))
    exact = {name: _plane(of, *bodies.places(new.space)) for name, of in kinds.items()}
    errors = {name: np.abs(densities[name] / exact[name] - 1).max() for name in kinds}
    there = mesh.points[mesh.body]
    pressure = _plane(PRESSURE, *mesh.points[inside].T)
    whole = sum(exact.values()) / bodies.DENSITY
    if order == 1:
        whole = whole[np.searchsorted(mesh.body, mesh.cells[mesh.biomass]), 0].mean(axis=1, keepdims=True)
    return {**errors, "pressure": np.abs(new.pressure[inside] / pressure - 1).max(),
            "places at t = 0": np.abs(new.body.reference @ MOTION.T - there).max() / np.abs(there).max(),
            "theta": np.abs(new.theta / (np.linalg.det(MOTION) * whole) - 1).max()}


@case("reprojection-remesh-order", kind="manufactured", slow=True,
      norm="L2 of the density on the new mesh less the exact one, and of the density over X_m less one after an update "
           "without growth, relative, means of three pairs of meshes a size; area after that update, relative",
      claim="A remesh carries a smooth density to second order; the next update brings it back to X_m to second order, "
            "and the area to the biomass over X_m exactly",
      mutants=("theta-without-density", "corners-for-middles"))
def order() -> Outcome:
    rows = refine(_density_errors, REFINEMENTS)
    studies = (study("density after the remesh", rows["size"], rows["carried"], 2, "linear elements: second order",
                     ceiling=1.5e-4),
               study("density after the update", rows["size"], rows["restored"], 2,
                     "mean over triangles for value at nodes: second order", ceiling=5e-4))
    return Outcome((at_most("area after the update, over biomass / X_m", rows["area"].max(), 1e-12,
                            "theta sums to the biomass: round-off"),
                    at_least("density over X_m less one, before it", rows["before"].min(), 0.03,
                             "else nothing is restored")), studies, (_along_the_wall(),))


def _hump(x, y):
    """X_A, level across the rim and the wall, 5 % above and below X_m."""
    return bodies.DENSITY * (1 + 0.05 * np.cos(np.pi * np.hypot(x, y) / RADIUS))


def _before_and_after(refinement: float, old: float):
    """A half-disc with that density, and the same after a remesh."""
    before = bodies.placed(bodies.half_disc(RADIUS, refinement), old * refinement, _hump, (-30.0, 30.0))
    return before, bodies.remeshed(bodies.scene(f"numerics.refinement={refinement}", 'pore.length="60 um"'), before)


def _density_errors(refinement: float) -> dict[str, float]:
    """Mean errors of one size."""
    rows = [_errors_of_a_pair(refinement, old) for old in OLD]
    return {name: float(np.mean([row[name] for row in rows])) for name in rows[0]}


def _errors_of_a_pair(refinement: float, old: float) -> dict[str, float]:
    """Errors after the remesh, and after the update that follows it."""
    _, new = _before_and_after(refinement, old)
    after, area = bodies.expanded(bodies.scene(), new, 0.0), new.mass / bodies.DENSITY
    return {"carried": norms.l2_error(*_body(new), _density(new), _hump), "restored": _off(after),
            "before": _off(new), "area": abs(after.outline.area / area - 1),
            "size": np.sqrt(2 * new.mesh.areas[new.mesh.biomass].mean())}


def _body(now):
    """Points and triangles of the aggregate."""
    return now.mesh.points[now.mesh.body], now.mesh.topology.body_cells


def _density(now) -> np.ndarray:
    """(n,) X_A mg/L at the nodes of the aggregate."""
    return bodies.densities(now)[0][:, 0]


def _off(now) -> float:
    """L2 of the density over X_m less one."""
    return norms.l2_error(*_body(now), _density(now), lambda x, y: bodies.DENSITY + 0 * x)


def _along_the_wall() -> Profile:
    """Density along the wall: before the remesh, after it, after the update."""
    old, new = _before_and_after(1.0, 0.8)
    last, x = bodies.expanded(bodies.scene(), new, 0.0), np.linspace(-19.0, 19.0, 191)
    line, dots = np.column_stack([x, 0 * x + 1e-6]), x[::10]
    curves = [(name, "ours", x, norms.sample(*_body(now), _density(now) / bodies.DENSITY, line))
              for name, now in (("before", old), ("remeshed", new), ("updated", last))]
    return Profile("density along the wall", "x (um)", "X_A / X_m",
                   (*curves, ("exact before", "exact", dots, _hump(dots, 0 * dots) / bodies.DENSITY),
                    ("X_m", "reference", x, np.ones(len(x)))))


@case("reprojection-remesh-arc", kind="exact",
      norm="largest relative difference; distance of the interface's nodes from a circle, over that before the update",
      claim="Where a remesh splits edges of what was the seed's arc, the new nodes were on it at t = 0, the polygon "
            "stays what it is, and the next update rounds it",
      mutants=("origin-on-the-chord",))
def arc() -> Outcome:
    coarse, fine = (bodies.scene('aggregate.radius="10 um"', f"numerics.refinement={r}") for r in (0.5, 1.0))
    grown = bodies.expanded(coarse, bodies.seed(10.0, 0.5), 3.0)
    new = bodies.remeshed(fine, grown)
    after = bodies.expanded(fine, new, 0.0)
    free = new.wall == FREE
    added = np.count_nonzero(free) / np.count_nonzero(grown.wall == FREE)
    beside = np.abs(np.hypot(*new.outline.origin[free].T) / 10 - 1).max()
    return Outcome((at_most("beside the arc at t = 0", beside, 1e-12, "the seed's arc: round-off"),
                    at_most("area of the polygon", abs(new.outline.area / grown.outline.area - 1), 1e-12, "round-off"),
                    at_most("unroundness left", _unround(after) / _unround(new), 0.25,
                            "edges half as long: a quarter of the sag"),
                    at_least("interface nodes, after over before", added, 1.9, "split, else nothing is tested")))


def _unround(now) -> float:
    """Spread of the distances of the interface's nodes from the origin, um."""
    return float(np.ptp(np.hypot(*now.outline.points[now.wall == FREE].T)))
