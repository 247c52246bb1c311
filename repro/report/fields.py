"""The fields of a run for the script of its page: 16 bits a value, and each mesh once.

Each array is base64 of little-endian integers: coordinates over the box of all frames, values over
their own range, the largest integer for a value that is not finite. Fields of the aggregate have
only its nodes or triangles, in ascending order.
"""

import base64
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from skfem import MeshTri

from repro.errors import OutputError
from repro.fem.transfer import located
from repro.results import field_files, names
from repro.results.arrays import ARRAYS
from repro.results.drawing import magnitude
from repro.results.field_files import Grid
from repro.results.files import MOST_TABLE, read

MOST_FRAMES = 40
MOST_BYTES = 2_600_000  # of all frames and charts in the page; two frames are always shown
MOST_NODES = 10_000  # of a frame; a finer mesh is shown on a regular grid of so many points
LEVELS = 65534  # of a value; one more for no value
#: The fields that a reader can choose, in this order.
FIELDS = """velocity_m_per_d head_cm acceptor_mg_per_L donor_mg_per_L active_biomass inert_biomass
theta J largest_principal_stress_MPa stress_xx_MPa stress_yy_MPa stress_zz_MPa stress_xy_MPa
pressure_MPa displacement_um region""".split()
#: Fields only of the aggregate: those undefined in the fluid, and biomass, which is zero there.
OF_AGGREGATE = {each.name for each in ARRAYS if each.body} | {"active_biomass", "inert_biomass"}


def index(folder: Path, name: str = "fields.pvd") -> list[tuple[float, Path]]:
    """(time in h, file) of the existing fields of a run. The list before_expansion.pvd has those
    before each expansion."""
    return [(time, path) for time, path in listed_files(folder, name) if path.is_file()]


def listed_files(folder: Path, name: str = "fields.pvd") -> list[tuple[float, Path]]:
    """(time in h, file) of all listed fields, existing or not; only names that a
    run uses. Raises OutputError if the list cannot be read."""
    if not (folder / name).exists():
        return []
    try:
        entries = ElementTree.fromstring(read(folder / name, MOST_TABLE)).iter("DataSet")
    except (OSError, ElementTree.ParseError) as error:
        raise OutputError(f"{folder / name}: it cannot be read: {error}") from error
    named = [(float(entry.get("timestep", "nan")), entry.get("file", "")) for entry in entries]
    return [(time, folder / name) for time, name in named if field_files.NAME.fullmatch(name)]


def packed(entries: list[tuple[float, Path]],
           before: list[tuple[float, Path]] | None = None, spent: int = 0) -> dict:
    """The data for the script: fields, meshes and frames; empty without entries.

    before: entries of the same times before the aggregate expands, each placed ahead of its time;
    spent: bytes of MOST_BYTES that the rest of the page takes.
    """
    if not entries:
        return {}
    last = field_files.read(entries[-1][1])
    chosen = _chosen(entries, dict(before or []), _as_drawn(last), MOST_BYTES - spent)
    grids = [_as_drawn(field_files.read(path)) for _, path, _ in chosen]
    arrays = [grid.point_data | grid.cell_data for grid in grids]
    units = {name: names.readable_unit(name, [each[name] for each in arrays if name in each])
             for name in FIELDS if any(name in each for each in arrays)}
    low = np.min([grid.points.min(0) for grid in grids], 0)
    high = np.max([grid.points.max(0) for grid in grids], 0)
    meshes: dict[bytes, dict] = {}
    frames = [_frame(time, grid, low[:2], high[:2], meshes, units)
              | ({"note": note} if note else {}) for (time, _, note), grid in zip(chosen, grids)]
    described = []
    for name, (unit, _) in units.items():
        at_nodes = grids[0].point_data.get(name)
        vector = at_nodes is not None and at_nodes.ndim == 2
        words = names.words(name) + " (magnitude)" * vector
        described.append({"name": name, "label": words[0].upper() + words[1:], "unit": unit,
                          "at": "cell" if at_nodes is None else "node",
                          "body": name in OF_AGGREGATE})
    return {"box": [low[0], high[0], low[1], high[1]], "of": len(entries), "frames": frames,
            "nodes": len(last.points), "meshes": list(meshes.values()), "fields": described}


def _chosen(entries: list[tuple[float, Path]], before: dict[float, Path], grid: Grid,
            most: int) -> list[tuple[float, Path, str]]:
    """(time, file, note) of evenly chosen frames, with the first and the last, up to a limit.

    Frames before an expansion are included if all of them fit. grid: the last one, assumed to be
    the largest; most: limit on the bytes of all frames.
    """
    size = 8 / 3 * (len(grid.points) * (2 + len(grid.point_data)) + 2 * grid.cells.size
                    + len(grid.cells) * len(grid.cell_data))
    room = int(most / size)
    count = min(len(entries), MOST_FRAMES, max(2, room))
    evenly = np.linspace(0, len(entries) - 1, count).round().astype(int)
    frames: list[tuple[float, Path, str]] = []
    for time, path in (entries[k] for k in np.unique(evenly)):
        if time in before and 2 * count <= room:
            frames.append((time, before[time], "before the expansion"))  # Plate 1
        frames.append((time, path, ""))
    return frames


def _as_drawn(grid: Grid) -> Grid:
    """The fields for display; those of a fine mesh on a regular grid of triangles."""
    if len(grid.points) <= MOST_NODES:
        return grid
    points = grid.points[:, :2]
    cells = grid.cells
    grid_points, triangles = _regular(points.min(axis=0), points.max(axis=0))
    at = located(points, cells, grid_points)
    nodal = {name: at.field(value, cells) for name, value in grid.point_data.items()}
    inside = located(points, cells, grid_points[triangles].mean(axis=1)).triangle
    values = {name: value[inside] for name, value in grid.cell_data.items()}
    points = np.column_stack([grid_points, np.zeros(len(grid_points))])
    return Grid(points, triangles, nodal, values)


def _regular(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n, 2) points of a regular grid over a box, and (t, 3) its triangles."""
    counts = np.maximum(2, (high - low) / np.sqrt(np.prod(high - low) / MOST_NODES)).astype(int)
    mesh = MeshTri.init_tensor(*map(np.linspace, low, high, counts))
    return mesh.p.T, mesh.t.T


def _frame(time: float, grid: Grid, low, high, meshes: dict[bytes, dict],
           units: dict[str, tuple[str, float]]) -> dict:
    cells = grid.cells
    region = grid.cell_data["region"] > 0.5
    key = cells.tobytes() + region.tobytes()
    if key not in meshes:
        meshes[key] = {"per": cells.shape[1], "cells": _text(cells, "<u4"),
                       "body": _text(region, "<u1")}
    span = np.where(high > low, high - low, 1.0)
    points = np.round((grid.points[:, :2] - low) / span * LEVELS)
    return {"time": time, "mesh": list(meshes).index(key), "points": _text(points, "<u2"),
            "values": _values(grid, region, units)}


def _values(grid: Grid, region: np.ndarray,
            units: dict[str, tuple[str, float]]) -> dict[str, list]:
    """The values of fields in their units; fields of the aggregate only in its triangles
    (`region`)."""
    nodes = np.unique(grid.cells[region])
    cells = np.flatnonzero(region)
    arrays = grid.point_data | grid.cell_data
    values = {}
    for name in (name for name in units if name in arrays):
        value = magnitude(arrays[name])
        if name in OF_AGGREGATE:
            value = value[nodes if name in grid.point_data else cells]
        values[name] = _levels(units[name][1] * value)
    return values


def _levels(values: np.ndarray) -> list:
    """[least, largest, base64 of the values in LEVELS steps between them]."""
    is_finite = np.isfinite(values)
    finite = values[is_finite] if is_finite.any() else np.zeros(1)
    low, high = float(finite.min()), float(finite.max())
    steps = np.full(len(values), LEVELS + 1.0)
    steps[is_finite] = np.round((values[is_finite] - low) / (high - low or 1.0) * LEVELS)
    return [low, high, _text(steps, "<u2")]


def _text(values: np.ndarray, kind: str) -> str:
    return base64.b64encode(values.astype(kind).tobytes()).decode("ascii")
