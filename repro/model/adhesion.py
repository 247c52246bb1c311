"""Wall tractions, fluid forces and the largest tensile stress of an aggregate (section 5).

The equilibrium (22), tested with the nodal functions, gives the forces of the walls on the
aggregate. At a node on a wall, this force is the force of the stress minus the force of the fluid.
The nodal forces are consistent with a traction t. On a bonded wall t has both components. On a
sliding wall t is normal to the wall, and a shear keeps each contact surface in place
(:mod:`repro.model.support`). At a point x of a contact surface, the wall bears

    ((max(pull, 0))^2 + shear^2)^(1/2)

with means over a length of W / 20 around x. The pull acts from the aggregate into the wall. The
stress at a contact line may be singular, but a mean over a length converges as the mesh is refined.
The tensile stress is a weighted mean over the points within W / 20 of a node.

The stresses in the run's own mesh are not accurate enough. A new mesh takes over a shape that was
in equilibrium on the old mesh, so stresses at contact lines err by up to 185 %
(``growth-gold-contact``). Elements longer than the averaging length do not resolve the singularity
at the edge of a bonded wall: tractions err by 30 to 55 % (``growth-gold-bonded``). Therefore both
stresses are computed in a separate equilibrium (:func:`at_rest`). It has small triangles beside all
contact lines, the contact surfaces of the run, and the forces of the water around it. The run keeps
its mesh.

Without ``growth.fluid_forces`` the equilibrium has no fluid forces, and walls bear the stress of
growth alone.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np

from repro.errors import GrowthError
from repro.fem import elements
from repro.fem.mesh import Mesh, Region
from repro.fem.outline import Outline
from repro.fem.sizing import GRADATION
from repro.fem.walls import Wall
from repro.model import flow, growth, traction
from repro.model.finer_lines import with_finer_lines
from repro.model.flow import Flow
from repro.model.interface import Interface, interface_of
from repro.model.mechanics import Mechanics, equilibrium
from repro.model.pore import Pore
from repro.model.resistance import resistance_of
from repro.model.solid import Solid
from repro.model.solving import Solved
from repro.scene import Flow as Drive
from repro.scene import Growth, Numerics, Scene, at_time, needed

#: Averaging length over the pore's width.
LENGTH = 1 / 20
#: Averaging length over the size of the triangles beside contact lines. On bonded walls tractions
#: err by 0.7, 0.5 and 0.35 % with 8, 11 and 16 triangles (``growth-gold-bonded``), and late contact
#: by 4.8, 3.1 and 1.4 % with 8, by 1.4, 1.8 and 0.7 % with 16 in the presets with arcs
#: (``growth-gold-contact``).
ELEMENTS_ALONG = 16
#: Number of parts of an edge on a wall, to average its traction.
PARTS = 64


@dataclass(frozen=True)
class Loading:
    """Data from which stresses and forces are computed.

    growth, numerics: sections of the scene; drive: section [flow], None without flow; interface:
    form of the flow; length: of the pore, um.
    """

    growth: Growth
    numerics: Numerics
    drive: Drive | None
    interface: Interface
    length: float

    @classmethod
    def of(cls, scene: Scene) -> Loading:
        """The loading of a scene with growth."""
        return cls(scene.growing.growth, scene.numerics, scene.flow,
                   interface_of(scene.numerics.interface), scene.pore.length)


@dataclass(frozen=True)
class Peak:
    """Largest mean of a stress: its value (MPa) and its coordinates x, y (um)."""

    value: float
    x: float
    y: float


@dataclass(frozen=True)
class Load:
    """Force of the fluid on one aggregate, per depth.

    x, y: MPa um; moment: MPa um2, counterclockwise, about the middle of the contact surface with
    the wall of its seed.
    """

    x: float
    y: float
    moment: float


def stress(loading: Loading, pore: Pore) -> np.ndarray:
    """(t, q, 4) MPa, Cauchy stress xx, yy, zz, xy at the points where growth is integrated, in the
    order of the mesh's triangles."""
    return pore.mesh.by_triangle([_stress(loading, pore, body.solid, region)
                                  for body, region in zip(pore.bodies, pore.mesh.regions)])


def _stress(loading: Loading, pore: Pore, solid: Solid, region: Region) -> np.ndarray:
    """(t, q, 4) MPa in one aggregate."""
    strained = solid.strained(pore.mesh.points[region.nodes])
    pressure = pore.pressure[region.cells[:, :3]] @ solid.shape.table.linear.T
    return loading.growth.shear_modulus * growth.cauchy(strained, pressure)


def fluid_forces(loading: Loading, pore: Pore, solved: Solved) -> np.ndarray:
    """(n, 2) MPa um, forces of the water on the aggregates' nodes.

    They exclude the force of the water on the wall beside a contact line.
    """
    drive = at_time(needed(loading.drive, "[flow]"), pore.time)
    water = needed(solved.flow, "a solution of the flow")
    of_head = traction.on_aggregate(pore.space, water, drive, loading.interface)
    if not resistance_of(drive).permeable:
        of_head = of_head + _beside_contact(pore, water)
    return flow.MPA_PER_UM * drive.density * drive.gravity * of_head[pore.mesh.body]


def _beside_contact(pore: Pore, water: Flow) -> np.ndarray:
    """(N, 2) um2 of head: forces of the water on wall edges that end at a contact line.

    The nodal forces of the fluid's triangles include these forces. They are forces of the pressure
    alone, because the water in this corner is at rest.
    """
    mesh = pore.mesh
    forces = np.zeros_like(mesh.points)
    ends = np.zeros(len(mesh.points), bool)
    for outline, region in zip(pore.outlines, mesh.regions):
        ends[region.loop[outline.contact_ends]] = True
    head = mesh.with_middles(water.head)
    beside = ~mesh.biomass & ends[mesh.triangles].any(axis=1)
    for side in range(3):
        inward = np.sum([wall.normal * mesh.on_wall(wall, side) for wall in mesh.walls], axis=0)
        chosen = beside & (inward != 0)
        cells = mesh.cells[chosen]
        values, weights, along = elements.side_table(mesh.geometry, side)
        dx = np.abs(mesh.points[cells, 0] @ along.T) * weights
        loads = (dx * (head[cells] @ values.T)) @ values
        np.add.at(forces[:, 1], cells, inward[chosen, None] * loads * ends[cells])
    return forces


@lru_cache(maxsize=1)
def fluid_loads(loading: Loading, pore: Pore, solved: Solved) -> tuple[Load, ...]:
    """The force and the moment of the water on each aggregate."""
    forces = fluid_forces(loading, pore, solved)
    return tuple(_load(pore.mesh, outline, region, pore.mesh.of_region(region, forces))
                 for outline, region in zip(pore.outlines, pore.mesh.regions))


def _load(mesh: Mesh, outline: Outline, region: Region, forces: np.ndarray) -> Load:
    """Resultant of forces (n, 2) MPa um on the nodes of one aggregate."""
    seeded, *_ = outline.seat.walls(mesh.walls)
    on = outline.points[outline.touches(seeded.number), 0]
    x, y = (mesh.points[region.nodes] - [(on.min() + on.max()) / 2, seeded.y]).T
    moment = float(x @ forces[:, 1] - y @ forces[:, 0])
    return Load(float(forces[:, 0].sum()), float(forces[:, 1].sum()), moment)


def wall_forces(loading: Loading, pore: Pore, solved: Solved) -> np.ndarray:
    """(n, 2) MPa um, forces of the walls on the aggregates' nodes.

    At nodes off the walls the value is the residual of the equilibrium.
    """
    mesh = pore.mesh
    nodal = np.zeros_like(mesh.points)
    for body, region in zip(pore.bodies, mesh.regions):
        nodal[region.nodes] += growth.internal_forces(
            body.solid, body.theta, mesh.points[region.nodes], pore.pressure[region.corner_nodes])
    forces = loading.growth.shear_modulus * nodal[mesh.body]
    if loading.growth.has_fluid_forces:
        forces = forces - fluid_forces(loading, pore, solved)
    return forces


@lru_cache(maxsize=1)
def at_rest(loading: Loading, pore: Pore, solved: Solved) -> tuple[Pore, Solved]:
    """The pore with its aggregates in equilibrium on a mesh with small triangles at contact lines.

    Also returns the solution. With fluid forces it contains the flow on this mesh. Contact surfaces
    stay the same. Raises GrowthError if there is no equilibrium.
    """
    if not pore.bodies:
        return pore, solved
    mechanics = Mechanics(loading.growth, loading.numerics)
    lines = np.concatenate([outline.points[outline.contact_ends] for outline in pore.outlines])
    size = LENGTH * pore.mesh.width / ELEMENTS_ALONG
    rest, _ = with_finer_lines(pore, lines, size, GRADATION)
    forces = None
    if loading.growth.has_fluid_forces:
        # The mean velocity of the solution drives this flow: at a jump, the scene gives only the
        # head after the jump.
        driven = replace(at_time(needed(loading.drive, "[flow]"), pore.time),
                         mean_velocity=solved.mean_velocity)
        water = flow.solve(rest.space, driven, loading.length, interface=loading.interface)
        solved = replace(solved, flow=water)
        forces = fluid_forces(loading, rest, solved) / loading.growth.shear_modulus
        forces = rest.mesh.from_body(forces)
    for group in rest.groups:
        seen = rest.focused(group[0] if len(group) == 1 else None)
        rest = _under_forces(partial(_equilibrium, mechanics, seen, group), seen, forces)
    return rest.focused(pore.focus), solved


def _under_forces(solve: Callable[..., Pore], pore: Pore, forces: np.ndarray | None) -> Pore:
    """Equilibrium of aggregates that move together under nodal forces (N, 2), over mu_L.

    A shape on a new mesh is not in equilibrium. If Newton's method fails to balance it under the
    forces, it starts from the equilibrium without forces, if there is one. solve: solve(start,
    forces, patient) is their equilibrium.
    """
    start = pore
    if forces is not None:
        try:
            return solve(pore, forces, patient=False)
        except GrowthError:
            with suppress(GrowthError):
                start = solve(pore, None, patient=False)
    return solve(start, forces, patient=True)


def _equilibrium(mechanics: Mechanics, pore: Pore, group: tuple[int, ...], start: Pore,
                 forces: np.ndarray | None, patient: bool) -> Pore:
    """Equilibrium of the aggregates of a group: of one in focus, or of all that are welded."""
    if len(group) > 1:
        from repro.model.welding import Welding  # a run without a weld does not load it
        return Welding(mechanics, pore, start, group, forces, patient=patient).equilibrium()
    own = None if forces is None else forces[pore.region.nodes]
    return equilibrium(mechanics, pore, start, own, patient=patient)[0]


def wall_peak(loading: Loading, pore: Pore, solved: Solved) -> Peak:
    """Largest mean stress that a wall bears in equilibrium, with its coordinates."""
    return max(wall_peaks(loading, pore, solved), key=lambda peak: peak.value)


@lru_cache(maxsize=1)
def wall_peaks(loading: Loading, pore: Pore, solved: Solved) -> tuple[Peak, ...]:
    """For each aggregate, the largest mean stress that a wall bears in equilibrium."""
    rest, around = at_rest(loading, pore, solved)
    forces = rest.mesh.from_body(wall_forces(loading, rest, around))
    peaks = []
    for outline, region in zip(rest.outlines, rest.mesh.regions):
        touched = outline.edge_wall
        own = [_peak_on(rest, outline, region, wall, forces) for wall in rest.mesh.walls
               if not wall.mirrors and (touched == wall.number).any()]
        peaks.append(max(own, key=lambda peak: peak.value))
    return tuple(peaks)


def _peak_on(pore: Pore, outline: Outline, region: Region, wall: Wall, forces: np.ndarray) -> Peak:
    """Largest mean stress that one wall bears from one aggregate, with its coordinates."""
    x = pore.mesh.points[:, 0]
    nodes = region.loop[outline.edges_on(wall.number)]
    nodes = nodes[np.argsort(x[nodes].min(axis=1))]
    nodes = nodes[:, :: int(wall.normal)]
    surface = _Surface(x, nodes)
    pull = surface.means(surface.density(-wall.normal * forces[:, 1]), pore.mesh.width)
    shear = surface.means(surface.density(forces[:, 0]), pore.mesh.width)
    bears = np.hypot(np.maximum(pull, 0.0), shear)
    worst = int(bears.argmax())
    middle = surface.middles(pore.mesh.width)[worst]
    return Peak(float(bears[worst]), float(middle), wall.y)


@dataclass(frozen=True, eq=False)
class _Surface:
    """A contact surface. x: (N,) um, of the mesh's nodes; nodes: (e, 2 or 3) of each edge, along x.
    """

    x: np.ndarray
    nodes: np.ndarray

    def _at(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(p, k) shape functions of an edge's k nodes at s (p,) in [0, 1], and derivatives."""
        return elements.ELEMENTS[self.nodes.shape[1] - 1].on_edge(s)

    def density(self, forces: np.ndarray) -> np.ndarray:
        """(N,) MPa, traction at the nodes of the surface, from nodal forces (N,) MPa um."""
        points, weights = np.polynomial.legendre.leggauss(4)
        values, slopes = self._at((points + 1) / 2)
        dx = self.x[self.nodes] @ slopes.T * (weights / 2)
        local = np.einsum("eq,qa,qb->eab", dx, values, values)
        surface_nodes, index = np.unique(self.nodes, return_inverse=True)
        index = index.reshape(self.nodes.shape)
        mass = np.zeros((len(surface_nodes), len(surface_nodes)))
        np.add.at(mass, (index[:, :, None], index[:, None, :]), local)
        density = np.zeros(len(forces))
        density[surface_nodes] = np.linalg.solve(mass, forces[surface_nodes])
        return density

    def _places(self) -> np.ndarray:
        """(e PARTS + 1,) um, x of points along the surface."""
        values, _ = self._at(np.arange(PARTS) / PARTS)
        return np.append((self.x[self.nodes] @ values.T).ravel(), self.x[self.nodes[-1, -1]])

    def _windows(self, width: float) -> tuple[np.ndarray, float]:
        """Starts (w,) um and length (um) of the averaging intervals; a short surface has only one.
        """
        places = self._places()
        length = min(LENGTH * width, places[-1] - places[0])
        starts = np.concatenate([places, places - length])
        inside = (starts >= places[0]) & (starts <= places[-1] - length)
        return np.append(starts[inside], places[0]), length

    def middles(self, width: float) -> np.ndarray:
        """(w,) um, middles of the averaging intervals."""
        starts, length = self._windows(width)
        return starts + length / 2

    def means(self, density: np.ndarray, width: float) -> np.ndarray:
        """(w,) means of a traction (N,), exact by Simpson's rule on each part of an edge."""
        s = np.arange(2 * PARTS + 1) / (2 * PARTS)
        values, slopes = self._at(s)
        along = (density[self.nodes] @ values.T) * (self.x[self.nodes] @ slopes.T)
        parts = (along[:, :-1:2] + 4 * along[:, 1::2] + along[:, 2::2]) / (6 * PARTS)
        total = np.append(0.0, np.cumsum(parts))
        starts, length = self._windows(width)
        places = self._places()
        ahead = np.interp(starts + length, places, total)
        return (ahead - np.interp(starts, places, total)) / length


def tensile_peak(loading: Loading, pore: Pore, solved: Solved) -> Peak:
    """Largest principal value of the mean stress around a node in equilibrium.

    The mean is over the points where growth is integrated, with the weight 1 - (d / L)^2 at a
    distance d < L = W / 20 from the node. If no point is within W / 40 of any node, L is twice the
    least distance.
    """
    return max(tensile_peaks(loading, pore, solved), key=lambda peak: peak.value)


@lru_cache(maxsize=1)
def tensile_peaks(loading: Loading, pore: Pore, solved: Solved) -> tuple[Peak, ...]:
    """:func:`tensile_peak` of each aggregate."""
    rest, _ = at_rest(loading, pore, solved)
    return tuple(_tensile_peak(loading, rest, body.solid, region)
                 for body, region in zip(rest.bodies, rest.mesh.regions))


def _tensile_peak(loading: Loading, pore: Pore, solid: Solid, region: Region) -> Peak:
    """Largest principal value of the mean stress around a node of one aggregate."""
    from scipy.spatial import KDTree  # few scenes need it

    nodes = pore.mesh.points[region.nodes]
    places = KDTree((solid.shape.table.values @ nodes[solid.shape.cells]).reshape(-1, 2))
    dx = solid.at.dx * solid.strained(nodes).J
    reach = max(LENGTH * pore.mesh.width, 2 * places.query(nodes)[0].min())
    near = KDTree(nodes).sparse_distance_matrix(places, reach, output_type="coo_matrix")
    weights = (1 - (near.data / reach) ** 2) * dx.ravel()[near.col]
    total = np.bincount(near.row, weights, len(nodes))
    has_points = total > 0
    sums = [np.bincount(near.row, weights * component[near.col], len(nodes))
            for component in _stress(loading, pore, solid, region).reshape(-1, 4).T]
    means = np.column_stack(sums)[has_points] / total[has_points, None]
    largest = growth.largest_principal(means)
    worst = int(largest.argmax())
    return Peak(float(largest[worst]), *nodes[has_points][worst].tolist())
