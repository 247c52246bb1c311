"""Writes which functions of the code a test calls, in the process of the test and in those that it starts.

Python imports this module at its start where its folder is on PYTHONPATH. It writes lines "test, file, first line,
name" to the file REACH_FILE, each once a process, as soon as it happens: a process that is killed has written what it
called. Nothing is traced but calls, so that a test takes little longer.
"""

import os
import sys
import threading

test = os.environ.get("REACH_TEST", "")
_root = os.environ.get("REACH_ROOT", "")
_written: set[tuple[str, str, int, str]] = set()
_ours: dict[str, str] = {}


def note(frame, event, argument):
    """Write the function that is called, if it is the code's and new."""
    code = frame.f_code
    name = code.co_filename
    ours = _ours.get(name)
    if ours is None:
        ours = _ours[name] = os.path.relpath(name, _root) if name.startswith(_root + os.sep) else ""
    if ours:
        call = (test, ours, code.co_firstlineno, code.co_qualname)
        if call not in _written:
            _written.add(call)
            os.write(_file, ("\t".join(map(str, call)) + "\n").encode())


def start() -> None:
    """Trace the calls of all threads from now on."""
    threading.settrace(note)
    sys.settrace(note)


if "REACH_FILE" in os.environ:
    _file = os.open(os.environ["REACH_FILE"], os.O_WRONLY | os.O_APPEND | os.O_CREAT)
    start()
