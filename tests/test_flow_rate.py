"""Flow rates with the depth of a pore: mean velocity, tables over time, totals, refusals, sweeps."""

import tomllib
from dataclasses import replace

import pytest

import repro
from repro.preflight.modelled import describe_model
from repro.scene import scene_hash
from tests.test_derived import integrate_over_end

#: 50 um x 20 um x 3 m/day = 3e9 um3/day = 3 uL/day.
RATE = {"flow.rate": "3 uL/day", "pore.depth": "20 um"}
SHORT = {"numerics.preset": "fast", "growth.end": "0.2 h", "output.every": "0.1 h"}


def driven(changes, **more):
    return repro.load_scene("base", {**changes, **more}, unset=["flow.head"])


def test_a_rate_is_a_mean_velocity_over_width_and_depth():
    scene = driven(RATE)
    assert scene.flow.mean_velocity == pytest.approx(3e6 / 24, rel=1e-14)
    assert driven({**RATE, "pore.upper_wall": "symmetry"}).flow.mean_velocity == pytest.approx(1.5e6 / 24, rel=1e-14)
    assert driven({**RATE, "pore.width": "25 um"}).flow.mean_velocity == pytest.approx(6e6 / 24, rel=1e-14)
    assert dict(describe_model(scene))["flow"].count("through a depth of 20 um") == 1


@pytest.mark.parametrize("between", ["steps", "linear"])
def test_a_table_of_rates_is_one_of_velocities(between):
    table = [["0 h", "3 uL/day"], ["2 h", "6 uL/day"]]
    rate = {"table": table, "between": between} if between == "linear" else table
    scene = driven({**RATE, "flow.rate": rate})
    values = [scene.at(time).flow.mean_velocity * 24 / 1e6 for time in (0, 1, 2, 3)]
    assert values == pytest.approx([3, 4.5 if between == "linear" else 3, 6, 6])
    assert scene.time_tables.jumps(2.0) == (between == "steps")


def test_a_scene_with_a_rate_is_written_and_read_unchanged():
    """Its text has the rate; later changes of width, depth and drive apply."""
    scene = driven(RATE)
    text = str(scene)
    assert 'rate = "3 uL/day"' in text and 'depth = "20 um"' in text and "mean_velocity" not in text
    assert replace(repro.load_scene(tomllib.loads(text)), name="base") == scene
    assert repro.load_scene(scene, {"pore.depth": "40 um"}).flow.mean_velocity == scene.flow.mean_velocity / 2
    other = repro.load_scene(scene, {"flow.mean_velocity": "3 m/day"}, unset=["flow.rate"])
    assert other.flow.rate is None and scene_hash(other) != scene_hash(scene)
    assert scene_hash(repro.load_scene("base")) != scene_hash(repro.load_scene("base", {"pore.depth": "1 um"}))


@pytest.mark.parametrize("changes, unset, message", [
    (RATE, [], r"flow.rate = .*: flow.head \(10 um\) is set too; only one of them"),
    ({**RATE, "flow.mean_velocity": "1 m/day"}, ["flow.head"], r"flow.mean_velocity \(1 m/day\) is set too; only one"),
    ({"flow.rate": "3 uL/day"}, ["flow.head"], "flow.rate = .*: pore.depth is needed with it"),
    ({"pore.depth": "20 um"}, ["flow.head"], "flow.head is missing: it, flow.mean_velocity or flow.rate is needed"),
    ({**RATE, "flow.rate": "0 uL/day"}, ["flow.head"], "flow.rate = .*: greater than zero is needed, or numerics.tran"),
    ({**RATE, "flow.rate": "3 m/day"}, ["flow.head"], 'a flow rate is needed, such as "0.1 uL/min"'),
    ({**RATE, "pore.depth": "0 um"}, ["flow.head"], "pore.depth = .*: a length is needed")])
def test_one_drive_is_needed_and_a_rate_needs_a_depth(changes, unset, message):
    with pytest.raises(repro.SceneError, match=message):
        repro.load_scene("base", changes, unset=unset)


def test_a_run_by_its_rate_is_that_by_its_velocity_with_totals():
    """Per depth, all columns are equal. Totals are those times the depth; the flow rate is the given one."""
    run = repro.solve(driven({**RATE, **SHORT}))
    plane = repro.solve(driven({"flow.mean_velocity": "3 m/day", **SHORT}))
    totals = set(run) - set(plane)
    assert totals == {"flow_rate_uL_per_min", "aggregate_volume_um3", "acceptor_uptake_pg_per_h",
                      "donor_uptake_pg_per_h", "biomass_growth_pg_per_h"}
    assert all(run[name] == pytest.approx(plane[name], rel=1e-9, abs=1e-9) for name in plane)
    assert run["flow_rate_uL_per_min"] == pytest.approx(3 / 1440, rel=1e-9)
    assert run["aggregate_volume_um3"] == pytest.approx(20 * plane["aggregate_area_um2"])
    for name in ("acceptor_uptake", "donor_uptake", "biomass_growth"):
        per_depth = plane[f"{name}_ug_per_m_per_h"]  # 1 ug/m is 1e6 pg in 1 m, and 20 pg in 20 um
        assert run[f"{name}_pg_per_h"] == pytest.approx(20 * per_depth)


def test_the_flow_rate_is_the_integral_over_the_outlet():
    """Of the whole pore, also where the upper wall is its middle."""
    scene = driven({**RATE, "pore.upper_wall": "symmetry", "growth.end": "0 h"})
    (report,) = repro.simulate(scene)
    half = integrate_over_end(report.pore.space, report.pore.mesh.ends[1], report.solved.flow.velocity[:, 0])
    assert repro.solve(scene)["flow_rate_uL_per_min"] == pytest.approx(2 * half * 20 * 1e-9 / 60, rel=1e-6)


def test_forces_of_the_fluid_are_totals_too():
    run = repro.solve(driven({**RATE, "growth.fluid_forces": "included", "growth.end": "0 h"}))
    for axis in "xy":
        per_depth = run[f"fluid_force_{axis}_uN_per_m"]  # 1 uN/m is 0.02 nN in 20 um
        assert run[f"fluid_force_{axis}_nN"] == pytest.approx(0.02 * per_depth)
