"""Mesh and time-step independence of `base`, and the strict variant of 2001 beside it."""

from __future__ import annotations

from dataclasses import dataclass

from verification.claims import PaperCheck, at_most
from verification.claims.evaluate import side_by_side
from verification.claims.levels import DEFAULT, forget
from verification.claims.runs import BASE, LAST, at

TIMES = (0.0, 19.2, 19.4)
NUMBERS = {"mean velocity (m/d)": "mean_velocity_m_per_d", "effluent acceptor (mg/L)": "effluent_acceptor_mg_per_L",
           "effluent donor (mg/L)": "effluent_donor_mg_per_L", "inlet acceptor (mg/L)": "inlet_acceptor_mg_per_L",
           "area (um2)": "aggregate_area_um2", "thickness (um)": "thickness_um", "inert fraction": "inert_fraction",
           "meshed length (um)": "meshed_length_um"}


def _changed(*changes: str) -> tuple[str, ...]:
    return (*BASE, *changes, LAST)


#: Element sizes twice, once and half those of base; steps likewise; the scheme of 2001.
MESHES = {"size 2": _changed("numerics.refinement=0.5"), "size 1": BASE, "size 1/2": _changed("numerics.refinement=2")}
UPDATES = {"24 min": _changed('growth.time_step="24 min"'), "12 min": BASE,
           "6 min": _changed('growth.time_step="6 min"')}
STRICT = _changed('numerics.transport="gear"', 'numerics.transfer="linear"', 'numerics.inlet="mean"')
VARIANTS = {"base": BASE, "strict": STRICT}
RUNS = tuple(dict.fromkeys([STRICT, *reversed(MESHES.values()), *UPDATES.values()]))


@dataclass(frozen=True)
class Comparison:
    """Base's numbers in several runs: names of the runs, and lines (quantity, their values, differences in percent of
    each value from the one before)."""

    title: str
    runs: tuple[str, ...]
    lines: tuple[tuple[str, tuple[float, ...], tuple[float, ...]], ...]


Rows = dict[tuple[str, ...], dict[float, dict[str, float]]]


def compare(title: str, runs: dict[str, tuple[str, ...]], rows: Rows) -> Comparison:
    """Every number at every time in every run."""
    lines = [_line(f"{name}, t = {time:g} h", [rows[run][time][column] for run in runs.values()])
             for time in TIMES for name, column in NUMBERS.items()]
    return Comparison(title, tuple(runs), tuple(lines))


def _line(name: str, values: list[float]):
    moved = tuple(100 * (b / a - 1) if a else 0.0 for a, b in zip(values, values[1:]))
    return name, tuple(values), moved


def rows_of(run: tuple[str, ...]) -> dict[float, dict[str, float]]:
    """The rows of a run at TIMES."""
    found = {time: at(run, time) for time in TIMES}
    forget(DEFAULT)
    return found


def computed() -> Rows:
    """The rows of all runs, a run a process."""
    return dict(zip(RUNS, side_by_side(rows_of, list(RUNS))))


def comparisons(rows: Rows) -> tuple[Comparison, ...]:
    """Three mesh sizes, three time steps, and the strict variant against base."""
    return (compare("Three mesh sizes, in those of base", MESHES, rows),
            compare("Three steps between shape updates", UPDATES, rows),
            compare("The strict variant of 2001 (gear, linear transfer, u_ave in (11)) against base", VARIANTS, rows))


def checks(rows: Rows) -> tuple[PaperCheck, ...]:
    """Halving the time step moves the velocity by less than 0.5 %, halving the mesh size by less than 1 %."""
    return tuple(_halved(what, runs, time, bound, rows) for time in TIMES
                 for what, runs, bound in (("time step", UPDATES, 0.5), ("mesh size", MESHES, 1.0)))


def _halved(what: str, runs: dict[str, tuple[str, ...]], time: float, bound: float, rows: Rows) -> PaperCheck:
    before, after = (rows[run][time]["mean_velocity_m_per_d"] for run in list(runs.values())[1:])
    return at_most(f"halving the {what} moves the velocity at {time:g} h (%)", f"< {bound:g}",
                   100 * abs(after / before - 1), bound, "set beforehand")
