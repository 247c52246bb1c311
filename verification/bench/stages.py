"""Flow, transport, growth and transfer, each alone: error against time.

The pore of flow and transport is a half-disc of biomass that leaves a film of 10 um.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial
from types import SimpleNamespace

import numpy as np

from reference import quadratic_growth, taylor_hood
from reference.whole_run import Pore as Constants
from reference.whole_run_grid import grid
from reference.whole_run_pore import Section
from repro.fem import transfer
from repro.fem.outline import FREE
from repro.fem.space import Space
from repro.model import growth, pore, transport
from repro.model.contact import constrained
from repro.model.kinetics import Sink
from repro.scene import parse_scene
from verification.bench.record import part, series
from verification.problems import bodies, meshes
from verification.problems.bodies import HalfCylinder

WIDTH, LENGTH = 50.0, 600.0
RADIUS, RATIO = 40.0, 2000.0
PAPER = "linear elements (paper)"
ORDER_2, QUADRATIC = "order 2 on curved triangles (fast, accurate)", "scikit-fem: quadratic elements"
#: Methods of this package by the order of their elements, and what a scene says of them.
OURS = {PAPER: (1, {"preset": "paper"}), "linear with a bubble": (1, {"preset": "paper", "flow_element": "bubble"}),
        ORDER_2: (2, {"preset": "accurate"}), "order 3 on curved triangles": (3, {"preset": "accurate"})}
#: The meshed part ends 1.5 W from the aggregate (3.1), for all methods; m/d.
ENDS, SPEED = (-RADIUS - 1.5 * WIDTH, RADIUS + 1.5 * WIDTH), 2.9


def half_disc(**numerics):
    """The pore with Table 1's substrates and a mean velocity, solved as ``numerics`` say."""
    tables = {"pore": {"width": f"{WIDTH} um", "length": f"{LENGTH} um"}, "aggregate": {"radius": f"{RADIUS} um"},
              "flow": {"mean_velocity": f"{SPEED} m/day", "viscosity_ratio": RATIO}, "substrates": {},
              "numerics": numerics}
    return parse_scene(tables, "half disc", "half_disc.toml")


def constants() -> Constants:
    """Table 1, as the references take it."""
    return Constants(width=WIDTH, length=LENGTH, radius=RADIUS, ratio=RATIO)


def curved_mesh(rings: int) -> Section:
    """The reference's curved mesh of the half-disc."""
    made = topology(rings)
    return Section(made, made.around(RADIUS * made.seed, WIDTH, ENDS), WIDTH, ENDS)


@cache
def topology(rings: int):
    """The reference's triangles, which know no place."""
    return grid(rings)


def outside_loss() -> float:
    """Loss (1/um) of the pore beyond the mesh, at mean velocity one: 12 L / W^2."""
    return 12 * (LENGTH - (ENDS[1] - ENDS[0])) / WIDTH**2


def largest(found, wanted, scale) -> float:
    """Largest difference over the scale."""
    return float(np.max(np.abs(np.asarray(found) - wanted) / scale))


#: Runs of a job that count.
FLOW_REPEATS = TRANSFER_REPEATS = (3, 1)
TRANSPORT_REPEATS = GROWTH_REPEATS = (5, 1)
REFINEMENT, RINGS = "refinement {:g}", "{} rings"
#: Rings of the reference, the last one being it; refinements of linear and of curved elements; of scikit-fem's; rings.
#: Here as below: of the part, and of its quick version.
FLOW_SIZES = ((16, 24), (0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8), (0.15, 0.25, 0.45, 0.7, 1.0, 1.6), (0, 1, 2),
              (3, 4, 6, 8)), ((6, 9), (0.35, 0.7), (0.25, 0.45), (0,), (3,))


def flow_part(quick: bool) -> dict:
    """Flow around a half-disc of 40 um in a pore of 50 um, lambda = 2000: error of the head loss of the whole pore."""
    rings, linear, quadratic, skfem, sections = FLOW_SIZES[quick]
    coarse, truth = map(flow_reference, rings)
    jobs = series("order 2 on straight triangles", REFINEMENT, linear[:-2], _flow_ours, truth=truth, order=2,
                  preset="paper")
    for name, (order, numerics) in OURS.items():
        jobs |= series(name, REFINEMENT, linear if order == 1 else quadratic, _flow_ours, truth=truth, order=order,
                       **numerics)
    jobs |= series("scikit-fem: Taylor-Hood, two pressures", "{} refinements", skfem, _taylor_hood, truth=truth)
    jobs |= series("scikit-fem: Taylor-Hood, rings", RINGS, sections, _flow_section, truth=truth)
    change = abs(coarse / truth - 1)
    found = part("Flow: half-disc of 40 um in a pore of 50 um, lambda = 2000; mesh, assembly and solution",
                 "head loss of the whole pore, relative",
                 f"Taylor-Hood on curved triangles, {rings[1]} rings: {truth:.9g} 1/um; from {rings[0]} to {rings[1]} "
                 f"rings it changes by {change:.1e}", jobs, FLOW_REPEATS[quick], reference_change=change)
    found["lines"] += [{"method": name, "points": [], "failed": [{
        "label": "Stokes flow with a jump of viscosity", "reason": "has no incompressible flow of this kind"}]}
        for name in ("fipy", "py-pde")]
    return found


def flow_reference(rings: int) -> float:
    """Head loss at mean velocity one, 1/um: pressures of their own on both sides of the interface."""
    return curved_mesh(rings).flow(RATIO).loss + outside_loss()


def _flow_ours(refinement: float, truth: float, order: int, **numerics) -> dict:
    scene = half_disc(refinement=refinement, **numerics)
    mesh = pore.seeded(scene).mesh
    found = pore.solve_flow(scene, Space(mesh, order))
    nu = scene.flow.kinematic_viscosity / scene.flow.gravity
    return _flow_judged(truth, found.head_loss / scene.flow.mean_velocity / nu, nodes=len(mesh.points))


def _taylor_hood(refinements: int, truth: float) -> dict:
    channel = taylor_hood.half_disc(WIDTH, ENDS, RADIUS, refinements, corner=2 + refinements)
    return _flow_judged(truth, taylor_hood.stokes(channel, RATIO).loss + outside_loss())


def _flow_section(rings: int, truth: float) -> dict:
    return _flow_judged(truth, flow_reference(rings))


def _flow_judged(truth: float, loss: float, **more) -> dict:
    return {"error": abs(loss / truth - 1), **more}


#: Rings of the reference; refinements; rings.
TRANSPORT_SIZES = ((16, 24), (0.5, 0.7, 1.0, 1.4, 2.0, 2.8), (0.15, 0.25, 0.45, 0.7, 1.0), (3, 4, 6, 8)), (
    (6, 9), (0.5, 0.7), (0.25,), (3,))


def transport_part(quick: bool) -> dict:
    """Both substrates around the half-disc of the flow part, dual Monod uptake: error of the effluents over the supply.

    Flow of the same elements on the same mesh is found beforehand, and neither it nor the mesh is counted: error is of
    both flow and transport, time of transport alone.
    """
    rings, linear, quadratic, sections = TRANSPORT_SIZES[quick]
    coarse, truth = (_effluents(*prepared(each)) for each in rings)
    jobs = {}
    for name, (order, numerics) in OURS.items():
        for size in linear if order == 1 else quadratic:
            jobs[name, REFINEMENT.format(size)] = _transport_ours(truth, order, refinement=size, **numerics)
    for each in sections:
        jobs[QUADRATIC, RINGS.format(each)] = partial(_carried_by, truth, *prepared(each))
    change = largest(coarse, truth, supply())
    return part("Transport: dual Monod uptake around a half-disc of 40 um in a pore of 50 um, 2.9 m/d; assembly and "
                "solution", "effluents over the supply, the larger error",
                f"quadratic elements on curved triangles, {rings[1]} rings: {truth[0]:.8f} and {truth[1]:.8f} mg/L; "
                f"from {rings[0]} rings on they change by {change:.1e} of the supply", jobs, TRANSPORT_REPEATS[quick],
                reference_change=change)


def supply() -> np.ndarray:
    """(2,) mg/L."""
    return np.array(constants().supply)


def prepared(rings: int):
    """(section, its flow)."""
    section = curved_mesh(rings)
    return section, section.flow(RATIO)


def _effluents(section, flow) -> np.ndarray:
    given = constants()
    operators = section.operators(given, SPEED / 24e-6, flow)
    start = np.multiply.outer(given.supply, np.ones(section.whole.N))
    fields = section.steady(operators, np.full(section.body.dx.shape, given.density), given.rates, start)
    return section.effluents(flow, fields)


def _carried_by(truth, section, flow) -> dict:
    return {"error": largest(_effluents(section, flow), truth, supply())}


def _transport_ours(truth, order: int, **numerics):
    """A job whose mesh and flow are there."""
    scene = half_disc(**numerics)
    now = pore.seeded(scene)
    space = Space(now.mesh, order)
    return partial(_solved, truth, scene, space, pore.solve_flow(scene, space))


def _solved(truth, scene, space, flow) -> dict:
    space = Space(replace(space.mesh, topology=replace(space.mesh.topology)), space.order)  # nothing is known of it
    problem = transport.problem(space, flow, scene.substrates, scene.kinetics)
    sink = Sink(scene.kinetics.maximum_density * space.reaction.dx)
    found = transport.fluxes(problem, sink, transport.steady(problem, sink))
    return {"error": largest([flux.effluent for flux in found], truth, supply()), "nodes": len(space.mesh.points)}


#: The body at the start of the step, and at its end.
BEFORE, AFTER = HalfCylinder(8.0, 24.0), HalfCylinder(12.0, 36.0)
#: Refinements, and rings.
GROWTH_SIZES = ((0.5, 0.7, 1.0, 1.4, 2.0, 2.8), (0.15, 0.25, 0.45, 0.7, 1.0, 1.6), (2, 4, 8, 16)), (
    (0.5, 1.0), (0.25, 0.45), (4,))


def growth_part(quick: bool) -> dict:
    """One growth step: a half-disc that slides on a wall goes from one uneven theta(R) to a half more, in closed form.

    theta = a + c (R / R_0)^2 from 12 to 36; every method starts from the exact places and pressure under two thirds of
    it.
    """
    linear, quadratic, rings = GROWTH_SIZES[quick]
    jobs = {**series(PAPER, REFINEMENT, linear, _growth_ours, preset="paper"),
            **series(ORDER_2, REFINEMENT, quadratic, _growth_ours, preset="accurate"),
            **series(QUADRATIC, RINGS, rings, _skfem)}
    return part("Growth: a step of an aggregate with theta from 12 to 36; assembly and solution",
                "places of the outline over the radius, the largest error",
                "closed form of the growing half-cylinder", jobs, GROWTH_REPEATS[quick])


def _growth_judged(found: np.ndarray, points: np.ndarray, rim: np.ndarray) -> dict:
    """Largest distance of the outline's nodes from where they should be, over the radius; places (n, 2) now and at
    t = 0."""
    wanted = AFTER.place(*points[rim].T)
    error = np.hypot(*(found[rim] - wanted).T).max() / np.hypot(*wanted.T).max()
    return {"error": float(error), "nodes": len(points)}


@cache
def _seeded(refinement: float, preset: str):
    now = pore.seeded(half_disc(preset=preset, refinement=refinement))
    return now, constrained(len(now.mesh.body), now.mesh.topology.body_loop, now.wall, now.fixed)


def _growth_ours(refinement: float, preset: str):
    now, held = _seeded(refinement, preset)
    shape, points = now.body.shape, now.body.reference * bodies.RADIUS / RADIUS
    given = bodies.Supported(growth.Body(shape, points), held)  # nothing is known of it
    start, push = BEFORE.place(*points.T), BEFORE.pressure(*points[: shape.corners].T)
    found = growth.equilibrium(given.body, given.field(AFTER.theta), start, push, held, start)
    return partial(_growth_judged, found.position, points, now.mesh.topology.body_loop[now.wall == FREE])


@cache
def _growth_meshed(rings: int):
    return quadratic_growth.half_disc(bodies.RADIUS, rings)


#: The exact state at the start of the step, asked for as that of a solution on another mesh is.
START = SimpleNamespace(at=lambda x, y: (BEFORE.place(x, y), BEFORE.pressure(x, y)))


def _skfem(rings: int):
    mesh = _growth_meshed(rings)
    found = quadratic_growth.grow(mesh, AFTER.theta, AFTER.outer, start=START)
    points = mesh.doflocs.T
    rim = np.isclose(np.hypot(*points.T), bodies.RADIUS, rtol=1e-9)
    return partial(_growth_judged, found.place.T, points, rim)


#: um; the front's place along x and its width.
TRANSFER_ENDS, TRANSFER_WIDTH = (0.0, 40.0), 25.0
FRONT, STEEP = 20.0, 3.0
#: Remeshes; um.
TRANSFER_SIZES = (20, (4.0, 2.8, 2.0, 1.4, 1.0), (8.0, 5.6, 4.0, 2.8, 2.0)), (3, (4.0, 2.8), (5.6,))


def transfer_part(quick: bool) -> dict:
    """A field with a front, carried through twenty unrelated meshes of one rectangle: its error, and its total's drift.

    Meshes and what is worked out once for them are made beforehand; a time is of all twenty transfers.
    """
    count, sizes, quadratic = TRANSFER_SIZES[quick]
    jobs = series("quadratic interpolation (fast, accurate)", SIZE, quadratic, _carried, count=count, order=2,
                  carry=transfer.interpolated)
    ways = {"conserving projection": transfer.project, "bounded conserving projection": transfer.project_bounded,
            f"linear interpolation, {PAPER}": transfer.interpolated}
    for name, way in ways.items():
        jobs |= series(name, SIZE, sizes, _carried, count=count, order=1, carry=way)
    return part(f"Transfer: a front through {count} remeshes",
                "L2 of the field in the end, relative; drift: of its total, relative", "the field itself", jobs,
                TRANSFER_REPEATS[quick])


SIZE = "{:g} um"


def transfer_exact(x, y):
    """From 1 to 2 across a slanted front."""
    return 1.5 + 0.5 * np.tanh((x + 0.3 * y - FRONT) / STEEP)


@cache
def _transfer_meshed(size: float, which: int, order: int) -> Space:
    straight = meshes.channel(TRANSFER_ENDS, TRANSFER_WIDTH, size, lambda x, y: x < np.inf, seed=which)
    return meshes.space_on(straight, order)


def _carried(size: float, count: int, order: int, carry):
    """The field through so many meshes, by ``carry(points, triangles, field, new points, new triangles)``."""
    old = _transfer_meshed(size, 0, order)
    field = transfer_exact(*old.points.T)[:, None]
    start = _weighed(old, field)
    for which in range(1, count + 1):
        new = _transfer_meshed(size, which, order)
        field = carry(old.points, old.cells, field, new.points, new.cells)
        old = new
    return lambda: {"error": meshes.field_error(old, field[:, 0], transfer_exact), "nodes": len(old.points),
                    "drift": abs(_weighed(old, field) / start - 1),
                    "beyond": float(max(1.0 - field.min(), field.max() - 2.0, 0.0))}


def _weighed(space: Space, field: np.ndarray) -> float:
    """Integral of a field."""
    return float(np.sum(space.at.dx * space.at_points(field[:, 0])))
