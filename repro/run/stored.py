"""States of a run as plain data and arrays, field by field, and back: what makes no sense is refused."""

from __future__ import annotations

from dataclasses import astuple
from typing import Any

import numpy as np

from repro.curved.mesh import CurvedMesh
from repro.curved.pore import Pore as CurvedPore
from repro.errors import CheckpointError
from repro.fem import geometry
from repro.fem.mesh import PoreMesh, triangle_areas
from repro.march.loop import Ledger, State
from repro.march.pace import Pace
from repro.model.pore import Pore
from repro.model.transport import Concentrations
from repro.scene import scene_hash

#: {array: (kind of its numbers, shape)}; a letter is the same number wherever it stands.
COMMON = {"points": ("f", "N", 2), "biomass": ("b", "T"), "loop": ("i", "M"), "wall": ("i", "M"), "fixed": ("b", "M"),
          "active": ("f", "N"), "inert": ("f", "N"), "origin": ("f", "N", 2)}
LINEAR = {**COMMON, "triangles": ("i", "T", 3), "theta": ("f", "B"), "pressure": ("f", "N")}
CURVED = {**COMMON, "cells": ("i", "T", 6), "reference": ("f", "N", 2), "pressure": ("f", "C")}
GUESS = {"acceptor": ("f", "N"), "donor": ("f", "N")}
PLAIN = {"scene", "time_h", "pace", "ends_um", "corners", "guess", "ledgers", "remeshes", "iterations"}


def packed(scene, state: State) -> tuple[dict, dict[str, np.ndarray]]:
    """A state as what JSON can say, and arrays."""
    now, guess = state.pore, state.pore.concentrations
    names = CURVED if isinstance(now, CurvedPore) else LINEAR
    arrays = {name: getattr(now if hasattr(now, name) else now.mesh, name) for name in names}
    if guess:
        arrays |= {name: getattr(guess, name) for name in GUESS}
    return {"scene": scene_hash(scene), "time_h": now.time, "pace": list(astuple(state.pace)),
            "ends_um": [float(x) for x in now.mesh.ends], "corners": getattr(now.mesh, "corners", None),
            "guess": guess.iterations if guess else None, "ledgers": [_numbers(ledger) for ledger in state.ledgers],
            "remeshes": int(state.remeshes), "iterations": state.iterations}, arrays


def _numbers(ledger: Ledger) -> list[float]:
    """A ledger's numbers in the order of its fields, pairs one after the other."""
    return [float(value) for part in astuple(ledger) for value in np.atleast_1d(part)]


def unpacked(scene, plain: dict, arrays: dict[str, np.ndarray]) -> State:
    """The state that :func:`packed` was given. Raises CheckpointError where it is none of this scene, or no state."""
    if set(plain) != PLAIN or plain["scene"] != scene_hash(scene):
        raise CheckpointError("it is of another scene")
    _refuse(not in_range(plain["time_h"], 0.0, scene.growth.end if scene.growth else 0.0), "its time")
    _refuse(not (counted(plain["remeshes"]) and counts(plain["iterations"])), "its counts")
    _refuse(plain["guess"] is not None and not counted(plain["guess"]), "its counts")
    _check(scene, plain, arrays)
    pore = (_curved if scene.numerics.curved else _linear)(scene, plain, arrays)
    _refuse_turned_over(pore)
    return State(pore, _pace(plain["pace"]), _ledgers(plain["ledgers"]), plain["remeshes"], plain["iterations"])


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


def _pace(told) -> Pace:
    """A pace from its numbers in the order of its fields."""
    right = isinstance(told, list) and len(told) == 3 and all(in_range(value, 0.0, np.inf) for value in told)
    _refuse(not right, "its step")
    return Pace(*told)


def _ledgers(told) -> tuple[Ledger, ...]:
    _refuse(not isinstance(told, list), "a ledger")
    return tuple(map(_ledger, told))


def _ledger(row) -> Ledger:
    """A ledger from its numbers in the order of :func:`_numbers`."""
    right = isinstance(row, list) and len(row) == 13 and all(in_range(value, -np.inf, np.inf) for value in row)
    _refuse(not right, "a ledger")
    pairs = dict(zip(("supplied", "out", "consumed", "stored"), zip(row[2:10:2], row[3:10:2])))
    before, made, after = row[10:]
    return Ledger(row[0], row[1], **pairs, biomass_before=before, biomass_made=made, biomass_after=after)


def _check(scene, plain: dict, arrays: dict[str, np.ndarray]) -> None:
    """Kinds and shapes of all arrays, finite numbers, indices that are nodes."""
    wanted = CURVED if scene.numerics.curved else LINEAR
    if plain["guess"] is not None:
        wanted = {**wanted, **GUESS}
    _refuse(arrays.keys() != wanted.keys(), "its list of arrays")
    sizes = {"C": plain["corners"], "B": np.count_nonzero(arrays["biomass"])}
    for name, (kind, *shape) in wanted.items():
        array = arrays[name]
        right = array.ndim == len(shape) and array.dtype.kind == kind and all(
            sizes.setdefault(letter, count) == count if isinstance(letter, str) else letter == count
            for letter, count in zip(shape, array.shape))
        _refuse(not right or kind == "f" and not np.isfinite(array).all(), f"array {name!r}")
    for name in ("triangles", "cells", "loop"):
        indices = arrays.get(name, np.zeros(1, int))
        _refuse(indices.size > 0 and not 0 <= indices.min() <= indices.max() < sizes["N"], f"array {name!r}")
    _refuse(not np.isin(arrays["wall"], (geometry.FREE, geometry.BOTTOM, geometry.TOP)).all(), "array 'wall'")
    _refuse(sizes["T"] == 0, "a mesh without triangles")
    _refuse((sizes["M"] > 0) != (scene.aggregate is not None) or (sizes["B"] > 0) != (sizes["M"] > 0), "its aggregate")
    _check_places(scene, plain["ends_um"], arrays)


def _check_places(scene, ends, arrays: dict[str, np.ndarray]) -> None:
    """Ends within the pore, and places within it too, but for a hundredth of its width."""
    half, width, slack = 0.5 * scene.pore.length * (1 + 1e-9), scene.pore.width, 0.01 * scene.pore.width
    right = isinstance(ends, list) and len(ends) == 2 and all(in_range(x, -half, half) for x in ends)
    _refuse(not right or ends[0] >= ends[1], "its extent")
    for name in arrays.keys() & {"points", "origin", "reference"}:
        x, y = arrays[name].T
        _refuse(bool(np.abs(x).max() > half + slack or y.min() < -slack or y.max() > width + slack), f"array {name!r}")


def _refuse_turned_over(pore) -> None:
    """Raises CheckpointError where a triangle has no area, at present or as it was at first."""
    grid = pore.mesh
    corners = grid.cells[:, :3] if isinstance(grid, CurvedMesh) else grid.triangles
    _refuse(not triangle_areas(grid.points, corners).min() > 0, "a triangle")
    if grid.biomass.any():
        _refuse(not triangle_areas(pore.origin, corners[grid.biomass]).min() > 0, "a triangle's place at t = 0")


def _linear(scene, plain: dict, arrays: dict[str, np.ndarray]) -> Pore:
    mesh: dict[str, Any] = {name: arrays[name] for name in ("points", "triangles", "biomass", "loop")}
    grid = PoreMesh(**mesh, width=scene.pore.width, ends=tuple(plain["ends_um"]))
    _refuse(arrays["theta"].min(initial=1.0) <= 0, "array 'theta'")
    own = {name: arrays[name] for name in LINEAR.keys() - mesh.keys()}
    return Pore(time=plain["time_h"], mesh=grid, **own, concentrations=_guess(plain, arrays))


def _curved(scene, plain: dict, arrays: dict[str, np.ndarray]) -> CurvedPore:
    corners, cells, loop = plain["corners"], arrays["cells"], arrays["loop"]
    right = counted(corners) and cells[:, :3].max() < corners <= cells[:, 3:].min() and len(loop) % 2 == 0
    _refuse(not right or bool((loop[::2] >= corners).any() or (loop[1::2] < corners).any()), "its nodes' order")
    mesh: dict[str, Any] = {name: arrays[name] for name in ("points", "cells", "biomass", "loop")}
    grid = CurvedMesh(**mesh, corners=corners, width=scene.pore.width, ends=tuple(plain["ends_um"]))
    own = {name: arrays[name] for name in CURVED.keys() - mesh.keys()}
    return CurvedPore(time=plain["time_h"], mesh=grid, **own, concentrations=_guess(plain, arrays))


def _guess(plain: dict, arrays: dict[str, np.ndarray]) -> Concentrations | None:
    return None if plain["guess"] is None else Concentrations(arrays["acceptor"], arrays["donor"], plain["guess"])
