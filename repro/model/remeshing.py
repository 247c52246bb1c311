"""The mesh of the next step (3.1, 3.5): moved with the aggregate, or new, fields carried over."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from repro.errors import Advised, StageError, TransferError, Unresolved
from repro.fem import sizing, transfer
from repro.fem.mesh import Mesh
from repro.fem.outline import Outline
from repro.fem.space import Space
from repro.fem.transfer import Located
from repro.model import biomass, mesh_motion, pore
from repro.model.biomass import Amounts
from repro.model.growth import Body
from repro.model.pore import Pore, Solved
from repro.model.transport import UNRESOLVED, Concentrations
from repro.scene import Scene, SceneError, Substrate, load_scene, needed

#: What element sizes at the aggregate are divided by at most, for a front of the substrates.
MOST_GRADED = 4.0
#: What element sizes at the aggregate are divided by, in turn, while places at t = 0 fold.
UNFOLDING = (1.0, 2.0, 4.0)
#: Factors of the refinement that are tried where that is not enough.
TRIED = (1.5, 2.0, 3.0)
#: The largest refinement that scenes accept.
MOST_REFINED = 20.0


def new_mesh(scene: Scene, now: Pore, expanded: Pore, speed: float) -> tuple[Pore, bool]:
    """The mesh moved with the aggregate, or a new one, and which of them it is.

    speed: mean velocity (um/h), for the substrates beyond the old mesh's ends. New where the paper
    says so: the extent is too short (3.1), or the moved mesh would not be acceptable (3.5); and
    where a moved mesh cannot do: contact has changed, or interface edges are twice too long for the
    narrowest film.
    """
    mesh = followed(scene, now, expanded)
    if mesh is not None:
        return replace(expanded, space=Space(mesh, now.space.order)), False
    return remesh(scene, now, expanded, speed)[0], True


def resolved(scene: Scene, now: Pore) -> tuple[Pore, Solved]:
    """The pore with what is solved in it; with order 2 and 3 on a mesh that is graded to a front of
    the substrates, where the present one is too coarse for it. Raises Unresolved where that does
    not do."""
    while True:
        try:
            return now, pore.solve(scene, now)
        except Unresolved as error:
            finer = graded(scene, now)
            if finer is None:
                raise advised(scene, now, error) from None
            now = finer


def graded(scene: Scene, now: Pore) -> Pore | None:
    """The same pore on elements half as large at the aggregate; None where they may not be halved
    again."""
    front = 2 * now.front
    if scene.numerics.order == 1 or front > MOST_GRADED:
        return None
    if now.time == 0:
        return pore.seeded(scene, front)
    return remesh(scene, now, replace(now, front=front), 0.0)[0]


def advised(scene: Scene, now: Pore, error: Unresolved) -> Advised:
    """The error with a setting that resolves the present state, by trial: numerics.refinement, or
    linear elements.

    An error that carries advice already stays as it is.
    """
    if isinstance(error, Advised):
        return error
    tried = [round(factor * pore.resolution(scene), 2) for factor in TRIED]
    tried = [wanted for wanted in tried if wanted <= MOST_REFINED]
    for wanted in tried:
        finer = replace(scene, numerics=replace(scene.numerics, refinement=wanted))
        if _resolves(finer, now):
            return Advised(f"{error}; numerics.refinement = {wanted:g} resolves this state")
    failed = f"numerics.refinement up to {tried[-1]:g} does not resolve it" if tried else (
        f"no numerics.refinement that is accepted (up to {MOST_REFINED:g}) is much larger")
    linear = _with_linear(scene)
    if linear and _resolves(linear, now):
        refinement = linear.numerics.refinement
        return Advised(f'{error}; {failed}; numerics.elements = "linear" with '
                       f"numerics.refinement = {refinement:g} resolves this state")
    return Advised(f"{error}; {failed}")


def _resolves(scene: Scene, now: Pore) -> bool:
    """Can the present state be solved with the elements of another scene, and with room?"""
    try:
        solved = pore.solve(scene, _with_elements_of(scene, now))
    except StageError:
        return False
    return _with_room(scene, now, solved)


def _with_elements_of(scene: Scene, now: Pore) -> Pore:
    """The present state on a new mesh. Where the order is another, biomass is that of t = 0 in the
    present outline."""
    if now.time == 0:
        return pore.seeded(scene, now.front if scene.numerics.order > 1 else 1.0)
    if scene.numerics.order == now.space.order:
        return remesh(scene, now, now, 0.0)[0]
    fresh = replace(pore.seeded(scene, outline=now.boundary.corners), time=now.time)
    state = carried_substrates(scene.at(0.0), now.space, fresh.space, now.concentrations, 0.0)
    return replace(fresh, concentrations=state)


def _with_linear(scene: Scene) -> Scene | None:
    """The scene with linear elements, of the paper's refinement at least; None where it has them,
    or may not have them.

    Their uptake is lumped at the nodes: behind a front that is thinner than an element they fall
    far less below zero than higher orders.
    """
    if scene.numerics.order == 1:
        return None
    refinement = max(1.0, scene.numerics.refinement)
    changes = ["numerics.elements=linear", f"numerics.refinement={refinement!r}"]
    try:
        return load_scene(scene, changes)
    except SceneError:
        return None


def _with_room(scene: Scene, now: Pore, solved: Solved) -> bool:
    """Are concentrations no further below zero than half of what is accepted?"""
    substrates = needed(scene.at(now.time).substrates, "[substrates]")
    state = needed(solved.concentrations, "concentrations")
    kinds = (substrates.acceptor, substrates.donor)
    fields = (state.acceptor, state.donor)
    return all(field.min() >= -0.5 * UNRESOLVED * s.supply for field, s in zip(fields, kinds))


def followed(scene: Scene, now: Pore, expanded: Pore) -> Mesh | None:
    """The mesh moved with the aggregate, None where a new one is due."""
    outline = expanded.boundary
    mesh = now.mesh
    if (sizing.extent_too_short(outline, mesh.ends, scene.pore.width, scene.pore.length)
            or not outline.same_contact(now.boundary)
            or sizing.too_coarse(outline.corners, pore.sized(scene))):
        return None
    numerics = scene.numerics
    points = mesh_motion.move(mesh, expanded.mesh.points[mesh.body],
                              numerics.mesh_compressibility, numerics.flow_stabilisation)
    moved = mesh.moved(points)
    return moved if moved.acceptable() else None


def remesh(scene: Scene, now: Pore, expanded: Pore, speed: float,
           others: Amounts = ()) -> tuple[Pore, Amounts]:
    """The pore on a new mesh around the aggregate, with the extent of 3.1; fields, places at t = 0
    and other amounts (r, q) of the same material are carried over. speed: mean velocity (um/h),
    zero where nothing flows, and the whole pore is meshed, or substrates are a guess alone.

    theta restarts as J times the density over X_m: the expansion that brings each density back to
    X_m, so that the error of the constraint is worked off at the next update and does not
    accumulate [E7].
    """
    outline, new, at, body = _new_material(scene, expanded)
    mesh = new.mesh
    old = expanded.mesh
    active, inert, *rest = biomass.carried(scene.numerics.transfer, expanded.space, new, at,
                                           (expanded.active, expanded.inert, *others),
                                           needed(scene.kinetics, "[kinetics]").maximum_density)
    filled = scene.at(expanded.time if speed else 0.0)
    substrates = carried_substrates(filled, now.space, new, expanded.concentrations, speed)
    last = expanded.last
    if last is not None:
        last = at.field(last, old.topology.body_cells, old.geometry)
    found = Pore(expanded.time, new, outline.wall, outline.fixed, active, inert, np.empty(0), body,
                 _pressure(mesh, expanded, at), substrates, expanded.front, last)
    return replace(found, theta=expansion(scene, found)), tuple(rest)


def _new_material(scene: Scene, expanded: Pore) -> tuple[Outline, Space, Located, Body]:
    """The outline and the space of a new mesh, its nodes in the old one, and the aggregate at
    t = 0.

    Where the places at t = 0 fold, element sizes at the aggregate are halved, twice at most.
    """
    for factor in UNFOLDING:
        mesh, generated = pore.generate(scene, expanded.boundary, factor * expanded.front)
        outline = needed(generated, "an aggregate")
        new = Space(mesh, expanded.space.order)
        old = expanded.mesh
        at = transfer.located(old.points, old.cells[old.biomass], mesh.points[mesh.body])
        try:
            return outline, new, at, _material(new, expanded, outline.origin, at)
        except TransferError as error:
            folded = error
    raise folded


def _pressure(mesh: Mesh, expanded: Pore, at: Located) -> np.ndarray:
    """(corners,) P / mu_L on a new mesh, interpolated in the aggregate, zero in the fluid."""
    old = expanded.mesh
    pressure = np.zeros(mesh.corners)
    inside = at.field(expanded.pressure, old.triangles[old.biomass], 1)[mesh.body < mesh.corners]
    pressure[mesh.topology.body_corners] = inside
    return pressure


def _material(new: Space, expanded: Pore, rim: np.ndarray, at: Located) -> Body:
    """The aggregate at t = 0 on a new mesh: interpolated places, on its boundary (M, 2) um those of
    the outline."""
    mesh = new.mesh
    old = expanded.mesh
    origin = mesh.points.copy()
    origin[mesh.body] = at.field(expanded.origin, old.cells[old.biomass], old.geometry)
    origin[mesh.loop] = rim
    return pore.material(new, transfer.unfolded(mesh, origin)[mesh.body])


def expansion(scene: Scene, now: Pore) -> np.ndarray:
    """(t, q) J times the density over X_m, in the points where growth is taken: on straight
    triangles the mean density of their nodes (29), on curved ones that of each point."""
    J = now.body.strained(now.mesh.points[now.mesh.body]).J
    maximum = needed(scene.kinetics, "[kinetics]").maximum_density
    density = (now.active + now.inert) / now.space.reaction.dx / maximum
    return J * spread(now.space, density)


def spread(space: Space, field: np.ndarray) -> np.ndarray:
    """(t, q) in the points where growth is taken, of a field (r, q) in the points of the reaction:
    the mean of the nodes of each straight triangle (29), and itself on curved ones, where the
    points are the same."""
    if space.order > 1:
        return field
    return field[space.mesh.straight.topology.body_cells, 0].mean(axis=1, keepdims=True)


def carried_substrates(scene: Scene, old: Space, new: Space, state: Concentrations | None,
                       speed: float) -> Concentrations | None:
    """C_A and C_D on a new mesh: interpolated; beyond the old ends (26) upstream, constant
    downstream, and the supply where nothing flows.

    scene: at the time whose supply is there: t = 0 where nothing flows, since all that was filled
    in then is still there.
    """
    if state is None:
        return None
    x = new.points[:, 0]
    first, last = old.mesh.ends
    where = np.column_stack([np.clip(x, first, last), new.points[:, 1]])
    at = transfer.located(old.mesh.points, old.mesh.cells, where)
    fields = at.field(np.column_stack([state.acceptor, state.donor]), old.cells, old.order)
    both = needed(scene.substrates, "[substrates]")
    acceptor, donor = (_beyond(field, substrate, x, old.mesh.ends, speed)
                       for field, substrate in zip(fields.T, (both.acceptor, both.donor)))
    return Concentrations(acceptor, donor)


def _beyond(field: np.ndarray, substrate: Substrate, x: np.ndarray, ends: tuple[float, float],
            speed: float) -> np.ndarray:
    """(n,) mg/L with what is beyond the old ends; ``field`` has the nearest end's value there."""
    before = np.minimum(x - ends[0], 0.0)
    if speed == 0:
        return np.where((before < 0) | (x > ends[1]), substrate.supply, field)
    faded = np.exp(speed * before / substrate.diffusivity)
    return substrate.supply - (substrate.supply - field) * faded
