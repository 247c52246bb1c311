"""Results as NetCDF with CF conventions; reading the file gives the columns to the last bit.

The coordinate is the simulated time in hours since the start of the run. It lacks the "since ..."
of a CF time axis, because simulated time has no date.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from repro.errors import printable
from repro.results.files import output_path

CONVENTIONS = "CF-1.11"
TIME = "time_h"


def write(path: Path, dataset: Any, tables: Mapping[str, dict],
          provenance: Mapping[str, Any]) -> None:
    """Write a dataset over TIME with its scene.

    tables: of the scene; provenance: its hash and the versions of the packages, empty if unknown.
    Raises OutputError if the file cannot be written.
    """
    about = {"Conventions": CONVENTIONS, "title": f"Clogging of one pore: {dataset.scene}",
             "status": printable(dataset.status), "scene_tables": json.dumps(tables)}
    if provenance:
        versions = provenance["versions"]
        about |= {"source": f"dupin2001-repro {versions['dupin2001-repro']}",
                  "scene_hash": provenance["hash"], "versions": json.dumps(versions)}
    encoding = {name: {"_FillValue": None if name == TIME else np.nan}
                for name in dataset.variables}
    with output_path(path) as beside:
        dataset.astype(float).assign_attrs(about).to_netcdf(
            beside.absolute(), engine="scipy", format="NETCDF3_64BIT", encoding=encoding)
