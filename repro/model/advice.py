"""Advice for errors of the finite elements: the keys of a scene that help.

:mod:`repro.fem` does not know the scene, so its messages cannot name the keys.
"""

from __future__ import annotations

from repro.errors import OriginFolded, OutsidePore, PackageMissing, StageError, Unresolved

ADVICE: dict[type[StageError], str] = {
    OutsidePore: "; aggregate.outline: try smooth = false",
    Unresolved: "; try a larger numerics.refinement, or the linear elements of "
                'numerics.preset = "paper"',
    PackageMissing: ", or leave numerics.solver out",
}


#: Advice on a bonded wall, where strain at contact lines is singular.
BONDED: dict[type[StageError], str] = {
    OriginFolded: "; no setting helps reliably: the strain at the contact lines of a bonded wall "
                  'is singular, and a finer mesh may stop the run sooner; growth.wall = "sliding" '
                  "is another model",
}


def with_advice(error: StageError, bonded: bool = False) -> str:
    """The message of an error, with advice about the scene's keys.

    bonded: is the aggregate bonded to the lower wall?
    """
    advice = ADVICE | BONDED if bonded else ADVICE
    return f"{error}{advice.get(type(error), '')}"
