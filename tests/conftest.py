"""Hostile numerics for every test: floating-point errors raise, figures need no screen, examples are repeatable."""
import os
import signal

import matplotlib
import numpy
import pytest
from hypothesis import HealthCheck, settings

from tests import pages

matplotlib.use("Agg")
SLOW_MACHINES_MAY = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
settings.register_profile("ci", derandomize=True, max_examples=20, **SLOW_MACHINES_MAY)
settings.register_profile("thorough", print_blob=True, max_examples=200, **SLOW_MACHINES_MAY)
signal.signal(signal.SIGINT, signal.default_int_handler)  # in the background it is ignored, by children too
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci"))


def run_of(name, *given):
    """A fixture: the folder of a run, for pages; whoever changes it copies it."""
    @pytest.fixture(scope="session", name=name)
    def made(tmp_path_factory):
        return pages.run(tmp_path_factory.mktemp(name), *given)
    return made


fast = run_of("fast", "base", pages.FAST, 'growth.end="3 h"')
paper = run_of("paper", "base", 'growth.end="1 h"')
flow_only = run_of("flow_only", "flow_only")


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup():
    """Overflow, division by zero and invalid operations raise.

    A hook and not an autouse fixture: it also covers fixtures of a wider scope, which are set up before any function's.
    """
    numpy.seterr(all="raise", under="ignore")


def pytest_collection_modifyitems(items):
    """What is marked thorough runs in make test-thorough alone."""
    if os.environ.get("HYPOTHESIS_PROFILE") != "thorough":
        for item in items:
            if item.get_closest_marker("thorough"):
                item.add_marker(pytest.mark.skip(reason="for make test-thorough"))
