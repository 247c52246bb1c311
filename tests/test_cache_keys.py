"""The key of every cache contains every input of the cached value."""
from dataclasses import fields, is_dataclass, replace
from functools import partial
from itertools import count

import numpy as np
import pytest

from repro.fem.space import Space
from repro.model import flow, gear, mesh_motion, transport
from repro.model.interface import interface_of
from repro.model.kinetics import Sink
from repro.model.resistance import Viscous
from repro.results.files import sealed
from repro.scene import load_scene, scene_hash
from repro.schemes import CURVED
from tests.strategies import meshed, seed
from verification import store
from verification.sensitivity import rounding

WIDE = load_scene("wide", ["numerics.preset=accurate", 'output.times=["1 h", "2 h"]', "growth.end=2 h"])
BASE = load_scene("base")


def leaves(node, path=()):
    """Yield the paths to all values of a scene except its name."""
    for field in fields(node):
        value = getattr(node, field.name)
        if is_dataclass(value):
            yield from leaves(value, (*path, field.name))
        elif isinstance(value, tuple) and value and is_dataclass(value[0]):
            yield from (leaf for k, each in enumerate(value) for leaf in leaves(each, (*path, field.name, k)))
        elif (*path, field.name) != ("name",):
            yield (*path, field.name)


def other(value):
    """Return another value of the same kind."""
    match value:
        case bool():
            return not value
        case float() | int():
            return 1.5 * value + 1
        case str():
            return value + "_other"
        case tuple():
            return (*value, 3.0)
    return None


def changed(node, path):
    """Return a scene with another value at a path, or None if its kind has no other value."""
    first, *rest = path
    value = node[first] if isinstance(first, int) else getattr(node, first)
    another = changed(value, rest) if rest else other(value)
    if another is None:
        return None
    if isinstance(first, int):
        return (*node[:first], another, *node[first + 1:])
    return replace(node, **{first: another})


def test_every_value_of_a_scene_counts_in_its_hash():
    variants = [changed(WIDE, path) for path in leaves(WIDE)]
    scenes = [WIDE, *(scene for scene in variants if scene is not None)]
    assert len(scenes) > 40 and len({*map(scene_hash, scenes)}) == len(scenes)


def test_every_section_of_a_scene_counts_in_its_hash():
    scenes = [BASE, *(replace(BASE, **{name: None}) for name in ("flow", "growth", "kinetics", "substrates"))]
    assert len({*map(scene_hash, scenes)}) == 5


def number_of_folder(path, scene):
    return store.provenance(store.Folders(path).get(scene))["number"]


def number_of_sensitivities(path, scene):
    return rounding.Runs(path / "runs.jsonl").get(scene)["number"]


@pytest.mark.parametrize("number_of", [number_of_folder, number_of_sensitivities])
def test_a_cached_run_belongs_to_its_scene_name_and_source(tmp_path, monkeypatch, number_of):
    """Another value, name or source makes another run; each run is computed once."""
    computed = count(1)

    def run(scene, folder):
        folder.mkdir()
        (folder / "run.json").write_text(sealed({"number": next(computed)}))

    monkeypatch.setattr(store, "run", run)
    for name in ("base", "wide"):
        monkeypatch.setitem(rounding.OF, name, lambda scene: {"number": next(computed)})
    scenes = [BASE, replace(BASE, name="wide"), changed(BASE, ("pore", "width")), changed(BASE, ("growth", "end"))]
    for source, first in (("12345678", 1), ("87654321", 5), ("12345678", 1)):
        monkeypatch.setattr(store, "source_hash", lambda text=source: text)
        assert [number_of(tmp_path, scene) for scene in scenes] == [*range(first, first + 4)]


def disc():
    """A new coarse curved mesh around a half-disc, with empty caches."""
    return meshed(seed(20.0, 0.3, 2), refinement=0.3)[0]


def velocity(interface, mesh):
    """Velocity of the flow on a mesh."""
    return flow.unit_flow(Space(mesh), Viscous(10.0), interface=interface_of(interface)).velocity


def concentrations(boundary, flowing, mesh):
    """Concentrations of both substrates on a mesh."""
    space = Space(mesh)
    carried = flow.solve(space, WIDE.flow, 600.0) if flowing else None
    substrates = replace(BASE.substrates, boundary=boundary)
    problem = transport.problem(space, carried, substrates, BASE.kinetics, CURVED)
    sink = Sink(1e-3 * BASE.kinetics.maximum_density * space.reaction.dx)
    if boundary == "closed":
        start = transport.supplied_everywhere(problem)
        end = gear.advance(problem, sink.active, sink.active, start, 0.01).concentrations
        return np.concatenate([end.acceptor, end.donor])
    steady = transport.steady(problem, sink)
    gear_steady = gear.settle(problem, sink, steady)
    return np.concatenate([steady.acceptor, steady.donor, gear_steady.acceptor])


def motion(mesh):
    """Motion of a mesh."""
    return mesh_motion.move(mesh, 1.001 * mesh.points[mesh.body], 1e-3)


#: Computations on one mesh that need different sparse systems.
SOLVES = {"flow, Laplacian": partial(velocity, "laplacian"), "flow, traction": partial(velocity, "traction"),
          "held ends": partial(concentrations, "open", False), "flow through": partial(concentrations, "open", True),
          "closed": partial(concentrations, "closed", False), "motion": motion}


@pytest.fixture(scope="module")
def alone():
    """Results of SOLVES, each on a new mesh."""
    return {name: solve(disc()) for name, solve in SOLVES.items()}


@pytest.mark.parametrize("names", [[*SOLVES], [*SOLVES][::-1]], ids=["forwards", "backwards"])
def test_sparse_systems_of_one_mesh_are_independent(names, alone):
    """Computations on one shared mesh agree to the last bit with those on separate meshes."""
    mesh = disc()
    wrong = [name for name in names if not np.array_equal(SOLVES[name](mesh), alone[name])]
    assert wrong == []
