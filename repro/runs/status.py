"""The ``status`` of a run in its ``run.json``."""

COMPLETED = "completed"
RUNNING = "running"
INTERRUPTED = "interrupted"
#: Of a point of a sweep without a run.
NOT_RUN = "not run"
#: Prefix of a status that states the reason of a failure.
FAILED = "failed: "


def is_fold(status: str) -> bool:
    """Has the model ended the run as a fold?"""
    return is_over(status) and "'s surface folds " in status


def is_over(status: str) -> bool:
    """Has the run reached the end of its scene, or of the model: :class:`repro.errors.RunEnd`?"""
    return status not in (RUNNING, INTERRUPTED, NOT_RUN) and not status.startswith(FAILED)
