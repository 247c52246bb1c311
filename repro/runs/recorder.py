"""The files of a run, as far as it has come, and the checkpoint from which it goes on."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import asdict, replace
from pathlib import Path
from time import perf_counter

import numpy as np

from repro import report, results, timing
from repro.errors import CheckpointError, Interrupted, OutputError
from repro.march.loop import Instant, Ledger, State, added
from repro.march.pace import Pace, missed
from repro.preflight.simplifications import CREASED, Warned, creased, unmet
from repro.results import field_files, netcdf
from repro.results.files import is_file, sha256_of, whole
from repro.runs import checkpoint, record, stored
from repro.runs.folder import (
    CHECKPOINTS,
    OWN,
    PROVENANCE,
    REPORT,
    SUMS,
    claimed,
    remove,
    sum_line,
    writing,
)
from repro.runs.machine import conditions
from repro.runs.record import Record
from repro.runs.status import RUNNING, done, undone
from repro.scene import Scene
from repro.scene.units import to_internal


class Recorder:
    """Collects a run's rows and writes its files to ``folder``.

    own: the names of the files in the folder that this run has written, or an earlier one;
    origin: the file that the scene was read from and what was set in it, empty where nobody tells.
    """

    def __init__(self, scene: Scene, folder: Path, own: Collection[str] = (),
                 origin: dict | None = None):
        self.scene = scene
        self.folder = folder
        self.own = set(own)
        self.origin = origin or {}
        self.conditions = conditions()
        self.state: State | None = None
        self.record = Record()
        self.unsynced: list[str] = []  # fields that the system may still lose with the power
        self.begun = perf_counter()

    @property
    def time(self) -> float:
        """How far the run has come, h."""
        return self.state.time if self.state else 0.0

    @property
    def end(self) -> float:
        """How far it is to come, h."""
        return self.scene.growth.end if self.scene.growth else 0.0

    @property
    def steps(self) -> int:
        """How many steps were made, reported or not."""
        return len(self.record.ledgers) + (len(self.state.ledgers) if self.state else 0)

    @property
    def remeshes(self) -> int:
        """How many of them made a new mesh."""
        return self.record.remeshes + (self.state.remeshes if self.state else 0)

    @property
    def contact(self) -> bool:
        """Does the aggregate touch the opposite wall?"""
        return self.state is not None and self.state.pore.contact

    @property
    def first_velocity(self) -> float | None:
        """Mean velocity at t = 0, um/h; None where there is no flow."""
        velocity = self.record.rows[0][results.COLUMNS.index("mean_velocity_m_per_d")]
        return None if velocity is None else to_internal(f"{velocity!r} m/day", "um/h")

    def add(self, state: State, instant: Instant | None) -> None:
        """Take one step: the state after it and, where it is reported, its row and its fields."""
        if instant:
            self._add_fields(instant)
            row = results.row(self.scene, instant)
            self.record.rows.append([row[name] for name in results.COLUMNS])
            self.record.ledgers += self._ledger_rows(instant.ledgers)
            self.record.remeshes += int(instant.remeshes)
            self.record.iterations = added(self.record.iterations, instant.iterations)
        if self.state and state.pace != self.state.pace:
            self._judge(state.pace)
        self.state = state

    def _ledger_rows(self, ledgers: Iterable[Ledger]) -> list[list[float]]:
        return [results.ledger_row(self.scene, ledger) for ledger in ledgers]

    def judge_surface(self) -> list[Warned]:
        """The warning of a surface that has begun to crease: recorded, and given, once."""
        if any(warned["key"] == CREASED for warned in self.record.warnings):
            return []
        warned = list(creased(self.state.pore))
        self.record.warnings += map(asdict, warned)
        return warned

    def _judge(self, pace: Pace) -> None:
        """Count the last step if it misses the tolerance."""
        if missed(pace, self.scene.numerics.tolerance):
            self.record.missed += 1
            self.record.worst = max(self.record.worst, pace.estimate)

    def unmet(self) -> list[Warned]:
        """What is to be said of the tolerance so far, if anything is."""
        count = f" in {self.record.missed} of {self.steps} steps"
        return list(unmet(self.scene, self.record.worst, count))

    def _add_fields(self, instant: Instant) -> None:
        self._write_fields(self.record.index, "fields", instant.pore, instant.solved)
        if instant.before and self.scene.output.times:
            self._write_fields(self.record.before, "before_expansion", *instant.before)

    def _write_fields(self, index: list, kind: str, pore, solved) -> None:
        name = record.fields_name(kind, len(index))
        path = claimed(self.folder, name, self.own)
        with writing(path), whole(path) as beside:
            field_files.write(beside, results.fields(self.scene, pore, solved))
            self.record.hashes[name] = sha256_of(beside)
            self._list_fields(name)
        index.append((pore.time, name))
        self.unsynced.append(name)

    def _list_fields(self, name: str) -> None:
        """Add a file of fields to those that the run has written, before it is there."""
        path = claimed(self.folder, SUMS, self.own)
        with path.open("a", encoding="utf-8", newline="") as sums:
            sums.write(sum_line(name, self.record.hashes[name]))

    def save(self, status: str) -> dict:
        """Write checkpoint, tables, indices and ``run.json`` as they are now; what that says."""
        now = self.record
        if self.state and undone(status):
            self._write_checkpoint(self.state)
        self._write("timeseries.csv", results.write_table, results.COLUMNS, now.rows)
        self._write("fields.pvd", results.write_index, now.index)
        ledgers = now.ledgers + self._ledger_rows(self.state.ledgers if self.state else ())
        if ledgers:
            self._write("ledger.csv", results.write_table, results.LEDGER_COLUMNS, ledgers)
        if now.before:
            self._write("before_expansion.pvd", results.write_index, now.before)
        return self.tell(status)

    def tell(self, status: str) -> dict:
        """Write ``run.json``, and return what it says.

        It has the SHA-256 of the other files once the run is not at work any more. Those of the
        fields are in the file SUMS, checkpoints have their own, and the page is not there yet.
        """
        now = self._now()
        warnings = now.warnings + [asdict(each) for each in self.unmet()]
        files = self._files(done(status))
        told = {
            **results.provenance(self.scene), "conditions": self.conditions, "status": status,
            "files": files, **{each.name: each.value(now) for each in record.COUNTS},
            "resumes": now.resumes, "warnings": warnings, "origin": self.origin,
            "sha256": {} if status == RUNNING else self._hashes(files)}
        self._write(PROVENANCE, results.write_sealed, told)
        return told

    def _hashes(self, files: list[str]) -> dict[str, str]:
        """The SHA-256 of these files, but of fields, checkpoints, the page and ``run.json``."""
        names = set(files) - self.record.hashes.keys() - {PROVENANCE, REPORT, *CHECKPOINTS}
        return {name: sha256_of(self.folder / name) for name in sorted(names)
                if is_file(self.folder / name)}

    def _files(self, over: bool) -> list[str]:
        """The names of the run's files: those there are, or may come while it is not over."""
        names = set(OWN) - _never(self.scene)
        if over:
            there = {name for name in names if is_file(self.folder / name)}
            names = (there | {REPORT}) - set(CHECKPOINTS)
        return sorted(names | self.record.hashes.keys())

    @property
    def kept(self) -> bool:
        """Is there a state from which a longer run goes on?"""
        return is_file(self.folder / checkpoint.LAST)

    def keep(self) -> None:
        """Write the state now as that from which a longer run goes on."""
        content = checkpoint.encoded(*packed(self.scene, self.state, self._now()))
        self._write(checkpoint.LAST, Path.write_bytes, content)

    def lengthen(self, scene: Scene, changes: list[str], near: bool) -> None:
        """Be the recorder of a longer run from here on, whose checkpoint is there before
        ``run.json`` tells of it. changes: what is now set in the file of its scene; near: is this
        also the state from which a still longer run goes on?"""
        self.scene = scene
        self.origin["set"] = changes
        self._write_checkpoint(self.state)
        if near:
            self.keep()
        else:
            remove(self.folder, [checkpoint.LAST])
        self.tell(RUNNING)

    def finish(self, status: str) -> None:
        """Write everything at the end of a run."""
        if self.scene.output.timeseries == "netcdf":
            self._write("timeseries.nc", netcdf.write, self.scene, self.record.rows)
        self._write(SUMS, _write_sums, self.record.hashes)
        settle(self.folder, self.save(status), self.own)

    def _write(self, name: str, write, *content) -> None:
        path = claimed(self.folder, name, self.own)
        with writing(path), whole(path) as beside:
            write(beside, *content)

    def _now(self) -> Record:
        """The record with the seconds spent so far, before a resume and since."""
        before = self.record
        names = sorted(before.stages.keys() | timing.seconds.keys())
        stages = {name: before.stages.get(name, 0.0) + timing.seconds.get(name, 0.0)
                  for name in names}
        return replace(before, seconds=before.seconds + perf_counter() - self.begun, stages=stages)

    def _write_checkpoint(self, state: State) -> None:
        for name in self.unsynced:
            with writing(self.folder / name):
                checkpoint.synced(self.folder / name)
        self.unsynced = []
        content = checkpoint.encoded(*packed(self.scene, state, self._now()))
        claimed(self.folder, checkpoint.PREVIOUS, self.own)
        with writing(claimed(self.folder, checkpoint.NEWEST, self.own)):
            checkpoint.write(self.folder, content)

    def restore(self, path: Path) -> None:
        """Be as the recorder was that wrote a checkpoint.

        Raises CheckpointError where the run cannot go on from it.
        """
        plain, arrays = checkpoint.read_checkpoint(path)
        try:
            with np.errstate(all="raise", under="ignore"):
                state = stored.unpacked(self.scene, plain["state"], arrays)
                before = record.unpacked(plain["record"], arrays)
                record.require_fields(self.folder, before)
        except CheckpointError:
            raise
        except Exception as error:  # whatever a forged file may cause
            why = " ".join(f"{type(error).__name__}: {error}".split())
            raise CheckpointError(f"it makes no sense ({why})") from error
        self.state = state
        self.record = before

    def forget(self) -> None:
        """Be as the recorder was before t = 0, but for how often the run was gone on with."""
        self.state = None
        self.record = Record(resumes=self.record.resumes)

    def drop_later(self) -> None:
        """Remove fields that were written after the state gone on from: they are made again."""
        fields = {name for name in self.own if name.startswith("fields/")}
        remove(self.folder, fields - self.record.hashes.keys())
        self._write(SUMS, _write_sums, self.record.hashes)

    def clear(self) -> None:
        """Remove what an earlier run has written, but for ``run.json``: it lists the rest."""
        remove(self.folder, sorted(self.own - {PROVENANCE, SUMS}))
        remove(self.folder, [SUMS])
        self.own = {PROVENANCE}
        with writing(self.folder / "fields"):
            (self.folder / "fields").mkdir(exist_ok=True)

    def last_good(self) -> str:
        """Where the last good state is, in words."""
        if not self.state:
            return "no state before it is there"
        index = self.record.index
        shown = f"; fields of t = {index[-1][0]:g} h: {index[-1][1]}" if index else ""
        where = self.folder / checkpoint.NEWEST
        return f"the last good state, t = {self.state.pore.time:g} h, is in {where}{shown}"


def packed(scene: Scene, state: State, now: Record) -> tuple[dict, checkpoint.Arrays]:
    """A state and a record as what a checkpoint takes."""
    of_state, arrays = stored.packed(scene, state)
    of_record, tables = record.packed(now)
    return {"state": of_state, "record": of_record}, arrays | tables


def _never(scene: Scene) -> set[str]:
    """The files that a run of this scene does not write."""
    absent = {"timeseries.nc": scene.output.timeseries != "netcdf",
              "ledger.csv": scene.growth is None, checkpoint.LAST: scene.growth is None,
              "before_expansion.pvd": not scene.output.times}
    return {name for name, never in absent.items() if never}


def _write_sums(path: Path, hashes: dict[str, str]) -> None:
    """Write what ``sha256sum --check`` takes."""
    results.write_text(path, "".join(sum_line(name, hashes[name]) for name in sorted(hashes)))


def settle(folder: Path, told: dict, own: set[str]) -> None:
    """The last things of a run's end: its page, whose SHA-256 ``run.json`` gets too, and no
    checkpoint where it is over.

    told: what ``run.json`` says; own: the names of the run's files. Raises OutputError where the
    page cannot be made or written.
    """
    path = claimed(folder, REPORT, own)
    try:
        with writing(path):
            report.write(folder)
    except ValueError as error:
        raise OutputError(f"{path}: it cannot be made: {error}") from error
    told = told | {"sha256": told["sha256"] | {REPORT: sha256_of(path)}}
    with writing(folder / PROVENANCE), whole(folder / PROVENANCE) as beside:
        results.write_sealed(beside, told)
    if done(told["status"]):
        remove(folder, CHECKPOINTS)


def interrupted(recorder: Recorder, number: int) -> Interrupted:
    """What to raise when a signal has asked the run to stop."""
    return Interrupted(f"interrupted by signal {number} at t = {recorder.time:g} h; what was "
                       f"computed is written, and --resume {recorder.folder} goes on from there",
                       number)
