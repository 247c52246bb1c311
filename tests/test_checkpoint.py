"""Checkpoints are read back as written, and every other file is refused."""

import io
import os
import shutil
from hashlib import sha256

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from repro.errors import CheckpointError
from repro.march.simulation import steps
from repro.march.state import SAME_TIME
from repro.runs import checkpoint, state_arrays
from repro.runs.checkpoint import NEWEST, PREVIOUS, decode
from repro.runs.execution import Watch, run
from repro.runs.recorder import Recorder
from repro.scene import load_scene
from tests.test_state import alike

TIMES = ('growth.end="0.6 h"', 'output.times=["0.2 h", "0.6 h"]')


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """Scene, folder and bytes of a checkpoint that holds reported steps and an unreported one."""
    scene, folder = load_scene("base", TIMES), tmp_path_factory.mktemp("kept") / "run"
    contents = []

    def keep(event):
        if event["event"] == "checkpoint":
            content = (folder / NEWEST).read_bytes()
            plain, _ = decode(content)
            contents.extend([content] * bool(plain["state"]["ledgers"] and plain["record"]["ledgers"]))

    run(scene, folder, watch=Watch(tell=keep, interval=0.0))
    return scene, folder, contents[0]


def restored(saved, content, path):
    """Return a recorder restored from these bytes."""
    scene, folder, _ = saved
    path.write_bytes(content)
    recorder = Recorder(scene, folder)
    recorder.restore(path)
    return recorder


def test_the_previous_checkpoint_is_kept(tmp_path):
    for content in (b"one", b"two", b"three"):
        checkpoint.write(tmp_path, content)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {NEWEST: b"three", PREVIOUS: b"two"}


@pytest.mark.parametrize("spoil", [lambda path: path.write_bytes(path.read_bytes()[:-9]), os.unlink,
                                   lambda path: path.write_bytes(path.read_bytes().replace(b"0", b"1", 1)),
                                   lambda path: path.rename(path.with_name("x")) and path.symlink_to("x")])
def test_altered_fields_are_refused(saved, tmp_path, spoil):
    """They are cut short, missing, altered at the same length, or moved and linked to."""
    scene, folder, content = saved
    (tmp_path / "x").write_bytes(content)
    copied = shutil.copytree(folder, tmp_path / "run")
    Recorder(scene, copied).restore(tmp_path / "x")
    spoil(copied / "fields" / "fields_0000.vtu")
    with pytest.raises(CheckpointError, match="fields_0000.vtu is missing, cut short or altered"):
        Recorder(scene, copied).restore(tmp_path / "x")


def signed(body: bytes) -> bytes:
    """Return a checkpoint with this content and a right checksum."""
    return checkpoint.MAGIC + sha256(body).hexdigest().encode() + b"\n" + body


class Harm:
    """An object that makes a file when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (str(self.path), "w")


def test_nothing_in_a_forged_checkpoint_is_executed(tmp_path):
    """Pickled arrays of objects in an .npz file with a right checksum are refused."""
    harm, file = Harm(tmp_path / "harm"), io.BytesIO()
    np.savez(file, plain=np.array([harm], dtype=object))
    with pytest.raises(ValueError, match="allow_pickle=False"):
        decode(signed(file.getvalue()))
    assert list(tmp_path.iterdir()) == []


@example(b"")
@example(checkpoint.MAGIC)
@example(b"\n")
@given(st.binary(max_size=300))
def test_other_files_are_refused(content):
    with pytest.raises(CheckpointError, match="does not begin like|checksum|format is not"):
        decode(content)


def test_a_checkpoint_of_another_format_or_scene_is_refused_in_one_line(saved, tmp_path):
    old = checkpoint.KIND + b"2 " + saved[2].removeprefix(checkpoint.MAGIC)
    with pytest.raises(CheckpointError, match="^its format is not 10: another version wrote it$"):
        restored(saved, old, tmp_path / "x")
    with pytest.raises(CheckpointError, match="another scene"):
        restored((load_scene("flow_only"), *saved[1:]), saved[2], tmp_path / "x")


def test_a_state_at_the_end_to_round_off_is_kept():
    """A step that ends less than SAME_TIME after growth.end is not cut at growth.end."""
    long = load_scene("base", ["numerics.preset=fast", "growth.end=5 h", "output.every=5 h"])
    time = next(state.pore.time for state, _ in steps(long) if state.pore.time > 0)
    short = load_scene(long, [f"growth.end={time - 0.5 * SAME_TIME!r} h"])
    *_, (last, _) = steps(short)
    assert 0 < last.pore.time - short.growth.end < SAME_TIME
    assert state_arrays.unpack_state(short, *state_arrays.pack_state(short, last)).pore.time == last.pore.time


FAST = ["numerics.preset=fast", "output.every=19.4 h"]


@pytest.mark.parametrize("name, changes, unset, after", [
    ("flow_only", [], ["aggregate"], -1.0), ("base", FAST, [], 0.0),
    ("base", [*FAST, "growth.new_biomass=stress_free"], [], 2.0)],
    ids=["without an aggregate", "after a step", "stress-free after two steps"])
def test_a_state_is_packed_and_unpacked_to_the_last_bit(name, changes, unset, after):
    """The least stretch is that of a step. With stress-free growth strain counts from the shape before the step."""
    scene = load_scene(name, changes, unset=unset)
    state = next(state for state, _ in steps(scene) if state.pore.time > after)
    assert state.compression.stretch < 1 or not changes
    if changes:
        body = state.pore.body
        assert np.array_equal(body.unstrained, body.reference) == (after == 0)
    assert alike(state_arrays.unpack_state(scene, *state_arrays.pack_state(scene, state)), state)


def test_a_scene_without_growth_has_no_row_after_its_state():
    scene = load_scene("flow_only")
    ((state, report),) = steps(scene)
    assert report.pore.time == 0 and [*steps(scene, state)] == []
