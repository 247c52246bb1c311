"""The state of a run after a step, the Report of a row, and the message of a failed step."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import Field, dataclass, field, fields, replace
from typing import TYPE_CHECKING, ClassVar, Protocol, TypeVar

import numpy as np

from repro.errors import SimulationError, StageError
from repro.fem.brief import brief
from repro.march.step_control import StepControl
from repro.model.advice import with_advice
from repro.model.pore import Pore
from repro.model.solving import Solved

if TYPE_CHECKING:
    from repro.march.balance import Ledger
    from repro.model.remeshing import GeneratedMesh


class Dataclass(Protocol):
    """An instance of any dataclass."""

    __dataclass_fields__: ClassVar[dict[str, Field]]


Data = TypeVar("Data", bound=Dataclass)

#: Two times (h) are equal if they differ by at most this.
SAME_TIME = 1e-9


@brief
@dataclass(frozen=True, eq=False)
class Report:
    """State of the pore at a reported time, for one row of results.

    Attributes
    ----------
    pore : Pore
        Pore at the reported time ``pore.time`` (h).
    solved : Solved
        Flow and substrates in the geometry of ``pore``.
    before : (Pore, Solved) or None
        Pore and solution at the end of the last step, after growth and before the expansion (Plate
        1). None at t = 0, and if the next step fails.
    ledgers : tuple of Ledger
        Mass balances of the steps since the last report.
    remeshes : int
        Number of new meshes since the last report.
    iterations : dict of str to int
        Newton iterations since the last report, by stage.
    new_mesh : bool
        Does the mesh differ from the mesh of the last report?
    departed : tuple of str
        For each aggregate that leaves the pore at this time, the message of its event.
    """

    pore: Pore
    solved: Solved
    before: tuple[Pore, Solved] | None
    ledgers: tuple[Ledger, ...]
    remeshes: int
    iterations: dict[str, int]
    new_mesh: bool = False
    departed: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class InterpolatedState:
    """Pore and solution interpolated within a step; before: pore and solution before the expansion.
    """

    pore: Pore
    solved: Solved
    before: tuple[Pore, Solved] | None = None


@dataclass(frozen=True, eq=False)
class StepResult:
    """Result of one step.

    pore: at the end; before: pore and solution after growth and before the expansion; ledger: mass
    balance; remeshed: does the step make a new mesh?; iterations: of Newton's method; within:
    interpolates the state to a time (h) within the step; departed: as :attr:`Report.departed`;
    generated: meshes for shorter steps from the same start (:func:`remeshing.new_mesh`).
    """

    pore: Pore
    before: tuple[Pore, Solved] | None
    ledger: Ledger
    remeshed: bool
    iterations: int
    within: Callable[[float], InterpolatedState]
    departed: tuple[str, ...] = ()
    generated: tuple[GeneratedMesh, ...] = ()


@dataclass(frozen=True)
class Compression:
    """The least elastic stretch of a run's free surface so far.

    x, y: um, its coordinates; time: h; aggregate: name of the aggregate in messages. A surface may
    buckle after it creases. Its stretch then rises again until the buckles touch, so the present
    stretch does not show a fold.
    """

    stretch: float = 1.0
    x: float = 0.0
    y: float = 0.0
    time: float = 0.0
    aggregate: str = "the aggregate"


@brief
@dataclass(frozen=True, eq=False)
class RestartState:
    """Complete state from which a run restarts after a step.

    pore: after the step, with the initial guess of its substrates; step_control: of the next step;
    ledgers, remeshes, iterations: of the steps since the last Report; row: time (h) of the last
    Report, later than ``pore.time`` if this Report lies within the next step; compression: the
    least stretch of the surface so far; missing: time (h) of a row within the next step that cannot
    be computed, and the reason.
    """

    pore: Pore
    step_control: StepControl
    ledgers: tuple[Ledger, ...] = ()
    remeshes: int = 0
    iterations: dict[str, int] = field(default_factory=dict)
    row: float = 0.0
    compression: Compression = Compression()
    missing: tuple[float, str] | None = None

    @property
    def time(self) -> float:
        """Simulated time (h) that the run has reached."""
        return max(self.pore.time, self.row)


def initial_report(state: RestartState, solved: Solved) -> Report:
    """Report the state at t = 0."""
    pore = replace(state.pore, concentrations=solved.concentrations)
    return Report(pore, solved, None, (), 0, newton_counts(solved))


def contiguous(pore: Pore) -> Pore:
    """Return the same pore with contiguous arrays.

    The sum over a strided view and the sum over its copy in a checkpoint may differ in the last
    bit.
    """
    state = pore.concentrations
    mesh = _contiguous_arrays(pore.mesh)
    copied = replace(_contiguous_arrays(pore), concentrations=state and _contiguous_arrays(state),
                     bodies=tuple(replace(
                         _contiguous_arrays(body), solid=_contiguous_arrays(body.solid),
                         configuration=_contiguous_arrays(body.configuration))
                         for body in pore.bodies))
    return copied if mesh is pore.mesh else replace(copied, space=replace(pore.space, mesh=mesh))


def _contiguous_arrays(data: Data) -> Data:
    """Return a dataclass with its strided arrays copied, or the same object if it has none."""
    arrays = {each.name: getattr(data, each.name) for each in fields(data) if each.init}
    strided = {name: np.ascontiguousarray(array) for name, array in arrays.items()
               if isinstance(array, np.ndarray) and not array.flags.forc}
    return replace(data, **strided) if strided else data


@contextmanager
def stopping(time: float, bonded: bool = False) -> Iterator[None]:
    """Raise SimulationError in place of the error of a step that starts at ``time`` (h).

    bonded: is the aggregate bonded to the lower wall? The advice in the message depends on it. The
    replaced errors are StageError, FloatingPointError and MemoryError.
    """
    stopped = f"stopped in the step from t = {time:g} h"
    try:
        with np.errstate(all="raise", under="ignore"):
            yield
    except StageError as error:
        message = f"{stopped}, in {error.stage}: {with_advice(error, bonded)}"
        raise SimulationError(message) from error
    except FloatingPointError as error:
        raise SimulationError(f"{stopped} by a floating-point error ({error})") from error
    except MemoryError as error:
        raise SimulationError(f"{stopped}, out of memory ({error}); "
                              "try a smaller numerics.refinement") from error


def newton_counts(solved: Solved) -> dict[str, int]:
    """Newton iterations by stage."""
    return {"transport": solved.concentrations.iterations if solved.concentrations else 0}


def sum_counts(*counts: dict[str, int]) -> dict[str, int]:
    """Add counts, key by key."""
    total: Counter[str] = Counter()
    for count in counts:
        total.update(count)
    return dict(sorted(total.items()))
