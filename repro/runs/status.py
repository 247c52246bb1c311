"""How a run has ended: the ``status`` in its ``run.json``, and which ones there are."""

from __future__ import annotations

import re

COMPLETED = "completed"
RUNNING = "running"
INTERRUPTED = "interrupted"
#: How a status begins that goes on with the reason.
FAILED = "failed: "
TIME = r"t = \d+(?:\.\d+)?(?:e[+-]\d+)? h"
#: The statuses of a run that the model itself ends, and when: :class:`repro.errors.RunEnd`.
RUN_ENDS = (re.compile("the aggregate reaches the pore's (?:up|down)stream end "
                       f"(?:at|in the step from) {TIME}"),
            re.compile(f"the aggregate's surface folds in the step from {TIME}: near x = .*"))


def done(status: str | None) -> bool:
    """Has the run come to its end, the scene's or the model's?"""
    if status is None:
        return False
    return status == COMPLETED or any(end.fullmatch(status) for end in RUN_ENDS)


def undone(status: str | None) -> bool:
    """Is there something left to run? A run at work says so too."""
    return status is not None and (
        status in (RUNNING, INTERRUPTED) or status.startswith(FAILED))
