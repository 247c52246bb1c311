"""Checkpoints: what is written is read, and whatever else is read is refused."""

import io
import os
import shutil
from hashlib import sha256

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from repro.errors import CheckpointError
from repro.march.loop import SAME_TIME
from repro.march.simulation import steps
from repro.runs import checkpoint, stored
from repro.runs.checkpoint import NEWEST, PREVIOUS, decoded, encoded
from repro.runs.recorder import Recorder
from repro.runs.running import Watch, run
from repro.scene import load_scene
from tests.faults import little_memory

TIMES = ('growth.end="0.6 h"', 'output.times=["0.2 h", "0.6 h"]')
LATER = ('growth.end="14 h"', 'output.times=["2 h", "14 h"]')
PRESETS = {"paper": ('numerics.preset="paper"', *TIMES), "fast": ('numerics.preset="fast"', *LATER),
           "cubic": ('numerics.preset="fast"', 'numerics.elements="cubic"', *LATER)}


@pytest.fixture(scope="module", params=PRESETS)
def kept(request, tmp_path_factory):
    """Scene, folder and bytes of a checkpoint with steps that are reported and one that is not."""
    scene, folder = load_scene("base", PRESETS[request.param]), tmp_path_factory.mktemp("kept") / "run"
    found = []

    def keep(event):
        if event["event"] == "checkpoint":
            content = (folder / NEWEST).read_bytes()
            arrays = decoded(content)[1]
            found.extend([content] * bool(len(arrays["pending"]) and len(arrays["ledgers"])))

    run(scene, folder, watch=Watch(tell=keep, interval=0.0))
    return scene, folder, found[0]


def restored(kept, content, path):
    """A recorder that goes on from these bytes."""
    scene, folder, _ = kept
    path.write_bytes(content)
    recorder = Recorder(scene, folder)
    recorder.restore(path)
    return recorder


def test_an_array_keeps_its_layout():
    """By rows or by columns, its type, and its numbers in either; what is read may be written to."""
    numbers = np.arange(6).reshape(2, 3)
    arrays = {"rows": numbers.astype(float), "columns": np.asfortranarray(numbers), "none": np.zeros(0),
              "flags": np.array([True, False]), "short": np.arange(3, dtype=np.int32), "edge": np.array([-0.0, 5e-324])}
    _, found = decoded(encoded({}, arrays))
    for name, array in arrays.items():
        assert found[name].tobytes() == array.tobytes() and found[name].dtype == array.dtype
        assert found[name].flags.c_contiguous == array.flags.c_contiguous and found[name].flags.writeable


def test_the_one_before_is_kept(tmp_path):
    for content in (b"one", b"two", b"three"):
        checkpoint.write(tmp_path, content)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {NEWEST: b"three", PREVIOUS: b"two"}


def test_one_bit_of_a_number_is_told(kept, tmp_path):
    """The last of the first array's first number: all else is as a run's."""
    content = bytearray(kept[2])
    content[content.index(b"points.npy") + 200] ^= 1
    with pytest.raises(CheckpointError, match="^.*checksum.*$"):
        restored(kept, bytes(content), tmp_path / "altered")


@pytest.mark.parametrize("kept", ["fast"], indirect=True)
def test_a_forged_checkpoint_is_refused_in_one_line_or_harmless(kept, tmp_path):
    """Under a right checksum: parts that are missing, of another kind or of another size, in every array and entry."""
    plain, arrays = decoded(kept[2])
    forged = [(plain, {key: value for key, value in arrays.items() if key != name}) for name in arrays]
    forged += [(plain, arrays | {name: array[:-1]}) for name, array in arrays.items() if array.size]
    forged += [(plain, arrays | {name: np.full(3, "x")}) for name in arrays]
    for section in plain:
        forged += [(plain | {section: value}, arrays) for value in (None, [], {}, "x", 3)]
        for key in plain[section]:
            changed = [plain[section] | {key: value} for value in (None, [1], {"a": []}, "x")]
            forged += [(plain | {section: part}, arrays) for part in changed]
    refusals = 0
    for one in forged:
        try:
            restored(kept, encoded(*one), tmp_path / "x")
        except CheckpointError as error:
            refusals += 1
            assert str(error) and "\n" not in str(error)
    assert refusals >= len(arrays) + 5 * len(plain), "at least each that lacks an array or a section"


@pytest.mark.parametrize("spoil", [lambda path: path.write_bytes(path.read_bytes()[:-9]), os.unlink,
                                   lambda path: path.write_bytes(path.read_bytes().replace(b"0", b"1", 1)),
                                   lambda path: path.rename(path.with_name("x")) and path.symlink_to("x")])
def test_fields_that_are_not_as_they_were_written_are_refused(kept, tmp_path, spoil):
    """Cut short, gone, altered with the same length, or moved and linked to."""
    scene, folder, content = kept
    (tmp_path / "x").write_bytes(content)
    copied = shutil.copytree(folder, tmp_path / "run")
    Recorder(scene, copied).restore(tmp_path / "x")
    spoil(copied / "fields" / "fields_0000.vtu")
    with pytest.raises(CheckpointError, match="fields_0000.vtu is not as it was written"):
        Recorder(scene, copied).restore(tmp_path / "x")


def signed(body: bytes) -> bytes:
    """A checkpoint with this content under a right checksum."""
    return checkpoint.MAGIC + sha256(body).hexdigest().encode() + b"\n" + body


class Harm:
    """What would make a file, were it unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (str(self.path), "w")


def test_nothing_in_a_forged_checkpoint_is_executed(tmp_path):
    """Pickles as arrays of objects in an .npz file, refused under a right checksum."""
    harm, file = Harm(tmp_path / "harm"), io.BytesIO()
    np.savez(file, plain=np.array([harm], dtype=object))
    for body in (file.getvalue(), b"", b"[]", file.getvalue()[:-30]):
        with pytest.raises(CheckpointError):
            decoded(signed(body))
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_is_too_long_or_none_is_not_read(kept, tmp_path):
    with (tmp_path / "x").open("wb") as file:
        file.truncate(2**31)
    os.mkfifo(tmp_path / "pipe")
    recorder = Recorder(*kept[:2])
    for name, why in (("x", "longer than"), ("pipe", "no regular file")):
        with little_memory(2**20), pytest.raises(CheckpointError, match=why):
            recorder.restore(tmp_path / name)


@example(b"")
@example(checkpoint.MAGIC)
@example(b"\n")
@given(st.binary(max_size=300))
def test_other_files_are_refused(content):
    with pytest.raises(CheckpointError, match="does not begin as|checksum|format is not"):
        decoded(content)


def test_a_checkpoint_of_another_format_or_scene_is_refused_in_one_line(kept, tmp_path):
    old = checkpoint.KIND + b"2 " + kept[2].removeprefix(checkpoint.MAGIC)
    with pytest.raises(CheckpointError, match="^its format is not 5: another version wrote it$"):
        restored(kept, old, tmp_path / "x")
    with pytest.raises(CheckpointError, match="another scene"):
        restored((load_scene("flow_only"), *kept[1:]), kept[2], tmp_path / "x")


def test_a_state_that_is_the_runs_end_to_round_off_is_kept():
    """A step that ends less than SAME_TIME after growth.end is not cut there."""
    long = load_scene("base", ["numerics.preset=fast", "growth.end=5 h"])
    time = next(state.pore.time for state, _ in steps(long) if state.pore.time > 0)
    short = load_scene("base", ["numerics.preset=fast", f"growth.end={time - 0.5 * SAME_TIME!r} h"])
    *_, (last, _) = steps(short)
    assert 0 < last.pore.time - short.growth.end < SAME_TIME
    assert stored.unpacked(short, *stored.packed(short, last)).pore.time == last.pore.time
