"""Judge a run by the files in its folder and by its scene, a dict of TOML tables.

The module shares nothing with the code that writes the files. It repeats units, defaults of Table 1, quadrature and
formulas of the balances; `tests/test_derived.py` derives the columns themselves. Each check is a :class:`Finding`: a
number, its range, and the origin of the range. The elements are curved quadratic triangles (``triangle6``) with
quadratic velocities and concentrations. Straight triangles (``triangle``) get nodes at the midpoints of their sides.
Lengths are in um, times in h, concentrations in mg/L, amounts per depth in pg/m = um2 mg/L.
"""

import csv
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from math import inf
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import meshio
import numpy as np
from skfem import ElementTriP2
from skfem.quadrature import get_quadrature

UNITS = {"um": 1.0, "cm": 1e4, "h": 1.0, "min": 1 / 60, "mg/L": 1.0, "1/day": 1 / 24, "m/day": 1e6 / 24,
         "cm^2/day": 1e8 / 24, "cm^2/s": 3.6e11, "m/s^2": 3600**2 * 1e6, "m^2": 1e12, "deg": np.pi / 180, "MPa": 1.0}
#: Defaults of the scene's keys: the values of the paper's Table 1.
TABLE_1 = {
    "pore": {"width": "100 um", "length": "600 um"},
    "flow": {"kinematic_viscosity": "0.01003 cm^2/s", "gravity": "9.81 m/s^2", "viscosity_ratio": 2000.0},
    "acceptor": {"supply": "10 mg/L", "half_saturation": "1 mg/L", "diffusivity": "2.32 cm^2/day"},
    "donor": {"supply": "10 mg/L", "half_saturation": "1 mg/L", "diffusivity": "1.01 cm^2/day",
              "inhibition_constant": "100 mg/L"},
    "kinetics": {"maximum_utilization_rate": "9.3 1/day", "yield_coefficient": 0.61, "decay_coefficient": "0.12 1/day",
                 "degradable_fraction": 0.8, "decay_oxygen_demand": 1.42, "acceptor_to_donor_ratio": 1.52,
                 "maximum_density": "30000 mg/L"},
}
NAMES = ("acceptor", "donor")
#: A half saturation, over that of the scene, for which Monod's law is nearly of zero order. It serves for bounds of m
#: alone: the uptake of so steep a law is not compared (STEP).
ZERO_ORDER = 1e-5

#: Round-off of sums over about 1e4 nodes or points.
SUM = 1e-11
#: Error of an amount conserved by Newton's method or a linear solver: 1e-12 of the terms of each of 1e3 to 1e4 rows.
SOLVED = 1e-8
#: docs/design.md: a concentration may leave the range from zero to its supply by these fractions of the supply.
UNDERSHOOT, OVERSHOOT = 1e-3, 0.02
#: docs/design.md: largest difference between two quadratures of the uptake. The fields give the biomass at nodes, as
#: the mean over the adjacent triangles; the same bound is assumed for its error.
UPTAKE = 0.05 + 0.05
#: With a half saturation below this fraction of the supply, the uptake is nearly a step function. Rules with 4, 8 and
#: 16 points a side disagree, so that this bound does not apply.
STEP = 0.01
#: Difference of two quadratures of gradients, rational functions on curved triangles: a tenth of the error of ``fast``.
QUADRATURE = 1e-3
#: Straight triangles have linear velocities, whose stabilisation dissipates work: the measured error of the head loss
#: is 1 to 4 %. Their biomass is nodal, and a remesh leaves an error of the area that the next update reduces. Both
#: bounds are those of the hard cases with linear elements.
STRAIGHT_LOSS, STRAIGHT_AREA = 0.04, 1e-4
#: README.md: errors of the presets fast and accurate.
PROMISED = 0.01 + 0.001


class Finding(NamedTuple):
    """A number that must lie between ``low`` and ``high``; ``origin`` is the origin of this range."""

    quantity: str
    value: float
    low: float
    high: float
    origin: str

    @property
    def holds(self) -> bool:
        """Whether the number is in its range, which may include infinity. NaN is in no range."""
        return bool(self.low <= self.value <= self.high)


def size(quantity: str, values, bound: float, origin: str) -> Finding:
    """Check that no absolute value exceeds ``bound``."""
    largest = np.max(np.abs(values), initial=0.0)
    return Finding(quantity, float(largest), 0.0, bound, origin)


def excess(quantity: str, values, low, high, origin: str) -> Finding:
    """Check that each value lies within its own bounds, which include the tolerance."""
    outside = np.maximum(np.subtract(low, values), np.subtract(values, high))
    return Finding(f"{quantity}, beyond its bounds", float(np.max(outside, initial=-inf)), -inf, 0.0, origin)


def number(text) -> float:
    """Convert a plain number, or a number with its unit."""
    if isinstance(text, str):
        value, _, unit = text.partition(" ")
        return float(value) * UNITS[unit]
    return float(text)


class TimeCourse:
    """A quantity over time (h): a constant, or a table of times and values. A value applies from its time on, unless
    the table names what is between them."""

    def __init__(self, entry):
        self.linear = isinstance(entry, dict) and entry["between"] == "linear"
        table = entry["table"] if isinstance(entry, dict) else entry if isinstance(entry, list) else [["0 h", entry]]
        self.times, self.values = np.array([[number(part) for part in pair] for pair in table]).T

    def at(self, time: float) -> float:
        """The value at a time; at a jump, the value after it."""
        if self.linear:
            return float(np.interp(time, self.times, self.values))
        return float(self.values[np.searchsorted(self.times, time + 1e-9, side="right") - 1])

    def largest(self, time: float) -> float:
        """The largest value up to and including a time."""
        return max(*self.values[self.times <= time + 1e-9], self.at(time))


@dataclass(frozen=True)
class Scene:
    """The numbers of a scene's tables."""

    tables: dict

    def number(self, section: str, key: str) -> float:
        """A number of a section, by default that of Table 1."""
        return number(self.section(section).get(key, TABLE_1[section].get(key)))

    def section(self, name: str) -> dict:
        """A section, or a substrate; empty if the scene omits it."""
        if name in NAMES:
            return self.tables["substrates"].get(name, {})
        return self.tables.get(name, {})

    def course(self, section: str, key: str) -> TimeCourse:
        """A quantity, which may be a table over time."""
        return TimeCourse(self.section(section).get(key, TABLE_1[section].get(key)))

    @property
    def width(self) -> float:
        """Width of the pore, um."""
        return self.number("pore", "width")

    @property
    def length(self) -> float:
        """Length of the pore, um."""
        return self.number("pore", "length")

    @property
    def names(self) -> tuple[str, ...]:
        """The substrates of the scene: both if it has the table of neither."""
        return tuple(name for name in NAMES if name in self.tables["substrates"]) or NAMES

    @property
    def law(self) -> str:
        """The law of uptake."""
        return self.section("kinetics").get("law", "dual Monod")

    def half_saturation(self, name: str) -> float:
        """K of the law of a substrate, mg/L."""
        return self.number(name, "half_saturation") * (ZERO_ORDER if self.law == "zero order" else 1.0)

    def fraction(self, name: str, concentration) -> np.ndarray:
        """m of concentrations (mg/L) that are not negative; one for a substrate that the scene leaves out."""
        if name not in self.names:
            return np.ones_like(concentration)
        half = self.half_saturation(name)
        if self.law == "first order":
            return concentration / half
        inhibited = self.law == "Haldane" and name == "donor"
        square = concentration**2 / self.number(name, "inhibition_constant") if inhibited else 0.0
        return concentration / (half + concentration + square)

    def largest_fraction(self, name: str, concentration: float) -> float:
        """The largest m up to a concentration, mg/L."""
        if self.law == "Haldane" and name == "donor":
            peak = np.sqrt(self.half_saturation(name) * self.number(name, "inhibition_constant"))
            concentration = min(concentration, peak)
        return float(self.fraction(name, concentration))

    @property
    def unlimited_decay(self) -> bool:
        """Whether biomass decays also without acceptor."""
        return self.section("kinetics").get("decay") == "unlimited"

    @property
    def may_leave(self) -> bool:
        """Whether aggregates may leave the pore."""
        return self.section("growth").get("after_detachment") == "continue"

    @property
    def aggregates(self) -> int:
        """Number of aggregates at t = 0."""
        seeds = self.tables["aggregate"]
        return len(seeds) if isinstance(seeds, list) else 1

    @property
    def flows(self) -> bool:
        """Whether the scene has a flow."""
        return "flow" in self.tables

    @property
    def viscosity_ratio(self) -> float | None:
        """Viscosity ratio of the aggregate; None if it is permeable."""
        permeable = "permeability" in self.section("flow")
        return None if permeable else self.number("flow", "viscosity_ratio")

    @property
    def stores(self) -> bool:
        """Whether substrates are transient."""
        return self.section("numerics").get("transport") == "gear"

    @property
    def midpoint(self) -> bool:
        """Whether the steps are those of the midpoint rule."""
        numerics = self.section("numerics")
        of_preset = "updates" if numerics.get("preset") in ("paper", "as_printed") else "midpoint"
        return numerics.get("time", of_preset) == "midpoint"

    @property
    def closed(self) -> bool:
        """Whether the ends of the pore are closed to substrates."""
        return self.tables["substrates"].get("boundary") == "closed"

    @property
    def end(self) -> float:
        """End of the growth, h."""
        return number(self.tables["growth"]["end"])


POINTS, WEIGHTS = get_quadrature(ElementTriP2, 8)
_FUNCTIONS = [ElementTriP2().lbasis(POINTS, number) for number in range(6)]
#: Quadratic functions (q, 6) at the points of the quadrature, corners and then midpoints of sides as in VTK, and their
#: derivatives (q, 6, 2) by the coordinates of the unit triangle.
SHAPES = np.stack([values for values, _ in _FUNCTIONS], axis=1)
SHAPE_GRADIENTS = np.stack([gradients.T for _, gradients in _FUNCTIONS], axis=1)
LINE, LINE_WEIGHTS = np.polynomial.legendre.leggauss(4)
ALONG = np.stack([LINE * (LINE - 1) / 2, LINE * (LINE + 1) / 2, 1 - LINE**2], axis=1)
SIDES = ((0, 1, 3), (1, 2, 4), (2, 0, 5))


def _with_middles(mesh: meshio.Mesh) -> meshio.Mesh:
    """Add nodes at the midpoints of straight triangles' sides; a field is the mean of its values at the side's ends."""
    triangles = mesh.cells_dict["triangle"]
    sides = np.sort([triangles[:, side[:2]] for side in SIDES], axis=2)
    ends, place = np.unique(sides.reshape(-1, 2), axis=0, return_inverse=True)
    cells = np.column_stack([triangles, len(mesh.points) + place.reshape(3, -1).T])
    points, *fields = (np.concatenate([values, values[ends].mean(axis=1)])
                       for values in (mesh.points, *mesh.point_data.values()))
    return meshio.Mesh(points, {"triangle6": cells}, dict(zip(mesh.point_data, fields)))


class Fields:
    """One ``.vtu`` file."""

    def __init__(self, path: Path):
        mesh = meshio.read(path)
        self.time = float(mesh.field_data["TimeValue"][0])
        self.straight = "triangle" in mesh.cells_dict
        complete = _with_middles(mesh) if self.straight else mesh
        self.points = complete.points[:, :2]
        self.cells = complete.cells_dict["triangle6"]
        self.at_nodes = complete.point_data
        self.in_cells = {name: values[0] for name, values in mesh.cell_data.items()}

    @property
    def present(self) -> int:
        """Number of aggregates."""
        return len(np.unique(self.in_cells["region"][self.body]))

    @cached_property
    def body(self) -> np.ndarray:
        """Whether each triangle belongs to an aggregate, (T,); the region is its number."""
        return self.in_cells["region"] > 0

    @cached_property
    def dx(self) -> np.ndarray:
        """Weights (T, q) of the quadrature points, um2."""
        return self.weights(self.points)

    def weights(self, points: np.ndarray) -> np.ndarray:
        """Weights (T, q) of the quadrature points for given coordinates (N, 2) of the nodes, um2."""
        jacobian = np.einsum("tni,qnj->tqij", points[self.cells], SHAPE_GRADIENTS)
        return np.linalg.det(jacobian) * WEIGHTS

    def gradients(self, values: np.ndarray) -> np.ndarray:
        """Gradients (T, q, c, 2) of nodal values (N, c) at the quadrature points."""
        jacobian = np.einsum("tni,qnj->tqij", self.points[self.cells], SHAPE_GRADIENTS)
        gradients = np.einsum("qnj,tqji->tqni", SHAPE_GRADIENTS, np.linalg.inv(jacobian))
        return np.einsum("tnc,tqni->tqci", values[self.cells], gradients)

    @cached_property
    def areas(self) -> np.ndarray:
        """Areas of the triangles (T,), um2."""
        return self.dx.sum(axis=1)

    def inside(self, name: str) -> np.ndarray:
        """A nodal field at the quadrature points of the aggregate's triangles, (B, q)."""
        return self.at_nodes[name][self.cells[self.body]] @ SHAPES.T

    def wall(self, y: float) -> np.ndarray:
        """Nodes on a wall, to round-off."""
        places = self.points[:, 1]
        return np.flatnonzero(np.abs(places - y) <= SUM * places.max())

    def end(self, outlet: bool) -> tuple[np.ndarray, np.ndarray]:
        """Sides (E, 3) at an end of the mesh, corners first, and their lengths (E,), um."""
        x = self.points[:, 0]
        at = x == (x.max() if outlet else x.min())
        sides = np.concatenate([self.cells[:, side] for side in SIDES])
        sides = sides[at[sides].all(axis=1)]
        return sides, np.abs(np.diff(self.points[sides[:, :2], 1], axis=1))[:, 0]

    def over_end(self, outlet: bool, *factors: np.ndarray) -> float:
        """Integral of the product of nodal fields (N,) over an end of the mesh."""
        sides, lengths = self.end(outlet)
        product = np.prod([factor[sides] @ ALONG.T for factor in factors], axis=0)
        return float((product @ LINE_WEIGHTS) @ lengths / 2)


def _read_table(path: Path) -> dict[str, np.ndarray]:
    """Read {column: values}. A column without any value is omitted; a single missing value is NaN."""
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    columns = {name: [row[name] for row in rows] for name in (rows[0] if rows else ())}
    return {name: np.array([float(text or "nan") for text in texts])
            for name, texts in columns.items() if any(texts)}


class Run:
    """The files of a run, and its scene."""

    def __init__(self, folder: Path, tables: dict):
        self.scene = Scene(tables)
        self.record = json.loads((folder / "run.json").read_text())
        self.series = _read_table(folder / "timeseries.csv")
        self.ledger = _read_table(folder / "ledger.csv") if (folder / "ledger.csv").is_file() else {}
        self.files = [folder / entry.get("file") for entry in ElementTree.parse(folder / "fields.pvd").iter("DataSet")]

    @cached_property
    def fields(self) -> list[Fields]:
        """The fields of each row."""
        return [Fields(path) for path in self.files]

    @property
    def times(self) -> np.ndarray:
        """Times of the rows (rows,), h."""
        return self.series["time_h"]

    @property
    def departures(self) -> list[float]:
        """Times (h) of the rows with fewer aggregates than the row before."""
        present = [fields.present for fields in self.fields]
        return [fields.time for fields, now, before in zip(self.fields[1:], present[1:], present) if now < before]

    @property
    def completed(self) -> bool:
        """Whether the run has reached growth.end."""
        return self.record["status"] == "completed"

    @cached_property
    def duration(self) -> np.ndarray:
        """Durations of the steps (steps,), h."""
        return self.ledger["end_h"] - self.ledger["start_h"]

    def at_ledger(self) -> tuple[np.ndarray, np.ndarray]:
        """Indices of the rows at which a step ends with biomass in the pore, and of these steps."""
        distances = np.abs(np.subtract.outer(self.times, self.ledger.get("end_h", np.zeros(0))))
        return np.nonzero((distances <= 1e-9) & (self.ledger.get("biomass_after_pg_per_m", np.zeros(0)) > 0))


def findings(run: Run) -> Iterator[Finding]:
    """Yield all checks of one run."""
    yield from _numbers(run)
    yield from _absent(run)
    yield from _rows(run)
    for index, fields in enumerate(run.fields):
        row = {name: values[index] for name, values in run.series.items()}
        for check in (_geometry, _flow, _concentrations, _uptake, _deformation):
            yield from (finding._replace(quantity=f"{finding.quantity}, t = {fields.time:.4g} h")
                        for finding in check(run.scene, row, fields))
    if run.ledger:
        yield from _steps(run)
        yield from _substrates(run)
        yield from _growth(run)


#: First words of the columns that stay if aggregates leave the pore.
OF_PORE = ("time", "mean_velocity", "head_loss", "conductivity", "effluent", "inlet", "meshed_length")


def _numbers(run: Run) -> Iterator[Finding]:
    """Check that all numbers are finite. An aggregate that has left the pore has empty columns."""
    series = {name: values for name, values in run.series.items()
              if not run.scene.may_leave or name.startswith(OF_PORE)}
    tables = [*series.values(), *run.ledger.values()]
    missing = sum(np.count_nonzero(~np.isfinite(values)) for values in tables)
    for fields in run.fields:
        nodes = np.unique(fields.cells[fields.body])
        aggregate = [values[nodes] for values in fields.at_nodes.values()]
        fluid = [fields.at_nodes[name] for name in ("velocity_m_per_d", "head_cm", "acceptor_mg_per_L",
                                                    "donor_mg_per_L") if name in fields.at_nodes]
        cells = [values[_defined_in(fields, name)] for name, values in fields.in_cells.items()]
        missing += sum(np.count_nonzero(~np.isfinite(values)) for values in (*aggregate, *fluid, *cells))
    yield size("numbers that are not finite", missing, 0, "all numbers are finite")


def _absent(run: Run) -> Iterator[Finding]:
    """Check that a substrate that the scene leaves out has no values."""
    tables = [*run.series, *run.ledger, *(name for fields in run.fields for name in fields.at_nodes)]
    for name in NAMES:
        if name not in run.scene.names:
            yield size(f"columns and fields of {name}, which the scene leaves out",
                       sum(name in column for column in tables), 0, "its columns are empty")


def _defined_in(fields: Fields, name: str) -> np.ndarray:
    """Triangles in which a field is defined: the aggregate or, for the surface stretch, its triangles at the fluid."""
    if name != "surface_stretch":
        return fields.body
    middles = fields.cells[:, 3:]
    return fields.body & np.isin(middles, middles[~fields.body]).any(axis=1)


def _rows(run: Run) -> Iterator[Finding]:
    """Check that rows and fields are at the requested times, and cover the run."""
    times = run.times
    yield size("rows that are not later than the row before", np.count_nonzero(np.diff(times) <= 0), 0, "time passes")
    yield size("rows without fields of their time", _unmatched(times, [f.time for f in run.fields]), 0, "one a row")
    requested = run.scene.section("output").get("times")
    if requested and run.completed:
        expected = {0.0, *map(number, requested), *(run.departures if run.scene.may_leave else ())}
        yield size("requested rows that are missing, and rows that were not requested", _unmatched(times, expected), 0,
                   "output.times, the start, and the time just after an aggregate has left")
    elif run.completed:
        yield size("time between the last row and the end", times[-1] - run.scene.end, 1e-9, "growth.end")
    if run.scene.end and (run.completed or run.ledger):
        covered = run.ledger["end_h"][-1] if run.ledger else 0.0
        last = run.scene.end if run.completed else times[-1]
        yield excess("end of the ledger, h", covered, last - 1e-9, run.scene.end + 1e-9, "every step is in the ledger")


def _unmatched(times, other_times) -> int:
    """Number of times in two lists without an equal time in the other list."""
    equal = np.abs(np.subtract.outer(list(times), list(other_times))) <= 1e-9
    return np.count_nonzero(~equal.any(axis=1)) + np.count_nonzero(~equal.any(axis=0))


def _geometry(scene: Scene, row: dict, fields: Fields) -> Iterator[Finding]:
    width, length = scene.width, scene.length
    x, y = fields.points.T
    yield size("area of the mesh over meshed length times width, less one",
               fields.areas.sum() / (row["meshed_length_um"] * width) - 1, SUM, "triangles fill the meshed part")
    half, top = (1 + SUM) * length / 2, (1 + SUM) * width
    yield excess("nodes", [x.min(), x.max(), y.min(), y.max()], [-half, -inf, 0, -inf], [inf, half, inf, top],
                 "the pore")
    yield size("triangles that are turned over", np.count_nonzero(fields.dx.min(axis=1) <= 0), 0,
               "all triangles are upright")


def _flow(scene: Scene, row: dict, fields: Fields) -> Iterator[Finding]:
    if not scene.flows:
        return
    width, length = scene.width, scene.length
    speed = row["mean_velocity_m_per_d"]
    drive = "head" if "head" in scene.section("flow") else "mean_velocity"
    column, unit = ("head_loss_cm", "cm") if drive == "head" else ("mean_velocity_m_per_d", "m/day")
    driven = scene.course("flow", drive).at(row["time_h"]) / UNITS[unit]
    yield size(f"{column} over that of the scene, less one", row[column] / driven - 1, SUM, "the scene's own")
    velocity = fields.at_nodes["velocity_m_per_d"]
    walls = np.concatenate([fields.wall(0.0), fields.wall(width)])
    in_fluid = walls[np.isin(walls, fields.cells[~fields.body])]
    no_slip = walls if scene.viscosity_ratio else in_fluid
    yield size("velocity at the walls over the mean", velocity[no_slip] / speed, SUM,
               "(5): no slip; water may slide under a permeable body whose layers are thin")
    yield size("velocity through the walls over the mean", velocity[walls, 1] / speed, SUM, "no flow through walls")
    for name, outlet, bound in (("inlet", False, SUM), ("outlet", True, SOLVED)):
        through = fields.over_end(outlet, velocity[:, 0]) / (speed * width)
        yield size(f"flow through the {name} over u_ave W, less one", through - 1, bound, "(2): water is conserved")
    viscosity = scene.number("flow", "kinematic_viscosity") / scene.number("flow", "gravity")
    clean = width**2 / (12 * viscosity) / UNITS["m/day"]
    outside = (length - row["meshed_length_um"]) * speed / clean / UNITS["cm"]
    head = fields.at_nodes["head_cm"]
    inside = (fields.over_end(False, head) - fields.over_end(True, head)) / width
    yield size("mean head at inlet less outlet and the loss outside, over the head loss, less one",
               (inside + outside) / row["head_loss_cm"] - 1, PROMISED, "(6); the preset's error")
    if scene.viscosity_ratio:
        bound = STRAIGHT_LOSS if fields.straight else QUADRATURE
        spent = viscosity * _dissipation(scene, fields) / (speed * UNITS["m/day"] * width) / UNITS["cm"]
        yield size("dissipation in the mesh and the loss outside, over the head loss, less one",
                   (spent + outside) / row["head_loss_cm"] - 1, bound, "viscosity dissipates the work of the head")
    if scene.viscosity_ratio is None or scene.viscosity_ratio >= 1:
        yield excess("conductivity over that of the clean pore", row["conductivity_m_per_d"] / clean, 0.0,
                     1 + PROMISED, "Stokes flow has the least dissipation; the preset's error")


def _dissipation(scene: Scene, fields: Fields) -> float:
    """Integral of nu_r grad u : grad u or, for traction, of nu_r grad u : (grad u + grad u^T), um2/h2."""
    velocity = fields.at_nodes["velocity_m_per_d"][:, :2] * UNITS["m/day"]
    gradient = fields.gradients(velocity)
    square = np.sum(gradient**2, axis=(2, 3))
    if scene.section("numerics").get("interface") == "traction":
        square += np.einsum("tqij,tqji->tq", gradient, gradient)
    return float(np.sum(square * fields.dx, axis=1) @ np.where(fields.body, scene.viscosity_ratio, 1.0))


def _concentrations(scene: Scene, row: dict, fields: Fields) -> Iterator[Finding]:
    for name in scene.names:
        values = fields.at_nodes[f"{name}_mg_per_L"]
        course = scene.course(name, "supply")
        supply = course.largest(row["time_h"]) if scene.stores else course.at(row["time_h"])
        yield excess(f"{name} in the fields, mg/L", values, -UNDERSHOOT * supply, (1 + OVERSHOOT) * supply,
                     "the maximum principle; docs/design.md")
        for end, outlet in (("inlet", False), ("effluent", True)):
            weights = [fields.at_nodes["velocity_m_per_d"][:, 0]] if scene.flows else []
            ones = np.ones(len(values))
            mean = fields.over_end(outlet, values, *weights) / fields.over_end(outlet, ones, *weights)
            yield size(f"{end} {name} of the fields less that of the row, over the supply",
                       (mean - row[f"{end}_{name}_mg_per_L"]) / max(supply, 1e-300), SUM, "(12), flux-averaged")


def _rates(scene: Scene, fields: Fields) -> tuple[float, float, float]:
    """Uptake of acceptor and donor, and the acceptor consumed by decay, (7) and (8), um2 mg/L/h.

    Unlimited decay consumes the same acceptor: the rest of its demand is unmet."""
    k, b = scene.number("kinetics", "maximum_utilization_rate"), scene.number("kinetics", "decay_coefficient")
    of_decay = b * scene.number("kinetics", "degradable_fraction") * scene.number("kinetics", "decay_oxygen_demand")
    m_a, m_d = (_fractions(scene, fields, name) for name in NAMES)
    active = fields.inside("active_biomass") * scene.number("kinetics", "maximum_density") * fields.dx[fields.body]
    donor = k * float(np.sum(active * m_a * m_d))
    decay = of_decay * float(np.sum(active * m_a))
    return scene.number("kinetics", "acceptor_to_donor_ratio") * donor + decay, donor, decay


def _fractions(scene: Scene, fields: Fields, name: str) -> np.ndarray:
    """m of a substrate at the quadrature points of the aggregate's triangles, (B, q)."""
    if name not in scene.names:
        return np.ones(())
    return scene.fraction(name, np.maximum(fields.inside(f"{name}_mg_per_L"), 0.0))


def _uptake(scene: Scene, row: dict, fields: Fields) -> Iterator[Finding]:
    """Check, in a steady row, that the loss between inlet and outlet equals the uptake by the aggregate."""
    steep = any(scene.half_saturation(name) < STEP * scene.course(name, "supply").at(row["time_h"])
                for name in scene.names)
    if not scene.flows or scene.stores or steep:
        return
    flow = row["mean_velocity_m_per_d"] * UNITS["m/day"] * scene.width
    rates = dict(zip(NAMES, _rates(scene, fields)))
    for name in scene.names:
        rate = rates[name]
        supply = scene.course(name, "supply").at(row["time_h"])
        lost = flow * (supply - row[f"effluent_{name}_mg_per_L"])
        slack = UPTAKE * rate + SOLVED * (flow + scene.number(name, "diffusivity")) * supply
        yield excess(f"{name} that the aggregate takes up, um2 mg/L/h", rate, lost - slack, lost + slack,
                     "(7) and (8) in the fields; two quadratures of one uptake")


def _deformation(scene: Scene, row: dict, fields: Fields) -> Iterator[Finding]:
    """Check that J is the ratio of areas, and that theta equals J in the mean (24)."""
    if scene.section("growth").get("new_biomass") == "stress_free" or not fields.body.any():
        return
    places = np.nan_to_num(fields.at_nodes["position_t0_um"][:, :2])
    before = fields.weights(places)[fields.body].sum(axis=1)
    after = fields.areas[fields.body]
    J, theta = (fields.in_cells[name][fields.body] for name in ("J", "theta"))
    yield size("area over that at t = 0 over J, less one", after / before / J - 1, SOLVED, "J = det dx/dX")
    yield size("integral of theta less J over that of J", np.sum((theta - J) * before) / after.sum(), SOLVED,
               "(24) with a constant test function; Newton's tolerance")
    if scene.section("growth").get("wall") == "bonded":
        body = np.unique(fields.cells[fields.body])
        bonded = body[(fields.points[body, 1] == 0) & (places[body, 1] == 0)]
        moved = fields.points[bonded, 0] - places[bonded, 0]
        yield size("path of bonded nodes along the wall over the width", moved / scene.width, SOLVED,
                   "2.3.3: nodes on a bonded wall stay there; quadratic functions carry their positions exactly")


def _steps(run: Run) -> Iterator[Finding]:
    ledger = run.ledger
    gaps = np.concatenate([ledger["start_h"][:1], ledger["start_h"][1:] - ledger["end_h"][:-1]])
    yield size("time between one step's end and the next one's start, h", gaps, SUM, "steps follow each other")
    before, after = ledger["biomass_before_pg_per_m"], ledger["biomass_after_pg_per_m"]
    yield size("biomass at a step's start less that at the end before, over that at t = 0",
               (before[1:] - after[:-1]) / before[0], SUM, "biomass does not change between steps")
    dense = run.scene.number("kinetics", "maximum_density")
    area = run.series["aggregate_area_um2"]
    yield size("biomass at t = 0 over X_m times the area, less one", before[0] / (dense * area[0]) - 1, SUM,
               "X_A + X_I = X_m")
    rows, steps = run.at_ledger()
    bound = STRAIGHT_AREA if run.fields[0].straight else SOLVED
    yield size("biomass over X_m times the area of the row, less one", after[steps] / (dense * area[rows]) - 1, bound,
               "(24) and (28): biomass has the density X_m in the mean")
    columns = [name for name in run.series if name.endswith("_balance")]
    for name in columns:
        if run.scene.midpoint or not name.startswith("oxygen"):
            yield size(f"column {name}", run.series[name], 1e-6, "docs/design.md: a step closes to 1e-6")


def _substrates(run: Run) -> Iterator[Finding]:
    """Check that each substrate's supply equals the amounts that leave, are consumed and are stored."""
    scene = run.scene
    width, length = scene.width, scene.length
    for name in scene.names:
        supplied, out, consumed, stored = (run.ledger[f"{name}_{part}_pg_per_m"]
                                           for part in ("supplied", "out", "consumed", "stored"))
        largest_supply = scene.course(name, "supply").largest(run.scene.end)
        exchanged = scene.number(name, "diffusivity") * largest_supply * run.duration
        content = largest_supply * width * length if scene.stores else 0.0
        scale = np.abs(supplied) + np.abs(consumed) + exchanged + content
        yield size(f"{name} supplied less leaving, consumed and stored, relative",
                   (supplied - out - consumed - stored) / np.maximum(scale, 1e-300), SOLVED, "(7), (8) over the pore")
        if not scene.stores:
            yield size(f"{name} stored by quasi-steady substrates", stored, 0, "quasi-steady")
        if scene.closed:
            yield size(f"{name} that passes closed ends", [*supplied, *out], 0, "no flux through closed ends")
        yield excess(f"{name} consumed, pg/m", consumed, -SOLVED * scale, _max_consumed(run, name) * (1 + SOLVED),
                     "the law's largest m up to the supply, with the biomass of the fastest growth")


def _saturation(run: Run, name: str) -> float:
    """The largest m of the run; one for a substrate that the scene leaves out."""
    if name not in run.scene.names:
        return 1.0
    largest = (1 + OVERSHOOT) * run.scene.course(name, "supply").largest(run.scene.end)
    return run.scene.largest_fraction(name, largest)


def _decay_fraction(run: Run) -> float:
    """The largest factor of b in the decay: m_A, or one if decay is unlimited."""
    return 1.0 if run.scene.unlimited_decay else _saturation(run, "acceptor")


def _max_biomass(run: Run) -> np.ndarray:
    """Upper bound of the biomass at the end of each step (steps,), pg/m."""
    scene = run.scene
    fastest = scene.number("kinetics", "maximum_utilization_rate") * scene.number("kinetics", "yield_coefficient")
    m_a, m_d = (max(1.0, _saturation(run, name)) for name in NAMES)
    return run.ledger["biomass_before_pg_per_m"] * np.exp(fastest * m_a * m_d * run.duration)


def _max_consumed(run: Run, name: str) -> np.ndarray:
    scene = run.scene
    m_a, m_d = (_saturation(run, name_of_substrate) for name_of_substrate in NAMES)
    donor = scene.number("kinetics", "maximum_utilization_rate") * m_a * m_d * run.duration * _max_biomass(run)
    if name == "donor":
        return donor
    return scene.number("kinetics", "acceptor_to_donor_ratio") * donor + _max_decay(run) * scene.number(
        "kinetics", "decay_oxygen_demand")


def _max_decay(run: Run) -> np.ndarray:
    """Upper bound of the biomass that degrades in each step (steps,), pg/m."""
    scene = run.scene
    rate = scene.number("kinetics", "decay_coefficient") * scene.number("kinetics", "degradable_fraction")
    return rate * _decay_fraction(run) * run.duration * _max_biomass(run)


def _least_decay(run: Run) -> np.ndarray | float:
    """Lower bound of the biomass that degrades in each step (steps,), pg/m: the part active at t = 0 decays at b."""
    scene = run.scene
    if "acceptor" in scene.names and not scene.unlimited_decay:
        return 0.0
    b = scene.number("kinetics", "decay_coefficient")
    active = (1 - run.series["inert_fraction"][0]) * run.ledger["biomass_before_pg_per_m"][0]
    least = active * np.exp(-b * run.ledger["end_h"])
    return scene.number("kinetics", "degradable_fraction") * b * run.duration * least


def _growth(run: Run) -> Iterator[Finding]:
    """Check that new biomass is the yield on the donor minus the decay."""
    scene, ledger = run.scene, run.ledger
    law = {key: scene.number("kinetics", key) for key in TABLE_1["kinetics"]}
    produced, after = ledger["biomass_made_pg_per_m"], ledger["biomass_after_pg_per_m"]
    before = ledger["biomass_before_pg_per_m"]
    lost = ledger.get("detached_pg_per_m", np.zeros_like(after))
    yield size("biomass after and detached, less before and new, over that at t = 0",
               (after + lost - before - produced) / before[0], SOLVED, "(9), (10) over the aggregates")
    acceptor, donor = _demands(run, law)
    grown = law["yield_coefficient"] * donor
    ratio = law["acceptor_to_donor_ratio"]
    decayed = (acceptor - ratio * donor) / law["decay_oxygen_demand"]
    terms = acceptor / law["decay_oxygen_demand"] + ratio * donor + grown
    slack = SUM * (before + terms) + _scheme_error(run, law, terms)
    yield excess("new biomass - (Y donor - (acceptor - F donor) / d_c), pg/m", produced - grown + decayed,
                 -slack, slack, "(7)-(10); round-off with the midpoint rule")
    yield excess("biomass that degrades by the oxygen consumed, pg/m", decayed,
                 _least_decay(run) - slack - SOLVED * terms, _max_decay(run) * (1 + SOLVED) + slack,
                 "f_d b m_A X_A, from zero to that at the supply; f_d b X_A at the least X_A where m_A = 1 in decay")
    rows, steps = run.at_ledger()
    inert = run.series["inert_fraction"][rows] * after[steps]
    first_inert = run.series["inert_fraction"][0] * before[0]
    share = (1 - law["degradable_fraction"]) * law["decay_coefficient"]
    gained = np.cumsum(share * _decay_fraction(run) * run.duration * _max_biomass(run))[steps]
    tolerance = SOLVED * after[steps]
    least = first_inert - np.cumsum(lost)[steps] - tolerance
    yield excess("inert biomass, pg/m", inert, least, first_inert + gained + tolerance,
                 "(10): it gains (1 - f_d) b m_A X_A, and loses at most all that detaches")


def _demands(run: Run, law: dict) -> tuple[np.ndarray, np.ndarray]:
    """Acceptor that growth and decay demand, met or not, and donor taken up, in each step (steps,), pg/m.

    With the acceptor alone m_D = 1, and growth takes the part k F of the uptake k F + d_c f_d b. With the donor alone
    the files do not contain the demand of the decay, f_d b times the active biomass. It is then the rest of the
    balance, which has bounds alone."""
    ledger = run.ledger
    unmet = ledger.get("acceptor_unmet_pg_per_m", 0.0)
    ratio = law["acceptor_to_donor_ratio"]
    if "donor" not in run.scene.names:
        acceptor, k = ledger["acceptor_consumed_pg_per_m"], law["maximum_utilization_rate"]
        decay = law["decay_oxygen_demand"] * law["degradable_fraction"] * law["decay_coefficient"]
        return acceptor + unmet, k * acceptor / (k * ratio + decay)
    donor = ledger["donor_consumed_pg_per_m"]
    if "acceptor" not in run.scene.names:
        decayed = law["yield_coefficient"] * donor - ledger["biomass_made_pg_per_m"]
        return ratio * donor + law["decay_oxygen_demand"] * decayed, donor
    return ledger["acceptor_consumed_pg_per_m"] + unmet, donor


def _scheme_error(run: Run, law: dict, terms: np.ndarray) -> np.ndarray | float:
    """Bound of the scheme's error in each step (steps,), pg/m.

    The paper's updates use the trapezoidal rule, whose error is (rate times step)^2 / 12 of the turnover. Gear's method
    computes concentrations to a thousandth of the supply, which changes C / (C + K_s) by at most a thousandth of
    supply / K_s. The error of the biomass is this fraction of its turnover at the fastest rate."""
    if run.scene.midpoint:
        return 0.0
    fastest = law["maximum_utilization_rate"] * law["yield_coefficient"] + law["decay_coefficient"]
    part = fastest * run.duration
    if not run.scene.stores:
        return part**2 / 12 * terms
    steep = sum(run.scene.course(name, "supply").largest(run.scene.end) / run.scene.half_saturation(name)
                for name in run.scene.names)
    return part**2 / 12 * terms + 1e-3 * max(1.0, steep) * part * _max_biomass(run)


#: Columns that report the steps since the previous row, and therefore depend on its time.
OF_STEPS = ("acceptor_balance", "donor_balance", "biomass_balance", "oxygen_demand_balance", "remeshed")


def same_rows(first: Run, second: Run) -> Iterator[Finding]:
    """Check that two runs that differ only in ``output.times`` have identical rows at the same times."""
    rows = [(i, k) for i, time in enumerate(first.times) for k in np.flatnonzero(second.times == time)]
    most = min(2, len(first.times), len(second.times))
    yield Finding("rows that both runs have", len(rows), most, inf, "else less is tested; a run may end at t = 0")
    columns = [name for name in first.series if name not in OF_STEPS]
    differing = sum(not np.array_equal(first.series[name][i], second.series[name][k], equal_nan=True)
                    for name in columns for i, k in rows)
    yield size("numbers of rows that depend on other rows", differing, 0, "output.times changes no step")
    differing = sum(_differ(first.fields[i], second.fields[k]) for i, k in rows)
    yield size("fields that depend on other rows", differing, 0, "output.times changes no step")
    shared = min(len(table.get("end_h", ())) for table in (first.ledger, second.ledger))
    differing = sum(np.count_nonzero(first.ledger[name][:shared] != second.ledger[name][:shared])
                    for name in first.ledger)
    yield size("numbers of the ledger that depend on rows", differing, 0, "output.times changes no step")


def _differ(*files: Fields) -> bool:
    """Whether two files contain different arrays."""
    first, second = ({**fields.at_nodes, **fields.in_cells, "points": fields.points} for fields in files)
    if first.keys() != second.keys():
        return True
    return not all(np.array_equal(first[key], second[key], equal_nan=True) for key in first)


def close(coarse: Run, fine: Run) -> Iterator[Finding]:
    """Compare the presets fast and accurate before contact, and before an aggregate leaves: differences of each column
    over its scale."""
    for column, scale in _scales(coarse, fine).items():
        if column in coarse.series and column in fine.series:
            pairs = [(i, k) for i, time in enumerate(coarse.times) for k in np.flatnonzero(fine.times == time)
                     if not (coarse.series["contact"][i] or fine.series["contact"][k])
                     and coarse.fields[i].present == fine.fields[k].present == fine.scene.aggregates]
            differences = [(coarse.series[column][i] - fine.series[column][k]) / scale(k) for i, k in pairs]
            yield size(f"{column} in fast less that in accurate, relative", differences, PROMISED,
                       "README.md: 1 % and 0.1 %")


def _scales(coarse: Run, fine: Run) -> dict[str, Callable[[int], float]]:
    """{column: function from the row to the scale of the column's differences}."""
    series, scene = fine.series, fine.scene
    scales: dict[str, Callable[[int], float]] = {}
    for name in ("mean_velocity_m_per_d", "head_loss_cm", "conductivity_m_per_d", "aggregate_area_um2", "thickness_um"):
        scales[name] = lambda k, name=name: series[name][k]
    for name in ("upstream_um", "downstream_um"):
        scales[name] = lambda k: series["downstream_um"][k] - series["upstream_um"][k]
    for name in scene.names:
        scales[f"effluent_{name}_mg_per_L"] = lambda k, name=name: max(
            scene.course(name, "supply").largest(fine.times[k]), 1e-300)
    return scales
