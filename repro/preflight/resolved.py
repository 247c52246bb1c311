"""Check whether the flow around a drawn outline is resolved, by its head loss on finer meshes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from repro.errors import StageError
from repro.model import solving
from repro.model.meshing import MOST_REFINED, seeded
from repro.polling import poll
from repro.preflight.memory import first_nodes
from repro.preflight.simplifications import Caveat
from repro.scene import Flow, Scene, at_time

#: The head loss of a resolved flow changes by at most this share on a mesh twice as fine. Near
#: unresolved corners the error falls with the first power of the size, and is twice the change.
CHANGE = 0.005
#: The meshes are two, four and eight times as fine, with at most this many nodes.
DOUBLINGS = 3
MOST_COMPARED = 30_000


def find_unresolved_flow(scene: Scene) -> Iterator[Caveat]:
    """Warn if the head loss at t = 0 depends on the mesh; name a refinement that resolves the flow.

    Yields nothing if the flow is resolved or the scene has no outline.
    """
    if scene.flow is None or all(seed.outline is None for seed in scene.aggregates):
        return
    losses = _compute_losses(scene, at_time(scene.flow, 0.0))
    if len(losses) < 2 or (len(losses) == 2 and _is_converged(losses)):
        return
    first = losses[0][1]
    expected = 2 * losses[-1][1] - losses[-2][1]
    yield Caveat("numerics.refinement", f"the head loss at t = 0 is {1e-4 * first:.4g} cm; "
                 f"finer meshes are expected to give about {1e-4 * expected:.4g} cm "
                 f"({100 * (expected / first - 1):+.2g} %); {_advice(losses)}")


def _advice(losses: list[tuple[float, float]]) -> str:
    within = 200 * CHANGE
    if _is_converged(losses):
        return f"numerics.refinement = {losses[-2][0]:g} resolves the flow to about {within:g} %"
    return f"numerics.refinement up to {losses[-1][0]:g} does not resolve the flow"


def _is_converged(losses: list[tuple[float, float]]) -> bool:
    return abs(losses[-2][1] / losses[-1][1] - 1) <= CHANGE


def _compute_losses(scene: Scene, drive: Flow) -> list[tuple[float, float]]:
    """(refinement, head loss in um) of meshes, each twice as fine as the one before, until the loss
    converges, or the next mesh is too large or fails."""
    losses: list[tuple[float, float]] = []
    for doubling in range(DOUBLINGS + 1):
        refinement = 2**doubling * scene.numerics.refinement
        finer = replace(scene, numerics=replace(scene.numerics, refinement=refinement))
        if refinement > MOST_REFINED or first_nodes(finer) > MOST_COMPARED:
            break
        try:
            poll()
            losses.append((refinement, _head_loss(finer, drive)))
        except StageError:
            break
        if doubling and _is_converged(losses):
            break
    return losses


def _head_loss(scene: Scene, drive: Flow) -> float:
    """Head loss (um) of the whole pore at t = 0, with the flow at that time."""
    space = seeded(scene).space
    poll()
    return solving.Solver.of(scene).solve_flow(space, drive).head_loss
