"""What a run of tests does, for those who wait for it: a plugin of pytest, in the process of the tests.

It writes a line of JSON each to the file "told" of the folder TRIED: the tests that are collected, with the fixtures
that they share, each test as it starts, with the processor time so far, and each of its reports. Of the tests it keeps
those of the file "asked", in that order: single ones, all of a function or all of a file. One that is there no more,
such as one that is named after a value which a mutant changes, is left out: pytest would refuse to run any with it. The
process ends after LIMIT seconds of processor time.
"""

import json
import os
import resource
import sys
from pathlib import Path

import pytest

_folder = Path(os.environ["TRIED"])
_file = (_folder / "told").open("w", encoding="utf-8")
_asked = (_folder / "asked").read_text(encoding="utf-8").splitlines()
_limit = int(os.environ["LIMIT"])
resource.setrlimit(resource.RLIMIT_CPU, (_limit, _limit + 5))
_spent = [0.0]
_tracer = sys.modules["sitecustomize"]


def _tell(**what: object) -> None:
    print(json.dumps(what), file=_file, flush=True)


def _processor() -> float:
    """Seconds of processor time of this process, and of its children that have ended."""
    return sum(os.times()[:4])


def _mark(name: str) -> str:
    """Tell the tracer which test, or which fixture for several tests, makes the calls; what made them before."""
    before, _tracer.test = _tracer.test, name
    os.environ["REACH_TEST"] = name
    return before


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list) -> None:
    """Keep the tests that are asked for."""
    places = {test: place for place, test in enumerate(_asked)}

    def place(item) -> int:
        names = item.nodeid, item.nodeid.partition("[")[0], item.nodeid.partition("::")[0]
        return next((places[name] for name in names if name in places), -1)

    items[:] = sorted((item for item in items if place(item) >= 0), key=place)
    _tell(collected={item.nodeid: _wide(item) for item in items})


def _wide(item) -> list[str]:
    """What makes a test's calls besides it: the fixtures that are made once for several tests."""
    definitions = item._fixtureinfo.name2fixturedefs.items()
    return [f"fixture {name}" for name, defined in definitions if defined[-1].scope != "function"]


def pytest_collectreport(report) -> None:
    """A file that cannot be imported fails."""
    if report.failed:
        pytest_runtest_logreport(report)


def pytest_runtest_logstart(nodeid: str) -> None:
    """A test starts."""
    _mark(nodeid)
    _spent[0] = _processor()
    _tell(starts=nodeid, spent=_spent[0])


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(fixturedef):
    """What a fixture for several tests calls is its own."""
    before = _mark(f"fixture {fixturedef.argname}" if fixturedef.scope != "function" else _tracer.test)
    found = yield
    _mark(before)
    return found


def pytest_runtest_logreport(report) -> None:
    """A test is made ready, run or cleared away; the message of its error where it has one."""
    before, _spent[0] = _spent[0], _processor()
    crash = getattr(report.longrepr, "reprcrash", None)
    _tell(test=report.nodeid, outcome=report.outcome, seconds=_spent[0] - before,
          how=crash.message if crash else report.longreprtext)


def pytest_runtest_logfinish() -> None:
    """What is called between tests is nobody's."""
    _mark("")


_tell(starts="collection", spent=0.0)
