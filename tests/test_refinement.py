"""Parts of triangles beside contact lines have the shapes and the fields of their triangles."""
from dataclasses import replace

import numpy as np
import pytest

from repro.fem import elements
from repro.fem.refinement import refined
from repro.fem.sizing import GRADATION, SPLIT
from repro.fem.walls import numbered
from repro.model import contact, mesh_motion, remeshing
from repro.model.finer_lines import with_finer_lines
from repro.model.mechanics import Mechanics
from repro.model.meshing import seeded
from repro.model.remeshing import Remeshing
from repro.scene import load_scene
from tests.strategies import PRESET_OF

#: Seeds: one, one on the upper wall, and two on opposite walls.
SEEDS = {"one": [{}], "upper": [{"wall": "upper"}],
         "two": [{"position": "-12 um"}, {"wall": "upper", "position": "9 um", "radius": "6 um"}]}
SIZE = 0.4


def grown_pore(order, seeds):
    """A scene and its pore after growth that differs from place to place; each aggregate sits off the middle."""
    tables = ", ".join("{" + ", ".join(f'{key}="{value}"' for key, value in {"radius": "8 um", **seed}.items()) + "}"
                       for seed in SEEDS[seeds])
    scene = load_scene("base", [f"numerics.preset={PRESET_OF[order]}", "growth.wall=bonded", f"aggregate=[{tables}]"])
    seed = seeded(scene)
    thetas = [body.theta * (1.1 + 0.003 * np.arange(len(body.theta))[:, None] / len(body.theta))
              for body in seed.bodies]
    grown = contact.expand(Mechanics.of(scene), seed, thetas).pore
    pressure = 0.01 * np.random.default_rng(3).standard_normal(grown.mesh.corners)
    return scene, replace(grown, pressure=pressure)


def lines_of(pore):
    return np.concatenate([outline.points[outline.contact_ends] for outline in pore.outlines])


@pytest.mark.parametrize("seeds", SEEDS)
@pytest.mark.parametrize("order", [1, 2])
def test_parts_have_the_shape_and_the_fields_of_their_triangles(order, seeds):
    """Areas, positions at t = 0, pressures, contact, J and theta, to round-off. Theta is linear in each triangle."""
    _, pore = grown_pore(order, seeds)
    fine, _ = with_finer_lines(pore, lines_of(pore), SIZE, GRADATION)
    assert len(fine.mesh.cells) > len(pore.mesh.cells) + 40 * len(pore.bodies)
    assert fine.mesh.area() == pytest.approx(pore.mesh.area(), rel=1e-12)
    assert fine.mesh.checked() is fine.mesh
    for old, new, before, after, outline, finer in zip(pore.bodies, fine.bodies, pore.mesh.regions, fine.mesh.regions,
                                                       pore.outlines, fine.outlines):
        for wall in pore.mesh.walls:
            assert finer.contact_length(numbered(pore.mesh.walls, wall.number)) == pytest.approx(
                outline.contact_length(wall), rel=1e-12)
        assert np.allclose(finer.points, fine.mesh.points[after.loop], atol=0) and finer.area == pytest.approx(
            outline.area, rel=1e-12)
        strained = [body.solid.strained(of.mesh.points[region.nodes])
                    for of, body, region in ((pore, old, before), (fine, new, after))]
        totals = [[np.sum(body.solid.at.dx * factor) for factor in (1.0, deformed.J, body.theta)]
                  for body, deformed in zip((old, new), strained)]
        assert totals[1] == pytest.approx(totals[0], rel=1e-10)
        pressures = [of.pressure[region.cells[:, :3]] @ body.solid.shape.table.linear.T
                     for of, body, region in ((pore, old, before), (fine, new, after))]
        integrals = [np.sum(body.solid.at.dx * deformed.J * pressure**order)
                     for body, deformed, pressure in zip((old, new), strained, pressures)]
        assert integrals[1] == pytest.approx(integrals[0], rel=1e-8)


@pytest.mark.parametrize("seeds", SEEDS)
@pytest.mark.parametrize("order", [1, 2])
def test_no_edge_is_longer_than_the_size_around_it_and_no_node_hangs(order, seeds):
    """Triangles beside all contact lines are small. Each edge inside has two triangles, and no angle is small."""
    _, pore = grown_pore(order, seeds)
    lines = lines_of(pore)
    assert len(lines) == 2 * len(pore.bodies)

    def size_at(where):
        return SIZE + GRADATION * np.linalg.norm(where[:, None] - lines, axis=2).min(axis=1)

    fine = refined(pore.mesh, pore.outlines, size_at).mesh
    corners = fine.points[fine.triangles]
    lengths = np.linalg.norm(corners[:, elements.NEXT] - corners, axis=2)
    assert (lengths.max(axis=1) <= SPLIT * size_at(corners.mean(axis=1))).all()
    for line in lines:
        beside = (np.linalg.norm(corners - line, axis=2).min(axis=1) < 1e-9)
        assert beside.any() and lengths[beside].max() < 2 * SPLIT * SIZE
    edges, counts = np.unique(np.sort(np.stack([fine.triangles, fine.triangles[:, elements.NEXT]], axis=2), axis=2)
                              .reshape(-1, 2), axis=0, return_counts=True)
    ends = [wall.y for wall in fine.walls]
    outer = np.isin(fine.points[edges, 1], ends).all(axis=1) | np.isin(fine.points[edges, 0], fine.ends).all(axis=1)
    assert counts.max() == 2 and (counts[~outer] == 2).all()
    assert fine.quality.min() > 0.3 * pore.mesh.quality.min() and (fine.areas > 0).all()


@pytest.mark.parametrize("seeds", SEEDS)
@pytest.mark.parametrize("order", [1, 2])
def test_parts_keep_nodes_and_share_amounts(order, seeds):
    """Values at the nodes of a mesh are among those at the nodes of its parts. Amounts per area that are linear in each
    triangle are so in its parts, in every aggregate."""
    _, pore = grown_pore(order, seeds)
    fine, bisection = with_finer_lines(pore, lines_of(pore), SIZE, GRADATION)
    field = np.random.default_rng(5).standard_normal(len(pore.mesh.points))
    assert bisection.restricted(bisection.nodal(field)) == pytest.approx(field, abs=1e-12)
    table = pore.bodies[0].solid.shape.table
    corners = 2 + np.random.default_rng(6).random((len(pore.mesh.triangles), 3))
    linear = corners if order == 2 else corners[:, :1] * np.ones(3)

    def densities(mesh, owner, local):
        places = np.einsum("qc,tci->tqi", table.linear, local)
        at = np.stack([1 - places.sum(axis=2), *np.moveaxis(places, 2, 0)], axis=2)
        every = np.einsum("tqc,tc->tq", at, linear[owner])
        return [every[region.triangles] for region in mesh.regions]

    unit = np.tile(elements.nodes(1), (len(corners), 1, 1))
    weights, own = ([body.solid.at.dx for body in of.bodies] for of in (pore, fine))
    before = [density * dx for density, dx in zip(densities(pore.mesh, np.arange(len(corners)), unit), weights)]
    shared = bisection.of_each(before, weights, own, table)
    expected = densities(fine.mesh, bisection.owner, bisection.local)
    for computed, dx, exact, total in zip(shared, own, expected, before, strict=True):
        assert computed / dx == pytest.approx(exact, rel=0.35)
        assert np.median(np.abs(computed / dx / exact - 1)) < 2e-3
        assert computed.sum() == pytest.approx(total.sum(), rel=1e-12)
    for computed, dx in zip(bisection.of_each([3 * dx for dx in weights], weights, own, table), own, strict=True):
        assert computed == pytest.approx(3 * dx, rel=1e-10)


def test_a_mesh_with_other_triangles_does_not_move_with_the_aggregate(monkeypatch):
    """Even if the nodes of the boundary and its contact are the same. The numbers of its nodes mean other places."""
    scene, pore = grown_pore(2, "one")
    inside, _ = with_finer_lines(pore, np.array([[0.0, 0.4 * pore.boundary.thickness]]), 0.9, 3.0)
    meshing = Remeshing.of(scene).meshing
    assert remeshing.same_contact(pore, inside) and len(inside.mesh.triangles) > len(pore.mesh.triangles)
    assert remeshing.moved_mesh(meshing, pore, pore) is not None
    monkeypatch.setattr(mesh_motion, "moved", lambda *_: pytest.fail("the mesh moves"))
    assert remeshing.moved_mesh(meshing, pore, inside) is None
