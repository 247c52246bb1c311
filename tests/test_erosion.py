"""Erosion: how an outline recedes, what stays, how a run ends, and what is refused."""

import numpy as np
import pytest

import repro
from reference import erosion as reference
from repro import results
from repro.errors import ErosionError
from repro.fem import recession
from repro.fem.outline import half_disc, polygon
from repro.fem.walls import BOTTOM, FREE, channel_walls
from repro.march import eroding
from repro.march.state import Report
from repro.model.erosion import Erosion
from repro.model.meshing import seeded
from repro.model.solving import Solver
from repro.model.stages import Stages
from repro.runs.status import is_over
from repro.scene import SceneError, load_scene
from verification.problems.erosion import MU, erosion, shaped
from verification.problems.erosion import half_disc as growing_disc

WALLS = channel_walls(50.0)


def receded(outline, distance):
    """An outline of arcs after a recession (um), without the arcs that it passes."""
    while True:
        moves = distance * recession.directions(outline)
        fewer = recession.merged(outline, moves)
        if fewer is None:
            return recession.moved(outline, moves)
        outline = fewer


@pytest.mark.parametrize("angle", [60, 90, 120])
def test_straight_sides_recede_in_parallel(angle):
    """A trapezoid whose sides leave the wall at an angle. Its contact lines recede by the distance over the sine, its
    upper corners along the line that halves them, and small arcs beside its corners vanish."""
    half, height, distance = 12.0, 8.0, 1.0
    inwards = height / np.tan(np.radians(angle))
    corners = [(-half, 0), (inwards - half, height), (half - inwards, height), (half, 0)]
    outline = polygon(corners, WALLS, 2, at_tips=0.01)
    shape = receded(outline, distance)
    base = half - distance / np.sin(np.radians(angle))
    lower = base - (height - distance) / np.tan(np.radians(angle))
    assert (-shape.upstream, shape.downstream) == pytest.approx([max(base, lower)] * 2, abs=1e-9)
    assert shape.contact_length(WALLS[0]) == pytest.approx(2 * base, abs=1e-9)
    assert shape.area == pytest.approx((base + lower) * (height - distance), rel=1e-9)
    assert shape.thickness == pytest.approx(height - distance)
    recession.refuse_invalid(shape, WALLS)
    arcs = shape.arcs(shape.points)
    chords = arcs[:, 2] - arcs[:, 0]
    part = np.sum((arcs[:, 1] - arcs[:, 0]) * chords, axis=1) / np.sum(chords**2, axis=1)
    assert np.abs(part - 0.5).max() <= recession.CENTRED and (shape.wall[[0, -1]] == [BOTTOM, FREE]).all()


def test_two_arcs_of_a_circle_join_to_an_arc_with_its_middle():
    """One of the two is half as long as the other."""
    outline = half_disc(10.0, 4.0, 2)
    angles = np.array([0.0, 0.15, 0.3, 0.375, 0.45]) + 1.0
    nodes = np.flatnonzero(outline.wall == FREE)[5:10]
    outline.points[nodes] = 10.0 * np.column_stack([np.cos(angles), np.sin(angles)])
    joined = recession._joined(outline, nodes[2] // 2)
    assert len(joined.points) == len(outline.points) - 2
    middle = 10.0 * np.array([np.cos(1.225), np.sin(1.225)])
    assert np.linalg.norm(joined.points - middle, axis=1).min() < 1e-3


def test_a_fixed_point_stays_until_a_line_passes_it():
    """The downstream line recedes; the points between it and the fixed one move, the others stay."""
    outline = half_disc(10.0, 2.0, 2)
    last = int(np.flatnonzero(outline.points[:, 0] == 10.0)[0])
    shapes = []
    for distance in (4.0, 14.0):
        moves = np.zeros_like(outline.points)
        moves[last, 0] = -distance
        shapes.append(recession.moved(outline, moves).points[outline.fixed][0, 0])
    assert shapes[0] == 0.0 and -10.0 < shapes[1] < -4.0


def test_a_surface_that_crosses_itself_is_refused():
    """A notch closes upwards as its sides recede; its bottom passes the wall."""
    outline = polygon([(-20, 0), (-10, 9), (0, 1), (10, 9), (20, 0)], WALLS, 2)
    lowered = recession.moved(outline, 1.5 * recession.directions(outline))
    with pytest.raises(ErosionError, match="crosses itself"):
        recession.refuse_invalid(lowered, WALLS)
    scene = shaped(erosion("constant", 1.5), 'aggregate.outline=[["-20 um", "0 um"], ["-10 um", "9 um"], '
                         '["0 um", "1 um"], ["10 um", "9 um"], ["20 um", "0 um"]]')
    with pytest.raises(ErosionError, match="crosses itself"):
        Erosion.of(scene).erode(seeded(scene), 1.0, 0.0)


def test_what_is_inside_keeps_its_composition():
    """The share of inert biomass rises linearly from the wall. What stays has the integral of this share over the
    smaller half-disc, and the present shape as its reference."""
    radius, speed, density = 10.0, 0.5, 300.0
    scene = growing_disc(radius, erosion("constant", speed), "numerics.refinement=0.6")
    pore = seeded(scene)
    y = pore.space.points[pore.space.reaction.cells][..., 1] @ pore.space.reaction.values.T
    share = 0.1 + 0.05 * y
    total = density * pore.space.reaction.dx
    mixed = pore.with_masses(total * (1 - share), total * share)
    rest = Erosion.of(scene).erode(mixed, 1.0, 0.0)
    smaller = radius - speed
    inert = density * (0.1 * np.pi / 2 * smaller**2 + 0.05 * 2 / 3 * smaller**3)
    assert rest.inert.sum() == pytest.approx(inert, rel=1e-4)
    assert rest.mass == pytest.approx(density * np.pi / 2 * smaller**2, rel=1e-4)
    (body,) = rest.bodies
    assert body.theta == pytest.approx(1.0, abs=1e-9)
    assert np.array_equal(body.reference, rest.mesh.points[rest.region.nodes])


#: Two half-discs whose radii, places and walls differ: number, radius (um) and place (um).
TWO = ((0, 10.0, -40.0, "lower"), (1, 6.0, 30.0, "upper"))
SEEDS = ", ".join(f'{{radius="{radius} um", position="{x} um", wall="{wall}"}}' for _, radius, x, wall in TWO)


def column(row, number):
    return row[f"aggregate_{number + 1}_eroded_ug_per_m_per_h"]


@pytest.mark.parametrize("number, radius", [body[:2] for body in TWO])
@pytest.mark.parametrize("law, coefficient, power", [("constant", 0.3, 1), ("thickness squared", 0.02, 3)])
def test_each_aggregate_has_the_rate_at_which_it_erodes(number, radius, law, coefficient, power):
    """X_m times the integral over the half-circle: pi v R, and pi k R^3 / 2. A run of one aggregate has no column."""
    scene = load_scene(shaped(erosion(law, coefficient)), [f"aggregate=[{SEEDS}]"])
    pore = seeded(scene)
    row = results.row(scene, Report(pore, Solver.of(scene).solve(pore), None, (), 0, {}))
    swept = np.pi * coefficient * radius**power * {1: 1.0, 3: 0.5}[power]
    expected = 1e-6 * scene.kinetics.maximum_density * swept
    assert column(row, number) == pytest.approx(expected, rel=2e-4)  # arcs of fast
    assert not [name for name in results.column_names(growing_disc(10.0)) if "eroded" in name]
    without = load_scene(shaped(), [f"aggregate=[{SEEDS}]"])
    assert column(results.row(without, Report(pore, Solver.of(without).solve(pore), None, (), 0, {})), number) is None


@pytest.mark.parametrize("number", [body[0] for body in TWO])
@pytest.mark.parametrize("law, coefficient, error", [
    ("constant", 0.3, 1e-12), ("thickness squared", 0.01, 1e-4), ("shear", 400.0, 0.02)])
def test_the_eroded_rate_is_what_an_aggregate_loses(number, law, coefficient, error):
    """In a duration dt an aggregate loses dt times the mean of its rates before and after, with an error of dt^3. By
    shear the meshes before, half-way and after differ: 1.2, 0.2, 0.12, 0.05 % at refinements of 0.3, 0.6, 1.2, 2.4."""
    scene = load_scene(shaped(), [f"aggregate=[{SEEDS}]", 'flow.mean_velocity="2.9 m/day"', erosion(law, coefficient)])
    solver, duration = Solver.of(scene), 0.05
    before = seeded(scene)
    after = Erosion.of(scene).erode(before, duration, 0.0)
    rates = [column(results.row(scene, Report(pore, solver.solve(pore), None, (), 0, {})), number)
             for pore in (before, after)]
    lost = before.bodies[number].mass - after.bodies[number].mass
    assert lost > 1e-3 * before.bodies[number].mass
    assert 1e-6 * lost / duration == pytest.approx(np.mean(rates), rel=error)


def run(scene):
    """The reports of a run, and its status."""
    reports = []
    try:
        reports.extend(repro.simulate(scene))
    except (repro.Detachment, repro.Steady) as end:
        return reports, str(end)
    return reports, "completed"


def test_the_tolerance_bounds_the_error_of_erosion():
    """The growth is uniform and has no error. The length of a step follows from what is detached in its halves."""
    tolerance = 0.0025
    scene = growing_disc(10.0, erosion("constant", 0.8), f"numerics.tolerance={tolerance}", 'growth.end="6 h"',
                         'output.times=["6 h"]')
    (_, last), _ = run(scene)
    error = last.pore.boundary.thickness / reference.half_disc(10.0, MU, 0.8, 6.0) - 1
    assert 0.001 * tolerance < abs(error) < 0.3 * tolerance


def test_a_row_within_a_step_is_that_of_a_shorter_step():
    scene = growing_disc(10.0, erosion("constant", 0.3), 'growth.end="3 h"', 'output.times=["0.7 h", "3 h"]')
    reports, _ = run(scene)
    assert [report.pore.time for report in reports] == [0.0, 0.7, 3.0]
    for report in reports:
        expected = reference.half_disc(10.0, MU, 0.3, report.pore.time)
        assert report.pore.boundary.thickness == pytest.approx(expected, abs=1e-3)
    assert not any(ledger.end < 1 for report in reports for ledger in report.ledgers)


@pytest.mark.parametrize("after", ["end", "continue"])
def test_an_aggregate_that_is_eroded_ends_the_run_or_leaves(after):
    """It comes to the least film. The run ends there, or goes on as a clean pore; the ledger has its mass."""
    scene = growing_disc(3.0, erosion("constant", 0.5), 'growth.end="6 h"', 'output.times=["6 h"]',
                         f"growth.after_detachment={after}")
    reports, status = run(scene)
    ledgers = [ledger for report in reports for ledger in report.ledgers]
    time = 2 / MU * np.log((10 - 2) / (10 - 3))
    if after == "end":
        assert status.startswith("the aggregate is eroded at t = ") and is_over(status)
        assert reports[-1].pore.boundary.thickness == pytest.approx(2.0, rel=2e-4)
        assert reports[-1].pore.time == pytest.approx(time, rel=0.01)
    else:
        assert status == "completed" and reports[-1].pore.bodies == () and reports[-1].pore.time == 6.0
    for ledger in ledgers:
        left = ledger.biomass_after + ledger.detached
        assert left == pytest.approx(ledger.biomass_before + ledger.biomass_made, rel=1e-12)
    columns = results.ledger_row(scene, ledgers[0])
    assert columns[-1] == ledgers[0].detached > 0


@pytest.mark.parametrize("radius, steady", [(10, True), (11, False)])
def test_a_run_ends_as_steady_only_if_asked_for_and_steady(radius, steady):
    """The balance at 2 v / mu = 10 um is not stable, but a run of hours stays there."""
    changes = (erosion("constant", 0.5), 'growth.end="1 h"', 'output.times=["1 h"]',
               'growth.steady_tolerance="1e-3 1/h"')
    _, status = run(growing_disc(radius, *changes, "growth.until=steady"))
    assert (status == "completed") is not steady
    assert not steady or status.startswith("the aggregates are steady at t = ") and is_over(status)
    assert run(growing_disc(radius, *changes))[1] == "completed"


def test_no_state_is_steady_before_the_last_time_of_a_table():
    scene = growing_disc(10.0, erosion("constant", 0.5), 'growth.end="2 h"', "growth.until=steady",
                         'output.times=["2 h"]',
                         'substrates.donor.supply=[["0 h", "10 mg/L"], ["1 h", "12 mg/L"]]')
    reports, status = run(scene)
    assert status.startswith("the aggregates are steady") and reports[-1].pore.time > 1.0


def test_a_step_that_erodes_a_contact_surface_ends_the_run():
    """The lines of the upper contact surface would pass each other."""
    scene = shaped(erosion("constant", 0.5), 'pore.width="8 um"', 'aggregate.outline=[["-6 um", "0 um"], '
                   '["-0.5 um", "8 um"], ["0.5 um", "8 um"], ["6 um", "0 um"]]')
    stages, pore = Stages.of(scene), seeded(scene)
    status = "erosion takes a contact surface at y = 8 um in the step from t = 0 h"
    with pytest.raises(repro.Detachment, match=f"^{status}$"):
        eroding.attempt(stages, pore, stages.solver.solve(pore), 2.0)
    assert is_over(status)


@pytest.mark.parametrize("changes, message", [
    (("numerics.preset=paper",), "growth.erosion"),
    (("growth.new_biomass=stressed",), "growth.new_biomass = 'stressed'|\"stress_free\" is needed"),
    (('growth.erosion.speed="1 um/h"', "growth.erosion.law=shear"), "growth.erosion"),
    (('growth.erosion.critical_shear="1 Pa"',), "\"shear\" is needed|growth.erosion.law = \"shear\" is needed"),
    (('growth.erosion.thickness_coefficient="1 1/um/h"',), "is needed"),
    *((("growth.erosion={}", f'growth.erosion.law="{law}"'), "is missing|needed with")
      for law in ("constant", "thickness squared", "shear"))])
def test_scenes_without_a_model_of_erosion_are_refused(changes, message):
    with pytest.raises(SceneError, match=message):
        load_scene("base", ["numerics.preset=fast", "growth.new_biomass=stress_free", erosion("constant", 0.1),
                            *changes])
