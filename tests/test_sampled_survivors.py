"""Behaviour that no other test covers: changes of mutants made by machine that no test had caught."""
import argparse
import dataclasses
import importlib
import pkgutil
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray

import repro
from repro import results, timing
from repro.cli import sweep
from repro.fem import linear, sizing
from repro.fem.mesh import Mesh, triangle_areas
from repro.fem.mesher import unlocked
from repro.fem.outline import BOTTOM, TOP
from repro.march.simulation import simulate, steps
from repro.model.contact_lines import surface_ends
from repro.model.pore import initial_outline
from repro.preflight import numbers, simplifications
from repro.report import charts, fields
from repro.results import field_files, netcdf
from repro.runs import state_arrays
from repro.scene import load_scene
from repro.sweeps import page, table
from repro.sweeps.design import Point, parse
from repro.sweeps.folder import Sweep
from tests import strategies


def test_states_are_immutable():
    """Objects with caches and the definitions of keys are frozen. Objects with arrays, whose comparison has no single
    truth value, are equal only to themselves."""
    names = [module.name for module in pkgutil.walk_packages(repro.__path__, "repro.") if "__main__" not in module.name]
    every = {each for name in names for each in vars(importlib.import_module(name)).values()
             if "__dataclass_params__" in getattr(each, "__dict__", ()) and each.__module__.startswith("repro.")}
    assert {each.__name__ for each in every if not each.__dataclass_params__.frozen} == {"Line", "History"}
    assert len(every) > 50
    compared = [part for each in every if each.__dataclass_params__.eq for part in dataclasses.fields(each)]
    assert not [part for part in compared if "ndarray" in str(part.type)]


def test_a_seed_at_both_walls_is_in_contact_from_the_start():
    scene = load_scene("base", ["aggregate.radius=49.9 um"])
    assert numbers.at_start(scene).contact == 0.0
    assert numbers.at_start(load_scene("base")).contact is None


@pytest.mark.parametrize("half, kind", [("0.02 mg/L", "zero-order front"), ("20 mg/L", "layer of first-order uptake")])
def test_the_warning_of_a_thin_layer_names_its_kind(half, kind):
    """The layer is of zero order if the supply exceeds the half saturation."""
    scene = load_scene("wide", [f'substrates.donor.half_saturation="{half}"', 'kinetics.maximum_density="3000000 mg/L"',
                                "numerics.refinement=0.1"])
    values = numbers.numbers(scene, scene.flow.mean_velocity or 1e4)
    texts = [w.text for w in simplifications.find_warnings(scene, values) if "donor is used up" in w.text]
    assert len(texts) == 1 and f"in a {kind} " in texts[0]


def test_the_default_seed_of_a_hypercube_is_0():
    """The help states this."""
    parser = argparse.ArgumentParser()
    sweep.add(parser.add_subparsers())
    options = parser.parse_args(["sweep", "base", "--vary", "pore.width=1:2 um:log", "--out", "x"])
    assert options.seed == 0


def test_contact_lines_do_not_depend_on_the_first_node():
    """If the numbers of the ring's nodes are shifted, the same positions result."""
    outline = initial_outline(load_scene("base"))
    expected = set(surface_ends(outline, BOTTOM))
    assert {step for _, step in expected} == {-1, 1} and len(expected) == 2
    for shift in range(1, len(outline.wall)):
        parts = {name: np.roll(getattr(outline, name), shift, axis=0) for name in ("points", "wall", "fixed")}
        moved = surface_ends(dataclasses.replace(outline, **parts), BOTTOM)
        assert {((node - shift) % len(outline.wall), step) for node, step in moved} == expected


def test_every_stage_of_a_step_is_timed():
    """These times are the reported cost of a run."""
    timing.reset()
    *_, last = simulate(load_scene("base", ["growth.end=0.2 h", "numerics.refinement=0.5"]))
    assert last.pore.time == 0.2
    assert {"flow", "transport", "growth", "mesh motion", "meshing", linear.FLOOR} <= set(timing.seconds)
    assert min(timing.seconds.values()) > 0


@pytest.mark.parametrize("low, begins", [(1.0, 0.0), (4.9, 0.0), (5.1, 4.0), (9.0, 9.0)])
def test_an_axis_begins_at_zero_if_zero_is_near(low, begins):
    first, last = charts._roomy(low, 10.0)
    assert first == begins and last >= 10.0


def test_words_are_centred_in_equal_parts_of_an_axis():
    factor = parse('numerics.preset="fast", "accurate", "exact"')
    axis = page._across(factor, [])
    ticks = charts.ticks(axis)
    assert [text for _, text in ticks] == ["fast", "accurate", "exact"]
    parts = [(axis(value) - charts.LEFT) / (charts.WIDTH - charts.LEFT - charts.RIGHT) for value, _ in ticks]
    assert parts == pytest.approx([1 / 6, 3 / 6, 5 / 6])


def test_columns_have_a_fill_value_and_time_has_none(tmp_path):
    """CF forbids missing values of coordinates."""
    scene = load_scene("flow_only")
    netcdf.write(tmp_path / "timeseries.nc", scene, [[0.0] * len(results.COLUMNS)])
    with xarray.open_dataset(tmp_path / "timeseries.nc", engine="scipy", decode_cf=False) as dataset:
        filled = {name for name in dataset.variables if "_FillValue" in dataset[name].attrs}
    assert filled == set(results.COLUMNS) - {"time_h"}


def test_a_second_signal_ends_the_process_with_the_signal_s_status():
    """The status is 128 plus the number of the signal, as in shells."""
    code = ("import os, signal, time\nfrom repro.runs.interrupts import DUPLICATE, catch_signals\n"
            "with catch_signals():\n    for _ in range(2):\n        os.kill(os.getpid(), signal.SIGTERM)\n"
            "        time.sleep(DUPLICATE + 0.2)")
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 128 + signal.SIGTERM


def test_fields_of_the_aggregate_alone_are_those_without_values_in_the_fluid(fast):
    """In the file of a run these fields are NaN at every node or triangle of the fluid, except biomass, which is zero.
    """
    grid = field_files.read(fields.index(fast)[-1][1])
    region = grid.cell_data["region"] > 0.5
    outside = np.setdiff1d(np.arange(len(grid.points)), grid.cells[region])
    absent = {name for name, values in grid.point_data.items() if np.isnan(values[outside]).all()}
    absent |= {name for name, values in grid.cell_data.items() if np.isnan(values[~region]).all()}
    shown = set(fields.FIELDS) & {*grid.point_data, *grid.cell_data}
    assert len(absent) > 5 and fields.OF_AGGREGATE & shown == absent & shown | {"active_biomass", "inert_biomass"}


@pytest.mark.parametrize("status, word", [("failed: TransportError: at t = 3 h", "failed"), ("completed", "completed"),
                                          ("not run", "not run")])
def test_the_table_of_a_sweep_has_the_status_of_a_run(status, word):
    """The table has one word; the reason is in the run's folder."""
    point = Point(1, ("40 um",), load_scene("flow_only"))
    empty = table.SweepRun(point, status, *[np.zeros(0)] * 3, dict.fromkeys(table.COLUMNS))
    row = page._row(Sweep(Path("s"), "base", (parse("pore.width=40 um, 50 um"),), (point,)), empty)
    assert re.search(r'<td class="text[ a-z]*">([^<]*)</td></tr>$', row)[1] == word


def test_a_pore_without_an_aggregate_is_packed_and_unpacked():
    scene = load_scene("flow_only", unset=["aggregate"])
    state, _ = next(steps(scene))
    assert scene.aggregate is None and state.pore.outline is None
    restored = state_arrays.unpack_state(scene, *state_arrays.pack_state(scene, state))
    assert np.array_equal(restored.pore.mesh.points, state.pore.mesh.points)


@pytest.mark.parametrize("biomass", [False, True])
@pytest.mark.parametrize("first", [0, 1, 2])
def test_cornered_triangles_are_freed_in_either_region_for_any_first_node(biomass, first):
    """Two of the four corners of a square belong to one triangle only."""
    points = np.array([[x, y] for y in range(3) for x in range(3)], float)
    corner = np.array([0, 1, 3, 4])[:, None]
    triangles = np.roll(np.vstack([corner + [0, 1, 4], corner + [0, 4, 3]]), first, axis=1)
    grid = Mesh.of(points, triangles, np.full(8, biomass), np.empty(0, int), 2.0, (0.0, 2.0))
    assert strategies.boundary_edge_counts(grid.triangles) == [0, 0, 1, 1, 1, 1, 2, 2]
    freed = unlocked(grid)
    assert strategies.boundary_edge_counts(freed.triangles) == [1] * 8
    assert triangle_areas(points, freed.triangles) == pytest.approx(np.full(8, 0.5))


def test_elements_are_small_beside_the_upper_wall_s_contact_lines_alone():
    """They grow with the distance from the contact lines."""
    plug_outline = strategies.plug(50.0, -20.0, 15.0, 3.0)
    sizes = sizing.interface_sizes(plug_outline, sizing.Sizing(50.0, 1.0, 1.0, contact=0.1))
    lower, upper = plug_outline.wall == BOTTOM, plug_outline.wall == TOP
    ends = np.array([15.0 + 3.0, -20.0 + 3.0])
    distance = np.abs(plug_outline.points[upper, :1] - ends).min(axis=1)
    assert sizes[upper] == pytest.approx(np.minimum(50.0 / 14, 0.1 + sizing.GRADATION * distance))
    assert sizes[upper].min() == 0.1 and (sizes[lower] == 50.0 / 14).all()
