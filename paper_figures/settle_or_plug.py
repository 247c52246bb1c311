"""Settle, oscillate or plug: growth against erosion by shear and against detachment, both drives. Not in the paper."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from paper_figures import states, style
from paper_figures.runs import FAST, Request
from verification.problems.hard import clean_conductivity

TITLE = "Addition. Settle, oscillate or plug"
CLAIMS = ()

#: Both drives, which are the same in the clean pore: the section [flow].
DRIVES = {"head": '{head="1e-3 cm"}', "velocity": '{mean_velocity="2.9 m/day"}'}
#: Supply of both substrates (mg/L): horizon (h), 12 over the growth rate of a small aggregate.
HORIZONS = {10: 60.0, 2: 120.0}
#: Coefficients of erosion by shear (um/(h Pa)), and strengths of the bond (Pa).
COEFFICIENTS, STRENGTHS = (5, 20, 80), (60, 20)
#: Definitions of docs/howto/settle_or_plug.md: a recovery, K / K_0 of a plug, and the change of a settled K.
RECOVERY, PLUG, SETTLED = 1.2, 0.05, 0.05
#: Ends (h) of runs that plug before the horizon: what follows costs a minute of processor time.
PLUGGED = {("velocity", 10, 5): 30.0, ("velocity", 10, 20): 40.0}
COLOURS = {"oscillates": style.SKY, "washes out": style.FLUID, "plugs": style.RED, "settles": style.BIOMASS,
           "undecided": "white"}
LINES = (style.BLACK, style.BLUE, style.RED)
#: Elements twice and a tolerance four times those of `fast`: most runs take 10 s.
BRIEF = (FAST, "numerics.refinement=0.1", "numerics.tolerance=0.03")


def _eroding(drive: str, supply: int, coefficient: int) -> Request:
    end = PLUGGED.get((drive, supply, coefficient), HORIZONS[supply])
    supplies = [f'substrates.{name}.supply="{supply} mg/L"' for name in ("acceptor", "donor")]
    return Request("base", (*BRIEF, f"flow={DRIVES[drive]}", f'growth.end="{end:g} h"', *supplies,
                            'growth.new_biomass="stress_free"', f'output.every="{HORIZONS[supply] / 12:g} h"',
                            f'growth.erosion={{law="shear", shear_coefficient="{coefficient} um/h/Pa"}}'),
                   f"eroding_{coefficient}_{supply}_{drive}")


def _detaching(drive: str, strength: int) -> Request:
    seeds = 'aggregate=[{radius="6 um", position="-50 um"}, {radius="4 um", position="50 um", wall="upper"}]'
    return Request("base", (*BRIEF, f"flow={DRIVES[drive]}", f'growth.end="{HORIZONS[10]:g} h"', seeds,
                            'growth.fluid_forces="included"', f'growth.bonding_strength="{strength} Pa"',
                            'growth.after_detachment="continue"', 'output.every="2 h"'),
                   f"detaching_{strength}_{drive}")


#: (drive, supply in mg/L, coefficient or strength) of all runs.
#: Those with k = 80 but one, and one of two alike that detach, were computed once, as the page says.
ERODING = tuple((drive, supply, k) for drive in DRIVES for supply in HORIZONS for k in COEFFICIENTS
                if k < 80 or (drive, supply) == ("head", 10))
DETACHING = (("head", 60), ("head", 20), ("velocity", 60))
LABELS = (*((drive, supply, f"k = {k}") for drive, supply, k in ERODING),
          *((drive, 10, f"{strength} Pa") for drive, strength in DETACHING))
RUNS = (*(_eroding(*key) for key in ERODING), *(_detaching(*key) for key in DETACHING))


def behaviour(hours: np.ndarray, share: np.ndarray, gone: bool, horizon: float) -> str:
    """The first behaviour whose criterion holds.

    Parameters
    ----------
    hours, share : (N,) array
        Times (h), and K / K_0 at these times.
    gone : bool
        Whether no aggregate is left at the end.
    horizon : float
        h.

    Returns
    -------
    str
        A key of ``COLOURS``.
    """
    recovered = share >= RECOVERY * np.minimum.accumulate(share)
    falls = np.minimum.accumulate(share[::-1])[::-1] <= share / RECOVERY
    last = share[hours >= horizon * 5 / 6]
    if (recovered & falls).any():
        return "oscillates"
    if gone:
        return "washes out"
    if share[-1] < PLUG:
        return "plugs"
    settled = hours[-1] >= horizon and last.max() <= (1 + SETTLED) * last.min()
    return "settles" if settled else "undecided"


def mean_share(hours: np.ndarray, share: np.ndarray) -> float:
    """Mean of K / K_0 over time in the second half of the run."""
    half = hours[-1] / 2
    late = hours > half
    times, values = np.append(half, hours[late]), np.append(np.interp(half, hours, share), share[late])
    return float(np.sum((values[1:] + values[:-1]) * np.diff(times)) / 2 / half)


@style.styled
def draw(*folders: Path) -> Figure:
    """Conductivities of the eroding runs by drive, of the detaching ones, and the behaviours with their means."""
    figure = style.figure(5.2)
    panels = figure.subplot_mosaic([["head", "velocity"], ["detaching", "behaviours"]])
    for drive in DRIVES:
        _eroded(panels[drive], drive, folders)
    panels["head"].legend(loc="lower left")
    _detached(panels["detaching"], folders)
    panels["detaching"].legend(loc="lower left")
    _behaviours(panels["behaviours"], folders)
    style.number_panels(*panels.values())
    return figure


def _eroded(axes: Axes, drive: str, folders: tuple[Path, ...]) -> None:
    """K / K_0 under erosion, against time over the horizon."""
    for (of_drive, supply, k), folder in zip(ERODING, folders):
        if of_drive == drive:
            hours, share = _course(folder)
            axes.plot(hours / HORIZONS[supply], share, {10: "-", 2: "--"}[supply], color=LINES[COEFFICIENTS.index(k)],
                      label=f"k = {k} µm/(h Pa)" if supply == 10 else None)
    axes.set(xlim=(0, 1), xlabel="time over the horizon", title=f"erosion, constant {drive} (dashed: 2 mg/L)")
    _share_axis(axes)


def _detached(axes: Axes, folders: tuple[Path, ...]) -> None:
    """K / K_0 with two aggregates that detach, against time."""
    for (drive, strength), folder in zip(DETACHING, folders[len(ERODING):]):
        hours, share = _course(folder)
        axes.plot(hours, share, {"head": "-", "velocity": "--"}[drive], color=LINES[STRENGTHS.index(strength)],
                  label=f"{strength} Pa" if drive == "head" else None)
    axes.set(xlim=(0, HORIZONS[10]), xlabel="time (h)", title="strength of the bond (dashed: constant velocity)")
    _share_axis(axes)


def _share_axis(axes: Axes) -> None:
    """K / K_0 on a logarithmic axis, with the bound of a plug."""
    axes.axhline(PLUG, color=style.FAINT, linewidth=0.8, linestyle=":")
    axes.set(yscale="log", ylim=(2e-3, 1.2), ylabel=r"conductivity, $K / K_0$")
    style.grid(axes)


def _behaviours(axes: Axes, folders: tuple[Path, ...]) -> None:
    """A cell for each run: its behaviour, and its K / K_0 in the mean and at the end."""
    rows = [(drive, supply) for drive in DRIVES for supply in HORIZONS]
    columns = [*(f"k = {k}" for k in COEFFICIENTS), *(f"{strength} Pa" for strength in STRENGTHS)]
    for (drive, supply, column), (name, mean, end) in zip(LABELS, judged(folders)):
        x, y = columns.index(column), rows.index((drive, supply))
        axes.add_patch(Rectangle((x, y), 1, 1, facecolor=COLOURS[name], edgecolor=style.WALL, linewidth=0.5))
        axes.text(x + 0.5, y + 0.5, f"{name}\n{mean:.2g}\n{end:.2g}", ha="center", va="center", fontsize=6.5,
                  color="white" if name == "plugs" else style.BLACK)
    axes.set(xlim=(0, len(columns)), ylim=(len(rows), 0), xticks=np.arange(len(columns)) + 0.5, xticklabels=columns,
             yticks=np.arange(len(rows)) + 0.5, yticklabels=[f"{drive}\n{supply} mg/L" for drive, supply in rows],
             title=r"behaviour; $K / K_0$, mean and at the end")


def _course(folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Times (h) and K / K_0 of all rows."""
    table = states.series(folder)
    return table["time_h"], table["conductivity_m_per_d"] / clean_conductivity(RUNS[0].load())


def judged(folders: tuple[Path, ...]) -> list[tuple[str, float, float]]:
    """Behaviour of each run, and its K / K_0 in the mean and at the end."""
    results = []
    for (_, supply, _), folder in zip(LABELS, folders):
        hours, share = _course(folder)
        name = behaviour(hours, share, _gone(folder), HORIZONS[supply])
        results.append((name, mean_share(hours, share), share[-1]))
    return results


def _gone(folder: Path) -> bool:
    """Whether no aggregate is left at the end."""
    return "is eroded" in states.status(folder) or not states.series(folder)["aggregate_area_um2"][-1] > 0


def caption(*folders: Path) -> str:
    """Caption, with the numbers of the behaviours and the means of each."""
    names = [name for name, *_ in judged(folders)]
    counts = ", ".join(f"{name} {names.count(name)}" for name in COLOURS)
    return ("The pore of Base, with growth against erosion by shear or against a bond of limited strength (preset "
            "`fast`, with larger elements and steps). K is divided by that of the clean pore. (a), (b) One seed that "
            "erodes by k times the shear of the water, at supplies of 10 mg/L (full, horizon 60 h) and 2 mg/L (dashed, "
            "120 h). (c) Two seeds that leave the pore where their wall must bear more than the strength. (d) The "
            "behaviour of each run, by the definitions of `docs/howto/settle_or_plug.md`, its mean K / K_0 in the "
            "second half of its time, and K / K_0 at its end. Number of runs by behaviour: "
            f"{counts}. Dotted: a plug, K / K_0 = {PLUG:g}. Runs that plug may end before the horizon.")
