"""The fields as ParaView, PyVista, meshio and this package read them, to the last bit. That they are what their names
say is in tests/test_derived.py."""
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest
import pyvista
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

from repro import results
from repro.results import vtu
from repro.scene import load_scene
from tests.pages import whole_of
from tests.strategies import ORDERS, arrays_of, same_arrays
from tests.test_derived import late

TRIANGLE, QUADRATIC_TRIANGLE = 5, 22
EVERY_ORDER = pytest.mark.parametrize("order", ORDERS)


@pytest.fixture
def written(order, tmp_path):
    """A late pore with elements of an order, its fields, and the file that they were written to."""
    scene, at = late(order)
    content = results.fields(scene, at.pore, at.solved)
    vtu.write(tmp_path / "fields.vtu", content)
    return at.pore, content, tmp_path / "fields.vtu"


def read_by_vtk(path):
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(path))
    assert reader.CanReadFile(str(path))
    reader.Update()
    assert reader.GetErrorCode() == 0
    return reader.GetOutput()


def arrays(data):
    return {data.GetArrayName(k): vtk_to_numpy(data.GetArray(k)) for k in range(data.GetNumberOfArrays())}


def by_vtk(path):
    grid = read_by_vtk(path)
    cells = vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(grid.GetNumberOfCells(), -1)
    shape = {"points": vtk_to_numpy(grid.GetPoints().GetData()), "cells": cells}
    return shape | arrays(grid.GetPointData()) | arrays(grid.GetCellData()), arrays(grid.GetFieldData())


def by_pyvista(path):
    grid = pyvista.read(path)
    shape = {"points": grid.points, "cells": grid.cell_connectivity.reshape(grid.n_cells, -1)}
    return {**shape, **grid.point_data, **grid.cell_data}, grid.field_data


def by_meshio(path):
    grid = meshio.read(path)
    return arrays_of(grid), grid.field_data


def by_this_package(path):
    return arrays_of(vtu.read(path)), by_meshio(path)[1]


@pytest.mark.parametrize("read", [by_vtk, by_pyvista, by_meshio, by_this_package])
@EVERY_ORDER
def test_every_reader_reads_what_was_computed(order, read, written):
    """Places, cells, the time, and each array as numbers of 64 bits."""
    now, computed, path = written
    told, besides = read(path)
    assert same_arrays(told, arrays_of(computed)) and besides["TimeValue"].tolist() == [now.time]
    assert {value.dtype for name, value in told.items() if name != "cells"} == {np.dtype(np.float64)}


@EVERY_ORDER
def test_middle_nodes_are_where_vtk_expects_them(order, written):
    """Within a fifth of the longest side of where the triangle's straight twin has what VTK takes for that node."""
    grid = read_by_vtk(written[-1])
    kinds = {grid.GetCellType(k) for k in range(grid.GetNumberOfCells())}
    assert kinds == {TRIANGLE if order == 1 else QUADRATIC_TRIANGLE}
    places = np.reshape(grid.GetCell(0).GetParametricCoords(), (-1, 3))
    assert len(places) == (3 if order == 1 else 6)
    weights = np.column_stack([1 - places[:, 0] - places[:, 1], places[:, :2]])
    found = np.array([vtk_to_numpy(grid.GetCell(k).GetPoints().GetData()) for k in range(grid.GetNumberOfCells())])
    straight = weights @ found[:, :3]
    longest = np.linalg.norm(found[:, :3] - found[:, [1, 2, 0]], axis=2).max(axis=1)
    assert (np.linalg.norm(found - straight, axis=2) < 0.2 * longest[:, None]).all()


def test_the_index_names_every_time_and_a_file_that_is_there():
    folder = whole_of(load_scene("base", ["growth.end=1 h", 'output.times=["0 h", "0.5 h", "1 h"]']))
    root = ElementTree.parse(folder / "fields.pvd").getroot()
    assert (root.tag, root.get("type")) == ("VTKFile", "Collection")
    found = {float(one.get("timestep", "nan")): folder / one.get("file", "") for one in root.iter("DataSet")}
    assert list(found) == results.read_table(folder / "timeseries.csv")["time_h"].tolist() == [0.0, 0.5, 1.0]
    assert sorted(found.values()) == sorted((folder / "fields").glob("fields_*"))
