"""Jumps of reported quantities where a table of the scene jumps, for curves over time.

A row at a jump has the values after it. A curve keeps the value of the row before up to the jump.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np

#: Columns that jump with the flow.
DRIVEN = ("mean_velocity_m_per_d", "head_loss_cm", "fluid_force_x_uN_per_m",
          "fluid_force_y_uN_per_m", "fluid_moment_nN")
#: Columns that jump with the flow and the supplies if substrates are quasi-steady.
CARRIED = tuple(f"{pattern}_mg_per_L" for name in ("acceptor", "donor")
                for pattern in (f"effluent_{name}", f"inlet_{name}", f"{name}_min",
                                f"{name}_overshoot"))


def with_jumps(name: str, times: np.ndarray, values: np.ndarray,
               tables: Mapping[str, dict]) -> tuple[np.ndarray, np.ndarray]:
    """Return times (h) and values of a column with two points at each of its jumps.

    tables: the tables of the scene, whose values have units.
    """
    for jump in _jumps(name, tables):
        after = int(np.searchsorted(times, jump))
        if 0 < after < len(times):
            exact = times[after] == jump
            added = [values[after - 1]] if exact else [values[after - 1], values[after]]
            times = np.insert(times, after, [jump] * len(added))
            values = np.insert(values, after, added)
    return times, values


def _jumps(name: str, tables: Mapping[str, dict]) -> list[float]:
    """The times (h) at which a column jumps."""
    flow = _times(tables.get("flow", {}))
    if name in DRIVEN:
        return flow
    at_rest = tables.get("numerics", {}).get("transport") == "quasi_steady"
    if name not in CARRIED or not at_rest:
        return []
    supplies = [_times(part) for part in tables.get("substrates", {}).values()
                if isinstance(part, dict)]
    return sorted({*flow, *(time for times in supplies for time in times)})


def _times(section: dict) -> list[float]:
    """The times (h) of the jumps in the tables over time of a section."""
    if section.get("interpolation") != "steps":
        return []
    lists = [section[key] for key in ("head", "mean_velocity", "supply")
             if isinstance(section.get(key), list)]
    return sorted({float(later[0].split()[0]) for entries in lists
                   for earlier, later in pairwise(entries) if earlier[1] != later[1]})
