"""What wrong changes would alter unseen, derived anew: each side, substrate, axis and row apart."""
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
from repro.march.loop import Instant, Ledger
from repro.march.pace import EXCESS, Pace, missed
from repro.model import biomass, contact, gear, mesh_motion, remeshing, transport
from repro.model.pore import Solved, resolution, seeded, solve
from repro.preflight import modelled, numbers, simplifications
from repro.report import comparison, quantities, run_page
from repro.report.reading import Run
from repro.results import field_files, picture
from repro.results.tables import Results
from repro.runs import progress, running
from repro.scene import load_scene
from repro.sweeps import making, page, table
from repro.sweeps.design import grid, parse, points
from repro.sweeps.state import Sweep
from tests import oracles
from tests.shell import rows, told
from tests.strategies import ORDERS, constants
from tests.test_derived import EVERY_ORDER, arcs, over_end, places_of
from tests.test_gear import case, storage

NOTHING = Solved(None, None, None)
UNLIKE_OF = {"acceptor": "donor", "donor": "acceptor"}
EVEN = Ledger(0.0, 1.0, (5.0, 3.0), (1.0, 1.5), (4.0, 1.5), (0.0, 0.0), 70.0, 10.0, 80.0)
UNLIKE = ['substrates.acceptor.supply="9 mg/L"', 'substrates.donor.supply="4 mg/L"', "numerics.refinement=0.3"]


def base(order, *changes, unset=()):
    """(scene, its seed) with coarse elements of an order, and supplies that differ."""
    scene = load_scene("base", [*UNLIKE, f"numerics.elements={ORDERS[order]}", *changes], unset)
    return scene, seeded(scene)


def row_of(scene, now, solved=NOTHING, ledgers=(), remeshes=0):
    return results.row(scene, Instant(now, solved, None, ledgers, remeshes, {}))


@EVERY_ORDER
def test_ends_and_top_are_those_of_the_boundary_between_its_nodes(order):
    """Of a swollen seed that leans, of arcs sampled to 1e-6; the nodes alone are off by 4e-4 um or more."""
    scene, now = base(order, "numerics.refinement=0.5")
    x, y = now.mesh.points.T
    near = np.exp(-(x**2 + y**2) / 100)
    now = now.moved(np.column_stack([x + (0.2 * x * y + 0.1 * y) * near, y * (1 + 0.05 * x * near)]))
    row = row_of(scene, now)
    ends = [row[name] for name in ("upstream_um", "downstream_um", "thickness_um")]
    wanted, of_nodes = ([*places.min(0)[:1], *places.max(0)] for places in (arcs(now), now.mesh.points[now.mesh.loop]))
    apart = np.abs(np.subtract(ends, of_nodes))
    assert ends == pytest.approx(wanted, rel=1e-6)
    assert apart.min() > 2e-4 if order > 1 else apart.max() == 0


def test_a_row_says_whether_any_of_its_steps_made_a_mesh():
    scene, now = base(1)
    assert [row_of(scene, now, remeshes=count)["remeshed"] for count in (0, 1, 2, 7)] == [0, 1, 1, 1]


def test_biomass_is_told_of_a_scene_that_does_not_grow():
    scene = load_scene("initial_mesh", ["substrates={}", "aggregate.inert_fraction=0.3"])
    row = row_of(scene, seeded(scene))
    known = [row[name] for name in ("inert_fraction", "biomass_density_min", "biomass_density_max")]
    assert known == pytest.approx([0.3, 1.0, 1.0], rel=1e-12) and row["biomass_balance"] is None


@pytest.mark.parametrize("k, name", [(0, "acceptor"), (1, "donor")])
def test_each_substrates_defect_is_over_its_own_terms(k, name):
    """Of a row's own fluxes without a step, and with Gear over what the meshed part holds at the supply."""
    scene, now = base(1)
    gear, solved = base(1, "numerics.transport=gear")[0], solve(scene, now)
    fluxes = [transport.Fluxes(5e3, 1e3, 4e3, 9.0, 8.0), transport.Fluxes(3e3, 1.5e3, 1.5e3, 4.0, 3.0)]
    fluxes[k] = replace(fluxes[k], out=fluxes[k].out - 60)
    own = np.eye(2)[k]
    held = getattr(scene.substrates, name).supply * np.ptp(now.mesh.ends) * scene.pore.width
    for row, wanted in ((row_of(scene, now, replace(solved, fluxes=tuple(fluxes))), 60 / fluxes[k].supplied),
                        (row_of(gear, now, solved, (replace(EVEN, stored=tuple(-7.0 * own)),)), 7.0 / held)):
        found = [row["acceptor_balance"], row["donor_balance"]]
        assert found == pytest.approx(wanted * own, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("k, name", [(0, "acceptor"), (1, "donor")])
def test_an_overshoot_is_over_each_substrates_own_supply(k, name):
    """Of the present supply, with Gear of the largest of its table; zero below it, and over a supply of zero too."""
    table = f'substrates.{name}.supply=[["0 h", "5 mg/L"], ["1 h", "9 mg/L"], ["2 h", "0 mg/L"]]'
    both = [base(1, table, *more)[0] for more in ((), ("numerics.transport=gear",))]
    now = replace(seeded(both[0]), time=2.0)
    solved = solve(both[0], now)
    for largest, over in ((0.25, (0.25, 0.0)), (9.5, (9.5, 0.5)), (-1e-6, (0.0, 0.0))):
        fields = [np.full(now.space.count, -1e-3), np.full(now.space.count, -1e-3)]
        fields[k][7] = largest
        found = replace(solved, concentrations=transport.Concentrations(*fields))
        rows_of = [row_of(scene, now, found) for scene in both]
        assert [row[f"{name}_overshoot_mg_per_L"] for row in rows_of] == pytest.approx(over)
        assert {row[f"{UNLIKE_OF[name]}_overshoot_mg_per_L"] for row in rows_of} == {0.0}


@EVERY_ORDER
def test_stress_is_told_only_of_strain_since_the_start(order):
    both = [results.fields(*base(order, f"growth.new_biomass={born}"), NOTHING) for born in ("stressed", "stress_free")]
    stressed, free = ({*found.point_data, *found.cell_data} for found in both)
    assert len(stressed - free) == 6 and free == {name for name in stressed if not name.endswith("_MPa")}


def test_times_of_fields_keep_every_digit(tmp_path):
    scene, now = base(1)
    results.write_index(tmp_path / "fields.pvd", [(100 / 3, "b.vtu")])
    field_files.write(tmp_path / "b.vtu", results.fields(scene, replace(now, time=100 / 3), NOTHING))
    index, fields_there = (ElementTree.parse(tmp_path / name) for name in ("fields.pvd", "b.vtu"))
    times = index.find(".//DataSet").get("timestep"), fields_there.findtext(".//FieldData/DataArray")
    assert [*map(float, times)] == [100 / 3, 100 / 3]


def test_a_picture_has_upstream_on_the_left_and_the_upper_wall_above():
    """A field that rises along x and y: dark below upstream, light above downstream."""
    places = np.array(list(product(np.linspace(-10, 30, 9), np.linspace(0, 20, 5))))
    cells = Delaunay(places).simplices
    shown = {"places_um": places, "triangles": cells, "region": np.zeros(len(cells), bool)}
    pixels = plt.imread(io.BytesIO(picture.png(shown, places @ [1, 3])))[..., :3]
    assert (np.diff(pixels[[-1, -1, 0, 0], [0, -1, 0, -1]].sum(axis=1)) > 0).all()


def test_key_figures_tell_first_and_last_values_and_the_first_contact():
    columns = np.array([[0.0, 1.5, 2.5, 7.0], [5.0, 19.0, 20.0, 21.0], [0, 0, 1, 1]])
    said = picture.key_figures(dict(zip(("time_h", "thickness_um", "contact"), columns)))
    assert "thickness of the aggregate 5 → 21 um" in said and "wall from t = 2.5 h on" in said


@EVERY_ORDER
def test_without_flow_the_ends_are_means_over_their_height(order):
    """Of fields that are no plane, inlet and outlet apart, by Gauss's rule along each end."""
    scene, now = base(order, "numerics.transport=gear", "substrates.boundary=closed", unset=["flow"])
    x, y = places_of(now.space).T
    fields = [2 + np.sin(y / 7) + 0.01 * x, 5 + np.cos(y / 9) - 0.02 * x]
    made = transport.problem(now.space, None, scene.substrates, scene.kinetics)
    found = transport.fluxes(made, None, transport.Concentrations(*fields))
    for one, field in zip(found, fields):
        means = [over_end(now.space, end, field) / scene.pore.width for end in now.mesh.ends]
        assert [one.inlet, one.effluent] == pytest.approx(means, rel=1e-9) and abs(means[0] - means[1]) > 0.5


@EVERY_ORDER
def test_the_inlet_is_weighted_with_what_flows_whatever_its_condition_takes(order):
    scene, now = base(order)
    flow = solve(scene, now).flow
    local, mean = (transport.problem(now.space, flow, scene.substrates, scene.kinetics, inlet).inflow
                   for inlet in ("local", "mean"))
    assert np.array_equal(mean, local) and mean.sum() == pytest.approx(flow.mean_velocity * scene.pore.width)


@EVERY_ORDER
def test_a_concentration_may_leave_its_bounds_by_as_much_as_is_said(order):
    """Below zero by a thousandth of its own supply; above that, with curved elements, by a fiftieth."""
    scene, now = base(order)
    made = transport.problem(now.space, None, scene.substrates, scene.kinetics)
    for k, (part, accepted) in product((0, 1), ((-9e-4, True), (-1.1e-3, False), (1.019, True), (1.021, order == 1))):
        state = made.supply
        state[k * made.space.count + 7] *= part
        with nullcontext() if accepted else pytest.raises(Unresolved, match=("acceptor", "donor")[k]):
            transport._checked(made, state, 1)


def test_a_run_that_is_loaded_says_how_it_ended(tmp_path):
    running.Recorder(load_scene("flow_only"), tmp_path).tell("failed: out of memory")
    results.write_table(tmp_path / "timeseries.csv", results.COLUMNS, [[0.0] * len(results.COLUMNS)])
    assert repro.load_run(tmp_path).status == "failed: out of memory"


def test_a_step_ends_at_a_jump_to_the_last_bit():
    """Wherever it began, so that what holds after it is the new value; one a microhour shorter ends where it does."""
    _, now = base(1)
    for start, k, off in product((0.1, 0.7, 2.3, 19.1), range(1, 50), (1 - 4e-16, 1.0, 1 + 4e-16)):
        left = k / 7 * off
        assert stepping._end_of(replace(now, time=start), left, start + k / 7) == start + k / 7
        assert stepping._end_of(replace(now, time=start), left - 1e-6, start + k / 7) == start + (left - 1e-6)


def uneven(order):
    """(scene, pore, what is solved) with masses that differ from X_m from point to point."""
    scene, now = base(order)
    part = np.random.default_rng(order).uniform(0.7, 1.2, now.active.shape)
    now = replace(now, active=0.6 * part * now.active, inert=0.3 * now.active, theta=1.5 * now.theta)
    return scene, now, solve(scene, now)


@EVERY_ORDER
def test_an_update_takes_the_mean_of_the_rates_at_its_ends(order):
    """Active and inert biomass apart, by (9) and (10) as printed at the concentrations of both ends, to round-off."""
    scene, now, solved = uneven(order)
    after, end, _ = updates.make_biomass(scene, now, solved, 2.0)
    pieces, rates = now.space.reaction, []
    for state in (solved.concentrations, end):
        both = (field[pieces.cells] @ pieces.values.T for field in (state.acceptor, state.donor))
        rates.append(np.array(oracles.rates(*both, **constants(scene))[2:]))
    growth, remains = np.mean(rates, axis=0)
    assert np.abs(rates[0] / rates[1] - 1).max(axis=(1, 2)).min() > 1e-4, "else the start would do"
    assert after.active == pytest.approx(now.active * np.exp(2 * growth), rel=1e-12)
    made = now.active * np.expm1(2 * growth) / growth * remains
    assert after.inert - now.inert == pytest.approx(made, rel=1e-9)


@EVERY_ORDER
@pytest.mark.parametrize("speed", [0.0, 2e5])
def test_beyond_the_old_mesh_there_is_what_flows_or_diffuses_there(speed, order):
    """Upstream (26) with each substrate's own diffusivity, downstream what leaves; without flow the supply."""
    scene, now = base(order)
    new = base(order, "numerics.extent=full")[1].space
    before, x = (places_of(space)[:, 0] for space in (now.space, new))
    state = transport.Concentrations(3 + 0.01 * before, 2 - 0.02 * before)
    found = remeshing.carried_substrates(scene, now.space, new, state, speed)
    first, last = now.mesh.ends
    apart = np.abs([x - first, x - last]).min(axis=0) > 1e-9
    for name, slope, start in (("acceptor", 0.01, 3), ("donor", -0.02, 2)):
        kind = getattr(scene.substrates, name)
        faded = np.exp(speed * np.minimum(x - first, 0) / kind.diffusivity)
        faded[(x < first) | (x > last)] *= speed > 0
        wanted = kind.supply - (kind.supply - start - slope * np.clip(x, first, last)) * faded
        assert getattr(found, name)[apart] == pytest.approx(wanted[apart], rel=1e-9) and apart.sum() > 0.9 * len(x)


@EVERY_ORDER
def test_every_amount_that_is_carried_keeps_its_own_sum(order):
    """Active and inert biomass, and two more of the same material, to 1e-12: rough ones, and of curved elements all of
    it inert in every other triangle, where none is less than nothing."""
    scene, now, _ = uneven(order)
    finer = replace(scene, numerics=replace(scene.numerics, refinement=0.47))
    full = scene.kinetics.maximum_density * now.space.reaction.dx
    rough = full * np.random.default_rng(3).uniform(0.0, 0.3, (3, *full.shape))
    patchy = full * (np.arange(len(full)) % 2)[:, None]
    pressure = now.mesh.points[: now.mesh.corners] @ [0.02, 0.03] + 1
    for inert, *others in (rough, [patchy, patchy])[:order]:
        before = replace(now, active=full - inert, inert=inert, pressure=pressure)
        after, carried = remeshing.remesh(finer, now, before, 0.0, tuple(others))
        inside = after.mesh.topology.body_corners
        assert after.pressure[inside] == pytest.approx(after.mesh.points[inside] @ [0.02, 0.03] + 1, abs=1e-2)
        sums = [amount.sum() for amount in (after.inert, *carried)]
        assert sums == pytest.approx([amount.sum() for amount in (inert, *others)], rel=1e-12)
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
    """The first run need not be the first by name; a tip further upstream, at a smaller x, is a fall."""
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
    made = comparison.build(runs)
    assert made.count("status unknown to t = 3 h") == 3
    heads = re.findall('<th scope="col" class="value">([^<]*)', made[made.index("Values at the common last time"):])
    assert heads == ["zeta", "alpha", "difference", "mu", "difference"]
    (row,) = re.findall("<tr><td>upstream end of the aggregate.*?</tr>", made)
    assert re.findall('class="value">([^<]*)<', row) == ["-8", "-12", "-50 %", "-4", "+50 %"]


@EVERY_ORDER
def test_a_mesh_follows_by_the_scenes_constants_or_is_left_where_it_is_too_coarse(order):
    """gamma of (35) and c of its stabilisation; edges three times as long as a film of 2.5 um asks for."""
    coarse, now = base(order, 'pore.width="20 um"', 'aggregate.radius="17.5 um"', "numerics.refinement=0.6",
                       "numerics.mesh_compressibility=3", "numerics.flow_stabilisation=40")
    places = now.mesh.points.copy()
    places[now.mesh.body] *= 1.001
    wanted = mesh_motion.move(now.mesh, places[now.mesh.body], compressibility=3.0, stabilisation=40.0)
    assert np.array_equal(remeshing.followed(coarse, now, now.moved(places)).points, wanted)
    assert remeshing.followed(replace(coarse, numerics=replace(coarse.numerics, refinement=1.8)), now, now) is None


@pytest.mark.parametrize("time", ["updates", "midpoint"])
def test_a_shape_leans_as_the_flow_at_the_end_of_its_step_pushes(time):
    """Under a head that rises evenly as under its last value all the time, and before a jump as if there were none: how
    much further one end goes than the other."""
    leans = []
    for first, last, kind in ((4, 4, "linear"), (1, 4, "linear"), (4, 1, "steps")):
        scene, _ = base(2, f'flow.head=[["0 h", "{first}e-3 cm"], ["0.2 h", "{last}e-3 cm"]]', 'growth.end="0.2 h"',
                        f"flow.interpolation={kind}", "growth.fluid_forces=included", f"numerics.time={time}",
                        'growth.shear_modulus="1e-3 MPa"', 'output.times=["0.2 h"]')
        _, end = simulation.simulate(scene)
        leans.append(end.pore.outline.upstream + end.pore.outline.downstream)
    assert leans == pytest.approx([leans[0]] * 3, rel=1e-2) and leans[0] > 1e-4


def test_a_step_makes_as_much_where_the_mesh_half_way_is_a_new_one():
    """In 4 h, in which a seed grows by half and the supply falls to a tenth: a new mesh because edges are three times
    as long as asked for, or the old one."""
    scene, now = base(2, 'substrates.donor.supply=[["0 h", "4 mg/L"], ["4 h", "0.4 mg/L"]]',
                      "substrates.donor.interpolation=linear")
    solved = solve(scene, now)
    first = updates.rates_of(scene, now, solved.concentrations)
    kept, new = (midpoint.halfway(replace(scene, numerics=replace(scene.numerics, refinement=part)), now, solved, first,
                                  4.0, contact.PATIENT) for part in (0.3, 0.9))
    assert new.made == pytest.approx(kept.made, rel=1e-2)
    assert len(new.solved.flow.velocity) > 2 * len(kept.solved.flow.velocity)


@pytest.mark.parametrize("key, unit", [("mean_velocity", "m/day"), ("head", "um")])
def test_meshes_are_fine_enough_for_the_fastest_flow_to_come(key, unit):
    """Those of curved elements, under a table as under its largest value from the start."""
    course = f'[["0 h", "2 {unit}"], ["1 h", "160 {unit}"], ["2 h", "3 {unit}"]]'
    changes = [["numerics.preset=fast", f"flow.{key}={value}"] for value in (f"2 {unit}", f"160 {unit}", course)]
    slow, fast, over_time = (resolution(load_scene("base", each, ["flow.head"])) for each in changes)
    assert over_time == fast > 1.5 * slow


def sweep_of(folder, widths):
    factors = [parse(f"pore.width={widths}")]
    return Sweep(folder, "flow_only", factors, points("flow_only", [], factors, grid(factors)))


def ended(swept, point, status, rows=1):
    """The recorder of a run of a sweep with rows of t = 0 and ones, which has ended so."""
    (swept.runs / point.name).mkdir(parents=True)
    one = running.Recorder(point.scene, swept.runs / point.name)
    one.record.rows = [[0.0, *[1.0] * (len(results.COLUMNS) - 1)]] * rows
    one.save(status)
    return one


def test_what_has_not_come_to_its_end_is_made_again(tmp_path):
    """Of the pore's end the whole sentence is needed."""
    swept = sweep_of(tmp_path, "40 um, 50 um, 60 um, 70 um, 80 um, 90 um, 95 um")
    end = "the aggregate reaches the pore's downstream end at t = 0 h"
    statuses = ("completed", "failed: x", "interrupted", end, f"{end}!", end.replace("= 0", "= 1"),
                end.replace("at t", "in the step from t"))
    for point, status in zip(swept.points, statuses):
        ended(swept, point, status)
    assert [point.index for point in swept.missing()] == [2, 3, 5]


def test_times_by_stage_are_those_before_a_resume_and_since(tmp_path, monkeypatch):
    monkeypatch.setattr(timing, "seconds", {"growth": 2.0, "transfer": 4.0})
    one = running.Recorder(load_scene("base"), tmp_path)
    one.record.stages, one.record.seconds = {"flow": 8.0, "growth": 16.0}, 1000.0
    one.tell("running")
    assert told(tmp_path)["wall_time_by_stage_s"] == {"flow": 8.0, "growth": 18.0, "transfer": 4.0}
    assert 1000 < told(tmp_path)["wall_time_s"] < 1100


def test_a_longer_run_is_judged_by_its_first_velocity(tmp_path):
    one = running.Recorder(load_scene("base"), tmp_path)
    at = results.COLUMNS.index("mean_velocity_m_per_d")
    one.record.rows = [[None] * at + [speed] for speed in (24.0, 0.024)]
    assert one.first_velocity == pytest.approx(1e6, rel=1e-12)


@pytest.mark.parametrize("key", ["blas", "libc", "geos", "machine", "system", "source"])
def test_a_resume_elsewhere_is_told(key, tmp_path, monkeypatch, recwarn):
    """Whatever could change the numbers, but for threads, which do not."""
    one = running.Recorder(load_scene("flow_only"), tmp_path)
    one.tell("running")
    before = told(tmp_path)
    now = {**before["conditions"], "threads": {"OMP_NUM_THREADS": "7"}}
    monkeypatch.setattr(running, "conditions", lambda: now)
    assert running._changed(before, one, running.ALONE) == {} and not recwarn.list
    now[key] = "another"
    with pytest.warns(UserWarning, match=f"conditions.{key} .*now another"):
        running._changed(before, one, running.ALONE)


@EVERY_ORDER
@pytest.mark.parametrize("fixed_point", ["kept", "rechosen"])
def test_each_contact_surface_has_its_own_fixed_point(fixed_point, order):
    """The corners nearest to the middles of both, -2 and -1 um, however points lie and whichever was fixed before."""
    leaning = [(-21, 0), (-19, 9), (-12, 17), (-6, 20), (-5.5, 20), (-5, 20), (-4.5, 20), (4, 20), (12, 12), (17, 0)]
    scene = simulation.shaped(base(order, 'pore.width="20 um"', f"numerics.fixed_point={fixed_point}")[0], leaning)
    now = seeded(scene)
    now = replace(now, fixed=np.roll(now.fixed, 2 * (fixed_point == "rechosen")))
    x, y = now.mesh.points[now.mesh.loop][contact._fixed_points(scene, now)].T
    assert y.tolist() == [0.0, 20.0] and x == pytest.approx([-2.0, -1.0], abs=0.3)


@pytest.mark.parametrize("order", [2, 3])
def test_gears_method_takes_less_than_nothing_by_each_substrates_own_supply(order):
    """A drain takes the acceptor, of 10 mg/L, and 5e-4 or 5e-3 of it too much, beside a donor of 1000 mg/L."""
    now, problem = case.__wrapped__(velocity=None, boundary="closed", order=order,
                                    substrates={"donor": {"supply": "1000 mg/L"}})
    drained = replace(problem, source=np.concatenate([-1e6 * storage(problem), np.zeros(problem.space.count)]))
    nothing = np.zeros_like(now.active)
    start = transport.supplied_everywhere(problem)
    taken = gear.advance(drained, nothing, nothing, start, 10.005e-6).concentrations.acceptor
    assert [taken.min(), taken.max()] == pytest.approx([-5e-3, -5e-3], rel=1e-6)
    with pytest.raises(TransportError, match="the acceptor becomes negative"):
        gear.advance(drained, nothing, nothing, start, 10.05e-6)


@pytest.mark.parametrize("seed", [0.0, -30.0])
def test_a_seed_anywhere_was_round_at_its_start(seed):
    """New nodes on straight edges remember places on the seed's own arc, to round-off."""
    outline = half_disc(8.0, 4.0, 1, seed)
    finer = split(outline, Sizing(50.0, 1.0, 2.0, seed=seed))
    free = finer.wall == FREE
    assert free.sum() > 1.5 * (outline.wall == FREE).sum()
    assert np.hypot(*(finer.origin[free] - [seed, 0]).T) == pytest.approx(8.0, rel=1e-12)
    assert np.hypot(*(finer.points[free] - [seed, 0]).T).min() < 7.99


@EVERY_ORDER
def test_half_saturations_that_come_down_end_where_they_are(order):
    """From the supply and by way of larger half saturations the state is the same, one of them over its supply."""
    scene, now = base(order, 'substrates.acceptor.half_saturation="1e-3 mg/L"',
                      'substrates.donor.half_saturation="30 mg/L"')
    made = solve(scene, now).problem
    sink = biomass.sink(now.active)
    found, _ = transport._found(transport.Balance(made, sink), made.supply)
    eased, _ = transport._eased(made, sink, made.supply)
    assert eased == pytest.approx(found, rel=1e-9)


@pytest.mark.parametrize("order", [2, 3])
def test_a_front_between_the_points_of_a_quadrature_is_refused(order, monkeypatch):
    """Where two of them differ by more than is accepted, a twentieth, behind a front 4e-2 um thick of an acceptor of
    2 mg/L."""
    front = ['substrates.acceptor.supply="2 mg/L"', 'substrates.acceptor.half_saturation="1e-4 mg/L"',
             'aggregate.radius="20 um"', "numerics.refinement=0.4", 'flow.mean_velocity="0.5 m/day"']
    scene, now = base(order, *front, unset=["flow.head"])
    solved = solve(scene, now)
    made, sink = solved.problem, biomass.sink(now.active)
    apart = transport.quadrature_error(made, sink, solved.concentrations)
    for accepted in (2 * apart, apart / 2):
        monkeypatch.setattr(transport, "APART", accepted)
        with nullcontext() if accepted > apart else pytest.raises(Unresolved, match="two quadratures"):
            transport.steady(made, sink)
    monkeypatch.undo()
    for apart in (0.049, 0.051):
        monkeypatch.setattr(transport, "quadrature_error", lambda *_, apart=apart: apart)
        with nullcontext() if apart < 0.05 else pytest.raises(Unresolved, match="by 5.1 % .up to 5 % is accepted"):
            transport.steady(made, sink)


def test_a_step_misses_the_tolerance_by_more_than_is_accepted_alone():
    for part, wanted in ((0.0, False), (1.0, False), (EXCESS, False), (1.01 * EXCESS, True)):
        assert missed(Pace(1.0, 1.0, 0.3 * part), 0.3) is wanted


def test_xarray_has_units_that_udunits_knows():
    pytest.importorskip("xarray")
    found = Results("x", [dict.fromkeys(results.COLUMNS, 1.0)], [], "failed: y")
    said = found.to_xarray()
    assert said.attrs["status"] == found.to_pandas().attrs["status"] == "failed: y"
    wanted = {"mean_velocity_m_per_d": "m d-1", "aggregate_area_um2": "um2", "nodes": "1",
              "inlet_donor_mg_per_L": "mg L-1"}
    assert {name: said[name].attrs["units"] for name in wanted} == wanted


def test_a_picture_says_which_values_are_dark():
    places = np.array([(0.0, 0.0), (4.0, 0.0), (0.0, 3.0)])
    shown = {"places_um": places, "triangles": np.array([[0, 1, 2]]), "region": np.zeros(1)}
    said = picture.figure(shown | {"acceptor_mg_per_L": np.array([3.0, 1.5, 7.0])}, 2.5)
    assert said.count("acceptor (mg/L), 1.5 (dark) to 7 (light), at t = 2.5 h") == 2
    said = picture.figure(shown | {"velocity_m_per_d": np.array([[-3.0, 4, 0], [0, 1, 0], [0, 2, 0]])}, 2.5)
    assert "velocity (m/day), 1 (dark) to 5 (light)" in said


THIN = {"front": ["numerics.preset=fast", 'substrates.acceptor.half_saturation="1e-3 mg/L"',
                  'flow.mean_velocity="1 m/day"'],
        "layer of drag": ["numerics.preset=fast", "flow.biomass=brinkman", 'flow.permeability="4e-13 m^2"',
                          "aggregate.radius=30 um",
                          'flow.mean_velocity="1 m/day"'],
        "cells": ["numerics.preset=paper", 'flow.mean_velocity="60 m/day"']}


@pytest.mark.parametrize("layer", THIN)
def test_a_refinement_that_is_advised_silences_its_warning_and_a_smaller_one_does_not(layer):
    def advice(*more):
        scene = load_scene("base", [*THIN[layer], 'growth.end="2 h"', *more], ["flow.head"])
        found = simplifications.warnings(scene, numbers.numbers(scene, scene.flow.mean_velocity))
        return [each.text for each in found if " would " in each.text]

    (told_there,) = advice()
    wanted = float(re.search("([0-9.]+) would (do|resolve it)", told_there)[1])
    assert not advice(f"numerics.refinement={1.06 * wanted}") and advice(f"numerics.refinement={0.94 * wanted}")


def test_the_worst_of_the_steps_that_miss_the_tolerance_is_told(tmp_path):
    one = running.Recorder(load_scene("base", ["numerics.tolerance=0.01"]), tmp_path)
    for estimate in (0.03, 0.5, 0.04, 0.001):
        one._judge(Pace(1.0, 1.0, estimate))
    assert one.record.missed == 3 and not one.contact and "errs by 0.5 (estimate)" in one.unmet()[0].text


@pytest.mark.parametrize("asked", ['["5 h", "18 h"]', '["0 h", "5 h", "18 h"]'])
def test_rows_at_times_are_counted_with_that_at_zero(asked):
    """And what slows the water is told in the units of the scene."""
    scene, _ = base(2, f"output.times={asked}", "flow.biomass=brinkman", 'flow.permeability="2.5e-15 m^2"')
    said = dict(modelled.modelled(scene))
    assert "rows and fields at 3 times" in said["output"]
    assert "an aggregate with a permeability of 2.5e-15 m2" in said["flow"]


def test_a_run_without_a_row_says_what_its_folder_does_before_and_after_it_was_made(tmp_path):
    """Failed before t = 0, say; one without a folder says what the attempt at it said, or that there was none."""
    swept = sweep_of(tmp_path, "40 um, 50 um, 60 um")
    ended(swept, swept.points[0], "failed: x", rows=0)
    for told_now, second in (({}, "not run"), ({1: "failed: y", 2: "failed: z"}, "failed: z")):
        assert [one.status for one in table.tell(swept, told_now, 0.1)] == ["failed: x", second, "not run"]


def test_rows_of_a_run_that_failed_are_in_the_table(tmp_path):
    swept = sweep_of(tmp_path, "40 um, 50 um")
    ended(swept, swept.points[1], "failed: x")
    table.write(swept, table.tell(swept, {}, 0.1))
    assert [row["run"] for row in rows(tmp_path / "table.csv")] == ["2"]


def test_marks_of_the_page_have_the_colour_that_the_key_below_them_names(tmp_path):
    """Of the other factor, where two are varied by different parts: each figure with its own key; dots where runs have
    clogged, and what stands at its end where one has not, but nothing where one has failed before that."""
    factors = [parse("pore.width=40 um, 50 um"), parse("flow.viscosity_ratio=100, 400, 1000")]
    found, course = points("flow_only", [], factors, grid(factors)), np.array([1.0, 8.0])
    numbers_of = [dict.fromkeys(table.COLUMNS) | {"clogging_time_h": time} for time in (5.0, 5.0, None, 5.0, 5.0, None)]
    runs = [table.Told(one, "completed", course, course, course, each) for one, each in zip(found, numbers_of)]
    runs[5] = replace(runs[5], status="failed: x")
    times = page.page(Sweep(tmp_path, "flow_only", factors, found), runs, 0.3).split("<h2>Clogging time")[1]
    figures = re.findall("<figure>.*?</figure>", times, re.S)
    for figure, key in zip(figures, ("flow.viscosity_ratio", "pore.width"), strict=True):
        named = dict(re.findall(r'class="line(.)" points="0,5 24,5"/></svg>([^<]*)</li>', figure))
        mark = rf'<(\w+) class="[a-z]+(.)"[^>]*><title>run (.)[^<]*?{key} = ([^,:]*)[^<]*?: ([^:<]*)</title>'
        marks = re.findall(mark, figure)
        assert len(marks) == 5 and "time to 0.3 of the conductivity (h)" in figure
        assert {named[level] == value for _, level, _, value, _ in marks} == {True}
        for kind, _, run, _, told_there in marks:
            assert (kind, told_there) == (("polygon", "after 8 h") if run == "3" else ("circle", "5 h"))


def test_a_sweep_that_goes_on_counts_what_was_there(tmp_path):
    swept = sweep_of(tmp_path, "40 um, 50 um, 60 um")
    ended(swept, swept.points[1], "completed")
    events = []
    making._make(swept, lambda missing, folder: ((one, "completed") for one in missing), {}, events.append)
    assert [(each["done"], each["total"], each.get("run")) for each in events] == [(1, 3, None), (2, 3, 1), (3, 3, 3)]


def test_the_time_that_is_left_is_that_of_the_pace_since_a_resume(monkeypatch):
    """From 18 of 20 h on, 1 h in 10 s leaves 10 s."""
    monkeypatch.setattr(progress, "_fit", lambda bar, event: None)
    bars = []
    monkeypatch.setattr(tqdm, "tqdm", lambda **asked: bars.append(Bar(**asked)) or bars[0])
    with progress.on_a_terminal() as tell:
        tell({"event": "start", "scene": "base", "from_h": 18.0, "end_h": 20.0, "step": 90})
        tell({"event": "step", "time_h": 19.0})
        assert Bar.format_meter(**bars[0].format_dict | {"elapsed": 10.0, "rate": None}).endswith("[00:10 < 00:10]")


@pytest.mark.parametrize("value, said", [(0.00123457, "0.00123457"), (True, "yes"), (False, "no"), (None, "none"),
                                         ("1234.56789 um", "1234.57 um"), ("a b", "a b"), ([], "none"),
                                         ([1.5, "2.0 h"], "1.5, 2 h")])
def test_a_value_is_shown_with_six_digits_and_its_unit(value, said):
    assert run_page.page.shown(value) == said


def test_gears_steps_are_controlled_by_what_is_there_or_supplied():
    """After a fall of the acceptor's supply, and under a rise of the donor's."""
    _, problem = case.__wrapped__()
    start = transport.supplied_everywhere(problem)
    start = replace(start, acceptor=3 * start.acceptor, donor=start.donor / 2)
    nothing = np.zeros_like(problem.space.reaction.dx)
    scale = gear._started(problem, nothing, nothing, start)[0].scale
    assert scale.ravel().tolist() == [3 * problem.both[0].supply, problem.both[1].supply]


@EVERY_ORDER
def test_an_update_under_a_table_begins_with_what_gear_has_in_the_pore(order):
    """By the supply half way, and not with profiles that have come to rest under it."""
    table_of = 'substrates.acceptor.supply=[["0 h", "9 mg/L"], ["1 h", "29 mg/L"]]'
    scene, now = base(order, "numerics.transport=gear", table_of, "substrates.acceptor.interpolation=linear")
    solved = solve(scene, now)
    there = updates._midway(scene, now, solved, 0.2)
    assert there.concentrations is solved.concentrations and there.problem.both[0].supply == pytest.approx(11.0)
    risen = updates.step(scene, now, solved, 0.2).ledger.stored[0] / (scene.pore.width * np.ptp(now.mesh.ends))
    assert risen == pytest.approx(2.0, rel=0.05)
