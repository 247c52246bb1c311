"""What wrong changes would have altered unseen: quantities derived anew from raw fields and fabricated states, each
side, substrate, axis and row apart."""
import io
import json
import re
import shutil
from dataclasses import replace
from xml.etree import ElementTree

import matplotlib.pyplot as plt
import numpy as np
import pint
import pytest
from scipy.spatial import Delaunay

import repro
from repro import results
from repro.check import cost
from repro.errors import BalanceError, Unresolved
from repro.fem.space import Space
from repro.march import balance
from repro.march.loop import Instant, Ledger
from repro.model.pore import Solved, seeded, solve
from repro.model import gear, transport
from repro.model.transport import Fluxes
from repro.results import picture
from repro.results.quantities import UNITS
from repro.scene import load_scene
from tests.pages import whole_of
from tests.strategies import ORDERS
from tests.test_derived import EVERY_ORDER, arcs, over_end, places_of

NOTHING = Solved(None, None, None)
#: A step whose substrates and biomass balance, and its two substrates differ.
EVEN = Ledger(0.0, 1.0, (5.0, 3.0), (1.0, 1.5), (4.0, 1.5), (0.0, 0.0), 70.0, 10.0, 80.0)


def bulging(order):
    """The seed of base, swollen and leaning downstream, so that neither its ends nor its top are at nodes."""
    scene = load_scene("base", [f"numerics.elements={ORDERS[order]}", "numerics.refinement=0.5"])
    now = seeded(scene)
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
    told = [row[name] for name in ("upstream_um", "downstream_um", "thickness_um")]
    assert told == pytest.approx([x.min(), x.max(), y.max()], rel=1e-6)
    rim = now.mesh.points[now.mesh.loop]
    apart = np.abs(np.array(told) - [rim[:, 0].min(), rim[:, 0].max(), rim[:, 1].max()])
    assert apart.min() > 2e-4 if order > 1 else apart.max() == 0


@pytest.mark.parametrize("count, told", [(0, 0), (1, 1), (2, 1), (7, 1)])
def test_a_row_says_whether_any_of_its_steps_made_a_mesh(count, told):
    scene, now = bulging(1)
    assert results.row(scene, alone(now, remeshes=count))["remeshed"] == told


def test_biomass_is_told_of_a_scene_that_does_not_grow():
    scene = load_scene("initial_mesh", ["substrates={}", "aggregate.inert_fraction=0.3"])
    assert scene.growth is None
    row = results.row(scene, alone(seeded(scene)))
    told = [row[name] for name in ("inert_fraction", "biomass_density_min", "biomass_density_max")]
    assert told == pytest.approx([0.3, 1.0, 1.0], rel=1e-12) and row["biomass_balance"] is None


UNLIKE = ['substrates.acceptor.supply="9 mg/L"', 'substrates.donor.supply="4 mg/L"', "numerics.refinement=0.3"]


@pytest.mark.parametrize("k, name", [(0, "acceptor"), (1, "donor")])
def test_each_substrates_defect_is_over_its_own_terms(k, name):
    """Of a row's own fluxes without a step, and with Gear over what the meshed part holds at the supply."""
    scene = load_scene("base", UNLIKE)
    now = seeded(scene)
    solved = solve(scene, now)
    fluxes = [Fluxes(5.0, 1.0, 4.0, 9.0, 8.0), Fluxes(3.0, 1.5, 1.5, 4.0, 3.0)]
    fluxes[k] = replace(fluxes[k], out=fluxes[k].out - 0.06)
    lacking = {f"{each}_balance": 0.0 for each in ("acceptor", "donor")}
    row = results.row(scene, Instant(now, replace(solved, fluxes=tuple(fluxes)), None, (), 0, {}))
    wanted = lacking | {f"{name}_balance": 0.06 / fluxes[k].supplied}
    assert {key: row[key] for key in wanted} == pytest.approx(wanted, rel=1e-9, abs=1e-12)

    gear_scene = load_scene("base", [*UNLIKE, "numerics.transport=gear"])
    stored = [0.0, 0.0]
    stored[k] = -7.0
    row = results.row(gear_scene, Instant(now, solved, None, (replace(EVEN, stored=tuple(stored)),), 0, {}))
    first, last = now.mesh.ends
    held = getattr(gear_scene.substrates, name).supply * (last - first) * gear_scene.pore.width
    wanted = lacking | {f"{name}_balance": 7.0 / held}
    assert {key: row[key] for key in wanted} == pytest.approx(wanted, rel=1e-9, abs=1e-12)


@EVERY_ORDER
def test_stress_is_told_only_of_strain_since_the_start(order):
    """New biomass that is born stress-free has none to tell; what is known besides stays."""
    found = {}
    for born in ("stressed", "stress_free"):
        scene = load_scene("base", [f"numerics.elements={ORDERS[order]}", f"growth.new_biomass={born}",
                                    "numerics.refinement=0.3"])
        now = seeded(scene)
        grid = results.fields(scene, now, NOTHING)
        found[born] = {*grid.point_data, *grid.cell_data}
    of_stress = {name for name in found["stressed"] if name.endswith("_MPa")}
    assert len(of_stress) == 6 and found["stress_free"] == found["stressed"] - of_stress
    assert {"theta", "J", "displacement_um"} <= found["stress_free"]


@pytest.mark.parametrize("time", [1 / 3, 19.38000000000001, 12345.678901])
def test_times_of_fields_keep_every_digit(time, tmp_path):
    """In the index of the fields, and in the field data of each."""
    results.write_index(tmp_path / "fields.pvd", [(0.0, "a.vtu"), (time, "b.vtu")])
    told = [float(entry.get("timestep")) for entry in ElementTree.parse(tmp_path / "fields.pvd").iter("DataSet")]
    assert told == [0.0, time]
    scene, now = bulging(1)
    results.write_fields(tmp_path / "b.vtu", results.fields(scene, replace(now, time=time), NOTHING))
    (entry,) = ElementTree.parse(tmp_path / "b.vtu").findall(".//FieldData/DataArray")
    assert entry.get("Name") == "TimeValue" and float(entry.text) == time


#: What the package's own units are of the units that names end in.
OWN = {"_m_per_d": "um/h", "_mg_per_L": "mg/L", "_pg_per_m": "pg/m", "_ug_per_m": "pg/m", "_ug_per_m_per_h": "pg/m/h",
       "_um2": "um^2", "_um": "um", "_cm": "um", "_h": "h", "_s": "s", "_MPa": "MPa"}


def test_units_are_what_their_factors_make_of_the_packages_own():
    """By pint: as UDUNITS writes them, "m d-1", and as a reader does."""
    registry = pint.UnitRegistry()
    assert OWN.keys() == UNITS.keys()
    for ending, own in OWN.items():
        of = UNITS[ending]
        powers = re.sub(r"([a-zA-Z])(-?[0-9])", r"\1**\2", of.udunits).replace(" ", "*")
        for text in (powers, of.shown.replace("²", "**2")):
            assert registry.Quantity(1, own).to(text).magnitude == pytest.approx(of.factor, rel=1e-12), ending


LEAKY = {"acceptor": ("out", 0), "donor": ("out", 1), "biomass": ("biomass_after", None)}


@pytest.mark.parametrize("part", LEAKY)
@pytest.mark.parametrize("transfer", ["conserving", "bounded"])
def test_a_step_that_lacks_a_millionth_stops_the_run(transfer, part):
    """Whichever transfer conserves; the linear one's loss of biomass alone is stated [E8]."""
    scene = load_scene("base", [f"numerics.transfer={transfer}"])
    law = scene.kinetics
    grown = law.yield_coefficient * EVEN.consumed[1]
    spent = (EVEN.consumed[0] - law.acceptor_to_donor_ratio * EVEN.consumed[1]) / law.decay_oxygen_demand
    even = replace(EVEN, biomass_made=grown - spent, biomass_after=EVEN.biomass_before + grown - spent)
    balance.refuse(scene, None, even)
    key, k = LEAKY[part]
    value = getattr(even, key)
    more = value * (1 + 2e-5) if k is None else tuple(one + 1e2 * (i == k) for i, one in enumerate(value))
    with pytest.raises(BalanceError, match=f"of the {part}"):
        balance.refuse(scene, now_of(scene), replace(even, **{key: more}))


def now_of(scene):
    return seeded(replace(scene, numerics=replace(scene.numerics, refinement=0.3)))


def test_a_picture_has_upstream_on_the_left_and_the_upper_wall_above():
    """A field that rises along x and y: dark below upstream, light above downstream, the aggregate upstream below."""
    x, y = (each.ravel() for each in np.meshgrid(np.linspace(-10, 30, 9), np.linspace(0, 20, 5)))
    cells = Delaunay(np.column_stack([x, y])).simplices
    middle = np.column_stack([x, y])[cells].mean(axis=1)
    shown = {"places_um": np.column_stack([x, y]), "triangles": cells,
             "region": ((middle[:, 0] < 0) & (middle[:, 1] < 10)).astype(float)}
    pixels = plt.imread(io.BytesIO(picture.png(shown, x + 3 * y)))[..., :3]
    bright = pixels.sum(axis=2)
    corners = {"below upstream": bright[-1, 0], "below downstream": bright[-1, -1], "above upstream": bright[0, 0],
               "above downstream": bright[0, -1]}
    assert list(corners.values()) == sorted(corners.values())
    rows, columns = np.argwhere((pixels == 1).all(axis=2)).T
    height, width = bright.shape
    assert rows.min() > 0.45 * height and rows.max() == height - 1
    assert columns.min() == 0 and columns.max() < 0.26 * width


def test_key_figures_tell_first_and_last_values_and_the_first_contact():
    columns = {"time_h": np.array([0.0, 1.5, 2.5, 7.0]), "thickness_um": np.array([5.0, 19.0, 20.0, 21.0]),
               "contact": np.array([0, 0, 1, 1])}
    told = picture.key_figures(columns)
    assert "thickness of the aggregate 5 → 21 um" in told and "wall from t = 2.5 h on" in told
    assert "opposite wall" not in picture.key_figures({**columns, "contact": np.zeros(4)})


@EVERY_ORDER
def test_without_flow_the_ends_are_means_over_their_height(order):
    """Of fields that are no plane, inlet and outlet apart, by Gauss's rule along each end."""
    closed = ["numerics.transport=gear", "substrates.boundary=closed", f"numerics.elements={ORDERS[order]}"]
    scene = load_scene("base", [*UNLIKE, *closed], unset=["flow"])
    now = seeded(scene)
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
    scene = load_scene("base", [*UNLIKE, f"numerics.elements={ORDERS[order]}"])
    made = transport.problem(Space(seeded(scene).mesh, order), None, scene.substrates, scene.kinetics)
    assert gear._lowest(made) == (0.0 if order == 1 else -9e-3)
    for k, supply in enumerate((9.0, 4.0)):
        for part, accepted in ((-9e-4, True), (-1.1e-3, False), (1.019, True), (1.021, order == 1)):
            state = made.supply.copy()
            state[k * made.space.count + 7] = part * supply
            if accepted:
                transport._checked(made, state, 1)
            else:
                with pytest.raises(Unresolved, match=("acceptor", "donor")[k]):
                    transport._checked(made, state, 1)


@pytest.mark.parametrize("status", ["interrupted", "failed: out of memory", "the aggregate reaches the pore's end"])
def test_a_run_that_is_loaded_says_how_it_ended(status, tmp_path):
    folder = shutil.copytree(whole_of(load_scene("flow_only")), tmp_path / "run")
    record = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps({**record, "status": status}))
    assert repro.load_run(folder).status == status


def test_memory_and_time_are_expected_to_grow_with_the_mesh():
    """What a trial took beyond the program goes with the nodes, seconds with their power of 1.2; of no growth."""
    scene = load_scene("flow_only")
    trial = cost.Trial(None, 2.0, 0.5, 1000, (100.0, 180.0))
    one, four = (cost.expected(scene, trial, nodes) for nodes in (1000, 4000))
    assert one.memory - 100 == pytest.approx(80 * cost.REMESHING) and one.seconds == pytest.approx(2.0)
    assert four.memory - 100 == pytest.approx(4 * (one.memory - 100)) and four.seconds == pytest.approx(2.0 * 4**1.2)
