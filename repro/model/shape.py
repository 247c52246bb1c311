"""The aggregate's new shape after it has grown: equilibrium, contact with the walls, closing films (2.3.3, 3.4)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from repro.errors import GrowthError
from repro.fem import geometry, reprojection
from repro.model import growth, traction
from repro.model.pore import Pore

#: Rounds in which closing films may change the contact surfaces within one step.
CONTACT_ROUNDS = 60
#: Rounds of shape and fluid forces, and the largest move of a node in the last of them over the aggregate's thickness.
FORCE_ROUNDS, FORCE_REST = 12, 1e-8


def expand(scene, grown: Pore, theta: np.ndarray) -> tuple[Pore, int, float]:
    """The aggregate in its new shape under theta (t,), X_A and X_I reprojected by (34); Newton's iterations; and the
    least distance (um) to the opposite wall before films closed.

    With fluid forces, shape and flow are sought in turn until both agree. The fluid's nodes stay where they were.
    Raises GrowthError where no equilibrium is found, contact does not rest, or shape and flow do not agree.
    """
    if scene.growth.fluid_forces == "neglected":
        return _at_rest(scene, grown, theta, None)
    around, last, iterations = traction.surroundings(scene, grown, grown), grown, 0
    for count in range(FORCE_ROUNDS):
        found, used, gap = _at_rest(scene, grown, theta, traction.forces(scene, around, last))
        moved, iterations = np.abs(found.mesh.points - last.mesh.points).max(), iterations + used
        if moved <= FORCE_REST * found.outline.thickness:
            return found, iterations, gap
        if count == 0 or (found.wall != last.wall).any():
            around = traction.surroundings(scene, grown, found)
        last = found
    raise GrowthError(f"the fluid's forces and the shape do not agree after {FORCE_ROUNDS} rounds, a node still moves "
                      f"by {moved:.2g} um: the aggregate is too soft for this flow; try a shorter growth.time_step, a "
                      'larger growth.shear_modulus, or growth.fluid_forces = "neglected"')


def _at_rest(scene, grown: Pore, theta: np.ndarray, forces: np.ndarray | None) -> tuple[Pore, int, float]:
    """The new shape under nodal forces (n, 2) um, over mu_L, that stay as they are (None: none).

    After each equilibrium, films and wedges that are too thin close, and the equilibrium is sought again until none is.
    """
    nodes, rim, triangles = grown.mesh.body, grown.mesh.body_loop, grown.mesh.body_triangles
    reference, target = grown.origin[nodes], theta
    if scene.growth.new_biomass == "stress_free":
        reference, target = grown.mesh.points[nodes], theta / grown.theta
    start, push = grown.mesh.points[nodes], grown.pressure[nodes]
    wall, fixed, iterations, gaps = grown.wall.copy(), _fixed_points(scene, grown), 0, []
    for _ in range(CONTACT_ROUNDS):
        body = growth.Body(reference, triangles, held_at(len(nodes), rim, wall, fixed), grown.mesh.topology,
                           scene.numerics.jacobian == "reused")
        prescribed = _prescribed(start, rim, wall, scene.pore.width)
        found = growth.equilibrium(body, target, start, push, prescribed, forces)
        start, push, iterations = found.position, found.pressure, iterations + found.iterations
        outline = geometry.Outline(start[rim], wall, fixed, grown.origin[grown.mesh.loop])
        gaps.append(scene.pore.width - outline.thickness)
        joins = geometry.closing_nodes(outline, scene.pore.width, scene.growth.minimum_film,
                                       scene.growth.minimum_contact_angle)
        if not joins.any():
            return _reprojected(grown, start, push, theta, wall, _with_new_surface(outline)), iterations, gaps[0]
        wall = np.where(joins != geometry.FREE, joins, wall)
    raise GrowthError(f"the contact surfaces still change after {CONTACT_ROUNDS} rounds; "
                      "try a shorter growth.time_step")


def held_at(count: int, rim: np.ndarray, wall: np.ndarray, fixed: np.ndarray) -> np.ndarray:
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
        fixed |= middle_of(grown.outline, wall)
    return fixed


def _with_new_surface(outline: geometry.Outline) -> np.ndarray:
    """Fixed points (M,), with the middle of the upper contact surface when that has just formed."""
    top = outline.wall == geometry.TOP
    if top.any() and not outline.fixed[top].any():
        return outline.fixed | middle_of(outline, geometry.TOP)
    return outline.fixed


def middle_of(outline: geometry.Outline, wall: int) -> np.ndarray:
    """(M,) True at the node nearest to the middle of the contact surface with a wall."""
    on, x = outline.wall == wall, outline.points[:, 0]
    chosen = np.zeros(len(on), bool)
    if on.any():
        middle = 0.5 * (x[on].min() + x[on].max())
        chosen[np.flatnonzero(on)[np.argmin(np.abs(x[on] - middle))]] = True
    return chosen


def _reprojected(grown: Pore, position, push, theta, wall, fixed) -> Pore:
    """The aggregate in its new shape, with X_A and X_I reprojected by (34); the fluid's nodes where they were."""
    grid = grown.mesh
    points, pressure = grid.points.copy(), grown.pressure.copy()
    points[grid.body], pressure[grid.body] = position, push
    moved = grid.moved(points)
    before, after = grid.lumped(grid.biomass), moved.lumped(grid.biomass)
    return replace(grown, mesh=moved, active=reprojection.reproject(grown.active, before, after),
                   inert=reprojection.reproject(grown.inert, before, after), theta=theta, pressure=pressure, wall=wall,
                   fixed=fixed)
