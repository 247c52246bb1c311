"""The keys of a scene that help against errors of the finite elements, which know no scene."""

from __future__ import annotations

from repro.errors import (
    NotCovered,
    OriginFolded,
    OutsidePore,
    PackageMissing,
    SelfCrossing,
    StageError,
    TurnedOver,
)

ADVICE: dict[type[StageError], str] = {
    TurnedOver: "; try a larger numerics.refinement or a shorter growth.time_step",
    SelfCrossing: "; a shorter growth.time_step or a larger numerics.refinement helps a coarse "
                  "outline; nothing helps where two parts of the surface meet: contact is modelled "
                  "with the walls alone",
    OutsidePore: "; aggregate.outline: give more points, or smooth = false",
    NotCovered: "; try a shorter growth.time_step",
    OriginFolded: "; try a larger numerics.refinement",
    PackageMissing: ", or leave numerics.solver and numerics.ordering out",
}


def with_advice(error: StageError) -> str:
    """The message of an error with the keys of a scene that help against it."""
    return f"{error}{ADVICE.get(type(error), '')}"
