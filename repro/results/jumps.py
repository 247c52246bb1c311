"""Jumps of reported quantities where a table of the scene jumps, for curves over time.

A row at a jump has the state just after it (:mod:`repro.march.loop`). A curve keeps the value of
the row before up to the jump.
"""

from collections.abc import Mapping

import numpy as np

from repro.model.transport_in_time import transport_in_time
from repro.results.names import known
from repro.scene.time_table import jump_times


def with_jumps(name: str, times: np.ndarray, values: np.ndarray,
               tables: Mapping[str, dict]) -> tuple[np.ndarray, np.ndarray]:
    """Return times (h) and values of a column with two points at each of its jumps.

    tables: the tables of the scene, whose values have units.
    """
    quantity = known(name)
    causes = quantity.jumps if quantity else ""
    jumps = jump_times(tables.get("flow", {})) if causes else []
    if "forces" in causes and tables.get("growth", {}).get("fluid_forces") != "included":
        jumps = []
    if "substrates" in causes:
        for part in tables.get("substrates", {}).values():
            jumps += jump_times(part) if isinstance(part, dict) else []
        if jumps and transport_in_time(tables["numerics"]["transport"]).stores:
            jumps = []
    for jump in sorted(set(jumps)):
        after = int(np.searchsorted(times, jump))
        if 0 < after < len(times):
            exact = times[after] == jump
            added = [values[after - 1]] if exact else [values[after - 1], values[after]]
            times = np.insert(times, after, [jump] * len(added))
            values = np.insert(values, after, added)
    return times, values
