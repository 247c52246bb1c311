"""Checkpoint files: plain data under a checksum, whole or not at all, the one before kept.

    dupin2001-repro checkpoint 4 SHA-256 of all that follows this line
    {"plain": ..., "arrays": [[name, dtype, shape, "C" or "F"], ...]}        one line of JSON
    the arrays' bytes, one after the other, little-endian

Nothing is compressed, no size is taken from the file that is not there in bytes, and the line of
JSON, whose objects take many times its length, is short: whatever grows with a run is an array. So
reading a hostile file needs little more memory than it is long, and executes nothing.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import stat
from contextlib import suppress
from pathlib import Path
from typing import Literal

import numpy as np

from repro.errors import CheckpointError
from repro.results.files import whole

#: Where a run keeps the state that it goes on from, the one before, the last one refused, and the
#: one from which a longer run goes on.
NEWEST = "checkpoint.state"
PREVIOUS = "checkpoint.previous"
REFUSED = "checkpoint.refused"
LAST = "checkpoint.last"
KIND, FORMAT = b"dupin2001-repro checkpoint ", b"4"
MAGIC = KIND + FORMAT + b" "
DTYPES = ("<f8", "<i8", "<i4", "|b1", "|u1")
#: Bytes that a file and its line of JSON may have. A mesh of a million nodes takes a quarter.
MOST, MOST_HEADER = 2**30, 2**22

Order = Literal["C", "F"]
Arrays = dict[str, np.ndarray]


def encoded(plain: dict, arrays: Arrays) -> bytes:
    """The bytes of a checkpoint: ``plain`` is what JSON can say; the layout of arrays is kept."""
    told: list[list] = []
    parts: list[bytes] = []
    for name, array in arrays.items():
        order: Order = "C" if array.flags.c_contiguous else "F"
        little = array.astype(array.dtype.newbyteorder("<"), copy=False)
        told.append([name, little.dtype.str, list(array.shape), order])
        parts.append(little.tobytes(order))
    header = json.dumps({"plain": plain, "arrays": told}, allow_nan=False, separators=(",", ":"))
    body = b"".join([header.encode(), b"\n", *parts])
    return MAGIC + hashlib.sha256(body).hexdigest().encode() + b"\n" + body


def decoded(content: bytes) -> tuple[dict, Arrays]:
    """What :func:`encoded` was given. Raises CheckpointError where checksum or data are wrong."""
    first, _, body = content.partition(b"\n")
    _check_first(first, body)
    header, newline, _ = body[: MOST_HEADER + 1].partition(b"\n")
    if not newline:
        raise CheckpointError(f"its header is longer than {MOST_HEADER} bytes, or has no end")
    try:
        told = json.loads(header, parse_constant=_no_constant)
    except (ValueError, RecursionError) as error:
        raise CheckpointError(f"its header is not JSON ({type(error).__name__})") from None
    right = isinstance(told, dict) and set(told) == {"plain", "arrays"}
    if not right or not isinstance(told["plain"], dict):
        raise CheckpointError("its header does not hold what it should")
    return told["plain"], _arrays(told["arrays"], memoryview(body)[len(header) + 1:])


def _check_first(first: bytes, body: bytes) -> None:
    """Raises CheckpointError where the first line is not that of the body."""
    if first.startswith(KIND) and not first.startswith(MAGIC):
        raise CheckpointError(f"its format is not {FORMAT.decode()}: another version wrote it")
    if not first.startswith(MAGIC):
        raise CheckpointError("it does not begin as a checkpoint does")
    if first != MAGIC + hashlib.sha256(body).hexdigest().encode():
        raise CheckpointError("its checksum is wrong: it was cut short or altered")


def _no_constant(name: str):
    raise ValueError(name)


def _arrays(told, data: memoryview) -> Arrays:
    """The arrays that a header tells of, which use up the data exactly."""
    arrays: Arrays = {}
    start = 0
    for entry in told if isinstance(told, list) else [None]:
        name, dtype, shape, order = _entry(entry)
        count = math.prod(shape)
        if count * dtype.itemsize > len(data) - start:
            raise CheckpointError(f"array {name!r} is longer than the file")
        flat = np.frombuffer(data, dtype, count, start)
        if dtype.kind == "b" and count and flat.view(np.uint8).max() > 1:
            raise CheckpointError(f"array {name!r} holds what is neither true nor false")
        arrays[name] = flat.astype(dtype.newbyteorder("=")).reshape(shape, order=order)
        start += count * dtype.itemsize
    if start != len(data) or len(arrays) != len(told):
        raise CheckpointError("its arrays are not those that its header tells of")
    return arrays


def _entry(entry) -> tuple[str, np.dtype, tuple[int, ...], Order]:
    """One array's name, type, shape and layout, checked."""
    right = (isinstance(entry, list) and len(entry) == 4 and isinstance(entry[0], str)
             and entry[1] in DTYPES and _is_shape(entry[2]) and entry[3] in ("C", "F"))
    if not right:
        raise CheckpointError("its header tells of an array that cannot be")
    return entry[0], np.dtype(entry[1]), tuple(entry[2]), entry[3]


def _is_shape(shape) -> bool:
    return (isinstance(shape, list) and 0 < len(shape) <= 2
            and all(type(count) is int and 0 <= count < 2**40 for count in shape))


def read(path: Path) -> bytes:
    """The content of a checkpoint's file, at most MOST bytes.

    Raises CheckpointError where it is no regular file (a link, a pipe, a device), or longer, or
    cannot be read. Nothing but a regular file is read, and nothing is waited for.
    """
    try:
        return _content(path)
    except OSError as error:
        raise CheckpointError(f"it cannot be read ({error.strerror})") from None


def _content(path: Path) -> bytes:
    names = ("O_NOFOLLOW", "O_NONBLOCK", "O_BINARY")
    flags = sum(getattr(os, name, 0) for name in names)
    number = os.open(path, os.O_RDONLY | flags)
    try:
        found = os.fstat(number)
        if not stat.S_ISREG(found.st_mode):
            raise CheckpointError("it cannot be read (not a regular file)")
        if found.st_size > MOST:
            raise CheckpointError(f"it is longer than {MOST} bytes")
        with open(number, "rb", closefd=False) as file:
            return file.read(found.st_size)
    finally:
        os.close(number)


def synced(path: Path) -> None:
    """Have the system put a file on the disk."""
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def write(folder: Path, content: bytes) -> None:
    """Make this the newest checkpoint of a folder, and the newest the previous one.

    Raises OSError where the folder cannot be written.
    """
    with whole(folder / NEWEST) as beside:
        with beside.open("xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        with suppress(FileNotFoundError):
            os.replace(folder / NEWEST, folder / PREVIOUS)
