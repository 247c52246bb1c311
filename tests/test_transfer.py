"""The transfer of fields to a new mesh (3.5, [E8]): its refusals, sums, and the water beyond the old mesh. The cases
of the stage reprojection test (34), the orders and bounds of the fields, the biomass through many remeshes, and the
projection against a dense code."""
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import shapely

from repro.errors import TransferError
from repro.fem import elements, transfer
from repro.fem.mesh import checked_map_derivatives
from repro.model import remeshing
from repro.model.meshing import seeded
from repro.model.remeshing import Remeshing
from repro.model.solving import solve
from repro.model.transport import Concentrations
from repro.scene import load_scene
from tests.strategies import EVERY_ORDER, coarse_base, scene
from verification.problems import pairs


def test_a_corner_on_a_side_of_the_window_loses_no_piece():
    """Corners of both triangles lie on each other's sides to round-off, so that signs change more than twice. Example
    of hypothesis."""
    one = np.array([[-16.24426155716945, 130.84127738448933], [-23.300536940563543, 128.28843621984055],
                    [-19.58595858772013, 122.50332319928634]])
    two = np.array([[-15.886283307711276, 128.7760213767805], [-21.144224195959378, 132.13499549379594],
                    [-23.30053694056353, 128.28843621984055]])
    common = shapely.intersection(shapely.Polygon(one), shapely.Polygon(two)).area
    for window, polygon in ((one, two), (two, one)):
        window = window if shapely.Polygon(window).exterior.is_ccw else window[::-1]
        piece = transfer.clip(polygon[None], window[None])[0]
        assert shapely.Polygon(piece).area == pytest.approx(common, rel=1e-12)


@pytest.fixture(scope="module")
def arcs():
    """A mesh of arcs around a half-disc."""
    return seeded(scene("20 um", numerics={"preset": "fast", "refinement": 0.5})).mesh


def test_a_point_far_outside_is_refused(arcs):
    for mesh in (arcs, arcs.straight):
        with pytest.raises(TransferError, match="of the new mesh is not in the old one"):
            transfer.located(mesh.points, mesh.cells, np.array([[0.0, 5.0], [500.0, 5.0]]))


def test_folded_positions_at_the_start_are_unfolded(arcs):
    """A middle node whose position at t = 0 turns its triangle over moves half way between its corners; other nodes
    stay. Corners that fold are refused, also those of straight triangles."""
    region, = arcs.regions
    assert transfer.unfolded(arcs, arcs.points, region) is arcs.points
    body, origin = arcs.cells[arcs.biomass], arcs.points.copy()
    cell = body[np.argmin(np.isin(body[:, 3:], arcs.loop).sum(axis=1))]
    origin[cell[3]] = origin[cell[2]]
    corrected = transfer.unfolded(arcs, origin, region)
    assert np.allclose(corrected[cell[3]], 0.5 * (origin[cell[0]] + origin[cell[1]]))
    assert np.array_equal(corrected[:arcs.corners], origin[:arcs.corners])
    assert not arcs.moved(corrected).turned_over(np.flatnonzero(arcs.biomass)).any()
    origin[cell[0]] = 2 * origin[cell[1]] - origin[cell[0]] + 3 * (origin[cell[2]] - origin[cell[1]])
    for grid, places in ((arcs, origin), (arcs.straight, origin[: arcs.corners])):
        with pytest.raises(TransferError, match="the places at t = 0 fold"):
            transfer.unfolded(grid, places, *grid.regions)
    assert transfer.unfolded(arcs.straight, arcs.straight.points, *arcs.straight.regions) is arcs.straight.points


def strip(count, shift):
    """A strip of triangles of six nodes; middles on the edges between two triangles are shifted along it."""
    corners = np.array([[k / 2, 0.1 * (k % 2)] for k in range(count + 2)])
    triangles = [(k, k + 2, k + 1)[:: 1 - 2 * (k % 2)] for k in range(count)]
    edges = sorted({tuple(sorted((a, b))) for t in triangles for a, b in zip(t, (*t[1:], t[0]))})
    inner = np.array([b - a == 1 and 0 < a < count for a, b in edges])
    middles = corners[np.array(edges)].mean(axis=1) + inner[:, None] * [shift, 0.0]
    cells = [(*t, *(len(corners) + edges.index(tuple(sorted(edge))) for edge in zip(t, (*t[1:], t[0]))))
             for t in triangles]
    points = np.vstack([corners, middles])
    return SimpleNamespace(points=points, cells=np.array(cells), geometry=2)


@pytest.mark.parametrize("shift", [-0.4, 0.4])
def test_a_corrected_triangle_may_turn_its_neighbour_over(shift):
    """Two shifted edges of a triangle shear it, one turns it over. So the correction runs along the whole strip, from
    the end that the sign selects."""
    mesh = strip(9, shift)
    derivatives = checked_map_derivatives(2)
    corrected = transfer.unfolded(mesh, mesh.points, mesh)
    assert np.allclose(corrected, strip(9, 0.0).points)
    jacobians = elements.jacobian(mesh.points[mesh.cells], derivatives)
    assert (elements.determinant(jacobians).min(axis=1) < 0).sum() == 1


OLD, NEW = pairs.grid(6.0, 1), pairs.grid(5.0, 2)


def test_projection_refuses_meshes_of_different_shapes():
    with pytest.raises(TransferError, match="common pieces"):
        transfer.project(*OLD, OLD[0], OLD[0] * [1.0, 1.001], OLD[1])


@pytest.mark.parametrize("speed, expected", [(0.0, 7.0), (4e6, 3.0)])
def test_water_beyond_the_old_mesh_has_the_supply_of_its_time(speed, expected):
    """The supply is a table, and the aggregate is off the middle. Still water has the first supply, flowing water the
    present one, and neither the largest one; concentrations in the old mesh stay. The case reprojection-beyond-the-ends
    tests the profile towards the mesh."""
    tables = {"pore": {"width": "100 um", "length": "160 um"}, "aggregate": {"radius": "20 um", "position": "15 um"},
             "substrates": {"boundary": "closed", "donor": {"supply": "5 mg/L"}, "acceptor": {
                 "supply": [["0 h", "7 mg/L"], ["1 h", "20 mg/L"], ["4 h", "3 mg/L"]]}},
             "growth": {"end": "9 h"}, "numerics": {"preset": "paper", "transport": "gear", "refinement": 0.5}}
    full_pore = load_scene({**tables, "pore": {"width": "100 um", "length": "400 um"}})
    old = seeded(load_scene(tables))
    along = old.mesh.points[:, 0]
    late = replace(old, time=6.0, concentrations=Concentrations(4 + 0.02 * along, 3 - 0.01 * along))
    new, _ = remeshing.remesh(Remeshing.of(full_pore), late, late, speed)
    x, (first, last) = new.mesh.points[:, 0], old.mesh.ends
    within, far = (x > first) & (x < last), x < first - 50
    for field, supply, start, slope in ((new.concentrations.acceptor, expected, 4, 0.02),
                                        (new.concentrations.donor, 5.0, 3, -0.01)):
        assert field[within] == pytest.approx(start + slope * x[within], rel=1e-9)
        assert far.any() and field[far] == pytest.approx(np.full(far.sum(), supply), rel=1e-9)
        leaves = start + slope * last if speed else supply
        assert field[x > last + 20] == pytest.approx(np.full((x > last + 20).sum(), leaves), rel=1e-9)


def uneven(order):
    """(scene, pore, its solution) with masses that differ from X_m from point to point."""
    scene, pore = coarse_base(order)
    part = np.random.default_rng(order).uniform(0.7, 1.2, pore.active.shape)
    pore = pore.with_body(active=0.6 * part * pore.active, inert=0.3 * pore.active, theta=1.5 * pore.body.theta)
    return scene, pore, solve(scene, pore)


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
        before = replace(pore.with_masses(full - inert, inert), pressure=pressure)
        after, carried = remeshing.remesh(remeshing.Remeshing.of(finer), pore, before, 0.0, tuple(amounts))
        inside = after.mesh.topology.body_corners
        assert after.pressure[inside] == pytest.approx(after.mesh.points[inside] @ [0.02, 0.03] + 1, abs=1e-2)
        sums = [amount.sum() for amount in (after.inert, *carried)]
        assert sums == pytest.approx([amount.sum() for amount in (inert, *amounts)], rel=1e-12)
        assert after.mass == pytest.approx(full.sum(), rel=1e-12 if order == 1 else 1e-9)
        assert order == 1 or min(amount.min() for amount in (after.active, after.inert, *carried)) >= 0
