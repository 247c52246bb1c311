"""Meshes that are graded to a front of the substrates in the aggregate."""

from __future__ import annotations

from dataclasses import replace

from repro.errors import Unresolved
from repro.model.meshing import seeded
from repro.model.pore import Pore
from repro.model.solving import Solved, solve
from repro.scene import Scene

#: A front of the substrates divides element sizes at the aggregate by at most this.
MOST_GRADED = 4.0


def solve_graded(scene: Scene, pore: Pore) -> tuple[Pore, Solved]:
    """Solve flow and substrates. If the mesh is too coarse for a front of the substrates, quadratic
    elements get a mesh graded to it.

    Raises Unresolved if no graded mesh resolves the front.
    """
    while True:
        try:
            return pore, solve(scene, pore)
        except Unresolved:
            finer = grade(scene, pore)
            if finer is None:
                raise
            pore = finer


def grade(scene: Scene, pore: Pore) -> Pore | None:
    """The same pore on elements half as large at the aggregate; None if they may not be halved
    again."""
    front = 2 * pore.front
    if not scene.numerics.scheme.follows_layers or front > MOST_GRADED:
        return None
    if pore.time == 0:
        return seeded(scene, front)
    from repro.model.remeshing import Remeshing, remesh  # later times are those of growth
    return remesh(Remeshing.of(scene), pore, replace(pore, front=front), 0.0)[0]
