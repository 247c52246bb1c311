"""Checkpoint files: plain data under a checksum, complete or absent, the previous one kept.

    dupin2001-repro checkpoint 5 SHA-256 of all that follows this line
    an uncompressed .npz file: the arrays, and the rest as JSON in the array "plain"

Reading one executes nothing. The checksum tells what an accident has changed; it does not protect
from somebody who forges a checkpoint together with its checksum.
"""

from __future__ import annotations

import io
import json
import os
from contextlib import suppress
from pathlib import Path

import numpy as np

from repro.errors import CheckpointError
from repro.results.files import MOST_DATA, is_file, read, sha256, whole

#: Where a run keeps the state that it goes on from, the one before, the last one refused, and the
#: one from which a longer run goes on.
NEWEST = "checkpoint.state"
PREVIOUS = "checkpoint.previous"
REFUSED = "checkpoint.refused"
LAST = "checkpoint.last"
KIND, FORMAT = b"dupin2001-repro checkpoint ", b"5"
MAGIC = KIND + FORMAT + b" "
#: The array that has what JSON can say.
PLAIN = "plain"

Arrays = dict[str, np.ndarray]


def encoded(plain: dict, arrays: Arrays) -> bytes:
    """The bytes of a checkpoint: ``plain`` is what JSON can say; the layout of arrays is kept."""
    text = json.dumps(plain, allow_nan=False).encode()
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **{PLAIN: np.frombuffer(text, np.uint8)}, **arrays)
    body = file.getvalue()
    return MAGIC + sha256(body).encode() + b"\n" + body


def decoded(content: bytes) -> tuple[dict, Arrays]:
    """What :func:`encoded` was given. Raises CheckpointError where it is not as it was written."""
    first, _, body = content.partition(b"\n")
    if first.startswith(KIND) and not first.startswith(MAGIC):
        raise CheckpointError(f"its format is not {FORMAT.decode()}: another version wrote it")
    if not first.startswith(MAGIC):
        raise CheckpointError("it does not begin as a checkpoint does")
    if first != MAGIC + sha256(body).encode():
        raise CheckpointError("its checksum is wrong: it was cut short or altered")
    try:
        with np.load(io.BytesIO(body), allow_pickle=False) as file:
            arrays = dict(file)
        return json.loads(arrays.pop(PLAIN).tobytes()), arrays
    except Exception as error:  # whatever a forged file may cause
        raise CheckpointError(f"it is no checkpoint ({type(error).__name__})") from error


def read_checkpoint(path: Path) -> tuple[dict, Arrays]:
    """What :func:`encoded` was given, from a file. Raises CheckpointError where it cannot be read
    or is not as it was written."""
    if not is_file(path):
        raise CheckpointError("it is no regular file")
    try:
        return decoded(read(path, MOST_DATA))
    except OSError as error:
        raise CheckpointError(f"it cannot be read ({error.strerror})") from None


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
