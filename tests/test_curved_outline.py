"""The chain of parabolic arcs: measures, splits that change nothing, closing films, and transfer between meshes."""
from dataclasses import replace

import numpy as np
import pytest

from repro.curved import coupling, elements, outline, pore, transfer
from repro.curved.mesh import curved
from repro.curved.outline import Arcs
from repro.errors import TransferError
from repro.fem import geometry
from repro.fem.geometry import BOTTOM, FREE, TOP
from repro.scene import load_scene
from tests.strategies import scene


def wavy(radius=20.0, refinement=0.5, bend=0.03):
    """A seed with its free nodes pushed about, so that its arcs are bent unevenly; places at t = 0 as the half-disc."""
    start = outline.seed(radius, refinement)
    random = np.random.default_rng(7)
    free = (start.wall == FREE)[:, None]
    points = start.points + free * random.uniform(-bend, bend, start.points.shape) * radius
    return replace(start, points=points)


def sampled(shape, per_arc=2000):
    """Points of the arcs, densely."""
    t = np.linspace(0, 1, per_arc, endpoint=False)
    return np.einsum("ta,mai->mti", outline.shape(t), outline.arcs(shape.points)).reshape(-1, 2)


def test_the_seed():
    """A half-disc to (edge / R)^4: middles on the arc too; only the middle of the base is fixed. Mutants: middles on
    the chords (area 1 % low), the fixed point missing or off."""
    for refinement in (0.25, 0.5, 1.0):
        start = outline.seed(10.0, refinement)
        free = start.wall == FREE
        assert np.allclose(np.hypot(*start.points[free].T), 10.0, rtol=1e-14)
        assert start.area == pytest.approx(np.pi / 2 * 100, rel=2e-4)
        assert np.array_equal(start.points[start.fixed], [[0.0, 0.0]])
        assert (start.points[~free, 1] == 0).all() and len(start.points) % 4 == 0
    assert start.area == pytest.approx(np.pi / 2 * 100, rel=1e-5)


def test_area_and_extremes_are_those_of_the_arcs():
    """Against a polygon of 2000 points an arc; the largest y is between nodes. Mutants: the polygon of the nodes, two
    thirds for four thirds of the triangle, extremes of nodes only."""
    shape, x = wavy(bend=0.1), sampled(wavy(bend=0.1))
    assert shape.area == pytest.approx(geometry.polygon_area(x), rel=1e-6)
    assert shape.upstream == pytest.approx(x[:, 0].min(), abs=1e-5)
    assert shape.downstream == pytest.approx(x[:, 0].max(), abs=1e-5)
    assert shape.thickness == pytest.approx(x[:, 1].max(), abs=1e-5)
    assert shape.thickness > shape.points[:, 1].max() + 1e-3, "else nothing is tested"


@pytest.mark.parametrize("refinement", [1.0, 2.0])
def test_a_split_changes_neither_shape_nor_area(refinement):
    """New nodes lie on the same parabolas, and so do their places at t = 0. Mutants: middles on chords, origin
    interpolated linearly."""
    shape = wavy()
    finer = outline.split(shape, geometry.Sizing(50.0, refinement, 2.0))
    assert len(finer.points) > len(shape.points)
    assert finer.area == pytest.approx(shape.area, rel=1e-13)
    assert (finer.thickness, finer.upstream) == pytest.approx((shape.thickness, shape.upstream), rel=1e-13)
    at_start = [geometry.polygon_area(sampled(replace(s, points=s.origin), 1000)) for s in (shape, finer)]
    assert at_start[1] == pytest.approx(at_start[0], rel=1e-6)
    assert np.array_equal(finer.points[finer.fixed], shape.points[shape.fixed])


def test_halved_arcs_are_the_same_curve():
    """Only those asked for; twice as many nodes there. Mutant: all of them, or the neighbour."""
    shape = wavy()
    which = np.zeros(len(shape.points) // 2, bool)
    which[[2, -1]] = True
    cut = outline.halved(shape, which)
    assert len(cut.points) == len(shape.points) + 4 and cut.area == pytest.approx(shape.area, rel=1e-13)
    kept = (shape.points[:, None] == cut.points[None]).all(axis=2).any(axis=1)
    assert kept.all()


def flat_top(heights, width=20.0):
    """A block whose upper side has nodes at the given heights, corner and middle in turn."""
    count = len(heights)
    x = np.linspace(10.0, -10.0, count)
    top = np.column_stack([x, heights])
    left, right = np.array([[-10.0, 0.5 * heights[-1]]]), np.array([[10.0, 0.5 * heights[0]]])
    base = np.column_stack([np.linspace(-10, 10, 5), np.zeros(5)])
    points = np.vstack([base, right, top, left])
    wall = np.where(np.arange(len(points)) < 5, BOTTOM, FREE)
    return Arcs(points, wall, np.arange(len(points)) == 2, points.copy()), 6 + np.arange(count)


def test_a_middle_never_joins_alone():
    """An arc of which only the middle is too near brings its nearer corner; a middle joins with both corners. Mutants:
    the rule of geometry on all nodes alike, the farther corner."""
    shape, top = flat_top([12.0, 16.0, 17.0, 18.5, 17.5, 16.0, 12.0])
    joins = outline.closing(shape, 20.0, 2.0, 0.0)
    assert np.array_equal(np.flatnonzero(joins == TOP), [top[4]]), "the corner beside it at 17.5, not that at 17"
    shape, top = flat_top([12.0, 16.0, 18.5, 18.9, 18.6, 16.0, 12.0])
    joins = outline.closing(shape, 20.0, 2.0, 0.0)
    assert np.array_equal(np.flatnonzero(joins == TOP), top[2:5]), "both corners, and the middle with them"
    shape, _ = flat_top([12.0, 16.0, 17.0, 17.5, 17.0, 16.0, 12.0])
    assert not outline.closing(shape, 20.0, 2.0, 0.0).any()


@pytest.fixture(scope="module")
def bent():
    """A mesh around a wavy outline."""
    made = scene("20 um", numerics={"preset": "fast", "refinement": 0.5})
    return pore.generate(made, wavy())[0]


def test_a_place_is_found_in_its_triangle(bent):
    """By Newton's method on the curved map, to 1e-9 of the size. Mutants: the straight triangle's coordinates, the
    first candidate taken."""
    random, nodes = np.random.default_rng(8), bent.points[bent.cells]
    local = random.dirichlet([1, 1, 1], len(nodes))[:, 1:]
    where = np.einsum("ka,kai->ki", elements.functions(local), nodes)
    cell, found = transfer.locate(nodes, where)
    back = np.einsum("ka,kai->ki", elements.functions(found), nodes[cell])
    assert np.allclose(back, where, atol=1e-9)
    inner = local.min(axis=1) + np.minimum(1 - local.sum(axis=1), 0) > 0.02
    assert np.array_equal(cell[inner & (1 - local.sum(axis=1) > 0.02)],
                          np.arange(len(nodes))[inner & (1 - local.sum(axis=1) > 0.02)])


def test_quadratic_fields_are_carried_exactly(bent):
    """x(s, t)^2 is none of them on a curved triangle: fields of the same six functions are, and places themselves.
    Mutants: linear interpolation, nodes of another triangle."""
    random = np.random.default_rng(9)
    where = np.column_stack([random.uniform(-14, 14, 200), random.uniform(0.5, 10, 200)])
    body = bent.cells[bent.biomass]
    assert np.allclose(transfer.interpolate(bent.points, body, bent.points, where), where, atol=1e-9)
    straight = curved(bent.straight, 0.5 * (bent.points[bent.loop[::2]] + bent.points[np.roll(bent.loop, -2)[::2]]))
    x, y = straight.points.T
    fields = np.column_stack([x * x - x * y + 3, y * y + 2 * x - 1])
    exact = np.column_stack([where[:, 0] ** 2 - where.prod(axis=1) + 3, where[:, 1] ** 2 + 2 * where[:, 0] - 1])
    assert np.allclose(transfer.interpolate(straight.points, straight.cells, fields, where), exact, atol=1e-8)
    at = transfer.located(straight.points, straight.cells[straight.biomass], where)
    linear = at.linear((2 * x - y)[:straight.corners])
    assert np.allclose(linear, 2 * where[:, 0] - where[:, 1], atol=1e-9)


def test_a_place_far_outside_is_refused(bent):
    """Mutant: the nearest triangle, however far."""
    with pytest.raises(TransferError, match="of the new mesh is not in the old one"):
        transfer.locate(bent.points[bent.cells], np.array([[0.0, 5.0], [500.0, 5.0]]))


def test_places_at_the_start_are_unfolded(bent):
    """A middle whose place at t = 0 turns its triangle over goes half way between its corners; others stay. Corners
    that fold are refused. Mutants: nothing done, all middles straightened, corners moved."""
    assert transfer.unfolded(bent, bent.points) is bent.points
    body, origin = bent.cells[bent.biomass], bent.points.copy()
    cell = body[np.argmin(np.isin(body[:, 3:], bent.loop).sum(axis=1))]
    origin[cell[3]] = origin[cell[2]]
    found = transfer.unfolded(bent, origin)
    assert np.allclose(found[cell[3]], 0.5 * (origin[cell[0]] + origin[cell[1]]))
    assert np.array_equal(found[:bent.corners], origin[:bent.corners])
    assert (elements.determinant(elements.jacobian(found[body])) > 0).all()
    origin[cell[0]] = 2 * origin[cell[1]] - origin[cell[0]] + 3 * (origin[cell[2]] - origin[cell[1]])
    with pytest.raises(TransferError, match="the places at t = 0 fold"):
        transfer.unfolded(bent, origin)


def test_a_remesh_keeps_mass_and_composition():
    """Mass is X_m times the area, before and after, to round-off; the share of X_I stays within what it was; places at
    t = 0 are those of the same material. Mutants: the expansion not restarted, shares beyond their bounds, origin of
    the mesh's own places."""
    made = load_scene("base", ('numerics.preset="fast"', "numerics.refinement=0.5", 'aggregate.radius="20 um"'))
    now = pore.seeded(made)
    inert = np.where(now.active > 0, 0.1 + 0.002 * now.mesh.points[:, 0], 0.0)
    grown = replace(now, active=1.44 - inert, inert=inert)
    expanded, _, _ = coupling.expand(made, grown)
    after = coupling.remesh(made, now, expanded, pore.solve(made, now).concentrations)
    assert expanded.mass() == pytest.approx(1.44 * now.mass(), rel=1e-13)
    assert expanded.mesh.area() == pytest.approx(expanded.mass(), rel=1e-12)
    assert after.mass() == pytest.approx(after.mesh.area(), rel=1e-13)
    assert after.mesh.area() == pytest.approx(expanded.mesh.area(), rel=1e-12)
    body, old = after.mesh.body, expanded.mesh.body
    share = after.inert[body] / (after.active + after.inert)[body]
    before = expanded.inert[old] / (expanded.active + expanded.inert)[old]
    assert before.min() - 1e-9 <= share.min() and share.max() <= before.max() + 1e-9
    assert after.composition(1.0)[0] == pytest.approx(expanded.composition(1.0)[0], rel=1e-4)
    assert np.allclose(after.origin[body], after.mesh.points[body] / 1.2, atol=0.02)
    assert np.hypot(*after.origin[after.mesh.loop].T).max() <= 20.0 + 1e-9
