"""Each rule of a wall holds on either wall of the pore, and a wall does what its fields say."""
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from repro.fem import mesher, sizing
from repro.fem.outline import half_disc, polygon
from repro.fem.sizing import Sizing
from repro.fem.space import Space
from repro.fem.walls import BOTTOM, FREE, TOP, Seat, channel_walls
from repro.model import adhesion, contact, flow, meshing
from repro.model.closing_by_nodes import closing_nodes
from repro.model.contact_lines import Clearance, surface_ends
from repro.model.mechanics import Mechanics, with_new_surfaces
from repro.model.meshing import seeded
from repro.preflight import numbers
from repro.scene import load_scene
from tests.strategies import EVERY_ORDER, PRESET_OF, coarse_base, in_um

WIDTH = 50.0
WALLS = pytest.mark.parametrize("on", channel_walls(WIDTH), ids=["lower", "upper"])


def with_wall(at, number, **fields):
    """A pore in which one of the walls has other fields."""
    walls = tuple(replace(wall, **fields) if wall.number == number else wall for wall in at.mesh.walls)
    return replace(at, space=Space(replace(at.mesh, walls=walls)))


@WALLS
@EVERY_ORDER
def test_a_seed_on_either_wall_has_the_same_boundary_sizes_and_mesh(order, on):
    """The boundary is counterclockwise, the paper's R is the radius, and films face the other wall."""
    walls = channel_walls(WIDTH)
    (other,) = [wall for wall in walls if wall != on]
    seed = half_disc(20.0, 6.0, order, 3.0, on)
    assert seed.area == pytest.approx(np.pi / 2 * 20.0**2, rel=0.02) and seed.thickness == pytest.approx(20.0)
    assert (on.holds(seed.points) == (seed.wall == on.number)).all()
    assert seed.points[seed.fixed].tolist() == [[3.0, on.y]]
    assert seed.untouched(walls) == (other,) and seed.gap(walls) == pytest.approx(WIDTH - 20.0)
    assert seed.nearest(other)[1] == pytest.approx(3.0, abs=0.1)
    sizes = Sizing(walls, 0.5, 2.0)
    points, _ = sizing.size_sources(seed, sizes)
    assert np.count_nonzero(other.holds(points)) == np.count_nonzero(seed.wall == FREE)
    mesh, (split,) = mesher.generate_around([seed], sizing.meshed_extent(seed, WIDTH, 600.0), sizes, order)
    assert mesh.area() == pytest.approx(seed.area, rel=1e-9)
    assert mesh.areas.sum() == pytest.approx(WIDTH * np.diff(mesh.ends)[0], rel=1e-3)
    radius = np.hypot(*(split.origin - [3.0, on.y])[split.wall == FREE].T)
    assert radius == pytest.approx(np.full(len(radius), 20.0), rel=1e-3 if order == 2 else 1e-12)


@WALLS
def test_elements_beside_contact_are_small_at_the_wall_without_the_seed(on):
    """The size at the lines of the opposite wall is that of the scene, and the wall of the seed has larger elements."""
    walls = channel_walls(WIDTH)
    points = np.array([[-14.0, 0.0], [-12.0, 25.0], [-11.0, WIDTH], [10.0, WIDTH], [13.0, 25.0], [16.0, 0.0]])
    outline = replace(polygon(points, walls), seat=Seat(on.number))
    sizes = sizing.interface_sizes(outline, Sizing(walls, 1.0, 2.0, contact=0.25))
    ends = outline.contact_ends
    for wall in walls:
        least = sizes[ends & (outline.wall == wall.number)].min()
        assert least > 1.0 if wall == on else least == 0.25


@pytest.mark.parametrize("number, middle", [(BOTTOM, 1.0), (TOP, -0.5)])
def test_a_moment_is_about_the_middle_of_the_contact_with_the_wall_of_the_seed(number, middle):
    """The contact with the upper wall has another middle than that with the lower one. All forces are 1 along y."""
    _, block = grown_plug(2)
    mesh, region = block.mesh, block.region
    outline = replace(block.boundary, seat=Seat(number))
    load = adhesion._load(mesh, outline, region, np.tile([0.0, 1.0], (len(region.nodes), 1)))
    assert load.y == len(region.nodes) and load.moment == pytest.approx((mesh.points[region.nodes, 0] - middle).sum())


@pytest.mark.parametrize("number", [1, 2])
@EVERY_ORDER
def test_water_slips_only_along_a_wall_that_lets_it(order, number):
    """No water crosses the wall. The other wall has no slip."""
    _, seed = coarse_base(order)
    at = with_wall(seed, number, no_slip=False)
    velocity = flow.unit_flow(at.space).velocity
    for wall in at.mesh.walls:
        nodes = np.setdiff1d(at.mesh.nodes_on(wall), at.space.dofs.inlet)
        assert (velocity[nodes, 1] == 0).all() and velocity[nodes, 0].any() == (wall.number == number)


def grown_plug(order, growth=1.05):
    """(mechanics, pore): a block from wall to wall after uneven growth, before its new shape."""
    outline = in_um([(-14, 0), (-11, 20), (10, 20), (16, 0)])
    scene = load_scene("base", [f"numerics.preset={PRESET_OF[order]}", f"aggregate.outline={outline}",
                                "pore.width=20 um", "numerics.refinement=0.3"], unset=["aggregate.radius"])
    seed = seeded(scene)
    x = seed.mesh.points[seed.mesh.cells[seed.mesh.biomass, :3], 0].mean(axis=1)
    seed = seed.with_body(theta=seed.body.theta * (growth + 0.01 * x)[:, None])
    return Mechanics.of(scene), seed


@pytest.mark.parametrize("number", [1, 2])
@EVERY_ORDER
def test_a_surface_keeps_its_place_on_a_bonded_wall_alone(order, number):
    mechanics, seed = grown_plug(order)
    seed = with_wall(seed, number, bonded=True).with_body(seat=Seat(number))
    moved = contact.expand(mechanics, seed, [seed.body.theta]).position[seed.mesh.loop] - seed.boundary.points
    for wall in seed.mesh.walls:
        along = np.abs(moved[seed.body.wall == wall.number, 0]).max()
        assert along == 0.0 if wall.number == number else along > 0.1


@pytest.mark.parametrize("number", [1, 2])
def test_a_new_surface_keeps_a_point_unless_its_wall_keeps_none(number):
    _, seed = grown_plug(2)
    lost = seed.with_body(fixed=np.zeros_like(seed.body.fixed))
    on = lost.body.wall == number
    kept = with_new_surfaces(lost).body.fixed
    assert np.count_nonzero(kept & on) == 1 and np.count_nonzero(kept) == 2
    slack = with_wall(lost, number, keeps_point=False)
    kept = with_new_surfaces(slack).body.fixed
    assert np.count_nonzero(kept & on) == 0 and np.count_nonzero(kept) == 1


@EVERY_ORDER
def test_a_film_closes_at_a_plane_of_symmetry_at_half_of_the_gap(order):
    """The film to the mirror image is 2.1 um thick where the gap is 1.05 um, and stays open; at 0.95 um it closes. At
    a wall both close."""
    closed = {}
    for gap, upper in product((1.05, 0.95), ("no slip", "symmetry")):
        scene = load_scene("base", [f"numerics.preset={PRESET_OF[order]}", "pore.width=20 um",
                                    f"pore.upper_wall={upper}", f"aggregate.radius={20 - gap} um",
                                    "numerics.refinement=0.5"])
        seed = seeded(scene)
        shape = contact.expand(Mechanics.of(scene), seed, [seed.body.theta])
        closed[gap, upper] = shape.pore.contact
        assert shape.gaps[1] == pytest.approx(gap if upper == "no slip" else 2 * gap, rel=1e-3)
    assert closed == {(1.05, "no slip"): True, (1.05, "symmetry"): False, (0.95, "no slip"): True,
                      (0.95, "symmetry"): True}


def wedge(slope, geometry):
    """An outline that touches the upper wall over 20 um and leaves it with a slope, with a node 2 um beyond each line
    and another one 4 um below the wall."""
    right = np.array([(10.0 + 4.0 / slope, 0.0), (10.0 + 4.0 / slope, WIDTH - 4.0), (12.0, WIDTH - 2.0 * slope),
                      (10.0, WIDTH)])
    return polygon(np.vstack([right * [-1, 1], right[::-1]]), channel_walls(WIDTH), geometry)


@pytest.mark.parametrize("upper, part", [("no slip", 1.0), ("symmetry", 0.5)])
def test_a_wedge_closes_at_a_plane_of_symmetry_at_half_of_the_tangent(upper, part):
    """A body and its mirror image enclose twice the angle of the body and the plane. Straight edges close at nodes,
    arcs anywhere."""
    walls, angle = channel_walls(WIDTH, upper=upper), np.radians(16.7)
    for factor in (0.95, 1.05):
        slope = factor * part * np.tan(angle)
        joins = closing_nodes(wedge(slope, 1), walls, 2.0, angle)
        assert np.count_nonzero(joins) == (2 if factor < 1 else 0)
        outline = wedge(slope, 2)
        for node, direction in surface_ends(outline, 2):
            clearance, _ = Clearance(walls, 2.0, angle).beyond(outline, node, direction)
            assert clearance == pytest.approx(factor - 1, abs=1e-6)


@pytest.mark.parametrize("number", [1, 2])
def test_a_plane_of_symmetry_bears_nothing_as_a_wall(number):
    """The traction that walls must bear is that of the other wall, on either side."""
    mechanics, seed = grown_plug(2, 1.02)
    shape = contact.expand(mechanics, seed, [seed.body.theta]).pore
    scene = load_scene("base", ["numerics.preset=fast"])
    peak = adhesion.wall_peak(adhesion.Loading.of(scene), with_wall(shape, number, mirrors=True), None)
    assert peak.value > 0 and peak.y == (20.0 if number == 1 else 0.0)


@EVERY_ORDER
def test_the_mesh_ends_where_that_of_the_pore_with_its_mirror_image_ends(order):
    """The ends (3.1) are 1.5 widths of that pore away, where its flow is developed. A new mesh is due at its distance,
    too."""
    changes = [f"numerics.preset={PRESET_OF[order]}", "aggregate.radius=20 um", "numerics.refinement=0.3"]
    meshes = [seeded(load_scene("base", [*changes, *own])).mesh
              for own in (["pore.upper_wall=symmetry"], ["pore.width=100 um"], [])]
    half, whole, alone = meshes
    assert half.ends == whole.ends == pytest.approx((-170, 170)) and alone.ends == pytest.approx((-95, 95))
    assert [mesh.whole_width for mesh in meshes] == [100, 100, 50]


@pytest.mark.parametrize("upper", ["no slip", "symmetry"])
def test_expected_numbers_are_those_of_the_pore_with_its_mirror_image(upper):
    """The shear of the water, the extent of the mesh, and the radius at first contact, before a run."""
    scene = load_scene("base", [f"pore.upper_wall={upper}", "flow.mean_velocity=1 m/day", "aggregate.radius=48.5 um"],
                       unset=["flow.head"])
    whole = load_scene(scene, ["pore.width=100 um", "pore.upper_wall=no slip"])
    speed = scene.flow.mean_velocity
    shear = {each: numbers.stresses(each, speed, None)[0] for each in (scene, whole)}
    assert shear[whole] == pytest.approx(shear[scene] * (1.0 if upper == "symmetry" else 0.5))
    alike = numbers.half_length(scene) == pytest.approx(numbers.half_length(whole))
    assert alike == (upper == "symmetry") and meshing.fastest(scene.flow, scene.pore) == speed
    assert numbers.at_start(scene).contact != (upper == "symmetry")
    driven = load_scene("base", [f"pore.upper_wall={upper}"])
    factor = 4.0 if upper == "symmetry" else 1.0
    clean = load_scene("base")
    assert meshing.fastest(driven.flow, driven.pore) == pytest.approx(factor * meshing.fastest(clean.flow, clean.pore))


@pytest.mark.parametrize("wall", ["sliding", "bonded"])
def test_a_scene_bonds_each_aggregate_to_the_wall_of_its_seed_alone(wall):
    walls = meshing.walls_of(load_scene("base", [f"growth.wall={wall}"]))
    for number in (BOTTOM, TOP):
        seen = Seat(number).walls(walls)
        assert seen[0].number == number and [each.bonded for each in seen] == [wall == "bonded", False]
