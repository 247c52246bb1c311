"""The time series as NetCDF: equal to the CSV table, with CF's conventions, whole or not at all."""
import json

import numpy as np
import pytest
import xarray

import repro
from repro import results
from repro.scene import load_scene, rules, scene_hash, scene_tables
from tests.pages import run
from tests.shell import flags, refused, stopped

SETS = ['numerics.preset="fast"', 'growth.end="1 h"', 'growth.time_step="1 min"', 'output.timeseries="netcdf"']
UNITS = {"m d-1", "mg L-1", "um2", "um", "cm", "h", "1"}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return run(tmp_path_factory.mktemp("netcdf"), "base", *SETS)


def content(out):
    with xarray.open_dataset(out / "timeseries.nc", engine="scipy") as found:
        return found.load()


def test_it_is_the_table(made):
    """Every column to the last bit."""
    found, table = content(made), results.read_table(made / "timeseries.csv")
    assert set(found.variables) == set(table) == set(results.COLUMNS) and len(table["time_h"]) > 2
    for name, column in table.items():
        assert found[name].dims == ("time_h",) and found[name].dtype == np.float64
        assert np.array_equal(found[name].to_numpy(), column, equal_nan=True), name


def test_it_says_what_it_is(made):
    found, loaded = content(made), load_scene("base", SETS)
    assert found.attrs["Conventions"] == "CF-1.11" and found.attrs["scene"] == "base" and found.attrs["title"]
    assert found.attrs["scene_hash"] == scene_hash(loaded)
    assert found.attrs["source"] == f"dupin2001-repro {repro.__version__}"
    assert json.loads(found.attrs["scene_tables"]) == scene_tables(loaded)
    assert json.loads(found.attrs["versions"])["numpy"] == np.__version__
    assert {variable.attrs["units"] for variable in found.variables.values()} == UNITS
    assert all(variable.attrs["long_name"] for variable in found.variables.values())
    assert found.mean_velocity_m_per_d.attrs == {"long_name": "mean velocity", "units": "m d-1"}
    assert found.time_h.attrs["units"] == "h" and "time_h" in found.coords


def test_that_of_a_run_that_was_stopped_is_its_table(tmp_path):
    stopped(load_scene("base", SETS), tmp_path, after=2)
    assert (tmp_path / "timeseries.nc").exists()
    assert np.array_equal(content(tmp_path).time_h, results.read_table(tmp_path / "timeseries.csv")["time_h"])


def test_without_xarray_it_is_refused_before_the_run(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(rules, "find_spec", lambda name: None)
    line = refused(tmp_path, capsys, "run", "base", *flags(*SETS), "--out", tmp_path / "run")
    assert 'output.timeseries = "netcdf"' in line and "pip install xarray" in line
    assert not (run(tmp_path, "flow_only") / "timeseries.nc").exists()
