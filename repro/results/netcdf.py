"""The time series as NetCDF with CF conventions; reading it back gives the CSV table.

The coordinate is the simulated time in hours since the start of the run. It lacks the "since ..."
of a CF time axis, because simulated time has no date.
"""

from __future__ import annotations

import json
from importlib import import_module
from pathlib import Path

import numpy as np

from repro import results
from repro.results import names
from repro.scene import Scene

CONVENTIONS = "CF-1.11"
PACKAGE = "xarray"  # optional: a scene that asks for it is refused where it is not installed
TIME = "time_h"


def write(path: Path, scene: Scene, rows: list[list]) -> None:
    """Write ``rows`` of ``results.COLUMNS``; quantities that are not modelled are NaN."""
    xarray = import_module(PACKAGE)
    table = np.array(rows, dtype=float)  # None becomes NaN
    columns = dict(zip(results.COLUMNS, table.reshape(len(rows), len(results.COLUMNS)).T))
    variables = {name: (TIME, column, _attributes(name)) for name, column in columns.items()}
    times = {TIME: variables.pop(TIME)}
    content = xarray.Dataset(variables, times, _provenance(scene))
    encoding = {name: {"_FillValue": None if name == TIME else np.nan} for name in columns}
    content.to_netcdf(path.absolute(), engine="scipy", format="NETCDF3_64BIT", encoding=encoding)


def _attributes(name: str) -> dict[str, str]:
    return {"long_name": names.words(name), "units": names.udunits(name)}


def _provenance(scene: Scene) -> dict[str, str]:
    """Attributes of the whole file; the scene's tables and the versions as JSON."""
    record = results.provenance(scene)
    return {"Conventions": CONVENTIONS, "title": f"Clogging of one pore: {scene.name}",
            "source": f"dupin2001-repro {record['versions']['dupin2001-repro']}",
            "scene": scene.name, "scene_hash": record["hash"],
            "scene_tables": json.dumps(record["tables"]),
            "versions": json.dumps(record["versions"])}
