"""Two aggregates in one pore: one and its mirror image, on the mesh of one and its mirror image.

What lies on one side of the middle does not act on the other one, except through the water. So each aggregate has the
shape, masses, stress and surface of the one in a pore of its own.
"""

from dataclasses import replace

import numpy as np
import pytest

from repro.errors import MeshError
from repro.fem import mesher, transfer
from repro.fem.mesh import Mesh
from repro.fem.outline import half_disc
from repro.fem.space import Space
from repro.march import folding, loop, updates
from repro.march import stepping as midpoint_steps
from repro.march.state import Compression, RestartState, contiguous
from repro.march.step_control import StepControl
from repro.model import adhesion, contact, growing, mesh_motion
from repro.model.adhesion import Loading
from repro.model.biomass import Rates, grow, transfer_amounts
from repro.model.mechanics import Mechanics
from repro.model.meshing import Seeding, seeded
from repro.model.surface import surfaces
from repro.scene import load_scene
from tests.strategies import MIRRORS

EVERY = pytest.mark.parametrize("order", [1, 2])
#: Width of a pore (um) around a half-disc of 17.8 um, far from it or 2.2 um.
FREE, TOUCHING = 40, 20


def one_pore(order, width=FREE):
    """A scene and its seed beside the middle of the mesh."""
    preset = {1: "paper", 2: "fast"}[order]
    scene = load_scene("base", [f"numerics.preset={preset}", "numerics.refinement=0.3", 'aggregate.radius="17.8 um"',
                                'aggregate.position="3 um"', f'pore.width="{width} um"'])
    return scene, seeded(scene)


def paired(pore):
    """A pore with the aggregate of another one and its mirror image, whose mesh joins that of the first at its outlet.

    Nodes of the second mesh are renumbered: corners of both first, then the middles of both.
    """
    mesh, image = pore.mesh, MIRRORS["along"](pore)
    middle = mesh.ends[1]
    shifted = image.mesh.points + [2 * middle, 0.0]
    first, corners = len(mesh.points), mesh.corners
    line = np.flatnonzero(mesh.points[:, 0] == middle)
    joined = np.full(len(shifted), -1)  # nodes of the line that both meshes share
    for node in np.flatnonzero(np.abs(shifted[:, 0] - middle) < 1e-9):
        joined[node] = line[np.abs(mesh.points[line, 1] - shifted[node, 1]).argmin()]
    new_corners = np.flatnonzero((joined < 0) & (np.arange(len(shifted)) < corners))
    new_middles = np.flatnonzero((joined < 0) & (np.arange(len(shifted)) >= corners))
    of_first = np.concatenate([np.arange(corners), np.arange(corners, first) + len(new_corners)])
    of_second = np.where(joined >= 0, of_first[joined], 0)
    of_second[new_corners] = corners + np.arange(len(new_corners))
    of_second[new_middles] = first + len(new_corners) + np.arange(len(new_middles))
    points = np.empty((first + len(new_corners) + len(new_middles), 2))
    points[of_second] = shifted
    points[of_first] = mesh.points
    cells = np.vstack([of_first[mesh.cells], of_second[image.mesh.cells]])
    region = np.concatenate([mesh.topology.region, 2 * image.mesh.topology.region])
    loops = (of_first[mesh.loop], of_second[image.mesh.loop])
    ends = (mesh.ends[0], 2 * middle - mesh.ends[0])
    space = Space(Mesh.of(points, cells, region, loops, mesh.walls, ends, mesh.topology.method))
    shift = [2 * middle, 0.0]
    other = image.body
    other = replace(other, solid=replace(other.solid, reference=other.solid.reference + shift))
    both = replace(pore, space=space, bodies=(pore.body, other), pressure=np.zeros(space.mesh.corners))
    return both, image, shift


def grown(scene, pore, factor):
    """The pore after its biomass has grown, and theta."""
    density = scene.kinetics.maximum_density
    points = np.einsum("qk,rki->rqi", pore.space.reaction.values, pore.space.points[pore.space.reaction.cells])
    rates = Rates(factor * (1 + 0.1 * np.sin(points[..., 1])), 0.1 * factor + 0 * points[..., 1])
    after = grow(pore, rates, 1.0)
    return after, growing.compute_theta(pore, after, density)


@pytest.mark.parametrize("width", [FREE, TOUCHING])
@EVERY
def test_each_of_two_aggregates_grows_and_moves_as_in_a_pore_of_its_own(order, width):
    """Masses, theta, shape, contact, moved mesh, surface and stress of an aggregate and its mirror image."""
    scene, one = one_pore(order, width)
    both, image, shift = paired(one)
    mechanics = Mechanics.of(scene)
    shapes = []
    for pore in (one, image, both):
        after, theta = grown(scene, pore, 0.1)
        expansion = contact.expand(mechanics, after, theta)
        assert len(expansion.pore.bodies) == len(theta) == len(pore.bodies)
        shapes.append((pore, after, theta, expansion))
    (_, _, theta_one, of_one), (_, _, theta_image, of_image), (_, after, theta, of_both) = shapes
    assert theta[0] == pytest.approx(theta_one[0], rel=1e-13) and theta[1] == pytest.approx(theta_image[0], rel=1e-13)
    for number, (alone, moved) in enumerate([(of_one.pore, 0.0), (of_image.pore, shift)]):
        region = of_both.pore.mesh.regions[number]
        expected = alone.mesh.points[alone.region.nodes] + moved
        assert of_both.pore.mesh.points[region.nodes] == pytest.approx(expected, abs=1e-7)
        assert np.array_equal(of_both.pore.bodies[number].wall, alone.body.wall)
        assert surfaces(of_both.pore)[number].least == pytest.approx(surfaces(alone)[0].least, rel=1e-6)
        assert of_both.pore.bodies[number].mass == pytest.approx(alone.mass, rel=1e-13)
    assert of_both.pore.mass == pytest.approx(of_one.pore.mass + of_image.pore.mass, rel=1e-13)
    loading = Loading.of(scene)
    peaks = [adhesion.tensile_peak(loading, pore, None).value for pore in (of_one.pore, of_both.pore)]
    assert peaks[1] == pytest.approx(peaks[0], rel=1e-5)
    compression = folding.most_compressed(Compression(), of_both.pore)
    assert compression.stretch == min(1.0, *(each.least for each in surfaces(of_both.pore)))
    touches = width == TOUCHING
    assert (of_one.pore.spanning, of_both.pore.spanning) == (touches, 2 * touches)
    assert len(of_both.divisions) == 2 * (touches and order == 2)
    if not touches:
        mesh = mesh_motion.moved(both.mesh, of_both.position[both.mesh.body])
        assert not mesh.turned_over().any()


@EVERY
def test_a_transfer_keeps_the_masses_of_each_aggregate(order):
    """A transfer between the same meshes; the second aggregate has half of the density of inert biomass."""
    scene, one = one_pore(order)
    both, *_ = paired(one)
    after, _ = grown(scene, both, 0.2)
    first, second = after.bodies
    after = replace(after, bodies=(first, replace(second, inert=0.5 * second.inert)))
    at = transfer.located(both.mesh.points, both.mesh.cells[both.mesh.biomass], both.mesh.points[both.mesh.body])
    method = scene.numerics.scheme.transfer
    active, inert = transfer_amounts(method, both.space, both.space, at, (after.active, after.inert),
                                     scene.kinetics.maximum_density)
    result = after.with_masses(active, inert)
    for before, body in zip(after.bodies, result.bodies):
        assert body.inert.sum() == pytest.approx(before.inert.sum(), rel=1e-9)
    restarted = growing.with_restarted_theta(result, scene.kinetics.maximum_density)
    assert [body.theta.shape for body in restarted.bodies] == [body.theta.shape for body in both.bodies]
    assert contiguous(restarted).mass == restarted.mass


@pytest.mark.parametrize("forces", [pytest.param("neglected", marks=pytest.mark.thorough), "included"])
@EVERY
def test_two_aggregates_grow_in_one_pore_and_balances_close(order, forces):
    """Steps with flow, substrates and new meshes. The loop refuses a step whose balances do not close. The
    aggregate upstream has more substrate, so it grows more."""
    preset, stepping = {1: ("paper", updates), 2: ("fast", midpoint_steps)}[order]
    scene = load_scene("base", [f"numerics.preset={preset}", "numerics.refinement=0.4", 'growth.end="7 h"',
                                'aggregate.radius="10 um"', "output.every=3.5 h", f"growth.fluid_forces={forces}"])
    seeding = Seeding.of(scene)
    outlines = [half_disc(10.0, 4.0, order, position) for position in (-25.0, 25.0)]
    start = RestartState(contiguous(seeding.around(outlines)), StepControl(1.0))
    states = list(loop.steps(scene, stepping.STEPPING, start))
    reports = [report for _, report in states if report]
    last = reports[-1].pore
    assert last.time == 7.0 and [len(report.pore.bodies) for report in reports] == [2] * len(reports)
    gains = [after.mass / before.mass for before, after in zip(start.pore.bodies, last.bodies)]
    assert gains[0] > gains[1] > 1.1
    areas = [outline.area for outline in last.outlines]
    assert areas == pytest.approx([body.mass / scene.kinetics.maximum_density for body in last.bodies], rel=0.02)
    assert sum(report.remeshes for report in reports) > 0


@pytest.mark.parametrize("position, refused", [(15.0, True), (50.0, False)])
def test_a_mesh_is_refused_if_two_aggregates_touch(position, refused):
    scene, one = one_pore(1)
    outlines = [one.boundary, half_disc(5.0, 2.0, 1, position)]
    if refused:
        with pytest.raises(MeshError, match="two aggregates touch"):
            mesher.check_apart(outlines)
        with pytest.raises(MeshError, match="two aggregates touch"):
            Seeding.of(scene).around(outlines)
    else:
        assert len(Seeding.of(scene).around(outlines).bodies) == 2


def test_a_pore_with_two_aggregates_has_no_only_one():
    _, one = one_pore(1)
    both, *_ = paired(one)
    with pytest.raises(ValueError):
        _ = both.body
    assert both.focused(1).body is both.bodies[1]
