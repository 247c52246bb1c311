"""The laws for networks with a scene's own kinetics: states that are solved once, in a file.

The states are half-discs of drawn sizes, and the shapes that the run of the scene itself grows,
each at drawn velocities and supplies. The constants of the law of uptake are fitted to them, as
those of Table 1 are to other states (:mod:`repro.network.uptakes`). The grown shapes also give the
resistance over that of the law.

The file is sealed JSON in the user's cache folder. Its name is the hash of everything that the
states depend on: the scene, the code and the versions of the packages. A file that was altered, or
that another version wrote, is made again.
"""

import json
import os
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from repro.errors import OutputError, RunEnd, Unresolved
from repro.fem.space import Space
from repro.march.simulation import simulate
from repro.model import flow, solving
from repro.model.interface import LAPLACIAN, Interface, interface_of
from repro.model.kinetics import rate_law
from repro.model.meshing import seeded
from repro.model.pore import Pore
from repro.model.resistance import Viscous
from repro.network.resistance import is_plug, share_range
from repro.network.uptakes import FASTEST, TRANSPORTS, Law, Throats, Transport, law_of
from repro.results import provenance, write_text
from repro.results.files import output_path, read_sealed, sealed, sha256
from repro.runs.machine import source_hash, statements
from repro.scene import Scene, SceneError, load_scene, scene_tables
from repro.timing import progress_bar

#: Seed of the drawn states, a date.
SEED = 20261129
#: Half-discs, and states at each grown shape: some ten for each of the eight constants, and half a
#: minute. With half of the half-discs the bound of a scene with 21 shapes was half as large.
HALF_DISCS, STATES = 60, 3
#: Thicknesses of half-discs over W, from the first of the law of resistance to a film of W / 50;
#: widths of their pores over that of the scene, a range as wide as that of Table 1's law.
THICKNESSES, WIDTHS = (0.05, 0.98), (0.5, 2.0)
#: The least velocity (m/d), at which diffusion alone supplies the aggregate (Pe is about 1e-4), and
#: the least supply over that of the scene.
SLOWEST, LEAST_SUPPLY = 1e-4, 0.01
#: Length of pores over W, as of the shapes of the law of resistance; factor between the areas of
#: grown shapes; their largest A / W^2, that of its table.
LENGTH, STEP, LARGEST = 15.0, 1.2, 4.5
#: Largest change of the fit's unknowns, ln of factors and exponents, and most evaluations: few
#: states may leave a constant undetermined. With twice the change, or with 20 to 200 evaluations,
#: the bound of a scene changes by less than 0.3 %.
SPREAD, MOST_FITS = 2.0, 40
#: The bound is the largest error of the fit, over the spread of the bound, times this factor, as
#: for Table 1.
FACTOR = 1.25


class Table(NamedTuple):
    """What is computed for a scene once.

    states: (n, 7) area (um2), width (um), velocity (m/d), supplies (mg/L) and uptakes (pg/m/h) of
    acceptor and donor; shapes: (m, 3) whether a shape touches both walls, its A / W^2, and r;
    constants: (2, 4) those of S and P, before contact and after it; bound: () of the uptakes.
    """

    states: np.ndarray
    shapes: np.ndarray
    constants: np.ndarray
    bound: np.ndarray


class Laws(NamedTuple):
    """Both laws of a scene.

    uptake: its law; shapes: those of the `Table`; viscosity_ratio: of the scene; file: the table.
    """

    uptake: Law
    shapes: np.ndarray
    viscosity_ratio: float
    file: Path


#: Shapes of the parts of a `Table`.
SIZES = (-1, 7), (-1, 3), (2, 4), ()
#: Laws that this process has read or made, by their files.
_KNOWN: dict[Path, Laws] = {}


def tabulated(scene: Scene, progress: bool = False) -> Laws:
    """Return the laws of a scene, from its file or from states that are solved now.

    Raises SceneError if they do not hold for the scene, and SimulationError. Warns if the file
    cannot be written.
    """
    _refuse(scene)
    key = _key(scene)
    caches = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    file = caches / "dupin2001-repro" / f"network-law-{key}.json"
    if file not in _KNOWN:
        table = _read(file, key)
        if table is None:
            table = _fitted(scene, *solved(scene, np.random.default_rng(SEED), progress))
            _write(file, key, table)
        _KNOWN[file] = Laws(_law(scene, table), table.shapes, scene.flow.viscosity_ratio, file)
    return _KNOWN[file]


def _refuse(scene: Scene) -> None:
    """Raise SceneError if the form of the laws does not suit a scene."""
    kinds = scene.substrates.modelled if scene.substrates and scene.kinetics else {}
    needs = {"a flow past one viscous aggregate between two walls": (
        scene.flow is not None and scene.flow.viscosity_ratio is not None
        and len(scene.aggregates) == 1 and scene.pore.whole_width == scene.pore.width)}
    needs["both substrates"] = len(kinds) == 2
    if kinds:
        rates = rate_law(scene.substrates, scene.kinetics)
        needs["an uptake that rises with both concentrations and has no front, and no decay "
              "without acceptor"] = rates.uptake_law.monotone and not (
                  rates.uptake_law.sharp or rates.further_decay)
    for need, suits in needs.items():
        if not suits:
            raise SceneError(f"{scene.name}: the laws for networks need {need}")


def _key(scene: Scene) -> str:
    """Hash (16 hexadecimal digits) of all that the states of a scene depend on."""
    about = provenance(scene)
    code = statements(Path(__file__).read_text(encoding="utf-8"))
    parts = [about["hash"], about["versions"], about.get("scheme"), source_hash(), code]
    return sha256(json.dumps(parts, sort_keys=True).encode())[:16]


def _read(file: Path, key: str) -> Table | None:
    """Read a table. None if there is no file, or if it is damaged or of another scene or code."""
    try:
        content = read_sealed(file)
        if content["key"] == key:
            parts = (np.array(content[name], float) for name in Table._fields)
            return Table(*(part.reshape(size) for part, size in zip(parts, SIZES)))
    except (OSError, ValueError, KeyError, TypeError):
        pass
    return None


def _write(file: Path, key: str, table: Table) -> None:
    """Write a table, or warn that it cannot be written."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with output_path(file) as path:
            lists = {name: values.tolist() for name, values in table._asdict().items()}
            write_text(path, sealed({"key": key, **lists}))
    except (OSError, OutputError) as error:
        warnings.warn(f"the law for networks is not kept: {error}", stacklevel=4)


def solved(scene: Scene, random: np.random.Generator,
           progress: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Return the states and the shapes of the `Table` of a scene. Raises SimulationError."""
    with progress_bar(progress, "h") as show:
        grown = list(_grown(scene, show))
    bodies = [None] * HALF_DISCS + grown * STATES
    states, unresolved = [], 0
    with progress_bar(progress, "states") as show:
        for body in bodies:
            try:
                states.append(_state(scene, random, body))
            except Unresolved:
                unresolved += 1
            show(len(states) + unresolved, len(bodies))
    if unresolved:
        warnings.warn(f"{scene.name}: {unresolved} of {len(bodies)} states of the laws for "
                      "networks have fronts thinner than an element, and the bounds leave them out",
                      stacklevel=5)
    ratio, interface = scene.flow.viscosity_ratio, interface_of(scene.numerics.interface)
    shapes = [[pore.contact, pore.boundary.area / pore.mesh.width**2,
               added_length(pore.space, ratio, interface)] for pore in grown]
    return np.array(states), np.array(shapes, float).reshape(SIZES[1])


def _grown(scene: Scene, show: Callable) -> Iterator[Pore]:
    """Yield shapes of the scene's run, until it ends or fills the range of A / W^2."""
    tables = {name: part for name, part in scene_tables(scene).items() if name != "output"}
    share = 0.0
    with suppress(RunEnd):
        for report in simulate(tables) if scene.growth else ():
            show(report.pore.time, scene.growth.end)
            area = report.pore.boundary.area / scene.pore.width**2
            if area > LARGEST:
                return
            if area > STEP * share:
                share = area
                yield report.pore


def added_length(space: Space, ratio: float, interface: Interface = LAPLACIAN) -> float:
    """r: the loss of the meshed part over that of an empty one of length W, less its own length
    over W."""
    mesh = space.mesh
    loss = flow.unit_flow(space, Viscous(ratio), interface=interface).loss
    empty = flow.poiseuille_loss(mesh.width, mesh.width)
    return loss / empty - (mesh.ends[1] - mesh.ends[0]) / mesh.width


def _state(scene: Scene, random: np.random.Generator, body: Pore | None) -> list[float]:
    """Solve a shape, or a drawn half-disc, at drawn velocity and supplies: a row of the table."""
    tables = scene_tables(scene)
    width = scene.pore.width * (1.0 if body else _log_uniform(random, *WIDTHS))
    radius = width * random.uniform(*THICKNESSES)
    velocity = _log_uniform(random, SLOWEST, FASTEST)
    supplies = [limit * _log_uniform(random, LEAST_SUPPLY, 1.0) for limit in _supplies(scene)]
    drives = ("head", "mean_velocity", "rate")
    fluid = {key: value for key, value in tables["flow"].items() if key not in drives}
    kinds = {name: {**tables["substrates"][name], "supply": f"{supply!r} mg/L"}
             for name, supply in zip(scene.substrates.modelled, supplies)}
    state = load_scene({
        "pore": {"width": f"{width!r} um", "length": f"{LENGTH * width!r} um"},
        "aggregate": {"radius": f"{radius!r} um"},
        "flow": {**fluid, "mean_velocity": f"{velocity!r} m/d"}, "substrates": kinds,
        "kinetics": tables["kinetics"], "numerics": tables["numerics"]})
    pore = body or seeded(state)
    acceptor, donor = solving.solve(state, pore).substrates.fluxes
    return [pore.boundary.area, width, velocity, *supplies, acceptor.consumed, donor.consumed]


def _log_uniform(random: np.random.Generator, low: float, high: float) -> float:
    """Draw a number between two values, whose logarithm is uniform."""
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def _supplies(scene: Scene) -> tuple[float, ...]:
    """Return the largest supplies of acceptor and donor, mg/L."""
    return tuple(kind.supply for kind in scene.largest.substrates.modelled.values())


def _fitted(scene: Scene, states: np.ndarray, shapes: np.ndarray) -> Table:
    """Fit the law of uptake to the states of a scene, from the constants of Table 1 on."""
    start = Table(states, shapes, np.array(TRANSPORTS), np.array(1.0))
    law = _law(scene, start)
    spanned = is_plug(states[:, 0] / states[:, 1] ** 2)
    kinds = zip((states[~spanned], states[spanned]), TRANSPORTS)
    transports = tuple(fit(throats(law, part), part.T[5:], first) if len(part) else first
                       for part, first in kinds)
    least = bound(throats(law._replace(transports=transports), states), states.T[5:])
    return Table(states, shapes, np.array(transports), np.array(least))


def _law(scene: Scene, table: Table) -> Law:
    """Return the law of uptake of a scene: to its largest plug, or to contact if it has none."""
    low, high = WIDTHS
    shares = table.states[:, 0] / table.states[:, 1] ** 2
    share = float(shares.max()) if is_plug(shares).any() else share_range(False)[1]
    before, after = (Transport(*row) for row in table.constants.tolist())
    return law_of(scene, (before, after), float(table.bound), share=share,
                  widths=(low * scene.pore.width, high * scene.pore.width),
                  supplies=_supplies(scene))


def throats(law: Law, states: np.ndarray) -> Throats:
    """Return the throats of states (n, 7), with a law."""
    area, width, velocity, *supplies = states.T[:5]
    return Throats(area, width, velocity, np.array(supplies), law)


def deviations(aggregates: Throats, solutions: np.ndarray) -> np.ndarray:
    """(2, n) ln of the uptakes (2, n) of acceptor and donor over those of the law."""
    return np.log(solutions / aggregates.uptake()[:2])


def fit(aggregates: Throats, solutions: np.ndarray, start: Transport) -> Transport:
    """Fit the constants, to three digits, of aggregates of one kind to their uptakes (2, n).

    The fit minimises the squares of the deviations over the spread of the bound.
    """
    from scipy.optimize import least_squares  # its import takes a quarter of a second

    spread = aggregates.spread()

    def constants(unknowns: np.ndarray) -> Transport:
        sherwood, power, plug, plug_power = unknowns
        return Transport(np.exp(sherwood), power, np.exp(plug), plug_power)

    def residuals(unknowns: np.ndarray) -> np.ndarray:
        law = aggregates.law._replace(transports=(constants(unknowns),) * 2)
        return (deviations(replace(aggregates, law=law), solutions) / spread).ravel()

    first = [np.log(start.sherwood), start.power, np.log(start.plug), start.plug_power]
    limits = np.array(first) - SPREAD, np.array(first) + SPREAD
    unknowns = least_squares(residuals, first, bounds=limits, diff_step=1e-2, xtol=1e-4, ftol=1e-4,
                             max_nfev=MOST_FITS).x
    return Transport(*(float(f"{value:.3g}") for value in constants(unknowns)))


def bound(aggregates: Throats, solutions: np.ndarray) -> float:
    """Return the least bound, to three digits, for the uptakes (2, n) of the fit."""
    errors = np.expm1(np.abs(deviations(aggregates, solutions))).max(axis=0)
    return float(f"{FACTOR * (errors / aggregates.spread()).max():.3g}")
