"""Fields as ParaView, PyVista and this package read them, to the last bit. tests/test_derived.py tests their values.
"""

from dataclasses import replace

import numpy as np
import pytest
import pyvista

from repro import results
from repro.model import solving
from repro.results import field_files
from repro.scene import load_scene
from tests.pages import cached_run
from tests.strategies import EVERY_ORDER, arrays_of, coarse_base, same_arrays


@pytest.fixture
def written(order, tmp_path):
    """A pore with elements of an order at a time with many digits, its fields, and the file of the fields."""
    scene, seed = coarse_base(order)
    state = replace(seed, time=1 / 3)
    content = results.fields(scene, state, solving.solve(scene, state))
    field_files.write(tmp_path / "fields.vtu", content)
    return state, content, tmp_path / "fields.vtu"


def by_pyvista(path):
    """What PyVista reads, by the reader of VTK and ParaView."""
    grid = pyvista.read(path)
    shape = {"points": grid.points, "cells": grid.cell_connectivity.reshape(grid.n_cells, -1)}
    return {**shape, **grid.point_data, **grid.cell_data}, grid.field_data


def by_this_package(path):
    grid = field_files.read(path)
    return arrays_of(grid), {field_files.TIME: np.array([grid.time])}


@pytest.mark.parametrize("read", [by_pyvista, by_this_package])
@EVERY_ORDER
def test_every_reader_reads_what_was_computed(order, read, written):
    """Points, cells and the time agree, and each array has numbers of 64 bits."""
    state, computed, path = written
    arrays, field_data = read(path)
    assert same_arrays(arrays, arrays_of(computed)) and field_data["TimeValue"].tolist() == [state.time]
    assert {value.dtype for name, value in arrays.items() if name != "cells"} == {np.dtype(np.float64)}


@EVERY_ORDER
def test_middle_nodes_are_where_vtk_expects_them(order, written):
    """Each node is within a fifth of the longest side of VTK's node in the straight triangle."""
    grid = pyvista.read(written[-1])
    assert {*grid.celltypes} == {pyvista.CellType.TRIANGLE if order == 1 else pyvista.CellType.QUADRATIC_TRIANGLE}
    parameters = np.reshape(grid.GetCell(0).GetParametricCoords(), (-1, 3))[:, :2]
    nodes = grid.points[by_pyvista(written[-1])[0]["cells"]]
    straight = np.column_stack([1 - parameters.sum(axis=1), parameters]) @ nodes[:, :3]
    longest = np.linalg.norm(nodes[:, :3] - nodes[:, [1, 2, 0]], axis=2).max(axis=1)
    assert (np.linalg.norm(nodes - straight, axis=2) < 0.2 * longest[:, None]).all()


def test_the_index_has_every_time_and_its_file():
    """Times keep every digit."""
    folder = cached_run(load_scene("base", ["growth.end=1 h", 'output.times=["0 h", "20 min", "1 h"]']))
    reader = pyvista.get_reader(folder / "fields.pvd")
    assert reader.time_values == results.read_table(folder / "timeseries.csv")["time_h"].tolist() == [0.0, 1 / 3, 1.0]
    assert [each.path for each in reader.datasets] == [f"fields/fields_000{k}.vtu" for k in range(3)]
