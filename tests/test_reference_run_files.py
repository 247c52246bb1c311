"""The judge of a run's files: an intact run passes, and each check detects its damage."""
import csv
import shutil

import numpy as np
import pytest

from reference import run_files
from repro.results import field_files
from repro.runs.execution import run
from repro.scene import load_scene

TABLES = {"pore": {"width": "50 um"}, "aggregate": {"radius": "15 um"}, "flow": {"head": "1e-3 cm"}, "substrates": {},
          "growth": {"end": "2 h"}, "numerics": {"preset": "fast"}, "output": {"times": ["0 h", "1 h", "2 h"]}}


@pytest.fixture(scope="module")
def intact(tmp_path_factory):
    folder = tmp_path_factory.mktemp("good") / "run"
    run(load_scene(TABLES), folder)
    return folder


def changed(**sections):
    """The tables with further keys or substrates in some sections."""
    return {**TABLES, **{name: {**TABLES.get(name, {}), **keys} for name, keys in sections.items()}}


def failed(folder, tables=TABLES):
    """Names, without times, of the checks that fail."""
    return {check_name(finding) for finding in run_files.findings(run_files.Run(folder, tables)) if not finding.holds}


def check_name(finding):
    return finding.quantity.split(", t = ")[0]


def cell(file, column, change, row=-1):
    """A function that damages one cell of a table."""
    def damage(folder):
        path = folder / file
        with path.open(newline="") as opened:
            rows = list(csv.reader(opened))
        k = rows[0].index(column)
        rows[row][k] = repr(float(change(float(rows[row][k]))))
        with path.open("w", newline="") as opened:
            csv.writer(opened).writerows(rows)
    return damage


def series(column, change, row=-1):
    return cell("timeseries.csv", column, change, row)


def ledger(column, change, row=-1):
    return cell("ledger.csv", column, change, row)


def field(change):
    """A function that damages the last file of fields by change(grid)."""
    def damage(folder):
        path = sorted((folder / "fields").glob("fields_*.vtu"))[-1]
        grid = field_files.read(path)
        change(grid)
        field_files.write(path, grid)
    return damage


def node(name, value, at=lambda mesh: 0):
    """A function that damages one node's value."""
    def change(mesh):
        mesh.point_data[name][at(mesh)] = value
    return field(change)


def scaled(name, factor, data="point_data"):
    """A function that scales an array."""
    def change(mesh):
        arrays = getattr(mesh, data)
        arrays[name] = arrays[name] * factor
    return field(change)


def turn_triangle(mesh):
    """Turn a triangle over."""
    mesh.cells[0] = mesh.cells[0, [1, 0, 2, 3, 5, 4]]


def move_outlet_corner(mesh):
    """Move a corner of the outlet out of the pore."""
    mesh.points[mesh.points[:, 0].argmax(), 1] -= 1.0
    mesh.points[mesh.points[:, 1].argmin(), 1] -= 1.0


def forgotten(folder):
    """Remove the last file from the index of the fields."""
    path = folder / "fields.pvd"
    lines = path.read_text().splitlines()
    lines.remove([line for line in lines if "DataSet" in line][-1])
    path.write_text("\n".join(lines))


def unfinished(folder):
    """Remove the last row of the table and its fields; the record still states that the run is complete."""
    path = folder / "timeseries.csv"
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:-1]))
    forgotten(folder)


def at_wall(mesh):
    return np.flatnonzero(mesh.points[:, 1] == 0)[0]


def inside_outlet(mesh):
    x, y = mesh.points[:, :2].T
    return np.flatnonzero((x == x.max()) & (y > 10) & (y < 40))[0]


def plus(amount):
    return lambda value: value + amount


def times(factor):
    return lambda value: value * factor


#: Damages, and the check that detects each.
DAMAGES = [
    (series("donor_min_mg_per_L", lambda _: np.nan), "numbers that are not finite"),
    (scaled("J", np.nan, "cell_data"), "numbers that are not finite"),
    (scaled("surface_stretch", np.nan, "cell_data"), "numbers that are not finite"),
    (series("time_h", lambda _: 1.0), "rows that are not later than the row before"),
    (forgotten, "rows without fields of their time"),
    (unfinished, "requested rows that are missing, and rows that were not requested"),
    (ledger("end_h", plus(-0.01)), "end of the ledger, h, beyond its bounds"),
    (series("meshed_length_um", times(1.0001)), "area of the mesh over meshed length times width, less one"),
    (field(move_outlet_corner), "nodes, beyond its bounds"),
    (field(turn_triangle), "triangles that are turned over"),
    (series("head_loss_cm", times(1.0001)), "head_loss_cm over that of the scene, less one"),
    (node("velocity_m_per_d", [0.001, 0.0, 0.0], at_wall), "velocity at the walls over the mean"),
    (node("velocity_m_per_d", [0.0, 0.001, 0.0], at_wall), "velocity through the walls over the mean"),
    (series("mean_velocity_m_per_d", times(1.001)), "flow through the inlet over u_ave W, less one"),
    (node("velocity_m_per_d", 0.0, inside_outlet), "flow through the outlet over u_ave W, less one"),
    (scaled("head_cm", 1.1), "mean head at inlet less outlet and the loss outside, over the head loss, less one"),
    (scaled("velocity_m_per_d", 1.05),
     "dissipation in the mesh and the loss outside, over the head loss, less one"),
    (series("conductivity_m_per_d", times(1.5)), "conductivity over that of the clean pore, beyond its bounds"),
    (ledger("start_h", plus(1e-6)), "time between one step's end and the next one's start, h"),
    (ledger("biomass_before_pg_per_m", times(1.000001), 1), "biomass at t = 0 over X_m times the area, less one"),
    (ledger("biomass_before_pg_per_m", times(1.000001)),
     "biomass at a step's start less that at the end before, over that at t = 0"),
    (ledger("biomass_after_pg_per_m", times(1.01)), "biomass over X_m times the area of the row, less one"),
    (ledger("biomass_made_pg_per_m", times(1.0001)),
     "biomass after and detached, less before and new, over that at t = 0"),
    (ledger("biomass_made_pg_per_m", times(1.0001)),
     "new biomass - (Y donor - (acceptor - F donor) / d_c), pg/m, beyond its bounds"),
    (ledger("acceptor_consumed_pg_per_m", times(1.1)),
     "biomass that degrades by the oxygen consumed, pg/m, beyond its bounds"),
    (series("inert_fraction", lambda _: -0.001), "inert biomass, pg/m, beyond its bounds"),
    (series("inert_fraction", times(3)), "inert biomass, pg/m, beyond its bounds"),
    (scaled("theta", 1.01, "cell_data"), "integral of theta less J over that of J"),
    (scaled("J", 1.01, "cell_data"), "area over that at t = 0 over J, less one"),
    *((series(f"{name}_balance", lambda _: -1.0), f"column {name}_balance")
      for name in ("acceptor", "donor", "biomass", "oxygen_demand")),
    *(bad for name in run_files.NAMES for bad in (
        (scaled(f"{name}_mg_per_L", 1.2), f"{name} in the fields, mg/L, beyond its bounds"),
        (node(f"{name}_mg_per_L", -0.011), f"{name} in the fields, mg/L, beyond its bounds"),
        *((series(f"{end}_{name}_mg_per_L", times(1.000001)),
           f"{end} {name} of the fields less that of the row, over the supply") for end in ("inlet", "effluent")),
        (scaled("active_biomass", 1.2), f"{name} that the aggregate takes up, um2 mg/L/h, beyond its bounds"),
        (ledger(f"{name}_out_pg_per_m", times(1.00001)),
         f"{name} supplied less leaving, consumed and stored, relative"),
        (ledger(f"{name}_stored_pg_per_m", plus(1e-3)), f"{name} stored by quasi-steady substrates"),
        (ledger(f"{name}_consumed_pg_per_m", times(-1)), f"{name} consumed, pg/m, beyond its bounds"),
        (ledger(f"{name}_consumed_pg_per_m", times(3)), f"{name} consumed, pg/m, beyond its bounds"))),
]


@pytest.mark.parametrize("damage, check", DAMAGES)
def test_each_check_detects_its_damage(intact, tmp_path, damage, check):
    folder = tmp_path / "run"
    shutil.copytree(intact, folder)
    damage(folder)
    assert check in failed(folder)


@pytest.mark.exact_lengths
def test_an_intact_run_passes_and_every_check_has_a_damage(intact):
    assert failed(intact) == set()
    checks = {check_name(finding) for finding in run_files.findings(run_files.Run(intact, TABLES))}
    assert checks == {check for _, check in DAMAGES}


#: Changes of the tables, and the check that shows that the run has other physics.
MISTAKEN = [
    ({"kinetics": {"law": "first order"}}, "donor that the aggregate takes up, um2 mg/L/h, beyond its bounds"),
    ({"kinetics": {"law": "Haldane"}, "substrates": {"acceptor": {}, "donor": {"inhibition_constant": "2 mg/L"}}},
     "donor that the aggregate takes up, um2 mg/L/h, beyond its bounds"),
    ({"substrates": {"acceptor": {}}}, "columns and fields of donor, which the scene leaves out"),
    ({"substrates": {"donor": {}}}, "columns and fields of acceptor, which the scene leaves out"),
    ({"growth": {"wall": "bonded"}}, "path of bonded nodes along the wall over the width"),
]


@pytest.mark.parametrize("changes, check", MISTAKEN)
def test_a_run_of_other_physics_than_the_scene_is_detected(intact, changes, check):
    """Runs of other physics pass in the case hard-family. Its mutants show that errors of these physics are detected.
    """
    assert check in failed(intact, changed(**changes))
