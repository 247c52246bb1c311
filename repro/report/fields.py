"""The fields of a run as the page's script reads them: in 16 bits, connectivities told once.

Each array is base64 of little-endian integers: places over the box of all frames, values over their
own range, the largest integer where a value is not finite. Fields of the aggregate alone hold its
nodes or triangles only, ascending.
"""

from __future__ import annotations

import base64
import re
from pathlib import Path
from xml.etree import ElementTree

import meshio
import numpy as np

from repro.results import names
from repro.results.arrays import ARRAYS

MOST_FRAMES = 40
MOST_BYTES = 5_000_000  # of all frames in the page; two frames are always shown
LEVELS = 65534  # of a value; one more means that there is none
_FILE = re.compile(r"fields/fields_\d{4,}\.vtu")

#: What can be chosen, in this order.
SHOWN = """velocity_m_per_d head_cm acceptor_mg_per_L donor_mg_per_L active_biomass inert_biomass
theta J largest_principal_stress_MPa stress_xx_MPa stress_yy_MPa stress_zz_MPa stress_xy_MPa
pressure_MPa displacement_um region""".split()
#: Of the aggregate alone: what is not known in the fluid, and biomass, of which it has none.
OF_AGGREGATE = {each.name for each in ARRAYS if each.body} | {"active_biomass", "inert_biomass"}


def index(folder: Path) -> list[tuple[float, Path]]:
    """(time in h, file) of the fields that a run has written; only its own files are looked at."""
    if not (folder / "fields.pvd").exists():
        return []
    entries = ElementTree.parse(folder / "fields.pvd").getroot().iter("DataSet")
    named = [(float(entry.get("timestep", "nan")), entry.get("file", "")) for entry in entries]
    return [(time, folder / name) for time, name in named
            if _FILE.fullmatch(name) and (folder / name).is_file()]


def packed(entries: list[tuple[float, Path]]) -> dict:
    """What the script is given: the fields that there are, meshes, and frames; empty without any.
    """
    if not entries:
        return {}
    chosen = _chosen(entries)
    grids = [meshio.vtu.read(path) for _, path in chosen]
    low = np.min([grid.points.min(0) for grid in grids], 0)
    high = np.max([grid.points.max(0) for grid in grids], 0)
    meshes: dict[bytes, dict] = {}
    frames = [_frame(time, grid, low[:2], high[:2], meshes)
              for (time, _), grid in zip(chosen, grids)]
    described = [_described(name, grids[0]) for name in SHOWN if _in_any(frames, name)]
    return {"box": [low[0], high[0], low[1], high[1]], "of": len(entries), "frames": frames,
            "meshes": list(meshes.values()), "fields": described}


def _in_any(frames: list[dict], name: str) -> bool:
    """Does a frame have values of this field?"""
    return any(name in frame["values"] for frame in frames)


def _chosen(entries: list[tuple[float, Path]]) -> list[tuple[float, Path]]:
    """Evenly chosen frames, the first and last among them, as many as the page may hold.

    The last one is taken for the largest.
    """
    grid = meshio.vtu.read(entries[-1][1])
    size = 8 / 3 * (len(grid.points) * (2 + len(grid.point_data)) + grid.cells[0].data.size
                    + len(grid.cells[0].data) * len(grid.cell_data))
    count = min(len(entries), MOST_FRAMES, max(2, int(MOST_BYTES / size)))
    evenly = np.linspace(0, len(entries) - 1, count).round().astype(int)
    return [entries[k] for k in np.unique(evenly)]


def _described(name: str, grid: meshio.Mesh) -> dict:
    vector = name in grid.point_data and grid.point_data[name].ndim == 2
    words = names.words(name) + (" (magnitude)" if vector else "")
    return {"name": name, "label": words[0].upper() + words[1:], "unit": names.unit(name),
            "at": "node" if name in grid.point_data else "cell", "body": name in OF_AGGREGATE}


def _frame(time: float, grid: meshio.Mesh, low, high, meshes: dict[bytes, dict]) -> dict:
    cells = grid.cells[0].data
    region = grid.cell_data["region"][0] > 0.5
    key = cells.tobytes() + region.tobytes()
    if key not in meshes:
        meshes[key] = {"per": cells.shape[1], "cells": _text(cells, "<u4"),
                       "body": _text(region, "<u1")}
    span = np.where(high > low, high - low, 1.0)
    points = np.round((grid.points[:, :2] - low) / span * LEVELS)
    return {"time": time, "mesh": list(meshes).index(key), "points": _text(points, "<u2"),
            "values": _values(grid, region)}


def _values(grid: meshio.Mesh, region: np.ndarray) -> dict[str, list]:
    """What there is of SHOWN, of the aggregate's fields what lies in its `region` of triangles."""
    nodes = np.unique(grid.cells[0].data[region])
    cells = np.flatnonzero(region)
    found = grid.point_data | {name: value[0] for name, value in grid.cell_data.items()}
    values = {}
    for name in (name for name in SHOWN if name in found):
        value = np.linalg.norm(found[name], axis=1) if found[name].ndim == 2 else found[name]
        if name in OF_AGGREGATE:
            value = value[nodes if name in grid.point_data else cells]
        values[name] = _levels(value)
    return values


def _levels(values: np.ndarray) -> list:
    """[least, largest, base64 of the values in LEVELS steps between them]."""
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 0.0)
    steps = np.full(len(values), LEVELS + 1.0)
    if high > low:
        steps[np.isfinite(values)] = np.round((known - low) / (high - low) * LEVELS)
    else:
        steps[np.isfinite(values)] = 0.0
    return [low, high, _text(steps, "<u2")]


def _text(values: np.ndarray, kind: str) -> str:
    return base64.b64encode(values.astype(kind).tobytes()).decode("ascii")
