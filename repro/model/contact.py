"""The grown aggregate's new shape, with closing films and fluid forces (2.3.2, 2.3.3, 3.4).

A film of fluid closes if it is thinner than the least film. A wedge beside a contact surface closes
if its angle is less than the least angle. Both rules together require a gap to the wall of at least
min(film, tan(angle) d) at the distance d from the contact line. On straight edges, as in the paper,
all nodes up to the farthest one that violates the rule join the wall
(:mod:`repro.model.closing_by_nodes`). On arcs the rule applies everywhere on the free surface, and
contact lines lie anywhere on an arc (:mod:`repro.model.closing_by_lines`).
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from math import inf

import numpy as np

from repro.errors import GrowthError, failing_as
from repro.fem.division import Division
from repro.fem.refinement import Bisection
from repro.model import contact_lines, traction
from repro.model.closing_by_lines import ByLines
from repro.model.closing_by_nodes import ByNodes
from repro.model.contact_lines import PATIENT, Advances, SearchOptions
from repro.model.finer_lines import with_finer_lines
from repro.model.mechanics import Closing, Expansion, Mechanics
from repro.model.pore import Pore
from repro.scene import Growth

#: {geometry of the triangles: closing of films}.
CLOSINGS: dict[int, type[Closing]] = {1: ByNodes, 2: ByLines}
#: Largest number of equilibria on small triangles. Each one predicts where the next one needs small
#: triangles.
PREDICTIONS = 3
#: Largest distance of a line from its predicted position, over the size of the triangles there. At
#: this distance the triangles are five times as large.
MISSED = 4
#: Growth of the triangles' size with the distance from a line. Bisection keeps good angles for any
#: value.
LINE_GRADATION = 1.0
#: Shape and flow agree if the last round moves no node by more than this, over the aggregate's
#: thickness.
FORCE_REST = 1e-8
#: The same bound, if round-off prevents that further rounds reduce the move.
FORCE_ROUND_OFF = 1e-6
#: Anderson acceleration combines this number of rounds. The least move must fall within as many.
FORCE_WINDOW = 5
#: The rounds stall if FORCE_WINDOW of them do not reduce the least move by this factor.
FORCE_REDUCTION = 0.5


@failing_as(GrowthError)
def expand(mechanics: Mechanics, grown: Pore, theta: Sequence[np.ndarray],
           guess: Pore | None = None, search: SearchOptions = PATIENT) -> Expansion:
    """Expand the aggregates to their new shapes under theta.

    Parameters
    ----------
    mechanics : Mechanics
    grown : Pore
        The pore with the grown biomass, in the old shape.
    theta : sequence of (t, q) float
        Expansion of each aggregate since t = 0.
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
    With fluid forces, shape and flow are computed in turn until both agree. If the forces change,
    the flow around the new shape changes them again, by up to 0.6 of the first change after
    contact. Anderson acceleration therefore chooses the forces of each round. Contact lines and
    nodes on walls move until they rest. Afterwards those of a single aggregate are fixed: a new
    search could move a line by up to its tolerance, and the rounds would not converge. The film at
    the first contact is tested under the forces of the open pore, because the forces are larger in
    a closed pore.

    If ``search.line_size`` is finite, triangles are bisected where ``search.advances`` predicts the
    contact lines with the opposite wall. If there is no equilibrium on the bisected triangles, the
    result is the equilibrium on the original mesh.
    """
    start = guess or grown
    if search.line_size < inf and len(_lines_after(grown, search.advances)):
        with suppress(GrowthError):
            return _on_small_triangles(mechanics, grown, theta, start, search)
    return _expand(mechanics, grown, theta, start, search)


def _on_small_triangles(mechanics: Mechanics, grown: Pore, theta: Sequence[np.ndarray],
                        start: Pore, search: SearchOptions) -> Expansion:
    """:func:`expand` on small triangles beside the contact lines with opposite walls."""
    for _ in range(PREDICTIONS):
        lines = _lines_after(grown, search.advances)
        fine, fine_theta, bisection = _bisected(grown, theta, lines, search.line_size)
        shape = _expand(mechanics, fine, fine_theta, divided_start(start, fine, bisection), search)
        shape = replace(shape, bisection=bisection)
        missed = [abs(length - search.advances[key]) for key, length in shape.advances.items()
                  if key in search.advances]  # an aggregate may make its first contact
        if max(missed) <= MISSED * search.line_size:
            break
        search = replace(search, advances=shape.advances)
    return shape


def _lines_after(grown: Pore, advances: Advances) -> np.ndarray:
    """(K, 2) um, predicted positions on the grown outlines of contact lines with opposite walls.

    Empty without such lines.
    """
    lines = [(outline, line, advances[number, *line.key])
             for number, outline in enumerate(grown.outlines)
             for line in contact_lines.lines_of(outline)
             if line.wall != outline.seat.wall and (number, *line.key) in advances]
    return np.array([contact_lines.point_at(*each) for each in lines])


def _bisected(grown: Pore, theta: Sequence[np.ndarray], lines: np.ndarray,
              size: float) -> tuple[Pore, list[np.ndarray], Bisection]:
    """A grown pore and its theta, with triangles of a size (um) beside points ``lines`` (K, 2) um.

    Also returns the bisection.
    """
    bodies = [replace(body, theta=each) for body, each in zip(grown.bodies, theta)]
    fine, bisection = with_finer_lines(replace(grown, bodies=tuple(bodies)), lines, size,
                                       LINE_GRADATION)
    weights, part_weights = ([pore.of(region, pore.space.reaction.dx)
                              for region in pore.mesh.regions] for pore in (grown, fine))
    masses = [bisection.of_each(amounts, weights, part_weights, grown.space.table) for amounts in (
        [body.active for body in bodies], [body.inert for body in bodies])]
    fine = replace(fine, bodies=tuple(replace(body, active=active, inert=inert)
                                      for body, active, inert in zip(fine.bodies, *masses)))
    return fine, [body.theta for body in fine.bodies], bisection


def _expand(mechanics: Mechanics, grown: Pore, theta: Sequence[np.ndarray], start: Pore,
            search: SearchOptions) -> Expansion:
    """:func:`expand` on the mesh of the grown pore."""
    if mechanics.fluid is None or not grown.bodies:
        return shape_under(mechanics, grown, theta, start, None, search)
    water = traction.SurroundingFlow(mechanics.fluid, grown)
    shape = Expansion(grown, 0)
    iterations = 0
    for stationary in (False, True):
        rounds = _Rounds()
        search = replace(search, stationary=stationary)
        if stationary and not shape.divisions:
            start = replace(start, bodies=tuple(
                replace(body, wall=rest.wall)
                for body, rest in zip(start.bodies, shape.pore.bodies)))
        while not rounds.stalled:
            last = shape
            forces = rounds.next_forces(last.gathered(water.forces(last.pore)))
            shape = shape_under(mechanics, grown, theta, start, forces, search)
            if stationary:
                shape = replace(shape, gaps=last.gaps)
            rounds.moves.append(float(np.abs(shape.position - last.position).max()))
            iterations += shape.iterations
            if stationary and rounds.agree(min(outline.thickness
                                               for outline in shape.pore.outlines)):
                return replace(shape, iterations=iterations)
            landing = -np.inf if shape.pore.spanning > grown.spanning else search.landing
            search = replace(search, advances=shape.advances, landing=landing)
            if not stationary and _lines_rest(shape, last, mechanics.keys):
                break
    raise GrowthError("the fluid's forces and the shape do not agree: after "
                      f"{len(rounds.moves)} rounds a node still moves by {rounds.moves[-1]:.2g} "
                      "um, and more rounds do not reduce this: the aggregate is too soft for this "
                      "flow; try a larger growth.shear_modulus, or "
                      'growth.fluid_forces = "neglected"')


def _lines_rest(shape: Expansion, last: Expansion, keys: Growth) -> bool:
    """Do the contact lines rest between two rounds?

    No node joins or leaves a wall, and no line moves by more than the errors of its two positions.
    """
    error = contact_lines.CLOSE * keys.minimum_film / np.tan(keys.minimum_contact_angle)
    moves = [abs(length - last.advances.get(key, inf)) for key, length in shape.advances.items()]
    return max(moves, default=0.0) <= 2 * error and all(
        np.array_equal(body.wall, before.wall)
        for body, before in zip(shape.pore.bodies, last.pore.bodies))


@dataclass(eq=False)
class _Rounds:
    """Rounds of fluid forces and shapes.

    forces: (n, 2) of each round; responses: (n, 2) forces of the flow around the shape before each
    round; moves: um, the largest move of a node in each round.
    """

    forces: list[np.ndarray] = field(default_factory=list)
    responses: list[np.ndarray] = field(default_factory=list)
    moves: list[float] = field(default_factory=list)

    def next_forces(self, response: np.ndarray) -> np.ndarray:
        """Forces (n, 2) of the next round; response: (n, 2) forces of the flow around the shape.

        Anderson acceleration combines the last rounds so that forces and responses differ least
        (Walker and Ni 2011, SIAM J. Numer. Anal. 49, 1715).
        """
        rounds = slice(max(0, len(self.forces) - FORCE_WINDOW), None)
        self.responses.append(response)
        forces = response
        if len(self.forces) > 1:
            responses = np.array(self.responses[1:][rounds])
            differences = responses - self.forces[rounds]
            changes = np.diff(differences, axis=0).reshape(len(differences) - 1, -1)
            weights = np.linalg.lstsq(changes.T, differences[-1].ravel())[0]
            forces = response - np.tensordot(weights, np.diff(responses, axis=0), 1)
        self.forces.append(forces)
        return forces

    @property
    def stalled(self) -> bool:
        """Do the last FORCE_WINDOW rounds fail to reduce the least move?"""
        before = self.moves[:-FORCE_WINDOW]
        return bool(before) and min(self.moves[-FORCE_WINDOW:]) > FORCE_REDUCTION * min(before)

    def agree(self, thickness: float) -> bool:
        """Do forces and shape agree, for an aggregate of a thickness (um)?"""
        move = self.moves[-1] / thickness
        return move <= FORCE_REST or self.stalled and move <= FORCE_ROUND_OFF


def shape_under(mechanics: Mechanics, grown: Pore, theta: Sequence[np.ndarray], start: Pore,
                forces: np.ndarray | None, search: SearchOptions) -> Expansion:
    """The new shapes under constant nodal forces (n, 2) um, over mu_L; None for no forces.

    The shapes are computed one after the other, those of welded aggregates together.
    """
    mesh = grown.mesh
    bodies = [replace(body, theta=expansion,
                      configuration=body.configuration.restarted(mesh.points[region.nodes]))
              for body, expansion, region in zip(grown.bodies, theta, mesh.regions, strict=True)]
    shape = Expansion(replace(grown, bodies=tuple(bodies)), 0)
    nodal = None if forces is None else mesh.from_body(forces)
    for group in grown.groups:
        closed = _closed(mechanics, shape.pore, start, group, nodal, search)
        for division in closed.divisions:
            start = divided_start(start, closed.pore, division)
            nodal = None if nodal is None else division.divided_loads(nodal)
        shape = shape.joined(closed)
    return replace(shape, pore=shape.pore.focused(None))


def _closed(mechanics: Mechanics, grown: Pore, start: Pore, group: tuple[int, ...],
            forces: np.ndarray | None, search: SearchOptions) -> Expansion:
    """The new shape of aggregates that move together; group: their indices; forces: (N, 2) um."""
    number, *other = group
    if other:
        from repro.model.welding import Welding  # a run without a weld does not load it
        return Welding(mechanics, grown, start, group, forces, patient=search.patient,
                       within_arcs=search.within_arcs).close()
    own = None if forces is None else forces[grown.mesh.regions[number].nodes]
    return CLOSINGS[grown.mesh.geometry](mechanics, grown.focused(number), start.focused(number),
                                         own, search).close()


def divided_start(start: Pore, shape: Pore, division: Division | Bisection) -> Pore:
    """The start of further searches, carried to the mesh of a shape with divided triangles."""
    divided = shape.moved(division.nodal(start.mesh.points))
    return replace(divided, pressure=division.at_corners(start.pressure))
