"""Results that wrong changes could alter unnoticed, derived anew for each side, substrate, axis and row."""
import io
import re
from contextlib import nullcontext
from dataclasses import replace
from itertools import product
from pathlib import Path
from xml.etree import ElementTree

import matplotlib.pyplot as plt
import numpy as np
import pytest
import tqdm
from scipy.spatial import Delaunay
from tqdm import tqdm as Bar

import repro
from repro import results, timing
from repro.errors import TransportError, Unresolved
from repro.fem.outline import FREE, half_disc
from repro.fem.sizing import Sizing, split
from repro.march import midpoint, simulation, stepping, updates
from repro.march.balance import Ledger
from repro.march.loop import Report
from repro.march.step_control import EXCESS, StepControl, exceeds_tolerance
from repro.model import biomass, contact, gear, mesh_motion, remeshing, transport
from repro.model.pore import Meshing, Solved, resolution, seeded, solve
from repro.model.remeshing import Remeshing
from repro.model.stages import Stages
from repro.preflight import modelled, numbers, simplifications
from repro.report import comparison, quantities, run_page
from repro.report.reading import Run
from repro.results import field_files, picture
from repro.results.tables import Results
from repro.runs import execution, progress
from repro.scene import load_scene
from repro.sweeps import driver, page, table
from repro.sweeps.design import grid, parse, points
from repro.sweeps.folder import Sweep
from tests import oracles
from tests.shell import read_record, rows
from tests.strategies import ORDERS, rate_constants
from tests.test_derived import EVERY_ORDER, arcs, integrate_over_end, node_coordinates
from tests.test_gear import case, storage

NOTHING = Solved(None, None, None)
UNLIKE_OF = {"acceptor": "donor", "donor": "acceptor"}
EVEN = Ledger(0.0, 1.0, (5.0, 3.0), (1.0, 1.5), (4.0, 1.5), (0.0, 0.0), 70.0, 10.0, 80.0)
UNLIKE = ['substrates.acceptor.supply="9 mg/L"', 'substrates.donor.supply="4 mg/L"', "numerics.refinement=0.3"]


def base(order, *changes, unset=()):
    """(scene, its seed) with coarse elements of an order, and supplies that differ."""
    scene = load_scene("base", [*UNLIKE, f"numerics.elements={ORDERS[order]}", *changes], unset)
    return scene, seeded(scene)


def row_of(scene, pore, solved=NOTHING, ledgers=(), remeshes=0):
    return results.row(scene, Report(pore, solved, None, ledgers, remeshes, {}))


@EVERY_ORDER
def test_ends_and_top_are_those_of_the_boundary_between_its_nodes(order):
    """The seed is swollen and leans, and its arcs are sampled to 1e-6. The nodes alone are off by 4e-4 um or more."""
    scene, pore = base(order, "numerics.refinement=0.5")
    x, y = pore.mesh.points.T
    near = np.exp(-(x**2 + y**2) / 100)
    pore = pore.moved(np.column_stack([x + (0.2 * x * y + 0.1 * y) * near, y * (1 + 0.05 * x * near)]))
    row = row_of(scene, pore)
    ends = [row[name] for name in ("upstream_um", "downstream_um", "thickness_um")]
    outlines = arcs(pore), pore.mesh.points[pore.mesh.loop]
    expected, nodal = ([*points.min(0)[:1], *points.max(0)] for points in outlines)
    difference = np.abs(np.subtract(ends, nodal))
    assert ends == pytest.approx(expected, rel=1e-6)
    assert difference.min() > 2e-4 if order > 1 else difference.max() == 0


def test_a_row_states_whether_any_of_its_steps_made_a_mesh():
    scene, pore = base(1)
    assert [row_of(scene, pore, remeshes=count)["remeshed"] for count in (0, 1, 2, 7)] == [0, 1, 1, 1]


def test_biomass_is_reported_for_a_scene_without_growth():
    scene = load_scene("initial_mesh", ["substrates={}", "aggregate.inert_fraction=0.3"])
    row = row_of(scene, seeded(scene))
    computed = [row[name] for name in ("inert_fraction", "biomass_density_min", "biomass_density_max")]
    assert computed == pytest.approx([0.3, 1.0, 1.0], rel=1e-12) and row["biomass_balance"] is None


@pytest.mark.parametrize("k, name", [(0, "acceptor"), (1, "donor")])
def test_each_substrates_defect_is_over_its_own_terms(k, name):
    """Without a step it is over the row's fluxes, with Gear over the content of the meshed part at the supply."""
    scene, pore = base(1)
    gear, solved = base(1, "numerics.transport=gear")[0], solve(scene, pore)
    fluxes = [transport.Fluxes(5e3, 1e3, 4e3, 9.0, 8.0), transport.Fluxes(3e3, 1.5e3, 1.5e3, 4.0, 3.0)]
    fluxes[k] = replace(fluxes[k], out=fluxes[k].out - 60)
    unit = np.eye(2)[k]
    supplied_content = getattr(scene.substrates, name).supply * np.ptp(pore.mesh.ends) * scene.pore.width
    ledger = replace(EVEN, stored=tuple(-7.0 * unit))
    for row, expected in ((row_of(scene, pore, replace(solved, fluxes=tuple(fluxes))), 60 / fluxes[k].supplied),
                          (row_of(gear, pore, solved, (ledger,)), 7.0 / supplied_content)):
        balances = [row["acceptor_balance"], row["donor_balance"]]
        assert balances == pytest.approx(expected * unit, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("k, name", [(0, "acceptor"), (1, "donor")])
def test_an_overshoot_is_over_each_substrates_own_supply(k, name):
    """It is over the present supply, with Gear over the largest of its table. It is zero below the supply, and defined
    for a supply of zero."""
    table = f'substrates.{name}.supply=[["0 h", "5 mg/L"], ["1 h", "9 mg/L"], ["2 h", "0 mg/L"]]'
    both = [base(1, table, *more)[0] for more in ((), ("numerics.transport=gear",))]
    pore = replace(seeded(both[0]), time=2.0)
    solved = solve(both[0], pore)
    for largest, overshoots in ((0.25, (0.25, 0.0)), (9.5, (9.5, 0.5)), (-1e-6, (0.0, 0.0))):
        fields = [np.full(pore.space.count, -1e-3), np.full(pore.space.count, -1e-3)]
        fields[k][7] = largest
        changed = replace(solved, concentrations=transport.Concentrations(*fields))
        rows_of = [row_of(scene, pore, changed) for scene in both]
        assert [row[f"{name}_overshoot_mg_per_L"] for row in rows_of] == pytest.approx(overshoots)
        assert {row[f"{UNLIKE_OF[name]}_overshoot_mg_per_L"] for row in rows_of} == {0.0}


@EVERY_ORDER
def test_stress_is_reported_only_for_strain_since_the_start(order):
    kinds = ("stressed", "stress_free")
    grids = [results.fields(*base(order, f"growth.new_biomass={kind}"), NOTHING) for kind in kinds]
    stressed, free = ({*grid.point_data, *grid.cell_data} for grid in grids)
    assert len(stressed - free) == 6 and free == {name for name in stressed if not name.endswith("_MPa")}


def test_times_of_fields_keep_every_digit(tmp_path):
    scene, pore = base(1)
    results.write_index(tmp_path / "fields.pvd", [(100 / 3, "b.vtu")])
    field_files.write(tmp_path / "b.vtu", results.fields(scene, replace(pore, time=100 / 3), NOTHING))
    index, fields_file = (ElementTree.parse(tmp_path / name) for name in ("fields.pvd", "b.vtu"))
    times = index.find(".//DataSet").get("timestep"), fields_file.findtext(".//FieldData/DataArray")
    assert [*map(float, times)] == [100 / 3, 100 / 3]


def test_a_picture_has_upstream_on_the_left_and_the_upper_wall_above():
    """A field that rises along x and y: dark below upstream, light above downstream."""
    coordinates = np.array(list(product(np.linspace(-10, 30, 9), np.linspace(0, 20, 5))))
    cells = Delaunay(coordinates).simplices
    drawing = {"places_um": coordinates, "triangles": cells, "region": np.zeros(len(cells), bool)}
    pixels = plt.imread(io.BytesIO(picture.png(drawing, coordinates @ [1, 3])))[..., :3]
    assert (np.diff(pixels[[-1, -1, 0, 0], [0, -1, 0, -1]].sum(axis=1)) > 0).all()


def test_key_figures_have_first_and_last_values_and_the_first_contact():
    columns = np.array([[0.0, 1.5, 2.5, 7.0], [5.0, 19.0, 20.0, 21.0], [0, 0, 1, 1]])
    figures = picture.key_figures(dict(zip(("time_h", "thickness_um", "contact"), columns)))
    assert "thickness of the aggregate 5 → 21 um" in figures and "wall from t = 2.5 h on" in figures


@EVERY_ORDER
def test_without_flow_the_ends_are_means_over_their_height(order):
    """The fields are not linear, and differ at inlet and outlet. Gauss's rule integrates along each end."""
    scene, pore = base(order, "numerics.transport=gear", "substrates.boundary=closed", unset=["flow"])
    x, y = node_coordinates(pore.space).T
    fields = [2 + np.sin(y / 7) + 0.01 * x, 5 + np.cos(y / 9) - 0.02 * x]
    problem = transport.problem(pore.space, None, scene.substrates, scene.kinetics)
    all_fluxes = transport.fluxes(problem, None, transport.Concentrations(*fields))
    for flux, field in zip(all_fluxes, fields):
        means = [integrate_over_end(pore.space, end, field) / scene.pore.width for end in pore.mesh.ends]
        assert [flux.inlet, flux.effluent] == pytest.approx(means, rel=1e-9) and abs(means[0] - means[1]) > 0.5


@EVERY_ORDER
def test_the_inlet_is_weighted_with_the_flow_for_any_inlet_condition(order):
    scene, pore = base(order)
    flow = solve(scene, pore).flow
    local, mean = (transport.problem(pore.space, flow, scene.substrates, scene.kinetics, inlet).inflow
                   for inlet in ("local", "mean"))
    assert np.array_equal(mean, local) and mean.sum() == pytest.approx(flow.mean_velocity * scene.pore.width)


@EVERY_ORDER
def test_a_concentration_may_leave_its_bounds_by_the_documented_part(order):
    """It may fall below zero by a thousandth of its supply and, with curved elements, exceed it by a fiftieth."""
    scene, pore = base(order)
    problem = transport.problem(pore.space, None, scene.substrates, scene.kinetics)
    for k, (part, accepted) in product((0, 1), ((-9e-4, True), (-1.1e-3, False), (1.019, True), (1.021, order == 1))):
        state = problem.supply
        state[k * problem.space.count + 7] *= part
        with nullcontext() if accepted else pytest.raises(Unresolved, match=("acceptor", "donor")[k]):
            transport._checked(problem, state, 1)


def test_a_loaded_run_has_its_status(tmp_path):
    execution.Recorder(load_scene("flow_only"), tmp_path).write_record("failed: out of memory")
    results.write_table(tmp_path / "timeseries.csv", results.COLUMNS, [[0.0] * len(results.COLUMNS)])
    assert repro.load_run(tmp_path).status == "failed: out of memory"


def test_a_step_ends_at_a_jump_to_the_last_bit():
    """For any start the new value applies after the step. A step shorter by a microhour ends earlier."""
    _, pore = base(1)
    for start, k, factor in product((0.1, 0.7, 2.3, 19.1), range(1, 50), (1 - 4e-16, 1.0, 1 + 4e-16)):
        length, shorter = k / 7 * factor, k / 7 * factor - 1e-6
        assert stepping._end_of(replace(pore, time=start), length, start + k / 7) == start + k / 7
        assert stepping._end_of(replace(pore, time=start), shorter, start + k / 7) == start + shorter


def uneven(order):
    """(scene, pore, its solution) with masses that differ from X_m from point to point."""
    scene, pore = base(order)
    part = np.random.default_rng(order).uniform(0.7, 1.2, pore.active.shape)
    pore = replace(pore, active=0.6 * part * pore.active, inert=0.3 * pore.active, theta=1.5 * pore.theta)
    return scene, pore, solve(scene, pore)


@EVERY_ORDER
def test_an_update_takes_the_mean_of_the_rates_at_its_ends(order):
    """Active and inert biomass follow (9) and (10), as printed, at the concentrations of both ends, to round-off."""
    scene, pore, solved = uneven(order)
    after, end, _ = updates.make_biomass(Stages.of(scene), pore, solved, 2.0)
    pieces, rates = pore.space.reaction, []
    for state in (solved.concentrations, end):
        both = (field[pieces.cells] @ pieces.values.T for field in (state.acceptor, state.donor))
        rates.append(np.array(oracles.rates(*both, **rate_constants(scene))[2:]))
    growth, remains = np.mean(rates, axis=0)
    assert np.abs(rates[0] / rates[1] - 1).max(axis=(1, 2)).min() > 1e-4, "else the start would suffice"
    assert after.active == pytest.approx(pore.active * np.exp(2 * growth), rel=1e-12)
    new_inert = pore.active * np.expm1(2 * growth) / growth * remains
    assert after.inert - pore.inert == pytest.approx(new_inert, rel=1e-9)


@EVERY_ORDER
@pytest.mark.parametrize("speed", [0.0, 2e5])
def test_water_beyond_the_old_mesh_has_the_profile_of_flow_or_diffusion(speed, order):
    """It follows (26) with each substrate's diffusivity upstream, and the outflow downstream; without flow the supply.
    """
    scene, pore = base(order)
    new = base(order, "numerics.extent=full")[1].space
    before, x = (node_coordinates(space)[:, 0] for space in (pore.space, new))
    state = transport.Concentrations(3 + 0.01 * before, 2 - 0.02 * before)
    computed = remeshing.transfer_substrates(scene.substrates, pore.space, new, state, speed)
    first, last = pore.mesh.ends
    certain = np.abs([x - first, x - last]).min(axis=0) > 1e-9
    for name, slope, start in (("acceptor", 0.01, 3), ("donor", -0.02, 2)):
        substrate = getattr(scene.substrates, name)
        faded = np.exp(speed * np.minimum(x - first, 0) / substrate.diffusivity)
        faded[(x < first) | (x > last)] *= speed > 0
        expected = substrate.supply - (substrate.supply - start - slope * np.clip(x, first, last)) * faded
        assert getattr(computed, name)[certain] == pytest.approx(expected[certain], rel=1e-9)
        assert certain.sum() > 0.9 * len(x)


@EVERY_ORDER
def test_every_transferred_amount_keeps_its_sum(order):
    """The sums of active and inert biomass and of two more amounts stay to 1e-12. The amounts are rough or, with curved
    elements, inert in every other triangle; none becomes negative."""
    scene, pore, _ = uneven(order)
    finer = replace(scene, numerics=replace(scene.numerics, refinement=0.47))
    full = scene.kinetics.maximum_density * pore.space.reaction.dx
    rough = full * np.random.default_rng(3).uniform(0.0, 0.3, (3, *full.shape))
    patchy = full * (np.arange(len(full)) % 2)[:, None]
    pressure = pore.mesh.points[: pore.mesh.corners] @ [0.02, 0.03] + 1
    for inert, *amounts in (rough, [patchy, patchy])[:order]:
        before = replace(pore, active=full - inert, inert=inert, pressure=pressure)
        after, carried = remeshing.remesh(Remeshing.of(finer), pore, before, 0.0, tuple(amounts))
        inside = after.mesh.topology.body_corners
        assert after.pressure[inside] == pytest.approx(after.mesh.points[inside] @ [0.02, 0.03] + 1, abs=1e-2)
        sums = [amount.sum() for amount in (after.inert, *carried)]
        assert sums == pytest.approx([amount.sum() for amount in (inert, *amounts)], rel=1e-12)
        assert after.mass == pytest.approx(full.sum(), rel=1e-12 if order == 1 else 1e-9)
        assert order == 1 or min(amount.min() for amount in (after.active, after.inert, *carried)) >= 0


def test_a_plug_ends_in_quarter_discs_and_its_pressure_drops_over_its_whole_length():
    scene = load_scene("wide", ['flow.mean_velocity="2.9 m/day"', 'growth.end="45 h"'])
    width = scene.pore.width
    for area in (1.6 * width**2, 4 * width**2):
        reach = numbers.sizes(scene, area).reach
        assert 2 * (reach - width) * width + np.pi / 2 * width**2 == pytest.approx(area, rel=1e-12)
    drop = 12 * 2000 * 998 * 1.003e-6 * 2.9 / 86400 / (width * 1e-6) ** 2 * 2 * numbers.at_end(scene).reach * 1e-6 / 1e4
    assert numbers.stresses(scene, scene.flow.mean_velocity)[1] == pytest.approx(drop, rel=1e-12)


def test_runs_are_compared_under_their_own_names_with_signs():
    """The first run is not the first by name. A tip further upstream, at a smaller x, is a decrease."""
    runs = []
    for name, scale in (("zeta", 1.0), ("alpha", 1.5), ("mu", 0.5)):
        series = {column: scale * (1.0 + k + np.array([0.1, 0.4])) for k, column in enumerate(results.COLUMNS)}
        series |= {"time_h": np.array([0.0, 3.0]), "upstream_um": scale * np.array([-5.0, -8.0])}
        runs.append(Run(Path("runs") / name, {"scene": name, "tables": {"factor": 1.0 + (scale < 1)}}, series, {}))
    labels = comparison.short([run.folder for run in runs])
    for chart in quantities.overlaid(runs, labels):
        assert [line.label for line in chart.lines] == labels, chart.title
        if chart.title != "Mesh: made anew":
            assert [line.values[-1] / chart.lines[0].values[-1] for line in chart.lines] == pytest.approx([1, 1.5, 0.5])
    assert comparison.differences(runs) == [("factor", "1", "1", "2")]
    page_text = comparison.build(runs)
    assert page_text.count("status unknown to t = 3 h") == 3
    values = page_text[page_text.index("Values at the common last time"):]
    heads = re.findall('<th scope="col" class="value">([^<]*)', values)
    assert heads == ["zeta", "alpha", "difference", "mu", "difference"]
    (row,) = re.findall("<tr><td>upstream end of the aggregate.*?</tr>", page_text)
    assert re.findall('class="value">([^<]*)<', row) == ["-8", "-12", "-50 %", "-4", "+50 %"]


@EVERY_ORDER
def test_a_mesh_moves_by_the_scenes_constants_unless_it_is_too_coarse(order):
    """The motion uses gamma of (35) and c of its stabilisation. Edges three times as long as a film of 2.5 um allows
    are too coarse."""
    coarse, pore = base(order, 'pore.width="20 um"', 'aggregate.radius="17.5 um"', "numerics.refinement=0.6",
                       "numerics.mesh_compressibility=3", "numerics.flow_stabilisation=40")
    coordinates = pore.mesh.points.copy()
    coordinates[pore.mesh.body] *= 1.001
    expected = mesh_motion.move(pore.mesh, coordinates[pore.mesh.body], compressibility=3.0, stabilisation=40.0)
    moved = remeshing.moved_mesh(Meshing.of(coarse), pore, pore.moved(coordinates))
    assert np.array_equal(moved.points, expected)
    fine = replace(coarse, numerics=replace(coarse.numerics, refinement=1.8))
    assert remeshing.moved_mesh(Meshing.of(fine), pore, pore) is None


@pytest.mark.parametrize("time", ["updates", "midpoint"])
def test_a_shape_leans_as_the_flow_at_the_end_of_its_step_pushes(time):
    """The lean is the difference between the ends' motion. It is the same under a rising head as under its last value,
    and a jump at the end of the step has no effect."""
    leans = []
    for first, last, kind in ((4, 4, "linear"), (1, 4, "linear"), (4, 1, "steps")):
        scene, _ = base(2, f'flow.head=[["0 h", "{first}e-3 cm"], ["0.2 h", "{last}e-3 cm"]]', 'growth.end="0.2 h"',
                        f"flow.interpolation={kind}", "growth.fluid_forces=included", f"numerics.time={time}",
                        'growth.shear_modulus="1e-3 MPa"', 'output.times=["0.2 h"]')
        _, end = simulation.simulate(scene)
        leans.append(end.pore.outline.upstream + end.pore.outline.downstream)
    assert leans == pytest.approx([leans[0]] * 3, rel=1e-2) and leans[0] > 1e-4


def test_a_step_grows_as_much_on_a_new_mesh_half_way():
    """In 4 h a seed grows by half and the supply falls to a tenth. The mesh half way is new, since edges are three
    times too long, or the old one."""
    scene, pore = base(2, 'substrates.donor.supply=[["0 h", "4 mg/L"], ["4 h", "0.4 mg/L"]]',
                      "substrates.donor.interpolation=linear")
    solved = solve(scene, pore)
    first = Stages.of(scene).rates(pore, solved)
    numerics = [replace(scene.numerics, refinement=part) for part in (0.3, 0.9)]
    same_mesh, new_mesh = (midpoint.solve_halfway(Stages.of(replace(scene, numerics=each)), pore, solved, first, 4.0,
                                                  contact.PATIENT) for each in numerics)
    assert new_mesh.produced == pytest.approx(same_mesh.produced, rel=1e-2)
    assert len(new_mesh.solved.flow.velocity) > 2 * len(same_mesh.solved.flow.velocity)


@pytest.mark.parametrize("key, unit", [("mean_velocity", "m/day"), ("head", "um")])
def test_meshes_are_fine_enough_for_the_fastest_later_flow(key, unit):
    """Curved elements under a table are as fine as under its largest value from the start."""
    course = f'[["0 h", "2 {unit}"], ["1 h", "160 {unit}"], ["2 h", "3 {unit}"]]'
    changes = [["numerics.preset=fast", f"flow.{key}={value}"] for value in (f"2 {unit}", f"160 {unit}", course)]
    slow, fast, over_time = (resolution(load_scene("base", each, ["flow.head"])) for each in changes)
    assert over_time == fast > 1.5 * slow


def sweep_of(folder, widths):
    factors = [parse(f"pore.width={widths}")]
    return Sweep(folder, "flow_only", factors, points("flow_only", [], factors, grid(factors)))


def record_end(swept, point, status, rows=1):
    """Record the end of a run of a sweep, with rows of t = 0 and ones; return its recorder."""
    (swept.runs / point.name).mkdir(parents=True)
    recorder = execution.Recorder(point.scene, swept.runs / point.name)
    recorder.history.rows = [[0.0, *[1.0] * (len(results.COLUMNS) - 1)]] * rows
    recorder.save(status)
    return recorder


def test_unfinished_runs_of_a_sweep_are_made_again(tmp_path):
    """The pore's end counts only as the complete sentence."""
    swept = sweep_of(tmp_path, "40 um, 50 um, 60 um, 70 um, 80 um, 90 um, 95 um")
    end = "the aggregate reaches the pore's downstream end at t = 0 h"
    statuses = ("completed", "failed: x", "interrupted", end, f"{end}!", end.replace("= 0", "= 1"),
                end.replace("at t", "in the step from t"))
    for point, status in zip(swept.points, statuses):
        record_end(swept, point, status)
    assert [point.index for point in swept.missing()] == [2, 3, 5]


def test_times_by_stage_are_those_before_a_resume_and_since(tmp_path, monkeypatch):
    monkeypatch.setattr(timing, "seconds", {"growth": 2.0, "transfer": 4.0})
    recorder = execution.Recorder(load_scene("base"), tmp_path)
    recorder.history.stages, recorder.history.seconds = {"flow": 8.0, "growth": 16.0}, 1000.0
    recorder.write_record("running")
    assert read_record(tmp_path)["wall_time_by_stage_s"] == {"flow": 8.0, "growth": 18.0, "transfer": 4.0}
    assert 1000 < read_record(tmp_path)["wall_time_s"] < 1100


def test_a_longer_run_is_judged_by_its_first_velocity(tmp_path):
    recorder = execution.Recorder(load_scene("base"), tmp_path)
    column = results.COLUMNS.index("mean_velocity_m_per_d")
    recorder.history.rows = [[None] * column + [speed] for speed in (24.0, 0.024)]
    assert recorder.first_velocity == pytest.approx(1e6, rel=1e-12)


@pytest.mark.parametrize("key", ["blas", "libc", "geos", "machine", "system", "source"])
def test_a_resume_under_other_conditions_is_reported(key, tmp_path, monkeypatch, recwarn):
    """Conditions that may change numbers are reported; threads are not."""
    recorder = execution.Recorder(load_scene("flow_only"), tmp_path)
    recorder.write_record("running")
    before = read_record(tmp_path)
    present = {**before["conditions"], "threads": {"OMP_NUM_THREADS": "7"}}
    monkeypatch.setattr(execution, "conditions", lambda: present)
    assert execution._find_changes(before, recorder, execution.DEFAULT_WATCH) == {} and not recwarn.list
    present[key] = "another"
    with pytest.warns(UserWarning, match=f"conditions.{key} .*now another"):
        execution._find_changes(before, recorder, execution.DEFAULT_WATCH)


@EVERY_ORDER
@pytest.mark.parametrize("fixed_point", ["kept", "rechosen"])
def test_each_contact_surface_has_its_own_fixed_point(fixed_point, order):
    """They are the corners nearest to the middles of both, -2 and -1 um, for any points and any previous fixed point.
    """
    leaning = [(-21, 0), (-19, 9), (-12, 17), (-6, 20), (-5.5, 20), (-5, 20), (-4.5, 20), (4, 20), (12, 12), (17, 0)]
    scene = simulation.shaped(base(order, 'pore.width="20 um"', f"numerics.fixed_point={fixed_point}")[0], leaning)
    pore = seeded(scene)
    pore = replace(pore, fixed=np.roll(pore.fixed, 2 * (fixed_point == "rechosen")))
    x, y = pore.mesh.points[pore.mesh.loop][contact._fixed_points(scene.numerics, pore)].T
    assert y.tolist() == [0.0, 20.0] and x == pytest.approx([-2.0, -1.0], abs=0.3)


@pytest.mark.parametrize("order", [2, 3])
def test_gears_method_bounds_undershoots_by_each_substrates_supply(order):
    """A drain consumes all of the acceptor, 10 mg/L, and 5e-4 or 5e-3 of it too much. The donor has 1000 mg/L."""
    pore, problem = case.__wrapped__(velocity=None, boundary="closed", order=order,
                                    substrates={"donor": {"supply": "1000 mg/L"}})
    drained = replace(problem, source=np.concatenate([-1e6 * storage(problem), np.zeros(problem.space.count)]))
    nothing = np.zeros_like(pore.active)
    start = transport.supplied_everywhere(problem)
    consumed = gear.advance(drained, nothing, nothing, start, 10.005e-6).concentrations.acceptor
    assert [consumed.min(), consumed.max()] == pytest.approx([-5e-3, -5e-3], rel=1e-6)
    with pytest.raises(TransportError, match="the acceptor becomes negative"):
        gear.advance(drained, nothing, nothing, start, 10.05e-6)


@pytest.mark.parametrize("seed", [0.0, -30.0])
def test_a_seed_anywhere_was_round_at_its_start(seed):
    """New nodes on straight edges have initial positions on the seed's arc, to round-off."""
    outline = half_disc(8.0, 4.0, 1, seed)
    finer = split(outline, Sizing(50.0, 1.0, 2.0, seed=seed))
    free = finer.wall == FREE
    assert free.sum() > 1.5 * (outline.wall == FREE).sum()
    assert np.hypot(*(finer.origin[free] - [seed, 0]).T) == pytest.approx(8.0, rel=1e-12)
    assert np.hypot(*(finer.points[free] - [seed, 0]).T).min() < 7.99


@EVERY_ORDER
def test_continuation_in_half_saturations_reaches_the_same_state(order):
    """Newton's method reaches the same state from the supply and through larger half saturations, one above its supply.
    """
    scene, pore = base(order, 'substrates.acceptor.half_saturation="1e-3 mg/L"',
                      'substrates.donor.half_saturation="30 mg/L"')
    problem = solve(scene, pore).problem
    sink = biomass.sink(pore.active)
    computed, _ = transport._newton(transport.Balance(problem, sink), problem.supply)
    eased, _ = transport._eased(problem, sink, problem.supply)
    assert eased == pytest.approx(computed, rel=1e-9)


@pytest.mark.parametrize("order", [2, 3])
def test_a_front_between_the_points_of_a_quadrature_is_refused(order, monkeypatch):
    """Two quadratures differ by more than a twentieth, the accepted part, behind a front 4e-2 um thick. The acceptor
    has 2 mg/L."""
    front = ['substrates.acceptor.supply="2 mg/L"', 'substrates.acceptor.half_saturation="1e-4 mg/L"',
             'aggregate.radius="20 um"', "numerics.refinement=0.4", 'flow.mean_velocity="0.5 m/day"']
    scene, pore = base(order, *front, unset=["flow.head"])
    solved = solve(scene, pore)
    problem, sink = solved.problem, biomass.sink(pore.active)
    error = transport.quadrature_error(problem, sink, solved.concentrations)
    for accepted in (2 * error, error / 2):
        monkeypatch.setattr(transport, "APART", accepted)
        with nullcontext() if accepted > error else pytest.raises(Unresolved, match="two quadratures"):
            transport.steady(problem, sink)
    monkeypatch.undo()
    for error in (0.049, 0.051):
        monkeypatch.setattr(transport, "quadrature_error", lambda *_, error=error: error)
        with nullcontext() if error < 0.05 else pytest.raises(Unresolved, match="by 5.1 % .up to 5 % is accepted"):
            transport.steady(problem, sink)


def test_a_step_misses_the_tolerance_only_beyond_the_accepted_excess():
    for part, expected in ((0.0, False), (1.0, False), (EXCESS, False), (1.01 * EXCESS, True)):
        assert exceeds_tolerance(StepControl(1.0, 1.0, 0.3 * part), 0.3) is expected


def test_xarray_has_units_that_udunits_knows():
    pytest.importorskip("xarray")
    results_of_run = Results("x", [dict.fromkeys(results.COLUMNS, 1.0)], [], "failed: y")
    dataset = results_of_run.to_xarray()
    assert dataset.attrs["status"] == results_of_run.to_pandas().attrs["status"] == "failed: y"
    expected = {"mean_velocity_m_per_d": "m d-1", "aggregate_area_um2": "um2", "nodes": "1",
              "inlet_donor_mg_per_L": "mg L-1"}
    assert {name: dataset[name].attrs["units"] for name in expected} == expected


def test_a_picture_states_which_values_are_dark():
    coordinates = np.array([(0.0, 0.0), (4.0, 0.0), (0.0, 3.0)])
    drawing = {"places_um": coordinates, "triangles": np.array([[0, 1, 2]]), "region": np.zeros(1)}
    caption = picture.figure(drawing | {"acceptor_mg_per_L": np.array([3.0, 1.5, 7.0])}, 2.5)
    assert caption.count("acceptor (mg/L), 1.5 (dark) to 7 (light), at t = 2.5 h") == 2
    caption = picture.figure(drawing | {"velocity_m_per_d": np.array([[-3.0, 4, 0], [0, 1, 0], [0, 2, 0]])}, 2.5)
    assert "velocity (m/day), 1 (dark) to 5 (light)" in caption


THIN = {"front": ["numerics.preset=fast", 'substrates.acceptor.half_saturation="1e-3 mg/L"',
                  'flow.mean_velocity="1 m/day"'],
        "layer of drag": ["numerics.preset=fast", "flow.biomass=brinkman", 'flow.permeability="4e-13 m^2"',
                          "aggregate.radius=30 um",
                          'flow.mean_velocity="1 m/day"'],
        "cells": ["numerics.preset=paper", 'flow.mean_velocity="60 m/day"']}


@pytest.mark.parametrize("layer", THIN)
def test_an_advised_refinement_ends_its_warning_and_a_smaller_one_does_not(layer):
    def advice(*more):
        scene = load_scene("base", [*THIN[layer], 'growth.end="2 h"', *more], ["flow.head"])
        warnings = simplifications.find_warnings(scene, numbers.numbers(scene, scene.flow.mean_velocity))
        return [each.text for each in warnings if " would " in each.text]

    (message,) = advice()
    expected = float(re.search("([0-9.]+) would (do|resolve it)", message)[1])
    assert not advice(f"numerics.refinement={1.06 * expected}") and advice(f"numerics.refinement={0.94 * expected}")


def test_the_worst_step_that_misses_the_tolerance_is_reported(tmp_path):
    recorder = execution.Recorder(load_scene("base", ["numerics.tolerance=0.01"]), tmp_path)
    for estimate in (0.03, 0.5, 0.04, 0.001):
        recorder._count_missed_tolerance(StepControl(1.0, 1.0, estimate))
    assert recorder.history.missed == 3 and not recorder.contact
    assert "errs by 0.5 (estimate)" in recorder.warn_missed_tolerance()[0].text


@pytest.mark.parametrize("times", ['["5 h", "18 h"]', '["0 h", "5 h", "18 h"]'])
def test_requested_rows_are_counted_with_that_at_zero(times):
    """The permeability is reported in the units of the scene."""
    scene, _ = base(2, f"output.times={times}", "flow.biomass=brinkman", 'flow.permeability="2.5e-15 m^2"')
    description = dict(modelled.describe_model(scene))
    assert "rows and fields at 3 times" in description["output"]
    assert "an aggregate with a permeability of 2.5e-15 m2" in description["flow"]


def test_a_run_without_rows_has_the_status_of_its_folder_or_attempt(tmp_path):
    """A run failed before t = 0. A run without a folder has the status of its attempt, or "not run"."""
    swept = sweep_of(tmp_path, "40 um, 50 um, 60 um")
    record_end(swept, swept.points[0], "failed: x", rows=0)
    for messages, second in (({}, "not run"), ({1: "failed: y", 2: "failed: z"}, "failed: z")):
        assert [run.status for run in table.read_runs(swept, messages, 0.1)] == ["failed: x", second, "not run"]


def test_rows_of_a_run_that_failed_are_in_the_table(tmp_path):
    swept = sweep_of(tmp_path, "40 um, 50 um")
    record_end(swept, swept.points[1], "failed: x")
    table.write(swept, table.read_runs(swept, {}, 0.1))
    assert [row["run"] for row in rows(tmp_path / "table.csv")] == ["2"]


def test_marks_of_the_page_have_the_colour_of_their_key(tmp_path):
    """Two factors are varied, and each figure has the key of the other one. Dots are runs that clogged, triangles runs
    that ended before; failed runs have no mark."""
    factors = [parse("pore.width=40 um, 50 um"), parse("flow.viscosity_ratio=100, 400, 1000")]
    designed, course = points("flow_only", [], factors, grid(factors)), np.array([1.0, 8.0])
    numbers_of = [dict.fromkeys(table.COLUMNS) | {"clogging_time_h": time} for time in (5.0, 5.0, None, 5.0, 5.0, None)]
    runs = [table.SweepRun(one, "completed", course, course, course, each) for one, each in zip(designed, numbers_of)]
    runs[5] = replace(runs[5], status="failed: x")
    times = page.page(Sweep(tmp_path, "flow_only", factors, designed), runs, 0.3).split("<h2>Clogging time")[1]
    figures = re.findall("<figure>.*?</figure>", times, re.S)
    for figure, key in zip(figures, ("flow.viscosity_ratio", "pore.width"), strict=True):
        named = dict(re.findall(r'class="line(.)" points="0,5 24,5"/></svg>([^<]*)</li>', figure))
        mark = rf'<(\w+) class="[a-z]+(.)"[^>]*><title>run (.)[^<]*?{key} = ([^,:]*)[^<]*?: ([^:<]*)</title>'
        marks = re.findall(mark, figure)
        assert len(marks) == 5 and "time to 0.3 of the conductivity (h)" in figure
        assert {named[level] == value for _, level, _, value, _ in marks} == {True}
        for kind, _, run, _, message in marks:
            assert (kind, message) == (("polygon", "after 8 h") if run == "3" else ("circle", "5 h"))


def test_a_continued_sweep_counts_existing_runs(tmp_path):
    swept = sweep_of(tmp_path, "40 um, 50 um, 60 um")
    record_end(swept, swept.points[1], "completed")
    events = []
    driver._run_missing(swept, lambda missing, folder: ((one, "completed") for one in missing), {}, events.append)
    assert [(each["done"], each["total"], each.get("run")) for each in events] == [(1, 3, None), (2, 3, 1), (3, 3, 3)]


def test_the_remaining_time_follows_from_the_speed_since_a_resume(monkeypatch):
    """After a resume at 18 of 20 h, 1 h in 10 s leaves 10 s."""
    monkeypatch.setattr(progress, "_fit", lambda bar, event: None)
    bars = []
    monkeypatch.setattr(tqdm, "tqdm", lambda **options: bars.append(Bar(**options)) or bars[0])
    with progress.on_a_terminal() as tell:
        tell({"event": "start", "scene": "base", "from_h": 18.0, "end_h": 20.0, "step": 90})
        tell({"event": "step", "time_h": 19.0})
        assert Bar.format_meter(**bars[0].format_dict | {"elapsed": 10.0, "rate": None}).endswith("[00:10 < 00:10]")


@pytest.mark.parametrize("value, displayed", [(0.00123457, "0.00123457"), (True, "yes"), (False, "no"), (None, "none"),
                                         ("1234.56789 um", "1234.57 um"), ("a b", "a b"), ([], "none"),
                                         ([1.5, "2.0 h"], "1.5, 2 h")])
def test_a_value_is_shown_with_six_digits_and_its_unit(value, displayed):
    assert run_page.page.format_value(value) == displayed


def test_gears_steps_are_scaled_by_the_larger_of_content_and_supply():
    """The acceptor's supply has fallen, the donor's has risen."""
    _, problem = case.__wrapped__()
    start = transport.supplied_everywhere(problem)
    start = replace(start, acceptor=3 * start.acceptor, donor=start.donor / 2)
    nothing = np.zeros_like(problem.space.reaction.dx)
    scale = gear._started(problem, nothing, nothing, start)[0].scale
    assert scale.ravel().tolist() == [3 * problem.both[0].supply, problem.both[1].supply]


@EVERY_ORDER
def test_an_update_under_a_table_starts_from_gears_concentrations(order):
    """It uses the supply half way, and not the steady profiles of that supply."""
    table_of = 'substrates.acceptor.supply=[["0 h", "9 mg/L"], ["1 h", "29 mg/L"]]'
    scene, pore = base(order, "numerics.transport=gear", table_of, "substrates.acceptor.interpolation=linear")
    solved = solve(scene, pore)
    half_way = updates._solve_midway(scene, pore, solved, 0.2)
    assert half_way.concentrations is solved.concentrations and half_way.problem.both[0].supply == pytest.approx(11.0)
    stored = updates.step(Stages.of(scene), pore, solved, 0.2).ledger.stored[0]
    risen = stored / (scene.pore.width * np.ptp(pore.mesh.ends))
    assert risen == pytest.approx(2.0, rel=0.05)
