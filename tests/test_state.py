"""State is explicit: what is worked out once belongs to the object that it derives from, and runs share nothing."""
from dataclasses import fields, is_dataclass, replace
from functools import cached_property
from itertools import zip_longest

import numpy as np
import pytest
from skfem import Mesh as TheirMesh

from repro.fem.linear import DEFAULT, Method
from repro.fem.mesh import Mesh, Topology
from repro.fem.space import Space
from repro.march.simulation import simulate
from repro.model import contact, pore, remeshing
from repro.scene import load_scene
from tests import faults
from tests.strategies import ORDERS, meshed, seed

geometries = pytest.mark.parametrize("geometry", [1, 2])


def remembered(cls):
    """Names of what a class works out once."""
    return [name for name, value in vars(cls).items() if isinstance(value, cached_property)]


def alike(one, other):
    """Are two values the same to the last bit? Of objects: all that they were made of."""
    if isinstance(one, np.ndarray):
        return np.array_equal(one, other)
    if isinstance(one, TheirMesh):
        return np.array_equal(one.p, other.p) and np.array_equal(one.t, other.t)
    if isinstance(one, tuple):
        return all(alike(a, b) for a, b in zip_longest(one, other))
    if is_dataclass(one):
        return all(alike(getattr(one, f.name), getattr(other, f.name)) for f in fields(one) if f.init)
    return one == other


def differences(one, other):
    """Names of what two objects of a class have worked out otherwise."""
    return [name for name in remembered(type(one)) if not alike(getattr(one, name), getattr(other, name))]


def touched(thing):
    """The object, after everything has been asked of it that it works out once."""
    for name in remembered(type(thing)):
        getattr(thing, name)
    if isinstance(thing, Topology):
        [thing.dofs(order) for order in ORDERS]
    return thing


def disc(geometry, refinement=0.4):
    """A mesh around a half-disc, and its outline."""
    return meshed(seed(20.0, refinement, geometry), refinement=refinement)


def again(mesh, **changes):
    """The same mesh from its arrays, with other ones in their place."""
    parts = {"points": mesh.points, "cells": mesh.cells, "biomass": mesh.biomass, "loop": mesh.loop,
             "width": mesh.width, "ends": mesh.ends} | changes
    return Mesh.of(**parts)


@pytest.mark.parametrize("kind", ORDERS.values())
def test_what_is_replaced_remembers_nothing(kind):
    """Of each object that works things out once: its fields alone go to the other, and nothing that it has kept."""
    scene = load_scene("base", ["numerics.preset=fast", f"numerics.elements={kind}", "numerics.refinement=0.5"])
    now = pore.seeded(scene)
    pore.solve(scene, now)
    contact.expand(scene, now, 1.02 * now.theta)
    kept = (now, now.space, now.mesh, now.mesh.topology, now.mesh.topology.straight, now.body, now.body.shape)
    for thing in map(touched, kept):
        names = {field.name for field in fields(thing)}
        assert names < vars(thing).keys(), "else nothing is tested"
        other = replace(thing)
        assert vars(other).keys() == names, type(thing)
        assert all(value == {} for value in vars(other).values() if isinstance(value, dict)), type(thing)


@geometries
def test_a_mesh_with_other_points_forgets(geometry):
    """All that depends on places is worked out anew; what depends on the connections alone stays."""
    mesh = touched(disc(geometry)[0])
    touched(mesh.topology)
    points = mesh.points * [1.1, 1.0]
    ends = tuple(1.1 * end for end in mesh.ends)
    moved, fresh = replace(mesh, points=points, ends=ends), again(mesh, points=points, ends=ends)
    assert differences(moved, fresh) == [] and differences(moved.topology, fresh.topology) == []
    assert moved.area() == fresh.area() != mesh.area() and moved.topology is mesh.topology
    for order in ORDERS:
        assert alike(moved.topology.dofs(order), fresh.topology.dofs(order))
        assert differences(Space(moved, order), Space(fresh, order)) == []
    assert mesh.moved(points).points is points


def scenes(*changes):
    """A short run of the paper's scheme and one of curved triangles."""
    common = ("numerics.refinement=0.5", 'aggregate.radius="20 um"', *changes)
    return (load_scene("base", ('growth.end="48 min"', *common)),
            load_scene("base", ('numerics.preset="fast"', 'growth.end="1 h"', 'output.times=["0.3 h", "0.6 h", "1 h"]',
                                *common)))


def numbers(instant):
    """All that an instant reports, to the last bit."""
    now, solved = instant.pore, instant.solved
    return (now.time, now.mesh.points, now.mesh.cells, now.active, now.inert, now.theta, now.pressure,
            solved.concentrations.acceptor, solved.concentrations.donor, solved.flow.velocity, solved.flow.head_loss)


OTHER_PACKAGES = 'numerics.ordering="metis"', 'numerics.solver="pardiso"'


@pytest.mark.parametrize("which", [0, 1], ids=["paper", "fast"])
def test_runs_in_turns_do_not_see_each_other(which, monkeypatch):
    """Two runs of one scene but for the packages that order and solve its linear systems, step by step in turns in one
    process: each is what it is alone, to the last bit, and the two differ in the last bits."""
    made, _ = (faults.stand_in_package(monkeypatch, package) for package in ("pymetis", "pypardiso"))
    pair = scenes()[which], scenes(*OTHER_PACKAGES)[which]
    alone = [tuple(map(numbers, simulate(scene))) for scene in pair]
    called = len(made.calls)
    turns = list(zip(*map(simulate, pair), strict=True))
    together = [tuple(map(numbers, instants)) for instants in zip(*turns)]
    assert len(together[0]) >= 3 and all(map(alike, alone, together))
    assert called > 0 and len(made.calls) == 2 * called, "each run orders its own systems, and no other's"
    assert not alike(alone[0][-1], alone[1][-1]), "else the order of the unknowns would not show"
    for one, other in zip(alone[0][-1][1:], alone[1][-1][1:]):
        assert np.allclose(one, other, rtol=1e-6, atol=1e-6 * np.abs(one).max())


@pytest.mark.parametrize("which", [0, 1], ids=["paper", "fast"])
def test_the_method_of_a_scene_reaches_every_system(which, monkeypatch):
    """Of flow, substrates, mesh motion and growth, at t = 0 and on a new mesh."""
    for package in ("pymetis", "pypardiso"):
        faults.stand_in_package(monkeypatch, package)
    scene = scenes(*OTHER_PACKAGES)[which]
    wanted = Method("pardiso", "metis")
    now = pore.seeded(scene)
    expanded = contact.expand(scene, now, 1.05 * now.theta).pore
    assert remeshing.followed(scene, now, expanded) is not None
    then = remeshing.remesh(scene, now, expanded, 0.0)[0]
    for one in (now, then):
        pore.solve(scene, one)
        topologies = one.mesh.topology, one.mesh.topology.straight
        systems = [system for topology in topologies for system in topology._systems.values()]
        assert {topology.method for topology in topologies} == {one.body.shape.method} == {wanted}
        assert {system.method for system in (*systems, one.body.shape.unconstrained)} == {wanted}
        assert len(systems) >= 3
    assert {system.method for system in pore.seeded(scenes()[which]).mesh.topology._systems.values()} <= {DEFAULT}
