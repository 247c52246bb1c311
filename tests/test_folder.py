"""The folder of a run: one run at a time, no half-written files, no writes outside it."""

import errno
import os
import signal
import sys
from pathlib import Path

import pytest

from repro import results
from repro.cli import main
from repro.errors import OutputError
from repro.results import field_files
from repro.results import files as written
from repro.runs import checkpoint
from repro.runs.checkpoint import NEWEST, PREVIOUS
from repro.runs.execution import Watch, resume, run
from repro.runs.folder import LOCK
from repro.runs.scripts import load_run
from repro.scene import load_scene
from tests.pages import cached_run
from tests.shell import (
    files,
    interrupt_run,
    matches_uninterrupted,
    read_record,
    refusal,
    resume_run,
    start_run,
    wait_for,
)

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="for Linux alone")


@pytest.mark.thorough
def test_a_killed_run_leaves_no_lock_that_counts(tmp_path, capsys):
    """While it runs, another process is refused with status 2. After SIGKILL the lock's file remains without effect."""
    out = tmp_path / "run"
    process = start_run("base", "--out", out, "--checkpoint", "0")
    wait_for((out / NEWEST).exists, process)
    for arguments in (["--resume", out], ["flow_only", "--out", out]):
        assert "another process is writing there" in refusal(tmp_path / "none", capsys, "run", *arguments)
    process.kill()
    process.communicate()
    assert process.returncode == -signal.SIGKILL and (out / LOCK).exists()
    assert main(["run", "flow_only", "--out", str(out), "--force"]) == 0
    assert read_record(out)["scene"] == "flow_only" and not (out / NEWEST).exists() and not (out / LOCK).exists()


def spoil(folder):
    """Truncate the checkpoints of a run."""
    for name in (NEWEST, PREVIOUS):
        (folder / name).write_bytes((folder / name).read_bytes()[:1000])


@pytest.fixture(scope="module")
def short():
    """A scene with one kind of fields: its run writes no before_expansion.pvd."""
    return load_scene("base", ["growth.end=1 h", "numerics.refinement=0.5"])


@pytest.fixture
def out(short, tmp_path):
    """An interrupted run with two checkpoints."""
    interrupt_run(short, tmp_path / "run")
    return tmp_path / "run"


def test_foreign_files_are_not_replaced(out, capsys):
    """A foreign file with the name of the next fields is refused in one line and stays unchanged."""
    count = len(list((out / "fields").iterdir()))
    mine = out / "fields" / f"fields_{count:04d}.vtu"
    mine.write_text("years of work")
    message = refusal(mine, capsys, "run", "--resume", out, "--quiet")
    assert f"{mine}: it exists, and this run has not written it" in message
    mine.unlink()
    assert resume_run(out) == 0


@pytest.mark.parametrize("name", ["fields", "timeseries.csv", NEWEST, PREVIOUS, "report.html",
                                  "fields/fields_0001.vtu"])
def test_links_are_refused(out, tmp_path, capsys, name):
    """Their targets stay unchanged."""
    spoil(out)
    (out / "report.html").touch()
    (out / name).rename(tmp_path / "elsewhere")
    (out / name).symlink_to(tmp_path / "elsewhere")
    message = refusal(tmp_path, capsys, "run", "--resume", out)
    assert str(out / name) in message and "link" in message


def test_a_run_killed_at_its_very_end_is_tidied(tmp_path, capsys):
    """The status is written, the page is missing, and a checkpoint remains. A resume, the same command and --force
    each tidy the folder."""
    run(load_scene("flow_only"), tmp_path)
    page = tmp_path / "report.html"
    page_content = page.read_bytes()
    page.unlink()
    (tmp_path / PREVIOUS).write_bytes(b"left")
    assert resume(tmp_path) == "completed" and page.read_bytes() == page_content and not (tmp_path / PREVIOUS).exists()
    for force in (False, True):
        (tmp_path / PREVIOUS).write_bytes(b"left")
        assert run(load_scene("flow_only"), tmp_path, force=force) == "completed" and not (tmp_path / PREVIOUS).exists()


def test_temporary_files_of_a_killed_run_are_removed(out, short):
    """Foreign files in the temporary folders stay."""
    for part in (f".writing-abcdefgh/{NEWEST}", "fields/.writing-_1234567/fields_0001.vtu",
                 ".writing-thesis00/thesis.tex"):
        (out / part).parent.mkdir()
        (out / part).write_text("half")
    assert resume(out) == "completed"
    assert files(out) == files(cached_run(short)) | {".writing-thesis00/thesis.tex": b"half"}
    assert [path.name for path in out.rglob(".writing-*")] == [".writing-thesis00"]


@pytest.mark.parametrize("make", [lambda lock: lock.symlink_to("elsewhere"), lambda lock: lock.write_text("mine"),
                                  os.mkfifo, os.mkdir])
def test_a_foreign_lock_is_left_alone(tmp_path, capsys, make):
    """It may be a link, a file with content, a pipe or a folder."""
    make(tmp_path / LOCK)
    before = (tmp_path / LOCK).lstat()
    assert refusal(tmp_path, capsys, "run", "flow_only", "--out", tmp_path).startswith("repro: --out")
    assert (tmp_path / LOCK).lstat() == before


@LINUX
def test_a_folder_that_cannot_be_made_is_refused(capsys):
    """Not even root can make this folder."""
    folder = Path("/proc/1/nowhere")
    assert str(folder) in refusal(folder, capsys, "run", "flow_only", "--out", folder)


def full(*_):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize("module, name, file", [
    (results, "write_table", "timeseries.csv"), (written.os, "replace", r"fields/fields_\d{4}\.vtu"),
    *(pytest.param(*place, marks=pytest.mark.thorough) for place in (
        (field_files, "write", r"fields/fields_\d{4}\.vtu"), (checkpoint.os, "fsync", r"fields/fields_\d{4}\.vtu"),
        (checkpoint, "write", NEWEST)))])
def test_a_full_disk_is_reported_with_the_file_and_nothing_is_lost(short, tmp_path, monkeypatch, module, name, file):
    """The run stops, names the file, leaves no half-written one, and resumes when there is space."""
    out, works = tmp_path / "run", getattr(module, name)

    def fill(event):
        if event["event"] == "checkpoint" and event["time_h"] > 0.5:
            monkeypatch.setattr(module, name, full)

    with pytest.raises(OutputError, match=f"{file}: No space left on device; .* use repro.resume"):
        run(short, out, watch=Watch(tell=fill, interval=0.0))
    assert not [path for path in out.rglob("*") if "part" in path.name] and not (out / LOCK).exists()
    assert len(load_run(out).time) > 1
    monkeypatch.setattr(module, name, works)
    assert resume(out) == "completed" and matches_uninterrupted(short, out)
    assert read_record(out)["resumes"][0]["time_h"] > 0.5


def test_no_record_counts_rows_that_the_table_lacks(short, tmp_path, monkeypatch):
    """A run may be killed between two writes. Its record then has no more rows than its table. Every checkpoint writes
    the table of the rows so far."""
    out, write, counts = tmp_path / "run", results.write_table, []

    def write_watched(path, columns, rows):
        if columns[0] == "time_h" and (out / "timeseries.csv").exists():
            counts.append((read_record(out)["rows"], len(results.read_table(out / "timeseries.csv")["time_h"])))
        write(path, columns, rows)

    monkeypatch.setattr(results, "write_table", write_watched)
    run(short, out, watch=Watch(interval=0.0))
    assert len(counts) > 4 and [written for _, written in counts] == [*range(1, len(counts) + 1)]
    assert all(recorded <= written for recorded, written in counts)
