"""The ``status`` of a run in its ``run.json``."""

import re

COMPLETED = "completed"
RUNNING = "running"
INTERRUPTED = "interrupted"
#: Prefix of a status that states the reason of a failure.
FAILED = "failed: "
AGGREGATE = r"(?:the aggregate|aggregate \S+)"
TIME = r"t = \d+(?:\.\d+)?(?:e[+-]\d+)? h"
#: The statuses of a run that the model itself ends: :class:`repro.errors.RunEnd`.
RUN_ENDS = (re.compile(f"{AGGREGATE} reaches the pore's (?:up|down)stream end "
                       f"(?:at|in the step from) {TIME}(?:; .*)?"),
            re.compile(f"{AGGREGATE}'s surface folds (?:at|in the step from) {TIME}: growth .*"),
            re.compile(f"{AGGREGATE} (?:detaches|tears) at {TIME}: near x = .*"),
            re.compile(f"{AGGREGATE} is eroded at {TIME}: .*"),
            re.compile(f"erosion takes a contact surface at y = .* um in the step from {TIME}"),
            re.compile(f"the aggregates are steady at {TIME}: .*"),
            re.compile(f"{AGGREGATE}'s surface touches itself at {TIME}: near x = .*"),
            re.compile(f"aggregates .* touch in a second place at {TIME}: near x = .*"),
            re.compile(rf"{AGGREGATE} touches the wall y = \S+ um at {TIME}: near x = .*"),
            re.compile(rf"(?:{AGGREGATE} touches|aggregates .* touch) the wall y = \S+ um in a "
                       f"second place at {TIME}: near x = .*"),
            re.compile(rf"aggregates .* and \S+ meet (?:at|in the step from) {TIME}(?:: .*)?"))


def is_fold(status: str) -> bool:
    """Has the model ended the run as a fold?"""
    return bool(RUN_ENDS[1].fullmatch(status))


def is_over(status: str) -> bool:
    """Has the run reached the end of its scene or of the model?"""
    return status == COMPLETED or any(end.fullmatch(status) for end in RUN_ENDS)
