"""State is explicit: cached values belong to the object that they derive from, and runs share nothing."""
import dataclasses
import importlib
import pkgutil
from dataclasses import fields, is_dataclass, replace
from functools import cached_property
from itertools import zip_longest

import numpy as np
import pytest
from skfem import Mesh as SkfemMesh

import repro
from repro.fem.mesh import Mesh
from repro.fem.space import Space
from tests.strategies import meshed, seed

geometries = pytest.mark.parametrize("geometry", [1, 2])


def cached_names(cls):
    """Names of the cached properties of a class."""
    return [name for name, value in vars(cls).items() if isinstance(value, cached_property)]


def alike(one, other):
    """Return whether two values agree to the last bit. Objects are compared by their fields."""
    if isinstance(one, np.ndarray):
        return np.array_equal(one, other)
    if isinstance(one, SkfemMesh):
        return np.array_equal(one.p, other.p) and np.array_equal(one.t, other.t)
    if isinstance(one, tuple):
        return all(alike(a, b) for a, b in zip_longest(one, other))
    if is_dataclass(one):
        return all(alike(getattr(one, f.name), getattr(other, f.name)) for f in fields(one) if f.init)
    return one == other


def differences(one, other):
    """Names of the cached properties in which two objects of a class differ."""
    return [name for name in cached_names(type(one)) if not alike(getattr(one, name), getattr(other, name))]


def fill_caches(owner):
    """Compute all cached properties of an object; return it."""
    for name in cached_names(type(owner)):
        getattr(owner, name)
    return owner


def disc(geometry, refinement=0.4):
    """A mesh around a half-disc, and its outline."""
    return meshed(seed(20.0, refinement, geometry), refinement=refinement)


def rebuild(mesh, **changes):
    """Make a mesh from the arrays of another, with changes."""
    parts = {"points": mesh.points, "cells": mesh.cells, "region": mesh.topology.region, "loops": mesh.topology.loops,
             "walls": mesh.walls, "ends": mesh.ends} | changes
    return Mesh.of(**parts)


@geometries
def test_a_mesh_with_other_points_has_new_caches(geometry):
    """Properties that depend on coordinates are computed anew; those of the connections alone stay."""
    mesh = fill_caches(disc(geometry)[0])
    fill_caches(mesh.topology)
    points = mesh.points * [1.1, 1.0]
    ends = tuple(1.1 * end for end in mesh.ends)
    moved, fresh = replace(mesh, points=points, ends=ends), rebuild(mesh, points=points, ends=ends)
    assert differences(moved, fresh) == [] and differences(moved.topology, fresh.topology) == []
    assert moved.area() == fresh.area() != mesh.area() and moved.topology is mesh.topology
    assert alike(moved.topology.dofs, fresh.topology.dofs)
    assert differences(Space(moved), Space(fresh)) == []
    assert mesh.moved(points).points is points


def test_states_are_immutable():
    """Objects with caches and the definitions of keys are frozen; searches are not. Objects with arrays, whose
    comparison has no single truth value, are equal only to themselves."""
    names = [module.name for module in pkgutil.walk_packages(repro.__path__, "repro.") if "__main__" not in module.name]
    every = {each for name in names for each in vars(importlib.import_module(name)).values()
             if "__dataclass_params__" in getattr(each, "__dict__", ()) and each.__module__.startswith("repro.")}
    searches = {"Line", "History", "_Rounds", "Closing", "ByNodes", "ByLines", "Front", "Notch", "WallLine",
                "Welding"}
    assert {each.__name__ for each in every if not each.__dataclass_params__.frozen} <= searches
    assert len(every) > 50
    compared = [part for each in every if each.__dataclass_params__.eq for part in dataclasses.fields(each)]
    assert not [part for part in compared if "ndarray" in str(part.type)]
