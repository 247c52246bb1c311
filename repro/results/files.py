"""Files that appear whole or not at all, and through no link that stands in their way."""

from __future__ import annotations

import errno
import os
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import mkdtemp

#: How the folders are called in which files are written before they are moved to their place.
WRITING = ".writing-"


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A path to write to; what is written there is moved to ``path`` at the end of the block.

    The path is in a new folder beside ``path`` that no other user may enter, so that no link can
    be in the way. A link at ``path`` itself is replaced and not followed. Raises OSError where the
    folder cannot be written; nothing is left of it then.
    """
    room = Path(mkdtemp(prefix=WRITING, dir=path.parent))
    try:
        yield room / path.name
        os.replace(room / path.name, path)
    finally:
        shutil.rmtree(room, ignore_errors=True)


def is_file(path: Path) -> bool:
    """Is it a regular file, and not a link to one?"""
    try:
        return stat.S_ISREG(path.lstat().st_mode)
    except OSError:
        return False


def is_folder(path: Path) -> bool:
    """Is it a folder, and not a link to one?"""
    return path.is_dir() and not path.is_symlink()


def open_lock(path: Path) -> int:
    """The descriptor of an empty file to lock, made where it is not there.

    Raises OSError where it is a link, or no file, or has content: then it is somebody else's.
    """
    asked = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    number = os.open(path, asked, 0o666)
    opened = os.fstat(number)
    if stat.S_ISREG(opened.st_mode) and opened.st_size == 0:
        return number
    os.close(number)
    raise FileExistsError(errno.EEXIST, f"{path.name} is there and is no lock")
