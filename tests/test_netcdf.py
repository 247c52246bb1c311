"""The columns as NetCDF: equal to the CSV table, with CF's conventions, complete or absent."""
import json

import numpy as np
import pytest
import xarray

import repro
from repro import results
from repro.scene import load_scene, scene_hash, scene_tables
from tests.pages import run

SETS = ['numerics.preset="fast"', 'growth.end="1 h"', 'growth.time_step="1 min"', 'output.every="0.5 h"']
UNITS = {"m d-1", "mg L-1", "um2", "um", "cm", "h", "MPa", "uN m-1", "nN", "1"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return run(tmp_path_factory.mktemp("netcdf"), "base", *SETS)


def content(written, file):
    """The dataset that results write to a file."""
    written.to_netcdf(file)
    with xarray.open_dataset(file, engine="scipy") as dataset:
        return dataset.load()


def test_the_dataset_of_a_loaded_run_equals_its_table(folder, tmp_path):
    """Every column that the scene models agrees to the last bit; the others are not in the file. That of a run in
    memory is the same."""
    dataset = content(repro.load_run(folder), tmp_path / "mine.nc")
    table = results.read_table(folder / "timeseries.csv")
    modelled = {name: column for name, column in table.items() if not np.isnan(column).all()}
    assert set(dataset.variables) == set(modelled) and len(modelled) > 25 and len(table["time_h"]) > 2
    for name, column in modelled.items():
        assert dataset[name].dims == ("time_h",) and dataset[name].dtype == np.float64
        assert np.array_equal(dataset[name].to_numpy(), column, equal_nan=True), name
    assert content(repro.solve("base", SETS), str(tmp_path / "other.nc")).identical(dataset)


def test_the_dataset_names_scene_source_and_units(folder, tmp_path):
    dataset, scene = content(repro.load_run(folder), tmp_path / "mine.nc"), load_scene("base", SETS)
    assert dataset.attrs["Conventions"] == "CF-1.11" and dataset.attrs["scene"] == "base" and dataset.attrs["title"]
    assert dataset.attrs["status"] == "completed" and dataset.attrs["scene_hash"] == scene_hash(scene)
    assert dataset.attrs["source"] == f"dupin2001-repro {repro.__version__}"
    assert json.loads(dataset.attrs["scene_tables"]) == scene_tables(scene)
    assert json.loads(dataset.attrs["versions"])["numpy"] == np.__version__
    assert all(variable.attrs["long_name"] for variable in dataset.variables.values())
    assert dataset.mean_velocity_m_per_d.attrs == {"long_name": "mean velocity", "units": "m d-1"}
    assert dataset.time_h.attrs["units"] == "h" and "time_h" in dataset.coords


def test_columns_have_a_fill_value_and_time_has_none(folder, tmp_path):
    """CF forbids missing values of coordinates."""
    repro.load_run(folder).to_netcdf(tmp_path / "mine.nc")
    with xarray.open_dataset(tmp_path / "mine.nc", engine="scipy", decode_cf=False) as dataset:
        filled = {name for name in dataset.variables if "_FillValue" in dataset[name].attrs}
        assert filled == set(dataset.variables) - {"time_h"}


def test_results_without_a_scene_are_written(tmp_path):
    """Made by hand, with all columns, and with bytes that are no text in their status."""
    by_hand = repro.Results("mine", [dict.fromkeys(results.COLUMNS, 1.0)], [], "failed: \udcff")
    dataset = content(by_hand, tmp_path / "mine.nc")
    assert by_hand.to_xarray().attrs["status"] == by_hand.status
    assert {variable.attrs["units"] for variable in dataset.variables.values()} == UNITS
    assert dataset.attrs["status"] == "failed: \\udcff" and "versions" not in dataset.attrs
