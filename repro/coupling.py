"""The sequential coupling (section 2): flow -> substrates -> biomass -> shape -> moved mesh, once every 12 min.

One step: (9)-(10) are integrated over the step in the present geometry, theta grows by (28)-(29), the aggregate finds its
new equilibrium, films that have become too thin close (2.3.3), the biomass is reprojected (34), the mesh moves (35)
or, by the paper's criteria (3.1, 3.5), is made anew.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from repro import gear, geometry, growth, kinetics, mesh, mesh_motion, pore, reprojection, transport
from repro.errors import GrowthError, MeshError, SimulationError, StageError
from repro.pore import Pore, Solved
from repro.transport import Concentrations

#: Rounds in which closing films may change the contact surfaces within one step.
CONTACT_ROUNDS = 60


@dataclass(frozen=True)
class Ledger:
    """Mass balance of one step, per depth (um2 mg/L = 1e-12 g/m): both substrates, then the biomass."""

    start: float
    end: float
    supplied: tuple[float, float]
    out: tuple[float, float]
    consumed: tuple[float, float]
    stored: tuple[float, float]
    biomass_before: float
    biomass_made: float
    biomass_after: float


@dataclass(frozen=True, eq=False)
class Instant:
    """The pore at ``pore.time`` with what is solved in its geometry, and how it came there.

    before: the pore and its solution at the end of the last step, grown but not yet expanded (Plate 1), None at t = 0;
    ledgers, remeshes, iterations: of the steps since the last instant.
    """

    pore: Pore
    solved: Solved
    before: tuple[Pore, Solved] | None
    ledgers: tuple[Ledger, ...]
    remeshes: int
    iterations: dict[str, int]


class PoreEnd(Exception):
    """The aggregate has reached an end of the pore: the run is over."""


def schedule(scene) -> tuple[list[float], set[float]]:
    """Times (h) at which steps end, and those of them that are reported; t = 0 first."""
    if scene.growth is None:
        return [0.0], {0.0}
    end, step = scene.growth.end, scene.growth.time_step
    grid = [round(k * step, 9) for k in range(int(np.ceil(round(end / step, 9))))]
    wanted = scene.output.times
    reported = {0.0, *(grid if wanted is None else (round(t, 9) for t in wanted))}
    if wanted is None:
        reported.add(round(end, 9))
    times = sorted({0.0, round(end, 9), *grid, *reported})
    return times, reported


def simulate(scene) -> Iterator[Instant]:
    """Run a scene; yields an Instant at t = 0 and at each reported time.

    Raises SimulationError where a stage fails; ends early, after a last Instant, by raising PoreEnd where the aggregate
    reaches an end of the pore.
    """
    times, reported = schedule(scene)
    with _stopping(0.0):
        now = pore.seeded(scene)
        solved = pore.solve(scene, now)
    now = replace(now, concentrations=solved.concentrations)
    yield Instant(now, solved, None, (), 0, _newton_counts(solved))
    ledgers, remeshes, counts = [], 0, {}
    for time in times[1:]:
        with _stopping(now.time):
            done = step(scene, now, solved, time - now.time)
            now, before = replace(done.pore, time=time), done.before
            solved = pore.solve(scene, now)
        now = replace(now, concentrations=solved.concentrations)
        ledgers.append(done.ledger)
        remeshes += done.remeshed
        counts = _added(counts, {"growth": done.iterations}, _newton_counts(solved))
        over = _at_pore_end(scene, now)
        if time in reported or over:
            yield Instant(now, solved, before, tuple(ledgers), remeshes, counts)
            ledgers, remeshes, counts = [], 0, {}
        if over:
            raise PoreEnd(over)


@contextmanager
def _stopping(time: float):
    """Floating-point errors stop the run; a stage's failure is told with the simulated time of its step."""
    try:
        with np.errstate(all="raise", under="ignore"):
            yield
    except StageError as error:
        raise SimulationError(f"stopped in the step from t = {time:g} h, in {error.stage}: {error}") from error
    except FloatingPointError as error:
        raise SimulationError(f"stopped in the step from t = {time:g} h by a floating-point error ({error}); "
                              "try a shorter growth.time_step or a larger numerics.refinement") from error


def _newton_counts(solved: Solved) -> dict[str, int]:
    return {"transport": solved.concentrations.iterations if solved.concentrations else 0}


def _added(*counts: dict[str, int]) -> dict[str, int]:
    keys = {key for count in counts for key in count}
    return {key: sum(count.get(key, 0) for count in counts) for key in sorted(keys)}


def _at_pore_end(scene, now: Pore) -> str:
    """Why the run is over, empty while it is not."""
    outline, end = now.outline, scene.pore.length / 2
    near = scene.pore.width / geometry.ACROSS_PORE
    if outline.upstream < near - end or outline.downstream > end - near:
        side = "upstream" if outline.upstream < near - end else "downstream"
        return f"the aggregate reaches the pore's {side} end at t = {now.time:g} h"
    return ""


@dataclass(frozen=True, eq=False)
class Step:
    """What one step made: the new pore, the pore and its solution before it expanded, the ledger, and counts."""

    pore: Pore
    before: tuple[Pore, Solved]
    ledger: Ledger
    remeshed: bool
    iterations: int


def step(scene, now: Pore, solved: Solved, duration: float) -> Step:
    """One step (h): biomass, shape, mesh."""
    grown, end, flows = make_biomass(scene, now, solved, duration)
    made = float(np.sum(solved.problem.body * (grown.active + grown.inert - now.active - now.inert)))
    theta = now.theta * (1 + _increase(now, grown) / scene.kinetics.maximum_density)
    shape, wall, fixed, iterations = expand(scene, grown, theta)
    expanded = _reprojected(grown, shape, theta, wall, fixed)
    solved = replace(solved, concentrations=end)
    after, remeshed = new_mesh(scene, now, expanded, solved)
    ledger = Ledger(now.time, now.time + duration, *flows, _mass(now), made, _mass(after))
    return Step(after, (replace(grown, time=now.time + duration), solved), ledger, remeshed, iterations)


def _mass(now: Pore) -> float:
    return float(np.sum(now.mesh.lumped(now.mesh.biomass) * (now.active + now.inert)))


def make_biomass(scene, now: Pore, solved: Solved, duration: float):
    """(9)-(10) over a step (h) in a fixed geometry: the grown pore, concentrations at its end, substrate flows.

    Quasi-steady: Heun's method on the rates, each biomass exponential in its rate; the second rates are those of the
    steady concentrations over the grown biomass. Gear: the transient of the paper.
    """
    if scene.numerics.transport == "gear":
        return gear.make_biomass(scene, now, solved, duration)
    first = _rates(scene, solved.concentrations)
    guess = kinetics.grow(now.active, now.inert, *first, duration)
    end = transport.steady(solved.problem, guess[0], solved.concentrations)
    mean = [(a + b) / 2 for a, b in zip(first, _rates(scene, end))]
    active, inert = kinetics.grow(now.active, now.inert, *mean, duration)
    pairs = zip(transport.fluxes(solved.problem, now.active, solved.concentrations),
                transport.fluxes(solved.problem, guess[0], end))
    means = [[duration * (getattr(a, key) + getattr(b, key)) / 2 for key in ("supplied", "out", "consumed")]
             for a, b in pairs]
    flows = (*(tuple(row) for row in zip(*means)), (0.0, 0.0))
    return replace(now, active=active, inert=inert), end, flows


def _rates(scene, state: Concentrations):
    return (kinetics.growth_rate(state.acceptor, state.donor, scene.substrates, scene.kinetics),
            kinetics.inert_rate(state.acceptor, scene.substrates, scene.kinetics))


def _increase(now: Pore, grown: Pore) -> np.ndarray:
    """(29): mean over the nodes of each biomass triangle of the increase of X_A + X_I (mg/L)."""
    more = grown.active + grown.inert - now.active - now.inert
    return more[now.mesh.triangles[now.mesh.biomass]].mean(axis=1)


def expand(scene, grown: Pore, theta: np.ndarray):
    """New places (n, 2) of the aggregate's nodes with pressures (n,), contact (M,), fixed points (M,), iterations.

    After each equilibrium, films and wedges that are too thin close, and the equilibrium is sought again until none is.
    """
    nodes, rim, triangles = grown.mesh.body, *_body_numbering(grown.mesh)
    reference, target = grown.origin[nodes], theta
    if scene.growth.new_biomass == "stress_free":
        reference, target = grown.mesh.points[nodes], theta / grown.theta
    start, push = grown.mesh.points[nodes], grown.pressure[nodes]
    wall, fixed, iterations = grown.wall.copy(), _fixed_points(scene, grown), 0
    for _ in range(CONTACT_ROUNDS):
        body = growth.Body(reference, triangles, _held(len(nodes), rim, wall, fixed), grown.mesh.topology)
        prescribed = _prescribed(start, rim, wall, scene.pore.width)
        found = growth.equilibrium(body, target, start, push, prescribed)
        start, push, iterations = found.position, found.pressure, iterations + found.iterations
        outline = geometry.Outline(start[rim], wall, fixed, grown.origin[grown.mesh.loop])
        joins = geometry.closing_nodes(outline, scene.pore.width, scene.growth.minimum_film,
                                       scene.growth.minimum_contact_angle)
        if not joins.any():
            return (start, push), wall, _with_new_surface(outline), iterations
        wall = np.where(joins != geometry.FREE, joins, wall)
    raise GrowthError(f"the contact surfaces still change after {CONTACT_ROUNDS} rounds; "
                             "try a shorter growth.time_step")


def _body_numbering(grid: mesh.PoreMesh) -> tuple[np.ndarray, np.ndarray]:
    """Loop (M,) and biomass triangles (t, 3) in the numbering of ``grid.body``."""
    local = np.full(len(grid.points), -1)
    local[grid.body] = np.arange(len(grid.body))
    return local[grid.loop], local[grid.triangles[grid.biomass]]


def _held(count: int, rim: np.ndarray, wall: np.ndarray, fixed: np.ndarray) -> np.ndarray:
    """(n, 2): x is held at fixed points, y on the walls (2.3.3)."""
    held = np.zeros((count, 2), bool)
    held[rim[fixed], 0] = True
    held[rim[wall != geometry.FREE], 1] = True
    return held


def _prescribed(position: np.ndarray, rim: np.ndarray, wall: np.ndarray, width: float) -> np.ndarray:
    """(n, 2): the present places, with y on the wall that each node touches."""
    target = position.copy()
    target[rim[wall == geometry.BOTTOM], 1] = 0.0
    target[rim[wall == geometry.TOP], 1] = width
    return target


def _fixed_points(scene, grown: Pore) -> np.ndarray:
    """(M,) fixed points: those of before, or the present middles of the contact surfaces."""
    if scene.numerics.fixed_point == "kept":
        return grown.fixed
    fixed = np.zeros(len(grown.wall), bool)
    for wall in (geometry.BOTTOM, geometry.TOP):
        fixed |= _middle(grown.outline, wall)
    return fixed


def _with_new_surface(outline: geometry.Outline) -> np.ndarray:
    """Fixed points (M,), with the middle of the upper contact surface when that has just formed."""
    top = outline.wall == geometry.TOP
    if top.any() and not outline.fixed[top].any():
        return outline.fixed | _middle(outline, geometry.TOP)
    return outline.fixed


def _middle(outline: geometry.Outline, wall: int) -> np.ndarray:
    """(M,) True at the node nearest to the middle of the contact surface with a wall."""
    on, x = outline.wall == wall, outline.points[:, 0]
    chosen = np.zeros(len(on), bool)
    if on.any():
        middle = 0.5 * (x[on].min() + x[on].max())
        chosen[np.flatnonzero(on)[np.argmin(np.abs(x[on] - middle))]] = True
    return chosen


def _reprojected(grown: Pore, shape, theta, wall, fixed) -> Pore:
    """The aggregate in its new shape, with X_A and X_I reprojected by (34); the fluid's nodes where they were."""
    grid = grown.mesh
    points, pressure = grid.points.copy(), grown.pressure.copy()
    points[grid.body], pressure[grid.body] = shape
    moved = grid.moved(points)
    before, after = grid.lumped(grid.biomass), moved.lumped(grid.biomass)
    return replace(grown, mesh=moved, active=reprojection.reproject(grown.active, before, after),
                   inert=reprojection.reproject(grown.inert, before, after), theta=theta, pressure=pressure, wall=wall,
                   fixed=fixed)


def new_mesh(scene, now: Pore, expanded: Pore, solved: Solved) -> tuple[Pore, bool]:
    """The mesh moved with the aggregate, or a new one: where the extent is too short, contact has changed, or the
    mesh would not be acceptable (3.1, 3.5). Says whether it is new."""
    outline, width = expanded.outline, scene.pore.width
    stale = (geometry.extent_too_short(outline, now.mesh.ends, width, scene.pore.length)
             or (expanded.wall != now.wall).any() or _too_coarse(scene, outline))
    if not stale:
        moved = now.mesh.moved(mesh_motion.move(now.mesh, expanded.mesh.points[now.mesh.body],
                                                scene.numerics.mesh_compressibility, scene.numerics.flow_stabilisation))
        if moved.acceptable():
            return replace(expanded, mesh=moved, concentrations=solved.concentrations), False
    return remesh(scene, now, expanded, solved), True


def _too_coarse(scene, outline: geometry.Outline) -> bool:
    """Is an interface edge twice longer than a new mesh would have it?"""
    sizes = geometry.interface_sizes(outline, scene.pore.width, scene.numerics.refinement, pore.film(scene))
    edge = np.linalg.norm(np.roll(outline.points, -1, axis=0) - outline.points, axis=1)
    wanted = 0.5 * (sizes + np.roll(sizes, -1))
    return bool((outline.interface_edges() & (edge > 2 * geometry.SPLIT * wanted)).any())


def remesh(scene, now: Pore, expanded: Pore, solved: Solved) -> Pore:
    """A new mesh around the aggregate with the extent of 3.1; fields, and places at t = 0, are carried over.

    theta restarts as J times the density over X_m: the expansion that brings each triangle's density back to X_m, so
    that the error of the constraint is worked off at the next update and does not accumulate [E7].
    """
    outline, numerics = expanded.outline, scene.numerics
    ends = geometry.meshed_extent(outline, scene.pore.width, scene.pore.length, numerics.extent == "full")
    grid, outline = mesh.generate(outline, ends, scene.pore.width, numerics.refinement, pore.film(scene))
    _, triangles = _body_numbering(expanded.mesh)
    body = expanded.mesh.points[expanded.mesh.body]
    carried = _carried(numerics.transfer, body, triangles, expanded, grid)
    carried["origin"][grid.loop] = outline.origin
    theta = _expansion(grid, carried["origin"]) * _density(scene, grid, carried)
    return replace(expanded, mesh=grid, wall=outline.wall, fixed=outline.fixed, theta=theta,
                   concentrations=_carried_substrates(scene, now, grid, solved), **carried)


def _carried(transfer: str, body, triangles, expanded: Pore, grid: mesh.PoreMesh) -> dict[str, np.ndarray]:
    """X_A and X_I by the chosen transfer; places at t = 0 and pressure by linear interpolation."""
    old = expanded.mesh.body
    new, (_, new_triangles) = grid.points[grid.body], _body_numbering(grid)
    biomass = np.column_stack([expanded.active, expanded.inert])[old]
    others = np.column_stack([expanded.origin, expanded.pressure])[old]
    if transfer == "conserving":
        masses = reprojection.project(body, triangles, biomass, new, new_triangles)
    else:
        masses = reprojection.interpolate(body, triangles, biomass, new)
    others = reprojection.interpolate(body, triangles, others, new)
    count = len(grid.points)
    active, inert, pressure, origin = np.zeros(count), np.zeros(count), np.zeros(count), grid.points.copy()
    active[grid.body], inert[grid.body] = masses.T
    origin[grid.body], pressure[grid.body] = others[:, :2], others[:, 2]
    return {"active": active, "inert": inert, "origin": origin, "pressure": pressure}


def _expansion(grid: mesh.PoreMesh, origin: np.ndarray) -> np.ndarray:
    """J (t,) of each biomass triangle: its area over the area it had at t = 0 (3.5)."""
    reference = mesh.triangle_areas(origin, grid.triangles[grid.biomass])
    if reference.min() <= 0:
        worst = grid.points[grid.triangles[grid.biomass][np.argmin(reference)]].mean(axis=0)
        raise MeshError(f"after a remesh the places at t = 0 fold near x = {worst[0]:.4g}, y = {worst[1]:.4g} um; "
                             "try a larger numerics.refinement")
    return grid.areas[grid.biomass] / reference


def _density(scene, grid: mesh.PoreMesh, carried) -> np.ndarray:
    """(t,) mean of (X_A + X_I) / X_m over the nodes of each biomass triangle."""
    total = (carried["active"] + carried["inert"]) / scene.kinetics.maximum_density
    return total[grid.triangles[grid.biomass]].mean(axis=1)


def _carried_substrates(scene, now: Pore, grid: mesh.PoreMesh, solved: Solved) -> Concentrations:
    """C_A and C_D on a new mesh: interpolated; beyond the old ends (26) upstream, constant downstream, and the supply
    where nothing flows."""
    old, state, speed = now.mesh, solved.concentrations, solved.flow.mean_velocity if solved.flow else 0.0
    fields = reprojection.interpolate(old.points, old.triangles, np.column_stack([state.acceptor, state.donor]), grid.points)
    x = grid.points[:, 0]
    before, beyond = x < old.ends[0], (x < old.ends[0]) | (x > old.ends[1])
    for column, substrate in enumerate((scene.substrates.acceptor, scene.substrates.donor)):
        if speed == 0:
            fields[beyond, column] = substrate.supply
        else:
            fall = np.exp(speed * (x[before] - old.ends[0]) / substrate.diffusivity)
            fields[before, column] = substrate.supply - (substrate.supply - fields[before, column]) * fall
    return Concentrations(fields[:, 0], fields[:, 1])
