"""The audit: every choice is a scene that differs in what it says, and a row tells what it measures."""
import json

import numpy as np
import pytest

from repro.model import pore
from repro.scene import load_scene, scene_tables
from verification.audit import __main__ as audit
from verification.audit import choices, measure
from verification.audit.choices import CHOICES


@pytest.mark.parametrize("choice", CHOICES, ids=lambda choice: choice.alternative)
def test_a_choice_changes_what_it_names_and_nothing_else(choice):
    """Against the paper's preset."""
    plain, changed = (scene_tables(measure.scene(*changes)) for changes in ((), choice.changes))
    apart = [f"{name}.{key}" for name, table in plain.items() if isinstance(table, dict) for key in table
             if table[key] != changed[name][key]]
    assert apart == [choice.changes[0].partition("=")[0]]


def test_the_default_is_the_papers():
    said = measure.scene()
    assert said.numerics == load_scene("base", ['numerics.preset="paper"']).numerics and said.growth.end == 19.2


@pytest.fixture(scope="module")
def short():
    """Base for two steps on a coarse mesh."""
    changes = ("numerics.refinement=0.5", 'aggregate.radius="15 um"')
    return lambda *more: measure.scene(*changes, *more, end=0.8)


def test_effects_are_relative_and_effluents_over_the_supply(short):
    said = short()
    default = dict.fromkeys((*measure.RELATIVE, *measure.EFFLUENTS), 4.0)
    found = measure.effect(said, default, {name: 5.0 for name in default})
    assert found == {**dict.fromkeys(measure.RELATIVE, 0.25), **dict.fromkeys(measure.EFFLUENTS, 0.1)}
    assert measure.largest({"a": -2.0, "b": 1.0}) == "a" and measure.largest({}) == ""


def test_one_state_tells_two_scenes_apart_on_one_mesh(short):
    """No difference to itself to the last bit; F changes the acceptor, fluid forces the shape alone."""
    said = short()
    found = measure.run(said)
    assert set(measure.one_state(said, said, found).values()) == {0.0}
    fluid = measure.one_state(said, short('growth.fluid_forces="included"'), found)
    assert fluid["velocity"] == fluid["acceptor leaving"] == 0 and 0 < abs(fluid["upstream"]) < 1e-4
    exact = measure.one_state(said, short("kinetics.acceptor_to_donor_ratio=1.5138"), found)
    assert 1e-5 < exact["acceptor leaving"] < 1e-2 and exact["velocity"] == 0


def test_reshaping_to_its_own_outline_changes_nothing_and_to_a_finer_one_hardly_anything(short):
    """The mesh stays the default's; the flow is that of the other shape: a larger aggregate of the same shape."""
    default, finer = measure.run(short()), measure.run(short("numerics.refinement=0.52"))
    assert np.array_equal(measure.reshaped(default.pore, default.pore.outline).mesh.points, default.pore.mesh.points)
    one, two = (each(short(), default, finer) for each in (measure.whole_run, measure.two_meshes))
    assert abs(one["velocity"]) < 0.3 * abs(two["velocity"]) and one["area"] == two["area"]
    wide = measure.run(short('aggregate.radius="15.15 um"'))
    radius = wide.pore.outline.thickness / default.pore.outline.thickness
    there = measure.reshaped(default.pore, wide.pore.outline)
    assert there.outline.area / default.pore.outline.area == pytest.approx(radius**2, rel=1e-4)
    assert measure.whole_run(short(), default, wide)["velocity"] < -1e-3


def test_runs_in_turn_alternate():
    order = []

    def make(name, seconds):
        return lambda: order.append(name) or measure.Run(seconds, None, None)

    *_, ratio = measure.in_turn((make("a", 2.0), make("b", 3.0)), 2)
    assert order == ["a", "b", "a", "b"] and ratio == 1.5


def test_marching_is_the_run(short):
    """The audit's own loop and the package's make the same steps."""
    said = short()
    found, steps = measure.advance(said, pore.seeded(said), choices._step, 0.8)
    other = measure.run(said)
    assert {len(column) for column in steps.values()} == {2} and steps["drift"].max() < 0.01
    assert abs(steps["lean"]).max() < 1e-2
    assert measure.quantities(found.pore, found.solved) == measure.quantities(other.pore, other.solved)


def test_an_uneven_seed_is_one_percent_off():
    said = measure.scene()
    plain, bulging = pore.seeded(said), choices.uneven(said, 0.01)
    assert bulging.outline.downstream == pytest.approx(5.05) and bulging.outline.upstream == pytest.approx(-4.95)
    apart = np.hypot(*(bulging.outline.points[bulging.wall == 0] - [0.05, 0.0]).T) / 5 - 1
    assert np.ptp(apart) > 0.02  # and not a half-disc that has moved
    assert bulging.outline.area == pytest.approx(plain.outline.area, rel=1e-4)
    assert np.array_equal(bulging.origin, bulging.mesh.points) and bulging.fixed.sum() == 1
    assert (bulging.active == said.kinetics.maximum_density * bulging.space.reaction.dx).all()


def test_the_record_is_written_whole_and_the_table_names_every_row(tmp_path):
    row = {"choice": "extent", "default": "central", "alternative": "full", "cost_ratio": 2.5, "largest": "velocity",
           "effect": {"velocity": -0.01, "area": 0.001}, "one_state": {}, "note": ""}
    audit.save({"machine": {}, "rows": [row]}, tmp_path / "report" / "audit.json")
    assert json.loads((tmp_path / "report" / "audit.json").read_text())["rows"] == [row]
    head, line = audit.table([row])
    assert "extent" in line and "2.50" in line and "-1.0e-02 velocity" in line and "cost" in head
    assert audit.resolved(row["effect"], {"velocity": 0.0049, "area": -0.0006}) == ["velocity"]
    with pytest.raises(ValueError):
        audit.save({"rows": [float("nan")]}, tmp_path / "audit.json")
    assert not (tmp_path / "audit.json").exists()
