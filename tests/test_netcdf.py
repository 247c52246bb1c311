"""The time series as NetCDF: equal to the CSV table, with CF's conventions, complete or absent."""
import json

import numpy as np
import pytest
import xarray

import repro
from repro import results
from repro.results import netcdf
from repro.scene import load_scene, rules, scene_hash, scene_tables
from tests.pages import run
from tests.shell import flags, interrupt_run, refusal

SETS = ['numerics.preset="fast"', 'growth.end="1 h"', 'growth.time_step="1 min"', 'output.timeseries="netcdf"']
UNITS = {"m d-1", "mg L-1", "um2", "um", "cm", "h", "MPa", "uN m-1", "nN", "1"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return run(tmp_path_factory.mktemp("netcdf"), "base", *SETS)


def content(out):
    with xarray.open_dataset(out / "timeseries.nc", engine="scipy") as dataset:
        return dataset.load()


def test_the_dataset_equals_the_table(folder):
    """Every column agrees to the last bit."""
    dataset, table = content(folder), results.read_table(folder / "timeseries.csv")
    assert set(dataset.variables) == set(table) == set(results.COLUMNS) and len(table["time_h"]) > 2
    for name, column in table.items():
        assert dataset[name].dims == ("time_h",) and dataset[name].dtype == np.float64
        assert np.array_equal(dataset[name].to_numpy(), column, equal_nan=True), name


def test_the_dataset_names_scene_source_and_units(folder):
    dataset, scene = content(folder), load_scene("base", SETS)
    assert dataset.attrs["Conventions"] == "CF-1.11" and dataset.attrs["scene"] == "base" and dataset.attrs["title"]
    assert dataset.attrs["scene_hash"] == scene_hash(scene)
    assert dataset.attrs["source"] == f"dupin2001-repro {repro.__version__}"
    assert json.loads(dataset.attrs["scene_tables"]) == scene_tables(scene)
    assert json.loads(dataset.attrs["versions"])["numpy"] == np.__version__
    assert {variable.attrs["units"] for variable in dataset.variables.values()} == UNITS
    assert all(variable.attrs["long_name"] for variable in dataset.variables.values())
    assert dataset.mean_velocity_m_per_d.attrs == {"long_name": "mean velocity", "units": "m d-1"}
    assert dataset.time_h.attrs["units"] == "h" and "time_h" in dataset.coords


def test_the_dataset_of_a_stopped_run_equals_its_table(tmp_path):
    interrupt_run(load_scene("base", SETS), tmp_path, after=2)
    assert (tmp_path / "timeseries.nc").exists()
    assert np.array_equal(content(tmp_path).time_h, results.read_table(tmp_path / "timeseries.csv")["time_h"])


def test_netcdf_without_xarray_is_refused_before_the_run(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(rules, "find_spec", lambda name: None)
    line = refusal(tmp_path, capsys, "run", "base", *flags(*SETS), "--out", tmp_path / "run")
    assert 'output.timeseries = "netcdf"' in line and "pip install xarray" in line
    assert not (run(tmp_path, "flow_only") / "timeseries.nc").exists()


def test_columns_have_a_fill_value_and_time_has_none(tmp_path):
    """CF forbids missing values of coordinates."""
    scene = load_scene("flow_only")
    netcdf.write(tmp_path / "timeseries.nc", scene, [[0.0] * len(results.COLUMNS)])
    with xarray.open_dataset(tmp_path / "timeseries.nc", engine="scipy", decode_cf=False) as dataset:
        filled = {name for name in dataset.variables if "_FillValue" in dataset[name].attrs}
    assert filled == set(results.COLUMNS) - {"time_h"}
