"""Rows and arrays of one instant: each number is that of its own side, substrate and steps. `test_derived.py` derives
all of them from the state."""
from dataclasses import replace

import numpy as np
import pytest

from repro import results
from repro import solve as solve_scene
from repro.march.balance import Ledger
from repro.march.state import Report
from repro.model import transport
from repro.model.meshing import seeded
from repro.model.solving import Solved, solve
from repro.scene import load_scene
from tests.strategies import EVERY_ORDER, coarse_base
from tests.test_derived import arcs

NOTHING = Solved(None, None, None)
UNLIKE_OF = {"acceptor": "donor", "donor": "acceptor"}
EVEN = Ledger(0.0, 1.0, (5.0, 3.0), (1.0, 1.5), (4.0, 1.5), (0.0, 0.0), 70.0, 10.0, 80.0)


def row_of(scene, pore, solved=NOTHING, ledgers=(), remeshes=0):
    return results.row(scene, Report(pore, solved, None, ledgers, remeshes, {}))


@EVERY_ORDER
def test_ends_and_top_are_those_of_the_boundary_between_its_nodes(order):
    """The seed is swollen and leans, and its arcs are sampled to 1e-6. The nodes alone are off by 4e-4 um or more."""
    scene, pore = coarse_base(order, "numerics.refinement=0.5")
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


def test_biomass_is_reported_for_a_scene_without_growth():
    scene = load_scene("initial_mesh", ["substrates={}", "aggregate.inert_fraction=0.3"])
    row = row_of(scene, seeded(scene))
    computed = [row[name] for name in ("inert_fraction", "biomass_density_min", "biomass_density_max")]
    assert computed == pytest.approx([0.3, 1.0, 1.0], rel=1e-12) and row["biomass_balance"] is None


@pytest.mark.parametrize("k, name", [(0, "acceptor"), (1, "donor")])
def test_each_substrates_defect_is_over_its_own_terms(k, name):
    """Without a step it is over the row's fluxes, with Gear over the content of the meshed part at the supply."""
    scene, pore = coarse_base(1)
    gear, solved = coarse_base(1, "numerics.transport=gear")[0], solve(scene, pore)
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
    both = [coarse_base(1, table, *more)[0] for more in ((), ("numerics.transport=gear",))]
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
    grids = [results.fields(*coarse_base(order, f"growth.new_biomass={kind}"), NOTHING) for kind in kinds]
    stressed, free = ({*grid.point_data, *grid.cell_data} for grid in grids)
    assert len(stressed - free) == 6 and free == {name for name in stressed if not name.endswith("_MPa")}


@pytest.mark.parametrize("preset", ["fast", pytest.param("paper", marks=pytest.mark.thorough)])
def test_a_row_with_another_mesh_than_the_last_row_has_a_new_mesh(preset):
    """Rows within a step show the new meshes of this step."""
    run = solve_scene("base", [f"numerics.preset={preset}", "growth.end=4 h", "output.every=0.1 h"])
    jumps = np.diff(run["nodes"], prepend=run["nodes"][0]) != 0
    assert jumps.any() and (run["remeshed"] == jumps).all()
