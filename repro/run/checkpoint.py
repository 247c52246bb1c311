"""Checkpoint files: plain data under a checksum, whole or not at all, the one before kept.

    dupin2001-repro checkpoint 1 SHA-256 of all that follows this line
    {"plain": ..., "arrays": [[name, dtype, shape, "C" or "F"], ...]}        one line of JSON
    the arrays' bytes, one after the other, little-endian

Nothing is compressed and no size is taken from the file that is not there in bytes, so that reading a hostile one needs
no more memory than it is long, and executes nothing.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from contextlib import suppress
from pathlib import Path
from typing import Literal

import numpy as np

from repro.errors import CheckpointError
from repro.files import whole

#: Where a run keeps the state that it goes on from, the one before, and the last one that could not be used.
NEWEST, PREVIOUS, REFUSED = "checkpoint.state", "checkpoint.previous", "checkpoint.refused"
MAGIC = b"dupin2001-repro checkpoint 1 "
DTYPES = ("<f8", "<i8", "<i4", "|b1")


def encoded(plain: dict, arrays: dict[str, np.ndarray]) -> bytes:
    """The bytes of a checkpoint: ``plain`` is what JSON can say; arrays are contiguous, their layout is kept."""
    told, parts = [], []
    for name, array in arrays.items():
        order: Literal["C", "F"] = "C" if array.flags.c_contiguous else "F"
        small = array.astype(array.dtype.newbyteorder("<"), copy=False)
        told.append([name, small.dtype.str, list(array.shape), order])
        parts.append(small.tobytes(order))
    header = json.dumps({"plain": plain, "arrays": told}, allow_nan=False, separators=(",", ":"))
    body = b"".join([header.encode(), b"\n", *parts])
    return MAGIC + hashlib.sha256(body).hexdigest().encode() + b"\n" + body


def decoded(content: bytes) -> tuple[dict, dict[str, np.ndarray]]:
    """What :func:`encoded` was given. Raises CheckpointError where the checksum or the data are not right."""
    first, _, body = content.partition(b"\n")
    if not first.startswith(MAGIC):
        raise CheckpointError("it does not begin as a checkpoint of this version does")
    if first != MAGIC + hashlib.sha256(body).hexdigest().encode():
        raise CheckpointError("its checksum is wrong: it was cut short or altered")
    header, _, data = body.partition(b"\n")
    try:
        told = json.loads(header, parse_constant=_no_constant)
    except (ValueError, RecursionError) as error:
        raise CheckpointError(f"its header is not JSON ({type(error).__name__})") from None
    if not isinstance(told, dict) or set(told) != {"plain", "arrays"} or not isinstance(told["plain"], dict):
        raise CheckpointError("its header does not hold what it should")
    return told["plain"], _arrays(told["arrays"], data)


def _no_constant(name: str):
    raise ValueError(name)


def _arrays(told, data: bytes) -> dict[str, np.ndarray]:
    """The arrays that a header tells of, which use up the data exactly."""
    found, at = {}, 0
    for entry in told if isinstance(told, list) else [None]:
        name, dtype, shape, order = _entry(entry)
        count = math.prod(shape)
        if count * dtype.itemsize > len(data) - at:
            raise CheckpointError(f"array {name!r} is longer than the file")
        flat = np.frombuffer(data, dtype, count, at)
        if dtype.kind == "b" and count and flat.view(np.uint8).max() > 1:
            raise CheckpointError(f"array {name!r} holds what is neither true nor false")
        found[name] = flat.astype(dtype.newbyteorder("=")).reshape(shape, order=order)
        at += count * dtype.itemsize
    if at != len(data) or len(found) != len(told):
        raise CheckpointError("its arrays are not those that its header tells of")
    return found


def _entry(entry) -> tuple[str, np.dtype, tuple[int, ...], Literal["C", "F"]]:
    """One array's name, type, shape and layout, checked."""
    right = isinstance(entry, list) and len(entry) == 4 and isinstance(entry[0], str) and entry[1] in DTYPES and (
        isinstance(entry[2], list) and 0 < len(entry[2]) <= 2 and entry[3] in ("C", "F")) and (
        all(type(count) is int and 0 <= count < 2**40 for count in entry[2]))
    if not right:
        raise CheckpointError("its header tells of an array that cannot be")
    return entry[0], np.dtype(entry[1]), tuple(entry[2]), entry[3]


def synced(path: Path) -> None:
    """Have the system put a file on the disk."""
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def write(folder: Path, content: bytes) -> None:
    """Make this the newest checkpoint of a folder and the newest before the previous one; OSError where it cannot."""
    with whole(folder / NEWEST) as beside:
        with beside.open("xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        with suppress(FileNotFoundError):
            os.replace(folder / NEWEST, folder / PREVIOUS)
