"""Errors of the finite elements name no keys of scenes; the error that stops a run names the keys that help."""
import re
from pathlib import Path

import pytest

import repro
from repro.errors import MeshError, SimulationError
from repro.march.loop import stopping
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


@pytest.mark.parametrize("kind", [*ADVICE, MeshError])
def test_an_error_of_the_elements_stops_a_run_with_the_keys_that_help(kind):
    """They are keys of scenes. If no key helps, the message ends with the cause."""
    with pytest.raises(SimulationError) as stopped, stopping(1.5):
        raise kind("the cause")
    start, advice = str(stopped.value).split("the cause")
    named = re.findall(r"\b[a-z]+\.[a-z_]+", advice)
    assert start == f"stopped in the step from t = 1.5 h, in {kind.stage}: "
    assert bool(named) is (kind in ADVICE) and {*named} <= KEYS | {"aggregate.outline"}
