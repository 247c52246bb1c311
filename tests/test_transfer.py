"""The transfer of fields to a new mesh (3.5, [E8]): what it refuses, what is bounded, what remeshes keep. (34), the
orders of what is carried, and the projection against a dense code, are in the cases of the stage reprojection."""
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from repro.errors import TransferError
from repro.fem import transfer
from repro.model import biomass, pore, remeshing
from repro.model.transport import OVERSHOOT, UNRESOLVED, Concentrations
from repro.scene import load_scene
from tests.strategies import ORDERS, scene, scenes, share
from verification.problems import pairs


def test_a_corner_on_a_side_of_the_window_loses_no_piece():
    """Corners of these two lie on each other's sides to round-off, where signs change more than twice. Found by
    hypothesis."""
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
    """A mesh around a half-disc, of arcs."""
    return pore.seeded(scene("20 um", numerics={"preset": "fast", "refinement": 0.5})).mesh


def test_a_place_far_outside_is_refused(arcs):
    for mesh in (arcs, arcs.straight):
        with pytest.raises(TransferError, match="of the new mesh is not in the old one"):
            transfer.located(mesh.points, mesh.cells, np.array([[0.0, 5.0], [500.0, 5.0]]))


def test_places_at_the_start_are_unfolded(arcs):
    """A middle whose place at t = 0 turns its triangle over goes half way between its corners; others stay. Corners
    that fold are refused, of straight triangles too."""
    assert transfer.unfolded(arcs, arcs.points) is arcs.points
    body, origin = arcs.cells[arcs.biomass], arcs.points.copy()
    cell = body[np.argmin(np.isin(body[:, 3:], arcs.loop).sum(axis=1))]
    origin[cell[3]] = origin[cell[2]]
    found = transfer.unfolded(arcs, origin)
    assert np.allclose(found[cell[3]], 0.5 * (origin[cell[0]] + origin[cell[1]]))
    assert np.array_equal(found[:arcs.corners], origin[:arcs.corners])
    assert not arcs.moved(found).turned_over(np.flatnonzero(arcs.biomass)).any()
    origin[cell[0]] = 2 * origin[cell[1]] - origin[cell[0]] + 3 * (origin[cell[2]] - origin[cell[1]])
    for grid, places in ((arcs, origin), (arcs.straight, origin[: arcs.corners])):
        with pytest.raises(TransferError, match="the places at t = 0 fold"):
            transfer.unfolded(grid, places)
    assert transfer.unfolded(arcs.straight, arcs.straight.points) is arcs.straight.points


OLD, NEW = pairs.grid(6.0, 1), pairs.grid(5.0, 2)


def random_field(seed: int, share: float) -> np.ndarray:
    """Zeros and ones, of which a share is one."""
    return 1.0 * (np.random.default_rng(seed).uniform(size=len(OLD[0])) < share)


@given(st.integers(0, 10**6), st.floats(0.02, 0.98), st.floats(1e-6, 1e6), st.floats(-1.0, 1.0))
def test_a_bounded_transfer_keeps_mass_and_bounds(seed, share, scale, level):
    """For rough fields of any size and level."""
    before = scale * (random_field(seed, share) + level)
    after = transfer.project_bounded(*OLD, before[:, None], *NEW)[:, 0]
    assert after.min() >= before.min() and after.max() <= before.max()
    apart = pairs.integral(NEW, after) - pairs.integral(OLD, before)
    tiny = np.finfo(float).tiny  # numbers below it have fewer digits
    assert abs(apart) <= (1e-12 * np.abs(before).max() + tiny) * pairs.AREA


def test_projection_refuses_meshes_of_different_shapes():
    with pytest.raises(TransferError, match="common pieces"):
        transfer.project(*OLD, OLD[0], OLD[0] * [1.0, 1.001], OLD[1])


@share(0.4)
@given(scenes(steps=1, elements=list(ORDERS.values())), st.integers(0, 2**32 - 1),
       st.lists(st.floats(0.4, 0.9), min_size=2, max_size=4))
def test_a_pore_that_is_meshed_again_and_again_keeps_its_biomass(made, seed, refinements):
    """The pore's own remesh, X_A uneven and X_I even: totals to 1e-11 by the conserving transfer, bounds by the
    paper's, X_I even by both; with order 2 and 3, whose masses are X_m all together again, totals of both, and no share
    below zero; the outline's area, and substrates between nothing and the supply."""
    now = pore.seeded(made)
    solved = pore.solve(made, now)
    uneven = np.random.default_rng(seed).uniform(0.5, 1.5, now.active.shape)
    now = replace(filled(made, now, uneven), concentrations=solved.concentrations)
    for refinement in refinements:
        finer = replace(made, numerics=replace(made.numerics, refinement=refinement))
        speed = solved.flow.mean_velocity if solved.flow else 0.0
        then, _ = remeshing.remesh(finer, now, now, speed)
        assert then.outline.area == pytest.approx(now.outline.area, rel=1e-12)
        check_biomass(made, now, then)
        check_substrates(made, then)
        now = then


def filled(made, now, uneven):
    """With X_I = 7 mg/L and uneven X_A; with order 2 and 3 both together X_m, as growth keeps them."""
    dx, density = now.space.reaction.dx, made.kinetics.maximum_density
    if now.space.order == 1:
        return replace(now, active=uneven * density * dx, inert=7.0 * dx)
    inert = uneven / 3
    return replace(now, active=(1 - inert) * density * dx, inert=inert * density * dx)


def check_biomass(made, now, then):
    """What the transfer of the scene promises of the new mesh's biomass."""
    before, after = (one.active / one.space.reaction.dx for one in (now, then))
    if made.numerics.transfer == "conserving":
        assert then.active.sum() == pytest.approx(now.active.sum(), rel=1e-11)
        assert then.inert.sum() == pytest.approx(now.inert.sum(), rel=1e-11)
    else:
        assert before.min() <= after.min() and after.max() <= before.max()
    if then.space.order == 1:
        assert then.inert / then.space.reaction.dx == pytest.approx(np.full(then.inert.shape, 7.0), rel=1e-10)
    else:
        assert then.active.min() >= 0 and then.inert.min() >= 0
    outside = np.setdiff1d(np.arange(len(then.mesh.points)), then.mesh.body)
    assert not biomass.at_nodes(then.space, after)[outside].any()


def check_substrates(made, then):
    """Interpolated: with linear functions within their bounds; with order 2 and 3 an interpolant may overshoot."""
    room = 1e-12 if then.space.order == 1 else OVERSHOOT
    both = (made.substrates.acceptor, then.concentrations.acceptor), (made.substrates.donor, then.concentrations.donor)
    largest = max(substrate.supply for substrate, _ in both)
    for substrate, field in both:
        assert len(field) == then.space.count
        assert field.min() >= -(0.0 if then.space.order == 1 else UNRESOLVED * largest)
        assert field.max() <= substrate.supply * (1 + room)


@pytest.mark.parametrize("speed, brought", [(0.0, 7.0), (4e6, 3.0)])
def test_beyond_the_old_mesh_no_other_time_s_water_appears(speed, brought):
    """A table of supplies, late, around an aggregate off the middle: still water is that of the start, flowing water
    that of the time, and never the table's largest; what was in the mesh is still there. How it falls off towards the
    mesh is in `test_unseen.py`."""
    there = {"pore": {"width": "100 um", "length": "160 um"}, "aggregate": {"radius": "20 um", "position": "15 um"},
             "substrates": {"boundary": "closed", "donor": {"supply": "5 mg/L"}, "acceptor": {
                 "supply": [["0 h", "7 mg/L"], ["1 h", "20 mg/L"], ["4 h", "3 mg/L"]]}},
             "growth": {"end": "9 h"}, "numerics": {"preset": "paper", "transport": "gear", "refinement": 0.5}}
    whole = load_scene({**there, "pore": {"width": "100 um", "length": "400 um"}})
    old = pore.seeded(load_scene(there))
    along = old.mesh.points[:, 0]
    late = replace(old, time=6.0, concentrations=Concentrations(4 + 0.02 * along, 3 - 0.01 * along))
    new, _ = remeshing.remesh(whole, late, late, speed)
    x, (first, last) = new.mesh.points[:, 0], old.mesh.ends
    within, far = (x > first) & (x < last), x < first - 50
    for field, supply, start, slope in ((new.concentrations.acceptor, brought, 4, 0.02),
                                        (new.concentrations.donor, 5.0, 3, -0.01)):
        assert field[within] == pytest.approx(start + slope * x[within], rel=1e-9)
        assert far.any() and field[far] == pytest.approx(np.full(far.sum(), supply), rel=1e-9)
        leaves = start + slope * last if speed else supply
        assert field[x > last + 20] == pytest.approx(np.full((x > last + 20).sum(), leaves), rel=1e-9)
