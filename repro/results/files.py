"""Files: written completely or not at all, read up to a limit of size, and verified by SHA-256.

``run.json`` is written last. It ends with the SHA-256 of all of its text before that. Unless the
run is in progress, it also has the SHA-256 of the run's other files. These sums reveal accidental
changes. They give no protection against intentional ones.
"""

import errno
import hashlib
import json
import os
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import mkdtemp

from repro.errors import OutputError

#: Prefix of the folders in which files are written before they are moved to their final path.
WRITING = ".writing-"
#: Largest files in bytes: JSON, whose objects take many times its length; a table; the fields of
#: one time, or a checkpoint. A mesh of a million nodes takes a quarter of the last limit.
MOST_JSON = 2**24
MOST_TABLE = 2**27
MOST_DATA = 2**30


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """Yield a path to write to. The file moves to ``path`` at the end of the block.

    The yielded path is in a new folder beside ``path`` that no other user may enter, so that no
    link can redirect it. A link at ``path`` itself is replaced and not followed. Raises OSError if
    the folder cannot be written; no file is left then.
    """
    folder = Path(mkdtemp(prefix=WRITING, dir=path.parent))
    try:
        yield folder / path.name
        os.replace(folder / path.name, path)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def output_path(path: Path) -> Iterator[Path]:
    """:func:`atomic_path` for a file that a user names.

    Raises OutputError, at the start if possible, if the file cannot be written.
    """
    try:
        if "\0" in str(path):
            raise OSError(errno.EINVAL, "a path has no null byte")
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        with atomic_path(path) as beside:
            yield beside
    except OSError as error:
        reason = error.strerror or error
        raise OutputError(f"{path}: {reason}; a file that can be written is "
                          "needed") from error


def is_file(path: Path) -> bool:
    """Is it a regular file, and not a link to one?"""
    try:
        return stat.S_ISREG(path.lstat().st_mode)
    except OSError:
        return False


def is_folder(path: Path) -> bool:
    """Is it a folder, and not a link to one?"""
    return path.is_dir() and not path.is_symlink()


def read(path: Path, most: int) -> bytes:
    """The content of a regular file of at most `most` bytes.

    Raises OSError if the path is no regular file (a pipe, a device), or if the file is longer or
    cannot be read. Never waits for a writer.
    """
    flags = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    with open(os.open(path, os.O_RDONLY | flags), "rb") as file:
        status = os.fstat(file.fileno())
        if not stat.S_ISREG(status.st_mode):
            raise OSError(errno.EINVAL, "it is not a regular file")
        if status.st_size > most:
            raise OSError(errno.EFBIG, f"it is longer than {most} bytes")
        return file.read(status.st_size)


def sha256(content: bytes) -> str:
    """The SHA-256 of a file's content, in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def sha256_of(path: Path) -> str:
    """The SHA-256 of a file; empty if it is missing, unreadable or not a regular file."""
    try:
        return sha256(read(path, MOST_DATA))
    except OSError:
        return ""


def read_json(path: Path) -> dict:
    """The object in a JSON file. Raises OSError as :func:`read`, and ValueError if it is no object.
    """
    return _object(read(path, MOST_JSON))


def _object(content: bytes) -> dict:
    try:
        parsed = json.loads(content)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    if not isinstance(parsed, dict):
        raise ValueError("it is not a JSON object")
    return parsed


def sealed(content: dict) -> str:
    """The text of an object as JSON. Its last entry is the SHA-256 of the text before."""
    return _with_checksum(json.dumps(content, indent=2, allow_nan=False).removesuffix("\n}"))


def _with_checksum(text: str) -> str:
    return f'{text},\n  "checksum": "{sha256(text.encode())}"\n}}\n'


def read_sealed(path: Path) -> dict:
    """The object in a file of :func:`sealed` text. Raises OSError as :func:`read`, and ValueError
    if the file has changed since it was written."""
    content = read(path, MOST_JSON)
    before, separator, _ = content.rpartition(b',\n  "checksum": ')
    if not separator or content != _with_checksum(before.decode(errors="replace")).encode():
        _object(content)  # raises a more specific error if the JSON is broken
        raise ValueError("its checksum is wrong: it was cut short or altered, or another version "
                         "wrote it")
    record = _object(content)
    del record["checksum"]
    return record
