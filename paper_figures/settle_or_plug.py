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
COLOURS = {"oscillates": style.SKY, "washes out": style.FLUID, "plugs": style.RED, "settles": style.BIOMASS,
           "undecided": "white"}
#: A sixth of the elements of `accurate`, and steps about twice those of `fast`: a run takes some 10 s.
BRIEF = (FAST, "numerics.refinement=0.1", "numerics.tolerance=0.03")


def _eroding(drive: str, supply: int, coefficient: int) -> Request:
    end = HORIZONS[supply]
    supplies = [f'substrates.{name}.supply="{supply} mg/L"' for name in ("acceptor", "donor")]
    return Request("base", (*BRIEF, f"flow={DRIVES[drive]}", f'growth.end="{end:g} h"', *supplies,
                            'growth.new_biomass="stress_free"', f'output.every="{end / 12:g} h"',
                            f'growth.erosion={{law="shear", shear_coefficient="{coefficient} um/h/Pa"}}'),
                   f"eroding_{coefficient}_{supply}_{drive}")


def _detaching(drive: str, strength: int) -> Request:
    seeds = 'aggregate=[{radius="6 um", position="-50 um"}, {radius="4 um", position="50 um", wall="upper"}]'
    return Request("base", (*BRIEF, f"flow={DRIVES[drive]}", f'growth.end="{HORIZONS[10]:g} h"', seeds,
                            'growth.fluid_forces="included"', f'growth.bonding_strength="{strength} Pa"',
                            'growth.after_detachment="continue"', 'output.every="2 h"'),
                   f"detaching_{strength}_{drive}")


#: (drive, supply in mg/L, coefficient or strength) of all runs.
ERODING = tuple((drive, supply, k) for drive in DRIVES for supply in HORIZONS for k in COEFFICIENTS)
DETACHING = tuple((drive, strength) for drive in DRIVES for strength in STRENGTHS)
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
