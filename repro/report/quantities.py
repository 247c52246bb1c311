"""What is drawn over time, of one run or of several."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from repro.report.charts import Chart, Line
from repro.report.reading import Run

UG = 1e-6  # of pg


@dataclass(frozen=True)
class Kind:
    """A chart: what it shows, its axis, and (quantity, label) of its lines."""

    title: str
    axis: str
    lines: tuple[tuple[str, str], ...]


_BOTH = ("acceptor", "donor")
#: The parts of a substrate's ledger, and what the page calls them.
_PARTS = {"supplied": "supplied", "out": "leaving", "consumed": "taken up", "stored": "stored"}


def _concentrations(title: str, pattern: str) -> Kind:
    """A chart of both substrates, whose names go into the pattern of the quantity's."""
    return Kind(title, "concentration (mg/L)",
                tuple((pattern.format(name), name) for name in _BOTH))


def _ledger(name: str) -> Kind:
    """A chart of the rates of a substrate's ledger."""
    return Kind(f"Ledger: {name}", "ug per m of depth and h",
                tuple((f"{name}_{part}", words) for part, words in _PARTS.items()))


KINDS = (
    Kind("Conductivity", "conductivity (m/day)", (("conductivity_m_per_d", "conductivity"),)),
    Kind("Mean velocity", "velocity (m/day)", (("mean_velocity_m_per_d", "mean velocity"),)),
    Kind("Head loss", "head (cm)", (("head_loss_cm", "head loss"),)),
    _concentrations("Effluents", "effluent_{}_mg_per_L"),
    _concentrations("Inlet of the meshed part", "inlet_{}_mg_per_L"),
    _concentrations("Least concentrations", "{}_min_mg_per_L"),
    Kind("Area of the aggregate", "area (um²)", (("aggregate_area_um2", "area"),)),
    Kind("Extent of the aggregate", "length (um)",
         (("thickness_um", "thickness"), ("upstream_um", "upstream end"),
          ("downstream_um", "downstream end"))),
    Kind("Inert part of the biomass", "inert over all", (("inert_fraction", "inert part"),)),
    Kind("Biomass density", "X / X_m",
         (("biomass_density_min", "least"), ("biomass_density_max", "largest"))),
    *map(_ledger, _BOTH),
    Kind("Ledger: biomass", "ug per m of depth",
         (("biomass_held", "held"), ("biomass_made", "made since t = 0"))),
    Kind("Defects of the balances", "|defect|, relative",
         tuple((f"{name}_defect", name) for name in (*_BOTH, "biomass"))),
    Kind("Mesh", "nodes", (("nodes", "nodes"), ("remeshed_nodes", "made anew"))),
)


def series(run: Run) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Times (h) and values of everything that can be drawn of a run.

    What the run does not model is left out.
    """
    found = {name: (run.times, values) for name, values in run.series.items()}
    for name in (*_BOTH, "biomass"):
        defect = np.abs(run.series.get(f"{name}_balance", run.times * np.nan))
        defect = np.where(defect > 0, defect, np.nan)  # zero has no logarithm
        found[f"{name}_defect"] = (run.times, defect)
    nodes, remeshed = (run.series.get(name, run.times * np.nan) for name in ("nodes", "remeshed"))
    found["remeshed_nodes"] = (run.times, np.where(remeshed == 1, nodes, np.nan))
    found |= _from_ledger(run.ledger)
    return {name: (times, values) for name, (times, values) in found.items()
            if np.isfinite(values).any()}


def _from_ledger(ledger: dict[str, np.ndarray]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Rates at the middle of each step, and the biomass at its end.

    Storage only where there is some.
    """
    if not ledger or not len(ledger["end_h"]):
        return {}
    start, end = ledger["start_h"], ledger["end_h"]
    found = {"biomass_held": (end, UG * ledger["biomass_after_pg_per_m"]),
             "biomass_made": (end, UG * np.cumsum(ledger["biomass_made_pg_per_m"]))}
    for name, part in product(_BOTH, _PARTS):
        amount = UG * ledger[f"{name}_{part}_pg_per_m"]
        if part != "stored" or amount.any():
            found[f"{name}_{part}"] = ((start + end) / 2, amount / (end - start))
    return found


def charts_of(run: Run) -> list[Chart]:
    """The charts of one run; none of a run that has one row, which has nothing over time."""
    if len(run.times) < 2:
        return []
    known, marks = series(run), contact(run)
    found = []
    for kind in KINDS:
        lines = [_line(label, name, known) for name, label in kind.lines if name in known]
        if lines:
            found.append(Chart(kind.title, kind.axis, lines, marks))
    return found


def overlaid(runs: Sequence[Run], labels: Sequence[str]) -> list[Chart]:
    """A chart for each quantity that changes in time in a run, a line a run."""
    known, found = [series(run) if len(run.times) > 1 else {} for run in runs], []
    for kind in KINDS:
        for name, label in kind.lines:
            lines = [_line(one, name, each) for one, each in zip(labels, known)]
            title = kind.title if len(kind.lines) == 1 else f"{kind.title}: {label}"
            if any(name in each for each in known):
                found.append(Chart(title, kind.axis, lines))
    return found


def _line(label: str, name: str, known: dict) -> Line:
    """The line of a quantity; one without points where it is not known.

    So each run keeps its colour.
    """
    times, values = known.get(name, (np.array([]), np.array([])))
    return Line(label, times, values, dots=name == "remeshed_nodes")


def contact(run: Run) -> list[float]:
    """When the aggregate is first seen to touch the opposite wall, h; empty while it does not."""
    return run.times[run.series.get("contact", run.times * 0) == 1][:1].tolist()
