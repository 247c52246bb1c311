"""Checkpoint files: plain data with a checksum. A file is complete or absent.

    dupin2001-repro checkpoint 7 SHA-256 of everything after this line
    an uncompressed .npz file: the arrays, and the rest as JSON in the array "plain"

Reading a checkpoint executes nothing. The checksum detects accidental changes. It does not protect
against a forged checkpoint with a forged checksum.
"""

import io
import json
import os
from contextlib import suppress
from pathlib import Path

import numpy as np

from repro.errors import CheckpointError
from repro.results.files import MOST_DATA, atomic_path, is_file, read, sha256

#: Files of the newest checkpoint, the one before, the last refused one, and the state from which a
#: longer run resumes.
NEWEST = "checkpoint.state"
PREVIOUS = "checkpoint.previous"
REFUSED = "checkpoint.refused"
LAST = "checkpoint.last"
#: The checkpoints from which an unfinished run resumes, the newest first.
STATES = (NEWEST, PREVIOUS)
KIND, FORMAT = b"dupin2001-repro checkpoint ", b"10"
MAGIC = KIND + FORMAT + b" "
#: The array with the JSON text.
PLAIN = "plain"

Arrays = dict[str, np.ndarray]


def encode(plain: dict, arrays: Arrays) -> bytes:
    """The bytes of a checkpoint; plain: values for JSON. The memory layout of arrays is kept."""
    text = json.dumps(plain, allow_nan=False).encode()
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **{PLAIN: np.frombuffer(text, np.uint8)}, **arrays)
    body = file.getvalue()
    return MAGIC + sha256(body).encode() + b"\n" + body


def decode(content: bytes) -> tuple[dict, Arrays]:
    """Invert :func:`encode`. Raises CheckpointError if the bytes have changed."""
    header, _, body = content.partition(b"\n")
    if header.startswith(KIND) and not header.startswith(MAGIC):
        raise CheckpointError(f"its format is not {FORMAT.decode()}: another version wrote it")
    if not header.startswith(MAGIC):
        raise CheckpointError("it does not begin like a checkpoint")
    if header != MAGIC + sha256(body).encode():
        raise CheckpointError("its checksum is wrong: it was cut short or altered")
    with np.load(io.BytesIO(body), allow_pickle=False) as file:
        arrays = dict(file)
    return json.loads(arrays.pop(PLAIN).tobytes()), arrays


def read_checkpoint(path: Path) -> tuple[dict, Arrays]:
    """Decode a checkpoint file. Raises CheckpointError if it cannot be read or has changed."""
    if not is_file(path):
        raise CheckpointError("it is not a regular file")
    try:
        return decode(read(path, MOST_DATA))
    except OSError as error:
        raise CheckpointError(f"it cannot be read ({error.strerror})") from None


def sync_to_disk(path: Path) -> None:
    """Force the system to write a file to the disk."""
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def write(folder: Path, content: bytes) -> None:
    """Write the newest checkpoint of a folder; the one before becomes the previous one.

    Raises OSError if the folder cannot be written.
    """
    with atomic_path(folder / NEWEST) as beside:
        with beside.open("xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        with suppress(FileNotFoundError):
            os.replace(folder / NEWEST, folder / PREVIOUS)
