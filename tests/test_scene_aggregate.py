"""[aggregate]: position and outline of the seed; points that are no outline are refused."""
import json
import tomllib
from dataclasses import replace

import pytest

from repro.march.simulation import shaped
from repro.scene import load_scene, packaged_scenes, parse_scene, scene_hash, scene_tables
from repro.scene.text import scene_text
from tests.test_scene import refusal, write_scene

BUMP = [["-5 um", "0 um"], ["-4 um", "3 um"], ["6 um", "4 um"], ["5 um", "0 um"]]
#: An aggregate from wall to wall, in a pore of 50 um by 600 um.
PLUG = [["-9 um", "0 um"], ["-8 um", "50 um"], ["8 um", "0.05 mm"], ["9 um", "0 um"]]
#: Hashes of the packaged scenes, when [aggregate] had only a radius.
HASHES = {"base": "201dca44f3569bf3", "flow_only": "ed81a859766f815f", "initial_mesh": "036078bb54cedcf3",
          "wide": "87b878e7ce531592"}


def scene_of(**aggregate):
    tables = {"pore": {"width": "50 um"}, "substrates": {}, "aggregate": aggregate}
    return parse_scene(tables, "mine", "mine.toml")


def toml(points):
    return f"[pore]\nwidth = \"50 um\"\n[aggregate]\noutline = {json.dumps(points)}\n"


@pytest.mark.parametrize("name", packaged_scenes())
def test_hashes_do_not_change(name):
    assert scene_hash(load_scene(name)) == HASHES[name]
    assert scene_hash(load_scene(name, ["aggregate.position=0 um", "aggregate.smooth=false",
                                         "pore.upper_wall=no slip"])) == HASHES[name]
    assert scene_hash(load_scene(name, ["pore.upper_wall=symmetry"])) != HASHES[name]
    assert scene_hash(load_scene(name, ["aggregate.position=1 um"])) != HASHES[name]


@pytest.mark.parametrize("points", [BUMP, PLUG])
def test_an_outline_is_read_back_unchanged(points, tmp_path):
    """A file, --set and the text give the same scene and hash."""
    path = write_scene(tmp_path, toml(points))
    scene, text = load_scene(path), scene_text(str(path))
    assert f"\noutline = {json.dumps(points)}\n" in text and '\n#radius = "5 um"\n' in text
    typed = load_scene("initial_mesh", [f"aggregate={{outline={json.dumps(points)}}}", "numerics.preset=fast"])
    for again in (typed, parse_scene(tomllib.loads(text), "mine", "again")):
        assert replace(again, name="mine") == scene and scene_hash(again) == scene_hash(scene)
    smooth = load_scene(path, ["aggregate.smooth=true"])
    assert scene_hash(smooth) != scene_hash(scene) and parse_scene(scene_tables(smooth), "mine", "again") == smooth


@pytest.mark.parametrize("aggregate", [{"radius": "4 um", "position": "3 um"}, {"outline": PLUG, "smooth": True}])
def test_a_shape_replaces_the_outline_alone(aggregate):
    """All other keys of the scene stay, including those of the seed."""
    changed = shaped(scene_of(inert_fraction=0.3, **aggregate), [(-5.0, 0.0), (-4.0, 3.0), (6.0, 4.0), (5.0, 0.0)])
    assert changed == scene_of(outline=BUMP, inert_fraction=0.3, smooth=aggregate.get("smooth", False))


LIST = "a list of 3 to 1000 points [x, y], each a pair of lengths, is needed, such as"


@pytest.mark.parametrize("points, part", [
    *((points, LIST) for points in (
        [], BUMP[:2], [["0 um", "0 um"]] * 1001, "-5 um, 0 um", [["-5 um", "0 um", "0 um"], *BUMP[1:]],
        [[-5, 0], [0, 4], [5, 0]], [["-5 h", "0 um"], *BUMP[1:]], [["nan um", "0 um"], *BUMP[1:]])),
    # no outline
    ([["-5 um", "1 um"], *BUMP[1:]], "y = 0 um at the first and the last point is needed"),
    ([*BUMP[:-1], ["5 um", "-1 um"]], "y = 0 um at the first and the last point is needed"),
    (BUMP[::-1], "the upstream end first (x of the first point less than of the last) is needed"),
    ([BUMP[0], BUMP[1], BUMP[0]], "the upstream end first"),
    ([BUMP[0], ["0 um", "0 um"], BUMP[3]], "0 < y <= pore.width (50 um) at point 2 (0 um, 0 um) is needed"),
    ([*BUMP[:3], ["6 um", "-4 um"], BUMP[3]], "0 < y <= pore.width (50 um) at point 4 (6 um, -4 um)"),
    ([["-300 um", "0 um"], *BUMP[1:]], "|x| < half of pore.length (600 um) at point 1 (-300 um, 0 um) is needed"),
    ([BUMP[0], BUMP[1], BUMP[1], BUMP[3]], "(50 um) or more is needed from point 2 to the next"),
    ([["-5 um", "0 um"], ["5 um", "4 um"], ["-5 um", "4 um"], ["5 um", "0 um"]], "neither crosses nor touches itself"),
    ([["-5 um", "0 um"], ["0 um", "9 um"], ["0 um", "2 um"], ["0 um", "8 um"], ["5 um", "0 um"]], "nor touches"),
    ([BUMP[0], ["0 um", "50 um"], BUMP[3]], "two points or more in a row, or none, on the upper wall"),
    ([BUMP[0], ["-4 um", "50 um"], ["0 um", "9 um"], ["4 um", "50 um"], BUMP[3]], "two points or more in a row"),
    # the same at the other end; tests/test_odd_outlines.py has gaps to walls and ends
    ([*BUMP[:3], ["300 um", "0 um"]], "|x| < half of pore.length (600 um) at point 4 (300 um, 0 um) is needed"),
    ([BUMP[0], ["0 um", "50.1 um"], BUMP[3]], "0 < y <= pore.width (50 um) at point 2 (0 um, 50.1 um) is needed"),
    ([BUMP[0], ["-5.01 um", "0.04 um"], *BUMP[1:]], "(50 um) or more is needed from point 1 to the next"),
    ([*BUMP[:3], ["5.01 um", "0.04 um"], BUMP[3]], "(50 um) or more is needed from point 4 to the next"),
])
def test_points_that_are_no_outline_are_refused(tmp_path, points, part):
    """One line names file, key, value and the accepted values."""
    path = write_scene(tmp_path, toml(points))
    message = refusal(path)
    assert message.startswith(f"{path}: aggregate.outline = {json.dumps(points)[:30]}") and part in message


@pytest.mark.parametrize("points", [
    [["-299.99 um", "0 um"], *BUMP[1:]], [*BUMP[:3], ["299.99 um", "0 um"]],
    [BUMP[0], ["0 um", "0.006 um"], ["4 um", "9 um"], BUMP[3]], [BUMP[0], ["0 um", "49.994 um"], BUMP[3]],
    [BUMP[0], ["-5.01 um", "0.06 um"], *BUMP[1:]], [["-0.03 um", "0 um"], *BUMP[1:3], ["0.03 um", "0 um"]]])
def test_points_just_within_their_bounds_are_accepted(points):
    """At either end, beside either wall, and between neighbours."""
    assert scene_of(outline=points).aggregate.outline
