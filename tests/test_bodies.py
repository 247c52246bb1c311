"""Two aggregates in one pore: masses, films, ends and departures. The cases of coupling_bodies.py compare their growth,
flow and uptake with those of aggregates in pores of their own."""

from dataclasses import replace

import numpy as np
import pytest

from repro import simulate
from repro.errors import MeshError
from repro.fem import mesher, sizing, transfer
from repro.fem.outline import half_disc
from repro.fem.walls import BOTTOM, TOP, channel_walls
from repro.march import balance, loop, midpoint, updates
from repro.march import stepping as midpoint_steps
from repro.march.ends import Detachment, Meeting, PoreEnd
from repro.march.state import RestartState, contiguous
from repro.march.step_control import StepControl
from repro.model import contact, growing, meshing
from repro.model.biomass import Rates, grow, transfer_amounts
from repro.model.mechanics import Mechanics
from repro.model.meshing import Seeding, seeded
from repro.model.solving import Solver
from repro.scene import load_scene
from tests.strategies import EVERY_ORDER, PRESET_OF


def pair(order, width=40, second=12):
    """A scene with an aggregate of 17.8 um and a second one, and its pore at t = 0."""
    aggregates = f'aggregate=[{{radius="17.8 um", position="-30 um"}}, {{radius="{second} um", position="30 um"}}]'
    scene = load_scene("base", [f"numerics.preset={PRESET_OF[order]}", "numerics.refinement=0.3",
                                f"pore.width={width} um", aggregates])
    return scene, seeded(scene)


def grown(scene, pore, factor):
    """The pore after its biomass has grown, and theta."""
    density = scene.kinetics.maximum_density
    points = np.einsum("qk,rki->rqi", pore.space.reaction.values, pore.space.points[pore.space.reaction.cells])
    rates = Rates(factor * (1 + 0.1 * np.sin(points[..., 1])), 0.1 * factor + 0 * points[..., 1])
    after = grow(pore, rates, 1.0)
    return after, growing.compute_theta(pore, after, density)


@EVERY_ORDER
def test_each_of_two_equal_aggregates_comes_into_contact(order):
    """Films of 2.2 um to the upper wall close, and both shapes are alike up to their meshes."""
    scene, both = pair(order, 20, 17.8)
    after, theta = grown(scene, both, 0.1)
    pore = contact.expand(Mechanics.of(scene), after, theta).pore
    first, second = pore.outlines
    with pytest.raises(ValueError):
        _ = pore.body
    assert pore.spanning == 2 and first.area > 1.05 * both.outlines[0].area
    assert second.area == pytest.approx(first.area, rel=1e-3)
    lengths = [each.contact_length(pore.mesh.walls[1]) for each in (first, second)]
    assert lengths[1] == pytest.approx(lengths[0], rel=0.02)  # the meshes differ; 0.4 % is measured


def test_an_aggregate_comes_into_contact_after_another():
    """The lines of the first one have predicted positions then, those of the second one do not."""
    scene = load_scene("base", [
        "numerics.preset=fast", "numerics.refinement=0.2", 'pore.width="20 um"', 'pore.length="150 um"',
        'aggregate=[{radius="17.98 um", position="-40 um"}, {radius="17.9 um", position="40 um"}]',
        'flow.mean_velocity="2.9 m/day"', 'growth.end="0.08 h"', 'output.times=["0.08 h"]'], unset=["flow.head"])
    assert [report.pore.spanning for report in simulate(scene)] == [0, 2]


@EVERY_ORDER
def test_a_transfer_keeps_the_masses_of_each_aggregate(order):
    """A transfer between the same meshes; the second aggregate has half of the density of inert biomass."""
    scene, both = pair(order)
    after, _ = grown(scene, both, 0.2)
    first, second = after.bodies
    after = replace(after, bodies=(first, replace(second, inert=0.5 * second.inert)))
    at = transfer.located(both.mesh.points, both.mesh.cells[both.mesh.biomass], both.mesh.points[both.mesh.body])
    method = scene.numerics.scheme.transfer
    active, inert = transfer_amounts(method, both.space, both.space, at, (after.active, after.inert),
                                     scene.kinetics.maximum_density * both.space.reaction.dx)
    result = after.with_masses(active, inert)
    for before, body in zip(after.bodies, result.bodies):
        assert body.inert.sum() == pytest.approx(before.inert.sum(), rel=1e-9)
    restarted = growing.with_restarted_theta(result, scene.kinetics.maximum_density)
    assert [body.theta.shape for body in restarted.bodies] == [body.theta.shape for body in both.bodies]
    assert contiguous(restarted).mass == restarted.mass


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


@EVERY_ORDER
def test_a_film_between_two_aggregates_has_elements_as_small_as_one_at_a_wall(order):
    """Between two half-discs that face each other lie ten elements per refinement, and none without the second."""
    scene = load_scene("base", [f"numerics.preset={PRESET_OF[order]}", "pore.width=50 um",
                                "numerics.refinement=0.5"])
    facing = seeds_at(scene, (20.0, 0.0, BOTTOM), (20.0, 0.0, TOP))
    (_, beside), _ = sizing.each_beside(facing, meshing.sized(scene))
    film = sizing.film_sizes(facing[0].corners, beside)
    top = int(np.argmax(facing[0].corners.points[:, 1]))
    assert film[top] == pytest.approx(10.0 / 10 / 0.5, rel=1e-3)
    assert facing[0].film(facing[1]) == (pytest.approx(10.0, rel=1e-3), pytest.approx([0.0, 25.0], abs=0.2))


def test_each_aggregate_gets_the_growth_that_was_computed_for_it():
    """The correction of one aggregate does not depend on the other one."""
    scene, both = pair(2)
    after, _ = grown(scene, both, 0.1)
    produced = tuple((factor * float((new.active - old.active).sum()), factor * float((new.inert - old.inert).sum()))
                     for factor, old, new in zip((1.01, 0.97), both.bodies, after.bodies))
    matched = midpoint._match_production(both, after, produced)
    for old, new, (active, inert) in zip(both.bodies, matched.bodies, produced):
        assert (new.active - old.active).sum() == pytest.approx(active, rel=1e-9)
        assert (new.inert - old.inert).sum() == pytest.approx(inert, rel=1e-9)


@EVERY_ORDER
def test_two_aggregates_that_meet_on_one_wall_end_the_run_there(order):
    """Where the film is as thin as the least one. The case coupling-meeting has opposite walls."""
    scene = load_scene("base", [f"numerics.preset={PRESET_OF[order]}", "numerics.refinement=0.4", "pore.width=40 um",
                                "growth.meeting=end",
                                'growth.end="40 h"', 'growth.minimum_film="4 um"', 'growth.time_step="0.5 h"'])
    seeds = (12.0, -15.0, BOTTOM), (10.0, 15.0, BOTTOM)
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


@pytest.mark.parametrize("transport", ["quasi_steady", pytest.param("gear", marks=pytest.mark.thorough)])
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


@pytest.mark.parametrize("scheme", ["paper", pytest.param("fast", marks=pytest.mark.thorough)])
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
    scene, _ = pair(1)
    outlines = [half_disc(17.8, 2.0, 1, 3.0), half_disc(5.0, 2.0, 1, position)]
    if refused:
        with pytest.raises(MeshError, match="two aggregates touch"):
            mesher.check_apart(outlines)
        with pytest.raises(MeshError, match="two aggregates touch"):
            Seeding.of(scene).around(outlines)
    else:
        assert len(Seeding.of(scene).around(outlines).bodies) == 2
