"""K / K0 of pores against their biomass, with the usual laws for models on the Darcy scale.

K0 is the conductivity of the clean pore, g W^2 / (12 nu). B is the biomass per pore volume: the
area of the aggregates over W L. x = 1 - B is the porosity over that of the clean pore. A row of a
run is a point (B, K / K0).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from repro.model.flow import poiseuille_loss
from repro.results import M_PER_D, write_table
from repro.results.files import output_path
from repro.scene import load_scene
from repro.scene.arguments import typed

if TYPE_CHECKING:
    from repro.results.tables import Results


@dataclass(frozen=True, eq=False)
class Law:
    """A law of K / K0, which takes B and the constants.

    constants: symbol, first value of the fit and upper limit of each; all are above zero. The first
    values are typical of sand, and do not change where the fits of the tests end.
    """

    formula: str
    relative: Callable[..., np.ndarray]
    constants: tuple[tuple[str, float, float], ...] = ()


def _vandevivere(biomass: np.ndarray, critical: float, plug: float) -> np.ndarray:
    """critical: B beyond which biomass forms plugs; plug: K / K0 of plugs."""
    films = np.exp(-0.5 * (biomass / critical)**2)
    return films * (1 - biomass)**2 + (1 - films) * plug / (plug + biomass * (1 - plug))


#: By the name of their column; n0 is the porosity of the clean medium, and n0 x that of the pore.
LAWS = {
    "power": Law("x^b", lambda biomass, power: (1 - biomass)**power, (("b", 3.0, np.inf),)),
    "kozeny_carman": Law(
        "x^3 ((1 - n0) / (1 - n0 x))^2", lambda biomass, clean: (
            (1 - biomass)**3 * ((1 - clean) / (1 - clean * (1 - biomass)))**2),
        (("n0", 0.4, 1.0),)),
    "clement": Law("x^(19/6)", lambda biomass: (1 - biomass)**(19 / 6)),
    "okubo_matsumoto": Law("x^2", lambda biomass: (1 - biomass)**2),
    "vandevivere": Law("f x^2 + (1 - f) k / (k + B (1 - k)), f = exp(-(B / Bc)^2 / 2)",
                       _vandevivere, (("Bc", 0.1, np.inf), ("k", 1e-3, 1.0)))}


@dataclass(frozen=True)
class Fit:
    """A law with its constants by symbol, each with its standard error.

    rms: of ln(law / K * K0) over the rows; worst: the largest factor between both.
    """

    law: Law
    constants: dict[str, tuple[float, float]]
    rms: float
    worst: float

    def relative(self, biomass: np.ndarray) -> np.ndarray:
        """K / K0 at a biomass per pore volume."""
        return self.law.relative(biomass, *(value for value, _ in self.constants.values()))


@dataclass(frozen=True, eq=False)
class Permeability:
    """K / K0 of the rows of runs, and the laws that are fitted to it.

    Parameters
    ----------
    columns : dict of str to (n,) array
        ``run`` from 1, ``time_h``, ``biomass_per_pore_volume``, ``relative_porosity``,
        ``relative_permeability``, and the values of each law.
    fits : dict of str to Fit
        The laws by name. ``fits["power"].relative(biomass)`` evaluates one.
    """

    columns: dict[str, np.ndarray]
    fits: dict[str, Fit]

    @typed
    def to_csv(self, file: str | Path) -> None:
        """Write the columns to a CSV file. Raises OutputError if it cannot be written."""
        with output_path(Path(file)) as beside:
            write_table(beside, list(self.columns),
                        zip(*(values.tolist() for values in self.columns.values())))

    def __str__(self) -> str:
        biomass = self.columns["biomass_per_pore_volume"]
        relative = self.columns["relative_permeability"]
        lines = [f"K / K0 in {len(biomass)} rows, biomass per pore volume B of {biomass.min():.3g} "
                 f"to {biomass.max():.3g}, x = 1 - B, K / K0 of {relative.min():.3g} to "
                 f"{relative.max():.3g}"]
        for name, fit in self.fits.items():
            constants = "".join(f", {symbol} = {value:.4g} +- {error:.2g}"
                                for symbol, (value, error) in fit.constants.items())
            lines.append(f"{name}: {fit.law.formula}{constants}; error of ln K {fit.rms:.2g} (rms),"
                         f" at most a factor of {fit.worst:.3g}")
        return "\n".join(lines)


def of_runs(runs: Sequence[Results]) -> Permeability:
    """Fit the laws to the rows of runs. Raises KeyError and ValueError, as of `Results`."""
    tables = [(np.full(len(run.time), number), run.time, *_relative(run))
              for number, run in enumerate(runs, 1) if len(run.time)]
    number, time, biomass, relative = np.hstack(tables) if tables else np.zeros((4, 0))
    amounts = len(np.unique(biomass))
    if amounts < 3:  # Vandevivere's law has two constants, and an error needs one row more
        raise ValueError(f"permeability: rows with three amounts of biomass or more are needed, "
                         f"here are {amounts}")
    fits = {name: fitted(law, biomass, relative) for name, law in LAWS.items()}
    columns = {"run": number.astype(int), "time_h": time, "biomass_per_pore_volume": biomass,
               "relative_porosity": 1 - biomass, "relative_permeability": relative}
    laws = {name: fit.relative(biomass) for name, fit in fits.items()}
    return Permeability(columns | laws, fits)


def _relative(run: Results) -> tuple[np.ndarray, np.ndarray]:
    """B and K / K0 of the rows of a run."""
    scene = load_scene(dict(run.tables))
    flow, pore = scene.flow, scene.pore
    clean = flow.gravity / (flow.kinematic_viscosity * poiseuille_loss(1.0, pore.whole_width))
    biomass = run["aggregate_area_um2"] / (pore.width * pore.length)
    return biomass, run["conductivity_m_per_d"] / (M_PER_D * clean)


def fitted(law: Law, biomass: np.ndarray, relative: np.ndarray) -> Fit:
    """Fit the constants of a law to ln(K / K0); each row has the same weight."""
    def deviations(constants: np.ndarray) -> np.ndarray:
        return np.log(law.relative(biomass, *constants) / relative)

    values = errors = np.zeros(0)
    if law.constants:
        from scipy.optimize import least_squares  # its import takes a quarter of a second

        _, first, upper = zip(*law.constants)
        fit = least_squares(deviations, first, bounds=(0, upper), x_scale="jac")
        values = fit.x
        _, sizes, directions = np.linalg.svd(fit.jac, full_matrices=False)
        sizes = np.maximum(sizes, np.finfo(float).eps)  # it is 0 where the rows leave one open
        scatter = np.sqrt(2 * fit.cost / (len(biomass) - len(values)))
        errors = scatter * np.linalg.norm(directions.T / sizes, axis=1)
    pairs = zip(values.tolist(), errors.tolist())
    constants = {symbol: pair for (symbol, *_), pair in zip(law.constants, pairs)}
    remaining = deviations(values)
    return Fit(law, constants, float(np.sqrt(np.mean(remaining**2))),
               float(np.exp(np.abs(remaining).max())))
