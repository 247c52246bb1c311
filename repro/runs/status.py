"""The ``status`` of a run in its ``run.json``."""

import re

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
    names_time = re.search(r" t = \S+ h\b", status)  # as the message of every end of the model
    return status == COMPLETED or bool(names_time) and not status.startswith(FAILED)


def is_known(status: str) -> bool:
    """Is it a status that this version writes?"""
    return (is_over(status) or status in (RUNNING, INTERRUPTED, NOT_RUN)
            or status.startswith(FAILED))
