"""The paper's closing of films (2.3.3), on straight edges: a node joins a wall or stays free.

After each equilibrium, nodes at a film or a wedge that is too thin join the wall. All nodes between
them and the contact surface join too.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf

import numpy as np

from repro.errors import GrowthError
from repro.fem.outline import Outline
from repro.fem.walls import FREE, Walls, touched
from repro.model.contact_lines import outward_sign, surface_ends, would_enclose
from repro.model.mechanics import CONTACT_ROUNDS, Closing, Expansion, equilibrium, with_new_surfaces


class ByNodes(Closing):
    """The closing on straight edges."""

    def close(self) -> Expansion:
        grown = self.grown
        film = self.mechanics.keys.minimum_film
        angle = self.mechanics.keys.minimum_contact_angle
        walls = grown.walls
        first = self.start if self.search.stationary else grown
        shape = replace(grown.with_body(wall=first.body.wall), space=self.start.space,
                        pressure=self.start.pressure)
        iterations = 0
        gaps: list[float] = []
        before = grown.boundary.gap(walls)
        for _ in range(CONTACT_ROUNDS):
            last = None if gaps else grown.mesh.points[grown.region.nodes]
            shape, used = equilibrium(self.mechanics, grown, shape, self.forces, last=last)
            iterations += used
            gaps.append(shape.boundary.gap(walls))
            if not shape.body.spans:
                self.search.refuse_late((before, gaps[-1]), film)
            joins = closing_nodes(shape.boundary, walls, film, angle,
                                  self.mechanics.numerics.tolerance)
            if not joins.any():
                return Expansion(with_new_surfaces(shape), iterations, (before, gaps[0]))
            shape = shape.with_body(wall=np.where(joins != FREE, joins, shape.body.wall))
        raise GrowthError(f"the contact surfaces still change after {CONTACT_ROUNDS} rounds")


def closing_nodes(outline: Outline, walls: Walls, film: float, angle: float,
                  tolerance: float = 0.0) -> np.ndarray:
    """(M,) wall that each node must join next, or FREE (2.3.3).

    At a wall without contact, the run of nodes closest to the wall closes if its films are thinner
    than ``film`` (um). Beside a contact surface, a wedge with an angle below ``angle`` (rad)
    closes: the gap must be at least min(film, tan(angle) d) at the distance d from the contact
    line. Nodes between closing nodes close too, so that no fluid is trapped. Nodes beyond a valley
    stay free: tolerance is that of :func:`repro.model.contact_lines.would_enclose`.
    """
    joins = np.full(len(outline.points), FREE)
    for wall in walls:
        gap = wall.film(outline.points)
        lines = surface_ends(outline, wall.number)
        if not lines:
            thin = (outline.wall == FREE) & (gap < film)
            wide = np.cumsum(~thin)
            tip = np.argmin(np.where(thin, gap, inf))
            joins[thin & ((wide - wide[tip]) % wide[-1] == 0)] = wall.number
        for line, step in lines:
            run = _closing_run(outline, gap, line, step, film, np.tan(angle), tolerance)
            joins[run] = wall.number
    return joins


def _closing_run(outline: Outline, gap: np.ndarray, line: int, step: int, film: float,
                 slope: float, tolerance: float) -> np.ndarray:
    """Free nodes from a contact line outwards, up to the last node too close to the wall before a
    valley.

    gap: (M,) um; step: 1 or -1, direction along the outline; slope: tangent of the least angle.
    """
    _, *free, other = outline.free_walk(line, step)
    walk = np.array(free, int)
    x = outline.points[:, 0]
    gaps = gap[walk]
    apart = x[walk] - x[line]
    # Free nodes end at another line. If that is on the same wall, nodes belong to the nearer line.
    nearer = np.abs(apart) <= np.abs(x[walk] - x[other])
    if touched(outline.wall[other]) != touched(outline.wall[line]):
        nearer = np.ones(len(walk), bool)
    along = outward_sign(outline, line, step) * apart
    thin = (nearer & (gaps < 0)) | (gaps < np.minimum(film, slope * along))
    behind = would_enclose(np.append(0.0, along), np.append(0.0, gaps), film, tolerance)[1:]
    thin &= ~np.logical_or.accumulate(behind)
    return walk[: np.flatnonzero(thin)[-1] + 1] if thin.any() else walk[:0]
