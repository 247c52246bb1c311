"""Ragged outlines, drawn by seed: sharp tips and notches, necks and films. The presets agree, or a warning states the
difference."""
import random
import re

import numpy as np
import pytest
import shapely

from repro.fem import mesher
from repro.fem.mesh import triangle_areas
from repro.fem.outline import polygon
from repro.fem.walls import channel_walls
from repro.model import solving
from repro.model.meshing import seeded
from repro.preflight import resolved
from repro.preflight.resolved import find_unresolved_flow
from repro.scene import SceneError, load_scene, packaged_scenes, parse_scene
from tests.strategies import in_um

#: Largest relative difference between fast and accurate without a warning.
FAST = 0.015
SPIKES = [(-14.6091, 0), (-6.88447, 11.647), (-4.89941, 26.2897), (-0.60518, 22.8188), (2.9581, 38.0181),
          (4.92759, 29.0622), (7.63545, 27.8786), (15.1722, 34.9812), (9.46785, 11.292), (11.0158, 0)]


def scene(width, points, preset="fast", refinement=None):
    numerics = {"preset": preset} if refinement is None else {"preset": preset, "refinement": refinement}
    return parse_scene({"pore": {"width": f"{width!r} um", "length": "600 um"}, "aggregate": {"outline": in_um(points)},
                        "flow": {"mean_velocity": "0.3032 m/day"}, "numerics": numerics}, "ragged", "ragged.toml")


def ragged(seed):
    """Width (um) and points of an outline that its scene accepts; every fourth one spans the pore."""
    draw = random.Random(seed)
    for _ in range(10_000):
        width, half, count = draw.uniform(15, 120), draw.uniform(0.15, 1.2), draw.randint(3, 12)
        x = sorted(draw.uniform(-half, half) for _ in range(count))
        y = [draw.choice([draw.uniform(0.05, 0.5), draw.uniform(0.5, 0.97)]) for _ in x]
        points = width * np.array([(-1.05 * half, 0), *zip(x, y), (1.05 * half, 0)])
        if seed % 4 == 0:
            points[count // 2: count // 2 + 2, 1] = width
        try:
            if shapely.Polygon(points).is_valid and scene(width, points):
                return width, points
        except SceneError:
            continue


def head_loss(scene_of_outline):
    return solving.solve(scene_of_outline, seeded(scene_of_outline)).flow.head_loss


def test_a_spiked_outline_is_the_same_in_every_preset():
    """Without smaller edges at its tips the head loss in fast is 11 % low."""
    losses = {preset: head_loss(scene(43.5, SPIKES, preset)) for preset in ("fast", "accurate", "exact")}
    assert losses["fast"] == pytest.approx(losses["exact"], rel=0.01)
    assert losses["accurate"] == pytest.approx(losses["exact"], rel=0.002)


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.thorough) for seed in range(2, 8))])
def test_presets_agree_on_a_ragged_outline_or_a_warning_names_what_resolves_it(seed):
    width, points = ragged(seed)
    fast = scene(width, points)
    warnings = list(find_unresolved_flow(fast))
    if not warnings:
        assert head_loss(fast) == pytest.approx(head_loss(scene(width, points, "accurate")), rel=FAST)
        return
    advice = re.search(r"numerics\.refinement = ([\d.]+) resolves", warnings[0].text)
    assert not list(find_unresolved_flow(scene(width, points, "fast", float(advice[1]))))


def thin_spike():
    """A needle 1 um thick and 98 um high beside a pile, whose flank the preset fast does not resolve."""
    return [(-20, 0), (-9, 35), (22, 81), (23, 8), (30.5, 113), (31, 23), (43, 0)]


def test_an_unresolved_flow_gives_a_warning_with_the_expected_head_loss():
    warnings = list(find_unresolved_flow(scene(116.0, thin_spike())))
    assert len(warnings) == 1
    numbers = re.match(r"the head loss at t = 0 is ([\d.e-]+) cm; finer meshes are expected to give about "
                       r"([\d.e-]+) cm \(", warnings[0].text)
    first, expected = (1e4 * float(number) for number in numbers.groups())
    assert first == pytest.approx(head_loss(scene(116.0, thin_spike())), rel=1e-3)
    assert expected == pytest.approx(head_loss(scene(116.0, thin_spike(), "exact")), rel=0.01)
    advice = float(re.search(r"numerics\.refinement = ([\d.]+) resolves", warnings[0].text)[1])
    assert not list(find_unresolved_flow(scene(116.0, thin_spike(), "fast", advice)))


@pytest.mark.parametrize("name", packaged_scenes())
def test_half_discs_are_not_compared_with_finer_meshes(name, monkeypatch):
    monkeypatch.setattr(resolved, "seeded", None)
    assert not list(find_unresolved_flow(load_scene(name)))


def test_edges_grow_from_a_tip_a_notch_and_no_other_corner():
    """Edges start at 0.1 um at tips and 0.3 um at notches; the lines do not move."""
    points = np.array([(-20, 0), (-10, 20), (0, 5), (5, 20), (9, 29), (30, 0)], float)
    outline = polygon(points, channel_walls(50.0), at_tips=0.1)
    lengths = outline.edge_lengths()
    for corner, shortest in [((-10, 20), 0.1), ((0, 5), 0.3), ((9, 29), 0.1)]:
        k = int(np.flatnonzero((outline.points == corner).all(axis=1))[0])
        assert lengths[[k - 1, k]] == pytest.approx(shortest)
    assert outline.area == pytest.approx(polygon(points, channel_walls(50.0)).area, rel=1e-12)
    k = int(np.flatnonzero((outline.points == (5, 20)).all(axis=1))[0])
    assert lengths[[k - 1, k]].min() > 1
    assert len(polygon(points, channel_walls(50.0)).points) == len(points) + 1


def test_no_triangle_has_its_nodes_on_one_line():
    """Round-off may move the middle one of three nodes off a straight edge; Mmg refuses the triangle that results."""
    points = np.array([(0, 0), (1, 0), (3, 0), (2, 2)], float)
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    mended = mesher._without_slivers(points, triangles)
    assert triangle_areas(points, mended) == pytest.approx([1, 2])
