"""Jumps of reported quantities where a table of the scene jumps, for curves over time.

A row at a jump has the state just after it (:mod:`repro.march.loop`). A curve keeps the value of
the row before up to the jump.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from repro.model.transport_in_time import transport_in_time
from repro.scene.time_table import jump_times

DRIVEN = ("mean_velocity_m_per_d", "head_loss_cm", "flow_rate_uL_per_min")
#: Columns that jump with the flow, and with its forces if the aggregate bears them.
FORCES = (*(f"fluid_force_{axis}_{unit}" for axis in "xy" for unit in ("uN_per_m", "nN")),
          "fluid_moment_nN")
STRESSES = ("wall_traction_max_MPa", "tensile_stress_max_MPa")
#: Columns that jump with the flow and the supplies if substrates are quasi-steady.
CARRIED = tuple(f"{pattern}_mg_per_L" for name in ("acceptor", "donor")
                for pattern in (f"effluent_{name}", f"inlet_{name}", f"{name}_min",
                                f"{name}_overshoot"))
#: Rates that jump with them.
RATES = tuple(f"{rate}_{unit}" for rate in ("acceptor_uptake", "donor_uptake", "biomass_growth")
              for unit in ("ug_per_m_per_h", "pg_per_h"))


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
    flow = jump_times(tables.get("flow", {}))
    bears_forces = tables.get("growth", {}).get("fluid_forces") == "included"
    if name in (*DRIVEN, *FORCES) or name in STRESSES and bears_forces:
        return flow
    supplies = [jump_times(part) for part in tables.get("substrates", {}).values()
                if isinstance(part, dict)]
    times = sorted({*flow, *(time for times in supplies for time in times)})
    if name not in (*CARRIED, *RATES) or not times:
        return []
    return [] if transport_in_time(tables["numerics"]["transport"]).stores else times
