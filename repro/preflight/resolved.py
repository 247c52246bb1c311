"""Check whether the flow around a drawn outline is resolved, by its head loss on finer meshes."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import count

from repro.errors import StageError
from repro.model import solving
from repro.model.meshing import MOST_REFINED, seeded
from repro.polling import poll
from repro.preflight.memory import first_nodes
from repro.preflight.simplifications import Caveat
from repro.scene import Scene, at_time

#: The head loss of a resolved flow changes by at most this share on a mesh twice as fine. Near
#: unresolved corners the error falls with the first power of the size, and is twice the change.
CHANGE = 0.005
#: Each mesh is twice as fine as the one before, with at most this many nodes.
MOST_COMPARED = 30_000


def find_unresolved_flow(scene: Scene) -> Iterator[Caveat]:
    """Warn if the head loss at t = 0 depends on the mesh; name a refinement that resolves the flow.

    The loss (um) is computed on meshes, each twice as fine as the one before, until it converges,
    or the next mesh is too large or fails. Yields nothing if the flow is resolved or the scene has
    no outline.
    """
    if scene.flow is None or all(seed.outline is None for seed in scene.aggregates):
        return
    drive = at_time(scene.flow, 0.0)
    refinements, losses = [], []
    converged = False
    for doubling in count():
        refinement = 2**doubling * scene.numerics.refinement
        finer = replace(scene, numerics=replace(scene.numerics, refinement=refinement))
        if refinement > MOST_REFINED or first_nodes(finer) > MOST_COMPARED:
            break
        try:
            poll()
            space = seeded(finer).space
            poll()
            losses.append(solving.Solver.of(finer).solve_flow(space, drive).head_loss)
        except StageError:
            break
        refinements.append(refinement)
        converged = doubling > 0 and abs(losses[-2] / losses[-1] - 1) <= CHANGE
        if converged:
            break
    if len(losses) < 2 or (len(losses) == 2 and converged):
        return
    expected = 2 * losses[-1] - losses[-2]
    advice = (f"numerics.refinement = {refinements[-2]:g} resolves the flow to about "
              f"{200 * CHANGE:g} %" if converged else
              f"numerics.refinement up to {refinements[-1]:g} does not resolve the flow")
    yield Caveat("numerics.refinement", f"the head loss at t = 0 is {1e-4 * losses[0]:.4g} cm; "
                 f"finer meshes are expected to give about {1e-4 * expected:.4g} cm "
                 f"({100 * (expected / losses[0] - 1):+.2g} %); {advice}")
