"""Contact with the walls, closing films, and the grown aggregate's new shape (2.3.3, 3.4).

A film of fluid closes if it is thinner than the least film. A wedge beside a contact surface closes
if its angle is less than the least angle. Both rules together require a gap to the wall of at least
min(film, tan(angle) d) at the distance d from the contact line. On straight edges, which the paper
uses, all nodes up to the farthest one that violates the rule join the wall. On arcs the rule
applies everywhere on the free surface, and :mod:`repro.model.contact_lines` finds the contact
lines, anywhere on an arc.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from repro.errors import GrowthError, LinearError, failing_as
from repro.fem.division import Division
from repro.fem.mesh import Mesh
from repro.fem.outline import Outline
from repro.fem.space import Space
from repro.fem.walls import FREE, Wall, Walls
from repro.model import contact_lines, growth, traction
from repro.model.body import Body, Shape
from repro.model.contact_lines import (
    Clearance,
    Contact,
    FirstContact,
    Line,
    SearchOptions,
    contact_with,
)
from repro.model.contact_newton import BESIDE, Coupled, Placed
from repro.model.pore import Pore, material
from repro.model.support import Support
from repro.model.traction import Fluid
from repro.scene import Growth, Numerics, Scene

#: Largest number of rounds in which closing films change the contact surfaces in one step.
CONTACT_ROUNDS = 60
#: Largest number of times that contact lines go back after a trial that fails.
RETREATS = 6
#: Rounds of shape and fluid forces after which contact lines stay in place, because each new
#: search may move them by up to its tolerance.
SETTLING_ROUNDS = 4
#: Shape and flow agree if the last round moves no node by more than this, over the aggregate's
#: thickness.
FORCE_REST = 1e-8
#: Or by more than this, if further rounds do not reduce the move because of round-off.
FORCE_ROUND_OFF = 1e-6
#: Rounds of forces that are combined, and within which the least move must fall.
FORCE_WINDOW = 5
#: The move stalls if FORCE_WINDOW rounds do not reduce the least move by this factor.
FORCE_REDUCTION = 0.5
PATIENT = SearchOptions()
#: Defect at which each part of theta except the last counts as reached.
PARTLY = 1e-3
#: Clearances of the first contact at which Newton's method takes over from the search.
CLOSE_ENOUGH = 0.2
#: Lengths of the first contact on both sides of the highest point, over the least film.
FIRST_LENGTHS = np.array([1.0, 0.5, 0.25])


@dataclass(frozen=True, eq=False)
class Mechanics:
    """Data from which the shape of a grown aggregate is computed.

    keys: section [growth] of the scene; numerics: Newton's method; fluid:
    its forces on the aggregate, None if they are neglected.
    """

    keys: Growth
    numerics: Numerics
    fluid: Fluid | None = None

    @classmethod
    def of(cls, scene: Scene) -> Mechanics:
        """The mechanics of a scene with growth."""
        keys = scene.growing.growth
        fluid = Fluid.of(scene) if keys.has_fluid_forces else None
        return cls(keys, scene.numerics, fluid)


@dataclass(frozen=True, eq=False)
class Expansion:
    """The aggregate in its new shape.

    pore: with the fluid's nodes not yet moved, on the divided mesh if a contact line lies
    within an arc; iterations: of Newton's method; gap: um, the thinnest film at a wall without
    contact before films closed; division: of the mesh of the grown pore, None if it is not divided;
    advances: {(wall, direction): um} by which contact lines have advanced along the outline of the
    grown pore.
    """

    pore: Pore
    iterations: int
    gap: float
    division: Division | None = None
    advances: Mapping[tuple[int, int], float] = field(default_factory=dict)

    @property
    def position(self) -> np.ndarray:
        """(N, 2) um, new positions of the grown pore's nodes."""
        points = self.pore.mesh.points
        return points if self.division is None else self.division.restricted(points)

    def amounts(self, amounts: np.ndarray, grown: Pore) -> np.ndarray:
        """Carry amounts (r, q) from the points of the grown pore's aggregate to those of the new
        shape."""
        if self.division is None:
            return amounts
        return self.division.amounts(amounts, grown.space.table)


@failing_as(GrowthError)
def expand(mechanics: Mechanics, grown: Pore, theta: np.ndarray, guess: Pore | None = None,
           search: SearchOptions = PATIENT) -> Expansion:
    """Expand the aggregate to its new shape under theta (t, q).

    Parameters
    ----------
    mechanics : Mechanics
    grown : Pore
        Biomass as it has grown, in the old shape.
    theta : (t, q) float
        Expansion since t = 0.
    guess : Pore, optional
        A pore on the same mesh with the shape and pressure from which the search starts; ``grown``
        by default.
    search : SearchOptions
        Options of the search for contact lines.

    Raises
    ------
    FirstContact
        If the film to the opposite wall becomes thinner than ``search.landing`` times the least
        film while there is no contact.
    GrowthError
        If there is no equilibrium, if contact does not come to rest, or if shape and flow do not
        agree.

    Notes
    -----
    With fluid forces, shape and flow are computed in turn until both agree. A shape changes its
    forces by a part of the change that gave the shape, up to 0.6 of it after contact. Anderson
    acceleration therefore chooses the forces of a round. After the first contact the film's
    thickness counts under the forces of the open pore, because a closed pore has larger forces.
    """
    start = grown if guess is None else guess
    fluid = mechanics.fluid
    if fluid is None:
        return _at_rest(mechanics, grown, theta, start, None, search)
    around = traction.surroundings(fluid.meshing, grown, grown)
    last = Expansion(grown, 0, 0.0)
    iterations = 0
    rounds = _Rounds()
    while not rounds.stalled:
        around = traction.follow(fluid.meshing, around, last.pore)
        response = traction.forces(fluid, around, last.pore)
        if last.division is not None:
            response = _gathered(last.division, response)
        shape = _at_rest(mechanics, grown, theta, start, rounds.next_forces(response), search)
        rounds.moves.append(float(np.abs(shape.position - last.position).max()))
        stationary = len(rounds.moves) >= SETTLING_ROUNDS
        landing = -np.inf if shape.pore.contact else search.landing
        search = replace(search, advances=shape.advances, stationary=stationary, landing=landing)
        iterations += shape.iterations
        if rounds.agree(shape.pore.boundary.thickness):
            return replace(shape, iterations=iterations)
        if last.pore is grown or not shape.pore.boundary.same_contact(last.pore.boundary):
            around = traction.surroundings(fluid.meshing, grown, shape.pore)
        last = shape
    raise GrowthError("the fluid's forces and the shape do not agree: after "
                      f"{len(rounds.moves)} rounds a node still moves by {rounds.moves[-1]:.2g} "
                      "um, and more rounds do not reduce this: the aggregate is too soft for this "
                      "flow; try a larger growth.shear_modulus, or "
                      'growth.fluid_forces = "neglected"')


@dataclass(eq=False)
class _Rounds:
    """Rounds of fluid forces and the shape under them.

    forces: (n, 2) of each round; responses: those of the flow around the shape before each round;
    moves: um, the largest move of a node in each round.
    """

    forces: list[np.ndarray] = field(default_factory=list)
    responses: list[np.ndarray] = field(default_factory=list)
    moves: list[float] = field(default_factory=list)

    def next_forces(self, response: np.ndarray) -> np.ndarray:
        """Forces of the next round, from those of the flow around the last shape.

        Once contact lines stay in place, Anderson acceleration combines the last rounds so that
        their forces differ least from their response (Walker and Ni 2011, SIAM J. Numer. Anal. 49,
        1715). Before, the forces are the response.
        """
        rounds = slice(max(SETTLING_ROUNDS, len(self.forces) - FORCE_WINDOW), None)
        self.responses.append(response)
        forces = response
        if len(self.forces[rounds]) > 1:
            responses = np.array(self.responses[1:][rounds])
            differences = responses - self.forces[rounds]
            changes = np.diff(differences, axis=0).reshape(len(differences) - 1, -1)
            weights = np.linalg.lstsq(changes.T, differences[-1].ravel())[0]
            forces = response - np.tensordot(weights, np.diff(responses, axis=0), 1)
        self.forces.append(forces)
        return forces

    @property
    def stalled(self) -> bool:
        """Do the last FORCE_WINDOW rounds not reduce the least move? The first rounds, in which
        contact lines move, do not count."""
        settled = self.moves[SETTLING_ROUNDS:]
        before = settled[:-FORCE_WINDOW]
        return bool(before) and min(settled[-FORCE_WINDOW:]) > FORCE_REDUCTION * min(before)

    def agree(self, thickness: float) -> bool:
        """Do forces and shape agree, for an aggregate of a thickness (um)?"""
        move = self.moves[-1] / thickness
        return move <= FORCE_REST or self.stalled and move <= FORCE_ROUND_OFF


def _gathered(division: Division, loads: np.ndarray) -> np.ndarray:
    """(n, 2) loads on the nodes of the grown aggregate, from loads on the divided one."""
    return division.gathered_loads(_on_mesh(division.mesh, loads))[division.parent.body]


def _at_rest(mechanics: Mechanics, grown: Pore, theta: np.ndarray, start: Pore,
             forces: np.ndarray | None, search: SearchOptions) -> Expansion:
    """The new shape under constant nodal forces (n, 2) um, over mu_L; None for no forces."""
    configuration = grown.configuration.restarted(grown.mesh.points[grown.mesh.body])
    grown = replace(grown, theta=theta, configuration=configuration)
    return CLOSINGS[grown.boundary.geometry](mechanics, grown, start, forces, search)


def _close_by_nodes(mechanics: Mechanics, grown: Pore, start: Pore, forces: np.ndarray | None,
                    search: SearchOptions) -> Expansion:
    """Compute the shape in which no film and no wedge is too thin.

    After each equilibrium, the nodes at a film or a wedge that is too thin join the wall.
    """
    keys = mechanics.keys
    walls = grown.mesh.walls
    shape = replace(grown, space=start.space, pressure=start.pressure)
    iterations = 0
    gaps: list[float] = []
    for _ in range(CONTACT_ROUNDS):
        last = None if gaps else grown.mesh.points[grown.mesh.body]
        shape, used = _equilibrium(mechanics, grown, shape, forces, last=last)
        iterations += used
        gaps.append(shape.boundary.gap(walls))
        if not shape.contact:
            _refuse_late(gaps[-1], keys.minimum_film, search)
        joins = closing_nodes(shape.boundary, walls, keys.minimum_film, keys.minimum_contact_angle)
        if not joins.any():
            rest = replace(shape, fixed=_with_new_surface(shape.boundary, walls))
            return Expansion(rest, iterations, gaps[0])
        shape = replace(shape, wall=np.where(joins != FREE, joins, shape.wall))
    raise GrowthError(f"the contact surfaces still change after {CONTACT_ROUNDS} rounds")


def _equilibrium(mechanics: Mechanics, grown: Pore, start: Pore, forces: np.ndarray | None, *,
                 last: np.ndarray | None = None, patient: bool = True) -> tuple[Pore, int]:
    """Equilibrium of a grown pore under its theta, and the count of Newton iterations.

    ``start`` has the contact, and the shape and pressure from which Newton's method starts.
    """
    body, target_J = grown.strained_body
    nodes = grown.mesh.body
    inside = grown.mesh.topology.body_corners
    locked, target = _constraints(grown, start)
    rest = growth.equilibrium(body, target_J, start.mesh.points[nodes], start.pressure[inside],
                              locked, target, forces=forces, last=last, patient=patient,
                              supports=_supports(body, start, forces),
                              modified_newton=mechanics.numerics.scheme.modified_newton)
    return _placed(grown, start, rest), rest.iterations


def _close_by_lines(mechanics: Mechanics, grown: Pore, start: Pore, forces: np.ndarray | None,
                    search: SearchOptions) -> Expansion:
    """The shape with the smallest contact surfaces that leave no film and no wedge too thin."""
    keys = mechanics.keys
    rule = Clearance(grown.mesh.walls, keys.minimum_film, keys.minimum_contact_angle)
    trials = _Trials(mechanics, grown, start, forces, search.patient)
    lines = contact_lines.lines_of(grown.boundary)
    _place_lines(grown.boundary, lines, search)
    if grown.contact and not search.stationary:
        expansion = trials.settle(grown.wall, lines, rule)
        if expansion is not None:
            return expansion
    shape = trials.solve(grown.wall, lines)
    gap = shape.pore.boundary.gap(rule.walls)
    wall = grown.wall
    if not grown.contact and gap < rule.film:
        _refuse_late(gap, rule.film, search)
        wall, lines, shape = _touch(grown, shape, rule, trials, search)
    tried = grown.contact
    for _ in range(CONTACT_ROUNDS):
        for line in lines:
            line.record(*_clearance(rule, shape.pore.boundary, line))
        if search.stationary or all(line.accepted for line in lines):
            fixed = _with_new_surface(shape.pore.boundary, rule.walls)
            rest = replace(shape.pore, fixed=fixed)
            return replace(shape, pore=rest, iterations=trials.iterations, gap=gap)
        if not tried and all(abs(line.trials[-1][1]) < CLOSE_ENOUGH or line.accepted
                             for line in lines):
            tried = True
            expansion = trials.settle(wall, lines, rule)
            if expansion is not None:
                return replace(expansion, gap=gap)
        for line in lines:
            if not line.accepted:
                line.step()
        shape = trials.solve(wall, lines)
    raise GrowthError(f"the contact lines still move after {CONTACT_ROUNDS} trials")


def _refuse_late(gap: float, film: float, search: SearchOptions) -> None:
    """Raise FirstContact if the gap (um) at the first contact is much less than the least film."""
    if gap < search.landing * film:
        raise FirstContact(gap)


#: By the geometry of the triangles.
CLOSINGS = {1: _close_by_nodes, 2: _close_by_lines}


def _touch(grown: Pore, shape: Expansion, rule: Clearance, trials: _Trials,
           search: SearchOptions) -> tuple[np.ndarray, list[Line], Expansion]:
    """The first contact of a shape with the nearest wall: walls (M,), contact lines, and the
    equilibrium with them.

    Contact covers at least the least film's thickness on both sides of the nearest point, because a
    force at a single point would indent an elastic body without limit. If the body is too pointed
    to be flat over this length, contact covers half of it, or a quarter.
    """
    outline = shape.pore.boundary
    nearest, *_ = outline.untouched(rule.walls)
    lengths = rule.film * FIRST_LENGTHS
    width = _tip_width(outline, nearest, rule.film * nearest.part)
    if width < 2 * lengths[-1]:
        raise GrowthError(f"a tip comes into contact that is {width:.2g} um wide at a depth of "
                          f"{rule.film:.2g} um, the least film; the rule for films (2.3.3) does "
                          "not describe so thin a tip, and no setting helps")
    for length in lengths:
        wall, lines = _first_contact(outline, nearest, length)
        _place_lines(replace(grown.boundary, wall=wall), lines, search)
        try:
            return wall, lines, trials.solve(wall, lines)
        except (GrowthError, LinearError) as error:
            failure = error
    raise failure


def _place_lines(outline: Outline, lines: Sequence[Line], search: SearchOptions) -> None:
    """Start each contact line at its advance in ``search``, or at its least advance if that is
    larger."""
    for line in lines:
        length = search.advances.get(line.key, 0.0)
        line.advance = max(line.least, contact_lines.to_arcs(outline, line, length))
        if 0 < line.advance < contact_lines.LEAST_PART:
            line.advance = BESIDE


def _tip_width(outline: Outline, wall: Wall, depth: float) -> float:
    """The width (um) of the aggregate at a depth (um) behind its point nearest to a wall."""
    x = outline.points[:, 0]
    height = -wall.normal * outline.points[:, 1]
    tip = int(np.argmax(height))
    sides = []
    for direction in (1, -1):
        walk = (tip + direction * np.arange(len(x))) % len(x)
        behind = int(np.argmax(height[walk] < height[tip] - depth))
        last = walk[behind - 1 : behind + 1][::-1]
        sides.append(np.interp(height[tip] - depth, height[last], x[last]))
    return float(abs(sides[0] - sides[1]))


def _first_contact(outline: Outline, nearest: Wall,
                   length: float) -> tuple[np.ndarray, list[Line]]:
    """Walls (M,) after the corner next to the nearest point has joined a wall, and the contact
    lines at a length (um) on both sides of that point."""
    x = outline.points[:, 0]
    _, tip = outline.nearest(nearest)
    arc = int(np.argmin((nearest.normal * outline.arcs(outline.points)[:, :, 1]).min(axis=1)))
    ends = np.array([2 * arc, (2 * arc + 2) % len(x)])
    corner = int(ends[np.argmin(np.abs(x[ends] - tip))])
    wall = outline.wall.copy()
    wall[corner] = nearest.number
    touching = replace(outline, wall=wall)
    lines = contact_lines.lines_of(touching)
    for line in lines:
        if line.wall == nearest.number:
            outwards = np.sign(x[(corner + line.direction) % len(x)] - x[corner])
            advance = length + outwards * (tip - x[corner])
            line.start_from(contact_lines.to_arcs(touching, line, max(advance, 0.0)))
    return wall, lines


def _clearance(rule: Clearance, outline: Outline, line: Line) -> tuple[float, float]:
    """Clearance and reach beyond a line on the outline of a trial."""
    ends = contact_lines.surface_ends(outline, line.wall)
    node = next(node for node, direction in ends if direction == line.direction)
    return rule.beyond(outline, node, line.direction)


class _Trials:
    """Equilibria of one grown pore with its contact lines at several positions.

    Each starts from the last one, extrapolated in the advance of the line that moves most.
    """

    def __init__(self, mechanics: Mechanics, grown: Pore, start: Pore, forces: np.ndarray | None,
                 patient: bool):
        self._mechanics = mechanics
        self._grown = grown
        self._forces = forces
        self._patient = patient
        self._start = start.mesh.points, start.pressure
        self._shapes = [(np.zeros(0), *self._start)]
        self._divided: Division | None = None
        self._shape: Shape | None = None
        self.iterations = 0

    def solve(self, wall: np.ndarray, lines: Sequence[Line]) -> Expansion:
        """The equilibrium with walls (M,) of the grown pore's outline and advances of the lines.

        If it fails, the lines retreat half way to an advance that was too short. Raises
        GrowthError if that does not help.
        """
        for _ in range(RETREATS):
            try:
                shape = self._solve(contact_with(wall, lines),
                                    np.array([line.advance for line in lines]))
                return replace(shape, advances=self._lengths(wall, lines))
            except (GrowthError, LinearError) as error:
                failure = error
                moving = [line for line in lines if line.retreat()]
                if not moving:
                    break
        raise failure

    def settle(self, wall: np.ndarray, lines: Sequence[Line], rule: Clearance) -> Expansion | None:
        """Equilibrium with walls (M,) of the grown pore's outline and lines at zero clearance.

        Newton's method solves for shape and lines at once. If it fails, the result is None and the
        lines stay unchanged. Theta changes to its target in parts, as in
        :func:`growth.equilibrium`.
        """
        start = [line.advance for line in lines]
        grown = self._grown
        body, target_J = grown.strained_body
        points, pressures = self._shapes[-1][1:]
        J = body.strained(points[grown.mesh.body]).J
        try:
            for part in _parts(target_J / J):
                theta = grown.theta * (J / target_J) ** (1 - part)
                partly = replace(grown, theta=theta)
                coupled = Coupled(partial(self._place, partly, wall, lines, rule), lines, points,
                                  pressures)
                coupled.solve(growth.NEWTON if part == 1 else PARTLY)
                self.iterations += coupled.iterations
                points, pressures = coupled.placed.on_parent(coupled.position, coupled.pressure)
        except (GrowthError, LinearError, np.linalg.LinAlgError):
            for line, advance in zip(lines, start):
                line.advance = advance
            return None
        placed = coupled.placed
        points, pressures = placed.on_mesh(coupled.position, coupled.pressure)
        shape = replace(placed.pore.moved(points), pressure=pressures)
        rest = replace(shape, fixed=_with_new_surface(shape.boundary, rule.walls))
        return Expansion(rest, self.iterations, 0.0, placed.division, self._lengths(wall, lines))

    def _lengths(self, wall: np.ndarray, lines: Sequence[Line]) -> dict[tuple[int, int], float]:
        """{(wall, direction): um} by which lines have advanced."""
        outline = replace(self._grown.boundary, wall=wall)
        return {line.key: contact_lines.to_length(outline, line) for line in lines}

    def _place(self, grown: Pore, wall: np.ndarray, lines: Sequence[Line],
               rule: Clearance) -> Placed:
        """A grown pore with lines at their advances."""
        locked, division, forces = self._locked(grown, contact_with(wall, lines))
        body, theta = locked.strained_body
        reference = _on_mesh(grown.mesh, grown.unstrained)
        prescribed, target = _constraints(locked, locked)
        supports = _supports(body, locked, forces)
        system = growth.System(body, prescribed, forces=forces, supports=supports)
        return Placed(grown, locked, division, reference, system, theta, target, rule)

    def _locked(self, grown: Pore, contact: Contact) -> tuple[Pore, Division | None,
                                                              np.ndarray | None]:
        """A grown pore with a contact, its division, and the forces on its nodes."""
        if not len(contact.arcs):
            return replace(grown, wall=contact.wall), None, self._forces
        division = self._division(contact)
        locked = divided(grown, division, contact, self._shape)
        self._shape = locked.body.shape
        forces = self._forces
        return locked, division, None if forces is None else _divided_loads(division, forces)

    def _division(self, contact: Contact) -> Division:
        """The division of the contact's arcs; it keeps the connections of the last one if the arcs
        are the same."""
        if self._divided is None or not np.array_equal(self._divided.arcs, contact.arcs):
            self._divided = Division(self._grown.mesh, contact.arcs, contact.t)
            self._shape = None
        else:
            self._divided = self._divided.at(contact.t)
        return self._divided

    def _guesses(self, advances: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Positions (N, 2) um and pressures from which a trial may start, the best ones first."""
        ahead = self._ahead(advances)
        if ahead is not None:
            yield ahead
        yield self._shapes[-1][1:]
        yield self._start

    def _ahead(self, advances: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """The last two shapes, extrapolated in the advance of the line that moves most."""
        last, points, pressure = self._shapes[-1]
        before, points_before, pressure_before = self._shapes[0]
        if len(self._shapes) < 2 or len(before) != len(advances):
            return None
        line = np.argmax(np.abs(last - before))
        if last[line] == before[line]:
            return None
        part = (advances[line] - last[line]) / (last[line] - before[line])
        part = min(max(part, -1.0), 1.0)
        return (points + part * (points - points_before),
                pressure + part * (pressure - pressure_before))

    def _solve(self, contact: Contact, advances: np.ndarray) -> Expansion:
        grown = self._grown
        locked, division, forces = self._locked(grown, contact)
        first = self._first(locked, advances)
        shape, iterations = _equilibrium(self._mechanics, locked, first, forces,
                                         patient=self._patient)
        self.iterations += iterations
        expansion = Expansion(shape, iterations, 0.0, division)
        at_rest = advances, expansion.position, shape.pressure[: grown.mesh.corners]
        self._shapes = [*self._shapes[-1:], at_rest]
        return expansion

    def _first(self, locked: Pore, advances: np.ndarray) -> Pore:
        """The pore from which a trial starts: the best guess in which no triangle is turned over.

        A divided arc may have a kink where its contact begins. The undivided arc rounds it off,
        which can turn a triangle over.
        """
        division = self._divided
        for points, pressure in self._guesses(advances):
            if division is not None and len(points) < len(locked.mesh.points):
                points = division.nodal(points)
                pressure = division.at_corners(pressure)
            if locked.body.strained(points[locked.mesh.body]).J.min() > 0:
                break
        return replace(locked.moved(points), pressure=pressure)


@failing_as(GrowthError)
def _parts(growing: np.ndarray) -> np.ndarray:
    """The parts of a growth theta / J (t, q), up to 1."""
    count = growth.GradDiv.parts(growing)
    return np.arange(1, count + 1) / count


def divided(grown: Pore, division: Division, contact: Contact,
            shape: Shape | None = None) -> Pore:
    """The pore on the divided mesh, with the walls of a contact; shape: the aggregate's connections
    there, if they are known."""
    space = Space(division.mesh)
    table = grown.space.table
    reference = division.nodal(grown.origin)[space.mesh.body]
    body = (replace(grown.body, shape=shape, reference=reference) if shape
            else material(space, reference, grown.body.energy))
    configuration = grown.configuration.carried(
        lambda positions: division.nodal(_on_mesh(division.parent, positions))[space.mesh.body])
    expanded = division.amounts(grown.theta * grown.body.at.dx, table)
    at_line = np.where(contact.first != FREE, contact.first, contact.second)
    wall = contact.wall.copy()
    wall[2 * contact.arcs + 1] = contact.first
    none = np.zeros(len(contact.arcs), bool)
    return replace(grown, space=space, wall=division.along_loop(wall, at_line, contact.second),
                   fixed=division.along_loop(grown.fixed, none, none), body=body,
                   active=division.amounts(grown.active, table),
                   inert=division.amounts(grown.inert, table), theta=expanded / body.at.dx,
                   pressure=division.at_corners(grown.pressure),
                   configuration=configuration)


def _on_mesh(mesh: Mesh, values: np.ndarray) -> np.ndarray:
    """(N, 2) values at all nodes of a mesh, from those (n, 2) of its aggregate; zero in the fluid.
    """
    nodal = np.zeros_like(mesh.points)
    nodal[mesh.body] = values
    return nodal


def _divided_loads(division: Division, loads: np.ndarray) -> np.ndarray:
    """Loads on the nodes of the divided aggregate, from those (n, 2) on the parent's."""
    return division.divided_loads(_on_mesh(division.parent, loads))[division.topology.body]


def _placed(grown: Pore, start: Pore, rest: growth.Equilibrium) -> Pore:
    """The pore with its aggregate in equilibrium; the fluid's nodes are those of the grown pore."""
    points = grown.mesh.points.copy()
    points[grown.mesh.body] = rest.position
    pressure = grown.pressure.copy()
    pressure[grown.mesh.topology.body_corners] = rest.pressure
    return replace(start.moved(points), pressure=pressure)


def _constraints(grown: Pore, shape: Pore) -> tuple[np.ndarray, np.ndarray]:
    """(n, 2) True where a coordinate is prescribed, and (n, 2) um, its prescribed value.

    x is prescribed at fixed points, y on the walls (2.3.3). Every point that lay on a bonded wall
    before the step keeps its position.
    """
    rim = shape.mesh.topology.body_loop
    before = grown.mesh.points[grown.mesh.body]
    fixed = shape.fixed
    target = shape.mesh.points[shape.mesh.body].copy()
    for wall in shape.mesh.walls:
        target[rim[shape.wall == wall.number], 1] = wall.y
        fixed = fixed | (wall.bonded & wall.holds(before[rim]))
    target[rim[fixed], 0] = before[rim[fixed], 0]
    return constrained(len(target), rim, shape.wall, fixed), target


def _supports(body: Body, shape: Pore, forces: np.ndarray | None) -> list[Support]:
    """The supports of the contact surfaces of ``body`` that slide and have a fixed point.

    A surface of a single node has no length; the node bears its force. Without ``forces`` (n, 2)
    one surface alone bears none, because the forces of growth along the pore add up to zero.
    """
    outline = shape.boundary
    rim = shape.mesh.topology.body_loop
    walls = shape.mesh.walls
    supports = []
    for wall in walls:
        edges = rim[outline.edges_on(wall.number)]
        points = rim[outline.fixed & (outline.wall == wall.number) & (not wall.bonded)]
        if len(edges) and len(points):
            supports.append(Support.on(int(points[0]), edges, body.reference))
    alone = len(supports) == 1 and not any(wall.bonded for wall in walls)
    return [] if alone and forces is None else supports


def constrained(count: int, rim: np.ndarray, wall: np.ndarray, fixed: np.ndarray) -> np.ndarray:
    """(count, 2) True where a coordinate is prescribed: x at fixed points, y on the walls (2.3.3).

    rim: (M,) the boundary's nodes among all; wall, fixed: (M,), as in an outline.
    """
    prescribed = np.zeros((count, 2), bool)
    prescribed[rim[fixed], 0] = True
    prescribed[rim[wall != FREE], 1] = True
    return prescribed


def _with_new_surface(outline: Outline, walls: Walls) -> np.ndarray:
    """(M,) fixed points, with the middles of contact surfaces that have just formed."""
    fixed = outline.fixed
    for wall in walls:
        if wall.keeps_point and not outline.fixed[outline.wall == wall.number].any():
            fixed = fixed | middle_of(outline, wall.number)
    return fixed


def middle_of(outline: Outline, wall: int) -> np.ndarray:
    """(M,) True at the node nearest to the middle of the contact surface with a wall; the corner
    before it if that node is the middle of an arc."""
    on = outline.wall == wall
    x = outline.points[:, 0]
    chosen = np.zeros(len(on), bool)
    if on.any():
        middle = 0.5 * (x[on].min() + x[on].max())
        index = int(np.flatnonzero(on)[np.argmin(np.abs(x[on] - middle))])
        chosen[index - index % outline.geometry] = True
    return chosen


def closing_nodes(outline: Outline, walls: Walls, film: float, angle: float) -> np.ndarray:
    """(M,) wall that each node must join next, or FREE (2.3.3).

    A layer of fluid thinner than ``film`` to a wall without contact closes, and so does a wedge of
    fluid beside a contact surface whose angle is under ``angle``. Beside contact the gap must not
    be less than the smaller of film and tan(angle) times the distance from the contact line.
    Nodes between closing nodes close too, so that no fluid is trapped.
    """
    joins = np.full(len(outline.points), FREE)
    for wall in walls:
        gap = wall.film(outline.points)
        lines = contact_lines.surface_ends(outline, wall.number)
        if not lines:
            joins[(outline.wall == FREE) & (gap < film)] = wall.number
        for line, step in lines:
            joins[_closing_run(outline, gap, line, step, film, np.tan(angle))] = wall.number
    return joins


def _closing_run(outline: Outline, gap: np.ndarray, line: int, step: int, film: float,
                 slope: float) -> np.ndarray:
    """Free nodes from a contact line outwards, up to the last one too close to the wall."""
    count = len(gap)
    walk = (line + step * np.arange(1, count)) % count
    reach = np.flatnonzero(outline.wall[walk] != FREE)[0]
    other = walk[reach]
    walk = walk[:reach]
    x = outline.points[:, 0]
    gaps = gap[walk]
    apart = x[walk] - x[line]
    # Free nodes end at the other line. If it is on the same wall, nodes belong to the nearer line.
    nearer = np.abs(apart) <= np.abs(x[walk] - x[other])
    if outline.wall[other] != outline.wall[line]:
        nearer = np.ones(len(walk), bool)
    along = np.sign(x[line] - x[(line - step) % count]) * apart
    thin = (nearer & (gaps < 0)) | (gaps < np.minimum(film, slope * along))
    return walk[: np.flatnonzero(thin)[-1] + 1] if thin.any() else walk[:0]
