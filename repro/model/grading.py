"""Finer elements at the aggregate, if the mesh does not resolve a front of the substrates."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from repro.errors import Unresolved
from repro.model.meshing import Seeding
from repro.model.pore import Pore
from repro.model.solving import Solved, Solver
from repro.scene import Scene, needed

if TYPE_CHECKING:
    from repro.model.remeshing import Remeshing

#: A front of the substrates divides element sizes at the aggregate by at most this.
MOST_GRADED = 4.0


@dataclass(frozen=True, eq=False)
class Grading:
    """Solver of a pore that makes finer elements at the aggregate if they are needed.

    seeding: makes the finer pore at t = 0; remeshing: makes the finer mesh at later times, None
    without growth, because t = 0 is then the only time.
    """

    solver: Solver
    seeding: Seeding
    remeshing: Remeshing | None

    @classmethod
    def of(cls, scene: Scene) -> Grading:
        """The grading of a scene."""
        remeshing = None
        if scene.growth:
            from repro.model.remeshing import Remeshing  # a scene without growth does not load it
            remeshing = Remeshing.of(scene)
        return cls(Solver.of(scene), Seeding.of(scene), remeshing)

    def solve(self, pore: Pore) -> tuple[Pore, Solved]:
        """Solve flow and substrates, by :func:`solve_graded`."""
        while True:
            try:
                return pore, self.solver.solve(pore)
            except Unresolved:
                finer = self.finer(pore)
                if finer is None:
                    raise
                pore = finer

    def finer(self, pore: Pore) -> Pore | None:
        """The same pore with elements half as large at the aggregate; None if elements may not be
        halved again."""
        front = 2 * pore.front
        if not self.solver.scheme.follows_layers or front > MOST_GRADED:
            return None
        if pore.time == 0:
            # Outlines from elsewhere, or moved by the water, are not the seeds of the scene.
            seeds = self.seeding.pore(pore.front).mesh.points
            if np.array_equal(seeds, pore.mesh.points):
                return self.seeding.pore(front)
            if self.remeshing is None:
                return self.seeding.around(pore.outlines, front)
        from repro.model.remeshing import remesh
        rules = needed(self.remeshing, "[growth]")
        return remesh(rules, pore, replace(pore, front=front), 0.0)[0]


def solve_graded(scene: Scene, pore: Pore) -> tuple[Pore, Solved]:
    """Solve flow and substrates; also returns the pore, on a finer mesh if that was needed.

    With quadratic elements, a finer mesh at the aggregate replaces a mesh that is too coarse for a
    front of the substrates. Raises Unresolved if no accepted mesh resolves the front.
    """
    return Grading.of(scene).solve(pore)
