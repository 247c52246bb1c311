"""What wrong changes would have altered unseen: quantities derived anew from raw fields and fabricated states, each
side, substrate, axis and row apart."""
import inspect
import io
import json
import re
import shutil
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import matplotlib.pyplot as plt
import numpy as np
import pytest
from scipy.spatial import Delaunay

import repro
from repro import results, timing
from repro.check import cost, numbers
from repro.check.modelled import modelled
from repro.errors import BalanceError, TransportError, Unresolved
from repro.march import balance, stepping, updates
from repro.march.loop import Instant, Ledger
from repro.march.simulation import shaped
from repro.model import contact, gear, mesh_motion, remeshing, traction, transport
from repro.model.pore import Solved, resolution, seeded, solve
from repro.model.transport import Fluxes
from repro.report import comparison, quantities
from repro.report.reading import Run
from repro.results import picture
from repro.run import running
from repro.run.recorder import Recorder
from repro.scene import load_scene
from repro.sweep import page, table
from repro.sweep.design import grid, parse, points
from repro.sweep.state import Sweep
from tests import oracles
from tests.pages import whole_of
from tests.shell import told
from tests.strategies import ORDERS, constants
from tests.test_derived import EVERY_ORDER, arcs, over_end, places_of
from tests.test_gear import case, storage

NOTHING = Solved(None, None, None)
#: A step whose substrates balance; they differ.
EVEN = Ledger(0.0, 1.0, (5.0, 3.0), (1.0, 1.5), (4.0, 1.5), (0.0, 0.0), 70.0, 10.0, 80.0)
UNLIKE = ['substrates.acceptor.supply="9 mg/L"', 'substrates.donor.supply="4 mg/L"', "numerics.refinement=0.3"]


def base(order, *changes, unset=()):
    """(scene, its seed) with coarse elements of an order, and supplies that differ."""
    scene = load_scene("base", [*UNLIKE, f"numerics.elements={ORDERS[order]}", *changes], unset)
    return scene, seeded(scene)


def bulging(order):
    """The seed of base, swollen and leaning downstream, so that neither its ends nor its top are at nodes."""
    scene, now = base(order, "numerics.refinement=0.5")
    x, y = now.mesh.points.T
    near = np.exp(-(x**2 + y**2) / 100)
    return scene, now.moved(np.column_stack([(x * (1 + 0.2 * y) + 0.1 * y) * near + x * (1 - near),
                                             y * (1 + 0.05 * x * near)]))


def alone(now, **more):
    """An Instant of a pore in which nothing is solved."""
    return Instant(now, NOTHING, None, **{"ledgers": (), "remeshes": 0, "iterations": {}, **more})


@EVERY_ORDER
def test_ends_and_top_are_those_of_the_boundary_between_its_nodes(order):
    """Of arcs sampled to 1e-6; the nodes alone are off by 4e-4 um or more."""
    scene, now = bulging(order)
    row = results.row(scene, alone(now))
    x, y = arcs(now).T
    ends = np.array([row[name] for name in ("upstream_um", "downstream_um", "thickness_um")])
    assert ends == pytest.approx([x.min(), x.max(), y.max()], rel=1e-6)
    x, y = now.mesh.points[now.mesh.loop].T
    apart = np.abs(ends - [x.min(), x.max(), y.max()])
    assert apart.min() > 2e-4 if order > 1 else apart.max() == 0


def test_a_row_says_whether_any_of_its_steps_made_a_mesh():
    scene, now = base(1)
    assert [results.row(scene, alone(now, remeshes=count))["remeshed"] for count in (0, 1, 2, 7)] == [0, 1, 1, 1]


def test_biomass_is_told_of_a_scene_that_does_not_grow():
    scene = load_scene("initial_mesh", ["substrates={}", "aggregate.inert_fraction=0.3"])
    row = results.row(scene, alone(seeded(scene)))
    known = [row[name] for name in ("inert_fraction", "biomass_density_min", "biomass_density_max")]
    assert known == pytest.approx([0.3, 1.0, 1.0], rel=1e-12) and row["biomass_balance"] is None


@pytest.mark.parametrize("k, name", [(0, "acceptor"), (1, "donor")])
def test_each_substrates_defect_is_over_its_own_terms(k, name):
    """Of a row's own fluxes without a step, and with Gear over what the meshed part holds at the supply."""
    scene, now = base(1)
    solved = solve(scene, now)
    fluxes = [Fluxes(5.0, 1.0, 4.0, 9.0, 8.0), Fluxes(3.0, 1.5, 1.5, 4.0, 3.0)]
    fluxes[k] = replace(fluxes[k], out=fluxes[k].out - 0.06)
    lacking = {f"{each}_balance": 0.0 for each in ("acceptor", "donor")}
    row = results.row(scene, Instant(now, replace(solved, fluxes=tuple(fluxes)), None, (), 0, {}))
    wanted = lacking | {f"{name}_balance": 0.06 / fluxes[k].supplied}
    assert {key: row[key] for key in wanted} == pytest.approx(wanted, rel=1e-9, abs=1e-12)
    scene = load_scene("base", [*UNLIKE, "numerics.transport=gear"])
    step = replace(EVEN, stored=tuple(-7.0 * (each == k) for each in (0, 1)))
    row = results.row(scene, Instant(now, solved, None, (step,), 0, {}))
    held = getattr(scene.substrates, name).supply * np.ptp(now.mesh.ends) * scene.pore.width
    wanted = lacking | {f"{name}_balance": 7.0 / held}
    assert {key: row[key] for key in wanted} == pytest.approx(wanted, rel=1e-9, abs=1e-12)


@EVERY_ORDER
def test_stress_is_told_only_of_strain_since_the_start(order):
    """New biomass that is born stress-free has none to tell; what is known besides stays."""
    found = {}
    for born in ("stressed", "stress_free"):
        made = results.fields(*base(order, f"growth.new_biomass={born}"), NOTHING)
        found[born] = {*made.point_data, *made.cell_data}
    of_stress = {name for name in found["stressed"] if name.endswith("_MPa")}
    assert len(of_stress) == 6 and found["stress_free"] == found["stressed"] - of_stress
    assert {"theta", "J", "displacement_um"} <= found["stress_free"]


@pytest.mark.parametrize("time", [1 / 3, 19.38000000000001, 12345.678901])
def test_times_of_fields_keep_every_digit(time, tmp_path):
    """In the index of the fields, and in the field data of each."""
    results.write_index(tmp_path / "fields.pvd", [(0.0, "a.vtu"), (time, "b.vtu")])
    entries = ElementTree.parse(tmp_path / "fields.pvd").iter("DataSet")
    assert [float(entry.get("timestep")) for entry in entries] == [0.0, time]
    scene, now = base(1)
    results.write_fields(tmp_path / "b.vtu", results.fields(scene, replace(now, time=time), NOTHING))
    (entry,) = ElementTree.parse(tmp_path / "b.vtu").findall(".//FieldData/DataArray")
    assert entry.get("Name") == "TimeValue" and float(entry.text) == time


LEAKY = {"acceptor": ("out", 0), "donor": ("out", 1), "biomass": ("biomass_after", None)}


@pytest.mark.parametrize("part", LEAKY)
@pytest.mark.parametrize("transfer", ["conserving", "bounded"])
def test_a_step_that_lacks_a_millionth_stops_the_run(transfer, part):
    """Whichever transfer conserves; the linear one's loss of biomass alone is stated [E8]."""
    scene, now = base(1, f"numerics.transfer={transfer}")
    law = scene.kinetics
    grown = law.yield_coefficient * EVEN.consumed[1]
    spent = (EVEN.consumed[0] - law.acceptor_to_donor_ratio * EVEN.consumed[1]) / law.decay_oxygen_demand
    even = replace(EVEN, biomass_made=grown - spent, biomass_after=EVEN.biomass_before + grown - spent)
    balance.refuse(scene, now, even)
    key, k = LEAKY[part]
    value = getattr(even, key)
    more = value * (1 + 2e-5) if k is None else tuple(one + 1e2 * (i == k) for i, one in enumerate(value))
    with pytest.raises(BalanceError, match=f"of the {part}"):
        balance.refuse(scene, now, replace(even, **{key: more}))


def test_a_picture_has_upstream_on_the_left_and_the_upper_wall_above():
    """A field that rises along x and y: dark below upstream, light above downstream, the aggregate upstream below."""
    x, y = (each.ravel() for each in np.meshgrid(np.linspace(-10, 30, 9), np.linspace(0, 20, 5)))
    cells = Delaunay(np.column_stack([x, y])).simplices
    middle = np.column_stack([x, y])[cells].mean(axis=1)
    shown = {"places_um": np.column_stack([x, y]), "triangles": cells,
             "region": ((middle[:, 0] < 0) & (middle[:, 1] < 10)).astype(float)}
    pixels = plt.imread(io.BytesIO(picture.png(shown, x + 3 * y)))[..., :3]
    bright = pixels.sum(axis=2)
    below, above = (bright[row, [0, -1]].tolist() for row in (-1, 0))
    assert below + above == sorted(below + above)
    rows, columns = np.argwhere((pixels == 1).all(axis=2)).T
    height, width = bright.shape
    assert rows.min() > 0.45 * height and rows.max() == height - 1
    assert columns.min() == 0 and columns.max() < 0.26 * width


def test_key_figures_tell_first_and_last_values_and_the_first_contact():
    columns = {"time_h": np.array([0.0, 1.5, 2.5, 7.0]), "thickness_um": np.array([5.0, 19.0, 20.0, 21.0]),
               "contact": np.array([0, 0, 1, 1])}
    said = picture.key_figures(columns)
    assert "thickness of the aggregate 5 → 21 um" in said and "wall from t = 2.5 h on" in said
    assert "opposite wall" not in picture.key_figures({**columns, "contact": np.zeros(4)})


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
def test_a_concentration_may_leave_its_bounds_by_as_much_as_is_said(order):
    """Steady or with Gear's method: below zero by a thousandth of the supply, above it, with curved elements, by a
    fiftieth; each substrate by its own."""
    scene, now = base(order)
    made = transport.problem(now.space, None, scene.substrates, scene.kinetics)
    assert gear._lowest(made)[:, 0] == pytest.approx([0.0, 0.0] if order == 1 else [-9e-3, -4e-3], rel=1e-12)
    for k, supply in enumerate((9.0, 4.0)):
        for part, accepted in ((-9e-4, True), (-1.1e-3, False), (1.019, True), (1.021, order == 1)):
            state = made.supply.copy()
            state[k * made.space.count + 7] = part * supply
            refused = pytest.raises(Unresolved, match=("acceptor", "donor")[k])
            with nullcontext() if accepted else refused:
                transport._checked(made, state, 1)


@pytest.mark.parametrize("status", ["interrupted", "failed: out of memory", "the aggregate reaches the pore's end"])
def test_a_run_that_is_loaded_says_how_it_ended(status, tmp_path):
    folder = shutil.copytree(whole_of(load_scene("flow_only")), tmp_path / "run")
    (folder / "run.json").write_text(json.dumps({**told(folder), "status": status}))
    assert repro.load_run(folder).status == status


def test_memory_and_time_are_expected_to_grow_with_the_mesh():
    """What a trial took beyond the program goes with the nodes, seconds with their power of 1.2; of no growth."""
    scene = load_scene("flow_only")
    trial = cost.Trial(None, 2.0, 0.5, 1000, (100.0, 180.0))
    one, four = (cost.expected(scene, trial, nodes) for nodes in (1000, 4000))
    assert one.memory - 100 == pytest.approx(80 * cost.REMESHING) and one.seconds == pytest.approx(2.0)
    assert four.memory - 100 == pytest.approx(4 * (one.memory - 100)) and four.seconds == pytest.approx(2.0 * 4**1.2)


@pytest.mark.parametrize("start", [0.1, 0.3, 0.7, 1.1, 2.3, 19.1])
def test_a_step_ends_at_a_jump_to_the_last_bit(start):
    """Wherever it began, so that what holds after it is the new value."""
    now = replace(base(1)[1], time=start)
    rounded = 0
    for corner in start + np.arange(1, 50) / 7:
        for left in (corner - start) * np.array([1 - 4e-16, 1.0, 1 + 4e-16]):
            assert stepping._end_of(now, left, corner) == corner
            assert stepping._end_of(now, left - 1e-3, corner) == start + (left - 1e-3)
            rounded += start + left != corner
    assert rounded, "else nothing is put right"


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
    rates = [printed(scene, now, state) for state in (solved.concentrations, end)]
    growth, remains = np.mean(rates, axis=0)
    assert np.abs(rates[0] / rates[1] - 1).max(axis=(1, 2)).min() > 1e-4, "else the start would do"
    assert after.active == pytest.approx(now.active * np.exp(2 * growth), rel=1e-12)
    made = now.active * np.expm1(2 * growth) / growth * remains
    assert after.inert - now.inert == pytest.approx(made, rel=1e-9)


def printed(scene, now, state):
    """(2, r, q) F3 / X_A and F4 / X_A, 1/h."""
    pieces = now.space.reaction
    both = (field[pieces.cells] @ pieces.values.T for field in (state.acceptor, state.donor))
    return np.array(oracles.rates(*both, **constants(scene))[2:])


@EVERY_ORDER
def test_the_expansion_grows_with_the_mass_there_is(order):
    """By (28)-(29) with straight triangles, by what X_A + X_I grow over X_m, in the mean of the corners; with curved
    ones as the mass of each point, so that no error of a density stays."""
    scene, now, _ = uneven(order)
    grown = replace(now, active=1.3 * now.active, inert=now.inert + 0.1 * now.active)
    found = updates.enlarged(scene, now, grown)
    before = now.active + now.inert
    more = grown.active + grown.inert - before
    wanted = 1.5 * (1 + more / before)
    if order == 1:
        of_node = np.full(len(now.mesh.points), np.nan)
        of_node[now.space.reaction.cells] = more / now.space.reaction.dx / scene.kinetics.maximum_density
        wanted = 1.5 * (1 + of_node[now.mesh.triangles[now.mesh.biomass]].mean(axis=1, keepdims=True))
    assert found == pytest.approx(wanted, rel=1e-12)


@EVERY_ORDER
@pytest.mark.parametrize("speed", [0.0, 2e5])
def test_beyond_the_old_mesh_there_is_what_flows_or_diffuses_there(speed, order):
    """Upstream the decay of (26) with each substrate's own diffusivity, downstream what leaves; without flow the supply
    at either end."""
    scene, now = base(order)
    old = now.space
    new = base(order, "numerics.extent=full")[1].space
    state = transport.Concentrations(3 + 0.01 * places_of(old)[:, 0], 2 - 0.02 * places_of(old)[:, 0])
    found = remeshing.carried_substrates(scene, old, new, state, speed)
    x, (first, last) = places_of(new)[:, 0], old.mesh.ends
    assert x.min() < first - 50 and x.max() > last + 50
    for name, slope, start in (("acceptor", 0.01, 3), ("donor", -0.02, 2)):
        kind = getattr(scene.substrates, name)
        wanted = start + slope * np.clip(x, first, last)
        if speed:
            faded = np.exp(speed * np.minimum(x - first, 0) / kind.diffusivity)
            wanted = kind.supply - (kind.supply - wanted) * faded
        else:
            wanted[(x < first) | (x > last)] = kind.supply
        apart = (np.abs(x - first) > 1e-9) & (np.abs(x - last) > 1e-9)
        assert getattr(found, name)[apart] == pytest.approx(wanted[apart], rel=1e-9), name


@EVERY_ORDER
def test_every_amount_that_is_carried_keeps_its_own_sum(order):
    """Active and inert biomass, and two more of the same material: rough ones, to 1e-12."""
    scene, now, _ = uneven(order)
    full = scene.kinetics.maximum_density * now.space.reaction.dx
    inert, *others = full * np.random.default_rng(3).uniform(0.0, 0.3, (3, *full.shape))
    now = replace(now, active=full - inert, inert=inert)
    finer = replace(scene, numerics=replace(scene.numerics, refinement=0.47))
    after, carried = remeshing.remesh(finer, now, now, 0.0, tuple(others))
    assert len(after.mesh.points) > 1.2 * len(now.mesh.points)
    sums = [inert.sum(), *(one.sum() for one in others)]
    assert [after.inert.sum(), *(one.sum() for one in carried)] == pytest.approx(sums, rel=1e-12)
    assert after.mass == pytest.approx(now.mass, rel=1e-12 if order == 1 else 1e-9)


def test_a_plug_ends_in_quarter_discs_and_its_pressure_drops_over_its_whole_length():
    """In SI units, by hand: the area of wall to wall with quarter discs at its four ends, and 12 lambda rho nu u / W^2
    over twice the reach."""
    scene = load_scene("wide", ['flow.mean_velocity="2.9 m/day"', 'growth.end="45 h"'])
    width = scene.pore.width
    for area in (1.6 * width**2, 4 * width**2):
        reach = numbers.sizes(scene, area).reach
        assert 2 * (reach - width) * width + np.pi / 2 * width**2 == pytest.approx(area, rel=1e-12)
    end = numbers.at_end(scene)
    assert end.contact is not None
    drop = 12 * 2000 * 998 * 1.003e-6 * 2.9 / 86400 / (width * 1e-6) ** 2 * 2 * end.reach * 1e-6 / 1e4
    assert numbers.stresses(scene, scene.flow.mean_velocity)[1] == pytest.approx(drop, rel=1e-12)


def of(name, scale):
    """A run of three rows whose numbers go with a scale, but for its times."""
    series = {column: scale * (1.0 + k + np.array([0.1, 0.2, 0.4])) for k, column in enumerate(results.COLUMNS)}
    series |= {"time_h": np.array([0.0, 1.0, 3.0]), "upstream_um": scale * np.array([-5.0, -6.0, -8.0])}
    return Run(Path("runs") / name, {"scene": name}, series, {})


def test_runs_are_compared_under_their_own_names_with_signs():
    """The first run need not be the first by name; a tip further upstream, at a smaller x, is a fall."""
    runs = [of("zeta", 1.0), of("alpha", 1.5), of("mu", 0.5)]
    labels = [run.folder.name for run in runs]
    assert comparison.short([run.folder for run in runs]) == labels
    for chart in quantities.overlaid(runs, labels):
        assert [line.label for line in chart.lines] == labels, chart.title
        if chart.title != "Mesh: made anew":
            assert [line.values[-1] / chart.lines[0].values[-1] for line in chart.lines] == pytest.approx([1, 1.5, 0.5])
    made = comparison.build(runs)
    (row,) = re.findall("<tr><td>upstream end of the aggregate.*?</tr>", made)
    assert re.findall('class="value">([^<]*)<', row) == ["-8", "-12", "-50 %", "-4", "+50 %"]


@EVERY_ORDER
def test_the_mesh_moves_with_the_scenes_own_constants(order, monkeypatch):
    """gamma of (35) and c of its stabilisation, in steps and around what the fluid pushes."""
    seen, move = [], mesh_motion.move

    def noted(*given, **named):
        seen.append(inspect.signature(move).bind(*given, **named).arguments)
        return move(*given, **named)

    monkeypatch.setattr(mesh_motion, "move", noted)
    scene, now = base(order, "numerics.mesh_compressibility=3", "numerics.flow_stabilisation=40")
    places = now.mesh.points.copy()
    places[now.mesh.body] *= 1.01
    assert remeshing.followed(scene, now, now.moved(places)) is not None
    traction.forces(scene, traction.surroundings(scene, now, now), now.moved(places))
    assert [(one["compressibility"], one["stabilisation"]) for one in seen] == [(3, 40), (3, 40)]


@EVERY_ORDER
def test_a_mesh_is_left_where_its_edges_are_too_long_for_a_film(order):
    """The same shape, over which a film of 2.5 um is left, on a mesh made for elements three times as large."""
    narrow = ('pore.width="20 um"', 'aggregate.radius="17.5 um"')
    coarse, now = base(order, *narrow, "numerics.refinement=0.6")
    fine = replace(coarse, numerics=replace(coarse.numerics, refinement=1.8))
    assert now.mesh.acceptable() and remeshing.followed(coarse, now, now) is not None
    assert remeshing.followed(fine, now, now) is None


@EVERY_ORDER
def test_the_fluid_pushes_as_its_drive_does_at_the_time(order):
    """Forces go as the head of a table at the pore's time, after a jump as in a slope."""
    course = '[["0 h", "1e-3 cm"], ["1 h", "4e-3 cm"], ["3 h", "2e-3 cm"]]'
    scene, now = base(order, f"flow.head={course}", "flow.interpolation=linear")
    around = traction.surroundings(scene, now, now)
    pushes = [traction.forces(scene, around, replace(now, time=time)) for time in (0.0, 1.0, 2.0, 5.0)]
    assert np.abs(pushes[0]).max() > 0
    for push, factor in zip(pushes, (1.0, 4.0, 3.0, 2.0)):
        assert push == pytest.approx(factor * pushes[0], rel=1e-9, abs=1e-12 * np.abs(pushes[0]).max())


def test_what_slows_the_water_is_told_in_the_units_of_the_scene():
    scene, _ = base(2, "flow.biomass=brinkman", 'flow.permeability="2.5e-15 m^2"')
    assert "an aggregate with a permeability of 2.5e-15 m2" in dict(modelled(scene))["flow"]


@pytest.mark.parametrize("key, values", [("mean_velocity", ("1 m/day", "80 m/day", "4 m/day")),
                                         ("head", ("1e-3 cm", "1e-2 cm", "2e-3 cm"))])
def test_meshes_are_fine_enough_for_the_fastest_flow_to_come(key, values):
    """Those of curved elements, under a table as under its largest value from the start."""
    sets = ["numerics.preset=fast", "numerics.refinement=0.05"]
    course = json.dumps([[f"{k} h", value] for k, value in enumerate(values)])
    slow, fast, over_time = (resolution(load_scene("base", [*sets, f"flow.{key}={value}"], unset=["flow.head"]))
                             for value in (*values[:2], course))
    assert over_time == fast > 1.5 * slow


def test_clogged_runs_are_dots_at_their_time_and_others_stand_at_their_end(tmp_path):
    """Of two runs over 8 h the first has clogged at 5 h."""
    factors = [parse("pore.width=40 um, 50 um")]
    found = points("flow_only", [], factors, grid(factors))
    numbers_of = [{**dict.fromkeys(table.COLUMNS), "clogging_time_h": time} for time in (5.0, None)]
    times, course = np.array([0.0, 8.0]), np.array([1.0, 0.2])
    runs = [table.Told(point, "completed", times, course, course, each) for point, each in zip(found, numbers_of)]
    made = page.page(Sweep(tmp_path, "base", factors, found), runs, 0.1)
    (dot,) = re.findall("<circle [^>]*><title>([^<]*)", made)
    (hollow,) = re.findall("<polygon [^>]*><title>([^<]*)", made)
    assert dot.startswith("run 1") and dot.endswith(": 5 h")
    assert hollow.startswith("run 2") and hollow.endswith(": after 8 h")


def test_times_by_stage_are_those_before_a_resume_and_since(tmp_path, monkeypatch):
    monkeypatch.setattr(timing, "seconds", {"growth": 2.0, "transfer": 4.0})
    one = Recorder(load_scene("base"), tmp_path)
    one.record.stages, one.record.seconds = {"flow": 8.0, "growth": 16.0}, 1000.0
    one.tell("running")
    record = told(tmp_path)
    assert record["wall_time_by_stage_s"] == {"flow": 8.0, "growth": 18.0, "transfer": 4.0}
    assert 1000 < record["wall_time_s"] < 1100


def test_a_longer_run_is_judged_by_its_first_velocity(tmp_path):
    """Under a head the velocity falls as the pore clogs, and with it the numbers that are warned of."""
    one = Recorder(load_scene("base"), tmp_path)
    at = results.COLUMNS.index("mean_velocity_m_per_d")
    one.record.rows = [[None] * at + [speed] for speed in (24.0, 2.4, 0.024)]
    assert one.first_velocity == pytest.approx(1e6, rel=1e-12)


@pytest.mark.parametrize("key", ["blas", "libc", "geos", "machine", "system", "source"])
def test_a_resume_elsewhere_is_told(key, tmp_path, monkeypatch, recwarn):
    """Whatever could change the numbers, but for threads, which do not."""
    one = Recorder(load_scene("flow_only"), tmp_path)
    one.tell("running")
    before = told(tmp_path)
    now = {**before["conditions"], "threads": {"OMP_NUM_THREADS": "7"}}
    monkeypatch.setattr(running, "conditions", lambda: now)
    assert running._changed(before, one, running.ALONE) == {} and not recwarn.list
    now[key] = "another"
    with pytest.warns(UserWarning, match=f"conditions.{key} .*now another"):
        running._changed(before, one, running.ALONE)


LEANING = [(-21, 0), (-19, 9), (-12, 17), (-6, 20), (4, 20), (12, 12), (17, 0)]


@EVERY_ORDER
@pytest.mark.parametrize("fixed_point", ["kept", "rechosen"])
def test_each_contact_surface_has_its_own_fixed_point(fixed_point, order):
    """The corners nearest to the middles of both, -2 and -1 um, whichever was fixed before."""
    scene = shaped(base(order, 'pore.width="20 um"', f"numerics.fixed_point={fixed_point}")[0], LEANING)
    now = seeded(scene)
    if fixed_point == "rechosen":
        now = replace(now, fixed=np.roll(now.fixed, 2))
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
    taken = gear.advance(drained, nothing, nothing, start, 10.005e-6)
    assert taken.concentrations.acceptor == pytest.approx(np.full(problem.space.count, -5e-3), rel=1e-6)
    with pytest.raises(TransportError, match="the acceptor becomes negative"):
        gear.advance(drained, nothing, nothing, start, 10.05e-6)
