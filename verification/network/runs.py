"""Throats of the example of a network as whole runs of the solver, and their comparison with the law.

A scene has the throat's width, seed, head loss and supplies; the tables keep their values for the step of the example.
Two properties differ from those of the example. First, a scene has no negative head loss. Where the flow in a throat
reverses (two throats), the run keeps its direction and uses the absolute value. Second, a run with steady substrates
needs a flow. Throats without flow get LEAST_HEAD, which supplies almost nothing.
"""

from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np

from repro.errors import RunEnd
from repro.march.simulation import simulate
from repro.march.state import Report
from repro.network.throats import added_resistance, uptake
from repro.results import M_PER_D, read_table
from repro.scene import Scene, load_scene
from verification.claims.runs import SUBSTRATES, rows_at
from verification.network.histories import History, read
from verification.network.throats import (
    EXPECTED,
    EXPECTED_COLUMNS,
    LENGTH,
    QUANTITIES,
    TIMES,
    VISCOSITY,
    conditions,
    resistance,
)

#: Head loss (um) below that of every throat with flow.
LEAST_HEAD = 1e-4
#: The rows of ten runs at TIMES. A run that ends earlier has no later rows.
TABLE, COLUMNS = Path(__file__).with_name("throats.csv"), ["throat", "time_h", *QUANTITIES]

#: The throat whose aggregate also grows at constant velocities (m/d), up to an A / W^2, for at most LONGEST hours.
CONTROL, SPEEDS = 61, (2.0, 1.0, 0.3)
CONTROL_SHARE, LONGEST = 1.25, 120
CONTROLS = Path(__file__).with_name("controls.csv")
CONTROL_COLUMNS = ["velocity_m_per_d", "area_over_width2", "resistance_over_law", "thickness_over_half_disc"]


def scene(one: History, times: Iterable[float] = TIMES, preset: str = "fast") -> Scene:
    """The scene of a throat, to the last of some times (h)."""
    times = list(times)
    tables = _throat(one)
    heads = np.maximum(np.abs(one.head_loss), LEAST_HEAD)
    supplies = {name: {"supply": _table(one.time, values, "mg/L")} for name, values in zip(SUBSTRATES, one.supplies)}
    return load_scene(tables | {
        "flow": {"head": _table(one.time, heads, "um"), "kinematic_viscosity": f"{VISCOSITY} m^2/s"},
        "substrates": supplies, "growth": {"end": f"{times[-1]} h"}},
        [f"numerics.preset={preset}", rows_at(*times)])


def _throat(one: History) -> dict:
    """The pore and the seed of a throat."""
    return {"pore": {"width": f"{one.width} um", "length": f"{LENGTH} um"},
            "aggregate": {"radius": f"{np.sqrt(2 * one.area[0] / np.pi)} um"}}


def _table(times: np.ndarray, values: np.ndarray, unit: str) -> list[list[str]]:
    return [[f"{time} h", f"{value} {unit}"] for time, value in zip(times, values)]


def run(one: History, times: Iterable[float] = TIMES) -> Iterator[list]:
    """Rows of TABLE of a throat."""
    with suppress(RunEnd):
        for report in simulate(scene(one, times)):
            if report.pore.time > 0:
                yield [one.number, report.pore.time, *values(report)]


def values(report: Report) -> list[float]:
    """Each of QUANTITIES."""
    solved = report.solved
    taken = [float(flux.consumed) for flux in solved.fluxes]
    return [float(report.pore.outline.area), float(M_PER_D * solved.flow.mean_velocity), *taken]


def controls(all_throats: list[History]) -> Iterator[list]:
    """Rows of CONTROLS: the throat CONTROL with its history, then at constant velocities and its first supplies."""
    one = next(one for one in all_throats if one.number == CONTROL)
    yield [0.0, *_last(scene(one, range(1, 49)), one.width)]
    supplies = {name: {"supply": f"{values[0]} mg/L"} for name, values in zip(SUBSTRATES, one.supplies)}
    for speed in SPEEDS:
        tables = _throat(one) | {"substrates": supplies, "growth": {"end": f"{LONGEST} h"}}
        tables["flow"] = {"mean_velocity": f"{speed} m/d", "kinematic_viscosity": f"{VISCOSITY} m^2/s"}
        yield [speed, *_last(load_scene(tables, ["numerics.preset=fast", rows_at(*range(1, LONGEST + 1))]), one.width)]


def _last(one_scene: Scene, width: float) -> list[float]:
    """A / W^2, and the ratios of r to the law and thickness to the half-disc, in the last row up to CONTROL_SHARE."""
    rows: list[list[float]] = []
    for report in simulate(one_scene):
        outline, flow = report.pore.outline, report.solved.flow
        share = float(outline.area / width**2)
        if share > CONTROL_SHARE:
            break
        speed = M_PER_D * flow.mean_velocity
        r = resistance(width, flow.head_loss, speed)
        half_disc = np.sqrt(2 * outline.area / np.pi)
        rows.append([share, float(r / added_resistance(share, 1.0).length), float(outline.thickness / half_disc)])
    return rows[-1]


class Comparison(NamedTuple):
    """Ten throats at TIMES.

    number: (n,) of the throats; in_range: (n, times), whether the conditions so far are those of the shapes behind the
    law; example: (n, times) um2, areas of the example; law, least, most, run: (n, times, quantities). A run that has
    ended has not-a-number.
    """

    number: np.ndarray
    in_range: np.ndarray
    example: np.ndarray
    law: np.ndarray
    least: np.ndarray
    most: np.ndarray
    run: np.ndarray

    @property
    def error(self) -> np.ndarray:
        """(n, times, quantities) of the law, relative to the run."""
        return self.law / self.run - 1

    @property
    def holds(self) -> np.ndarray:
        """(n, times, quantities) whether the run is within the bounds."""
        return (self.least <= self.run) & (self.run <= self.most)

    @property
    def example_error(self) -> np.ndarray:
        """(n, times) of the example's areas, with the error of its step."""
        return self.example / self.run[:, :, 0] - 1


class Judgement(NamedTuple):
    """Values of the runs and of one law at their areas, in all s states.

    share: (s,) A / W^2; in_range: (s,) as in Comparison; run, law, least, most: (s,), or (2, s) for both substrates.
    """

    share: np.ndarray
    in_range: np.ndarray
    run: np.ndarray
    law: np.ndarray
    least: np.ndarray
    most: np.ndarray

    @property
    def holds(self) -> np.ndarray:
        """Whether the run is within the bounds of the law."""
        return (self.least <= self.run) & (self.run <= self.most)


def laws_at_the_runs() -> tuple[Judgement, Judgement]:
    """The laws of resistance (r) and of uptake at the areas and velocities of the runs, for all states."""
    of_runs, measured = compared(), read_table(TABLE)
    throats = {one.number: one for one in read()}
    states = []
    for number, time in zip(measured["throat"], measured["time_h"]):
        one = throats[int(number)]
        states.append(conditions([one], int(np.searchsorted(one.time, time)), time))
    width = np.concatenate([state.width for state in states])
    head = np.concatenate([state.head_loss for state in states])
    supplies = np.concatenate([state.supplies for state in states], axis=1)
    area, speed, *taken = (measured[name] for name in QUANTITIES)
    share, inside = area / width**2, of_runs.in_range[~np.isnan(of_runs.run[:, :, 0])]
    r = resistance(width, head, speed)
    added, law = added_resistance(area, width), uptake(area, width, speed, *supplies)
    both = np.stack([law.acceptor, law.donor])
    return (Judgement(share, inside, r, added.length, added.least, added.most),
            Judgement(share, inside, np.stack(taken), both, both / (1 + law.bound), both * (1 + law.bound)))


def compared() -> Comparison:
    """The records of law and runs."""
    expected, measured = read_table(EXPECTED), read_table(TABLE)
    throat, _, in_range, example, *sides = (_by_throat(expected[name]) for name in EXPECTED_COLUMNS)
    law, least, most = np.reshape(sides, (len(QUANTITIES), 3, *throat.shape)).transpose(1, 2, 3, 0)
    number, run = throat[:, 0], np.full(law.shape, np.nan)
    _, rows = (measured["throat"][:, None] == number).nonzero()
    run[rows, np.searchsorted(TIMES, measured["time_h"])] = np.transpose([measured[name] for name in QUANTITIES])
    return Comparison(number.astype(int), in_range == 1, example, law, least, most, run)


def _by_throat(column: np.ndarray) -> np.ndarray:
    """(n, times) from the rows of EXPECTED, which are in order of time."""
    return column.reshape(len(TIMES), -1).T
