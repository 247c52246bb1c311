"""E20: the point that stays where it is."""

from __future__ import annotations

from verification.claims.runs import BASE, WIDE, at
from verification.errata import erratum, percent, table
from verification.switches import CHOICES, PLOTTED

RECHOSEN = CHOICES["rechosen"]
AGAIN = {BASE: RECHOSEN.run, WIDE: (*WIDE, RECHOSEN.change)}
COLUMNS = {"mean_velocity_m_per_d": "mean velocity, m/d", "conductivity_m_per_d": "conductivity, m/d",
           "upstream_um": "upstream, um", "downstream_um": "downstream, um", "aggregate_area_um2": "area, um2"}


@erratum(
    "E20", "which point of a contact surface stays",
    printed="""2.3.3 keeps the middle point of each contact surface fixed, and does not say whether that is the same
        material as the surface grows.""",
    reading="""The material point in the middle when the surface first forms (the origin, on the lower wall), for good.
        `numerics.fixed_point = "rechosen"` takes the node nearest to the present middle at every update.""",
    consequence="Rechosen against kept, where growth is nearly symmetric and where it is not:\n\n{table}")
def fixed_point() -> dict[str, str]:
    """Base at 19.2 h and wide at 45 h with both choices."""
    rows = []
    for run, time in ((BASE, PLOTTED), (WIDE, 45.0)):
        kept, rechosen = at(run, time), at(AGAIN[run], time)
        rows.append([f"{run[0]}, {time:g} h, kept (ours)", *(f"{kept[key]:.4g}" for key in COLUMNS)])
        moved = (f"{rechosen[key]:.4g} ({percent(rechosen[key] / kept[key], 1)})" for key in COLUMNS)
        rows.append([f"{run[0]}, {time:g} h, rechosen", *moved])
    return {"table": table(["", *COLUMNS.values()], rows)}
