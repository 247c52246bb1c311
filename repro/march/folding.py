"""Where the aggregate's surface folds, which is the model's own end, and no failure.

See :mod:`repro.model.surface`. A step that ends below Biot's limit is not taken. A step for which
no smooth equilibrium exists fails like any other; where the surface can crease already, that is
what the failure means.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from repro.errors import GrowthError, MeshError, RunEnd
from repro.model.pore import Pore
from repro.model.surface import BIOT, CREASE, surface
from repro.scene import Scene, needed

#: Where no equilibrium exists and the last stretch is below this, the surface folds. Meshes of two
#: presets and refinements stop at 0.64 to 0.66 (docs/design.md): a crease begins within a step.
CREASING = 0.68
#: The least and the largest density of a node over X_m in a shape that counts as smooth.
DENSITIES = 0.5, 2.0


class Fold(RunEnd):
    """The aggregate's surface folds: no smooth equilibrium is left."""


def refuse_fold(now: Pore, expanded: Pore) -> None:
    """Raises Fold where a step from ``now`` ends below Biot's limit."""
    if surface(expanded).least < BIOT:
        raise Fold(_message(expanded, now.time))


@contextmanager
def folding(now: Pore, time: float) -> Iterator[None]:
    """A step from ``now`` that has no equilibrium is a Fold where the surface can crease; time: h,
    of the last row or step."""
    try:
        yield
    except (GrowthError, MeshError) as error:
        if now.outline is None or surface(now).least >= CREASING:
            raise
        raise Fold(_message(now, time)) from error


def _message(now: Pore, time: float) -> str:
    """How a run ends that comes as far as ``time`` (h); stretch and place are of ``now``."""
    found = surface(now)
    x, y = found.place
    return (f"the aggregate's surface folds in the step from t = {time:g} h: near x = {x:.4g}, "
            f"y = {y:.4g} um growth compresses it to an elastic stretch of {found.least:.3f}; it "
            f"creases from {CREASE:g} on and is unstable to all waves below {BIOT:g}, so that the "
            "model has no smooth shape any more; a finer mesh does not help, "
            'growth.new_biomass = "stress_free" does')


def refuse_density(scene: Scene, now: Pore) -> None:
    """Raises GrowthError where the density of a node is out of bounds: J = theta is lost there."""
    maximum = needed(scene.kinetics, "[kinetics]").maximum_density
    _, least, largest = now.composition(maximum)
    low, high = DENSITIES
    if least < low or largest > high:
        raise GrowthError(f"the density of biomass comes to {least:.2g} to {largest:.2g} X_m, out "
                          f"of {low:g} to {high:g}: a triangle has collapsed; try a shorter "
                          "growth.time_step or a larger numerics.refinement")
