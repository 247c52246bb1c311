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
from repro.model import contact, flow, mesh_motion, pore, remeshing
from repro.model.growth import Body, Shape
from repro.model.pore import Pore
from repro.scene import load_scene
from tests import faults
from tests.strategies import ORDERS, bent_inside, body_of, meshed, seed

METIS = Method("superlu", "metis")
geometries = pytest.mark.parametrize("geometry", [1, 2])
orders = pytest.mark.parametrize("order", ORDERS)


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


def less_biomass(mesh):
    """(T,) the aggregate without what lies to the right of the middle."""
    return mesh.biomass & (mesh.points[mesh.triangles].mean(axis=1)[:, 0] < 0)


def flipped(mesh):
    """Cells with the corners of every triangle one further on, and in another order of triangles."""
    turn = [1, 2, 0] if mesh.geometry == 1 else [1, 2, 0, 4, 5, 3]
    return np.roll(mesh.cells[:, turn], 7, axis=0)


def test_there_is_something_to_forget():
    """Else nothing is tested."""
    assert {len(remembered(cls)) > 0 for cls in (Mesh, Topology, Space, Pore, Body, Shape)} == {True}


@geometries
def test_a_mesh_with_other_points_forgets(geometry):
    """All that depends on places is worked out anew; what depends on the connections alone stays."""
    mesh = touched(disc(geometry)[0])
    touched(mesh.topology)
    points = mesh.points * [1.1, 1.0]
    ends = tuple(1.1 * end for end in mesh.ends)
    moved, fresh = replace(mesh, points=points, ends=ends), again(mesh, points=points, ends=ends)
    assert differences(moved, fresh) == []
    assert moved.area() == fresh.area() != mesh.area() and moved.topology is mesh.topology
    for order in ORDERS:
        assert alike(moved.topology.dofs(order), fresh.topology.dofs(order))
        assert differences(Space(moved, order), Space(fresh, order)) == []
    assert mesh.moved(points).points is points


@geometries
@pytest.mark.parametrize("what", ["cells", "biomass"])
def test_a_topology_with_other_cells_or_biomass_forgets(geometry, what):
    """Nodes of every order, edges, the aggregate's nodes, and the systems."""
    mesh = disc(geometry)[0]
    old = touched(mesh.topology)
    kept = old.system("a key", lambda: "the old one")
    loop = mesh.loop if what == "cells" else np.empty(0, int)
    order = np.roll(mesh.biomass, 7) if what == "cells" else less_biomass(mesh)
    changes = {"loop": loop, "biomass": order} | ({"cells": flipped(mesh)} if what == "cells" else {})
    other, fresh = replace(old, **changes), again(mesh, **changes).topology
    assert differences(other, fresh) == []
    for each in ORDERS:
        assert alike(other.dofs(each), fresh.dofs(each))
    assert kept == "the old one" and other.system("a key", lambda: "a new one") == "a new one"
    assert old.system("a key", lambda: "another") == "the old one"
    there = replace(mesh, topology=other)
    assert differences(there, again(mesh, **changes)) == []


@geometries
def test_a_topology_with_another_method_orders_anew(geometry, monkeypatch):
    """Nodes are in the order of the new method, and so are systems."""
    mesh = disc(geometry)[0]
    old = touched(mesh.topology)
    faults.stand_in_package(monkeypatch, "pymetis")
    other = replace(old, method=METIS)
    fresh = again(mesh, method=METIS).topology
    for order in ORDERS:
        assert np.array_equal(other.dofs(order).elimination, fresh.dofs(order).elimination)
        assert not np.array_equal(other.dofs(order).elimination, old.dofs(order).elimination)


@orders
@geometries
def test_a_space_of_another_mesh_or_order_forgets(geometry, order):
    """Quadrature points, element matrices, places of nodes, the points of the reaction."""
    mesh = disc(geometry)[0]
    space = touched(Space(mesh, order))
    moved = mesh.moved(mesh.points * [1.1, 1.0])
    assert differences(replace(space, mesh=moved), Space(moved, order)) == []
    other = 1 + order % 3
    assert differences(replace(space, order=other), Space(mesh, other)) == []
    less = again(mesh, biomass=less_biomass(mesh), loop=np.empty(0, int))
    assert differences(replace(space, mesh=less), Space(less, order)) == []
    assert not alike(replace(space, mesh=less).reaction, space.reaction)


@pytest.mark.parametrize("kind", ORDERS.values())
def test_a_pore_with_other_places_biomass_or_material_forgets(kind):
    """Its outline, its mass, its composition, the material's places at t = 0."""
    scene = load_scene("base", ['numerics.preset="fast"', f'numerics.elements="{kind}"', "numerics.refinement=0.5"])
    now = touched(pore.seeded(scene))
    mesh, X_m = now.mesh, scene.kinetics.maximum_density
    moved = now.moved(mesh.points * [1.0, 1.02])
    assert differences(moved, remade(moved)) == [] and moved.outline.thickness > now.outline.thickness
    heavier = replace(now, active=1.5 * now.active, inert=now.inert + 1.0)
    assert heavier.mass == remade(heavier).mass > now.mass and heavier.composition(X_m) != now.composition(X_m)
    older = replace(now, body=replace(now.body, reference=0.5 * now.body.reference))
    touched(older.body)
    assert differences(older, remade(older)) == [] and not np.array_equal(older.outline.origin, now.outline.origin)
    body = pore.material(now.space, 0.5 * now.body.reference)
    assert differences(older.body, body) == [] and np.array_equal(older.origin, replace(now, body=body).origin)
    up = now.wall.copy()
    up[up.argmin()] = 2
    assert replace(now, wall=up).contact and not now.contact and (replace(now, wall=up).outline.wall == up).all()


def remade(now):
    """The same pore with every object made again from its arrays."""
    mesh = again(now.mesh)
    parts = {f.name: getattr(now, f.name) for f in fields(now)} | {"space": Space(mesh, now.space.order)}
    return Pore(**parts)


@geometries
def test_a_body_of_another_shape_forgets(geometry):
    mesh, outline = disc(geometry)
    body = body_of(mesh, outline)[0]
    shape = touched(body.shape)
    touched(body)
    cells = shape.cells[::-1].copy()
    other = replace(body, shape=replace(shape, cells=cells))
    fresh = Body(Shape(cells, shape.corners, shape.degree, shape.method), body.reference)
    assert differences(other, fresh) == []
    system, made = other.shape.unconstrained, fresh.shape.unconstrained
    assert system is not shape.unconstrained and np.array_equal(system.kinds[0], made.kinds[0])


@orders
def test_what_is_solved_on_a_replaced_mesh_is_that_of_a_fresh_one(order):
    """To the last bit, after another mesh of the same object has been solved on."""
    mesh = disc(1 if order == 1 else 2)[0]
    mesh = mesh if order == 1 else bent_inside(mesh)
    flow.unit_flow(Space(mesh, order), 100.0)
    less = replace(mesh, topology=replace(mesh.topology, biomass=less_biomass(mesh), loop=np.empty(0, int)))
    fresh = again(mesh, biomass=less_biomass(mesh), loop=np.empty(0, int))
    found, exact = (flow.unit_flow(Space(grid, order), 100.0) for grid in (less, fresh))
    assert alike(found, exact)
    body = mesh.points[less.body] * [1.02, 1.0]
    assert np.array_equal(mesh_motion.move(less, body, 1.0, 100.0), mesh_motion.move(fresh, body, 1.0, 100.0))


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


@pytest.mark.parametrize("which", [0, 1], ids=["paper", "fast"])
def test_runs_in_turns_do_not_see_each_other(which, monkeypatch):
    """Two runs of one scene but for the ordering of its linear systems, step by step in turns in one process: each is
    what it is alone, to the last bit, and the two differ in the last bits."""
    made = faults.stand_in_package(monkeypatch, "pymetis")
    pair = scenes()[which], scenes('numerics.ordering="metis"')[which]
    alone = [list(map(numbers, simulate(scene))) for scene in pair]
    called = len(made.calls)
    runs, together = [simulate(scene) for scene in pair], ([], [])
    for instants in zip(*runs):
        for found, instant in zip(together, instants, strict=True):
            found.append(numbers(instant))
    assert len(alone[0]) == len(alone[1]) == len(together[0]) >= 3
    assert alike(tuple(alone[0]), tuple(together[0])) and alike(tuple(alone[1]), tuple(together[1]))
    assert called > 0 and len(made.calls) == 2 * called, "each run orders its own systems, and no other's"
    assert not alike(alone[0][-1], alone[1][-1]), "else the order of the unknowns would not show"
    for one, other in zip(alone[0][-1][1:], alone[1][-1][1:]):
        assert np.allclose(one, other, rtol=1e-6, atol=1e-6 * np.abs(one).max())


@pytest.mark.parametrize("which", [0, 1], ids=["paper", "fast"])
@pytest.mark.parametrize("ordering, solver, package", [("metis", "superlu", "pymetis"),
                                                       ("degree", "pardiso", "pypardiso")])
def test_the_method_of_a_scene_reaches_every_system(which, ordering, solver, package, monkeypatch):
    """Of flow, substrates, mesh motion and growth, at t = 0 and on a new mesh."""
    faults.stand_in_package(monkeypatch, package)
    scene = scenes(f'numerics.ordering="{ordering}"', f'numerics.solver="{solver}"')[which]
    wanted = Method(solver, ordering)
    now = pore.seeded(scene)
    expanded = contact.expand(scene, now, 1.05 * now.theta)[0]
    assert remeshing.followed(scene, now, expanded) is not None
    then = remeshing.remesh(scene, now, expanded, 0.0)[0]
    pore.solve(scene, now)
    pore.solve(scene, then)
    for one in (now, then):
        topologies = one.mesh.topology, one.mesh.topology.straight
        systems = [system for topology in topologies for system in topology._systems.values()]
        assert {topology.method for topology in topologies} == {one.body.shape.method} == {wanted}
        assert {system.method for system in (*systems, one.body.shape.unconstrained)} == {wanted}
        assert len(systems) >= 3
    assert {system.method for system in pore.seeded(scenes()[which]).mesh.topology._systems.values()} <= {DEFAULT}
