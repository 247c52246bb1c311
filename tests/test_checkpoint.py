"""Checkpoints: what is written is read, and whatever else is read is refused."""

import copy
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
from hypothesis import example, given, settings
from hypothesis import strategies as st

from repro import results
from repro.errors import CheckpointError
from repro.march.loop import SAME_TIME, State
from repro.march.simulation import steps
from repro.run import checkpoint, stored
from repro.run.checkpoint import NEWEST, PREVIOUS, decoded, encoded
from repro.run.recorder import PENDING, Recorder, packed
from repro.run.running import Watch, run
from repro.scene import load_scene

THOROUGH = os.environ.get("HYPOTHESIS_PROFILE") == "thorough"
EXAMPLES = settings(max_examples=500 if THOROUGH else 20)  # by two tests and three presets: 3000 malformed checkpoints
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
            found.append((folder / NEWEST).read_bytes())

    run(scene, folder, watch=Watch(tell=keep, interval=0.0))
    told = [decoded(content)[1] for content in found]
    both = [k for k, arrays in enumerate(told) if len(arrays[PENDING]) and len(arrays["record.ledgers"])]
    return scene, folder, found[both[0]]


def restored(kept, content, path):
    """A recorder that goes on from these bytes."""
    scene, folder, _ = kept
    path.write_bytes(content)
    recorder = Recorder(scene, folder)
    recorder.restore(path)
    return recorder


def test_what_is_written_is_read(kept, tmp_path):
    """To the last bit, layout and type included."""
    scene, _, content = kept
    found = restored(kept, content, tmp_path / "x")
    plain, arrays = packed(scene, found.state, found.record)
    assert encoded(plain, arrays) == encoded(*decoded(content)) == content
    assert plain["state"]["pace"][0] > 0 and isinstance(found.state.ledgers[0].supplied, tuple)
    assert {type(value) for row in found.record.rows for value in row} <= {int, float, type(None)}


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


def refused(kept, content, path):
    """Is it refused in one line?"""
    with pytest.raises(CheckpointError) as error:
        restored(kept, content, path)
    return bool(str(error.value)) and "\n" not in str(error.value)


def refused_with(kept, path, **changes):
    """Is it refused with arrays, by their names, changed by functions?"""
    plain, arrays = decoded(kept[2])
    changed = {name: np.ascontiguousarray(change(arrays[name])) for name, change in changes.items()}
    return refused(kept, encoded(plain, arrays | changed), path)


@EXAMPLES
@given(st.floats(0.0, 1.0, exclude_max=True), st.integers(0, 40) | st.just(2**40), st.binary(max_size=40))
def test_altered_and_truncated_checkpoints_are_refused(kept, tmp_path_factory, part, length, some):
    """Bytes changed, cut out, put in or cut off at random places: told by the checksum."""
    content = kept[2]
    at = int(part * len(content))
    new = content[:at] + some + content[at + length:]
    assert new == content or refused(kept, new, tmp_path_factory.getbasetemp() / "altered")


def test_one_bit_of_a_number_is_told(kept, tmp_path):
    """The last of the first array's first number: all else is as a run's."""
    content = bytearray(kept[2])
    content[content.index(b"\n", content.index(b"\n") + 1) + 1] ^= 1
    assert refused(kept, bytes(content), tmp_path / "altered")


JUNK = st.one_of(st.none(), st.booleans(), st.integers(), st.just(10**400),
                 st.floats(allow_nan=False, allow_infinity=False),
                 st.text(max_size=3), st.lists(st.integers(0, 3), max_size=4), st.just({}), st.just([[]]))
NEVER = (math.nan, math.inf, -math.inf)


def places(value, path=()):
    """Every place in what JSON says, but for the wall times and the names of stages."""
    yield path
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        if key not in ("seconds", "stages", "resumes"):
            yield from places(inner, (*path, key))


def at(value, path):
    for key in path:
        value = value[key]
    return value


@EXAMPLES
@given(st.data())
def test_signed_nonsense_is_refused_or_harmless(kept, tmp_path_factory, data):
    """A value of another kind, an array of another kind or shape, indices that are no nodes, numbers that are none, all
    under a right checksum: refused, or a state of the same shape as a run's. Nothing but a CheckpointError is raised.
    """
    path = tmp_path_factory.getbasetemp() / "nonsense"
    plain, arrays = copy.deepcopy(decoded(kept[2])[0]), dict(decoded(kept[2])[1])
    data.draw(st.sampled_from([spoil_plain, spoil_array, spoil_numbers]))(data, plain, arrays)
    try:
        recorder = restored(kept, encoded(plain, arrays), path)
    except CheckpointError as error:
        assert str(error) and "\n" not in str(error)
        return
    assert isinstance(recorder.state, State) and np.isfinite(recorder.state.pore.mesh.points).all()


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


def spoil_plain(data, plain, arrays):
    path = data.draw(st.sampled_from([path for path in places(plain) if path]))
    at(plain, path[:-1])[path[-1]] = data.draw(JUNK)


def spoil_array(data, plain, arrays):
    name = data.draw(st.sampled_from(sorted(arrays)))
    change = data.draw(st.sampled_from([lambda a: a[:-1], lambda a: a.astype(np.int64), lambda a: a.astype(bool),
                                        lambda a: a[:0], lambda a: np.column_stack([a, a])]))
    with np.errstate(all="ignore"):
        arrays[name] = np.ascontiguousarray(change(arrays[name]))


def spoil_numbers(data, plain, arrays):
    """One of an array: not a number, or so large; an index that may be no node."""
    able = [name for name, array in arrays.items() if array.dtype.kind in "fi" and array.size]
    name = data.draw(st.sampled_from(able))
    wrong = {"f": st.sampled_from([*NEVER, 1e300, -1e300]), "i": st.integers(-(2**63), 2**63 - 1)}
    place = data.draw(st.integers(0, arrays[name].size - 1))
    arrays[name] = with_number(arrays[name], place, data.draw(wrong[arrays[name].dtype.kind]))


def with_number(array, place, value):
    """The array with another number at a place."""
    array = array.copy(order="K")
    array.flat[place] = value
    return array


def test_numbers_that_are_none_and_indices_that_are_no_nodes_are_refused(kept, tmp_path):
    """In every array."""
    arrays = decoded(kept[2])[1]
    for name, array in arrays.items():
        wrong = {"f": NEVER, "i": (-1, len(arrays["points"]), 2**40)}.get(array.dtype.kind, ())
        for value in wrong if array.size else ():
            assert refused_with(kept, tmp_path / "x", **{name: partial(with_number, place=-1, value=value)})


@pytest.mark.parametrize("path, value", [
    ("state time_h", 1e9), ("state time_h", -1.0), ("state time_h", -0.5), ("state time_h", 0), ("state front", 0.5),
    ("state front", 1e9), ("state row_h", -0.5),
    ("state front", None), ("state front", 1), ("state pace", "1"), ("state pace", [1.0, 1.0]),
    ("state pace", [-0.1, 0.0, 0.0]), ("state remeshes", -1), ("state ends_um", [1.0, -1.0]),
    ("state ends_um", [-1e9, 1e9]), ("state guess", 1.5), ("state iterations", {"a": 0.5}),
    ("state ledgers", [[0.0]]), ("state ledgers", None), ("record", {}), ("record index", []),
    ("record seconds", -1.0), ("record stages", []), ("record iterations", []), ("record resumes", [1]),
    ("record missed", -1), ("record worst", -1.0), ("state pace", [0.0, 0.2, 0.0]), ("state pace", [1e300, 0.2, 0.0]),
    ("state ends_um", [-50.0, 50.0]), ("state ends_um", [-300.0, 300.0]), ("state remeshes", 10**15),
    ("record remeshes", 10**15), ("record missed", 10**15), ("record seconds", 1e300)])
def test_what_makes_no_sense_is_refused(kept, tmp_path, path, value):
    plain, arrays = copy.deepcopy(decoded(kept[2])[0]), decoded(kept[2])[1]
    *above, last = path.split()
    at(plain, above)[last] = value
    assert refused(kept, encoded(plain, arrays), tmp_path / "x")


@pytest.mark.parametrize("name, value", [
    ("active", -1e-9), ("inert", -1.0), ("theta", 0.0), ("theta", -1.0), ("theta", 1e300), ("acceptor", 1e300),
    ("donor", -1e300), ("pressure", 1e300), ("points", 1e6), ("reference", -1e6), ("wall", 3), ("cells", 0)])
def test_amounts_that_cannot_be_are_refused(kept, tmp_path, name, value):
    """Of a number in the middle of an array: masses below zero, expansions and concentrations that nothing has, places
    outside of the pore, a wall that is none, a triangle whose corners are one node."""
    def change(array):
        changed = with_number(array, array.size // 2, value)
        if name == "cells":
            changed[len(changed) // 2, :3] = value
        return changed

    assert refused_with(kept, tmp_path / "x", **{name: change})


def column(name, value):
    """The change of a table by which the last row of a column holds a value."""
    def change(rows):
        rows[-1, results.COLUMNS.index(name)] = value
        return rows
    return change


@pytest.mark.parametrize("name, change", [
    ("theta", lambda a: a * 0 + 1e-300), ("theta", lambda a: a * 0 + 1), ("theta", lambda a: 1.3 * a),
    ("theta", lambda a: 1e8 * a), ("theta", lambda a: with_number(a, 0, 1e-300)), ("active", lambda a: 1.5 * a),
    ("active", lambda a: 100 * a), ("active", lambda a: 0 * a), ("active", lambda a: a * 0 + 1e300),
    ("active", lambda a: with_number(a, 0, 0.0)), ("inert", lambda a: 300 * a),
    ("reference", lambda a: 0 * a), ("fixed", lambda a: a & False), ("fixed", lambda a: a | True),
    ("fixed", lambda a: np.roll(a, len(a) // 2)), ("wall", lambda a: a * 0), ("wall", lambda a: a * 0 + 1),
    ("wall", lambda a: with_number(a, 0, 2)), ("record.ledgers", lambda a: a * 0 + 1e300),
    ("record.rows", column("aggregate_area_um2", 1e300)), ("record.rows", column("mean_velocity_m_per_d", -3.0)),
    ("record.rows", column("effluent_acceptor_mg_per_L", -7.0)), ("record.rows", column("thickness_um", math.nan))])
def test_arrays_that_no_run_comes_to_are_refused(kept, tmp_path, name, change):
    """Of the right kind and size: theta, biomass and area that are not of one aggregate, nodes held where no wall is,
    one fixed point too many or none, rows that cannot be."""
    plain, arrays = decoded(kept[2])
    with np.errstate(over="ignore"):
        arrays[name] = change(arrays[name])
    assert refused(kept, encoded(plain, arrays), tmp_path / "x")


@pytest.mark.parametrize("name", ["points", "cells", "biomass", "loop", "wall", "fixed", "active", "inert", "theta",
                                  "reference", "pressure", "acceptor", "donor"])
def test_arrays_of_another_size_are_refused(kept, tmp_path, name):
    """A row too few, a row twice, and one column too many."""
    for change in (lambda a: a[:-1], lambda a: np.concatenate([a, a[-1:]]), lambda a: np.column_stack([a, a])):
        assert refused_with(kept, tmp_path / "x", **{name: change})


def test_the_elements_of_another_order_are_refused(kept, tmp_path):
    """Triangles of a scene of other elements, in a state that says it is of this one."""
    scene = kept[0]
    other = load_scene("base", PRESETS["paper" if scene.numerics.order > 1 else "fast"])
    state, _ = next(steps(other))
    plain, arrays = stored.packed(scene, state)
    with pytest.raises(CheckpointError):
        stored.unpacked(scene, plain, arrays)


def all_rows(cut):
    """Rows, and what there is of each row, cut alike."""
    return {f"record.{name}": cut for name in ("rows", "whole")}


@pytest.mark.parametrize("changes", [
    all_rows(lambda a: a[:-1]), all_rows(lambda a: a[:, 1:]), all_rows(lambda a: a[:0]), {"record.rows": lambda a: -a},
    {"record.rows": lambda a: a + 1.0}, {"record.whole": lambda a: ~a}, {"record.ledgers": lambda a: a[:0]},
    {"record.ledgers": lambda a: np.column_stack([a, a])}, {"record.before_h": lambda a: np.append(a, 1.0)},
    {"record.sizes": lambda a: a + 1}, {"record.hashes": lambda a: a[::-1].copy()},
    {"record.hashes": lambda a: np.zeros_like(a)}, {PENDING: lambda a: a[:0]}, {PENDING: lambda a: a[:, 1:]},
    {PENDING: lambda a: a[0]}])
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
    b"", b"{", b"[]", b"\xff\xfe", b'{"plain": NaN, "arrays": []}', b"[" * 100_000, b'{"plain": [], "arrays": []}',
    b'{"plain": {}}', b"9" * 5000, *(json.dumps({"plain": {}, "arrays": arrays}).encode() for arrays in [
    [["points", "<f8", [2**39, 2**39], "C"]], [["points", "<f8", [2**62], "C"]], [["points", "|O", [1], "C"]],
    [["points", "<f8", [-1], "C"]], [["points", "<f8", [True], "C"]], [["points", "<f8", [], "C"]], [["points"]], [1],
    [["points", "<f8", [1], "K"]], [[1, "<f8", [1], "C"]], [["points", ["<f8"], [1], "C"]], {}, None,
    [["points", "<f8", [0], "C"], ["points", "<f8", [0], "C"]], [["a", "|b1", [8], "C"]],
    [["a", "<f8", [1, 1, 1], "C"]]])])
def test_headers_that_cannot_be_are_refused_without_memory(header):
    """One that promises terabytes takes none."""
    with little_memory(2**20), pytest.raises(CheckpointError):
        decoded(signed(header, b"\x02" * 8))


def test_a_long_header_is_refused_without_memory():
    """48 MB of empty lists would take 1.3 GB as objects."""
    content = signed(b'{"plain": {}, "arrays": [' + b"[]," * 16_000_000 + b"[]]}")
    with little_memory(2 * len(content)), pytest.raises(CheckpointError, match="longer than"):
        decoded(content)


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


def test_a_checkpoint_of_another_format_is_refused_in_one_line(kept, tmp_path):
    old = checkpoint.KIND + b"2 " + kept[2].removeprefix(checkpoint.MAGIC)
    assert old != kept[2]
    with pytest.raises(CheckpointError, match="^its format is not 4: another version wrote it$"):
        restored(kept, old, tmp_path / "x")


def of_two_gigabytes(path):
    """With nothing in it."""
    with path.open("wb") as file:
        file.truncate(2**31)


@pytest.mark.parametrize("make, why", [
    (os.mkfifo, "cannot be read"), (lambda path: path.symlink_to("/dev/zero"), "cannot be read"),
    (lambda path: path.symlink_to("good"), "cannot be read"), (os.mkdir, "cannot be read"),
    (of_two_gigabytes, "longer than")])
def test_nothing_but_a_regular_file_is_read(kept, tmp_path, make, why):
    """A pipe that nobody writes to, a device without end, a link to what would be right, a folder; nor a long file."""
    (tmp_path / "good").write_bytes(kept[2])
    make(tmp_path / "x")
    recorder = Recorder(kept[0], kept[1])
    with little_memory(2**20), pytest.raises(CheckpointError, match=why):
        recorder.restore(tmp_path / "x")


def test_a_checkpoint_of_another_scene_is_refused(kept, tmp_path):
    other = load_scene("base", ("flow.viscosity_ratio=3",))
    with pytest.raises(CheckpointError, match="another scene"):
        restored((other, *kept[1:]), kept[2], tmp_path / "x")


def test_states_of_clean_channels_are_kept():
    """No aggregate, no substrates."""
    for elements in ("linear", "quadratic", "cubic"):
        scene = load_scene("flow_only", (f'numerics.elements="{elements}"',))
        ((state, _),) = steps(scene)
        plain, arrays = stored.packed(scene, state)
        assert stored.packed(scene, stored.unpacked(scene, plain, arrays))[0] == plain


def test_a_state_that_is_the_runs_end_to_round_off_is_kept():
    """A step that ends less than SAME_TIME after growth.end is not cut there."""
    long = load_scene("base", ["numerics.preset=fast", "growth.end=5 h"])
    time = next(state.pore.time for state, _ in steps(long) if state.pore.time > 0)
    short = load_scene("base", ["numerics.preset=fast", f"growth.end={time - 0.5 * SAME_TIME!r} h"])
    *_, (last, _) = steps(short)
    assert 0 < last.pore.time - short.growth.end < SAME_TIME
    assert stored.unpacked(short, *stored.packed(short, last)).pore.time == last.pore.time
