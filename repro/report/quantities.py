"""The charts over time of one run or of several runs."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from repro.report.charts import MOST_POINTS, Chart, Line
from repro.report.reading import Run
from repro.results import names
from repro.results.columns import BODY, PARTS, SUBSTRATES
from repro.results.jumps import with_jumps
from repro.results.quantities import Quantity

#: Times (h) and values.
TimeSeries = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Kind:
    """A chart over time.

    Parameters
    ----------
    title : str
        Title of the chart.
    axis_name : str
        Name of the vertical axis, without the unit.
    drawn : tuple of str
        Names of the columns that it draws, all in the same unit.
    of_mesh : bool, optional
        Whether it shows the mesh and its numerics, not the pore.

    Examples
    --------
    >>> from repro.report.charts import Line
    >>> from repro.report.quantities import Kind
    >>> kind = Kind("Stress", "stress", ("wall_traction_max_MPa",))
    >>> chart = kind.chart("Stress", [Line("wall traction", [0.0, 1.0], [0.0, 2e-6])])
    >>> chart.axis, chart.lines[0].values.tolist()
    ('stress (Pa)', [0.0, 2.0])
    """

    title: str
    axis_name: str
    drawn: tuple[str, ...]
    of_mesh: bool = False

    def chart(self, title: str, lines: Sequence[Line], marks: Sequence[float] = ()) -> Chart:
        """Make the chart of lines in the unit of the columns; it shows a readable unit."""
        symbol, factor = names.readable_unit(self.drawn[0], [line.values for line in lines])
        axis = f"{self.axis_name} ({symbol})" if symbol else self.axis_name
        scaled = [replace(line, values=factor * np.asarray(line.values)) for line in lines]
        return Chart(title, axis, scaled, marks, self.of_mesh)


def mean_rates(start: np.ndarray, end: np.ndarray, amounts: np.ndarray) -> TimeSeries:
    """Return the mean rates of steps, from start to end (n,) h, as a staircase.

    Each step has two points, at its start and at its end. More than MOST_POINTS / 2 steps are
    merged to that many, with their common means.
    """
    count = min(len(start), MOST_POINTS // 2)
    first = np.linspace(0, len(start), count, endpoint=False).astype(int)
    start = start[first]
    end = np.append(start[1:], end[-1])
    rates = np.add.reduceat(amounts, first) / (end - start)
    return np.column_stack([start, end]).ravel(), np.repeat(rates, 2)


#: Quantities besides the columns of the time series, by their names; ``value`` maps a run to a
#: TimeSeries.
DERIVED = {each.name: each for each in (
    *(Quantity(f"{name}_{part}_ug_per_m_per_h", f"{name} {label} in an hour",
               f"{name}_{part}_pg_per_m / (end_h - start_h), from the start to the end of the step",
               lambda run, column=f"{name}_{part}_pg_per_m": mean_rates(
                   run.ledger["start_h"], run.ledger["end_h"], run.ledger[column]),
               label, signed=True)
      for name in SUBSTRATES for part, (label, _) in PARTS.items()),
    Quantity("biomass_held_ug_per_m", "biomass of the aggregate",
             "biomass_after_pg_per_m, at the step's end",
             lambda run: (run.ledger["end_h"], run.ledger["biomass_after_pg_per_m"]),
             "in the aggregate"),
    Quantity("biomass_made_ug_per_m", "biomass made since t = 0",
             "sum of biomass_made_pg_per_m up to the step's end",
             lambda run: (run.ledger["end_h"], np.cumsum(run.ledger["biomass_made_pg_per_m"])),
             "made since t = 0", signed=True),
)}


def _pair(pattern: str) -> tuple[str, ...]:
    """Return the names of a quantity of both substrates, by a pattern."""
    return tuple(pattern.format(name) for name in SUBSTRATES)


KINDS = (
    Kind("Conductivity", "conductivity", ("conductivity_m_per_d",)),
    Kind("Mean velocity", "velocity", ("mean_velocity_m_per_d",)),
    Kind("Head loss", "head", ("head_loss_cm",)),
    Kind("Effluents", "concentration", _pair("effluent_{}_mg_per_L")),
    Kind("Inlet of the meshed part", "concentration", _pair("inlet_{}_mg_per_L"), True),
    Kind("Least concentrations", "concentration", _pair("{}_min_mg_per_L")),
    Kind("Concentrations above the supply", "concentration", _pair("{}_overshoot_mg_per_L")),
    Kind("Area of the aggregate", "area", ("aggregate_area_um2",)),
    Kind("Extent of the aggregate", "length", ("thickness_um", "upstream_um", "downstream_um")),
    Kind("Inert part of the biomass", "inert over all", ("inert_fraction",)),
    Kind("Biomass density", "X / X_m", ("biomass_density_min", "biomass_density_max")),
    Kind("Stress that could detach the aggregate", "stress",
         ("wall_traction_max_MPa", "tensile_stress_max_MPa")),
    Kind("Force of the fluid on the aggregate", "force",
         ("fluid_force_x_uN_per_m", "fluid_force_y_uN_per_m")),
    Kind("Uptake and growth", "rate",
         (*_pair("{}_uptake_ug_per_m_per_h"), "biomass_growth_ug_per_m_per_h")),
    *(Kind(f"Ledger: {name}", "rate", tuple(f"{name}_{part}_ug_per_m_per_h" for part in PARTS))
      for name in SUBSTRATES),
    Kind("Ledger: biomass", "biomass", ("biomass_held_ug_per_m", "biomass_made_ug_per_m")),
    Kind("Defects of the balances", "relative defect",
         (*_pair("{}_balance"), "biomass_balance", "oxygen_demand_balance"), True),
    Kind("Mesh", "nodes", ("nodes",), True),
)


def kinds(drawable: Iterable[str]) -> list[Kind]:
    """Return the charts of columns: ``KINDS``, and those that compare aggregates.

    A quantity of each aggregate has a chart unless it is a coordinate.
    """
    of_bodies = [Kind(f"Each aggregate: {quantity.words}", quantity.label,
                      tuple(name for name in drawable if names.label_in(name, quantity)))
                 for quantity in BODY if not quantity.name.endswith(names.COORDINATES)]
    return [*KINDS, *(kind for kind in of_bodies if kind.drawn)]


def series(run: Run) -> dict[str, TimeSeries]:
    """Return times (h) and values of all quantities of a run that can be drawn, by name.

    Quantities that the run does not model are left out, and so is zero storage.
    """
    drawable = {name: with_jumps(name, run.times, values, run.record["tables"])
                for name, values in run.series.items()}
    for quantity in DERIVED.values() if len(run.ledger.get("end_h", ())) else ():
        times, values = quantity.value(run)
        drawable[quantity.name] = times, quantity.unit.factor * values
    return {name: (times, values) for name, (times, values) in drawable.items()
            if np.isfinite(values).any() and (values.any() or "_stored_" not in name)}


def charts_of(run: Run) -> list[Chart]:
    """Make the charts of one run; none for a single row.

    A chart needs a quantity that changes. A quantity that is zero throughout is not drawn. A chart
    with one of several lines has its label in the title.
    """
    drawable = series(run) if len(run.times) > 1 else {}
    drawn = []
    for kind in kinds(drawable):
        lines = [_line(_named(name).label, name, drawable) for name in kind.drawn
                 if name in drawable]
        if all(line.constant for line in lines):
            continue
        lines = [line for line in lines if np.nan_to_num(line.values).any()]
        one_of_several = len(lines) == 1 < len(kind.drawn)
        title = f"{kind.title}: {lines[0].label}" if one_of_several else kind.title
        drawn.append(kind.chart(title, lines, contact(run)))
    return drawn


def _named(name: str) -> Quantity:
    """Return the quantity of a name; an unknown name is its own words."""
    return (DERIVED.get(name) or names.known(name)
            or Quantity(name, names.words(name), "", None, names.words(name)))


def overlaid(runs: Sequence[Run], labels: Sequence[str]) -> list[Chart]:
    """Make a chart for each quantity, with one line for each run."""
    by_run, overlays = [series(run) if len(run.times) > 1 else {} for run in runs], []
    drawable = dict.fromkeys(name for each in by_run for name in each)
    for kind in kinds(drawable):
        for name in (name for name in kind.drawn if name in drawable):
            lines = [_line(label, name, each) for label, each in zip(labels, by_run)]
            more = f": {_named(name).label}" if len(kind.drawn) > 1 else ""
            overlays.append(kind.chart(kind.title + more, lines))
    return overlays


def _line(label: str, name: str, drawable: dict[str, TimeSeries]) -> Line:
    """Make the line of a quantity. An unknown one has no points: each run keeps its colour."""
    times, values = drawable.get(name, (np.array([]), np.array([])))
    return Line(label, times, values)


def contact(run: Run) -> list[float]:
    """Time (h) of the first row in which the aggregate touches the opposite wall; empty if none."""
    return run.times[run.series.get("contact", run.times * 0) == 1][:1].tolist()
