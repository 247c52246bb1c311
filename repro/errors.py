"""Numerical failures, each named by its stage.

:func:`repro.march.loop.stopping` adds the time, and :mod:`repro.model.advice` the keys of a scene
that help.
"""


class StageError(RuntimeError):
    """A stage has no trustworthy result; the message says where, why, and what to try."""

    stage = "a stage"


class MeshError(StageError):
    """A mesh cannot be made, or has turned inside out."""

    stage = "meshing"


class TurnedOver(MeshError):
    """A triangle of a mesh is turned over."""


class SelfCrossing(MeshError):
    """An outline of the aggregate crosses itself."""


class OutsidePore(MeshError):
    """The curve through the points of an outline leaves the pore."""


class LinearError(StageError):
    """A linear system is singular or too ill-conditioned."""

    stage = "a linear system"


class PackageMissing(LinearError):
    """An optional package for linear systems is not installed."""


class TransportError(StageError):
    """The substrates cannot be solved for."""

    stage = "transport"


class Unresolved(TransportError):
    """The mesh is too coarse for a front of the substrates."""


class Advised(Unresolved):
    """The same, with the refinement that resolves the state, or the statement that none does."""


class GrowthError(StageError):
    """No equilibrium of the aggregate was found."""

    stage = "growth"


class TransferError(StageError):
    """Fields cannot be carried from one mesh to the other."""

    stage = "transfer between meshes"


class NotCovered(TransferError):
    """Two meshes do not cover the same area."""


class OriginFolded(TransferError):
    """The coordinates at t = 0 fold on a new mesh."""


class BalanceError(StageError):
    """A step does not conserve what it should."""

    stage = "its balance"


class RunEnd(Exception):
    """The model itself ends before ``growth.end``; nothing has failed."""


class SimulationError(RuntimeError):
    """A run has stopped: at what simulated time, in which stage, why, and what to try."""


class OutputError(RuntimeError):
    """A folder or a file of the results cannot be used; says which and why."""


class CheckpointError(ValueError):
    """A checkpoint that cannot be gone on from; says why."""


class Interrupted(Exception):
    """A run was asked to stop by a signal, and has written what it goes on from."""

    def __init__(self, message: str, signal: int):
        super().__init__(message)
        self.signal = signal
