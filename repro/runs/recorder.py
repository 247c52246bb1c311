"""The files that a run writes, and the checkpoint from which it resumes."""

from collections import Counter
from collections.abc import Collection, Iterable
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path
from time import perf_counter

from repro import report, results, timing
from repro.errors import Interrupted, shell_word
from repro.march.balance import Ledger
from repro.march.state import Report, RestartState, sum_counts
from repro.march.step_control import exceeds_tolerance
from repro.preflight.numbers import reached
from repro.preflight.simplifications import (
    Caveat,
    find_warnings,
    warn_missed_tolerance,
    warn_missing_rows,
    warn_surface,
)
from repro.results import field_files
from repro.results.files import atomic_path, is_file, sha256_of
from repro.runs import checkpoint, state_arrays
from repro.runs.folder import (
    CHECKPOINTS,
    PROVENANCE,
    REPORT,
    RUN_FILES,
    SUMS,
    claim,
    file_errors,
    remove,
    sum_line,
)
from repro.runs.history import (
    COUNTS,
    History,
    require_fields,
    restore_history,
)
from repro.runs.machine import conditions
from repro.runs.status import RUNNING, is_over
from repro.scene import Scene
from repro.scene.units import to_internal


class Recorder:
    """Collects the rows of a run and writes its files to ``folder``.

    run_files: names of the files in the folder that this run or an earlier one has written;
    origin: the file of the scene and the changes made to it, empty if unknown.
    """

    def __init__(self, scene: Scene, folder: Path, run_files: Collection[str] = (),
                 origin: dict | None = None):
        self.scene = scene
        self.folder = folder
        self.run_files = set(run_files)
        self.origin = origin or {}
        self.conditions = conditions()
        self.state: RestartState | None = None
        self.history = History()
        self.unsynced: list[str] = []  # fields that a power failure may still destroy
        self.started = perf_counter()

    @property
    def time(self) -> float:
        """Simulated time (h) that the run has reached."""
        return self.state.time if self.state else 0.0

    @property
    def end(self) -> float:
        """Simulated time (h) at which the run ends."""
        return self.scene.growth.end if self.scene.growth else 0.0

    @property
    def steps(self) -> int:
        """Number of steps, reported or not."""
        return len(self.history.ledgers) + (len(self.state.ledgers) if self.state else 0)

    @property
    def remeshes(self) -> int:
        """Number of steps that generated a new mesh."""
        return self.history.remeshes + (self.state.remeshes if self.state else 0)

    @property
    def contact(self) -> bool:
        """Does the aggregate touch the opposite wall?"""
        return self.state is not None and self.state.pore.contact

    @property
    def first_velocity(self) -> float | None:
        """Mean velocity (um/h) at t = 0; None without flow."""
        velocity = self.history.rows[0][results.COLUMNS.index("mean_velocity_m_per_d")]
        return None if velocity is None else to_internal(f"{velocity!r} m/day", "um/h")

    def add(self, state: RestartState, reported: Report | None) -> None:
        """Add one step: the state after it and, if it is reported, its row and fields."""
        history = self.history
        if reported:
            self._write_fields(history.index, "fields", reported.pore, reported.solved)
            if reported.before and self.scene.requested_times:
                self._write_fields(history.before, "before_expansion", *reported.before)
            row = results.row(self.scene, reported)
            history.rows.append(list(row.values()))
            history.ledgers += self._ledger_rows(reported.ledgers)
            history.remeshes += int(reported.remeshes)
            history.iterations = sum_counts(history.iterations, reported.iterations)
            history.departed += reported.departed
        if state.missing and state.missing not in history.missing:  # not before a resume
            history.missing.append(state.missing)
        control = state.step_control
        is_new = self.state is not None and control != self.state.step_control
        if is_new and exceeds_tolerance(control, self.scene.numerics.tolerance):
            history.missed += 1
            history.worst = max(history.worst, control.estimate)
        self.state = state

    def _ledger_rows(self, ledgers: Iterable[Ledger]) -> list[list[float]]:
        return [results.ledger_row(self.scene, ledger) for ledger in ledgers]

    def find_crease(self) -> list[Caveat]:
        """Warn, and record the warning, when creases begin or positions at t = 0 first fold."""
        earlier = {warning["key"] for warning in self.history.surface}
        new = [each for each in warn_surface(self.state.pore) if each.key not in earlier]
        self.history.surface += map(asdict, new)
        return new

    def warnings_so_far(self) -> list[Caveat]:
        """Warn if any step so far misses the tolerance, if any row is missing or an aggregate has
        left, and of each simplification that holds at t = 0 and not at the present size."""
        history = self.history
        of_growth: list[Caveat] = []
        if self.scene.growth and self.state and history.rows:
            earlier = {warning["key"] for warning in history.warnings}
            with suppress(ArithmeticError):  # the warnings at t = 0 report it
                later = find_warnings(self.scene, self.first_velocity, reached(self.state.pore))
                of_growth = [each for each in later if each.key not in earlier]
        count = f" in {history.missed} of {self.steps} steps"
        return [*warn_missed_tolerance(self.scene, history.worst, count),
                *warn_missing_rows(history.missing),
                *(Caveat("growth.after_detachment", text) for text in history.departed),
                *of_growth]

    def _write_fields(self, index: list, kind: str, pore, solved) -> None:
        name = f"fields/{kind}_{len(index):04d}.vtu"
        path = claim(self.folder, name, self.run_files)
        with file_errors(path), atomic_path(path) as beside:
            field_files.write(beside, results.fields(self.scene, pore, solved))
            self.history.hashes[name] = sha256_of(beside)
            # listed as written by this run before the file exists
            with claim(self.folder, SUMS, self.run_files).open("a", encoding="utf-8",
                                                               newline="") as sums:
                sums.write(sum_line(name, self.history.hashes[name]))
        index.append((pore.time, name))
        self.unsynced.append(name)

    def save(self, status: str) -> dict:
        """Write the checkpoint, tables, indices and ``run.json``; return the last one.
        """
        history = self.history
        if self.state and not is_over(status):
            self._write_checkpoint()
        self._write("timeseries.csv", results.write_table, results.column_names(self.scene),
                    history.rows)
        self._write("fields.pvd", results.write_index, history.index)
        ledgers = history.ledgers + self._ledger_rows(self.state.ledgers if self.state else ())
        if ledgers:
            names = [column.name for column in results.ledger_columns(self.scene)]
            self._write("ledger.csv", results.write_table, names, ledgers)
        if history.before:
            self._write("before_expansion.pvd", results.write_index, history.before)
        return self.write_record(status)

    def write_record(self, status: str) -> dict:
        """Write ``run.json``, and return its content.

        It lists the SHA-256 of the other files unless the run is still running. SUMS lists those of
        the fields, each checkpoint contains its own, and the page does not exist yet.
        """
        history = self._current_history()
        warnings = [*history.warnings, *history.surface, *map(asdict, self.warnings_so_far())]
        files = self._files(is_over(status))
        hashed = set() if status == RUNNING else \
            set(files) - history.hashes.keys() - {PROVENANCE, REPORT, *CHECKPOINTS}
        record = {
            **results.provenance(self.scene), "conditions": self.conditions, "status": status,
            "files": files, **{count.name: count.value(history) for count in COUNTS},
            "resumes": history.resumes, "warnings": warnings, "origin": self.origin,
            "sha256": {name: sha256_of(self.folder / name) for name in sorted(hashed)
                       if is_file(self.folder / name)}}
        self._write(PROVENANCE, results.write_sealed, record)
        return record

    def _files(self, finished: bool) -> list[str]:
        """Names of the run's files: the existing ones, or all possible ones until it has finished.
        """
        names = set(RUN_FILES)
        if self.scene.growth is None:
            names -= {"ledger.csv", checkpoint.LAST}
        if not self.scene.requested_times:
            names.remove("before_expansion.pvd")
        if finished:
            existing = {name for name in names if is_file(self.folder / name)}
            names = (existing | {REPORT}) - set(CHECKPOINTS)
        return sorted(names | self.history.hashes.keys())

    @property
    def has_last_state(self) -> bool:
        """Is the state saved from which a longer run resumes?"""
        return is_file(self.folder / checkpoint.LAST)

    def save_last_state(self) -> None:
        """Save the present state as the one from which a longer run resumes."""
        path = claim(self.folder, checkpoint.LAST, self.run_files)
        with file_errors(path), atomic_path(path) as beside:
            beside.write_bytes(self._packed())

    def _packed(self) -> bytes:
        """The content of a checkpoint of the present state and history."""
        plain, arrays = state_arrays.pack_state(self.scene, self.state)
        return checkpoint.encode({"state": plain, "record": vars(self._current_history())}, arrays)

    def extend(self, scene: Scene, changes: list[str], ends_soon: bool) -> None:
        """Continue as the recorder of a longer run. Its checkpoint is written before ``run.json``.

        changes: overrides of the scene; ends_soon: is this also the state from which a still
        longer run resumes?
        """
        self.scene = scene
        self.origin["set"] = changes
        self._write_checkpoint()
        if ends_soon:
            self.save_last_state()
        else:
            remove(self.folder, [checkpoint.LAST])
        self.write_record(RUNNING)

    def finish(self, status: str) -> None:
        """Write all files at the end of a run."""
        self._write(SUMS, _write_sums, self.history.hashes)
        complete_folder(self.folder, self.save(status), self.run_files)

    def _write(self, name: str, write, *content) -> None:
        path = claim(self.folder, name, self.run_files)
        with file_errors(path):
            write(path, *content)

    def _current_history(self) -> History:
        """The history with the wall time so far, including the time before a resume."""
        stages = Counter(self.history.stages)
        stages.update(timing.seconds)
        seconds = self.history.seconds + perf_counter() - self.started
        return replace(self.history, seconds=seconds, stages=dict(sorted(stages.items())))

    def _write_checkpoint(self) -> None:
        for name in self.unsynced:
            with file_errors(self.folder / name):
                checkpoint.sync_to_disk(self.folder / name)
        self.unsynced = []
        content = self._packed()
        claim(self.folder, checkpoint.PREVIOUS, self.run_files)
        with file_errors(claim(self.folder, checkpoint.NEWEST, self.run_files)):
            checkpoint.write(self.folder, content)

    def restore(self, path: Path) -> None:
        """Restore state and history from a checkpoint.

        Raises CheckpointError if the run cannot resume from it.
        """
        plain, arrays = checkpoint.read_checkpoint(path)
        state = state_arrays.unpack_state(self.scene, plain["state"], arrays)
        before = restore_history(plain["record"])
        require_fields(self.folder, before)
        self.state = state
        self.history = before

    def forget(self) -> None:
        """Return to the state before t = 0, and keep only the list of resumes."""
        self.state = None
        self.history = History(resumes=self.history.resumes)

    def remove_later_fields(self) -> None:
        """Remove fields written after the state from which the run resumes."""
        fields = {name for name in self.run_files if name.startswith("fields/")}
        remove(self.folder, fields - self.history.hashes.keys())
        self._write(SUMS, _write_sums, self.history.hashes)

    def clear(self) -> None:
        """Remove the files of an earlier run, except ``run.json``, which lists them."""
        remove(self.folder, sorted(self.run_files - {PROVENANCE, SUMS}))
        remove(self.folder, [SUMS])
        self.run_files = {PROVENANCE}
        with file_errors(self.folder / "fields"):
            (self.folder / "fields").mkdir(exist_ok=True)

    def describe_last_state(self) -> str:
        """Say where the last good state is."""
        if not self.state:
            return "there is no earlier state"
        index = self.history.index
        fields_text = f"; fields of t = {index[-1][0]:g} h: {index[-1][1]}" if index else ""
        path = self.folder / checkpoint.NEWEST
        return f"the last good state, t = {self.state.pore.time:g} h, is in {path}{fields_text}"


def _write_sums(path: Path, hashes: dict[str, str]) -> None:
    """Write the checksums in the format of ``sha256sum --check``."""
    results.write_text(path, "".join(sum_line(name, hashes[name]) for name in sorted(hashes)))


def complete_folder(folder: Path, record: dict, run_files: set[str]) -> None:
    """Write the page of a run and its SHA-256; remove the checkpoints of a finished run.

    record: content of ``run.json``; run_files: names of the run's files. Raises OutputError if the
    page cannot be written.
    """
    path = claim(folder, REPORT, run_files)
    with file_errors(path):
        report.write(folder)
    record = record | {"sha256": record["sha256"] | {REPORT: sha256_of(path)}}
    with file_errors(folder / PROVENANCE):
        results.write_sealed(folder / PROVENANCE, record)
    if is_over(record["status"]):
        remove(folder, CHECKPOINTS)


def interruption(recorder: Recorder, number: int) -> Interrupted:
    """The exception to raise when a signal asks the run to stop."""
    return Interrupted(f"interrupted by signal {number} at t = {recorder.time:g} h; the "
                       "results so far are written, and "
                       f"--resume {shell_word(recorder.folder)} continues the run", number)
