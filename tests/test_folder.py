"""The folder of a run: one run at a time, nothing half-written, nothing outside it."""

import errno
import os
import signal
import sys
from contextlib import suppress
from hashlib import sha256
from pathlib import Path

import pytest

from repro import results
from repro.cli import main
from repro.errors import OutputError
from repro.results import field_files
from repro.results import files as written
from repro.runs import checkpoint
from repro.runs.checkpoint import LAST, NEWEST, PREVIOUS
from repro.runs.folder import LOCK, SUMS
from repro.runs.loading import load_run
from repro.runs.running import Watch, resume, run
from repro.scene import load_scene, parse_scene, scene_tables
from tests.pages import whole_of
from tests.shell import BRIEF, as_whole, files, refused, resumed, rewrite, started, stopped, told, wait_for

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="for Linux alone")


def test_a_killed_run_leaves_no_lock_that_counts(tmp_path, capsys):
    """While it runs another process is refused with status 2; after SIGKILL the lock's file is there and says nothing.
    """
    out = tmp_path / "run"
    process = started("base", "--out", out, "--checkpoint", "0")
    wait_for((out / NEWEST).exists, process)
    for asked in (["--resume", out], ["flow_only", "--out", out]):
        assert "another process is writing there" in refused(tmp_path / "none", capsys, "run", *asked)
    process.kill()
    process.communicate()
    assert process.returncode == -signal.SIGKILL and (out / LOCK).exists()
    assert main(["run", "flow_only", "--out", str(out), "--force"]) == 0
    assert told(out)["scene"] == "flow_only" and not (out / NEWEST).exists() and not (out / LOCK).exists()


def spoil(folder):
    """Cut the checkpoints of a run short."""
    for name in (NEWEST, PREVIOUS):
        (folder / name).write_bytes((folder / name).read_bytes()[:1000])


@pytest.fixture(scope="module")
def short():
    """With fields of one kind alone: of its files before_expansion.pvd is none."""
    return load_scene("base", BRIEF[:2])


@pytest.fixture
def out(short, tmp_path):
    """A run with two checkpoints that was cut off."""
    stopped(short, tmp_path / "run")
    return tmp_path / "run"


def test_a_runs_files_are_listed(short):
    """All that there is in the end, and nothing else, by name in run.json; the fields' sums are right."""
    out = whole_of(short)
    assert sorted({*files(out), "run.json", "report.html", LAST}) == told(out)["files"]
    sums = dict(line.split("  ")[::-1] for line in (out / SUMS).read_text().splitlines())
    assert sums == {name: sha256(content).hexdigest() for name, content in files(out).items() if "vtu" in name}


def test_nothing_is_removed_that_no_run_wrote(out, short, capsys):
    """A resume without a good checkpoint starts again, beside what others have put there, names of fields and tables
    among them."""
    spoil(out)
    (out / "fields" / "notes").mkdir()
    mine = dict.fromkeys(["thesis.tex", "timeseries.nc", "fields/mine.vtu", "fields/fields_0099.vtu",
                          "fields/notes/a.txt", "before_expansion.pvd"], b"years of work")
    for name, content in mine.items():
        (out / name).write_bytes(content)
    assert resumed(out) == 0
    assert "starts again from t = 0" in capsys.readouterr().err
    assert files(out) == files(whole_of(short)) | mine
    assert not mine.keys() & {*told(out)["files"]}


def test_nothing_is_replaced_that_no_run_wrote(out, capsys):
    """A file of the name of the next fields: told in one line, and left as it is."""
    count = len(list((out / "fields").iterdir()))
    mine = out / "fields" / f"fields_{count:04d}.vtu"
    mine.write_text("years of work")
    said = refused(mine, capsys, "run", "--resume", out, "--quiet")
    assert f"{mine}: it is there, and this run has not written it" in said
    mine.unlink()
    assert resumed(out) == 0


@pytest.mark.parametrize("name", ["fields", "timeseries.csv", NEWEST, PREVIOUS, "report.html",
                                  "fields/fields_0001.vtu"])
def test_links_are_refused(out, tmp_path, capsys, name):
    """What they lead to stays, whatever it is called."""
    spoil(out)
    (out / "report.html").touch()
    (out / name).rename(tmp_path / "elsewhere")
    (out / name).symlink_to(tmp_path / "elsewhere")
    message = refused(tmp_path, capsys, "run", "--resume", out)
    assert str(out / name) in message and "link" in message


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir, lambda path: os.symlink("/dev/zero", path)])
def test_a_checkpoint_that_is_no_file_is_refused(out, capsys, make):
    """A pipe, a folder, a device: no hang."""
    (out / NEWEST).unlink()
    make(out / NEWEST)
    assert f"{out / NEWEST}: it is a link, or no regular file" in refused(
        out / "fields", capsys, "run", "--resume", out)


@pytest.mark.parametrize("content", [None, b"", b"<VTKFile", b'<VTKFile type="UnstructuredGrid"/>', b"\xff" * 5000])
def test_altered_fields_are_told_and_made_again(out, short, capsys, content):
    """Or that are gone. The resume starts where all is right, here from t = 0, and ends with the bits of the whole run.
    """
    path = out / "fields" / "fields_0000.vtu"
    path.unlink() if content is None else path.write_bytes(content)
    assert resumed(out) == 0
    *refusals, last = capsys.readouterr().err.splitlines()
    assert ["fields_0000.vtu is not as it was written" in line for line in refusals] == [True, True]
    assert "starts again from t = 0" in last and as_whole(short, out)


def test_a_run_killed_at_its_very_end_is_tidied(tmp_path, capsys):
    """Its status told, its page and its checkpoints not seen to; a page that cannot be made is told. By the same
    command, and anew by --force, too."""
    run(load_scene("flow_only"), tmp_path)
    page, fields = tmp_path / "report.html", tmp_path / "fields" / "fields_0000.vtu"
    wanted, right = page.read_bytes(), fields.read_bytes()
    page.unlink()
    (tmp_path / PREVIOUS).write_bytes(b"left")
    sums, record = (tmp_path / SUMS).read_bytes(), told(tmp_path)
    fields.write_text("<VTKFile")
    results.write_text(tmp_path / SUMS, f"{sha256(fields.read_bytes()).hexdigest()}  fields/{fields.name}\n")
    rewrite(tmp_path, sha256={**record["sha256"], SUMS: sha256((tmp_path / SUMS).read_bytes()).hexdigest()})
    assert "report.html: it cannot be made" in refused(fields, capsys, "run", "--resume", tmp_path, "--quiet")
    fields.write_bytes(right)
    (tmp_path / SUMS).write_bytes(sums)
    rewrite(tmp_path, **record)
    assert resume(tmp_path) == "completed" and page.read_bytes() == wanted and not (tmp_path / PREVIOUS).exists()
    for force in (False, True):
        (tmp_path / PREVIOUS).write_bytes(b"left")
        assert run(load_scene("flow_only"), tmp_path, force=force) == "completed" and not (tmp_path / PREVIOUS).exists()


def test_what_a_killed_run_was_writing_is_removed(out, short):
    """What is in such a folder and no run's stays."""
    for part in (f".writing-abcdefgh/{NEWEST}", "fields/.writing-_1234567/fields_0001.vtu",
                 ".writing-thesis00/thesis.tex"):
        (out / part).parent.mkdir()
        (out / part).write_text("half")
    assert resume(out) == "completed"
    assert files(out) == files(whole_of(short)) | {".writing-thesis00/thesis.tex": b"half"}
    assert [path.name for path in out.rglob(".writing-*")] == [".writing-thesis00"]


def test_no_link_is_written_through(tmp_path):
    """Whatever a file is written as before it is moved to its place: what the links lead to stays as it is."""
    victim, out = tmp_path / "thesis.tex", tmp_path / "run"
    victim.write_text("years of work")
    names = [f".{name}.part" for name in ("run.json", "timeseries.csv", NEWEST, "report.html", "fields.pvd")]
    names += [f"fields/.part-fields_{k:04d}.vtu" for k in range(9)]

    def plant(event):
        for name in names:
            with suppress(FileExistsError):
                (out / name).symlink_to(victim)

    assert run(load_scene("base", BRIEF), out, watch=Watch(tell=plant, interval=0.0)) == "completed"
    assert victim.read_text() == "years of work" and not (out / "timeseries.csv").is_symlink()


@pytest.mark.parametrize("make", [lambda lock: lock.symlink_to("elsewhere"), lambda lock: lock.write_text("mine"),
                                  os.mkfifo, os.mkdir])
def test_a_lock_that_is_somebody_elses_is_left_alone(tmp_path, capsys, make):
    """A link, a file with content, a pipe, a folder."""
    make(tmp_path / LOCK)
    before = (tmp_path / LOCK).lstat()
    assert refused(tmp_path, capsys, "run", "flow_only", "--out", tmp_path).startswith("repro: --out")
    assert (tmp_path / LOCK).lstat() == before


@LINUX
def test_a_folder_that_cannot_be_made_is_refused(capsys):
    """Not even root may make one there."""
    there = Path("/proc/1/nowhere")
    assert str(there) in refused(there, capsys, "run", "flow_only", "--out", there)


def full(*_):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize("module, name, file", [(field_files, "write", r"fields/fields_\d{4}\.vtu"),
                                                (results, "write_table", "timeseries.csv"),
                                                (written.os, "replace", r"fields/fields_\d{4}\.vtu"),
                                                (checkpoint.os, "fsync", r"fields/fields_\d{4}\.vtu"),
                                                (checkpoint, "write", NEWEST)])
def test_no_space_is_told_with_the_file_and_nothing_is_lost(short, tmp_path, monkeypatch, module, name, file):
    """The run stops, says which file, leaves none half-written, and goes on when there is room."""
    out, works = tmp_path / "run", getattr(module, name)

    def fill(event):
        if event["event"] == "checkpoint" and event["time_h"] > 0.5:
            monkeypatch.setattr(module, name, full)

    with pytest.raises(OutputError, match=f"{file}: No space left on device; .* go on with --resume"):
        run(short, out, watch=Watch(tell=fill, interval=0.0))
    assert not [path for path in out.rglob("*") if "part" in path.name] and not (out / LOCK).exists()
    assert len(load_run(out).time) > 1
    monkeypatch.setattr(module, name, works)
    assert resume(out) == "completed" and told(out)["resumes"][0]["time_h"] > 0.5 and as_whole(short, out)


@pytest.mark.parametrize("name", ["../../outside", "/etc/cron.d/x", "a\nb", "\x1b[2J\x1b]0;owned\x07", "..", "x" * 300])
def test_no_name_of_a_scene_is_a_path(tmp_path, capsys, monkeypatch, name):
    """Whatever a scene is called, its run writes into its folder, and says so on a line."""
    monkeypatch.chdir(tmp_path)
    scene = parse_scene(scene_tables(load_scene("flow_only")), name, "scene.toml")
    monkeypatch.setattr("repro.cli.run.load_scene", lambda *_: scene)
    assert main(["run", "x", "--out", "run"]) == 0
    line = capsys.readouterr().out
    assert line.count("\n") == 1 and line.strip("\n").isprintable() and told(tmp_path / "run")["scene"] == name
    assert sorted(str(path.relative_to(tmp_path / "run")) for path in tmp_path.rglob("*") if path.is_file()) == sorted(
        told(tmp_path / "run")["files"])
