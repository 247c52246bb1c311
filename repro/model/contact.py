"""Contact with the walls, closing films, and the grown aggregate's new shape (2.3.3, 3.4)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from repro.errors import GrowthError
from repro.fem.outline import BOTTOM, FREE, TOP, Outline
from repro.model import growth, traction
from repro.model.pore import Pore
from repro.scene import Growth, Scene, needed

#: Rounds in which closing films may change the contact surfaces within one step.
CONTACT_ROUNDS = 60
#: Rounds of shape and fluid forces.
FORCE_ROUNDS = 12
#: The largest move of a node in the last of them over the aggregate's thickness.
FORCE_REST = 1e-8


def expand(scene: Scene, grown: Pore, theta: np.ndarray,
           guess: Pore | None = None) -> tuple[Pore, int, float]:
    """The aggregate in its new shape under theta (t, q); Newton's iterations; and the least
    distance (um) to the opposite wall before films closed.

    guess: a pore with the shape and pressure from which the search starts, those of ``grown`` by
    default. With fluid forces, shape and flow are sought in turn until both agree. The fluid's
    nodes stay where they were. Raises GrowthError where no equilibrium is found, contact does not
    rest, or shape and flow do not agree.
    """
    start = grown if guess is None else guess
    if needed(scene.growth, "[growth]").fluid_forces == "neglected":
        return _at_rest(scene, grown, theta, start, None)
    around = traction.surroundings(scene, grown, grown)
    last = grown
    iterations = 0
    for count in range(FORCE_ROUNDS):
        forces = traction.forces(scene, around, last)
        found, used, gap = _at_rest(scene, grown, theta, start, forces)
        moved = np.abs(found.mesh.points - last.mesh.points).max()
        iterations += used
        if moved <= FORCE_REST * found.boundary.thickness:
            return found, iterations, gap
        if count == 0 or (found.wall != last.wall).any():
            around = traction.surroundings(scene, grown, found)
        last = found
    raise GrowthError(f"the fluid's forces and the shape do not agree after {FORCE_ROUNDS} rounds, "
                      f"a node still moves by {moved:.2g} um: the aggregate is too soft for this "
                      "flow; try a shorter growth.time_step, a larger growth.shear_modulus, or "
                      'growth.fluid_forces = "neglected"')


def _at_rest(scene: Scene, grown: Pore, theta: np.ndarray, start: Pore,
             forces: np.ndarray | None) -> tuple[Pore, int, float]:
    """The new shape under nodal forces (n, 2) um, over mu_L, that stay as they are (None: none).

    After each equilibrium, films and wedges that are too thin close, and the equilibrium is sought
    again until none is.
    """
    keys = needed(scene.growth, "[growth]")
    width = scene.pore.width
    nodes = grown.mesh.body
    inside = grown.mesh.topology.body_corners
    body, target_J = _strained_from(keys, grown, theta)
    last = None if keys.new_biomass == "stressed" else body.reference
    found = replace(grown, space=start.space, pressure=start.pressure, theta=theta,
                    fixed=_fixed_points(scene, grown), last=last)
    iterations = 0
    gaps: list[float] = []
    for _ in range(CONTACT_ROUNDS):
        held, target = _constraints(found, width)
        rest = growth.equilibrium(body, target_J, found.mesh.points[nodes], found.pressure[inside],
                                  held, target, forces=forces,
                                  last=None if gaps else grown.mesh.points[nodes],
                                  reused=scene.numerics.jacobian == "reused")
        found = _placed(grown, found, rest)
        iterations += rest.iterations
        gaps.append(width - found.boundary.thickness)
        joins = closing(found.boundary, width, keys.minimum_film, keys.minimum_contact_angle)
        if not joins.any():
            return replace(found, fixed=_with_new_surface(found.boundary)), iterations, gaps[0]
        found = replace(found, wall=np.where(joins != FREE, joins, found.wall))
    raise GrowthError(f"the contact surfaces still change after {CONTACT_ROUNDS} rounds; "
                      "try a shorter growth.time_step")


def _strained_from(keys: Growth, grown: Pore, theta: np.ndarray) -> tuple[growth.Body, np.ndarray]:
    """The configuration from which strain counts, that of t = 0 or the present one (section 5), and
    the expansion since then: over J, so that what the constraint has left of J - theta is worked
    off, and the area does not drift away from the mass."""
    if keys.new_biomass == "stressed":
        return grown.body, theta
    position = grown.mesh.points[grown.mesh.body]
    present = replace(grown.body, reference=position)
    return present, theta / grown.body.strained(position).J


def _placed(grown: Pore, found: Pore, rest: growth.Equilibrium) -> Pore:
    """The pore with its aggregate at rest, the fluid's nodes where they were."""
    points = grown.mesh.points.copy()
    points[grown.mesh.body] = rest.position
    pressure = grown.pressure.copy()
    pressure[grown.mesh.topology.body_corners] = rest.pressure
    return replace(found.moved(points), pressure=pressure)


def _constraints(now: Pore, width: float) -> tuple[np.ndarray, np.ndarray]:
    """(n, 2) True where a coordinate is prescribed: x at fixed points, y on the walls (2.3.3); and
    (n, 2) um, its prescribed value."""
    rim = now.mesh.topology.body_loop
    position = now.mesh.points[now.mesh.body]
    target = position.copy()
    target[rim[now.wall == BOTTOM], 1] = 0.0
    target[rim[now.wall == TOP], 1] = width
    return constrained(len(position), rim, now.wall, now.fixed), target


def constrained(count: int, rim: np.ndarray, wall: np.ndarray, fixed: np.ndarray) -> np.ndarray:
    """(count, 2) True where a coordinate is prescribed: x at fixed points, y on the walls (2.3.3).

    rim: (M,) the boundary's nodes among all; wall, fixed: (M,), as those of an outline.
    """
    held = np.zeros((count, 2), bool)
    held[rim[fixed], 0] = True
    held[rim[wall != FREE], 1] = True
    return held


def _fixed_points(scene: Scene, grown: Pore) -> np.ndarray:
    """(M,) fixed points: those of before, or the present middles of the contact surfaces."""
    if scene.numerics.fixed_point == "kept":
        return grown.fixed
    return middle_of(grown.boundary, BOTTOM) | middle_of(grown.boundary, TOP)


def _with_new_surface(outline: Outline) -> np.ndarray:
    """Fixed points (M,), with the middle of the upper contact surface when that has just formed."""
    top = outline.wall == TOP
    if top.any() and not outline.fixed[top].any():
        return outline.fixed | middle_of(outline, TOP)
    return outline.fixed


def middle_of(outline: Outline, wall: int) -> np.ndarray:
    """(M,) True at the node nearest to the middle of the contact surface with a wall; the corner
    before it where that is the middle of an arc."""
    on = outline.wall == wall
    x = outline.points[:, 0]
    chosen = np.zeros(len(on), bool)
    if on.any():
        middle = 0.5 * (x[on].min() + x[on].max())
        index = int(np.flatnonzero(on)[np.argmin(np.abs(x[on] - middle))])
        chosen[index - index % outline.geometry] = True
    return chosen


def closing(outline: Outline, width: float, film: float, angle: float) -> np.ndarray:
    """(M,) wall that each node must join next, FREE where none (2.3.3): with straight edges all
    nodes that are too near, with arcs the next one beside each contact line.

    Contact of arcs with the opposite wall begins over the film's least thickness to both sides of
    the highest place, as the paper's nodes make it: a single point could not hold the aggregate,
    whatever is enforced there. From then on each contact line that must advance does so by one arc:
    what joins pulls its neighbours along, and where it ends must not depend on how many are taken
    at once. A middle joins with both corners of its arc, never alone.
    """
    joins = closing_nodes(outline, width, film, angle)
    if outline.geometry == 1 or (joins == FREE).all():
        return joins
    if (outline.wall == TOP).any() or not (joins == TOP).any():
        joins = _next_arcs(outline, joins)
    else:
        x, y = outline.points.T
        joins[(np.abs(x - outline.highest) <= film) & (width - y < 2 * film)] = TOP
    return _with_middles(outline, joins, width)


def _next_arcs(outline: Outline, joins: np.ndarray) -> np.ndarray:
    """Of the nodes that must join, the first arc beside each contact line."""
    first = np.full(len(joins), FREE)
    for wall in (BOTTOM, TOP):
        for line, step in contact_lines(outline, wall):
            beside = (line + step * np.arange(1, 3)) % len(joins)
            if joins[beside[0]] == wall:
                first[beside] = np.where(outline.wall[beside] == FREE, wall, FREE)
    return first


def _with_middles(outline: Outline, joins: np.ndarray, width: float) -> np.ndarray:
    """Middles join where both corners of their arc are on the wall; a middle that is too near joins
    with its nearer corner."""
    gap = np.minimum(outline.points[:, 1], width - outline.points[:, 1])
    for middle in np.flatnonzero(joins[1::2] != FREE) * 2 + 1:
        ends = np.array([middle - 1, (middle + 1) % len(joins)])
        ends = ends[outline.wall[ends] == FREE]
        if len(ends):
            joins[ends[np.argmin(gap[ends])]] = joins[middle]
    joins[1::2] = FREE
    wall = np.where(joins != FREE, joins, outline.wall)
    both = wall[::2] == np.roll(wall, -2)[::2]
    joins[1::2] = np.where(both & (outline.wall[1::2] == FREE), wall[::2], FREE)
    return joins


def closing_nodes(outline: Outline, width: float, film: float, angle: float) -> np.ndarray:
    """(M,) wall that each node must join next: FREE where none (2.3.3).

    A layer of fluid thinner than ``film`` to the opposite wall closes, and so does a wedge of fluid
    beside a contact surface whose angle is under ``angle``. Beside contact both say: the gap must
    not be less than the smaller of film and tan(angle) times the distance from the contact line.
    Nodes between closing ones close too: no fluid is trapped.
    """
    joins = np.full(len(outline.points), FREE)
    for wall, gap in ((BOTTOM, outline.points[:, 1]), (TOP, width - outline.points[:, 1])):
        lines = contact_lines(outline, wall)
        if wall == TOP and not lines:
            joins[(outline.wall == FREE) & (gap < film)] = TOP
        for line, step in lines:
            joins[_closing_run(outline, gap, line, step, film, np.tan(angle))] = wall
    return joins


def contact_lines(outline: Outline, wall: int) -> list[tuple[int, int]]:
    """(node, direction) of each end of a contact surface: the next node in that direction is off
    the wall."""
    on = outline.wall == wall
    if not on.any():
        return []
    last = on & ~np.append(on[1:], on[0])
    first = on & ~np.append(on[-1], on[:-1])
    forward = [(int(i), 1) for i in np.flatnonzero(last)]
    return forward + [(int(i), -1) for i in np.flatnonzero(first)]


def _closing_run(outline: Outline, gap: np.ndarray, line: int, step: int, film: float,
                 slope: float) -> np.ndarray:
    """Free nodes from a contact line outwards, up to the last with too little fluid between it and
    the wall."""
    count = len(gap)
    walk = (line + step * np.arange(1, count)) % count
    reach = np.flatnonzero(outline.wall[walk] != FREE)[0]
    other = walk[reach]
    walk = walk[:reach]
    x = outline.points[:, 0]
    gaps = gap[walk]
    apart = x[walk] - x[line]
    # Free nodes end at the other line; where that is on the same wall, the nearer one takes a node.
    nearer = np.abs(apart) <= np.abs(x[walk] - x[other])
    if outline.wall[other] != outline.wall[line]:
        nearer = np.ones(len(walk), bool)
    along = np.sign(x[line] - x[line - step]) * apart
    thin = (nearer & (gaps < 0)) | (gaps < np.minimum(film, slope * along))
    return walk[: np.flatnonzero(thin)[-1] + 1] if thin.any() else walk[:0]
