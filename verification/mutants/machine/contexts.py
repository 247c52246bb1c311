"""A plugin of pytest: the context of coverage.py is the test that runs, in its process and in those that it starts."""

import os

import pytest


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item):
    """Name the context in this process, and in the settings that the processes of the test read."""
    from coverage import Coverage

    os.environ |= {"TEST": item.nodeid, "COVERAGE_PROCESS_START": os.environ["SETTINGS"]}
    Coverage.current().switch_context(item.nodeid)
    outcome = yield
    Coverage.current().switch_context("")
    return outcome
