"""Taylor-Hood flow on curved triangles: exact where the flow is a parabola, scikit-fem's flow around a half-disc."""

from __future__ import annotations

from functools import cache

import numpy as np

from reference import poiseuille, taylor_hood
from repro.curved import flow, pore, transfer
from repro.curved.mesh import curved
from repro.scene import parse_scene
from verification import meshes
from verification.case import Outcome, Profile, at_most, between, case
from verification.convergence import refine, study

WIDTH, ENDS, LENGTH = 50.0, (-60.0, 70.0), 600.0
ROUND_OFF = "round-off: the elements hold a parabola and a linear head"


@cache
def plug():
    """A channel with biomass from wall to wall for |x| < 20."""
    return curved(meshes.channel(ENDS, WIDTH, 8.0, lambda x, y: np.abs(x) < 20, across=(-20.0, 20.0), seed=3), None)


def drive(ratio: float):
    """A mean velocity, as a scene gives it."""
    return parse_scene({"flow": {"mean_velocity": "2.9 m/day", "viscosity_ratio": ratio}}, "drive", "drive.toml").flow


@case("flow-curved-poiseuille", kind="exact",
      norm="largest difference over the largest velocity; relative difference of losses",
      claim="A clean channel, and one with a plug of biomass of 2000 times the viscosity, have the parabola at every "
            "node and the loss (6) of each part, on any mesh; the work of the inlet is that loss",
      mutants=("curved-viscosity-swapped", "curved-loss-per-width", "curved-inlet-parabola", "curved-whole-pore-twice"))
def channels() -> Outcome:
    grid, checks = plug(), []
    for ratio in (1.0, 2000.0):
        given = drive(ratio)
        found = flow.solve(grid, given, LENGTH)
        u = poiseuille.velocity(grid.points[:, 1], WIDTH, given.mean_velocity)
        nu, part = given.kinematic_viscosity / given.gravity, ENDS[1] - ENDS[0]
        lost = [poiseuille.head_loss(a, WIDTH, given.mean_velocity, nu) for a in (part - 40, 40 * ratio, LENGTH - part)]
        ends = found.head[grid.inlet[::2]].mean() - found.head[grid.outlet[::2]].mean()
        told = f"lambda = {ratio:g}"
        checks += [at_most(f"u_x, {told}", np.abs(found.velocity[:, 0] - u).max() / u.max(), 1e-10, ROUND_OFF),
                   at_most(f"u_y, {told}", np.abs(found.velocity[:, 1]).max() / u.max(), 1e-10, ROUND_OFF),
                   at_most(f"loss as work, {told}", abs(found.meshed_loss / sum(lost[:2]) - 1), 1e-10, ROUND_OFF),
                   at_most(f"loss of the whole pore, {told}", abs(found.head_loss / sum(lost) - 1), 1e-10, ROUND_OFF),
                   at_most(f"difference of heads, {told}", abs(ends / sum(lost[:2]) - 1), 1e-10, ROUND_OFF)]
    return Outcome(tuple(checks))


RADIUS, REFINEMENTS = 20.0, (0.3, 0.6, 1.2, 2.4)
#: Where the velocity's order is judged: on coarser meshes what is smooth, of third order, still counts (orders of 1.5).
FINE = (0.85, 1.3, 2.0, 3.0)


@cache
def _half_disc(refinement: float):
    tables = {"pore": {"width": f"{WIDTH} um"}, "aggregate": {"radius": f"{RADIUS} um"}, "flow": {"head": "1e-3 cm"},
              "numerics": {"preset": "accurate", "refinement": refinement}}
    return pore.seeded(parse_scene(tables, "half disc", "half_disc.toml")).mesh


@cache
def _reference(ratio: float):
    return taylor_hood.stokes(taylor_hood.half_disc(WIDTH, _half_disc(REFINEMENTS[0]).ends, RADIUS, 2), ratio)


def _there(grid, velocity, where) -> np.ndarray:
    return transfer.interpolate(grid.points, grid.cells, velocity, where)


def _errors(refinement: float, ratio: float) -> dict[str, float]:
    """Over the whole field, weighted by areas, and of the loss."""
    grid, trusted = _half_disc(refinement), _reference(ratio)
    velocity, _, loss = flow.unit_flow(grid, ratio)
    inside = np.clip(trusted.points, grid.points.min(axis=0), grid.points.max(axis=0))
    apart = trusted.areas @ np.sum((_there(grid, velocity, inside) - trusted.velocity) ** 2, axis=1)
    whole = trusted.areas @ np.sum(trusted.velocity**2, axis=1)
    return {"size": 1 / np.sqrt(len(grid.cells)), "velocity": float(np.sqrt(apart / whole)),
            "loss": abs(loss / trusted.loss - 1)}


@case("flow-curved-half-disc", kind="cross-code", slow=True,
      norm="velocity at the corners of the reference's triangles, root mean square, and the loss, relative",
      claim="Around a half-disc of biomass the whole velocity field and the loss are scikit-fem's, which has a "
            "pressure of its own on either side: to first order for lambda = 10, under 0.1 % for lambda = 2000",
      mutants=("curved-viscosity-swapped", "curved-straight-divergence"))
def half_disc() -> Outcome:
    errors, fine = (refine(_errors, series, 10.0) for series in (REFINEMENTS, FINE))
    why = "the pressure jumps at the interface [E2], ours is continuous: 1/2 in energy, which is twice that in the loss"
    studies = (study("loss, lambda = 10", errors["size"], errors["loss"], 1, why, ceiling=5e-4),
               study("velocity, lambda = 10", fine["size"], fine["velocity"], 1, why + ", and in L2 by duality",
                     ceiling=5e-4))
    near = [_errors(refinement, 2000.0) for refinement in REFINEMENTS]
    told = "0.1 %, as between codes; biomass all but stands still, and its pressure hardly matters"
    checks = [at_most(f"{name}, lambda = 2000, refinement {r:g}", row[name], bound, told)
              for r, row, bound in ((REFINEMENTS[1], near[1], 1e-3), (REFINEMENTS[3], near[3], 1e-4))
              for name in ("velocity", "loss")]
    return Outcome(tuple(checks), studies, (_profile(2000.0),))


def _profile(ratio: float) -> Profile:
    grid, trusted = _half_disc(REFINEMENTS[1]), _reference(ratio)
    line = np.abs(trusted.points[:, 0]) < 1e-6
    y = trusted.points[line, 1]
    order = np.argsort(y)
    ours = _there(grid, flow.unit_flow(grid, ratio)[0], np.column_stack([0 * y, y]))[:, 0]
    return Profile(f"above the middle, lambda = {ratio:g}", "y (um)", "u_x / u_ave",
                   (("ours", "ours", y[order], ours[order]),
                    ("scikit-fem", "reference", y[order], trusted.velocity[line, 0][order])))


@case("flow-curved-flux", kind="property", norm="flux through sections over that of the inlet",
      claim="What comes in goes through every section: exactly at the outlet, and as well as the mesh resolves it "
            "across the aggregate",
      mutants=("curved-straight-divergence",))
def flux() -> Outcome:
    grid = _half_disc(1.2)
    velocity = flow.unit_flow(grid, 2000.0)[0]
    y = (np.arange(2000) + 0.5) / 2000 * WIDTH
    through = {x: _there(grid, velocity, np.column_stack([np.full(len(y), x), y]))[:, 0].mean()
               for x in (-40.0, -20.0, -7.0, 0.0, 13.0, 33.0)}
    heights, u = grid.points[grid.outlet, 1], velocity[grid.outlet, 0]
    simpson = np.sum(np.diff(heights[::2]) * (u[:-2:2] + 4 * u[1:-1:2] + u[2::2])) / 6 / WIDTH
    why = "div u vanishes in the mean only of each linear function: third order"
    return Outcome((between("outlet", simpson, 1 - 1e-11, 1 + 1e-11, "q = 1: round-off"),
                    *(between(f"x = {x:g} um", value, 1 - 1e-4, 1 + 1e-4, why) for x, value in through.items())))
