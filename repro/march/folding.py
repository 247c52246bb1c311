"""Folding of the aggregate's surface: an end of the model, not a failure.

:mod:`repro.model.surface` computes the stretch. A run ends where the stretch reaches Biot's limit
(:mod:`repro.march.ends`). A step without a smooth equilibrium fails. The failure is reported as a
fold if the surface can crease, or if it could at any earlier time of the run: the surface may have
buckled since. The fold lies within the failing step. This step is growth.time_step long in the
paper's scheme, and a thousandth of it in the midpoint rule.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from repro.errors import GrowthError, MeshError, RunEnd
from repro.march.state import Compression
from repro.model.energies.neo_hookean import BIOT, CREASE
from repro.model.pore import Pore
from repro.model.surface import surfaces

#: A step without equilibrium is a fold if the surface's stretch has been below this. The bound is
#: 5 % above CREASE, because the stretch varies by up to 6 % within an edge, and runs stop at up to
#: 0.677 (docs/design.md).
CREASING = 0.68
#: Accepted range of the density at a node, over X_m.
DENSITIES = 0.5, 2.0


class Fold(RunEnd):
    """The aggregate's surface folds: the model has no smooth equilibrium any more.

    :func:`repro.simulate` raises it after the last Report. It is an end of the model, not a
    failure: the message names the time (h), the coordinates (um) of the fold, and the elastic
    stretch of the surface there. :mod:`repro.march.ends` has the other early ends of a run.

    Examples
    --------
    >>> import repro
    >>> reports = repro.simulate(repro.load_scene("base", ['growth.end="1 h"']))
    >>> try:
    ...     times = [report.pore.time for report in reports]
    ... except (repro.Fold, repro.PoreEnd) as end:
    ...     print(f"the run ends early: {end}")
    """


def most_compressed(earlier: Compression, pore: Pore) -> Compression:
    """Return the compression of a pore if its stretch is smaller than an earlier one.

    If no energy has limits of the stretch, the result is the earlier compression. If strain counts
    from the last shape, compression does not accumulate, and the result is that of ``pore``.
    """
    if not any(body.solid.energy.crease for body in pore.bodies):
        return earlier
    number, present = min(enumerate(surfaces(pore)), key=lambda each: each[1].least)
    if pore.accumulates and present.least >= earlier.stretch:
        return earlier
    return Compression(present.least, *present.place, pore.time, pore.name_of(number))


def refuse_fold(expanded: Pore) -> None:
    """Raise GrowthError if a step alone compresses the surface below Biot's limit.

    The test applies only if strain counts from the last shape. A shorter step then compresses the
    surface less.
    """
    compression = most_compressed(Compression(), expanded)
    if not expanded.accumulates and compression.stretch < expanded.biot:
        raise GrowthError(f"growth in one step compresses the surface to {compression.stretch:.3f} "
                          f"of its length near x = {compression.x:.4g}, y = {compression.y:.4g} um")


@contextmanager
def folding(compression: Compression, time: float) -> Iterator[None]:
    """Raise Fold in place of GrowthError or MeshError if the surface could crease.

    compression: the largest one of the run so far; time: h, of the last row or step.
    """
    try:
        yield
    except (GrowthError, MeshError) as error:
        if compression.stretch >= CREASING:
            raise
        raise Fold(fold_message(f"in the step from t = {time:g} h", compression)) from error


def fold_message(when: str, compression: Compression) -> str:
    """Message of a Fold; when: "at t = 1 h" or "in the step from t = 1 h"."""
    return (f"{compression.aggregate}'s surface folds {when}: growth compressed it to an elastic "
            f"stretch of {compression.stretch:.3f} near x = {compression.x:.4g}, "
            f"y = {compression.y:.4g} um at t = {compression.time:g} h; "
            f"it creases from {CREASE:g} on and is unstable to all waves below {BIOT:g}, so that "
            "the model has no smooth shape any more; a finer mesh does not help, "
            'growth.new_biomass = "stress_free" does')


def refuse_density(previous: Pore, pore: Pore, maximum_density: float) -> None:
    """Raise GrowthError if the density is out of bounds, so that J = theta is violated.

    previous: the pore before the step; maximum_density: X_m, mg/L. Densities are tested only if the
    step keeps the mesh: a new mesh has no equilibrium yet, and J is rough where strain is singular.
    """
    if not pore.bodies or pore.mesh.topology is not previous.mesh.topology:
        return
    _, least, largest = pore.composition(maximum_density)
    low, high = DENSITIES
    if least < low or largest > high:
        raise GrowthError(f"the density of biomass comes to {least:.2g} to {largest:.2g} X_m, out "
                          f"of {low:g} to {high:g}: a triangle has collapsed")
