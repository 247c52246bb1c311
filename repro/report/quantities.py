"""What is drawn over time, of one run or of several."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from repro.report.charts import Chart, Line
from repro.report.reading import Run
from repro.results import names
from repro.results.columns import PARTS, SUBSTRATES
from repro.results.quantities import Quantity

#: Times (h) and values.
Course = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Kind:
    """A chart: its title, what stands at its axis before the unit, and the quantities drawn."""

    title: str
    what: str
    drawn: tuple[str, ...]

    @property
    def axis(self) -> str:
        """What is drawn, with its unit."""
        unit = names.unit(self.drawn[0])
        return f"{self.what} ({unit})" if unit else self.what


def _middle(run: Run) -> np.ndarray:
    return (run.ledger["start_h"] + run.ledger["end_h"]) / 2


def _rate(name: str, part: str) -> Quantity:
    """A part of a substrate's ledger over the length of the step, at its middle."""
    column = f"{name}_{part}_pg_per_m"

    def value(run: Run) -> Course:
        lengths = run.ledger["end_h"] - run.ledger["start_h"]
        return _middle(run), run.ledger[column] / lengths

    return Quantity(f"{name}_{part}_ug_per_m_per_h", f"{name} {PARTS[part][0]} in an hour",
                    f"{column} / (end_h - start_h), at the middle of the step", value,
                    PARTS[part][0], signed=True)


def _anew(run: Run) -> Course:
    made = run.series.get("remeshed", run.times * np.nan) == 1
    return run.times, np.where(made, run.series.get("nodes", np.nan), np.nan)


#: What is drawn besides the columns of the time series: value takes the run, and gives a course.
DERIVED = (
    *(_rate(name, part) for name in SUBSTRATES for part in PARTS),
    Quantity("biomass_held_ug_per_m", "biomass held", "biomass_after_pg_per_m, at the step's end",
             lambda run: (run.ledger["end_h"], run.ledger["biomass_after_pg_per_m"]), "held"),
    Quantity("biomass_made_ug_per_m", "biomass made since t = 0",
             "sum of biomass_made_pg_per_m up to the step's end",
             lambda run: (run.ledger["end_h"], np.cumsum(run.ledger["biomass_made_pg_per_m"])),
             "made since t = 0", signed=True),
    Quantity("remeshed_nodes", "nodes of a mesh made anew", "nodes, where remeshed is 1", _anew,
             "made anew"),
)
KNOWN = names.KNOWN | {each.name: each for each in DERIVED}


def _pair(pattern: str) -> tuple[str, ...]:
    """A quantity of both substrates, whose names go into the pattern."""
    return tuple(pattern.format(name) for name in SUBSTRATES)


def _ledger(name: str) -> Kind:
    """A chart of the rates of a substrate's ledger."""
    return Kind(f"Ledger: {name}", "rate",
                tuple(f"{name}_{part}_ug_per_m_per_h" for part in PARTS))


KINDS = (
    Kind("Conductivity", "conductivity", ("conductivity_m_per_d",)),
    Kind("Mean velocity", "velocity", ("mean_velocity_m_per_d",)),
    Kind("Head loss", "head", ("head_loss_cm",)),
    Kind("Effluents", "concentration", _pair("effluent_{}_mg_per_L")),
    Kind("Inlet of the meshed part", "concentration", _pair("inlet_{}_mg_per_L")),
    Kind("Least concentrations", "concentration", _pair("{}_min_mg_per_L")),
    Kind("Concentrations above the supply", "concentration", _pair("{}_overshoot_mg_per_L")),
    Kind("Area of the aggregate", "area", ("aggregate_area_um2",)),
    Kind("Extent of the aggregate", "length", ("thickness_um", "upstream_um", "downstream_um")),
    Kind("Inert part of the biomass", "inert over all", ("inert_fraction",)),
    Kind("Biomass density", "X / X_m", ("biomass_density_min", "biomass_density_max")),
    *map(_ledger, SUBSTRATES),
    Kind("Ledger: biomass", "biomass", ("biomass_held_ug_per_m", "biomass_made_ug_per_m")),
    Kind("Defects of the balances", "relative defect",
         (*_pair("{}_balance"), "biomass_balance", "oxygen_demand_balance")),
    Kind("Mesh", "nodes", ("nodes", "remeshed_nodes")),
)


def series(run: Run) -> dict[str, Course]:
    """Times (h) and values of everything that can be drawn of a run, by name.

    What the run does not model is left out, and storage where there is none.
    """
    found: dict[str, Course] = {name: (run.times, values) for name, values in run.series.items()}
    steps = len(run.ledger["end_h"]) if run.ledger else 0
    for each in DERIVED:
        if steps or each.name == "remeshed_nodes":
            times, values = each.value(run)
            found[each.name] = times, each.unit.factor * values
    return {name: (times, values) for name, (times, values) in found.items()
            if np.isfinite(values).any() and (values.any() or "_stored_" not in name)}


def charts_of(run: Run) -> list[Chart]:
    """The charts of one run; none of a run that has one row, which has nothing over time."""
    if len(run.times) < 2:
        return []
    known, marks = series(run), contact(run)
    found = []
    for kind in KINDS:
        lines = [_line(KNOWN[name].label, name, known) for name in kind.drawn if name in known]
        if lines:
            found.append(Chart(kind.title, kind.axis, lines, marks))
    return found


def overlaid(runs: Sequence[Run], labels: Sequence[str]) -> list[Chart]:
    """A chart for each quantity that changes in time in a run, a line a run."""
    known, found = [series(run) if len(run.times) > 1 else {} for run in runs], []
    for kind in KINDS:
        for name in kind.drawn:
            lines = [_line(one, name, each) for one, each in zip(labels, known)]
            title = kind.title if len(kind.drawn) == 1 else f"{kind.title}: {KNOWN[name].label}"
            if any(name in each for each in known):
                found.append(Chart(title, kind.axis, lines))
    return found


def _line(label: str, name: str, known: dict[str, Course]) -> Line:
    """The line of a quantity; one without points where it is not known.

    So each run keeps its colour.
    """
    times, values = known.get(name, (np.array([]), np.array([])))
    return Line(label, times, values, dots=name == "remeshed_nodes")


def contact(run: Run) -> list[float]:
    """When the aggregate is first seen to touch the opposite wall, h; empty while it does not."""
    return run.times[run.series.get("contact", run.times * 0) == 1][:1].tolist()
