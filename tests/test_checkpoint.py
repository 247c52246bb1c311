"""Checkpoints: what is written is read, and whatever else is read is refused."""

import json
import math
import os
import shutil
import tracemalloc
from contextlib import contextmanager, suppress
from functools import partial
from hashlib import sha256

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from repro import results
from repro.errors import CheckpointError
from repro.march.loop import SAME_TIME
from repro.march.simulation import steps
from repro.run import checkpoint, stored
from repro.run.checkpoint import NEWEST, PREVIOUS, decoded, encoded
from repro.run.recorder import PENDING, Recorder
from repro.run.running import Watch, run
from repro.scene import load_scene

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
            found.extend([content] * bool(len(arrays[PENDING]) and len(arrays["record.ledgers"])))

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


def refused(kept, path, plain, arrays):
    """Is a checkpoint of these refused in one line?"""
    with pytest.raises(CheckpointError) as error:
        restored(kept, encoded(plain, arrays), path)
    return bool(str(error.value)) and "\n" not in str(error.value)


def refused_with(kept, path, **changes):
    """Is it refused with arrays, by their names, changed by functions?"""
    plain, arrays = decoded(kept[2])
    with np.errstate(over="ignore"):
        changed = {name: np.ascontiguousarray(change(arrays[name])) for name, change in changes.items()}
    return refused(kept, path, plain, arrays | changed)


def test_one_bit_of_a_number_is_told(kept, tmp_path):
    """The last of the first array's first number: all else is as a run's."""
    content = bytearray(kept[2])
    content[content.index(b"\n", content.index(b"\n") + 1) + 1] ^= 1
    with pytest.raises(CheckpointError, match="^.*checksum.*$"):
        restored(kept, bytes(content), tmp_path / "altered")


NEVER = (math.nan, math.inf, -math.inf)


def ending(scene, state):
    """Time, area, mass and upstream end with which the run from a state ends."""
    *_, (last, _) = steps(scene, state)
    return last.time, last.pore.boundary.area, last.pore.mass, last.pore.boundary.upstream


#: What is made of all numbers, or of all flags, of an array, or of the one in its middle.
WHOLE = {"f": [lambda a, k=k: k * a for k in (0.0, -1.0, 1e-300, 1.3, 3.0, 100.0)], "b": [np.logical_not]}
ONE = {"f": (0.0, 1.0, 1e-300), "b": (False, True), "i": (0, 1, 2)}


@pytest.mark.parametrize("kept", ["paper", "fast", pytest.param("cubic", marks=pytest.mark.thorough)], indirect=True)
def test_what_is_not_refused_is_harmless(kept, tmp_path):
    """Each array spoilt in turn: refused, or the run ends as the untouched one, to 1e-3 (measured: 7e-4, where a mass
    is off by less than the bounds)."""
    scene, _, content = kept
    wanted = ending(scene, restored(kept, content, tmp_path / "x").state)
    accepted = 0
    for name, array in decoded(content)[1].items():
        changes = [change(array) for change in WHOLE.get(array.dtype.kind, ()) if array.size]
        changes += [with_number(array, array.size // 2, one) for one in ONE.get(array.dtype.kind, ()) if array.size]
        for changed in changes:
            plain, arrays = decoded(content)
            with suppress(CheckpointError):
                recorder = restored(kept, encoded(plain, {**arrays, name: changed}), tmp_path / "x")
                assert ending(scene, recorder.state) == pytest.approx(wanted, rel=1e-3), name
                accepted += 1
    assert accepted > 20  # a guess from which Newton's method starts may be anything


def with_number(array, place, value):
    """The array with another number at a place."""
    array = array.copy(order="K")
    array.flat[place] = value
    return array


#: A row too few, a row twice, and one column too many.
RESIZED = (lambda a: a[:-1], lambda a: np.concatenate([a, a[-1:]]), lambda a: np.column_stack([a, a]))


def test_numbers_that_are_none_indices_that_are_no_nodes_and_other_sizes_are_refused(kept, tmp_path):
    """In every array."""
    arrays = decoded(kept[2])[1]
    for name, array in arrays.items():
        wrong = {"f": NEVER, "i": (-1, len(arrays["points"]), 2**40)}.get(array.dtype.kind, ())
        for value in wrong if array.size else ():
            assert refused_with(kept, tmp_path / "x", **{name: partial(with_number, place=-1, value=value)})
        for change in RESIZED if array.size else ():
            assert refused_with(kept, tmp_path / "x", **{name: change}), name


@pytest.mark.parametrize("section, name, value", [
    ("state", "time_h", 1e9), ("state", "time_h", -0.5), ("state", "front", 0.5), ("state", "front", None),
    ("state", "pace", [-0.1, 0.0, 0.0]), ("state", "pace", [1e300, 0.2, 0.0]), ("state", "ends_um", [-50.0, 50.0]),
    ("state", "remeshes", -1), ("state", "iterations", {"a": 0.5}), ("state", "ledgers", [[0.0]]),
    ("record", "resumes", [1]), ("record", "missed", 10**15), ("record", "worst", -1.0), ("record", "seconds", 1e300)])
def test_what_makes_no_sense_is_refused(kept, tmp_path, section, name, value):
    plain, arrays = decoded(kept[2])
    plain[section][name] = value
    assert refused(kept, tmp_path / "x", plain, arrays)


def column(name, value):
    """The change of a table by which the last row of a column holds a value."""
    def change(rows):
        rows[-1, results.COLUMNS.index(name)] = value
        return rows
    return change


@pytest.mark.parametrize("name, change", [
    ("theta", lambda a: a * 0 + 1), ("theta", lambda a: 1.3 * a), ("theta", lambda a: with_number(a, 0, 1e-300)),
    ("active", lambda a: 1.5 * a), ("active", lambda a: with_number(a, 0, 0.0)),
    ("active", lambda a: with_number(a, 1, -1e-9)), ("inert", lambda a: with_number(a, 1, -1e-9)),
    ("inert", lambda a: 300 * a), ("acceptor", lambda a: a + 1e300),
    ("points", lambda a: with_number(a, a.size // 2, 1e6)), ("reference", lambda a: with_number(a, a.size // 2, -1e6)),
    ("reference", lambda a: 0 * a), ("fixed", lambda a: a & False), ("fixed", lambda a: np.roll(a, len(a) // 2)),
    ("wall", lambda a: with_number(a, 0, 2)), ("cells", lambda a: a * 0), ("record.ledgers", lambda a: a * 0 + 1e300),
    ("record.rows", column("aggregate_area_um2", 1e300)), ("record.rows", column("mean_velocity_m_per_d", -3.0)),
    ("record.rows", column("effluent_acceptor_mg_per_L", -7.0)), ("record.rows", column("thickness_um", math.nan))])
def test_arrays_that_no_run_comes_to_are_refused(kept, tmp_path, name, change):
    """Of the right kind and size: theta, biomass and area that are not of one aggregate, nodes held where no wall is,
    one fixed point too many or none, rows that cannot be."""
    assert refused_with(kept, tmp_path / "x", **{name: change})


def all_rows(cut):
    """Rows, and what there is of each row, cut alike."""
    return {f"record.{name}": cut for name in ("rows", "whole")}


@pytest.mark.parametrize("changes", [
    all_rows(lambda a: a[:-1]), all_rows(lambda a: a[:, 1:]), {"record.rows": lambda a: -a},
    {"record.rows": lambda a: a + 1.0}, {"record.whole": lambda a: ~a}, {"record.ledgers": lambda a: a[:0]},
    {"record.before_h": lambda a: np.append(a, 1.0)}, {"record.sizes": lambda a: a + 1},
    {"record.hashes": lambda a: a[::-1].copy()}, {PENDING: lambda a: a[:0]}, {PENDING: lambda a: a[:, 1:]}])
def test_rows_that_are_not_those_of_the_state_are_refused(kept, tmp_path, changes):
    assert refused_with(kept, tmp_path / "x", **changes)


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


def signed(header: bytes, data: bytes = b"") -> bytes:
    """A checkpoint with this header under a right checksum."""
    body = header + b"\n" + data
    return checkpoint.MAGIC + sha256(body).hexdigest().encode() + b"\n" + body


@pytest.mark.parametrize("header", [
    b"", b"[]", b"\xff\xfe", b'{"plain": NaN, "arrays": []}', b"[" * 100_000, b'{"plain": [], "arrays": []}',
    b'{"plain": {}}', *(json.dumps({"plain": {}, "arrays": arrays}).encode() for arrays in [
        [["points", "<f8", [2**39, 2**39], "C"]], [["points", "|O", [1], "C"]], [["points", "<f8", [-1], "C"]],
        [["points"]], [["points", "<f8", [1], "K"]], {}, [["a", "<f8", [0], "C"], ["a", "<f8", [0], "C"]],
        [["a", "|b1", [8], "C"]], [["a", "<f8", [1, 1, 1], "C"]]])])
def test_headers_that_cannot_be_are_refused_without_memory(header):
    """One that promises terabytes takes none."""
    with little_memory(2**20), pytest.raises(CheckpointError):
        decoded(signed(header, b"\x02" * 8))


def test_a_long_header_is_refused_without_memory(kept, tmp_path):
    """48 MB of empty lists would take 1.3 GB as objects; nor is a file of 2 GB read."""
    content = signed(b'{"plain": {}, "arrays": [' + b"[]," * 16_000_000 + b"[]]}")
    with little_memory(2 * len(content)), pytest.raises(CheckpointError, match="longer than"):
        decoded(content)
    with (tmp_path / "x").open("wb") as file:
        file.truncate(2**31)
    recorder = Recorder(*kept[:2])
    with little_memory(2**20), pytest.raises(CheckpointError, match="longer than"):
        recorder.restore(tmp_path / "x")


@contextmanager
def little_memory(most):
    """Fails where it takes more bytes than so many."""
    tracemalloc.start()
    yield
    assert tracemalloc.get_traced_memory()[1] < most
    tracemalloc.stop()


@example(b"")
@example(checkpoint.MAGIC)
@example(b"\n")
@given(st.binary(max_size=300))
def test_other_files_are_refused(content):
    with pytest.raises(CheckpointError, match="does not begin as|checksum|format is not"):
        decoded(content)


def test_a_checkpoint_of_another_format_or_scene_is_refused_in_one_line(kept, tmp_path):
    old = checkpoint.KIND + b"2 " + kept[2].removeprefix(checkpoint.MAGIC)
    with pytest.raises(CheckpointError, match="^its format is not 4: another version wrote it$"):
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
