"""The transfer of fields to a new mesh (3.5, [E8]): where places are, what is bounded, what a remesh keeps.

What interpolation and projection keep in chains of meshes is in `test_remesh_chains.py`; (34), and the projection
against a dense code, in the cases of the stage reprojection.
"""
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from repro.errors import TransferError
from repro.fem import elements, transfer
from repro.fem.mesh import curved
from repro.fem.space import Space
from repro.march.simulation import simulate
from repro.model import contact, pore, remeshing
from repro.scene import load_scene
from tests.strategies import ORDERS, scene
from tests.test_outline import wavy
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
def around():
    """Meshes around a wavy outline: of arcs, of the same with edges between corners that are straight, and of three
    nodes a triangle."""
    made = scene("20 um", numerics={"preset": "fast", "refinement": 0.5})
    arcs = pore.generate(made, wavy())[0]
    flat = curved(arcs.straight, None)
    return {"arcs": arcs, "flat": flat, "straight": arcs.straight}


@pytest.mark.parametrize("kind", ["arcs", "flat", "straight"])
def test_a_place_is_found_in_its_triangle(around, kind):
    """By Newton's method on the curved map, to 1e-9 of the size."""
    mesh = around[kind]
    random, nodes = np.random.default_rng(8), mesh.points[mesh.cells]
    local = random.dirichlet([1, 1, 1], len(nodes))[:, 1:]
    where = np.einsum("ka,kai->ki", elements.values(mesh.geometry, local), nodes)
    at = transfer.located(mesh.points, mesh.cells, where)
    back = np.einsum("ka,kai->ki", elements.values(mesh.geometry, at.local), nodes[at.triangle])
    assert np.allclose(back, where, atol=1e-9)
    inner = local.min(axis=1) + np.minimum(1 - local.sum(axis=1), 0) > 0.02
    inner &= 1 - local.sum(axis=1) > 0.02
    assert np.array_equal(at.triangle[inner], np.arange(len(nodes))[inner])


def drawn_places():
    random = np.random.default_rng(9)
    return np.column_stack([random.uniform(-14, 14, 200), random.uniform(0.5, 10, 200)])


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("kind", ["flat", "straight"])
def test_polynomials_of_the_order_are_carried_exactly(around, order, kind):
    """On straight edges, whatever carries the map."""
    mesh, where = around[kind], drawn_places()
    space = Space(mesh, order)

    def fields(points):
        x, y = points.T
        return np.column_stack([(x - 2 * y) ** order + 3, (y / 2 + x) ** order + 2 * x - 1])

    at = transfer.located(mesh.points, mesh.cells[mesh.biomass], where)
    found = at.field(fields(space.points), space.cells[mesh.biomass], order)
    assert np.allclose(found, fields(where), rtol=1e-10, atol=1e-8)
    linear = at.field((2 * mesh.points[:, 0] - mesh.points[:, 1])[: mesh.corners], mesh.triangles[mesh.biomass], 1)
    assert np.allclose(linear, 2 * where[:, 0] - where[:, 1], atol=1e-9)


def test_a_place_a_little_outside_is_moved_to_the_edge(around):
    """A chord cuts an arc: what is between them is outside of the chord's triangle."""
    for mesh in around.values():
        places = np.column_stack([[-5.0, 5.0], np.full(2, -1e-3)])
        at = transfer.located(mesh.points, mesh.cells, places)
        assert at.local.min() >= 0 and at.local.sum(axis=1).max() <= 1
        found = at.field(mesh.points, mesh.cells, mesh.geometry)
        assert np.allclose(found, places * [1, 0], rtol=0, atol=2e-3)


@pytest.mark.parametrize("kind", ["arcs", "straight"])
def test_a_place_far_outside_is_refused(around, kind):
    mesh = around[kind]
    with pytest.raises(TransferError, match="of the new mesh is not in the old one"):
        transfer.located(mesh.points, mesh.cells, np.array([[0.0, 5.0], [500.0, 5.0]]))


def test_places_at_the_start_are_unfolded(around):
    """A middle whose place at t = 0 turns its triangle over goes half way between its corners; others stay. Corners
    that fold are refused, of straight triangles too."""
    mesh = around["arcs"]
    assert transfer.unfolded(mesh, mesh.points) is mesh.points
    body, origin = mesh.cells[mesh.biomass], mesh.points.copy()
    cell = body[np.argmin(np.isin(body[:, 3:], mesh.loop).sum(axis=1))]
    origin[cell[3]] = origin[cell[2]]
    found = transfer.unfolded(mesh, origin)
    assert np.allclose(found[cell[3]], 0.5 * (origin[cell[0]] + origin[cell[1]]))
    assert np.array_equal(found[:mesh.corners], origin[:mesh.corners])
    assert not mesh.moved(found).turned_over(np.flatnonzero(mesh.biomass)).any()
    origin[cell[0]] = 2 * origin[cell[1]] - origin[cell[0]] + 3 * (origin[cell[2]] - origin[cell[1]])
    for grid, places in ((mesh, origin), (mesh.straight, origin[: mesh.corners])):
        with pytest.raises(TransferError, match="the places at t = 0 fold"):
            transfer.unfolded(grid, places)
    assert transfer.unfolded(mesh.straight, mesh.straight.points) is mesh.straight.points


@pytest.mark.parametrize("kind", ORDERS.values())
def test_a_remesh_keeps_mass_and_composition(kind):
    """Of both kinds of biomass, to round-off where the transfer conserves them; with order 2 and 3 the mass is X_m
    times the area, before and after; the share of X_I stays within what it was; places at t = 0 are those of the same
    material."""
    made = load_scene("base", ('numerics.preset="fast"', f'numerics.elements="{kind}"', "numerics.refinement=0.5",
                               'aggregate.radius="20 um"'))
    X_m, now = made.kinetics.maximum_density, pore.seeded(made)
    share = 0.07 + 0.0014 * at_reaction(now.space)[0]
    total = 1.44 * X_m * now.space.reaction.dx
    grown = replace(now, active=(1 - share) * total, inert=share * total)
    expanded, _, _ = contact.expand(made, grown, 1.44 * now.theta)
    after, _ = remeshing.remesh(made, now, expanded, 0.0)
    assert expanded.mass == pytest.approx(1.44 * now.mass, rel=1e-13)
    assert expanded.mesh.area() == pytest.approx(expanded.mass / X_m, rel=1e-11)
    assert after.mesh.area() == pytest.approx(expanded.mesh.area(), rel=1e-12)
    assert after.mass == pytest.approx(expanded.mass, rel=1e-11)
    assert after.inert.sum() == pytest.approx(expanded.inert.sum(), rel=1e-11)
    if kind != "linear":
        assert after.mass == pytest.approx(X_m * after.mesh.area(), rel=1e-13)
        assert np.allclose(after.active + after.inert, X_m * after.space.reaction.dx, rtol=1e-13)
        shares = after.inert / (after.active + after.inert)
        assert share.min() - 2e-3 <= shares.min() and shares.max() <= share.max() + 2e-3
    assert after.composition(X_m)[0] == pytest.approx(expanded.composition(X_m)[0], rel=1e-9)
    body = after.mesh.body
    assert np.allclose(after.origin[body], after.mesh.points[body] / 1.2, atol=0.02)
    assert np.hypot(*after.origin[after.mesh.loop].T).max() <= 20.0 + 1e-9


def at_reaction(space):
    """x and y, (r, q) each, of the points in which the reaction is taken."""
    pieces = space.reaction
    return (space.points[pieces.cells].swapaxes(1, 2) @ pieces.values.T).swapaxes(0, 1)


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


def test_what_is_far_away_plays_no_part_in_a_bounded_transfer():
    """A spike is carried to nodes near it alone, where the projection rings in the whole domain."""
    before = np.zeros(len(OLD[0]))
    peak = np.argmin(np.hypot(*(OLD[0] - [20.0, 12.0]).T))
    before[peak] = 1.0
    free, bounded = (carry(*OLD, before[:, None], *NEW)[:, 0]
                     for carry in (transfer.project, transfer.project_bounded))
    far = np.hypot(*(NEW[0] - OLD[0][peak]).T) > 14.0
    assert np.abs(free[far]).max() > 1e-4 and (bounded[far] == 0).all() and bounded.min() == 0


def test_a_bounded_projection_is_left_alone():
    """Column by column: the smooth one is the projection's to the last bit, the rough one is not."""
    smooth = 2 + np.sin(0.05 * OLD[0][:, 0])
    fields = np.column_stack([3 + 0.1 * OLD[0][:, 0], random_field(3, 0.3), smooth])
    free, bounded = (carry(*OLD, fields, *NEW) for carry in (transfer.project, transfer.project_bounded))
    assert np.abs(free - bounded)[:, 0].max() < 1e-13 * 7 and np.abs(free - bounded)[:, 1].max() > 1e-2


def test_a_run_that_remeshes_by_a_bounded_transfer_keeps_its_biomass():
    """The scene's word reaches the remesh: never negative, mass to round-off, and not the other transfers' numbers."""
    found = {}
    for how in ("conserving", "linear", "bounded"):
        said = load_scene("base", ['numerics.preset="paper"', 'growth.end="4 h"', 'growth.time_step="24 min"',
                                   'numerics.refinement=0.6', f"numerics.transfer={how}", 'output.times=["4 h"]'])
        *_, last = simulate(said)
        assert last.remeshes > 0
        rows = last.ledgers
        found[how] = last.pore, max(abs(r.biomass_after - r.biomass_before - r.biomass_made) / r.biomass_after
                                         for r in rows)
    assert found["bounded"][1] < 1e-12 and found["conserving"][1] < 1e-12 and found["linear"][1] > 1e-12
    assert found["bounded"][0].inert.min() >= 0
    assert found["bounded"][0].outline.area != found["conserving"][0].outline.area
