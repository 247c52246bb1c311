"""The option ``--scale-lengths`` of pytest: no test depends on the last bit.

With it every length of every scene is multiplied by 1 + 1e-12 where it is read, and divided by it where it is written,
so that texts and hashes of scenes stay the same. A test of the reading itself has the mark ``exact_lengths``, and runs
with the lengths as they are. Processes that a test starts read the lengths as they are, too.
"""
import math

import pytest

from repro.scene import units

FACTOR = 1 + 1e-12
#: The functions of :mod:`repro.scene.units` without the option.
TO_INTERNAL, IN_UNIT, WRITE = units.to_internal, units.in_unit, units.Quantity.write


def pytest_addoption(parser):
    """Add the option ``--scale-lengths``."""
    parser.addoption("--scale-lengths", action="store_true", help="multiply all lengths of scenes by 1 + 1e-12")


def pytest_configure(config):
    """Register the mark ``exact_lengths``."""
    config.addinivalue_line("markers", "exact_lengths: a test of the reading of lengths, without --scale-lengths")
    _scale(config.getoption("--scale-lengths"))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item):
    """Run a test of the reading without the option."""
    is_exact = item.get_closest_marker("exact_lengths") is not None
    _scale(item.config.getoption("--scale-lengths") and not is_exact)
    return (yield)


def _scale(is_scaled):
    """Replace the functions that read and write quantities, or restore them."""
    units.to_internal = _to_internal if is_scaled else TO_INTERNAL
    units.in_unit = _in_unit if is_scaled else IN_UNIT
    units.Quantity.write = _write if is_scaled else WRITE


def _to_internal(value, unit):
    return TO_INTERNAL(value, unit) * (FACTOR if unit == "um" else 1.0)


def _in_unit(value, unit, to_unit):
    units.to_internal = TO_INTERNAL
    try:
        return IN_UNIT(_unscaled(value) if unit == "um" else value, unit, to_unit)
    finally:
        units.to_internal = _to_internal


def _write(quantity, value, unit=""):
    scaled_back = _unscaled(value) if quantity.unit == "um" and not unit else value
    return WRITE(quantity, scaled_back, unit)


def _unscaled(value):
    """The number that is read as a value; the nearest one if there is none."""
    near = value / FACTOR
    candidates = (near, math.nextafter(near, -math.inf), math.nextafter(near, math.inf))
    return next((each for each in candidates if each * FACTOR == value), near)
