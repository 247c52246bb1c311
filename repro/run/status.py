"""How a run has ended: the ``status`` in its ``run.json``, and which ones there are."""

from __future__ import annotations

import re

COMPLETED = "completed"
RUNNING = "running"
INTERRUPTED = "interrupted"
#: How a status begins that goes on with the reason.
FAILED = "failed: "
#: The status of a run that ends with its pore, and when: :class:`repro.march.loop.PoreEnd`.
PORE_END = re.compile(r"the aggregate reaches the pore's (?:up|down)stream end "
                      r"(?:at|in the step from) t = \d+(?:\.\d+)?(?:e[+-]\d+)? h")


def done(status: str | None) -> bool:
    """Has the run come to its end, the scene's or the pore's?"""
    return status is not None and (status == COMPLETED or bool(PORE_END.fullmatch(status)))


def undone(status: str | None) -> bool:
    """Is there something left to run? A run at work says so too."""
    return status is not None and (
        status in (RUNNING, INTERRUPTED) or status.startswith(FAILED))
