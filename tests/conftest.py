"""Settings of all tests: floating-point errors raise, figures need no screen, examples are repeatable."""
import os
import signal

import matplotlib
import numpy
import pytest
from hypothesis import HealthCheck, settings
from matplotlib import pyplot

from repro.runs import progress
from tests import browser, pages

matplotlib.use("Agg")
SLOW_MACHINES_MAY = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
settings.register_profile("ci", derandomize=True, max_examples=20, **SLOW_MACHINES_MAY)
#: The tests that a mutant names include thorough ones, with as many examples as usual.
settings.register_profile("mutants", settings.get_profile("ci"))
settings.register_profile("thorough", print_blob=True, max_examples=200, **SLOW_MACHINES_MAY)
signal.signal(signal.SIGINT, signal.default_int_handler)  # processes in the background ignore it
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci"))


def run_fixture(name, *arguments):
    """Make a fixture: the folder of a run for pages. Tests that change the folder copy it."""
    @pytest.fixture(scope="session", name=name)
    def folder(tmp_path_factory):
        return pages.run(tmp_path_factory.mktemp(name), *arguments)
    return folder


fast = run_fixture("fast", "base", pages.FAST, 'growth.end="3 h"', 'output.every="0.5 h"')
paper = run_fixture("paper", "base", 'growth.end="1 h"')
flow_only = run_fixture("flow_only", "flow_only")


@pytest.fixture
def without_progress(monkeypatch):
    """No line of progress appears, however slow the machine is."""
    monkeypatch.setattr(progress, "TICK", 600.0)


@pytest.fixture
def close_figures():
    """No figure of pyplot outlives its test."""
    yield
    pyplot.close("all")


@pytest.fixture(scope="module")
def window():
    """A window of Chromium."""
    with browser.Browser() as chromium:
        yield chromium


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup():
    """Make overflow, division by zero and invalid operations raise.

    An autouse fixture would be too late: pytest sets up fixtures of a wider scope before those of a function.
    """
    numpy.seterr(all="raise", under="ignore")


def pytest_collection_modifyitems(items):
    """Skip tests marked thorough, except in make test-thorough and make mutants."""
    if os.environ.get("HYPOTHESIS_PROFILE") not in ("thorough", "mutants"):
        for item in items:
            if item.get_closest_marker("thorough"):
                item.add_marker(pytest.mark.skip(reason="for make test-thorough"))
