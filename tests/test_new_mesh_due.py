"""When a new mesh is due: each criterion of 3.1, 3.5 and 2.3.3 suffices."""
from dataclasses import replace

import numpy as np
import pytest

from repro.fem import sizing
from repro.fem.walls import TOP
from repro.model import mesh_motion, remeshing
from repro.model.meshing import Meshing, seeded, sized
from repro.model.remeshing import moved_mesh
from tests.strategies import EVERY_ORDER, coarse_base
from verification.problems.schemes import exchange, load_scene


def grown_seed(elements):
    """(scene, its seed)."""
    scene = load_scene("base", ["aggregate.radius=20 um", "numerics.refinement=0.5", exchange(elements=elements)])
    return scene, seeded(scene)


def shifted(scene, pore):
    """The seed 16 um upstream, too near to the end of the mesh, which is 75 um away at first."""
    return scene, pore.moved(pore.mesh.points - [16.0, 0.0])


def touching(scene, pore):
    """A node at the top is on the opposite wall."""
    wall = pore.body.wall.copy()
    wall[pore.boundary.points[:, 1].argmax()] = TOP
    return scene, pore.with_body(wall=wall)


def coarse(scene, pore):
    """The scene requires elements a third as large."""
    return replace(scene, numerics=replace(scene.numerics, refinement=3 * scene.numerics.refinement)), pore


def inner(pore):
    """Corners of the aggregate's triangles that are not on its boundary."""
    return np.setdiff1d(pore.mesh.topology.body_corners, pore.mesh.loop)


def poor(scene, pore):
    """The inside of the aggregate is compressed, just far enough on any mesh: triangles at the boundary are poor, and
    none is turned over."""
    for part in np.arange(0.9, 0.6, -0.01):
        points = pore.mesh.points.copy()
        points[inner(pore)] = [0.0, 8.5] + part * (points[inner(pore)] - [0.0, 8.5])
        expanded = pore.moved(pore.mesh.with_middles(points[: pore.mesh.corners]))
        if np.count_nonzero(expanded.mesh.quality[expanded.mesh.biomass] < 0.6) > 7:
            return scene, expanded
    raise AssertionError("no triangle is poor")


def turned_over(scene, pore):
    """One inner node lies outside of the few triangles around it."""
    points = pore.mesh.points.copy()
    points[inner(pore)[0]] += [0.0, 14.0] if points[inner(pore)[0], 1] < 8 else [0.0, -14.0]
    return scene, pore.moved(pore.mesh.with_middles(points[: pore.mesh.corners]))


def unchanged(scene, pore):
    return scene, pore


def criteria(scene, pore, expanded):
    """{criterion: whether it requires a new mesh}. By 3.5, at most six triangles may have a quality under 0.6."""
    outline, ends, body = expanded.boundary, pore.mesh.ends, expanded.mesh
    reach = min(7 * outline.thickness, 1.3 * scene.pore.width)
    required = sizing.interface_sizes(outline.corners, sized(scene)).max()
    return {"extent": min(outline.upstream - ends[0], ends[1] - outline.downstream) < reach,
            "contact": bool((expanded.body.wall != pore.body.wall).any()),
            "size": outline.corners.edge_lengths()[outline.corners.interface_edges()].max() > 2.8 * required,
            "poor": np.count_nonzero(body.quality[body.biomass] < 0.6) > 6,
            "turned": bool((body.areas <= 0).any())}


@pytest.mark.parametrize("kind", ["linear", "quadratic"])
@pytest.mark.parametrize("change, criterion", [(unchanged, None), (shifted, "extent"), (touching, "contact"),
                                            (coarse, "size"), (poor, "poor"), (turned_over, "turned")])
def test_a_new_mesh_is_due_if_one_criterion_requires_it(change, criterion, kind):
    first = grown_seed(kind)
    scene, expanded = change(*first)
    assert (moved_mesh(Meshing.of(scene), first[1], expanded) is None) == (criterion is not None)
    due = [name for name, is_due in criteria(scene, first[1], expanded).items() if is_due]
    assert due == [*filter(None, [criterion])]


@EVERY_ORDER
def test_a_mesh_moves_by_gamma_unless_it_is_too_coarse(order):
    """gamma of (35) is 1. Edges three times as long as a film of 2.5 um allows are too coarse."""
    coarse, pore = coarse_base(order, 'pore.width="20 um"', 'aggregate.radius="17.5 um"', "numerics.refinement=0.6")
    coordinates = pore.mesh.points.copy()
    coordinates[pore.mesh.body] *= 1.001
    expected = mesh_motion.move(pore.mesh, coordinates[pore.mesh.body], compressibility=1.0)
    assert np.array_equal(remeshing.moved_mesh(Meshing.of(coarse), pore, pore.moved(coordinates)).points, expected)
    fine = replace(coarse, numerics=replace(coarse.numerics, refinement=1.8))
    assert remeshing.moved_mesh(Meshing.of(fine), pore, pore) is None
