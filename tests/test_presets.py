"""The values of presets, and the midpoint rule with elements of every order."""
from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

from repro.fem import sizing
from repro.fem.walls import TOP
from repro.march import simulation
from repro.scene import PRESETS, Numerics, parse_scene
from tests.strategies import scene
from tests.test_scene import EVERYTHING
from verification.problems.schemes import load_scene


@pytest.mark.parametrize("count", [pytest.param(0.0, marks=pytest.mark.thorough), 8.0])
def test_elements_beside_contact_lines_are_as_small_as_requested(count):
    """Edges beside the upper contact lines of a new mesh have at most the least film over the requested number. If no
    number is set, they are as large as elsewhere."""
    scene_in_contact = scene("17.9 um", "20 um", velocity="2.9 m/day", growth={"end": "0.2 h"},
                 numerics={"preset": "fast", "contact_elements": count}, output={"times": ["0.1 h", "0.2 h"]})
    film = scene_in_contact.growth.minimum_film
    last = next(instant.pore for instant in reversed(list(simulation.simulate(scene_in_contact))) if instant.remeshes)
    outline = last.outline.corners
    top = outline.wall == TOP
    beside = np.flatnonzero(outline.interface_edges() & (top | np.roll(top, -1)))
    assert len(beside) == 2
    sizes = outline.edge_lengths()[beside]
    assert (sizes <= sizing.SPLIT * 1.35 * (film / 8 + sizing.GRADATION * sizes)).all() == (count == 8)


def numerics(**changes):
    return parse_scene(EVERYTHING | {"numerics": changes}, "test", "test.toml").numerics


def test_a_preset_changes_the_defaults():
    """A preset changes only the keys that it names; the extent follows from the flow. Preset paper has the sizes of
    3.1."""
    for preset, chosen in PRESETS.items():
        assert numerics(preset=preset) == replace(Numerics(), preset=preset, extent="central", **chosen)
    assert numerics(preset="paper").refinement == 1.0


@pytest.mark.parametrize("former, other", list(permutations(PRESETS, 2)))
def test_another_preset_of_a_loaded_scene_sets_all_its_keys(former, other):
    """Keys that the scene itself sets keep their values."""
    loaded = load_scene("base", [f"numerics.preset={former}", "numerics.gradation=0.3"])
    expected = load_scene("base", [f"numerics.preset={other}", "numerics.gradation=0.3"])
    assert load_scene(loaded, [f"numerics.preset={other}"]) == expected
