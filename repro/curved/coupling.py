"""One step of the coupling on curved triangles: second order in space and in time; as :mod:`repro.march.coupling`.

The midpoint rule: half a step with the rates of its start gives the shape half way; the rates of flow and substrates
there carry (9)-(10), exactly integrated at constant rates, over the whole step; the aggregate finds its equilibrium
under theta = (M_A + M_I) / X_m, the mesh moves or is made anew.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from repro.curved import elements, growth, outline, pore, transfer
from repro.curved.outline import Arcs
from repro.curved.pore import Pore, seeded, solve
from repro.errors import GrowthError
from repro.fem import geometry
from repro.march.coupling import Attempt, Ledger, PoreEnd, Step, pore_end, rates_of
from repro.march.midpoint import first_contact
from repro.model import kinetics, mesh_motion
from repro.model.pore import Solved
from repro.model.shape import CONTACT_ROUNDS, held_at, middle_of
from repro.model.transport import Concentrations

__all__ = ["attempt", "seeded", "solve"]


@dataclass(frozen=True, eq=False)
class Midpoint:
    """What half a step has found.

    solved: flow and substrates half way; rates: F3 / X_A and F4 / X_A (N,) 1/h there, at the nodes of the mesh at the
    start; change: mean over the aggregate of |rate half way - rate at the start|, 1/h; shape: the aggregate half way,
    with the fluid's nodes where they were.
    """

    solved: Solved
    rates: tuple[np.ndarray, np.ndarray]
    change: float
    shape: Pore


def midpoint(scene, now: Pore, solved: Solved, duration: float) -> Midpoint:
    """Solve for flow and substrates in the shape that half of ``duration`` (h) makes with the rates of its start.

    Where the moved mesh is not acceptable a new one is made, and the rates are carried back to the material's nodes.
    """
    first = rates_of(scene, solved.concentrations)
    half, _, _ = expand(scene, _scaled(now, grown(now, first, duration / 2)))
    there, remeshed = new_mesh(scene, now, half, solved.concentrations)
    found = solve(scene, there)
    rates = rates_of(scene, found.concentrations)
    if remeshed:
        rates = _carried_back(there, half, rates)
    weight = now.mesh.weights()
    apart = np.abs(rates[0] + rates[1] - first[0] - first[1])
    return Midpoint(found, rates, float(weight @ apart / weight.sum()), half)


def _carried_back(there: Pore, half: Pore, rates):
    """Rates at the nodes of a new mesh, interpolated to the aggregate's nodes of the mesh before."""
    nodes, grid = half.mesh.body, there.mesh
    found = np.zeros((len(half.mesh.points), 2))
    found[nodes] = transfer.interpolate(grid.points, grid.cells[grid.biomass], np.column_stack(rates),
                                        half.mesh.points[nodes])
    return tuple(found.T)


def grown(now: Pore, rates, duration: float) -> Pore:
    """(9)-(10) over a step (h) at constant rates F3 / X_A and F4 / X_A (N,), 1/h."""
    active, inert = kinetics.grow(now.active, now.inert, rates[0], rates[1], duration)
    return replace(now, active=active, inert=inert)


def attempt(scene, now: Pore, solved: Solved, duration: float, most: float = np.inf) -> Attempt:
    """A step of ``duration`` (h), if the rates change by no more than ``most`` (1/h) over its first half. Raises
    StageError where it cannot be made."""
    half = midpoint(scene, now, solved, duration)
    if half.change > most:
        return Attempt(None, half.change, None)
    after = grown(now, half.rates, duration)
    expanded, iterations, gap = expand(scene, _ahead(now, half.shape, after))
    if leaves := pore_end(scene, expanded, 0.1):
        raise PoreEnd(f"{leaves} in the step from t = {now.time:g} h")
    guess = _extrapolated(solved.concentrations, half.solved.concentrations)
    new, remeshed = new_mesh(scene, now, expanded, guess)
    flows = {key: tuple(duration * getattr(flux, key) for flux in half.solved.fluxes)
             for key in ("supplied", "out", "consumed")}
    density = scene.kinetics.maximum_density
    ledger = Ledger(now.time, now.time + duration, **flows, stored=(0.0, 0.0),
                    biomass_before=density * now.mesh.area(), biomass_made=density * (after.mass() - now.mass()),
                    biomass_after=density * new.mesh.area())
    return Attempt(Step(new, (now, solved), ledger, remeshed, iterations), half.change,
                   first_contact(scene, now, expanded, gap))


def _extrapolated(start: Concentrations, half: Concentrations) -> Concentrations:
    """A first guess of the substrates at the end: as much change again as the first half of the step has made. Where
    that takes one below zero, what they are half way; where the mesh there is another, what they are at the start."""
    if len(half.acceptor) != len(start.acceptor):
        return start
    acceptor, donor = 2 * half.acceptor - start.acceptor, 2 * half.donor - start.donor
    return replace(start, acceptor=acceptor, donor=donor) if min(acceptor.min(), donor.min()) >= 0 else half


def _scaled(now: Pore, after: Pore) -> Pore:
    """A first guess of the shape: all lengths grow alike, while the aggregate is free."""
    if now.contact:
        return after
    factor = np.sqrt(after.mass() / now.mass())
    return _placed(after, now.mesh.points * factor)


def _ahead(now: Pore, half: Pore, after: Pore) -> Pore:
    """A first guess of the shape: as much again as half the step has made, while contact stays as it is."""
    if (half.wall != now.wall).any():
        return after
    push = 2 * half.pressure - now.pressure
    return _placed(replace(after, pressure=push), 2 * half.mesh.points - now.mesh.points)


def _placed(after: Pore, points: np.ndarray) -> Pore:
    """The pore with its aggregate's nodes at guessed places, unless they turn a triangle over."""
    body = after.mesh.body
    guess = after.mesh.points.copy()
    guess[body] = points[body]
    there = elements.jacobian(guess[after.mesh.cells[after.mesh.biomass]])
    return replace(after, mesh=after.mesh.moved(guess)) if elements.determinant(there).min() > 0 else after


def expand(scene, now: Pore) -> tuple[Pore, int, float]:
    """The aggregate in equilibrium under its theta, films closed (2.3.3); Newton's iterations; and the least distance
    (um) to the opposite wall before films closed.

    It starts from the places and the pressure of ``now``; the fluid's nodes stay where they were. Raises GrowthError
    where no equilibrium is found or contact does not rest.
    """
    nodes, rim = now.mesh.body, now.mesh.body_loop
    corners = nodes[nodes < now.mesh.corners]
    theta, found, iterations, gaps = (now.active + now.inert)[nodes], now, 0, []
    for _ in range(CONTACT_ROUNDS):
        held = held_at(len(nodes), rim, found.wall, found.fixed)
        start = found.mesh.points[nodes]
        target = start.copy()
        for side, height in ((geometry.BOTTOM, 0.0), (geometry.TOP, scene.pore.width)):
            target[rim[found.wall == side], 1] = height
        rest = growth.equilibrium(growth.of(now, held, scene.numerics.jacobian == "reused"), theta, start,
                                  found.pressure[corners], target)
        points, pressure = now.mesh.points.copy(), now.pressure.copy()
        points[nodes], pressure[corners] = rest.position, rest.pressure
        found, iterations = replace(found, mesh=now.mesh.moved(points), pressure=pressure), iterations + rest.iterations
        gaps.append(scene.pore.width - found.outline.thickness)
        joins = outline.closing(found.outline, scene.pore.width, scene.growth.minimum_film,
                                scene.growth.minimum_contact_angle)
        if not joins.any():
            break
        found = replace(found, wall=np.where(joins != geometry.FREE, joins, found.wall))
    else:
        raise GrowthError(f"the contact surfaces still change after {CONTACT_ROUNDS} rounds; "
                          "try a shorter growth.time_step")
    top = found.wall == geometry.TOP
    if top.any() and not found.fixed[top].any():
        found = replace(found, fixed=found.fixed | _corner_near(found.outline, middle_of(found.outline, geometry.TOP)))
    return found, iterations, gaps[0]


def _corner_near(shape: Arcs, chosen: np.ndarray) -> np.ndarray:
    """The chosen node, or the corner before it where it is a middle."""
    index = int(np.flatnonzero(chosen)[0])
    found = np.zeros(len(chosen), bool)
    found[index - index % 2] = True
    return found


def new_mesh(scene, now: Pore, expanded: Pore, state: Concentrations) -> tuple[Pore, bool]:
    """The mesh moved with the aggregate, or a new one where the paper's criteria (3.1, 3.5) ask for it."""
    shape, width = expanded.outline, scene.pore.width
    stale = geometry.extent_too_short(shape, now.mesh.ends, width, scene.pore.length) or (
        expanded.wall != now.wall).any() or geometry.too_coarse(outline.corners(shape), pore.sizing(scene))
    if not stale:
        moved = follow(scene, now, expanded)
        if moved.acceptable():
            return replace(expanded, mesh=moved, concentrations=state), False
    return remesh(scene, now, expanded, state), True


def follow(scene, now: Pore, expanded: Pore):
    """The mesh with its corners moved as in :mod:`repro.model.mesh_motion`, its fluid edges straight but at the interface."""
    grid, straight = now.mesh, now.mesh.straight
    corners = mesh_motion.move(straight, expanded.mesh.points[straight.body], scene.numerics.mesh_compressibility,
                               scene.numerics.flow_stabilisation)
    points = grid.with_middles(corners)
    points[grid.body] = expanded.mesh.points[grid.body]
    return grid.moved(points)


def remesh(scene, now: Pore, expanded: Pore, state: Concentrations) -> Pore:
    """A new mesh around the aggregate, which is its own reference: the expansion restarts at one, so that its mass is
    X_m times its area; places at t = 0 and the share of X_I in the biomass are carried over, its mass conserved."""
    grid, shape = pore.generate(scene, expanded.outline)
    old, count, nodes = expanded.mesh, len(grid.points), grid.body
    total = expanded.active + expanded.inert
    share = np.divide(expanded.inert, total, where=total > 0, out=np.zeros(len(total)))
    at = transfer.located(old.points, old.cells[old.biomass], grid.points[nodes])
    carried = at.quadratic(np.column_stack([expanded.origin, share]))
    origin, inert, active = grid.points.copy(), np.zeros(count), np.zeros(count)
    origin[nodes], inert[nodes] = carried[:, :2], np.clip(carried[:, 2], 0.0, 1.0)
    inert = _conserved(inert, grid.weights(), expanded.inert_mass())
    origin[grid.loop] = shape.origin
    active[nodes] = 1 - inert[nodes]
    pressure = np.zeros(grid.corners)
    inside = nodes < grid.corners
    pressure[nodes[inside]] = at.linear(expanded.pressure)[inside]
    return replace(expanded, mesh=grid, wall=shape.wall, fixed=shape.fixed, origin=transfer.unfolded(grid, origin),
                   reference=grid.points, active=active, inert=inert, pressure=pressure,
                   concentrations=_carried_substrates(scene, now, grid, state))


def _conserved(share: np.ndarray, weight: np.ndarray, wanted: float) -> np.ndarray:
    """Shares (N,) with the integral ``wanted``: share (1 - share) is added as often as that takes, so that they stay
    between zero and one."""
    room = float(weight @ (share * (1 - share)))
    lacking = wanted - float(weight @ share)
    return share + lacking / room * share * (1 - share) if abs(lacking) < room else share


def _carried_substrates(scene, now: Pore, grid, state: Concentrations) -> Concentrations:
    """C_A and C_D on a new mesh, a first guess: interpolated, the supply beyond the old ends."""
    old = now.mesh
    found = np.tile([s.supply for s in (scene.substrates.acceptor, scene.substrates.donor)], (len(grid.points), 1))
    x = grid.points[:, 0]
    within = (x >= old.ends[0]) & (x <= old.ends[1])
    fields = np.column_stack([state.acceptor, state.donor])
    found[within] = transfer.interpolate(old.points, old.cells, fields, grid.points[within])
    return Concentrations(*np.maximum(found, 0.0).T)
