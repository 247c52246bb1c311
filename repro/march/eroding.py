"""A step with erosion, by Strang's splitting.

Surfaces recede for half of the step, biomass grows for the whole step, and surfaces recede for the
other half. The splitting is of second order if its parts are. :mod:`repro.march.midpoint` computes
the growth, :mod:`repro.model.erosion` the erosion. The ledger's detached mass is the biomass that
both halves of the erosion remove. The error estimate of growth gets a second term: the difference
of the masses that both halves remove, over the biomass. A row within a step is the end of a shorter
step.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from repro.errors import ContactEroded
from repro.march import midpoint
from repro.march.ends import Detachment
from repro.march.midpoint import Attempt
from repro.march.state import InterpolatedState, StepResult
from repro.model.contact_lines import PATIENT, SearchOptions
from repro.model.pore import Pore
from repro.model.remeshing import GeneratedMesh
from repro.model.solving import Solved
from repro.model.stages import Stages
from repro.scene import needed


def attempt(stages: Stages, previous: Pore, solved: Solved, duration: float,
            largest_change: float = np.inf, search: SearchOptions = PATIENT,
            meshes: tuple[GeneratedMesh, ...] = ()) -> Attempt:
    """Attempt a step of ``duration`` (h) with erosion.

    Arguments and errors are those of :func:`midpoint.attempt`. Also raises ErosionError if a
    surface recedes too far, and Detachment if a contact surface vanishes.
    """
    if not previous.bodies:
        return midpoint.attempt(stages, previous, solved, duration, largest_change, search, meshes)
    start, at_start = stages.grading.solve(_erode(stages, previous, duration / 2, solved))
    start = replace(start, concentrations=at_start.concentrations)
    grown = midpoint.attempt(stages, start, at_start, duration, largest_change, search, meshes)
    if grown.step is None:
        return grown
    end = _erode(stages, grown.step.pore, duration / 2, at_start)
    lost = previous.mass - start.mass, grown.step.pore.mass - end.mass
    change = grown.change + abs(lost[1] - lost[0]) / (previous.mass * duration)
    if change > largest_change:
        return Attempt(None, change)
    ledger = replace(grown.step.ledger, biomass_before=previous.mass, biomass_after=end.mass,
                     detached=sum(lost))
    inner = partial(_interpolate, stages, previous, solved)
    step = StepResult(end, None, ledger, True, grown.step.iterations, inner)
    return Attempt(step, change, grown.gaps)


def _erode(stages: Stages, pore: Pore, duration: float, solved: Solved) -> Pore:
    """The pore after a duration (h) of erosion. Raises Detachment if a contact surface vanishes."""
    erosion = needed(stages.erosion, "[growth.erosion]")
    try:
        return erosion.erode(pore, duration, solved.mean_velocity)
    except ContactEroded as error:
        raise Detachment(f"erosion takes {error} in the step from t = {pore.time:g} h") from error


def _interpolate(stages: Stages, previous: Pore, solved: Solved, time: float) -> InterpolatedState:
    """The state at a time (h) within a step: the end of a shorter step."""
    step = needed(attempt(stages, previous, solved, time - previous.time).step, "a shorter step")
    return InterpolatedState(*stages.grading.solve(replace(step.pore, time=time)))
