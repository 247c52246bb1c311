"""[aggregate]: where the seed is and what outline it has, as data; what is no outline is refused."""
import dataclasses
import json
import math
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from repro.march.simulation import shaped
from repro.scene import Aggregate, load_scene, packaged_scenes, parse_scene, scene_hash, scene_tables
from repro.scene.text import scene_text
from tests.test_scene import refusal, written

BUMP = [["-5 um", "0 um"], ["-4 um", "3 um"], ["6 um", "4 um"], ["5 um", "0 um"]]
#: In a pore of 50 um by 600 um, from wall to wall.
PLUG = [["-9 um", "0 um"], ["-8 um", "50 um"], ["8 um", "0.05 mm"], ["9 um", "0 um"]]
#: Of the packaged scenes, before [aggregate] had anything but a radius.
HASHES = {"base": "201dca44f3569bf3", "flow_only": "ed81a859766f815f", "initial_mesh": "036078bb54cedcf3",
          "wide": "87b878e7ce531592"}


def tables(**aggregate):
    return {"pore": {"width": "50 um"}, "aggregate": aggregate}


def outlined(points, **more):
    return parse_scene(tables(outline=points, **more), "mine", "mine.toml").aggregate


def toml(points):
    return f"[pore]\nwidth = \"50 um\"\n[aggregate]\noutline = {json.dumps(points)}\n"


@pytest.mark.parametrize("name", packaged_scenes())
def test_hashes_stand(name):
    assert scene_hash(load_scene(name)) == HASHES[name]
    assert scene_hash(load_scene(name, ["aggregate.position=0 um", "aggregate.smooth=false"])) == HASHES[name]
    assert scene_hash(load_scene(name, ["aggregate.position=1 um"])) != HASHES[name]


def test_a_seed_is_5_um_unless_it_has_an_outline():
    assert Aggregate() == Aggregate(radius=5.0, position=0.0, outline=None, smooth=False, inert_fraction=0.0)
    seed = outlined(BUMP)
    assert (seed.radius, seed.position, seed.smooth) == (None, 0.0, False)
    assert seed.outline == ((-5.0, 0.0), (-4.0, 3.0), (6.0, 4.0), (5.0, 0.0))
    assert outlined(BUMP, smooth=True).smooth is True


@pytest.mark.parametrize("key, value, read", [
    ("position", "20 um", 20.0), ("position", "-0.02 mm", -20.0), ("position", "-294.9 um", -294.9),
    ("position", "0 um", 0.0), ("inert_fraction", 0.0, 0.0), ("inert_fraction", 0.3, 0.3),
    ("inert_fraction", 0.999999, 0.999999),
])
def test_a_seed_elsewhere_and_of_other_biomass(key, value, read):
    """Upstream of the middle, and with no active biomass but a millionth."""
    scene = load_scene("base", [f"aggregate.{key}={value}"])
    assert scene.aggregate == Aggregate(radius=5.0, **{key: read})
    assert parse_scene(scene_tables(scene), "base", "again") == scene
    assert (scene_hash(scene) == HASHES["base"]) == (read == 0)


def test_inert_fraction_needs_biomass_that_is_modelled():
    said = "aggregate.inert_fraction = 0.3: 0 is needed without [substrates]"
    assert said in refusal("flow_only", "aggregate.inert_fraction=0.3")
    assert load_scene("flow_only", ["aggregate.inert_fraction=0.3", "substrates={}"]).aggregate.inert_fraction == 0.3


@pytest.mark.parametrize("points", [BUMP, PLUG])
def test_an_outline_is_read_back_from_what_it_writes(points, tmp_path):
    """From a file, from --set and from its text: the same scene and hash."""
    scene, text = load_scene(written(tmp_path, toml(points))), scene_text(str(tmp_path / "mine.toml"))
    assert f"\noutline = {json.dumps(points)}\n" in text and '\n#radius = "5 um"\n' in text
    assert "\n#smooth = false\n" in text and '\n#position = "0 um"\n' in text
    there = [load_scene("initial_mesh", [f"aggregate={{outline={json.dumps(points)}}}", 'numerics.preset="fast"']),
             parse_scene(tomllib.loads(text), "mine", "again")]
    for again in there:
        assert dataclasses.replace(again, name="mine") == scene and scene_hash(again) == scene_hash(scene)
    smooth = load_scene(tmp_path / "mine.toml", ["aggregate.smooth=true"])
    moved = load_scene(tmp_path / "mine.toml", [f"aggregate.outline={json.dumps([['-30 um', '0 um'], *points[1:]])}"])
    assert len({scene_hash(one) for one in (scene, smooth, moved)}) == 3
    assert parse_scene(scene_tables(smooth), "mine", "again") == smooth


@pytest.mark.parametrize("aggregate", [{"radius": "4 um", "position": "3 um"}, {"outline": PLUG, "smooth": True}])
def test_a_shape_takes_the_place_of_the_outline_alone(aggregate):
    """All else that a scene says stands, of its seed as of the rest."""
    scene = parse_scene({**tables(inert_fraction=0.3, **aggregate), "substrates": {}}, "mine", "mine.toml")
    kept = dataclasses.asdict(scene.aggregate) | {"radius": None, "position": 0.0, "outline": ((-5, 0), (1, 4), (6, 0))}
    found = shaped(scene, [(-5, 0), (1, 4), (6, 0)])
    assert found == dataclasses.replace(scene, aggregate=Aggregate(**kept))


@given(st.lists(st.tuples(st.floats(1.1, 49.9), st.integers(4, 58)), min_size=1, max_size=9,
                unique_by=lambda point: point[1]), st.floats(-100, 100))
def test_whatever_is_seen_from_the_wall_is_an_outline(drawn, middle):
    """Points about a place on the wall, in the order of their angles."""
    points = [[f"{middle - 60!r} um", "0.0 um"]]
    for size, step in sorted(drawn, key=lambda point: -point[1]):
        points.append([f"{middle + size * math.cos(step / 20)!r} um", f"{size * math.sin(step / 20)!r} um"])
    points.append([f"{middle + 60!r} um", "0.0 um"])
    scene = parse_scene(tables(outline=points), "drawn", "drawn.toml")
    assert scene_tables(scene)["aggregate"]["outline"] == points
    assert parse_scene(scene_tables(scene), "drawn", "again") == scene


LIST = "a list of 3 to 1000 points [x, y], each a pair of lengths, is needed, such as"


@pytest.mark.parametrize("points, said", [
    *((points, LIST) for points in (
        [], BUMP[:2], [["0 um", "0 um"]] * 1001, "-5 um, 0 um", 5, {}, [["-5 um", "0 um", "0 um"], *BUMP[1:]],
        [["-5 um"], *BUMP[1:]], [[-5, 0], [0, 4], [5, 0]], [["-5 h", "0 um"], *BUMP[1:]], ["-5 um", "0 um", "5 um"],
        [["nan um", "0 um"], *BUMP[1:]])),
    # no outline
    ([["-5 um", "1 um"], *BUMP[1:]], "y = 0 um at the first and the last point is needed"),
    ([*BUMP[:-1], ["5 um", "-1 um"]], "y = 0 um at the first and the last point is needed"),
    (BUMP[::-1], "the upstream end first (x of the first point less than of the last) is needed"),
    ([BUMP[0], BUMP[1], BUMP[0]], "the upstream end first"),
    ([BUMP[0], ["0 um", "0 um"], BUMP[3]], "0 < y <= pore.width (50 um) at point 2 (0 um, 0 um) is needed"),
    ([*BUMP[:3], ["6 um", "-4 um"], BUMP[3]], "0 < y <= pore.width (50 um) at point 4 (6 um, -4 um)"),
    ([BUMP[0], ["0 um", "50.1 um"], BUMP[3]], "0 < y <= pore.width (50 um) at point 2 (0 um, 50.1 um)"),
    ([["-300 um", "0 um"], *BUMP[1:]], "|x| < half of pore.length (600 um) at point 1 (-300 um, 0 um) is needed"),
    ([*BUMP[:2], ["1 m", "3 um"], BUMP[3]], "at point 3 (1e+06 um, 3 um)"),
    ([BUMP[0], BUMP[1], BUMP[1], BUMP[3]], "(50 um) or more is needed from point 2 to the next"),
    ([["-5 um", "0 um"], ["5 um", "4 um"], ["-5 um", "4 um"], ["5 um", "0 um"]], "neither crosses nor touches itself"),
    ([["-5 um", "0 um"], ["0 um", "9 um"], ["0 um", "2 um"], ["0 um", "8 um"], ["5 um", "0 um"]], "nor touches"),
    ([BUMP[0], ["0 um", "50 um"], BUMP[3]], "two points or more in a row, or none, on the upper wall"),
    ([BUMP[0], ["-4 um", "50 um"], ["0 um", "9 um"], ["4 um", "50 um"], BUMP[3]], "two points or more in a row"),
])
def test_no_outline(tmp_path, points, said):
    """In one line that names file, key, value and what is accepted."""
    path = written(tmp_path, toml(points))
    message = refusal(path)
    assert message.startswith(f"{path}: aggregate.outline = {json.dumps(points)[:30]}") and said in message
