"""Hostile numerics for every test: floating-point errors raise, figures need no screen, examples are repeatable."""
import os

import matplotlib
import numpy
import pytest
from hypothesis import settings

matplotlib.use("Agg")
settings.register_profile("ci", deadline=None, derandomize=True, max_examples=20)
settings.register_profile("thorough", deadline=None, max_examples=500)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci"))


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup():
    """Overflow, division by zero and invalid operations raise.

    A hook and not an autouse fixture: it also covers fixtures of a wider scope, which are set up before any function's.
    """
    numpy.seterr(all="raise", under="ignore")
