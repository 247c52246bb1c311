"""The files of a run, as far as it has come, and the checkpoint from which it goes on."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter

from repro import report, results, timing
from repro.errors import CheckpointError, Interrupted
from repro.files import whole
from repro.march.loop import Instant, State, added
from repro.results import netcdf
from repro.run import checkpoint, stored
from repro.run.folder import writing
from repro.run.machine import conditions
from repro.run.status import done, undone
from repro.run.stored import counted, counts, in_range
from repro.scene import Scene

CHECKPOINTS = (checkpoint.NEWEST, checkpoint.PREVIOUS, checkpoint.REFUSED)
RECORD = {"rows", "ledgers", "index", "before", "remeshes", "iterations", "seconds", "stages", "resumes"}


class Recorder:
    """Collects a run's rows and writes its files to ``folder``."""

    def __init__(self, scene: Scene, folder: Path):
        self.scene, self.folder, self.conditions = scene, folder, conditions()
        self.state: State | None = None
        self.rows: list[list] = []
        self.ledgers: list[list[float]] = []
        self.index: list[list] = []  # [time, file] of each row's fields
        self.before: list[list] = []
        self.remeshes = 0
        self.iterations: dict[str, int] = {}
        self.resumes: list[dict] = []
        self.unsynced: list[str] = []  # fields that the system may still lose with the power
        self.begun, self.spent, self.stages = perf_counter(), 0.0, dict[str, float]()

    @property
    def time(self) -> float:
        """How far the run has come, h."""
        return self.state.pore.time if self.state else 0.0

    @property
    def end(self) -> float:
        """How far it is to come, h."""
        return self.scene.growth.end if self.scene.growth else 0.0

    @property
    def steps(self) -> int:
        """How many steps were made, reported or not."""
        return len(self.ledgers) + (len(self.state.ledgers) if self.state else 0)

    @property
    def all_remeshes(self) -> int:
        """How many of them made a new mesh."""
        return self.remeshes + (self.state.remeshes if self.state else 0)

    @property
    def contact(self) -> bool:
        """Does the aggregate touch the opposite wall?"""
        return self.state is not None and self.state.pore.contact

    def add(self, state: State, instant: Instant | None) -> None:
        """Take one step: the state after it and, where it is reported, its row, its ledgers and its fields."""
        if instant:
            self._write_fields(self.index, "fields", instant.pore, instant.solved)
            if instant.before and self.scene.output.times:
                self._write_fields(self.before, "before_expansion", *instant.before)
            found = results.row(self.scene, instant)
            self.rows.append([found[name] for name in results.COLUMNS])
            self.ledgers += [results.ledger_row(ledger) for ledger in instant.ledgers]
            self.remeshes += instant.remeshes
            self.iterations = added(self.iterations, instant.iterations)
        self.state = state

    def _write_fields(self, index: list, kind: str, pore, solved) -> None:
        name = f"fields/{kind}_{len(index):04d}.vtu"
        with writing(self.folder / name), whole(self.folder / name) as beside:
            results.write_fields(beside, results.fields(self.scene, pore, solved))
        index.append([pore.time, name])
        self.unsynced.append(name)

    def save(self, status: str) -> None:
        """Write checkpoint, tables, indices and provenance as they are now."""
        if self.state and undone(status):
            self._write_checkpoint(self.state)
        self._write("timeseries.csv", results.write_table, results.COLUMNS, self.rows)
        self._write("fields.pvd", results.write_index, self.index)
        if self.ledgers:
            self._write("ledger.csv", results.write_table, results.LEDGER_COLUMNS, self.ledgers)
        if self.before:
            self._write("before_expansion.pvd", results.write_index, self.before)
        self.tell(status)

    def tell(self, status: str) -> None:
        """Write ``run.json``."""
        seconds, stages = self._times()
        self._write("run.json", results.write_json, {
            **results.provenance(self.scene), "conditions": self.conditions, "status": status, "rows": len(self.rows),
            "wall_time_s": seconds, "wall_time_by_stage_s": stages, "newton_iterations": self.iterations,
            "remeshes": self.remeshes, "resumes": self.resumes})

    def finish(self, status: str) -> None:
        """Write everything at the end of a run."""
        if self.scene.output.timeseries == "netcdf":
            self._write("timeseries.nc", netcdf.write, self.scene, self.rows)
        self.save(status)
        settle(self.folder, done(status))

    def _write(self, name: str, write, *content) -> None:
        with writing(self.folder / name), whole(self.folder / name) as beside:
            write(beside, *content)

    def _times(self) -> tuple[float, dict[str, float]]:
        """Seconds spent, all together and by stage, before a resume and since."""
        stages = {key: self.stages.get(key, 0.0) + timing.seconds.get(key, 0.0)
                  for key in (self.stages.keys() | timing.seconds.keys())}
        return self.spent + perf_counter() - self.begun, dict(sorted(stages.items()))

    def _write_checkpoint(self, state: State) -> None:
        for name in self.unsynced:
            with writing(self.folder / name):
                checkpoint.synced(self.folder / name)
        self.unsynced = []
        plain, arrays = stored.packed(self.scene, state)
        seconds, stages = self._times()
        record = {"rows": self.rows, "ledgers": self.ledgers, "index": self.index, "before": self.before,
                  "remeshes": int(self.remeshes), "iterations": self.iterations, "seconds": seconds, "stages": stages,
                  "resumes": self.resumes}
        with writing(self.folder / checkpoint.NEWEST):
            checkpoint.write(self.folder, checkpoint.encoded({"state": plain, "record": record}, arrays))

    def restore(self, path: Path) -> None:
        """Be as the recorder was that wrote a checkpoint. Raises CheckpointError where it cannot be gone on from."""
        try:
            content = path.read_bytes()
        except OSError as error:
            raise CheckpointError(f"it cannot be read ({error.strerror})") from None
        plain, arrays = checkpoint.decoded(content)
        if set(plain) != {"state", "record"} or not all(isinstance(part, dict) for part in plain.values()):
            raise CheckpointError("its header does not hold what it should")
        state, record = stored.unpacked(self.scene, plain["state"], arrays), plain["record"]
        _check(self.folder, state, record)
        self.state, self.spent, self.stages = state, record["seconds"], record["stages"]
        for name in RECORD - {"seconds", "stages"}:
            setattr(self, name, record[name])

    def last_good(self) -> str:
        """Where the last good state is, in words."""
        if not self.state:
            return "no state before it is there"
        shown = f"; fields of t = {self.index[-1][0]:g} h: {self.index[-1][1]}" if self.index else ""
        return f"the last good state, t = {self.state.pore.time:g} h, is in {self.folder / checkpoint.NEWEST}{shown}"


def _check(folder: Path, state: State, record: dict) -> None:
    """Raises CheckpointError where the rows are not those of a run that has come to the state."""
    right = set(record) == RECORD and _table(record["rows"], len(results.COLUMNS)) and (
        _table(record["ledgers"], len(results.LEDGER_COLUMNS))) and counted(record["remeshes"]) and (
        counts(record["iterations"])) and in_range(record["seconds"], 0.0, float("inf")) and (
        isinstance(record["stages"], dict)) and isinstance(record["resumes"], list) and (
        all(in_range(value, 0.0, float("inf")) for value in record["stages"].values()))
    right = right and _files(folder, record["index"], "fields") and _files(folder, record["before"], "before_expansion")
    if not right or [row[0] for row in record["rows"]] != [time for time, _ in record["index"]]:
        raise CheckpointError("its rows or fields are not those of a run")
    spans = [row[:2] for row in record["ledgers"]] + [[ledger.start, ledger.end] for ledger in state.ledgers]
    ends = [0.0, *(end for _, end in spans)]
    starts = [*(start for start, _ in spans), state.pore.time]
    if None in ends + starts or any(abs(end - start) > 1e-6 for end, start in zip(ends, starts)) or (
            not record["rows"] or not state.ledgers and record["rows"][-1][0] != state.pore.time):
        raise CheckpointError("its rows do not end where its state is")


def _table(rows, width: int) -> bool:
    """Are these rows of so many numbers or empty fields?"""
    return isinstance(rows, list) and all(
        isinstance(row, list) and len(row) == width and
        all(value is None or counted(value) or in_range(value, -float("inf"), float("inf")) for value in row)
        for row in rows)


def _files(folder: Path, index, kind: str) -> bool:
    """Are these the times of fields that are there, under the names that a run gives them?"""
    return isinstance(index, list) and all(
        isinstance(entry, list) and len(entry) == 2 and in_range(entry[0], 0.0, float("inf")) and
        entry[1] == f"fields/{kind}_{number:04d}.vtu" and (folder / entry[1]).is_file()
        for number, entry in enumerate(index))


def settle(folder: Path, over: bool) -> None:
    """The last things of a run's end: its page, and no checkpoint where it is over and has nothing to go on from."""
    with writing(folder / "report.html"):
        report.write(folder)
    for name in CHECKPOINTS if over else ():
        (folder / name).unlink(missing_ok=True)


def interrupted(recorder: Recorder, number: int) -> Interrupted:
    """What to raise when a signal has asked the run to stop."""
    return Interrupted(f"interrupted by signal {number} at t = {recorder.time:g} h; what was computed is "
                       f"written, and --resume {recorder.folder} goes on from there", number)
