"""Jumps of reported quantities where a table of the scene jumps, for curves over time.

A row at a jump has the state just after it (:mod:`repro.march.loop`). A curve keeps the value of
the row before up to the jump.
"""

import re
from collections.abc import Mapping

import numpy as np

from repro.model.transport_in_time import transport_in_time
from repro.scene.time_table import jump_times

#: Columns that jump with the flow, and with its forces if the aggregate bears them.
DRIVEN = re.compile("mean_velocity_m_per_d|head_loss_cm|flow_rate_uL_per_min|fluid_moment_nN|"
                    "fluid_force_[xy]_(uN_per_m|nN)")
STRESSES = ("wall_traction_max_MPa", "tensile_stress_max_MPa")
#: Columns that jump with the flow and the supplies if substrates are quasi-steady.
CARRIED = re.compile("((effluent|inlet)_(acceptor|donor)|(acceptor|donor)_(min|overshoot))_mg_per_L"
                     "|(acceptor_uptake|donor_uptake|biomass_growth)_(ug_per_m_per_h|pg_per_h)")
def with_jumps(name: str, times: np.ndarray, values: np.ndarray,
               tables: Mapping[str, dict]) -> tuple[np.ndarray, np.ndarray]:
    """Return times (h) and values of a column with two points at each of its jumps.

    tables: the tables of the scene, whose values have units.
    """
    jumps = jump_times(tables.get("flow", {}))
    bears_forces = tables.get("growth", {}).get("fluid_forces") == "included"
    if not DRIVEN.fullmatch(name) and not (name in STRESSES and bears_forces):
        for part in tables.get("substrates", {}).values():
            jumps += jump_times(part) if isinstance(part, dict) else []
        if not CARRIED.fullmatch(name) or jumps and transport_in_time(
                tables["numerics"]["transport"]).stores:
            jumps = []
    for jump in sorted(set(jumps)):
        after = int(np.searchsorted(times, jump))
        if 0 < after < len(times):
            exact = times[after] == jump
            added = [values[after - 1]] if exact else [values[after - 1], values[after]]
            times = np.insert(times, after, [jump] * len(added))
            values = np.insert(values, after, added)
    return times, values
