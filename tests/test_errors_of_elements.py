"""Errors of the finite elements name no keys of scenes; the error that stops a run names the keys that help."""
import re
from pathlib import Path

import pytest

import repro
from repro.errors import MeshError, OriginFolded, SimulationError
from repro.march import loop
from repro.march.state import stopping
from repro.model.advice import ADVICE
from repro.scene import load_scene, scene_tables

KEYS = {f"{section}.{key}" for name in ("base", "wide") for section, table in scene_tables(load_scene(name)).items()
        for key in table}


def test_finite_elements_name_no_keys_of_scenes():
    words = r"\b(pore|aggregate|flow|substrates|kinetics|growth|numerics|output)\.[a-z_]+"
    folder = Path(repro.__file__).parent / "fem"
    texts = [path.read_text(encoding="utf-8") for path in folder.glob("*.py")]
    statements = [line for text in texts for line in text.splitlines() if not line.lstrip().startswith(">>>")]
    assert len(texts) > 10 and re.findall(words, "\n".join(statements)) == []


@pytest.mark.parametrize("kind", [*ADVICE, MeshError, OriginFolded])
def test_an_error_of_the_elements_stops_a_run_with_the_keys_that_help(kind):
    """They are keys of scenes. If no key helps, the message ends with the cause."""
    with pytest.raises(SimulationError) as stopped, stopping(1.5):
        raise kind("the cause")
    start, advice = str(stopped.value).split("the cause")
    named = re.findall(r"\b[a-z]+\.[a-z_]+", advice)
    assert start == f"stopped in the step from t = 1.5 h, in {kind.stage}: "
    assert bool(named) is (kind in ADVICE) and {*named} <= KEYS | {"aggregate.outline"}


@pytest.mark.parametrize("kind", [*ADVICE, OriginFolded])
def test_on_a_bonded_wall_no_refinement_is_advised_where_places_fold(kind):
    """A larger refinement stops base there sooner or later. All other advice is that of a sliding wall."""
    messages = []
    for bonded in (False, True):
        with pytest.raises(SimulationError) as stopped, stopping(1.5, bonded):
            raise kind("the cause")
        messages.append(str(stopped.value))
    assert (messages[0] == messages[1]) is (kind is not OriginFolded)
    if kind is OriginFolded:
        assert "no setting helps" in messages[1] and "numerics.refinement" not in messages[1]


def test_a_run_knows_whether_its_wall_is_bonded(monkeypatch):
    """A step fails as if its places at t = 0 folded."""
    def fail(*_):
        raise OriginFolded("the places at t = 0 fold")

    monkeypatch.setattr(loop.balance, "refuse", fail)
    for wall, advice in (("sliding", "places at t = 0 fold$"), ("bonded", "no setting helps")):
        with pytest.raises(SimulationError, match=advice):
            repro.solve("base", ["numerics.preset=fast", 'growth.end="0.2 h"', f"growth.wall={wall}"])
