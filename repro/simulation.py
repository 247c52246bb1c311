"""Run a scene in the way that its ``numerics.time`` names."""

from __future__ import annotations

from collections.abc import Iterator

from repro import coupling, linear, stepping
from repro.coupling import Instant


def simulate(scene) -> Iterator[Instant]:
    """Yields an Instant at t = 0 and at each reported time: at ``output.times``, or after every step.

    Raises SimulationError where a stage fails, and PoreEnd, after a last Instant, where the aggregate reaches an end of
    the pore.
    """
    linear.use(scene.numerics.solver, scene.numerics.ordering)
    return (stepping if scene.numerics.time == "midpoint" else coupling).simulate(scene)
