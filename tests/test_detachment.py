"""Stresses that walls and biomass bear, in a scene without strengths.

`test_ends.py` tests the ends of runs by a strength, `test_derived.py` these stresses, and `test_longer.py` a run with a
bonded wall that is made longer.
"""
import pytest

from repro import results
from repro.march.state import Report
from repro.model import adhesion
from repro.model.solving import solve
from tests.strategies import coarse_base


def test_stresses_on_walls_are_computed_only_for_a_scene_with_a_strength(monkeypatch):
    for name in ("wall_peak", "tensile_peak", "fluid_load"):
        monkeypatch.setattr(adhesion, name, lambda *_: pytest.fail("a stress was computed"))
    scene, pore = coarse_base(1)
    row = results.row(scene, Report(pore, solve(scene, pore), None, (), 0, {}))
    assert row["wall_traction_max_MPa"] is None and row["fluid_force_x_uN_per_m"] is None
