"""Read the files of a run: fields at one time, time series, and the last step. Lengths in um, times in h."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from matplotlib.tri import Triangulation

from repro.fem.transfer import interpolate
from repro.results import field_files, read_table

#: Straight triangles drawn for a triangle with 3 or 6 nodes; a curved triangle is divided into four.
PARTS = {3: np.array([[0, 1, 2]]), 6: np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])}


@dataclass(frozen=True, eq=False)
class State:
    """Fields at one time: points (N, 2), triangles (T, 3), biomass (T,) True in the aggregate; nodes, cells:
    {name: values}."""

    time: float
    points: np.ndarray
    triangles: np.ndarray
    biomass: np.ndarray
    nodes: dict[str, np.ndarray]
    cells: dict[str, np.ndarray]

    @cached_property
    def triangulation(self) -> Triangulation:
        """Fluid and aggregate for matplotlib."""
        return Triangulation(*self.points.T, self.triangles)

    @cached_property
    def aggregate(self) -> Triangulation:
        """The aggregate for matplotlib, with the same numbering of nodes."""
        return Triangulation(*self.points.T, self.triangles[self.biomass])

    @cached_property
    def body(self) -> np.ndarray:
        """Nodes of the aggregate, including its boundary."""
        return np.unique(self.triangles[self.biomass])

    @cached_property
    def rim(self) -> np.ndarray:
        """(M, 2) boundary of the aggregate, counterclockwise."""
        return self.points[loop(self.triangles[self.biomass])]

    @property
    def ends(self) -> tuple[float, float]:
        """x of inlet and outlet of the meshed part."""
        return float(self.points[:, 0].min()), float(self.points[:, 0].max())

    @property
    def width(self) -> float:
        """Distance between the walls."""
        return float(self.points[:, 1].max())

    def at(self, name: str, points: np.ndarray) -> np.ndarray:
        """A nodal vector field, its first two components (K, 2), at points (K, 2) of the mesh."""
        return interpolate(self.points, self.triangles, self.nodes[name][:, :2], points)

    def carried(self, name: str, end: int) -> float:
        """Flow-weighted mean of a nodal field over the inlet (end 0) or the outlet (1), both linear between nodes."""
        nodes = np.flatnonzero(self.points[:, 0] == self.ends[end])
        nodes = nodes[np.argsort(self.points[nodes, 1])]
        u, field = self.nodes["velocity_m_per_d"][nodes, 0], self.nodes[name][nodes]
        step = np.diff(self.points[nodes, 1])
        products = (2 * u[1:] * field[1:] + 2 * u[:-1] * field[:-1] + u[1:] * field[:-1] + u[:-1] * field[1:]) / 6
        return float(step @ products / (step @ (u[1:] + u[:-1]) / 2))


def loop(triangles: np.ndarray) -> np.ndarray:
    """Nodes along the boundary of one simply connected patch of counterclockwise triangles (T, 3)."""
    edges = [(int(t[i]), int(t[(i + 1) % 3])) for t in triangles for i in range(3)]
    inner = set(edges)
    after = {a: b for a, b in edges if (b, a) not in inner}
    nodes = [min(after)]
    while after[nodes[-1]] != nodes[0]:
        nodes.append(after[nodes[-1]])
    return np.array(nodes)


def times(folder: Path, kind: str = "fields") -> list[tuple[float, Path]]:
    """(time, file) of the fields of a run; kind: "fields", or "before_expansion" (grown, not yet expanded)."""
    root = ElementTree.parse(folder / f"{kind}.pvd").getroot()
    return [(float(entry.get("timestep")), folder / entry.get("file")) for entry in root.iter("DataSet")]


def read(time: float, path: Path) -> State:
    """One file of fields."""
    grid = field_files.read(path)
    parts = PARTS[grid.cells.shape[1]]
    cells = {name: np.repeat(values, len(parts), axis=0) for name, values in grid.cell_data.items()}
    return State(time, grid.points[:, :2], grid.cells[:, parts].reshape(-1, 3), cells["region"] > 0.5,
                 grid.point_data, cells)


def first(folder: Path) -> State:
    """The fields at t = 0."""
    return read(*times(folder)[0])


def last(folder: Path, kind: str = "fields") -> State:
    """The fields at the end of a run."""
    return read(*times(folder, kind)[-1])


def near(folder: Path, time: float) -> State:
    """The fields at a time (h). Raises LookupError if there are none."""
    for written, path in times(folder):
        if abs(written - time) < 1e-6:
            return read(written, path)
    raise LookupError(f"{folder}: no fields at t = {time:g} h")


def every(folder: Path, hours: float) -> list[State]:
    """The fields at multiples of ``hours``, beginning with t = 0."""
    return [read(time, path) for time, path in times(folder) if abs(time / hours - round(time / hours)) < 1e-9]


def series(folder: Path) -> dict[str, np.ndarray]:
    """Columns of `timeseries.csv`; empty fields are NaN."""
    return read_table(folder / "timeseries.csv")


def status(folder: Path) -> str:
    """How a run ended."""
    return json.loads((folder / "run.json").read_text(encoding="utf-8"))["status"]


def row(folder: Path, time: float) -> dict[str, float]:
    """The row of `timeseries.csv` at a time. Raises LookupError if there is none."""
    table = series(folder)
    rows = np.flatnonzero(np.abs(table["time_h"] - time) < 1e-6)
    if len(rows) == 0:
        raise LookupError(f"{folder}: timeseries.csv has no row at t = {time:g} h")
    return {name: float(column[rows[0]]) for name, column in table.items()}


def contact(folder: Path) -> float:
    """Time (h) of the first row in contact with the opposite wall; infinite if there is none."""
    table = series(folder)
    touching = table["time_h"][table["contact"] > 0]
    return float(touching[0]) if len(touching) else float("inf")


def last_step(folder: Path) -> tuple[float, float]:
    """Start and end (h) of the last shape update. The fields before the expansion have the shape of the start."""
    table = read_table(folder / "ledger.csv")
    return float(table["start_h"][-1]), float(table["end_h"][-1])
