"""With stress-free biomass nothing but some fields depends on positions at t = 0: a run goes on where they fold."""

import numpy as np
import pytest

import repro
from repro import results
from repro.errors import OriginFolded
from repro.fem import transfer
from repro.march import simulation
from repro.results.arrays import fields
from repro.runs.state_arrays import pack_state, unpack_state
from repro.scene import load_scene
from tests.shell import read_record

#: Contact lines rest within a clearance of 5e-4 of the film. A new mesh without the positions at t = 0 differs in its
#: last bits, and so the lines rest elsewhere within it: the mean velocity then differed by 4.5e-6.
AT_REST = 1e-4
#: A film that closes, so that both presets generate a mesh.
SCENE = ('aggregate.radius="17.8 um"', 'pore.width="20 um"', 'flow.head="1 mm"', 'growth.end="0.3 h"',
         'output.times=["0.3 h"]')
SINCE_START = {"displacement_um", "position_t0_um", "theta", "J"}
PRESETS = pytest.mark.parametrize("preset", ["fast", "paper"])


@pytest.fixture
def folded(monkeypatch):
    """Positions at t = 0 fold on every new mesh."""
    def fold(mesh, origin, region):
        raise OriginFolded("the places at t = 0 fold")

    def apply():
        monkeypatch.setattr(transfer, "unfolded", fold)

    return apply


def scene(preset, born="stress_free"):
    return load_scene("base", [*SCENE, f"numerics.preset={preset}", f"growth.new_biomass={born}"])


@PRESETS
def test_nothing_but_fields_depends_on_positions_at_the_start(preset, folded):
    """All columns are those of a run whose positions do not fold, as close as contact lines rest. Later fields are
    complete without the four that count from t = 0."""
    stress_free = scene(preset)
    expected = [results.row(stress_free, report) for report in repro.simulate(stress_free)]
    folded()
    states = [(state, report) for state, report in simulation.steps(stress_free) if report]
    for (_, report), row in zip(states, expected):
        columns = results.row(stress_free, report)
        compared = [name for name in row if row[name] is not None]
        for name in (name for name in compared if not name.endswith(("_balance", "_x_um", "_y_um"))):
            assert columns[name] == pytest.approx(row[name], rel=AT_REST, abs=1e-9), name
    (_, first), *_, (last, end) = states
    assert first.pore.body.origin_known and not end.pore.body.origin_known
    before, after = (fields(stress_free, report.pore, report.solved) for report in (first, end))
    names = [set(grid.point_data) | set(grid.cell_data) for grid in (before, after)]
    assert names[0] - names[1] == SINCE_START and names[1] < names[0]
    nodal = [value for name, value in after.point_data.items() if name != "surface_stretch"]
    assert all(np.isfinite(value).all() for value in nodal)
    assert not unpack_state(stress_free, *pack_state(stress_free, last)).pore.body.origin_known


@pytest.mark.parametrize("preset", [pytest.param("fast", marks=pytest.mark.thorough), "paper"])
def test_strain_that_counts_from_the_start_needs_its_positions(preset, folded):
    folded()
    with pytest.raises(repro.SimulationError, match="the places at t = 0 fold"):
        list(repro.simulate(scene(preset, "stressed")))


def test_the_record_says_from_when_on_fields_are_left_out(folded, tmp_path):
    folded()
    repro.run(scene("paper"), tmp_path / "run")
    texts = [each["text"] for each in read_record(tmp_path / "run")["warnings"] if each["key"] == "position_t0_um"]
    assert len(texts) == 1 and "from t = " in texts[0] and (tmp_path / "run" / "report.html").exists()
    run = repro.load_run(tmp_path / "run")
    with pytest.raises(KeyError, match="displacement: this run has no such column or field"):
        run.plot("displacement")
    assert "displacement_um" in run.fields(0.0)
