"""Two aggregates in one pore: one and its mirror image, on the mesh of one and its mirror image.

What lies on one side of the middle does not act on the other one, except through the water. So each aggregate has the
shape, masses, stress and surface of the one in a pore of its own.
"""

from dataclasses import replace

import numpy as np
import pytest

from repro.errors import MeshError
from repro.fem import mesher, sizing, transfer
from repro.fem.mesh import Mesh
from repro.fem.outline import half_disc, polygon
from repro.fem.space import Space
from repro.fem.walls import BOTTOM, TOP, channel_walls
from repro.march import balance, folding, loop, midpoint, updates
from repro.march import stepping as midpoint_steps
from repro.march.ends import Detachment, Meeting, PoreEnd
from repro.march.state import Compression, RestartState, contiguous
from repro.march.step_control import StepControl
from repro.model import adhesion, contact, growing, mesh_motion, meshing
from repro.model.adhesion import Loading
from repro.model.biomass import Rates, grow, transfer_amounts
from repro.model.mechanics import Mechanics
from repro.model.meshing import Seeding, seeded
from repro.model.solving import Solver
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


def seeds_at(scene, *places):
    """Half-discs of a scene, each with a radius (um), x (um) and number of its wall."""
    walls = {wall.number: wall for wall in channel_walls(scene.pore.width)}
    across = sizing.ACROSS_AGGREGATE * scene.numerics.refinement
    return [half_disc(radius, across, scene.numerics.scheme.order, x, walls[number]) for radius, x, number in places]


def started(scene, *places):
    """The states of a run with half-discs."""
    stepping = {True: midpoint_steps, False: updates}[scene.numerics.scheme.controls_error].STEPPING
    pore = Seeding.of(scene).around(seeds_at(scene, *places))
    bodies = tuple(replace(body, name=str(number)) for number, body in enumerate(pore.bodies, 1))
    first = StepControl(stepping.first * scene.growth.time_step)
    return loop.steps(scene, stepping, RestartState(contiguous(replace(pore, bodies=bodies)), first))


@pytest.mark.parametrize("places", [
    ((8.0, 0.0, BOTTOM), (5.0, 2.0, TOP)), ((8.0, -30.0, TOP), (5.0, 30.0, TOP)),
    ((8.0, -40.0, BOTTOM), None, (6.0, 40.0, TOP)), ((6.0, -60.0, TOP), None, (8.0, 30.0, BOTTOM), None),
    (None, None)], ids=lambda places: "".join({BOTTOM: "b", TOP: "t"}[each[2]] if each else "s" for each in places))
@EVERY
def test_water_is_meshed_around_aggregates_on_either_wall_and_between_those_on_both(order, places):
    """None stands for an aggregate from wall to wall. Each region has the area of its outline, the fluid the rest."""
    width = 30.0
    scene = load_scene("base", [f"numerics.preset={dict(enumerate(('paper', 'fast'), 1))[order]}", "pore.width=30 um",
                                "numerics.refinement=0.3"])
    outlines = []
    for number, place in enumerate(places):
        if place:
            outlines += seeds_at(scene, place)
        else:
            points = np.array([[-4.0, 0.0], [-6.0, width], [5.0, width], [3.0, 0.0]]) + [40.0 * number - 40.0, 0.0]
            outlines.append(polygon(points, channel_walls(width), order))
    outlines.reverse()  # the list need not be in the order along the pore
    mesh, split = meshing.Meshing.of(scene).around(outlines)
    assert [outline.seat for outline in split] == [outline.seat for outline in outlines]
    dx = Space(mesh).at.dx.sum(axis=1)
    areas = [dx[region.triangles].sum() for region in mesh.regions]
    assert areas == pytest.approx([outline.area for outline in split], rel=1e-9)
    assert dx.sum() == pytest.approx(width * np.ptp(mesh.ends), rel=1e-9)
    assert sum(body is None for body in places) == sum(np.ptp(each.wall[each.wall > 0]) > 0 for each in split)


@EVERY
def test_a_film_between_two_aggregates_has_elements_as_small_as_one_at_a_wall(order):
    """Between two half-discs that face each other lie ten elements per refinement, and none without the second."""
    scene = load_scene("base", [f"numerics.preset={dict(enumerate(('paper', 'fast'), 1))[order]}", "pore.width=50 um",
                                "numerics.refinement=0.5"])
    facing = seeds_at(scene, (20.0, 0.0, BOTTOM), (20.0, 0.0, TOP))
    (_, beside), _ = sizing.each_beside(facing, meshing.sized(scene))
    film = sizing.film_sizes(facing[0].corners, beside)
    top = int(np.argmax(facing[0].corners.points[:, 1]))
    assert film[top] == pytest.approx(10.0 / 10 / 0.5, rel=1e-3)
    assert facing[0].film(facing[1]) == (pytest.approx(10.0, rel=1e-3), pytest.approx([0.0, 25.0], abs=0.2))


def test_each_aggregate_gets_the_growth_that_was_computed_for_it():
    """The correction of one aggregate does not depend on the other one."""
    scene, one = one_pore(2)
    both, *_ = paired(one)
    after, _ = grown(scene, both, 0.1)
    produced = tuple((factor * float((new.active - old.active).sum()), factor * float((new.inert - old.inert).sum()))
                     for factor, old, new in zip((1.01, 0.97), both.bodies, after.bodies))
    matched = midpoint._match_production(both, after, produced)
    for old, new, (active, inert) in zip(both.bodies, matched.bodies, produced):
        assert (new.active - old.active).sum() == pytest.approx(active, rel=1e-9)
        assert (new.inert - old.inert).sum() == pytest.approx(inert, rel=1e-9)


@pytest.mark.parametrize("opposite", [TOP, BOTTOM])
@EVERY
def test_two_aggregates_that_meet_end_the_run_there(order, opposite):
    """On opposite walls and on one wall. The end is located where the film is as thin as the least one."""
    preset = {1: "paper", 2: "fast"}[order]
    scene = load_scene("base", [f"numerics.preset={preset}", "numerics.refinement=0.4", "pore.width=40 um",
                                'growth.end="40 h"', 'growth.minimum_film="4 um"', 'growth.time_step="0.5 h"'])
    x = 0.0 if opposite == TOP else 30.0
    seeds = (12.0, -x / 2, BOTTOM), (10.0, x / 2, opposite)
    reports = []
    with pytest.raises(Meeting, match=r"^aggregates 1 and 2 meet at t = .* below growth.minimum_film, 4 um"):
        reports.extend(report for _, report in started(scene, *seeds) if report)
    films = [report.pore.outlines[0].film(report.pore.outlines[1])[0] for report in reports]
    assert len(films) > 1 and min(films[:-1]) > 4.0 and films[-1] == pytest.approx(4.0, rel=2e-4)


@pytest.mark.parametrize("side, x", [("upstream", -292.5), ("downstream", 292.5)])
def test_the_end_of_the_pore_names_the_aggregate_that_reaches_it(side, x):
    scene = load_scene("base", ["numerics.preset=fast", 'growth.end="1 h"'])
    with pytest.raises(PoreEnd, match=f"^aggregate 2 reaches the pore's {side} end at t = 0 h"):
        list(started(scene, (5.0, 20.0, BOTTOM), (5.0, x, TOP), (5.0, -20.0, BOTTOM)))


@pytest.mark.parametrize("transport", ["quasi_steady", "gear"])
@pytest.mark.parametrize("preset", ["paper", "fast"])
def test_an_aggregate_that_detaches_leaves_the_pore_with_its_mass(preset, transport):
    """The others stay as they were. Without any the pore is clean: its effluents are the supplies."""
    if (preset, transport) == ("fast", "gear"):
        pytest.skip("the scene is refused")
    refinement = {"paper": 0.4, "fast": 0.15}[preset]
    scene = load_scene("base", [f"numerics.preset={preset}", f"numerics.refinement={refinement}", 'growth.end="4 h"',
                                "growth.wall=bonded", 'growth.bonding_strength="4 kPa"', "output.every=1 h",
                                "growth.after_detachment=continue", f"numerics.transport={transport}"])
    reports = [report for _, report in started(scene, (5.0, -60.0, BOTTOM), (8.0, 60.0, TOP)) if report]
    names = [[body.name for body in report.pore.bodies] for report in reports]
    assert names[0] == ["1", "2"] and ["1"] in names and names[-1] == [] and ["2"] not in names
    assert reports[-1].pore.time == 4.0
    ledgers = [ledger for report in reports for ledger in report.ledgers]
    left = [ledger for ledger in ledgers if ledger.detached]
    assert len(left) == 2
    messages = [message.partition(" at t = ")[0] for report in reports for message in report.departed]
    assert messages == ["aggregate 2 detaches", "the aggregate detaches"]
    for ledger in ledgers:
        after = ledger.biomass_after + ledger.detached
        assert after == pytest.approx(ledger.biomass_before + ledger.biomass_made, rel=1e-9)
    for ledger, following in zip(ledgers, ledgers[1:]):
        assert following.biomass_before == pytest.approx(ledger.biomass_after, rel=1e-12)
    clean = Solver.of(scene).solve_flow(Seeding.of(replace(scene, aggregates=())).pore(1.0).space, scene.flow)
    assert reports[-1].solved.flow.conductivity == pytest.approx(clean.conductivity, rel=1e-6)
    supplies = [kind.supply for kind in (scene.substrates.acceptor, scene.substrates.donor)]
    if transport == "quasi_steady":
        assert [flux.effluent for flux in reports[-1].solved.fluxes] == pytest.approx(supplies, rel=1e-9)
    assert balance.oxygen_demand(scene.kinetics, ledgers[-1]) == balance.biomass(ledgers[-1]) == 0.0


@pytest.mark.parametrize("scheme", ["paper", "fast"])
def test_an_aggregate_that_a_jump_of_the_flow_takes_away_leaves_at_the_jump(scheme):
    """The head rises hundredfold at 1 h. The run goes on as a clean pore, and the ledger of the step has the mass."""
    scene = load_scene("base", [f"numerics.preset={scheme}", "numerics.refinement=0.2", 'growth.end="2 h"',
                                "growth.fluid_forces=included", 'growth.bonding_strength="1 Pa"', "output.every=1 h",
                                "growth.after_detachment=continue", 'growth.shear_modulus="1 kPa"',
                                'flow.head=[["0 h", "1e-3 cm"], ["1 h", "0.1 cm"]]'])
    reports = [report for _, report in started(scene, (8.0, 0.0, BOTTOM)) if report]
    assert [(report.pore.time, len(report.pore.bodies)) for report in reports][-2:] == [(1.0, 0), (2.0, 0)]
    (left,) = [ledger for report in reports for ledger in report.ledgers if ledger.detached]
    assert left.end == 1.0 and left.biomass_after == pytest.approx(0.0, abs=1e-6 * left.detached)


@pytest.mark.thorough
def test_an_aggregate_on_both_walls_does_not_leave():
    """A wall that gives way would set its surface free, and the model has no law for that: the run ends."""
    scene = load_scene("base", ["numerics.preset=fast", "pore.width=20 um", 'growth.end="12 h"', "growth.wall=bonded",
                                'growth.bonding_strength="12 kPa"', "growth.after_detachment=continue"])
    reports = []
    with pytest.raises(Detachment, match="^the aggregate detaches at t = "):
        reports.extend(report for _, report in started(scene, (16.0, 0.0, BOTTOM)) if report)
    assert reports[-1].pore.contact and len(reports[-1].pore.bodies) == 1


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
