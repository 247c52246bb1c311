"""States of a run as plain data and arrays, and back; what makes no sense is refused."""

from __future__ import annotations

from dataclasses import astuple, replace
from typing import TypeAlias

import numpy as np

from repro.errors import CheckpointError
from repro.fem.linear import Method
from repro.fem.mesh import Mesh, triangle_areas
from repro.fem.outline import BOTTOM, FREE, TOP
from repro.fem.space import Space
from repro.march.loop import SAME_TIME, Ledger, State
from repro.march.pace import FASTER, Pace
from repro.march.stepping import FIRST, SHORTEST
from repro.model.pore import Pore, material
from repro.model.remeshing import MOST_GRADED
from repro.model.transport import Concentrations
from repro.scene import Scene, scene_hash

Shape: TypeAlias = tuple[str | int, ...]

#: {array: (kind of its numbers, shape)}; a letter is the same number wherever it stands. N nodes, T
#: triangles of G nodes, B of them biomass with Q points of growth, R pieces of reaction with P
#: points, M nodes of the boundary, n of the aggregate, C corners, D nodes of the concentrations.
ARRAYS: dict[str, tuple[str, Shape]] = {
    "points": ("f", ("N", 2)), "cells": ("i", ("T", "G")), "biomass": ("b", ("T",)),
    "loop": ("i", ("M",)), "wall": ("i", ("M",)), "fixed": ("b", ("M",)),
    "active": ("f", ("R", "P")), "inert": ("f", ("R", "P")), "theta": ("f", ("B", "Q")),
    "reference": ("f", ("n", 2)), "pressure": ("f", ("C",))}
#: No expansion, concentration, wall time (s) or other number of a state is as large.
LARGEST = 1e9
#: {order: what the mass over X_m, the area and the integral of theta may differ by}, (28)-(29).
#: With curved elements they are one number to round-off (measured 1e-11); with linear ones, where
#: theta grows by means of nodes, to 1e-4 in updates of half an hour, 1e-3 in those of four hours.
BALANCED = {1: 2e-2, 2: 1e-3, 3: 1e-3}
#: By what factor J and theta, or the density and X_m, differ in a point: measured up to 4.
APART = 100.0
GUESS: dict[str, tuple[str, Shape]] = {"acceptor": ("f", ("D",)), "donor": ("f", ("D",))}
PLAIN = {"scene", "time_h", "pace", "ends_um", "front", "guess", "ledgers", "remeshes",
         "iterations", "row_h"}


def packed(scene: Scene, state: State) -> tuple[dict, dict[str, np.ndarray]]:
    """A state as what JSON can say, and arrays."""
    now = state.pore
    guess = now.concentrations
    parts = {"points": now.mesh.points, "cells": now.mesh.cells, "biomass": now.mesh.biomass,
             "loop": now.mesh.loop, "reference": now.body.reference}
    arrays = {name: parts[name] if name in parts else getattr(now, name) for name in ARRAYS}
    if now.last is not None:
        arrays["last"] = now.last
    if guess:
        arrays |= {name: getattr(guess, name) for name in GUESS}
    plain = {"scene": scene_hash(scene), "time_h": now.time, "pace": list(astuple(state.pace)),
             "ends_um": [float(x) for x in now.mesh.ends], "front": float(now.front),
             "guess": guess.iterations if guess else None,
             "ledgers": [_numbers(ledger) for ledger in state.ledgers],
             "remeshes": int(state.remeshes), "iterations": state.iterations,
             "row_h": float(state.row)}
    return plain, arrays


def _numbers(ledger: Ledger) -> list[float]:
    """A ledger's numbers in the order of its fields, pairs one after the other."""
    return [float(value) for part in astuple(ledger) for value in np.atleast_1d(part)]


def unpacked(scene: Scene, plain: dict, arrays: dict[str, np.ndarray]) -> State:
    """The state that :func:`packed` was given. Raises CheckpointError where it is of another scene,
    or no state."""
    if set(plain) != PLAIN or plain["scene"] != scene_hash(scene):
        raise CheckpointError("it is of another scene")
    end = scene.growth.end + SAME_TIME if scene.growth else 0.0
    _refuse(not all(in_range(plain[key], 0.0, end) for key in ("time_h", "row_h")), "its time")
    _refuse(not (counted(plain["remeshes"]) and counts(plain["iterations"])), "its counts")
    _refuse(plain["guess"] is not None and not counted(plain["guess"]), "its counts")
    _refuse(not in_range(plain["front"], 1.0, MOST_GRADED), "its element sizes")
    _check(scene, plain, arrays)
    pore = _pore(scene, plain, arrays)
    return State(pore, _pace(scene, plain["pace"]), _ledgers(plain["ledgers"]), plain["remeshes"],
                 plain["iterations"], plain["row_h"])


def _refuse(wrong: bool, what: str) -> None:
    if wrong:
        raise CheckpointError(f"{what} makes no sense")


def in_range(value, low: float, high: float) -> bool:
    """Is it a finite number in [low, high], with a decimal point as every float is written?"""
    return type(value) is float and bool(np.isfinite(value)) and low <= value <= high


def counted(value) -> bool:
    """Is it a number of things?"""
    return type(value) is int and 0 <= value < 2**53


def counts(value) -> bool:
    """Does it say how many of what?"""
    return isinstance(value, dict) and all(counted(number) for number in value.values())


def _pace(scene: Scene, told) -> Pace:
    """A pace from its numbers in the order of its fields. Its length is the first one's of a
    scheme, or follows a step within the run."""
    right = isinstance(told, list) and len(told) == 3
    _refuse(not right or not all(in_range(value, 0.0, LARGEST) for value in told), "its step")
    if scene.growth:
        step = scene.growth.time_step
        longest = max(FIRST * step, FASTER * (scene.growth.end + SAME_TIME))
        _refuse(not SHORTEST * step <= told[0] <= longest, "its step")
    return Pace(*told)


def _ledgers(told) -> tuple[Ledger, ...]:
    _refuse(not isinstance(told, list), "a ledger")
    return tuple(map(_ledger, told))


def _ledger(row) -> Ledger:
    """A ledger from its numbers in the order of :func:`_numbers`."""
    right = isinstance(row, list) and len(row) == 13
    _refuse(not right or not all(in_range(value, -np.inf, np.inf) for value in row), "a ledger")
    supplied, out, consumed, stored = zip(row[2:10:2], row[3:10:2])
    return Ledger(row[0], row[1], supplied, out, consumed, stored, *row[10:])


def _check(scene: Scene, plain: dict, arrays: dict[str, np.ndarray]) -> None:
    """Kinds and shapes of all arrays, finite numbers, indices that are nodes."""
    wanted = ARRAYS
    if plain["guess"] is not None:
        wanted = {**wanted, **GUESS}
    if scene.growth and scene.growth.new_biomass == "stress_free" and plain["time_h"] > 0:
        wanted = {**wanted, "last": ARRAYS["reference"]}
    _refuse(arrays.keys() != wanted.keys(), "its list of arrays")
    sizes = {"B": int(np.count_nonzero(arrays["biomass"])), "G": 3 * scene.numerics.geometry}
    for name, (kind, shape) in wanted.items():
        array = arrays[name]
        right = array.dtype.kind == kind and _fits(array, shape, sizes)
        _refuse(not right or kind == "f" and not np.isfinite(array).all(), f"array {name!r}")
    for name in ("cells", "loop"):
        indices = arrays[name]
        right = indices.size == 0 or 0 <= indices.min() <= indices.max() < sizes["N"]
        _refuse(not right, f"array {name!r}")
    _refuse(not np.isin(arrays["wall"], (FREE, BOTTOM, TOP)).all(), "array 'wall'")
    _refuse(sizes["T"] == 0, "a mesh without triangles")
    _refuse((sizes["M"] > 0) != (scene.aggregate is not None), "its aggregate")
    _refuse((sizes["B"] > 0) != (sizes["M"] > 0), "its aggregate")
    _check_places(scene, plain["ends_um"], arrays)


def _fits(array: np.ndarray, shape: Shape, sizes: dict[str, int]) -> bool:
    """Has an array a shape of :data:`ARRAYS`? Notes the numbers that letters stand for in it."""
    if array.ndim != len(shape):
        return False
    return all(count == (sizes.setdefault(letter, count) if isinstance(letter, str) else letter)
               for letter, count in zip(shape, array.shape))


def _check_places(scene: Scene, ends, arrays: dict[str, np.ndarray]) -> None:
    """Ends within the pore, and places within it too, but for a hundredth of its width."""
    half = 0.5 * scene.pore.length * (1 + 1e-9)
    width = scene.pore.width
    slack = 0.01 * width
    right = isinstance(ends, list) and len(ends) == 2
    _refuse(not right or not all(in_range(x, -half, half) for x in ends), "its extent")
    x = arrays["points"][:, 0]
    _refuse(ends != [x.min(), x.max()], "its extent")
    for name in arrays.keys() & {"points", "reference", "last"}:
        x, y = arrays[name].T
        _refuse(bool(np.abs(x).max(initial=0.0) > half + slack), f"array {name!r}")
        _refuse(bool(y.min(initial=0.0) < -slack), f"array {name!r}")
        _refuse(bool(y.max(initial=0.0) > width + slack), f"array {name!r}")


def _pore(scene: Scene, plain: dict, arrays: dict[str, np.ndarray]) -> Pore:
    """The pore, if its nodes are in order and every triangle has an area, now and at t = 0."""
    cells = arrays["cells"]
    loop = arrays["loop"]
    numerics = scene.numerics
    if numerics.geometry == 2:
        _check_order(cells, loop)
    _refuse(not triangle_areas(arrays["points"], cells[:, :3]).min() > 0, "a triangle")
    method = Method(numerics.solver, numerics.ordering)
    first, last = plain["ends_um"]
    mesh = Mesh.of(arrays["points"], cells, arrays["biomass"], loop, scene.pore.width,
                   (first, last), method)
    space = Space(mesh, numerics.order)
    _check_sizes(space, plain, arrays)
    body = material(space, arrays["reference"])
    last = arrays.get("last")
    _refuse(arrays["theta"].shape[1] != len(body.shape.table.weights), "array 'theta'")
    if mesh.biomass.any():
        _refuse(not body.at.dx.min() > 0, "a triangle's place at t = 0")
        before = body if last is None else replace(body, reference=last)
        _refuse(not before.at.dx.min() > 0, "a triangle's place in the last shape")
    _check_walls(scene, arrays["points"][loop, 1], arrays["wall"], arrays["fixed"])
    own = {name: arrays[name] for name in ("wall", "fixed", "active", "inert", "theta", "pressure")}
    found = Pore(time=plain["time_h"], space=space, body=body, **own,
                 concentrations=_guess(plain, arrays), front=plain["front"], last=last)
    if scene.kinetics:
        _check_biomass(found, scene.kinetics.maximum_density)
    return found


def _check_walls(scene: Scene, y: np.ndarray, wall: np.ndarray, fixed: np.ndarray) -> None:
    """A node of the boundary is held on a wall if it is there to the last bit (y, um), and one node
    of each contact surface is fixed (2.3.3)."""
    there = np.where(y == 0, BOTTOM, np.where(y == scene.pore.width, TOP, FREE))
    _refuse(bool((wall != there).any()), "array 'wall'")
    held = wall[fixed].tolist()
    _refuse(sorted(held) != sorted(set(wall.tolist()) - {FREE}), "array 'fixed'")


def _check_biomass(now: Pore, density: float) -> None:
    """Mass, area and the integral of theta are of one aggregate, of maximum density (mg/L), and
    none of them is far from it in any point."""
    J = now.body.strained(now.mesh.points[now.mesh.body]).J
    part = (now.active + now.inert) / now.space.reaction.dx / density
    for ratio in (J / now.theta, part):
        _refuse(not 1 / APART <= ratio.min() <= ratio.max() <= APART, "its biomass")
    area = now.mass / density
    for other in (now.boundary.area, float((now.theta * now.body.at.dx).sum())):
        _refuse(not abs(area - other) <= BALANCED[now.space.order] * other, "its biomass")


def _check_order(cells: np.ndarray, loop: np.ndarray) -> None:
    """Corners are numbered first, and take turns with middles along the aggregate's boundary."""
    corners = int(cells[:, :3].max()) + 1
    _refuse(bool(cells[:, 3:].min() != corners) or len(loop) % 2 == 1, "its nodes' order")
    _refuse(bool((loop[::2] >= corners).any()), "its nodes' order")
    _refuse(bool((loop[1::2] < corners).any()), "its nodes' order")


def _check_sizes(space: Space, plain: dict, arrays: dict[str, np.ndarray]) -> None:
    """Refuse sizes that are not the mesh's, masses below zero, densities and expansions out of
    bounds."""
    mesh = space.mesh
    theta = arrays["theta"]
    _refuse(len(arrays["reference"]) != len(mesh.body), "its list of arrays")
    _refuse(len(arrays["pressure"]) != mesh.corners, "its list of arrays")
    _refuse(arrays["active"].shape != space.reaction.dx.shape, "its list of arrays")
    _refuse(len(theta) != np.count_nonzero(mesh.biomass), "its list of arrays")
    guessed = plain["guess"] is not None
    _refuse(guessed and len(arrays["acceptor"]) != space.count, "its concentrations")
    _refuse(len(arrays["points"]) != mesh.cells.max() + 1, "array 'points'")
    _refuse(bool(theta.min(initial=1.0) <= 0 or theta.max(initial=1.0) > LARGEST), "array 'theta'")
    _refuse(min(arrays[name].min(initial=0.0) for name in ("active", "inert")) < 0, "its biomass")
    for name in ("pressure", *(GUESS.keys() & arrays.keys())):
        _refuse(float(np.abs(arrays[name]).max()) > LARGEST, f"array {name!r}")


def _guess(plain: dict, arrays: dict[str, np.ndarray]) -> Concentrations | None:
    if plain["guess"] is None:
        return None
    return Concentrations(arrays["acceptor"], arrays["donor"], plain["guess"])
