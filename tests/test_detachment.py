"""Stresses that walls and biomass bear, in a scene without strengths.

`test_ends.py` tests the ends of runs by a strength, `test_derived.py` these stresses, and `test_longer.py` a run with a
bonded wall that is made longer.
"""
import numpy as np
import pytest

from repro import results
from repro.march.state import Report
from repro.model import adhesion, contact, remeshing
from repro.model.mechanics import Mechanics
from repro.model.meshing import seeded
from repro.model.remeshing import Remeshing
from repro.model.solving import solve
from repro.scene import load_scene
from tests.strategies import coarse_base


def test_stresses_are_those_of_the_equilibrium_on_a_new_mesh():
    """A shape that has grown on a bonded wall is carried to a mesh with smaller elements. Its nodal forces inside are
    not zero there; those of the equilibrium are, to the defect of Newton's method. It has the reported stresses."""
    changes = ["numerics.preset=fast", "growth.wall=bonded", "growth.bonding_strength=1 GPa"]
    scene, finer = (load_scene("base", [*changes, f"numerics.refinement={size}"]) for size in (0.2, 0.5))
    seed = seeded(scene)
    grown = contact.expand(Mechanics.of(scene), seed, [1.2 * seed.body.theta]).pore
    pore, _ = remeshing.remesh(Remeshing.of(finer), seed, grown, 0.0)
    loading = adhesion.Loading.of(scene)
    rest = adhesion.at_rest(loading, pore, None)
    inside = pore.mesh.points[pore.mesh.body, 1] > 0

    def defect(of):
        forces = adhesion.wall_forces(loading, of, None)
        return np.abs(forces[inside]).max() / np.abs(forces).max()

    assert defect(pore) > 1e-3 and defect(rest) < 1e-8
    for peak in (adhesion.wall_peak, adhesion.tensile_peak):
        assert peak(loading, pore, None).value == pytest.approx(peak(loading, rest, None).value, rel=1e-6)


def test_stresses_on_walls_are_computed_only_for_a_scene_with_a_strength(monkeypatch):
    for name in ("wall_peak", "tensile_peak", "fluid_loads"):
        monkeypatch.setattr(adhesion, name, lambda *_: pytest.fail("a stress was computed"))
    scene, pore = coarse_base(1)
    row = results.row(scene, Report(pore, solve(scene, pore), None, (), 0, {}))
    assert row["wall_traction_max_MPa"] is None and row["fluid_force_x_uN_per_m"] is None
