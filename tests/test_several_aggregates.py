"""[[aggregate]] from a scene to its files: keys of each body, refusals, columns, fields, checkpoints and pages."""

import json
import tomllib
from dataclasses import replace

import numpy as np
import pytest
import shapely

import repro
from repro import results
from repro.cli import main
from repro.fem.outline import half_disc
from repro.fem.walls import BOTTOM, TOP
from repro.model.grading import Grading
from repro.model.meshing import Seeding, seeded
from repro.results import names
from repro.results.columns import BODY, SERIES, of_body
from repro.scene import Aggregate, load_scene, parse_scene, scene_hash, scene_tables
from repro.scene.text import scene_text
from tests.test_scene import refusal

LEFT = {"name": "left", "radius": "12 um", "position": "-30 um"}
RIGHT = {"radius": "9 um", "position": "20 um", "wall": "upper"}
TABLES = {"pore": {"width": "50 um", "length": "400 um"}, "aggregate": [LEFT, RIGHT],
          "flow": {"mean_velocity": "2.9 m/day"}, "substrates": {"donor": {"supply": "4 mg/L"}, "acceptor": {}},
          "growth": {"end": "1 h"}, "output": {"every": "0.5 h"}}
PRESETS = pytest.mark.parametrize("preset", ["fast", "paper"])
BUMP = [["-9 um", "0 um"], ["-5 um", "12 um"], ["4 um", "14 um"], ["8 um", "0 um"]]


def scene_of(*bodies, **sections):
    return parse_scene({**TABLES, "aggregate": list(bodies) or [LEFT, RIGHT], **sections}, "mine", "mine.toml")


def upside_down(body):
    """The table of a seed in a pore turned upside down."""
    other = {"lower": "upper", "upper": "lower"}[body.get("wall", "lower")]
    outline = {"outline": [[x, f"{50 - float(y.split()[0])!r} um"] for x, y in body["outline"]]} \
        if "outline" in body else {}
    return {**body, "wall": other, **outline}


# ---------------------------------------------------------------- scenes


def test_a_list_of_one_table_is_this_table():
    one = scene_of(LEFT)
    assert one == scene_of(LEFT) == parse_scene({**TABLES, "aggregate": LEFT}, "mine", "mine.toml")
    assert scene_hash(one) == scene_hash(load_scene({**TABLES, "aggregate": (LEFT,)}))
    assert isinstance(scene_tables(one)["aggregate"], dict) and one.units["aggregate.radius"] == "um"
    assert one.aggregates == (one.aggregate,) and one.aggregate_keys == ["aggregate"]
    assert load_scene(one, ["aggregate.left.radius=3 um"]) == load_scene(one, ["aggregate.1.radius=3 um"]) \
        == load_scene(one, ["aggregate.radius=3 um"])
    clean = load_scene(one, unset=["aggregate", "kinetics", "growth", "output"])
    assert clean.aggregates == () and clean.aggregate is None


def test_several_aggregates_are_read_back_and_count_in_the_hash(tmp_path):
    scene = scene_of()
    assert scene.labels == ["left", "2"] and scene.aggregate_keys == ["aggregate.left", "aggregate.2"]
    assert [seed.wall for seed in scene.aggregates] == ["lower", "upper"]
    with pytest.raises(ValueError, match="the scene has 2 aggregates"):
        _ = scene.aggregate
    assert parse_scene(scene_tables(scene), "mine", "again") == scene
    assert parse_scene(tomllib.loads(str(scene)), "mine", "again") == scene
    path = tmp_path / "mine.toml"
    path.write_text(str(scene))
    text = scene_text(str(path))
    assert parse_scene(tomllib.loads(text), "mine", "again") == scene and text.count("\n[[aggregate]]\n") == 2
    hashes = {scene_hash(scene_of(*bodies)) for bodies in (
        (LEFT, RIGHT), (RIGHT, LEFT), (LEFT, {**RIGHT, "name": "b"}), (LEFT, {**RIGHT, "wall": "lower"}), (LEFT,))}
    assert len(hashes) == 5
    assert scene.stated("aggregate.left", "radius").text == "12 um" == scene.stated("aggregate.left", "radius")[0]
    millimetres = scene_of(LEFT, {**RIGHT, "radius": "0.009 mm"})
    assert millimetres == scene and millimetres.stated("aggregate.2", "radius").text == "0.009 mm"
    assert 'radius = "0.009 mm"' in str(millimetres)


@pytest.mark.parametrize("key, number", [("left", 0), ("1", 0), ("2", 1)])
def test_a_key_of_one_body_changes_this_body_alone(key, number):
    scene = scene_of()
    changed = load_scene(scene, [f"aggregate.{key}.radius=4 um", f"aggregate.{key}.inert_fraction=0.25"])
    bodies = list(scene.aggregates)
    bodies[number] = replace(bodies[number], radius=4.0, inert_fraction=0.25)
    assert changed == replace(scene, aggregates=tuple(bodies))
    assert load_scene(scene, [f'aggregate.{key}={{radius="4 um", position="90 um"}}']).aggregates[number] \
        == Aggregate(4.0, 90.0)
    assert load_scene(scene, unset=[f"aggregate.{key}"]).aggregates == scene.aggregates[1 - number:][:1]
    assert load_scene(scene, unset=[f"aggregate.{key}.position"]).aggregates[number].position == 0.0


THREE = {"pore": {"width": "50 um"}, "flow": {"mean_velocity": "1 m/d"},
         "aggregate": [{"radius": "4 um"}, {"radius": "5 um", "position": "40 um"},
                       {"radius": "6 um", "position": "90 um"}]}


@pytest.mark.parametrize("unset, radii", [
    (["aggregate.1", "aggregate.2"], [6.0]), (["aggregate.2", "aggregate.1"], [6.0]),
    (["aggregate.2.position", "aggregate.2"], [4.0, 6.0]), (["aggregate.3", "aggregate.1", "aggregate.2"], []),
    (["aggregate.1", "aggregate.3.position"], [5.0, 6.0])])
def test_aggregates_that_are_left_out_do_not_renumber_the_others(unset, radii):
    """Numbers are those of the scene, in every order. --set comes later: it sees those that are left."""
    apart = [f"aggregate.{len(radii)}.position=-90 um"] if unset[-1].endswith("position") else []
    assert [seed.radius for seed in load_scene(THREE, apart, unset=unset).aggregates] == radii
    for again in ("aggregate.2", "aggregate.2.position"):
        with pytest.raises(repro.SceneError, match=f'unset "{again}": the scene does not set it'):
            load_scene(THREE, unset=["aggregate.2", again])


REFUSED = {
    "aggregate.radius=3 um": "the scene has 2 aggregates, aggregate.left, aggregate.2; one of them is needed, such as "
                             "aggregate.left.radius",
    "aggregate.3.radius=3 um": "such as aggregate.left.radius", "aggregate.0.radius=3 um": "the scene has 2 aggregates",
    "aggregate.middle.radius=3 um": "one of them is needed",
    "aggregate.2.radus=3 um": "aggregate.2.radus = \"3 um\": there is no such key; [aggregate.2] takes radius,",
    "aggregate.left.radius=3 h": 'aggregate.left.radius = "3 h": a length is needed',
    "aggregate.left.radius=60 um": "aggregate.left.radius = \"60 um\": less than pore.width (50 um)",
    "aggregate.2.position=1 mm": "aggregate.2.position = \"1 mm\": less than half of pore.length",
    "aggregate.2.name=left": "aggregate.2.name = \"left\": another name is needed: each aggregate has its own",
    "aggregate.2.name=radius": "another name is needed: it is a key of [aggregate]",
    **{f"aggregate.2.name={name}": "a word of up to 30 letters, digits, - and _ that begins with a letter"
       for name in ("2", "1e5", "nan", "Inf", "a b", "\u00e9", '""', "x" * 31, "-a")},
    "aggregate.2.wall=left": 'aggregate.2.wall = "left": "lower" or "upper" is needed',
    "aggregate.2.smooth=true": "true is accepted only with aggregate.2.outline",
    "aggregate=[]": "aggregate = []: a table [aggregate] is needed, or one or more [[aggregate]]",
    'aggregate=[{radius="5 um"}, 3]': "aggregate.2 = 3: a table [aggregate.2] is needed",
    "pore.upper_wall=symmetry": 'pore.upper_wall = "symmetry": "no slip" is needed with aggregate.2.wall = "upper"',
    "aggregate.left.x.y=3": "aggregate.left.x", "aggregate.1.radius.x=3": "it takes no keys",
}


@pytest.mark.parametrize("entry, part", REFUSED.items())
def test_a_wrong_entry_names_the_body_and_its_key(entry, part):
    with pytest.raises(repro.SceneError) as error:
        load_scene(scene_of(), [entry])
    assert part in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize("key, part", [("aggregate.radius", "such as aggregate.left.radius"),
                                       ("aggregate.3", "aggregate.left, aggregate.2"),
                                       ("aggregate.2.outline", "the scene does not set it")])
def test_a_body_that_is_not_there_is_not_left_out(key, part):
    with pytest.raises(repro.SceneError, match=part.replace(".", r"\.")):
        load_scene(scene_of(), unset=[key])


@pytest.mark.parametrize("one, other, gap", [
    ({"radius": "12 um"}, {"radius": "9 um", "position": "22.5 um"}, 1.5),
    ({"radius": "12 um"}, {"radius": "9 um", "position": "13.5 um", "wall": "upper"}, np.hypot(50, 13.5) - 21),
    ({"radius": "30 um"}, {"radius": "18.5 um", "wall": "upper"}, 1.5),
    ({"outline": BUMP}, {"radius": "9 um", "position": "18.5 um"}, 1.5),
    ({"outline": BUMP}, {"outline": BUMP, "position": "18.5 um"}, 1.5),
    ({"outline": BUMP}, {**upside_down({"outline": BUMP}), "position": "9 um"}, 23.42848944)])
def test_bodies_keep_the_least_film(one, other, gap):
    """With [growth] it is growth.minimum_film, without a thousandth of the pore's width. Both bodies are named."""
    def tables(other, film=None):
        growth = {"growth": {"end": "1 h", "minimum_film": f"{float(film)!r} um"}} if film else {}
        kept = {key: TABLES[key] for key in ("pore", "substrates")}
        return {**kept, **growth, "aggregate": [{**one, "name": "a"}, other]}

    def nearer(by):
        return {**other, "position": f"{float(other.get('position', '0 um').split()[0]) - by!r} um"}

    assert load_scene(tables(other, 0.999 * gap)).aggregate_keys == ["aggregate.a", "aggregate.2"]
    message = refusal(tables(other, 1.001 * gap))
    assert f"aggregate.a and aggregate.2 are {gap:.3g} um apart; growth.minimum_film" in message
    if gap == 1.5 and "wall" not in other:
        assert load_scene(tables(nearer(gap - 0.06)))
        assert "0.04 um apart; a thousandth of pore.width (0.05 um) or more" in refusal(tables(nearer(gap - 0.04)))
        message = refusal(tables(nearer(gap)))
        assert "scene: aggregate.2.position = " in message and "aggregate.a and aggregate.2 overlap or touch" in message


def test_an_outline_within_another_or_around_a_half_disc_overlaps():
    around = {"outline": [["-40 um", "0 um"], ["-39 um", "30 um"], ["39 um", "30 um"], ["40 um", "0 um"]]}
    for inside in ({"radius": "5 um"}, {"outline": BUMP}):
        assert "aggregate.1 and aggregate.2 overlap or touch" in refusal({**TABLES, "aggregate": [around, inside]})


@pytest.mark.parametrize("points, part", [
    (BUMP, "y = pore.width at the first and the last point is needed"),
    ([["-9 um", "50 um"], ["0 um", "51 um"], ["8 um", "50 um"]],
     "0 <= y < pore.width (50 um) at point 2 (0 um, 51 um)"),
    ([["-9 um", "50 um"], ["0 um", "0 um"], ["8 um", "50 um"]], "in a row, or none, on the lower wall (y = 0)"),
    ([["-9 um", "50 um"], ["0 um", "49.999 um"], ["8 um", "50 um"]], "y = 0 is contact")])
def test_points_of_an_outline_on_the_upper_wall_are_checked(points, part):
    message = refusal({**TABLES, "aggregate": [{"radius": "3 um", "position": "90 um"},
                                               {"wall": "upper", "outline": points}]})
    assert message.startswith("scene: aggregate.2.outline = ") and part in message


def test_splines_of_two_aggregates_that_touch_are_refused_before_a_run():
    near = {"outline": [["-9 um", "0 um"], ["-9 um", "12 um"], ["9 um", "12 um"], ["9 um", "0 um"]], "smooth": True}
    scene = scene_of({**near, "name": "a"}, {**near, "position": "20.1 um"})
    with pytest.raises(repro.SceneError, match="the splines of aggregate.a and aggregate.2 overlap or touch"):
        repro.check(scene, run=False)


# ---------------------------------------------------------------- seeds and meshes


@PRESETS
@pytest.mark.parametrize("body", [{"radius": "17 um", "position": "5 um"}, {"outline": BUMP, "position": "7 um"},
                                  {"outline": BUMP, "smooth": True}], ids=["half-disc", "outline", "spline"])
def test_a_seed_on_the_upper_wall_is_the_mirror_image(preset, body):
    lower, upper = (seeded(scene_of(each, numerics={"preset": preset})) for each in (body, upside_down(body)))
    one, other = lower.boundary, upper.boundary
    back = -np.arange(len(one.points))
    assert other.points == pytest.approx((one.points * [1, -1] + [0, 50])[back], abs=1e-12)
    assert (other.wall == np.where(one.wall == BOTTOM, TOP, one.wall)[back]).all()
    assert (other.fixed == one.fixed[back]).all() and other.area == pytest.approx(one.area, rel=1e-12)
    assert other.seat.wall == upper.body.seat.wall == TOP and one.seat.wall == BOTTOM
    assert upper.mesh.areas.sum() == pytest.approx(lower.mesh.areas.sum(), rel=1e-12)


def test_an_outline_is_moved_by_its_position():
    moved = scene_of({"outline": BUMP, "position": "7 um"})
    drawn = scene_of({"outline": [[f"{float(x.split()[0]) + 7} um", y] for x, y in BUMP]})
    assert np.array_equal(seeded(moved).mesh.points, seeded(drawn).mesh.points)


PLUG = {"outline": [["-9 um", "0 um"], ["-4 um", "50 um"], ["3 um", "50 um"], ["8 um", "0 um"]]}


@pytest.mark.parametrize("flip", [False, True])
@pytest.mark.parametrize("bodies", [
    [LEFT, RIGHT], [LEFT, {**RIGHT, "position": "-30 um"}], [PLUG, LEFT, {**RIGHT, "position": "30 um"}],
    [{**PLUG, "position": "60 um"}, PLUG, {**LEFT, "position": "30 um"}, {**RIGHT, "position": "31 um"}],
    [{"radius": f"{5 + k % 3} um", "position": f"{20 * k - 110} um", "wall": "upper" if k % 5 else "lower"}
     for k in range(12)]], ids=["two", "facing", "a plug between", "two plugs", "twelve"])
@PRESETS
def test_meshes_fill_the_pore_around_all_bodies(preset, bodies, flip):
    """Each region has the area of its outline, and the fluid fills the rest."""
    scene = scene_of(*(map(upside_down, bodies) if flip else bodies), numerics={"preset": preset})
    pore = seeded(scene)
    mesh = pore.mesh
    assert len(pore.bodies) == len(mesh.regions) == len(bodies)
    assert mesh.areas.min() > 0 and mesh.areas.sum() == pytest.approx(50 * np.ptp(mesh.ends), rel=1e-12)
    for outline, region, seed in zip(pore.outlines, mesh.regions, scene.aggregates):
        polygon = shapely.Polygon(outline.corners.points)
        assert mesh.areas[region.triangles].sum() == pytest.approx(polygon.area, rel=1e-10)
        centre = mesh.points[mesh.triangles[region.triangles]].mean(axis=1)
        assert shapely.contains_xy(polygon, centre).all()
        assert outline.seat.wall == (TOP if seed.wall == "upper" else BOTTOM)
    fluid = mesh.points[mesh.triangles[~mesh.biomass]].mean(axis=1)
    assert not any(shapely.contains_xy(shapely.Polygon(each.corners.points), fluid).any() for each in pore.outlines)


def test_each_body_has_its_own_part_of_inert_biomass():
    pore = seeded(scene_of({**LEFT, "inert_fraction": 0.25}, {**RIGHT, "inert_fraction": 0.5}))
    assert [body.inert.sum() / body.mass for body in pore.bodies] == pytest.approx([0.25, 0.5], rel=1e-12)


@pytest.mark.parametrize("growth", [True, False])
def test_finer_elements_at_t_0_keep_the_shape_of_the_pore(growth):
    """Outlines that are not those of the scene stay, and so does a shape that the water has moved."""
    tables = {**TABLES, "numerics": {"preset": "fast"}}
    scene = load_scene(tables if growth else {key: tables[key] for key in tables if key not in ("growth", "output")})
    grading = Grading.of(scene)
    own = [half_disc(7.0, 4.0, 2, -40.0), half_disc(6.0, 4.0, 2, 40.0)]
    pore = Seeding.of(scene).around(own)
    finer = grading.finer(pore)
    assert finer.front == 2.0 and len(finer.mesh.points) > 1.2 * len(pore.mesh.points)
    assert [each.area for each in finer.outlines] == pytest.approx([each.area for each in pore.outlines], rel=1e-9)
    seeds = grading.finer(seeded(scene))
    assert np.array_equal(seeds.mesh.points, seeded(scene, 2.0).mesh.points)
    if growth:
        moved = seeded(scene)
        x, y = moved.mesh.points.T
        shift = np.zeros_like(moved.mesh.points)
        shift[moved.mesh.body, 0] = 0.01 * y[moved.mesh.body] * (50 - y[moved.mesh.body]) / 50
        at = moved.moved(moved.mesh.points + shift)
        assert grading.finer(at).outlines[0].area == pytest.approx(at.outlines[0].area, rel=1e-6)
        assert grading.finer(at).outlines[0].downstream == pytest.approx(at.outlines[0].downstream, abs=1e-9)


# ---------------------------------------------------------------- columns and fields


@pytest.fixture(scope="module")
def reports():
    """{preset: (scene, reports)} of two bodies in water that pushes them."""
    found = {}
    for preset in ("fast", "paper"):
        growth = {"end": "1 h", "fluid_forces": "included", "tensile_strength": "1 MPa"}
        scene = scene_of(numerics={"preset": preset, "refinement": 0.4}, growth=growth)
        found[preset] = scene, list(repro.simulate(scene))
    return found


@PRESETS
def test_columns_of_bodies_add_up_to_those_of_all(reports, preset):
    scene, (*_, report) = reports[preset]
    row = results.row(scene, report)
    assert list(row) == results.column_names(scene)

    def of(name):
        return np.array([row[f"aggregate_{label}_{name}"] for label in ("left", "2")])

    assert of("area_um2").sum() == pytest.approx(row["aggregate_area_um2"], rel=1e-13)
    assert of("thickness_um").max() == row["thickness_um"] > of("thickness_um").min()
    assert of("upstream_um").min() == row["upstream_um"] and of("downstream_um").max() == row["downstream_um"]
    assert of("biomass_pg_per_m").sum() == pytest.approx(report.ledgers[-1].biomass_after, rel=1e-13)
    first, second = of("area_um2") / of("biomass_pg_per_m")
    assert first == pytest.approx(second, rel=0.02)  # each has grown to the area of its biomass
    for k, name in enumerate(("acceptor", "donor")):
        consumed = report.solved.fluxes[k].consumed
        assert of(f"{name}_uptake_ug_per_m_per_h").sum() == pytest.approx(1e-6 * consumed, rel=1e-12)
        per_mass = of(f"{name}_uptake_ug_per_m_per_h") / of("biomass_pg_per_m")
        assert per_mass[0] > per_mass[1] > 0.9 * per_mass[0]  # the one downstream has less
    for name in ("wall_traction_max_MPa", "tensile_stress_max_MPa"):
        assert of(name).max() == row[name] > of(name).min() > 0
        largest = int(of(name).argmax())
        assert of(name.replace("MPa", "x_um"))[largest] == row[name.replace("MPa", "x_um")]
    assert of("surface_stretch_min").min() == row["surface_stretch_min"]
    for axis in "xy":
        assert of(f"fluid_force_{axis}_uN_per_m").sum() == pytest.approx(row[f"fluid_force_{axis}_uN_per_m"], rel=1e-12)
    assert (of("fluid_force_x_uN_per_m") > 0).all()
    outlines = report.pore.outlines
    assert of("lower_contact_um") == pytest.approx([np.ptp(outlines[0].points[outlines[0].wall == BOTTOM, 0]), 0.0])
    assert of("upper_contact_um") == pytest.approx([0.0, np.ptp(outlines[1].points[outlines[1].wall == TOP, 0])])
    assert of("film_um") == pytest.approx(50 - of("thickness_um"), rel=1e-12)
    polygons = [shapely.Polygon(outline.points) for outline in outlines]
    assert of("gap_um") == pytest.approx(polygons[0].distance(polygons[1]), rel=1e-4)


@PRESETS
def test_fields_have_the_body_of_each_cell(reports, preset):
    scene, (*_, report) = reports[preset]
    pore, mesh = report.pore, report.pore.mesh
    grid = results.fields(scene, pore, report.solved)
    region = grid.cell_data["region"]
    for number, each in enumerate(mesh.regions, 1):
        assert np.array_equal(np.flatnonzero(region == number), each.triangles)
        moved = grid.point_data["position_t0_um"][each.nodes, :2] + grid.point_data["displacement_um"][each.nodes, :2]
        assert moved == pytest.approx(mesh.points[each.nodes], abs=1e-12)
        body = pore.bodies[number - 1]
        assert grid.point_data["position_t0_um"][each.nodes, :2] == pytest.approx(body.reference, abs=0)
        theta = (body.theta * body.solid.at.dx).sum(axis=1) / body.solid.at.dx.sum(axis=1)
        assert grid.cell_data["theta"][each.triangles] == pytest.approx(theta, rel=1e-14)
        assert grid.cell_data["J"][each.triangles] == pytest.approx(theta, rel=1e-3)
    assert set(np.unique(region)) == {0.0, 1.0, 2.0}
    for name, values in {**grid.point_data, **grid.cell_data}.items():
        if name in ("theta", "J", "stress_xx_MPa"):
            assert np.array_equal(np.isnan(values), region == 0), name


def test_names_of_columns_of_bodies_tell_quantity_unit_and_body():
    """No label makes two columns the same, and each name leads back to its quantity and its label."""
    labels = ["1", "12", "left", "a_area", "x_um", "lower", "wall_traction_max", "c-1"]
    made = [of_body(quantity, label) for label in labels for quantity in BODY]
    assert len({quantity.name for quantity in made}) == len(made)
    known = {quantity.name for quantity in SERIES}
    for label in labels:
        for quantity in BODY:
            name = of_body(quantity, label).name
            found = names.known(name)
            assert name not in known and found.words == f"{quantity.words}, aggregate {label}"
            assert names.unit(name) == quantity.unit.symbol and names.label(name).endswith(f", {label}")
    assert names.known("aggregate__area_um2") is None and names.known("aggregate_area_um2").name in known


# ---------------------------------------------------------------- files


@pytest.mark.thorough
def test_a_sweep_and_a_comparison_know_bodies(tmp_path):
    """`test_published.py` runs and draws two bodies, `test_resume.py` and `test_longer.py` continue such runs."""
    path, swept = tmp_path / "two.toml", tmp_path / "swept"
    path.write_text(str(scene_of(growth={"end": "0.4 h"}, output={})))
    assert main(["sweep", str(path), "--vary", "aggregate.left.radius=5 um, 12 um", "--out", str(swept)]) == 0
    runs = results.read_table(swept / "table.csv")
    assert set(runs["aggregate.left.radius_um"]) == {5.0, 12.0} and runs["aggregate_2_area_um2"].min() > 100
    folders = sorted(map(str, swept.glob("runs/*")))
    assert main(["compare", *folders, "--out", str(tmp_path / "page.html")]) == 0
    text = (tmp_path / "page.html").read_text()
    assert "thickness, aggregate left (um)" in text and ">12 um<" in text
    report = (swept / folders[0] / "report.html").read_text()
    assert "2 aggregates" in report and "Each aggregate: thinnest film" in report


@pytest.mark.parametrize("key, other", [("left", "1"), ("1", "left"), ("2", "2")])
def test_one_key_of_a_body_is_not_varied_twice_or_set_besides(tmp_path, key, other):
    """A name and a number of the same body are the same key."""
    vary = [f"aggregate.{key}.radius=5 um, 6 um"]
    with pytest.raises(repro.SceneError, match="one --vary of it is accepted|one vary of it is accepted"):
        repro.sweep(scene_of(), [*vary, f"aggregate.{other}.radius=7 um, 8 um"], tmp_path / "a")
    with pytest.raises(repro.SceneError, match="is not accepted beside"):
        repro.sweep(scene_of(), vary, tmp_path / "b", [f"aggregate.{other}.radius=7 um"])


def test_a_shape_is_of_one_aggregate():
    with pytest.raises(repro.SceneError, match="one aggregate at most is needed"):
        repro.simulate(scene_of(), shape=[(-5.0, 0.0), (0.0, 4.0), (5.0, 0.0)])


def test_a_folder_says_which_aggregates_left(tmp_path, capsys):
    """The run goes on without them: their columns are empty, and sums, balances and fields lack them. Its end says
    nothing of them, so that a warning of the run names each."""
    changes = ["numerics.preset=fast", "numerics.refinement=0.15", 'growth.end="0.3 h"', "growth.wall=bonded",
               'growth.bonding_strength="4e-4 MPa"', "growth.after_detachment=continue", "output.every=0.1 h",
               'aggregate=[{radius="8 um", position="-60 um", name="first"}, {radius="5 um", position="60 um"}]']
    arguments = [part for change in changes for part in ("--set", change)]
    assert main(["run", "base", "--out", str(tmp_path / "run"), *arguments]) == 0
    written = capsys.readouterr().err
    recorded = json.loads((tmp_path / "run" / "run.json").read_text())
    left = [warning["text"] for warning in recorded["warnings"] if warning["key"] == "growth.after_detachment"]
    assert [text.partition(" at t = ")[0] for text in left] == ["aggregate first detaches", "aggregate 2 detaches"]
    assert recorded["status"] == "completed" and all(text in written for text in left)
    run = repro.load_run(tmp_path / "run")
    first, second, area = (run[f"aggregate{name}_area_um2"] for name in ("_first", "_2", ""))
    alone = np.isnan(first) & ~np.isnan(second)
    assert alone.any() and np.isnan(run["aggregate_2_gap_um"][alone]).all() and area[-1] == 0.0
    assert area == pytest.approx(np.nan_to_num(first) + np.nan_to_num(second))
    assert np.abs(run["biomass_balance"]).max() < 1e-12
    regions = [set(np.unique(run.fields(time)["region"])) for time in (0.0, run.time[alone][0], run.time[-1])]
    assert regions == [{0.0, 1.0, 2.0}, {0.0, 2.0}, {0.0}]
