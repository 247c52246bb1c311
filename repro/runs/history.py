"""The history of a run: its rows, fields and counts so far. A checkpoint stores it."""

from dataclasses import dataclass, field
from pathlib import Path

from repro.errors import CheckpointError
from repro.results.files import is_file, sha256_of
from repro.results.quantities import Quantity

#: Rows of a table, each a list of numbers or None.
Table = list[list]


@dataclass
class History:
    """Rows of the tables, ``(time in h, file)`` of the fields, their SHA-256, and counts.

    seconds: total wall time; stages: wall time by stage; resumes: when the run was resumed;
    warnings: ``key`` of the scene and ``text`` of each simplification that does not hold; surface:
    the same for creases, and for positions at t = 0 that fold; missed: number of steps that do not
    meet the tolerance; worst: the largest of their error estimates; missing: time (h) of each row
    that cannot be computed, and the reason; departed: how aggregates left the pore while the run
    went on.
    """

    rows: Table = field(default_factory=list)
    ledgers: Table = field(default_factory=list)
    index: list[tuple[float, str]] = field(default_factory=list)
    before: list[tuple[float, str]] = field(default_factory=list)
    hashes: dict[str, str] = field(default_factory=dict)
    remeshes: int = 0
    iterations: dict[str, int] = field(default_factory=dict)
    seconds: float = 0.0
    stages: dict[str, float] = field(default_factory=dict)
    resumes: list[dict] = field(default_factory=list)
    warnings: list[dict[str, str]] = field(default_factory=list)
    surface: list[dict[str, str]] = field(default_factory=list)
    missed: int = 0
    worst: float = 0.0
    missing: list[tuple[float, str]] = field(default_factory=list)
    departed: list[str] = field(default_factory=list)


#: The counts and times in ``run.json``; ``value`` takes a History.
COUNTS = (
    Quantity("rows", "rows of the time series", "those of timeseries.csv",
             lambda history: len(history.rows)),
    Quantity("wall_time_s", "wall time", "of the process that runs, and of those before a resume",
             lambda history: history.seconds),
    Quantity("wall_time_by_stage_s", "wall time by stage",
             "within each stage; the time of a stage that another one calls counts in both",
             lambda history: history.stages),
    Quantity("newton_iterations", "Newton's iterations, for growth and for transport",
             "of the solutions at the start and the end of each step; half steps and rejected "
             "attempts are not counted", lambda history: history.iterations),
    Quantity("remeshes", "new meshes", "steps that end on a new mesh",
             lambda history: history.remeshes),
)


def restore_history(plain: dict) -> History:
    """Restore a History from ``vars(history)`` after a round trip through JSON."""
    pairs = {name: list(map(tuple, plain.get(name, ()))) for name in ("index", "before", "missing")}
    return History(**plain | pairs)


def require_fields(folder: Path, history: History) -> None:
    """Raise CheckpointError if the SHA-256 of a fields file is not the one in the history."""
    for name, expected in history.hashes.items():
        if not is_file(folder / name) or sha256_of(folder / name) != expected:
            raise CheckpointError(f"{name} is missing, cut short or altered since it was written")
