"""Errors of the package: numerical failures by stage, ends of a run, and failures of files.

:func:`repro.march.state.stopping` adds the time to a failure, and :mod:`repro.model.advice` adds
the keys of a scene that help. The message of a refusal names options of the command line; its
``str`` names arguments of Python.
"""

import re
import shlex
from collections.abc import Iterator
from contextlib import contextmanager

#: Arguments of Python for options of the command line; others have the name of the option.
ARGUMENTS = {"--out": "folder", "--set": "overrides", "--force": "force=True",
             "--resume": "repro.resume"}
OPTION = re.compile(r"(?<![\w'\"-])--(?:out|set|unset|force|resume|vary|samples|seed|scheduler|"
                    r"limit)\b")


def printable(text: str) -> str:
    """Write a text on one line: bytes that are no text as escapes, control characters as spaces."""
    text = text.encode(errors="backslashreplace").decode()
    return "".join(letter if letter.isprintable() else " " for letter in text)


def shortened(text: str, longest: int = 60) -> str:
    """Shorten a text in a message to at most ``longest`` characters."""
    return text if len(text) <= longest else text[:longest - 3] + "..."


def shell_word(path: object) -> str:
    """Write a path as a word of a command: in quotes if necessary, and never an option."""
    text = str(path)
    return shlex.quote(f"./{text}" if text.startswith("-") else text)


class Refusal(Exception):
    """Input or a folder is refused. ``args[0]`` names options; ``str`` names Python arguments."""

    def __str__(self) -> str:
        return OPTION.sub(lambda match: ARGUMENTS.get(match[0], match[0][2:]), super().__str__())


class StageError(RuntimeError):
    """A stage has no reliable result; the message says where, why, and what to try.

    Its subclasses name their stage. A run adds the time and raises :class:`SimulationError`.

    Examples
    --------
    >>> from repro.errors import StageError
    >>> class DetachmentError(StageError):
    ...     stage = "detachment"
    >>> DetachmentError("no criterion for t < 0; try growth.end = 0 h").stage
    'detachment'
    """

    stage = "a stage"


@contextmanager
def failing_as(failure: type[StageError]) -> Iterator[None]:
    """Turn an arithmetic error into the failure of a stage; a decorator of its iterations.

    Parameters
    ----------
    failure : type of StageError
        The error of the stage.

    Yields
    ------
    None

    Raises
    ------
    StageError
        The failure, where an iterate leaves the domain of a power, root, logarithm or division. A
        caller shortens its step, as for an iteration that does not converge.

    Examples
    --------
    >>> from repro.errors import GrowthError, failing_as
    >>> @failing_as(GrowthError)
    ... def stretch(J):
    ...     return 1 / J
    >>> try:
    ...     stretch(0.0)
    ... except GrowthError as error:
    ...     print(error)
    an iterate leaves the domain of its equations (float division by zero)
    """
    try:
        yield
    except ArithmeticError as error:
        raise failure(f"an iterate leaves the domain of its equations ({error})") from error


class MeshError(StageError):
    """A mesh cannot be generated, or is turned inside out."""

    stage = "meshing"


class OutsidePore(MeshError):
    """The curve through the points of an outline leaves the pore."""


class LinearError(StageError):
    """A linear system is singular or too ill-conditioned."""

    stage = "a linear system"


class PackageMissing(LinearError):
    """An optional package for linear systems is not installed."""


class TransportError(StageError):
    """The equations of the substrates cannot be solved."""

    stage = "transport"


class Unresolved(TransportError):
    """The mesh is too coarse for a sharp front of the substrates."""


class GrowthError(StageError):
    """The solver finds no equilibrium of the aggregate."""

    stage = "growth"


class ErosionError(StageError):
    """The surface of an aggregate recedes too far in one step."""

    stage = "erosion"


class ContactEroded(ErosionError):
    """Nothing is left of a contact surface after one step."""


class TransferError(StageError):
    """Fields cannot be transferred from one mesh to another."""

    stage = "transfer between meshes"


class OriginFolded(TransferError):
    """The reference coordinates (t = 0) fold on a new mesh."""


class BalanceError(StageError):
    """A step violates a mass balance."""

    stage = "its balance"


class RunEnd(Exception):
    """The model ends before ``growth.end``: an end of :mod:`repro.march.ends`. No failure.

    Its message contains the time, for example "t = 3.5 h". The status of a run repeats the message,
    and a status with a time says that the run is over.
    """


class SimulationError(RuntimeError):
    """A numerical failure stops a simulation.

    The message names the simulated time (h), the stage, the reason and what to try. The original
    error is its ``__cause__``.

    Examples
    --------
    >>> import repro
    >>> try:
    ...     results = repro.solve("base", ["flow.head=1e-300 um", 'growth.end="1 h"'])
    ... except repro.SimulationError as error:
    ...     print(str(error).partition(":")[0])
    stopped in the step from t = 0 h, in transport
    """


class OutputError(Refusal, RuntimeError):
    """A folder or a file of results cannot be read or written; the message says which and why.

    Examples
    --------
    >>> import repro
    >>> try:
    ...     repro.load_run("no/such/folder")
    ... except repro.OutputError:
    ...     print("not a run")
    not a run
    """


class CheckpointError(ValueError):
    """A run cannot resume from a checkpoint; the message says why."""


class Interrupted(Exception):
    """A signal stopped a run, after it wrote the checkpoint from which it can resume."""

    def __init__(self, message: str, signal: int):
        super().__init__(message)
        self.signal = signal
