"""Films and wedges that close (2.3.3): nodes of straight edges, and contact lines anywhere on arcs."""

import signal
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from repro.errors import GrowthError, Interrupted, SimulationError
from repro.fem import linear
from repro.fem.division import Division
from repro.fem.outline import Outline, polygon
from repro.fem.space import Space
from repro.fem.walls import BOTTOM, FREE, TOP, channel_walls, numbered
from repro.march import midpoint, simulation
from repro.march.simulation import simulate
from repro.march.state import RestartState
from repro.march.step_control import StepControl
from repro.model import closing_by_lines, contact, contact_lines, contact_newton, growth, traction
from repro.model.closing_by_lines import ByLines, divided
from repro.model.closing_by_nodes import closing_nodes
from repro.model.configuration import FromPrevious
from repro.model.contact_lines import PATIENT, Clearance, Contact
from repro.model.mechanics import Mechanics
from repro.model.meshing import seeded
from repro.runs.execution import Watch, resume, run
from repro.runs.state_arrays import pack_state, unpack_state
from repro.scene import load_scene
from tests.shell import files
from tests.strategies import EVERY_ORDER, coarse_base, mirrored, plug

FILM, ANGLE = 2.0, np.radians(16.7)


def beside_contact(along, gap, second_node=(30.0, 20.0), width=100.0):
    """Lower contact from x = -40 to 10 um; the next node is ``gap`` above the wall and ``along`` beyond the contact
    line."""
    points = np.array([[-40.0, 0.0], [0.0, 0.0], [10.0, 0.0], [10.0 + along, gap], second_node, (-30.0, 30.0)])
    wall = np.array([BOTTOM] * 3 + [FREE] * 3)
    return Outline(points, wall, np.arange(6) == 1, points.copy())


def beside_upper_contact(gap):
    """A plug of 20 um. The node 2 um downstream of its upper contact line is ``gap`` below the wall."""
    outline = plug(100.0, -10.0, 10.0)
    points = np.insert(outline.points, 3, [[12.0, 100.0 - gap]], axis=0)
    return Outline(points, np.insert(outline.wall, 3, FREE), np.insert(outline.fixed, 3, False), points)


def joins(outline, width=100.0):
    return closing_nodes(outline, channel_walls(width), FILM, ANGLE).tolist()


NONE = [FREE] * 6


@pytest.mark.parametrize("name, outline, expected", [
    ("a wedge of 11 degrees closes", beside_contact(1.0, 0.2), [0, 0, 0, BOTTOM, 0, 0]),
    ("a wedge of 16.6 degrees closes", beside_contact(1.0, np.tan(np.radians(16.6))), [0, 0, 0, BOTTOM, 0, 0]),
    ("a wedge of 16.8 degrees stays", beside_contact(1.0, np.tan(np.radians(16.8))), NONE),
    ("a gap over 2 um stays whatever its angle", beside_contact(10.0, 2.1), NONE),
    ("a thin gap far from contact closes", beside_contact(10.0, 1.9), [0, 0, 0, BOTTOM, 0, 0]),
    ("a node through the wall closes", beside_contact(1.0, -0.01), [0, 0, 0, BOTTOM, 0, 0]),
    ("so does one that leans back over the contact", beside_contact(-1.0, -0.01), [0, 0, 0, BOTTOM, 0, 0]),
    ("a steep side stays", beside_contact(-1.0, 0.5), NONE),
    ("no fluid is trapped behind a closing node", beside_contact(1.0, 1.9, (18.0, 1.5)), [0, 0, 0, BOTTOM, BOTTOM, 0]),
    ("a node behind a valley stays", beside_contact(1.0, 3.0, (18.0, 1.5)), NONE),
    ("of two films to the opposite wall the thinner one closes",
     replace(beside_contact(1.0, 3.0), points=np.array([[-10, 0], [0, 0], [10, 0], [12, 98.4], [0, 50], [-12, 98.2]])),
     [0, 0, 0, TOP, 0, 0]),
    ("a film of 2.01 um to the opposite wall stays", beside_contact(5.0, 30.0, (0.0, 97.99)), NONE),
    ("a film of 1.99 um closes", beside_contact(5.0, 30.0, (0.0, 98.01)), [0, 0, 0, 0, TOP, 0]),
    ("a node through the opposite wall closes", beside_contact(5.0, 30.0, (0.0, 100.5)), [0, 0, 0, 0, TOP, 0]),
    ("a wedge under the upper wall closes", beside_upper_contact(0.2), [0, 0, 0, TOP, 0, 0, 0]),
    ("a wide one stays, though a film of 1.2 um", beside_upper_contact(1.2), [FREE] * 7),
])
def test_nodes_close_beside_a_contact_surface(name, outline, expected):
    """The minimum angle is 16.7 degrees, and the minimum film is 2 um (Table 1)."""
    assert joins(outline) == expected
    assert joins(mirrored(outline)) == expected[::-1]


#: Relative tolerance by which water is thicker than a film.
THICKER = 0.0025
#: {free surface beyond a contact line: (um along the wall and um of film of its points, film (um) that would enclose
#: water and its place, um)}. The surface then rises to 15 um.
SURFACES = {
    "a valley": ([(1, 3), (4, 6), (8, 6), (10, 1.5), (14, 1.8)], (1.5, 10)),
    "a valley behind a wedge that closes": ([(1, 0.2), (4, 1.9), (4, 9), (7, 9), (7, 1.5), (10, 1.8)], (1.5, 7)),
    "a film that still closes": ([(1, 3), (4, 6), (8, 6), (10, 2.5), (14, 2.8)], (2.5, 10)),
    "a film that only becomes thicker": ([(1, 0.6), (4, 1.5), (8, 1.8), (10, 1.9), (14, 2.5)], None),
    "a shallow wave that closes as a whole": ([(1, 1.7), (4, 1.95), (8, 1.5), (12, 3)], None),
    "a wave within the tolerance": ([(2, 1.99), (5, 2.004), (6, 2.004), (9, 1.99), (12, 5)], None),
    "a crack": ([(3, 1.8), (3.1, 9), (3.2, 1.8), (8, 1.7), (12, 5)], None),
    "a crack over the contact": ([(-6, 5), (-6.5, 6), (0.5, 1.8), (8, 1.7), (12, 5)], None),
    "a thick film": ([(2, 5), (8, 9), (12, 4.5)], None),
}


@pytest.mark.parametrize("surface", SURFACES)
@pytest.mark.parametrize("wall", [BOTTOM, TOP])
@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("geometry", [1, 2])
def test_a_contact_line_does_not_cross_a_valley(surface, wall, side, geometry):
    """A circle that is thicker than the film fits into it. Other water closes with the film behind it."""
    points, second = SURFACES[surface]
    rim = np.array([(0, 0), *points, (20, 15)]) + [10.0, 0.0]
    if wall == BOTTOM:
        corners = np.vstack([[(-10, 0), (-10, 20), (30, 20)], rim[::-1]])
    else:
        corners = np.vstack([[(-10, 0), (-10, 20)], [0.0, 20.0] + [1.0, -1.0] * rim, [(30, 0)]])
    walls = channel_walls(20.0)
    outline = polygon(corners if side == 1 else corners[::-1] * [-1.0, 1.0], walls, geometry)
    found = list(contact_lines.second_contacts(outline, walls, FILM, THICKER))
    assert len(found) == (second is not None)
    for place, film, (x, y) in found:
        assert (film, x) == pytest.approx((second[0], side * (10 + second[1])), abs=1e-9)
        assert place.number == wall and place.film(np.array([x, y])) == pytest.approx(film)
    closing = [d for d, film in points if film < min(FILM, np.tan(ANGLE) * d) and (second is None or d < second[1])]
    if geometry == 1:
        joins = closing_nodes(outline, walls, FILM, ANGLE, THICKER)
        assert np.abs(outline.points[joins == wall, 0]).max(initial=10.0) - 10.0 == max(closing, default=0.0)
    else:
        rule = Clearance(walls, FILM, ANGLE, THICKER)
        (value, reach), = [rule.beyond(outline, line.node, line.direction) for line in contact_lines.lines_of(outline)
                           if line.wall == wall and side * outline.points[line.node, 0] > 0]
        assert (value < 0) == (reach > 0) == bool(closing)


def test_water_between_two_contact_surfaces_with_a_wall_is_not_behind_a_film():
    """Its surface belongs to the nearer line of both."""
    corners = np.array([(-10, 0), (-10, 20), (-3, 20), (0, 12), (3, 20), (10, 20), (10, 0)], float)
    walls = channel_walls(20.0)
    outline = replace(polygon(corners[[0, 1, 5, 6]], walls), points=corners, wall=np.array([1, 2, 2, 0, 2, 2, 1]))
    outline = replace(outline, points=corners[::-1], wall=outline.wall[::-1])
    assert not list(contact_lines.second_contacts(outline, walls, FILM, THICKER))


RULE = Clearance(channel_walls(20.0), FILM, ANGLE)


def clearances(outline, rule=RULE):
    """{(wall, direction): clearance} for all contact lines of an outline with arcs."""
    return {line.key: rule.beyond(outline, line.node, line.direction)[0] for line in contact_lines.lines_of(outline)}


def wedge(degrees, height=20.0, arcs=6):
    """A plug whose sides make an angle with the upper wall in the fluid."""
    side = np.linspace(0, 1, arcs + 1)[:, None]
    left = [-30.0, 0.0] + np.hstack([(side - 1) / np.tan(np.radians(degrees)), side]) * height
    return polygon(np.vstack([left, left[::-1] * [-1, 1]]), channel_walls(height), 2)


@pytest.mark.parametrize("degrees, clearance", [(16.6, np.tan(np.radians(16.6)) / np.tan(ANGLE) - 1), (16.7, 0.0),
                                                (30.0, np.tan(np.radians(30.0)) / np.tan(ANGLE) - 1)])
def test_clearance_of_a_straight_wedge_is_that_of_its_angle(degrees, clearance):
    """Both upper contact lines have the same clearance. The surface leans over the fluid at the lower lines."""
    values = clearances(wedge(degrees))
    assert values[TOP, 1] == pytest.approx(clearance, abs=1e-9)
    assert values[TOP, -1] == pytest.approx(clearance, abs=1e-9)
    assert min(values[BOTTOM, 1], values[BOTTOM, -1]) >= 0


@pytest.mark.parametrize("gap, clearance", [(1.9, -0.05), (2.0, 0.0), (2.1, 0.05)])
@pytest.mark.parametrize("mirror", [False, True])
def test_clearance_sees_a_film_that_runs_along_the_wall(gap, clearance, mirror):
    """The surface leaves the wall steeply, runs along it at a constant distance, and then departs."""
    under = 20.0 - gap
    rim = [[-60.0, 0.0], [-50.0, under], [-5.4, under], [-5.0, 20.0], [5.0, 20.0], [30.0, 0.0]]
    outline = polygon(np.array(rim), channel_walls(20.0), 2)
    upstream = -1 if mirror else 1
    values = clearances(mirrored(outline) if mirror else outline)
    assert values[TOP, upstream] == pytest.approx(clearance, abs=1e-9)
    assert values[TOP, -upstream] > 1


@pytest.mark.parametrize("length, clearance", [(1.25, None), (1.45, -0.708), (4.5, -0.708)])
@pytest.mark.parametrize("mirror", [False, True])
def test_clearance_ignores_the_angle_close_to_the_line(length, clearance, mirror):
    """A wedge of 5 degrees beside the line ends in a step. A fifth of film / tan(angle) is 1.33 um."""
    low = 20.0 - length * np.tan(np.radians(5.0))
    rim = [[-60.0, 0.0], [-5.0 - length - 0.01, 16.0], [-5.0 - length, low], [-5.0, 20.0], [5.0, 20.0], [30.0, 0.0]]
    outline = polygon(np.array(rim), channel_walls(20.0), 2)
    value = clearances(mirrored(outline) if mirror else outline)[TOP, -1 if mirror else 1]
    assert value == pytest.approx(clearance, abs=1e-3) if clearance else value > 0.5


def test_a_surface_through_the_wall_has_a_negative_clearance():
    """The arc leans back over the contact surface while it lies beyond the wall. Elsewhere it is well below it."""
    outline = wedge(30.0)
    points = outline.points.copy()
    middle = np.flatnonzero(outline.wall == TOP)[-1] + 1
    points[middle] = [points[middle - 1, 0] + 1.0, 20.05]
    assert min(clearances(replace(outline, points=points)).values()) < -0.1


@pytest.fixture(scope="module")
def plugged():
    """Scene and pore of an aggregate in contact with the upper wall for two hours, with large elements at its lines."""
    scene = load_scene("wide", ["numerics.preset=fast", "numerics.contact_elements=0", 'pore.width="25 um"',
                                'output.times=["17 h"]', 'growth.end="17 h"'])
    return scene, [*simulate(scene)][-1].pore


@pytest.fixture(scope="module")
def division(plugged):
    """The plugged mesh with one divided arc on either side of the upper contact surface."""
    wall = plugged[1].boundary.edge_wall
    arcs = np.flatnonzero((wall == FREE) & ((np.roll(wall, 1) == TOP) | (np.roll(wall, -1) == TOP)))
    assert len(arcs) == 2
    return Division(plugged[1].mesh, arcs, np.array([0.3, 0.85]))


def test_a_division_changes_no_shape_and_no_field(plugged, division):
    pore = plugged[1]
    mesh = division.mesh
    x, y = pore.mesh.points.T
    field = 1 + x * y - 3 * y**2
    assert mesh.area() == pytest.approx(pore.mesh.area(), rel=1e-13)
    assert len(mesh.points) == len(pore.mesh.points) + 8 and not mesh.turned_over().any()
    assert np.sort(np.unique(mesh.cells)).tolist() == list(range(len(mesh.points)))
    assert division.restricted(mesh.points) == pytest.approx(pore.mesh.points, abs=1e-11)
    assert division.restricted(division.nodal(field)) == pytest.approx(field, rel=1e-11)
    amounts = division.amounts(pore.active, pore.space.table)
    assert amounts.sum() == pytest.approx(pore.active.sum(), rel=1e-14)
    density = amounts / Space(mesh).reaction.dx
    before = pore.active / pore.space.reaction.dx
    assert before.min() * 0.99 < density.min() and density.max() < before.max() * 1.01


def test_a_division_also_divides_the_reference_of_strain(plugged, division):
    pore = plugged[1]
    last = 1.01 * pore.mesh.points[pore.mesh.body]
    free = np.full(2, FREE)
    touching = Contact(pore.body.wall, division.arcs, division.t, free, free)
    parted = divided(pore.with_body(configuration=FromPrevious(last)), division, touching)
    assert parted.body.unstrained == pytest.approx(1.01 * division.mesh.points[division.mesh.body], rel=1e-13)


def grown_lines(pore, advance):
    """Lines of a pore, those of the upper wall advanced by so many arcs."""
    lines = contact_lines.lines_of(pore.boundary)
    for line in lines:
        line.advance = advance if line.wall == TOP else 0.0
    return lines


def expanded_by(scene, pore, factor, guess=None):
    """The new shape of a pore whose biomass has grown by a factor. Newton's method starts from lines at rest."""
    at_rest = contact_lines.SearchOptions(advances={(0, TOP, direction): 0.0 for direction in (1, -1)})
    return contact.expand(Mechanics.of(scene), pore, [factor * pore.body.theta], guess, at_rest)


@pytest.mark.parametrize("rheology", ["stressed", "stress_free"])
def test_the_residual_changes_with_a_line_as_its_slope_says(plugged, rheology):
    """The difference quotient over the entire aggregate agrees with that over the triangles beside the line. Both are
    without the support, whose load changes with the line, too."""
    scene, pore = plugged
    scene = load_scene(scene, [f"growth.new_biomass={rheology}"])
    closing = ByLines(Mechanics.of(scene), pore, pore, None, PATIENT)
    here, there = (closing._place(pore, pore.body.wall, grown_lines(pore, advance)) for advance in (0.4, 0.4 + 1e-6))
    here.system.supports = there.system.supports = ()
    position, pressure = here.divided(pore.mesh.points, 0.3 + 0 * pore.pressure)
    position = position + 0.01 * np.sin(position)
    at_rest, moved = (placed.system.under(placed.theta, position, position, pressure).residual
                      for placed in (here, there))
    slopes = [here.slope(line, position, pressure) for line in grown_lines(pore, 0.4) if line.wall == TOP]
    assert len(slopes) == 2 and all(np.abs(slope).max() > 0.1 for slope in slopes)
    assert sum(slopes) == pytest.approx((moved - at_rest) / 1e-6, abs=2e-4 * np.abs(slopes).max())


def test_the_search_takes_over_from_newton(plugged, monkeypatch):
    scene, pore = plugged
    monkeypatch.setattr(contact_newton, "MOST_ITERATIONS", 1)
    expansion = expanded_by(scene, pore, 1.03)
    rule = Clearance(channel_walls(scene.pore.width), scene.growth.minimum_film, scene.growth.minimum_contact_angle)
    assert min(clearances(expansion.pore.boundary, rule).values()) >= -contact_lines.CLOSE


def record_iterations(monkeypatch):
    """Return a list to which each solution for contact lines, also a failing one, adds its number of iterations."""
    iterations = []
    solve = contact_newton.Coupled.solve

    def counted(coupled, *arguments):
        try:
            solve(coupled, *arguments)
        finally:
            iterations.append(coupled.iterations)

    monkeypatch.setattr(contact_newton.Coupled, "solve", counted)
    return iterations


def test_newton_gives_up_as_soon_as_no_line_moves(plugged, monkeypatch):
    """If no line moves and a clearance is not accepted, more iterations change nothing. The search takes over."""
    iterations = record_iterations(monkeypatch)
    monkeypatch.setattr(contact_newton.Coupled, "_accepts", lambda coupled: False)
    expanded_by(*plugged, 1.1)
    assert 0 < iterations[0] < contact_newton.MOST_ITERATIONS


def test_lines_advance_the_farther_the_more_biomass_grows(plugged):
    """A line that rests too far beside the corner at 2.1 um would not move if more biomass grows."""
    factors = (1.062, 1.065, 1.068, 1.071, 1.074, 1.077)
    advances = [expanded_by(*plugged, factor).advances[0, TOP, 1] for factor in factors]
    assert (np.diff(advances) > 0.01).all()
    assert np.interp(factors, factors[::5], advances[::5]) == pytest.approx(advances, abs=0.1)


@pytest.mark.parametrize("factor", [1.0265, 1.075])
def test_newton_places_a_line_whose_clearance_jumps_at_a_corner(factor, plugged, monkeypatch):
    """The line is too short before the corner, and far enough beyond it. The search does not take over."""
    monkeypatch.setattr(growth, "equilibrium", lambda *_, **__: pytest.fail("the search took over"))
    expanded_by(*plugged, factor)


@pytest.mark.parametrize("start, step, near, place", [
    (1.5, -0.3, False, 1.2),
    (1.5, -0.49, False, 1.0202),
    (0.5, 0.51, False, 0.9798),
    (1.0202, -0.01, False, 1.0202),
    (1.0202, -0.01, True, 0.9798),
    (1.0202, -0.3, True, 0.7202),
    (0.9798, 0.01, False, 0.9798),
    (0.9798, 0.01, True, 1.0202),
    (0.0202, -0.01, True, 0.0),
    (0.0202, -0.5, True, 0.0),
    (0.3, -0.5, False, 0.0202),
    (0.5, 9.0, False, 2.5),
])
def test_a_line_keeps_away_from_corners(start, step, near, place):
    """It crosses a corner only from the place beside it, and only close to equilibrium."""
    line = contact_lines.Line(TOP, 0, 1, advance=start)
    assert contact_newton._place(line, start, step, near) == pytest.approx(place, abs=1e-12)


def test_newton_for_lines_gives_up_if_it_is_not_near_the_solution_in_time(plugged, monkeypatch):
    """It starts from the old shape, from the equilibrium with the expected lines, and once within the search."""
    iterations = record_iterations(monkeypatch)
    monkeypatch.setattr(contact_newton, "EARLY", (2, 0.0))
    expanded_by(*plugged, 1.03)
    assert iterations == [2, 2, 2]


@pytest.mark.parametrize("defects, length", [([3.0], 1.0), ([9.0, 5.0, 3.0], 0.25), ([9.0] * 5, 0.0625)])
def test_a_step_of_lines_that_raises_the_defect_is_shortened(defects, length):
    """The defect at the start is one, and may rise fourfold. The shortest step is made whatever the defect."""
    trials = iter(defects)
    residual = SimpleNamespace(defect=1.0, lag=np.zeros((1, 2)), residual=np.zeros(2))
    placed = SimpleNamespace(
        clearances=lambda *_: np.zeros((2, 0)), iterate=lambda *_: SimpleNamespace(defect=next(trials)),
        same_arcs=lambda _: True,
        system=SimpleNamespace(strained=lambda _: SimpleNamespace(J=np.ones(1)),
                               factored=lambda _: SimpleNamespace(solve=lambda *_: np.ones(2))))
    start = SimpleNamespace(divided=lambda *each: each)
    newton = contact_newton.Coupled(lambda: start, [], np.zeros((1, 2)), np.zeros(0))
    newton.placed = placed
    _, after = newton._step(residual)
    assert newton.position == pytest.approx(length) and after.defect == defects[-1]


def test_stationary_lines_stay_where_the_last_round_of_fluid_forces_left_them(plugged):
    """Lines that every round places anew can alternate between two places, one of them the end of an arc. The fluid's
    forces and the shape then never agree."""
    scene, pore = plugged
    moved = expanded_by(scene, pore, 1.03).advances
    asked = {key: 0.8 * advance for key, advance in moved.items()}
    search = contact_lines.SearchOptions(stationary=True, advances=asked)
    kept = contact.expand(Mechanics.of(scene), pore, [1.03 * pore.body.theta], search=search).advances
    assert max(abs(asked[key] - moved[key]) for key in moved) > 0.05
    assert kept == pytest.approx(asked, rel=1e-9)


def test_contact_lines_rest_under_the_forces_of_the_fluid(plugged, monkeypatch):
    """The aggregate is pulled off the wall by a force that grows with the contact length. A line rests if it moves
    by at most twice the error 5e-4 film / tan(angle) of a position. The bound is ten times this. If lines rest as soon
    as no node joins or leaves the wall, the clearance is 0.08."""
    scene, pore = plugged
    scene = replace(scene, flow=load_scene("wide").flow, growth=replace(scene.growth, fluid_forces="included"))

    def pull(_fluid, _around, shaped):
        points = shaped.mesh.points[shaped.mesh.body]
        joined = shaped.boundary.points[shaped.boundary.touches(TOP), 0]
        return np.column_stack([np.zeros(len(points)), -6e-4 * np.ptp(joined) * (points[:, 1] > pore.mesh.width / 2)])

    monkeypatch.setattr(traction, "forces", pull)
    shape = contact.expand(Mechanics.of(scene), pore, [1.1 * pore.body.theta]).pore
    rule = Clearance(pore.walls, scene.growth.minimum_film, scene.growth.minimum_contact_angle)
    beyond = [value for (wall, _), value in clearances(shape.boundary, rule).items() if wall == TOP]
    assert len(beyond) == 2 and np.abs(beyond).max() < 0.01


def with_line_size(scene, pore, size, advances, factor=1.3):
    """The new shape with triangles of a size beside the lines, where these are expected."""
    search = contact_lines.SearchOptions(advances=advances, line_size=size)
    return contact.expand(Mechanics.of(scene), pore, [factor * pore.body.theta], search=search)


def test_lines_have_small_triangles_where_they_go(plugged):
    """The arcs ahead are 2 to 3 um long, and lines that travel 5 um err by 0.1 um on them. With small triangles their
    places converge, whatever place was expected. The material keeps its nodes and its masses.

    Triangles of 0.2 to 0.0125 um place the lines within 0.011 um of each other. The bound is three times this, and half
    of the error on large triangles. It was 0.02 um for a state whose theta varied by half, on a rough new mesh."""
    scene, pore = plugged
    coarse = expanded_by(scene, pore, 1.3)
    far = {key: 1.2 * advance for key, advance in coarse.advances.items()}
    reached = [with_line_size(scene, pore, size, advances)
               for size, advances in ((0.1, coarse.advances), (0.1, far), (0.05, coarse.advances))]
    lengths = np.array([[shape.advances[0, TOP, side] for side in (1, -1)] for shape in (coarse, *reached)])
    exact = lengths[-1]
    assert np.abs(lengths[0] - exact).max() > 0.04 > 3 * np.abs(lengths[1:3] - exact).max()
    for shape in reached:
        outline = shape.pore.boundary
        ends = outline.contact_ends & (outline.wall == TOP)
        assert ends.sum() == 2 and outline.corners.edge_lengths().min() < 0.3
        assert shape.position.shape == pore.mesh.points.shape
        assert np.abs(shape.position - coarse.position)[pore.mesh.body].max() < 0.3
        assert shape.pore.active.sum() == pytest.approx(pore.active.sum(), rel=1e-12)
        assert shape.pore.inert.sum() == pytest.approx(pore.inert.sum(), rel=1e-12)


def test_the_triangles_of_the_mesh_take_over_from_the_small_ones(plugged, monkeypatch):
    """If there is no equilibrium on small triangles, the lines are those on the mesh."""
    scene, pore = plugged
    on_mesh = expanded_by(scene, pore, 1.05)
    expand = contact._expand

    def only_on_the_mesh(mechanics, grown, *rest):
        if grown.mesh.topology is not pore.mesh.topology:
            raise GrowthError("no equilibrium on small triangles")
        return expand(mechanics, grown, *rest)

    monkeypatch.setattr(contact, "_expand", only_on_the_mesh)
    shape = with_line_size(scene, pore, 0.1, on_mesh.advances, 1.05)
    assert shape.bisection is None
    assert shape.advances == pytest.approx(on_mesh.advances, abs=0.02)


@pytest.mark.thorough
def test_a_run_stops_within_a_step_in_contact(plugged, tmp_path):
    """At most three systems (motion of the mesh, flow, substrates) are factorised between two polls. A run that stops
    there resumes with the bits of an uninterrupted run."""
    scene = plugged[0]
    since = []
    polls = []

    def stop():
        polls.append(len(since))
        since.clear()
        return signal.SIGTERM if len(polls) == stop_at else 0

    stop_at = 0
    factorised = linear.factorised
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(linear, "factorised", lambda *arguments: since.append(1) or factorised(*arguments))
        run(scene, tmp_path / "whole", watch=Watch(stop_within=stop))
    assert len(polls) > 50 and max(polls) <= 3
    stop_at = len(polls) - 10
    polls.clear()
    with pytest.raises(Interrupted, match="interrupted by signal 15 at t = 1"):
        run(scene, tmp_path / "stopped", watch=Watch(stop_within=stop))
    assert resume(tmp_path / "stopped") == "completed"
    assert files(tmp_path / "stopped") == files(tmp_path / "whole")


def rows_at(scene, times):
    """The rows of a scene at given times (h)."""
    return [*simulate(load_scene(scene, [f"output.times={[f'{time!r} h' for time in times]}"]))][1:]


def test_lines_slow_down_in_a_step_as_in_the_last_one(plugged):
    """After a first contact its half length a grows like the square root of time: a^2 = a0^2 + k t."""
    pore = plugged[1]
    key = 0, TOP, 1
    halfway = SimpleNamespace(duration=1.0, expansion=SimpleNamespace(advances={key: 3.0}))
    speeds = np.zeros((2, 2, 2))
    speeds[:, TOP - 1, 0] = 4.0, 1.0
    known, unknown = (midpoint._slower_advances(pore.with_body(line_speeds=each), halfway)[key]
                      for each in (speeds, None))
    assert known == pytest.approx(3.75)
    before = pore.boundary.contact_length(numbered(pore.walls, TOP)) / 2
    assert (before + unknown)**2 - before**2 == pytest.approx(2 * ((before + 3)**2 - before**2))


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore:there is no row at")
def test_a_row_that_cannot_be_interpolated_is_reached_by_steps_of_its_own(plugged, monkeypatch):
    scene = plugged[0]
    expected = rows_at(scene, [15.3, 15.9])

    def fail(*_):
        raise GrowthError("no equilibrium")

    monkeypatch.setattr(midpoint, "interpolate", fail)
    reached = rows_at(scene, [15.3, 15.9])
    assert len(reached) == len(expected)
    for one, other in zip(reached, expected):
        assert one.pore.time == other.pore.time
        assert one.pore.boundary.area == pytest.approx(other.pore.boundary.area, rel=2e-3)
        assert one.solved.flow.conductivity == pytest.approx(other.solved.flow.conductivity, rel=0.02)


def test_lines_start_from_their_speeds(plugged):
    """A pore keeps the speeds of its lines in both halves of the last step. They repeat their advances at them."""
    pore = plugged[1]
    speeds = pore.body.line_speeds
    assert speeds.shape == (2, 2, 2) and (speeds >= 0).all() and speeds[1, 1].min() > 0
    advances = [contact_lines.advances_at(each, 0, 0.5) for each in speeds]
    assert advances[1][0, TOP, -1] == speeds[1, 1, 1] / 2 and advances[0][0, BOTTOM, 1] == speeds[0, 0, 0] / 2
    assert contact_lines.speeds(advances, 0, 0.5) == pytest.approx(speeds)
    kept = unpack_state(plugged[0], *pack_state(plugged[0], RestartState(pore, StepControl(1.0))))
    assert np.array_equal(kept.pore.body.line_speeds, speeds)
    assert contact_lines.speeds([{(0, BOTTOM, 1): 1.0}], 0, 0.5) is None


def test_loads_do_the_same_work_on_a_divided_mesh(division):
    """Gathered boundary loads agree in every displacement of the parent, divided loads in constant and linear ones."""
    draw = np.random.default_rng(1)
    parent = division.parent
    loads = draw.normal(size=division.mesh.points.shape)
    loads[-len(division.triangles):] = 0.0  # on the cuts, inside
    displacement = draw.normal(size=parent.points.shape)
    work = np.vdot(loads, division.nodal(displacement))
    assert np.vdot(division.gathered_loads(loads), displacement) == pytest.approx(work, rel=1e-12)
    loads = draw.normal(size=parent.points.shape)
    divided = division.divided_loads(loads)
    assert divided.sum(axis=0) == pytest.approx(loads.sum(axis=0), rel=1e-12)
    along = np.zeros(len(parent.points))
    arcs = parent.loop[2 * division.arcs[0] + np.arange(3)]
    along[arcs] = [0.0, 0.5, 1.0]
    assert divided.T @ division.nodal(along) == pytest.approx(loads.T @ along, rel=1e-12)


def test_contact_begins_on_both_sides_of_the_highest_point(plugged):
    """It extends by the minimum film along the free surface, because a single point cannot hold an elastic body."""
    _, pore = plugged
    *_, upper_wall = pore.mesh.walls
    free = replace(pore.boundary, wall=np.where(pore.body.wall == TOP, FREE, pore.body.wall))
    wall, lines = closing_by_lines._first_contact(free, upper_wall, FILM)
    (corner,) = np.flatnonzero(wall == TOP)
    upper = [line for line in lines if line.wall == TOP]
    lengths = {line.direction: contact_lines.to_length(replace(free, wall=wall), line) for line in upper}
    apart = free.nearest(upper_wall)[1] - free.points[corner, 0]
    assert sorted(lengths.values()) == pytest.approx(sorted([FILM - apart, FILM + apart]), abs=1e-9)
    assert all(line.advance == line.least == line.last_too_short > 0 for line in upper)


def test_contact_begins_beside_a_line_that_lies_within_an_arc():
    """Lines on the first wall divide arcs in the shape that comes too near to the other wall."""
    scene = load_scene("wide", ["numerics.preset=fast", "pore.width=25 um", "aggregate.radius=22.8 um"])
    pore = seeded(scene)
    search = contact_lines.SearchOptions(landing=-np.inf, advances={(0, BOTTOM, 1): 0.7, (0, BOTTOM, -1): 0.7})
    expansion = contact.expand(Mechanics.of(scene), pore, [1.02 * pore.body.theta], search=search)
    assert expansion.divisions and expansion.pore.contact
    assert len(expansion.pore.body.wall) > len(pore.body.wall)


def without_newton(monkeypatch):
    """The search with whole equilibria places all contact lines."""
    monkeypatch.setattr(ByLines, "settle", lambda *_: None)


@pytest.mark.parametrize("method, preset", [
    ("newton", "fast"), pytest.param("search", "fast", marks=pytest.mark.thorough),
    pytest.param("newton", "accurate", marks=pytest.mark.thorough)])
def test_the_contact_surface_is_the_smallest_that_leaves_enough_fluid(method, preset, monkeypatch):
    """After every step no clearance is negative, and lines that have advanced have zero clearance."""
    if method == "search":
        without_newton(monkeypatch)
    scene = load_scene("wide", [f"numerics.preset={preset}", 'pore.width="25 um"', 'growth.end="18.5 h"',
                                'output.times=["18.5 h"]'])
    keys = scene.growth
    rule = Clearance(channel_walls(scene.pore.width), keys.minimum_film, keys.minimum_contact_angle)
    expansions = []

    def record_expansion(*arguments):
        expansions.append(expand(*arguments))
        return expansions[-1]

    expand = contact.expand
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(contact, "expand", record_expansion)
        for _ in simulate(scene):
            pass
    touching = [expansion for expansion in expansions if expansion.pore.contact]
    advanced = 0
    for expansion in touching:
        values = clearances(expansion.pore.boundary, rule)
        assert min(values.values()) >= -contact_lines.CLOSE
        for key, length in expansion.advances.items():
            if length > 1.0:
                advanced += values[key[1:]] <= contact_lines.CLOSE
    assert advanced >= 5


@pytest.mark.parametrize("left, refused", [("11.9 um", True), ("11.5 um", False)])
def test_a_tip_comes_into_contact_unless_it_is_much_thinner_than_the_film(left, refused):
    """A needle has no room for a contact of half of the least film. A tip that is somewhat wider takes a shorter first
    contact than usual. Contact begins at 0.05 h."""
    outline = f'[["0 um", "0 um"], ["{left}", "29.9 um"], ["12 um", "29.9 um"], ["12 um", "0 um"]]'
    scene = load_scene("base", [f"aggregate.outline={outline}", "pore.width=32 um", "growth.end=0.2 h",
                                'numerics.preset="fast"', "numerics.contact_elements=0", 'output.times=["0.2 h"]'],
                       unset=["aggregate.radius"])
    if refused:
        with pytest.raises(SimulationError, match="tip that touches the wall is only .* wide .* no setting helps"):
            list(simulate(scene))
    else:
        assert list(simulate(scene))[-1].pore.contact


def test_a_trial_starts_from_a_shape_in_which_no_triangle_is_turned_over():
    """The last trial's shape is the first guess; a mirrored shape cannot be the start."""
    scene = load_scene("base", ['numerics.preset="fast"'])
    seed = seeded(scene)
    closing = ByLines(Mechanics.of(scene), seed, seed, None, PATIENT)
    closing._trials = [(np.zeros(2), seed.mesh.points * [-1.0, 1.0], seed.pressure)]
    assert np.array_equal(closing._first(seed, None, np.zeros(2)).mesh.points, seed.mesh.points)


@EVERY_ORDER
def test_each_contact_surface_has_its_own_fixed_point(order):
    """At t = 0 they are the corners nearest to the middles of both, -2 and -1 um. As the aggregate grows they stay in
    place, also beside the middles [E20]."""
    leaning = [(-21, 0), (-19, 9), (-12, 17), (-6, 20), (-5.5, 20), (-5, 20), (-4.5, 20), (4, 20), (12, 12), (17, 0)]
    scene = simulation.shaped(coarse_base(order, 'pore.width="20 um"')[0], leaning)
    pore = seeded(scene)
    x, y = pore.mesh.points[pore.mesh.loop][pore.body.fixed].T
    assert y == pytest.approx([0.0, 20.0]) and x == pytest.approx([-2.0, -1.0], abs=0.3)
    aside = pore.with_body(fixed=np.roll(pore.body.fixed, pore.mesh.geometry))
    shape = contact.expand(Mechanics.of(scene), aside, [1.02 * aside.body.theta]).pore
    before, after = (one.mesh.points[one.mesh.loop][one.body.fixed] for one in (aside, shape))
    assert len(before) == 2 and after == pytest.approx(before, abs=1e-9) and abs(before[:, 0] - x).min() > 0.3
