"""The fields as ParaView and PyVista read them: through VTK's own reader, meshio's and PyVista's."""
from functools import cache
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest
import pyvista
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

from repro import results
from repro.scene import load_scene
from tests.pages import whole_of
from tests.strategies import ORDERS, arrays_of, same_arrays
from tests.test_derived import derived_arrays, late

TRIANGLE, QUADRATIC_TRIANGLE = 5, 22
EVERY_ORDER = pytest.mark.parametrize("order", ORDERS)

@pytest.fixture
def written(order, tmp_path):
    """The fields of a late pore with elements of an order, and the file that they were written to."""
    scene, at = late(order)
    content = results.fields(scene, at.pore, at.solved)
    results.write_fields(tmp_path / "fields.vtu", content)
    return content, tmp_path / "fields.vtu"


def by_vtk(path):
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(path))
    assert reader.CanReadFile(str(path))
    reader.Update()
    assert reader.GetErrorCode() == 0
    return reader.GetOutput()


def arrays(data):
    return {data.GetArrayName(k): vtk_to_numpy(data.GetArray(k)) for k in range(data.GetNumberOfArrays())}


def test_the_index_names_every_time_and_a_file_that_is_there():
    folder = whole_of(load_scene("base", ["growth.end=1 h", 'output.times=["0 h", "1 h"]']))
    root = ElementTree.parse(folder / "fields.pvd").getroot()
    assert (root.tag, root.get("type")) == ("VTKFile", "Collection")
    found = {float(one.get("timestep", "nan")): folder / one.get("file", "") for one in root.iter("DataSet")}
    assert list(found) == results.read_table(folder / "timeseries.csv")["time_h"].tolist() == [0.0, 1.0]
    assert sorted(found.values()) == sorted((folder / "fields").glob("fields_*"))


@EVERY_ORDER
def test_vtk_reads_what_was_computed(order, written):
    """Cells, places and every array, to the last bit."""
    computed, path = written
    grid = by_vtk(path)
    kinds = {grid.GetCellType(k) for k in range(grid.GetNumberOfCells())}
    assert kinds == {TRIANGLE if order == 1 else QUADRATIC_TRIANGLE}
    points, in_cells = arrays(grid.GetPointData()), arrays(grid.GetCellData())
    assert points.keys() == computed.point_data.keys() and in_cells.keys() == computed.cell_data.keys()
    assert {value.dtype for value in (points | in_cells).values()} == {np.dtype(np.float64)}
    cells = vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(grid.GetNumberOfCells(), -1)
    places = vtk_to_numpy(grid.GetPoints().GetData())
    assert same_arrays({"points": places, "cells": cells, **points, **in_cells}, arrays_of(computed))


@EVERY_ORDER
def test_middle_nodes_are_where_vtk_expects_them(order, written):
    """Within a fifth of the longest side of where the triangle's straight twin has what VTK takes for that node."""
    grid = by_vtk(written[1])
    places = np.reshape(grid.GetCell(0).GetParametricCoords(), (-1, 3))
    assert len(places) == (3 if order == 1 else 6)
    weights = np.column_stack([1 - places[:, 0] - places[:, 1], places[:, :2]])
    found = np.array([vtk_to_numpy(grid.GetCell(k).GetPoints().GetData()) for k in range(grid.GetNumberOfCells())])
    straight = weights @ found[:, :3]
    longest = np.linalg.norm(found[:, :3] - found[:, [1, 2, 0]], axis=2).max(axis=1)
    assert (np.linalg.norm(found - straight, axis=2) < 0.2 * longest[:, None]).all()


def told_by_vtk(path):
    grid = by_vtk(path)
    return arrays(grid.GetPointData()) | arrays(grid.GetCellData()), arrays(grid.GetFieldData())["TimeValue"]


def told_by_meshio(path):
    found = meshio.read(path)
    told = arrays_of(found)
    return {name: told[name] for name in (*found.point_data, *found.cell_data)}, found.field_data["TimeValue"]


def told_by_pyvista(path):
    found = pyvista.read(path)
    told = {name: np.array(found[name]) for name in (*found.point_data, *found.cell_data)}
    return told, np.array(found.field_data["TimeValue"])


@cache
def known(order):
    """The arrays of the late pore derived anew, and its time."""
    scene, at = late(order)
    return derived_arrays(scene, at), at.pore.time


@pytest.mark.parametrize("read", [told_by_vtk, told_by_meshio, told_by_pyvista])
@EVERY_ORDER
def test_known_fields_come_out_of_every_reader_as_they_are(order, read, written):
    """As ``tests/test_derived.py`` makes them of the late pore, with its time; what the fluid has not is NaN there,
    biomass zero, and nodes of the interface are the aggregate's."""
    told, time = read(written[1])
    wanted, now = known(order)
    assert told.keys() == wanted.keys() and time.tolist() == [now]
    for name, value in wanted.items():
        assert told[name] == pytest.approx(value, rel=1e-9, abs=1e-9 * np.nanmax(np.abs(value)), nan_ok=True), name
