"""Run a scene into a folder: rows and fields as they come, tables and provenance at the end, whatever the end is."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter

from repro import netcdf, report, results, timing
from repro.coupling import Instant, PoreEnd
from repro.errors import SimulationError
from repro.scene import Scene
from repro.simulation import simulate

#: Everything that a run writes, beside its fields; a folder that holds anything else is not written to.
OWN = ("timeseries.csv", "timeseries.nc", "ledger.csv", "fields.pvd", "before_expansion.pvd", "run.json", "report.html")
FIELDS = re.compile(r"(?:\.part-)?(?:fields|before_expansion)_\d{4,}\.vtu")


class OutputError(RuntimeError):
    """The output folder cannot be used; says which and why."""


class Recorder:
    """Collects a run's rows and writes its files to ``folder``."""

    def __init__(self, scene: Scene, folder: Path):
        self.scene, self.folder = scene, folder
        self.rows, self.ledgers, self.index, self.before = [], [], [], []
        self.remeshes, self.iterations = 0, {}

    def add(self, instant: Instant) -> None:
        """Take one instant: its row, its ledgers and its fields."""
        found = results.row(self.scene, instant)
        self.rows.append([found[name] for name in results.COLUMNS])
        self.ledgers += [results.ledger_row(ledger) for ledger in instant.ledgers]
        self.remeshes += instant.remeshes
        for stage, count in instant.iterations.items():
            self.iterations[stage] = self.iterations.get(stage, 0) + count
        self._write_fields(self.index, "fields", instant.pore, instant.solved)
        if instant.before and self.scene.output.times:
            self._write_fields(self.before, "before_expansion", *instant.before)

    def _write_fields(self, index: list, kind: str, pore, solved) -> None:
        name = f"fields/{kind}_{len(index):04d}.vtu"
        results.write_fields(self.folder / name, results.fields(self.scene, pore, solved))
        index.append((pore.time, name))

    def finish(self, status: str, seconds: float) -> None:
        """Write tables, indices and provenance."""
        results.write_table(self.folder / "timeseries.csv", results.COLUMNS, self.rows)
        results.write_index(self.folder / "fields.pvd", self.index)
        if self.ledgers:
            results.write_table(self.folder / "ledger.csv", results.LEDGER_COLUMNS, self.ledgers)
        if self.before:
            results.write_index(self.folder / "before_expansion.pvd", self.before)
        results.write_json(self.folder / "run.json", {
            **results.provenance(self.scene), "status": status, "rows": len(self.rows), "wall_time_s": seconds,
            "wall_time_by_stage_s": dict(timing.seconds), "newton_iterations": self.iterations,
            "remeshes": self.remeshes})
        if self.scene.output.timeseries == "netcdf":
            netcdf.write(self.folder / "timeseries.nc", self.scene, self.rows)
        report.write(self.folder)


def prepare(folder: Path) -> None:
    """Make the folder, empty of an earlier run. Raises OutputError where it holds anything else or can't be made."""
    with _usable(folder):
        strange = _strange(folder) if folder.exists() else []
        if strange:
            raise OutputError(f"--out {folder}: it holds {strange[0]!r}, which is not of a run; "
                              "a new or empty folder, or one of an earlier run, is accepted")
        (folder / "fields").mkdir(parents=True, exist_ok=True)
        for old in (*(folder / "fields").iterdir(), *(folder / name for name in OWN)):
            old.unlink(missing_ok=True)


def _strange(folder: Path) -> list[str]:
    """What no run has written there: tables count as a run's beside a run.json only, fields by their names."""
    told = OWN if (folder / "run.json").exists() else ()
    found = [path.name for path in folder.iterdir() if path.name not in (*told, "fields")]
    inside = sorted((folder / "fields").iterdir()) if (folder / "fields").is_dir() else []
    return sorted(found) + [f"fields/{path.name}" for path in inside if not FIELDS.fullmatch(path.name)]


@contextmanager
def _usable(folder: Path):
    """Tell any trouble with the folder as one of the output's."""
    try:
        yield
    except OSError as error:
        why = error.strerror or error
        raise OutputError(f"--out {folder}: {why}; a folder that can be written is needed") from error


def run(scene: Scene, folder: Path, progress: Callable[[float], None] = lambda time: None) -> str:
    """Run a scene into a folder; ``progress`` is told each simulated time (h). Returns how the run ended.

    Raises OutputError where the folder cannot be used, SimulationError where a stage fails: what was computed until
    then is written all the same, and ``run.json`` says why it ends.
    """
    prepare(folder)
    timing.reset()
    recorder, start, status = Recorder(scene, folder), perf_counter(), "failed"
    with _usable(folder):
        try:
            status = _simulated(scene, recorder, progress)
        except SimulationError as error:
            status = f"failed: {error}"
            raise
        except KeyboardInterrupt:
            status = "interrupted"
            raise
        finally:
            recorder.finish(status, perf_counter() - start)
    return status


def _simulated(scene: Scene, recorder: Recorder, progress: Callable[[float], None]) -> str:
    """Record every instant of a run; how it ended."""
    try:
        for instant in simulate(scene):
            recorder.add(instant)
            progress(instant.pore.time)
    except PoreEnd as end:
        return str(end)
    except MemoryError as error:
        raise SimulationError(f"out of memory ({error}); try a smaller numerics.refinement") from error
    return "completed"
