"""How a run has ended: the ``status`` in its ``run.json``, and which ones there are."""

from __future__ import annotations

COMPLETED = "completed"
RUNNING = "running"
INTERRUPTED = "interrupted"
#: How a status begins that goes on with the reason.
FAILED, PORE_END = "failed: ", "the aggregate reaches "


def done(status: str | None) -> bool:
    """Has the run come to its end, the scene's or the pore's?"""
    return status is not None and (status == COMPLETED or status.startswith(PORE_END))


def undone(status: str | None) -> bool:
    """Is there something left to run? A run at work says so too."""
    return status is not None and (
        status in (RUNNING, INTERRUPTED) or status.startswith(FAILED))
