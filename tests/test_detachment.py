"""Stresses that walls and biomass bear, in a scene without strengths.

`test_ends.py` tests the ends of runs by a strength, `test_derived.py` these stresses, and `test_longer.py` a run with a
bonded wall that is made longer.
"""
import json

import numpy as np
import pytest

import repro
from repro.errors import GrowthError, SimulationError
from repro.fem import elements
from repro.model import adhesion, contact, remeshing
from repro.model.finer_lines import with_finer_lines
from repro.model.mechanics import Mechanics, equilibrium
from repro.model.meshing import seeded
from repro.model.remeshing import Remeshing
from repro.runs.execution import run
from repro.scene import load_scene
from tests.strategies import coarse_base


def test_stresses_are_those_of_the_equilibrium_on_a_new_mesh(monkeypatch):
    """A shape that has grown on a bonded wall is carried to a mesh with smaller elements. Its nodal forces inside are
    not zero there; those of the equilibrium are, to the defect of Newton's method. It has the reported stresses."""
    changes = ["numerics.preset=fast", "growth.wall=bonded", "growth.bonding_strength=1 GPa"]
    scene, finer = (load_scene("base", [*changes, f"numerics.refinement={size}"]) for size in (0.2, 0.5))
    seed = seeded(scene)
    grown = contact.expand(Mechanics.of(scene), seed, [1.2 * seed.body.theta]).pore
    pore, _ = remeshing.remesh(Remeshing.of(finer), seed, grown, 0.0)
    loading = adhesion.Loading.of(scene)
    rest, _ = adhesion.at_rest(loading, pore, None)
    reported = [peak(loading, pore, None).value for peak in (adhesion.wall_peak, adhesion.tensile_peak)]

    def defect(of):
        forces = adhesion.wall_forces(loading, of, None)
        inside = of.mesh.points[of.mesh.body, 1] > 0
        return np.abs(forces[inside]).max() / np.abs(forces).max()

    assert defect(pore) > 1e-3 and defect(rest) < 1e-8
    monkeypatch.setattr(adhesion, "at_rest", lambda loading, pore, solved: (pore, solved))
    for computed, peaks in zip(reported, (adhesion.wall_peaks, adhesion.tensile_peaks)):
        peaks.cache_clear()
        assert computed == pytest.approx(peaks(loading, rest, None)[0].value, rel=1e-12)


def test_stresses_without_an_equilibrium_end_a_run_with_its_time(tmp_path, monkeypatch):
    """The equilibrium of a row's stresses may fail where that of the run does not."""
    def none(*arguments, **options):
        raise GrowthError("there is no equilibrium")

    monkeypatch.setattr(adhesion, "equilibrium", none)
    with pytest.raises(SimulationError, match="t = 0 h, in growth: there is no equilibrium"):
        run(load_scene("base", ["numerics.preset=fast", "growth.bonding_strength=1 GPa"]), tmp_path / "run")
    assert json.loads((tmp_path / "run" / "run.json").read_text())["status"].startswith("failed: ")


@pytest.mark.parametrize("failing, starts", [(1, ("pore", "pore", "rest")), (2, ("pore", "pore", "pore"))])
def test_stresses_start_from_the_equilibrium_without_forces_if_newton_fails(monkeypatch, failing, starts):
    """The first attempt under the forces of the water fails, or that and the equilibrium without them."""
    soft = ("numerics.preset=fast", "growth.fluid_forces=included", "growth.shear_modulus=1e-3 MPa")
    scene = load_scene("base", soft)
    report = next(repro.simulate(scene))
    loading = adhesion.Loading.of(scene)
    expected = adhesion.wall_peak(loading, report.pore, report.solved).value
    calls = []

    def counted(mechanics, grown, start, forces, patient=True):
        calls.append(("pore" if start is grown else "rest", forces is not None, patient))
        if len(calls) <= failing:
            raise GrowthError("stands")
        return equilibrium(mechanics, grown, start, forces, patient=patient)

    monkeypatch.setattr(adhesion, "equilibrium", counted)
    for cached in (adhesion.at_rest, adhesion.wall_peaks):
        cached.cache_clear()
    assert adhesion.wall_peak(loading, report.pore, report.solved).value == pytest.approx(expected, rel=1e-8)
    assert calls == list(zip(starts, (True, False, True), (False, False, True)))


def test_theta_of_parts_stays_positive_and_keeps_its_sum():
    """A new mesh leaves theta rough beside the edge of a bonded wall. The linear function that fits it in a triangle
    may be negative, and no equilibrium exists then."""
    _, pore = coarse_base(2)
    fitted = elements.linear_fit(pore.body.solid.shape.table)
    theta = np.where(fitted[0] < 0, 40.0, 1.0) * np.ones_like(pore.body.theta)
    assert (theta @ fitted.T).min() < 0
    corner = pore.mesh.points[pore.region.loop[:1]]
    fine, _ = with_finer_lines(pore.with_body(theta=theta), corner, 0.4, 0.25)
    parts = fine.body.theta
    assert 0.1 < parts.min() and parts.max() < 400 and np.ptp(parts) > 10.0
    assert np.sum(parts * fine.body.solid.at.dx) == pytest.approx(np.sum(theta * pore.body.solid.at.dx), rel=1e-12)


def test_a_new_mesh_interpolates_theta_where_strain_is_singular():
    """Beside the edge of a bonded wall J on a new mesh leaves the range of theta by more than a tenth. The new theta
    stays within a hundredth of it, and its sum is the area."""
    scene, finer = (load_scene("base", ["numerics.preset=fast", "growth.wall=bonded", f"numerics.refinement={size}"])
                    for size in (0.2, 0.5))
    seed = seeded(scene)
    theta = 3.0 + 0.1 * np.linspace(-1.0, 1.0, len(seed.body.theta))[:, None] * np.ones_like(seed.body.theta)
    grown = contact.expand(Mechanics.of(scene), seed, [theta]).pore
    grown = grown.with_masses(theta * seed.active, theta * seed.inert)
    pore, _ = remeshing.remesh(Remeshing.of(finer), seed, grown, 0.0)
    solid = pore.body.solid
    J = solid.strained(pore.mesh.points[pore.region.nodes]).J
    assert J.min() < 2.6 or J.max() > 3.4
    assert 2.88 < pore.body.theta.min() and pore.body.theta.max() < 3.12
    assert np.sum(pore.body.theta * solid.at.dx) == pytest.approx(pore.space.reaction.dx.sum(), rel=1e-12)
    assert pore.mass == pytest.approx(grown.mass, rel=1e-3)
