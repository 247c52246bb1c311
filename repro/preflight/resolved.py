"""Is the flow around a drawn outline resolved? Its head loss at t = 0 on finer and finer meshes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from repro.errors import StageError
from repro.model import pore
from repro.model.remeshing import MOST_REFINED
from repro.preflight.memory import first_nodes
from repro.preflight.simplifications import Warned
from repro.scene import Scene

#: The head loss of a resolved flow changes by no more than this share on a mesh twice as fine.
#: Where corners are not resolved, the error falls with the first power of the elements: it is twice
#: that.
CHANGE = 0.005
#: Meshes twice, four and eight times as fine are tried, up to so many nodes.
DOUBLINGS = 3
MOST_COMPARED = 30_000


def unresolved(scene: Scene) -> Iterator[Warned]:
    """What the head loss at t = 0 is, what is to be expected, and a refinement that resolves it.

    Nothing where the flow is resolved or no outline is drawn.
    """
    if scene.flow is None or scene.aggregate is None or scene.aggregate.outline is None:
        return
    tried = _losses(scene)
    if len(tried) < 2 or (len(tried) == 2 and _settled(tried)):
        return
    first = tried[0][1]
    expected = 2 * tried[-1][1] - tried[-2][1]
    yield Warned("numerics.refinement", f"the head loss at t = 0 is {1e-4 * first:.4g} cm, and "
                 f"about {1e-4 * expected:.4g} cm ({100 * (expected / first - 1):+.2g} %) are "
                 f"expected of finer meshes; {_advice(tried)}")


def _advice(tried: list[tuple[float, float]]) -> str:
    within = 200 * CHANGE
    if _settled(tried):
        return f"numerics.refinement = {tried[-2][0]:g} resolves the flow to about {within:g} %"
    return f"numerics.refinement up to {tried[-1][0]:g} does not resolve the flow"


def _settled(tried: list[tuple[float, float]]) -> bool:
    return abs(tried[-2][1] / tried[-1][1] - 1) <= CHANGE


def _losses(scene: Scene) -> list[tuple[float, float]]:
    """(refinement, head loss in um) of meshes, each twice as fine as the one before, until the loss
    settles or the next mesh is too large or fails."""
    tried: list[tuple[float, float]] = []
    for doubling in range(DOUBLINGS + 1):
        refinement = 2**doubling * scene.numerics.refinement
        finer = replace(scene, numerics=replace(scene.numerics, refinement=refinement))
        if refinement > MOST_REFINED or first_nodes(finer) > MOST_COMPARED:
            break
        try:
            tried.append((refinement, _head_loss(finer)))
        except StageError:
            break
        if doubling and _settled(tried):
            break
    return tried


def _head_loss(scene: Scene) -> float:
    """Of the whole pore at t = 0, um."""
    return pore.solve_flow(scene.at(0.0), pore.seeded(scene).space).head_loss
