"""The state of a run after a step, what a row reports of it, and the failure of a step."""

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
from repro.model.body import Body
from repro.model.pore import Pore
from repro.model.solving import Solved

if TYPE_CHECKING:
    from repro.march.balance import Ledger


class Dataclass(Protocol):
    """An instance of any dataclass."""

    __dataclass_fields__: ClassVar[dict[str, Field]]


Data = TypeVar("Data", bound=Dataclass)

#: Two times (h) this close are the same time.
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
        Pore and solution at the end of the last step, grown but not yet expanded (Plate 1). None
        at t = 0, and if the next step fails.
    ledgers : tuple of Ledger
        Mass balances of the steps since the last report.
    remeshes : int
        Number of new meshes since the last report.
    iterations : dict of str to int
        Newton iterations since the last report, by stage.
    new_mesh : bool
        Is the mesh another one than in the last report?
    departed : tuple of str
        How aggregates left the pore at this time, while the run goes on.
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
    """Pore and solution interpolated within a step; ``before``: both before the expansion."""

    pore: Pore
    solved: Solved
    before: tuple[Pore, Solved] | None = None


@dataclass(frozen=True, eq=False)
class StepResult:
    """Result of one step: the new pore, pore and solution before the expansion, and the ledger.

    within: interpolates the state to a time (h) within the step; departed: how aggregates left the
    pore at its end.
    """

    pore: Pore
    before: tuple[Pore, Solved] | None
    ledger: Ledger
    remeshed: bool
    iterations: int
    within: Callable[[float], InterpolatedState]
    departed: tuple[str, ...] = ()


@dataclass(frozen=True)
class Compression:
    """The least elastic stretch of a run's free surface so far.

    x, y: um, its place; time: h; aggregate: its name in messages. A surface may buckle after it
    creases. Its stretch then rises again until the buckles meet, so the present stretch does not
    show a fold.
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

    pore: pore after the step, with the initial guess of its substrates; step_control: of the next
    step; ledgers, remeshes, iterations: of the steps since the last Report; row: time (h) of that
    Report, later than ``pore.time`` if it lies within the next step; compression: the least stretch
    of the surface so far; missing: time (h) of a row within the next step that cannot be computed,
    and the reason.
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

    A sum over a strided view may differ in the last bit from that over its copy in a checkpoint.
    """
    state = pore.concentrations
    mesh = _contiguous_arrays(pore.mesh)
    copied = replace(_contiguous_arrays(pore), concentrations=state and _contiguous_arrays(state),
                     bodies=tuple(map(_contiguous_body, pore.bodies)))
    return copied if mesh is pore.mesh else replace(copied, space=replace(pore.space, mesh=mesh))


def _contiguous_body(body: Body) -> Body:
    """Return the same aggregate with contiguous arrays."""
    return replace(_contiguous_arrays(body), solid=_contiguous_arrays(body.solid),
                   configuration=_contiguous_arrays(body.configuration))


def _contiguous_arrays(data: Data) -> Data:
    """Return a dataclass with its strided arrays copied, or the same object if it has none."""
    arrays = {each.name: getattr(data, each.name) for each in fields(data) if each.init}
    strided = {name: np.ascontiguousarray(array) for name, array in arrays.items()
               if isinstance(array, np.ndarray) and not array.flags.forc}
    return replace(data, **strided) if strided else data


@contextmanager
def stopping(time: float, bonded: bool = False) -> Iterator[None]:
    """Turn the failure of a step that starts at ``time`` (h) into a SimulationError.

    bonded: whether the aggregate is bonded to the lower wall, for the advice in the message. Stage
    errors, floating-point errors and lack of memory count as failures.
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
