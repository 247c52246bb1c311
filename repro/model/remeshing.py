"""The mesh of the next step (3.1, 3.5).

The present mesh moves with the aggregate, or the fields are transferred to a new mesh.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from repro.errors import OriginFolded
from repro.fem import sizing, transfer
from repro.fem.mesh import Mesh, Region
from repro.fem.outline import Outline
from repro.fem.space import Space
from repro.fem.transfer import Located
from repro.fem.walls import FREE, touched
from repro.model import biomass, growing, mesh_motion
from repro.model.biomass import Amounts
from repro.model.body import Body
from repro.model.meshing import Meshing
from repro.model.pore import Pore
from repro.model.solid import material
from repro.model.transport import Concentrations, concentrations
from repro.scene import Scene, Substrate, Substrates, at_time

#: Largest difference of the masses, relative to them, on two meshes of the same shape. Summation
#: and the division of arcs err by less.
ROUND_OFF = 1e-12


@dataclass(frozen=True, eq=False)
class Remeshing:
    """Data from which the mesh follows growing aggregates, and fields are transferred.

    meshing: of the scene; transfer: method of :func:`biomass.transfer_amounts`; maximum_density:
    X_m, mg/L; substrates: section of the scene. Its supplies may be tables over time.
    """

    meshing: Meshing
    transfer: str
    maximum_density: float
    substrates: Substrates

    @classmethod
    def of(cls, scene: Scene) -> Remeshing:
        """The remeshing of a scene with growth."""
        substrates, kinetics, _ = scene.growing
        return cls(Meshing.of(scene), scene.numerics.scheme.transfer, kinetics.maximum_density,
                   substrates)


@dataclass(frozen=True, eq=False)
class GeneratedMesh:
    """A mesh that a step has generated.

    shape: the aggregates for which the mesh was generated, on the mesh at the start of the step;
    pore: the same aggregates on the generated mesh.
    """

    shape: Pore
    pore: Pore

    @cached_property
    def at(self) -> Located:
        """Location of the generated mesh's aggregate nodes in the mesh at the start of the step."""
        return _located_in(self.shape, self.pore.mesh)


def new_mesh(rules: Remeshing, previous: Pore, expanded: Pore, speed: float,
             generated: Sequence[GeneratedMesh] = ()) -> tuple[Pore, bool]:
    """Give expanded aggregates a mesh: the present mesh, moved with them, or a new one.

    Parameters
    ----------
    rules : Remeshing
    previous : Pore
        The pore before the expansion, on an acceptable mesh.
    expanded : Pore
        The new shapes; the fluid's nodes are still in their old positions.
    speed : float
        Mean velocity, um/h, for the substrates beyond the ends of the old mesh.
    generated : sequence of GeneratedMesh, optional
        Meshes of steps from the same start. The nearest one in time that is acceptable after it has
        moved with the aggregates is used instead of a new mesh.

    Returns
    -------
    pore : Pore
    remeshed : bool
        True if another mesh replaces the present one.

    Notes
    -----
    In the paper, a new mesh is needed if the extent is too short (3.1) or the moved mesh is not
    acceptable (3.5). Here it is also needed if contact has changed, or if an interface edge is more
    than twice as long as in a new mesh.
    """
    mesh = moved_mesh(rules.meshing, previous, expanded)
    if mesh is not None:
        return replace(expanded, space=Space(mesh)), False
    for generated_mesh in sorted(generated, key=lambda each: abs(each.shape.time - expanded.time)):
        pore = _on_generated(rules, generated_mesh, expanded)
        if pore is not None:
            return pore, True
    return remesh(rules, previous, expanded, speed)[0], True


def _on_generated(rules: Remeshing, generated: GeneratedMesh, expanded: Pore) -> Pore | None:
    """Expanded aggregates on a mesh that steps from the same start have generated.

    The mesh moves with the material. Returns None if the contact differs or if the moved mesh is
    not acceptable. It may have as many poor triangles as the generated one: in an acute corner
    of the water each mesh has some. One arc may replace several (:func:`welds.coarsened`). It has
    their area only in the shape for which the mesh was generated, so the result is also None if
    the mass changes by more than ROUND_OFF.
    """
    shape, start = generated.shape, generated.pore
    old = expanded.mesh
    if old.topology is not shape.mesh.topology or not same_contact(expanded, shape):
        return None
    position = generated.at.field(old.points, old.cells[old.biomass])
    points = start.mesh.from_body(position, start.mesh.points)
    for body, region in zip(start.bodies, start.mesh.regions):
        on_wall = region.loop[touched(body.wall) != FREE]
        points[on_wall, 1] = start.mesh.points[on_wall, 1]
    mesh = moved_mesh(rules.meshing, start, start.moved(points), start.mesh.poor)
    if mesh is None:
        return None
    target = replace(start, space=Space(mesh))
    pore, _ = _transferred(rules, expanded, target, generated.at)
    return pore if abs(pore.mass - expanded.mass) <= ROUND_OFF * expanded.mass else None


def same_contact(pore: Pore, other: Pore) -> bool:
    """Do the same nodes of the aggregates touch the same walls in both pores?"""
    return all(outline.same_contact(earlier)
               for outline, earlier in zip(pore.outlines, other.outlines))


def _located_in(pore: Pore, mesh: Mesh) -> Located:
    """Location of a mesh's aggregate nodes in the biomass triangles of a pore of the same shape."""
    old = pore.mesh
    return transfer.located(old.points, old.cells[old.biomass], mesh.points[mesh.body])


def moved_mesh(meshing: Meshing, previous: Pore, expanded: Pore, poor: int = 0) -> Mesh | None:
    """The mesh, moved with the aggregates; None if a new mesh is needed; poor: as for
    :meth:`Mesh.acceptable`."""
    mesh = previous.mesh
    length = meshing.channel.length
    if expanded.mesh.topology is not mesh.topology or not same_contact(expanded, previous):
        return None
    for outline, sizes in sizing.each_beside(expanded.outlines, meshing.sizes):
        if (sizing.extent_too_short(outline, mesh.ends, mesh.whole_width, length)
                or sizing.too_coarse(outline.corners, sizes)):
            return None
    moved = mesh_motion.moved(mesh, expanded.mesh.points[mesh.body])
    return moved if moved.acceptable(poor) else None


def remesh(rules: Remeshing, previous: Pore, expanded: Pore, speed: float,
           amounts: Amounts = (),
           outlines: Sequence[Outline] | None = None) -> tuple[Pore, Amounts]:
    """Make a new mesh around the aggregates, with the extent of 3.1, and transfer all fields.

    Parameters
    ----------
    rules : Remeshing
    previous : Pore
        The pore on the mesh of the concentrations.
    expanded : Pore
        The aggregates and their biomass.
    speed : float
        Mean velocity, um/h; zero if nothing flows and the entire pore is meshed, or if the
        substrates are only a first guess.
    amounts : tuple of (r, q) arrays, optional
        Further amounts in the biomass, um2 mg/L.
    outlines : sequence of Outline, optional
        The outlines of ``expanded`` with other nodes on the same curves.

    Returns
    -------
    pore : Pore
    amounts : tuple of (r, q) arrays
        The further amounts on the new mesh.

    Notes
    -----
    theta restarts as J times the density over X_m. This expansion brings each density back to X_m.
    So the next update removes the error of J = theta, and the error does not accumulate [E7]. If
    strain adds up and the transfer is "shares", the new densities follow from the interpolated
    theta, because J is rough where strain is singular.
    """
    mesh, outlines = rules.meshing.around(outlines or expanded.outlines, expanded.front)
    new = Space(mesh)
    at = _located_in(expanded, mesh)
    bodies = _on_new_mesh(new, expanded, outlines, at)
    substrates = _carried(rules, previous, expanded, new, speed)
    target = replace(expanded, space=new, bodies=bodies, concentrations=substrates)
    return _transferred(rules, expanded, target, at, amounts)


def without(rules: Remeshing, pore: Pore, number: int, speed: float) -> Pore:
    """The pore without the aggregate with index ``number``, on a new mesh.

    Water replaces the aggregate. Stored substrates keep their concentrations. speed: as for
    :func:`remesh`.
    """
    mesh = pore.mesh
    topology = mesh.topology
    kept = [k for k in range(len(pore.bodies)) if k != number]
    if not kept:
        clean, _ = rules.meshing.around([])
        space = Space(clean)
        return replace(pore, space=space, bodies=(), pressure=np.zeros(clean.corners), front=1.0,
                       concentrations=_carried(rules, pore, pore, space, speed))
    new_number = np.zeros(len(pore.bodies) + 1, int)
    new_number[[k + 1 for k in kept]] = np.arange(1, len(kept) + 1)
    loops = tuple(topology.loops[k] for k in kept)
    left = Mesh.of(mesh.points, mesh.cells, new_number[topology.region], loops, mesh.walls,
                   mesh.ends, topology.method)
    pressure = np.where(np.isin(np.arange(mesh.corners), left.body), pore.pressure, 0.0)
    bodies = tuple(pore.bodies[k] for k in kept)
    rest = replace(pore, space=Space(left), bodies=bodies, pressure=pressure)
    return remesh(rules, rest, rest, speed)[0]


def within(rules: Remeshing, pore: Pore, outlines: Sequence[Outline], speed: float) -> Pore:
    """The pore with its aggregates reduced to outlines within them, on a new mesh.

    The fraction of inert biomass and the last shape are transferred. The present shape becomes the
    reference. No strain is lost, because strain counts from the last shape. speed: as for
    :func:`remesh`.
    """
    mesh, outlines = rules.meshing.around(outlines, pore.front)
    new = Space(mesh)
    at = _located_in(pore, mesh)
    bodies = tuple(replace(body, wall=outline.wall, fixed=outline.fixed,
                           solid=material(new, region, mesh.points[region.nodes],
                                          body.solid.energy))
                   for body, outline, region in zip(pore.bodies, outlines, mesh.regions))
    target = replace(pore, space=new, bodies=bodies,
                     concentrations=_carried(rules, pore, pore, new, speed))
    return _transferred(replace(rules, transfer="inside"), pore, target, at)[0]


def _carried(rules: Remeshing, previous: Pore, expanded: Pore, new: Space,
             speed: float) -> Concentrations | None:
    """The substrates of an expanded pore on a new mesh; arguments are those of :func:`remesh`."""
    supplied = at_time(rules.substrates, expanded.time if speed else 0.0)
    return transfer_substrates(supplied, previous.space, new, expanded.concentrations, speed)


def _transferred(rules: Remeshing, expanded: Pore, target: Pore, at: Located,
                 amounts: Amounts = ()) -> tuple[Pore, Amounts]:
    """Transfer biomass, pressure, last shape and further amounts to the mesh of ``target``.

    target: a pore of the same shape on another mesh; at: location of its aggregate nodes in the old
    mesh.
    """
    old = expanded.mesh
    active, inert, *rest = biomass.transfer_amounts(
        rules.transfer, expanded.space, target.space, at,
        (expanded.active, expanded.inert, *amounts), _masses(rules, expanded, target, at))
    bodies = []
    for number, body in enumerate(target.bodies):
        def carry(positions: np.ndarray, before: Region = expanded.mesh.regions[number],
                  after: Region = target.mesh.regions[number]) -> np.ndarray:
            nodal = old.from_region(before, positions)
            if target.welds:  # the nodes of the weld have other positions in the other aggregate
                own = transfer.located(old.points, before.cells, target.mesh.points[after.nodes])
                return own.field(nodal, before.cells)
            carried = target.mesh.from_body(at.field(nodal, old.cells[old.biomass]))
            return carried[after.nodes]
        configuration = expanded.bodies[number].configuration.carried(carry)
        bodies.append(replace(body, configuration=configuration))
    pore = replace(target, time=expanded.time, bodies=tuple(bodies),
                   pressure=_pressure(target.mesh, expanded, at)).with_masses(active, inert)
    return growing.with_restarted_theta(pore, rules.maximum_density), tuple(rest)


def _masses(rules: Remeshing, expanded: Pore, target: Pore, at: Located) -> np.ndarray:
    """(r, q) um2 mg/L, the biomass at the points of a new mesh at the density X_m.

    If strain adds up and the transfer is "shares", the biomass per area at t = 0 is proportional to
    the interpolated theta. Its sum over an aggregate is X_m times the present area. Arguments are
    those of :func:`_transferred`.
    """
    new = target.space
    areas = new.reaction.dx
    if target.accumulates and rules.transfer == "shares":
        old = expanded.mesh
        theta = expanded.joined([body.theta for body in expanded.bodies])
        nodal = at.field(expanded.space.integration.to_nodes(theta), old.cells[old.biomass])
        theta = new.integration.to_points(target.mesh.from_body(nodal[:, None])[:, 0])
        needed = [theta[new.integration.rows(region)] * body.solid.at.dx
                  for body, region in zip(target.bodies, target.mesh.regions)]
        areas = target.joined([each * (target.of(region, areas).sum() / each.sum())
                               for each, region in zip(needed, target.mesh.regions)])
    return rules.maximum_density * areas


def _pressure(mesh: Mesh, expanded: Pore, at: Located) -> np.ndarray:
    """(corners,) P / mu_L on a new mesh: interpolated in the aggregates, zero in the fluid."""
    old = expanded.mesh
    pressure = np.zeros(mesh.corners)
    inside = at.field(expanded.pressure, old.triangles[old.biomass])[mesh.body < mesh.corners]
    pressure[mesh.topology.body_corners] = inside
    return pressure


def _on_new_mesh(new: Space, expanded: Pore, outlines: Sequence[Outline],
                 at: Located) -> tuple[Body, ...]:
    """The aggregates on a new mesh, with the contact of their outlines.

    Positions at t = 0 are interpolated inside, and are those of the outline on the boundary. If
    they fold, the present shape replaces them, unless strain counts from t = 0. Then OriginFolded
    is raised.
    """
    mesh = new.mesh
    old = expanded.mesh
    bodies = []
    for body, outline, before, region in zip(expanded.bodies, outlines, old.regions, mesh.regions):
        inside = at.field(old.from_region(before, body.reference), old.cells[old.biomass])
        origin = mesh.from_body(inside, mesh.points)
        origin[region.loop] = outline.origin
        known = body.origin_known
        try:
            origin = transfer.unfolded(mesh, origin, region)
        except OriginFolded:
            if body.configuration.accumulates:
                raise
            origin = mesh.points
            known = False
        solid = material(new, region, origin[region.nodes], body.solid.energy)
        bodies.append(replace(body, wall=outline.wall, fixed=outline.fixed, solid=solid,
                              origin_known=known))
    return tuple(bodies)


def transfer_substrates(supplied: Substrates, old: Space, new: Space, state: Concentrations | None,
                        speed: float) -> Concentrations | None:
    """C_A and C_D on a new mesh; state: on the old mesh.

    Within the old ends they are interpolated. Beyond them they follow (26) upstream and are
    constant downstream; without flow they are the supply. supplied: the substrates at one time,
    without tables. Without flow this time is t = 0, because the water beyond the old ends has been
    there since t = 0.
    """
    if state is None:
        return None
    x = new.points[:, 0]
    first, last = old.mesh.ends
    clipped = np.column_stack([np.clip(x, first, last), new.points[:, 1]])
    at = transfer.located(old.mesh.points, old.mesh.cells, clipped)
    fields = at.field(state.fields.T, old.cells)
    kinds = supplied.modelled.values()
    new_fields = [_beyond(field, substrate, x, old.mesh.ends, speed)
                  for field, substrate in zip(fields.T, kinds)]
    return concentrations(supplied, np.stack(new_fields))


def _beyond(field: np.ndarray, substrate: Substrate, x: np.ndarray, ends: tuple[float, float],
            speed: float) -> np.ndarray:
    """(n,) mg/L: ``field`` with corrected values beyond the old ends (:func:`transfer_substrates`).

    field: (n,) mg/L, with the value at the nearest end beyond the old ends.
    """
    before = np.minimum(x - ends[0], 0.0)
    if speed == 0:
        return np.where((before < 0) | (x > ends[1]), substrate.supply, field)
    faded = np.exp(speed * before / substrate.diffusivity)
    return substrate.supply - (substrate.supply - field) * faded
