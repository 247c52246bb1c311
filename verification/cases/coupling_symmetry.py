"""Whole runs below a plane of symmetry, against runs of the pore with its mirror image.

The aggregate is a column from the wall to the plane. With its mirror image it is a column from wall to wall of a pore
of twice the width: one body, whose middle is inside it, without a plane, a contact or a fixed point there. Growth
bends the free surface, which stays at right angles to the plane by symmetry. No other pair of scenes has this: two
bodies that do not touch each other need a pore with two aggregates.
"""
from functools import cache

import pytest

from repro import load_scene, solve
from repro.results.tables import Results
from verification.evidence.cases import parametrize
from verification.evidence.checks import each_at_most
from verification.problems.runs import with_preset

WIDTH, HALF, HOURS = 50.0, 20.0, (2.0, 4.0)
#: Presets and the largest relative difference: the errors that they promise until contact, and 1 % for the paper's.
PRESETS = {"paper": ("paper", 1e-2), "fast": ("fast", 1e-2), "accurate": ("accurate", 1e-3)}
#: Columns that are the same in both pores, and the one that is twice as large with the mirror image.
SAME = ("conductivity_m_per_d", "upstream_um", "downstream_um", "effluent_acceptor_mg_per_L",
        "effluent_donor_mg_per_L", "acceptor_min_mg_per_L")
TWICE = "aggregate_area_um2"


@pytest.mark.case(
    "coupling-symmetry", kind="property", runs_with="1 2", omitted="exact: accurate has its elements and its steps",
    mutants=("plane-is-a-wall", "plane-keeps-a-point", "inlet-without-the-mirror-image",
             "unmeshed-without-the-mirror-image"))
@parametrize("preset, bound", PRESETS, slow=("paper",))
def test_symmetry(preset, bound, record):
    """A column below a plane of symmetry grows, clogs its pore and takes up substrates as it does with its mirror
    image in a pore of twice the width.

    Norm: largest relative difference of columns at 2 and 4 h.
    """
    half, whole = below_the_plane(preset), with_mirror_image(preset)
    errors = {name: _difference(half[name], whole[name]) for name in SAME}
    errors[TWICE] = _difference(2 * half[TWICE], whole[TWICE])
    record(each_at_most(errors, bound, "the error that the preset promises"))


def _difference(one, other) -> float:
    return float(abs(one / other - 1).max())


@cache
def below_the_plane(preset: str) -> Results:
    """The run below the plane."""
    return _solved(preset, WIDTH, 'pore.upper_wall="symmetry"')


@cache
def with_mirror_image(preset: str) -> Results:
    """The run of the whole pore."""
    return _solved(preset, 2 * WIDTH)


def _solved(preset: str, width: float, *changes: str) -> Results:
    points = [(-HALF, 0), (-HALF, width), (HALF, width), (HALF, 0)]
    outline = ", ".join(f'["{x} um", "{y} um"]' for x, y in points)
    return solve(load_scene("base", [
        with_preset(preset), f"aggregate.outline=[{outline}]", f'pore.width="{width} um"',
        'flow.mean_velocity="2.9 m/day"', f'growth.end="{HOURS[-1]} h"',
        f"output.times={[f'{hour} h' for hour in HOURS]}", *changes],
        unset=["aggregate.radius", "flow.head"]))
