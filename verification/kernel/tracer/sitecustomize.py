"""Writes which functions of the code a test calls, in the process of the test and in those that it starts.

Python imports this module at its start where its folder is on PYTHONPATH. It writes lines "test, file, name" to the
file REACH_FILE, each once a process, as soon as it happens: a process that is killed has written what it called.
Nothing is traced but calls, so that a test takes little longer.
"""

import os
import sys
import threading
from functools import cache

test = os.environ.get("REACH_TEST", "")


def note(frame, event, argument):
    """Write the function that is called, if it is the code's and new."""
    file = _ours(frame.f_code.co_filename)
    if file:
        _write(test, file, frame.f_code.co_qualname)


@cache
def _ours(name: str) -> str:
    """A file's place in the code, "" where it is not there."""
    root = os.environ["REACH_ROOT"]
    return os.path.relpath(name, root) if name.startswith(root + os.sep) else ""


@cache
def _write(*call: str) -> None:
    os.write(_file, ("\t".join(call) + "\n").encode())


if "REACH_FILE" in os.environ:
    _file = os.open(os.environ["REACH_FILE"], os.O_WRONLY | os.O_APPEND | os.O_CREAT)
    threading.settrace(note)
    sys.settrace(note)
