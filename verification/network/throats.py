"""Whole runs of throats of the network, with the heads and supplies that the laws give them, against the laws.

    python -m verification.network histories   advance the network (needs OpenPNM); writes histories.csv, ten throats
    python -m verification.network throats     run these throats, write throats.csv and print the errors
"""

from collections.abc import Iterator
from pathlib import Path
from time import perf_counter

import numpy as np

import repro
from repro.results import read_table
from verification.claims.runs import SUBSTRATES, until
from verification.network import shapes
from verification.network.lattice import LENGTH, Lattice, State

HISTORIES, RUNS = (Path(__file__).with_name(name) for name in ("histories.csv", "throats.csv"))
HISTORY_COLUMNS = ["throat", "width", "time", "head", "acceptor", "donor", "velocity", "area"]
RUN_COLUMNS = ["throat", "time", "velocity", "area", "contact"]
#: Of the throats of the network, evenly in their final area over W^2.
SELECTED = 10


def history_rows(lattice: Lattice, states: list[State], count: int = SELECTED) -> Iterator[list[float]]:
    """Rows of HISTORIES, of some throats that carry water."""
    share = states[-1].area / lattice.width**2
    flowing = np.flatnonzero(states[0].velocity > 1e-3)
    order = flowing[np.argsort(share[flowing])]
    for throat in sorted(order[np.linspace(0, len(order) - 1, count).astype(int)].tolist()):
        for state in states:
            yield [throat, *(float(value) for value in (
                lattice.width[throat], state.time, abs(state.head[throat]), *state.supplies[:, throat],
                state.velocity[throat], state.area[throat]))]


def scene(history: dict[str, np.ndarray]) -> repro.Scene:
    """The throat of a history, with its head and supplies as tables over time."""
    hours, width = history["time"], history["width"][0]

    def over_time(name: str, unit: str) -> list[list[str]]:
        return [[f"{hour:g} h", f"{value!r} {unit}"] for hour, value in zip(hours, history[name].tolist())]

    radius = np.sqrt(2 * history["area"][0] / np.pi)
    return repro.load_scene({
        "pore": {"width": f"{width} um", "length": f"{LENGTH} um"}, "aggregate": {"radius": f"{radius} um"},
        "flow": {"head": over_time("head", "um"), "interpolation": "linear"},
        "substrates": {name: {"supply": over_time(name, "mg/L"), "interpolation": "linear"} for name in SUBSTRATES},
        "growth": {}}, (*shapes.QUICK, *until(*(int(hour) for hour in hours))))


def histories(path: Path = HISTORIES) -> dict[int, dict[str, np.ndarray]]:
    """The history of each throat, by its number."""
    columns = read_table(path)
    return {int(throat): {name: values[columns["throat"] == throat] for name, values in columns.items()}
            for throat in np.unique(columns["throat"])}


def run_rows(throat: int, history: dict[str, np.ndarray]) -> list[list[float]]:
    """Rows of RUNS: a whole run of a throat."""
    start = perf_counter()
    rows: list[list[float]] = []
    ending = "48 h"
    try:
        for report in repro.simulate(scene(history)):
            rows.append([throat, report.pore.time, report.solved.mean_velocity * 24e-6, report.pore.boundary.area,
                         int(report.pore.contact)])
    except (repro.SimulationError, repro.PoreEnd, repro.Fold) as error:
        ending = str(error)
    print(f"throat {throat}: {rows[-1][1]:g} h, {perf_counter() - start:.0f} s; end: {ending}", flush=True)
    return rows


def errors(runs: dict[str, np.ndarray], laws: dict[int, dict[str, np.ndarray]]) -> dict[int, np.ndarray]:
    """(n, 3) time (h), and ln of area and of velocity by the laws over those of the run, by throat."""
    result = {}
    for throat, history in laws.items():
        of_run = runs["throat"] == throat
        time, area, velocity = (runs[name][of_run] for name in ("time", "area", "velocity"))
        result[throat] = np.column_stack([time] + [
            np.log(np.interp(time, history["time"], history[name]) / values)
            for name, values in (("area", area), ("velocity", velocity))])
    return result
