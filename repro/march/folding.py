"""Folding of the aggregate's surface: an end of the model, not a failure.

See :mod:`repro.model.surface`. A run ends where the stretch comes to Biot's limit
(:mod:`repro.march.ends`). A step without a smooth equilibrium fails like any other step. If the
surface can crease already, the failure is reported as a fold. A later failure is reported as a fold
too: the surface has buckled in between. The time of this fold is only known to lie in the failing
step: one of growth.time_step in the paper's scheme, a thousandth of it in the midpoint rule.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from repro.errors import GrowthError, MeshError, RunEnd
from repro.march.state import Compression
from repro.model.energies.neo_hookean import BIOT, CREASE
from repro.model.pore import Pore
from repro.model.surface import surfaces

#: The surface folds if no equilibrium exists and its stretch has been below this, 5 % above CREASE:
#: the stretch varies by up to 6 % within an edge, and runs stop at up to 0.677 (docs/design.md).
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

    An energy without limits of the stretch leaves the earlier one. Where strain counts from the
    last shape, compression does not accumulate: that of the later pore is returned.
    """
    if not any(body.solid.energy.crease for body in pore.bodies):
        return earlier
    number, present = min(enumerate(surfaces(pore)), key=lambda each: each[1].least)
    if pore.accumulates and present.least >= earlier.stretch:
        return earlier
    return Compression(present.least, *present.place, pore.time, pore.name_of(number))


def refuse_fold(expanded: Pore) -> None:
    """Raise GrowthError if a step alone compresses the surface below Biot's limit.

    It applies where strain counts from the last shape: a shorter step compresses the surface less.
    """
    compression = most_compressed(Compression(), expanded)
    if not expanded.accumulates and compression.stretch < expanded.biot:
        raise GrowthError(f"growth in one step compresses the surface to {compression.stretch:.3f} "
                          f"of its length near x = {compression.x:.4g}, y = {compression.y:.4g} um")


@contextmanager
def folding(compression: Compression, time: float) -> Iterator[None]:
    """Raise Fold if a step has no equilibrium and the surface could crease.

    time: h, of the last row or step.
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
    """Raise GrowthError if the density is out of bounds: J = theta does not hold.

    previous: the pore before the step. On a new mesh the step has no equilibrium yet, and J is
    rough where strain is singular, so densities are judged only if the step keeps the mesh.
    maximum_density: X_m, mg/L.
    """
    if not pore.bodies or pore.mesh.topology is not previous.mesh.topology:
        return
    _, least, largest = pore.composition(maximum_density)
    low, high = DENSITIES
    if least < low or largest > high:
        raise GrowthError(f"the density of biomass comes to {least:.2g} to {largest:.2g} X_m, out "
                          f"of {low:g} to {high:g}: a triangle has collapsed")
