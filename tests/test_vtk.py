"""The fields as ParaView and PyVista read them: through VTK's own reader, and through meshio."""
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import reference
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

from repro import results
from repro.march.simulation import simulate
from repro.results import names
from repro.run import running
from repro.scene import load_scene

TRIANGLE, QUADRATIC_TRIANGLE = 5, 22
#: Kinds of elements: what they are to VTK, and to meshio.
KINDS = {"linear": (TRIANGLE, "triangle"), "quadratic": (QUADRATIC_TRIANGLE, "triangle6"),
         "cubic": (QUADRATIC_TRIANGLE, "triangle6")}
AGGREGATE = ["theta", "J", "stress_xx_MPa", "stress_yy_MPa", "stress_zz_MPa", "stress_xy_MPa",
             "largest_principal_stress_MPa"]
NODES = ["velocity_m_per_d", "head_cm", "acceptor_mg_per_L", "donor_mg_per_L", "active_biomass", "inert_biomass",
         "displacement_um", "position_t0_um", "pressure_MPa"]


@pytest.fixture(scope="module", params=KINDS)
def made(request, tmp_path_factory):
    """A run's folder, its elements, and its last fields as they were before they were written."""
    preset = "paper" if request.param == "linear" else "fast"
    sets = [f"numerics.preset={preset}", f"numerics.elements={request.param}", 'growth.end="1 h"',
            'output.times=["0 h", "1 h"]']
    scene = load_scene("base", sets)
    folder = tmp_path_factory.mktemp(request.param) / "run"
    running.run(scene, folder)
    *_, last = simulate(scene)
    return folder, request.param, results.fields(scene, last.pore, last.solved)


def entries(folder):
    """{time: path} of the index."""
    root = ElementTree.parse(folder / "fields.pvd").getroot()
    assert (root.tag, root.get("type")) == ("VTKFile", "Collection")
    return {float(one.get("timestep", "nan")): folder / one.get("file", "") for one in root.iter("DataSet")}


def by_vtk(path):
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(path))
    assert reader.CanReadFile(str(path))
    reader.Update()
    assert reader.GetErrorCode() == 0
    return reader.GetOutput()


def arrays(data):
    return {data.GetArrayName(k): vtk_to_numpy(data.GetArray(k)) for k in range(data.GetNumberOfArrays())}


def test_the_index_names_every_time_and_a_file_that_is_there(made):
    """Mutants: times in another unit; paths that hang on where the reader stands."""
    folder, _, _ = made
    found = entries(folder)
    assert list(found) == results.read_table(folder / "timeseries.csv")["time_h"].tolist() == [0.0, 1.0]
    assert all(path.is_file() for path in found.values())
    assert sorted(found.values()) == sorted((folder / "fields").glob("fields_*"))


def test_vtk_reads_what_was_computed(made):
    """Cells, places and every array, to the last bit. Mutants: cells of another kind, arrays rounded to 32 bits, an
    array of another row."""
    folder, kind, computed = made
    grid = by_vtk(entries(folder)[1.0])
    cells = computed.cells[0].data
    assert {grid.GetCellType(k) for k in range(grid.GetNumberOfCells())} == {KINDS[kind][0]}
    assert (vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(cells.shape) == cells).all()
    assert (vtk_to_numpy(grid.GetPoints().GetData()) == computed.points).all()
    points, in_cells = arrays(grid.GetPointData()), arrays(grid.GetCellData())
    assert sorted(points) == sorted(NODES) and sorted(in_cells) == sorted([*AGGREGATE, "region"])
    for name, value in points.items():
        assert value.dtype == np.float64 and (value == computed.point_data[name]).all(), name
    for name, value in in_cells.items():
        assert value.dtype == np.float64 and (value == computed.cell_data[name][0]).all(), name


def test_meshio_reads_the_same(made):
    folder, kind, computed = made
    found = meshio.read(entries(folder)[1.0])
    assert [block.type for block in found.cells] == [KINDS[kind][1]]
    assert (found.points == computed.points).all() and (found.cells[0].data == computed.cells[0].data).all()
    assert all((found.point_data[name] == computed.point_data[name]).all() for name in NODES)
    assert all((found.cell_data[name][0] == computed.cell_data[name][0]).all() for name in (*AGGREGATE, "region"))


def test_middle_nodes_are_where_vtk_expects_them(made):
    """VTK's interpolation at the middle of each side is the middle node. Mutant: sides in another order."""
    folder, kind, _ = made
    if kind == "linear":
        assert by_vtk(entries(folder)[1.0]).GetCell(0).GetNumberOfPoints() == 3
        return
    grid = by_vtk(entries(folder)[1.0])
    for k in range(grid.GetNumberOfCells()):
        cell, place = grid.GetCell(k), [0.0, 0.0, 0.0]
        for node, (r, s) in zip((3, 4, 5), ((0.5, 0), (0.5, 0.5), (0, 0.5))):
            cell.EvaluateLocation(reference(0), (r, s, 0.0), place, [0.0] * 6)
            assert np.allclose(place, cell.GetPoints().GetPoint(node), atol=1e-12)
            ends = [np.array(cell.GetPoints().GetPoint(i)) for i in ((0, 1), (1, 2), (2, 0))[node - 3]]
            assert np.linalg.norm(np.mean(ends, 0) - place) < 0.2 * np.linalg.norm(ends[1] - ends[0])


def test_names_tell_units(made):
    """Vectors have three components, as VTK wants them; numbers are what their names say. Mutants: a concentration in
    g/L, J of another power, a head in um."""
    folder, kind, computed = made
    grid = by_vtk(entries(folder)[1.0])
    found = arrays(grid.GetPointData())
    assert {name: names.unit(name) for name in found} == {name: names.unit(name) for name in NODES}
    assert {name: value.shape[1] for name, value in found.items() if value.ndim == 2} == {
        "velocity_m_per_d": 3, "displacement_um": 3, "position_t0_um": 3}
    table = results.read_table(folder / "timeseries.csv")
    least = table["acceptor_min_mg_per_L"][-1]
    if kind == "cubic":  # of all its nodes, more than a file has
        assert 0 <= found["acceptor_mg_per_L"].min() / least - 1 < 1e-3
    else:
        assert found["acceptor_mg_per_L"].min() == least
    cells = arrays(grid.GetCellData())
    body = cells["region"] == 1
    assert np.allclose(cells["J"][body], cells["theta"][body], rtol=0.1) and cells["theta"][body].min() > 1.15
    length, loss = np.ptp(computed.points[:, 0]), np.ptp(found["head_cm"])
    assert loss < table["head_loss_cm"][-1] and loss > 0.5 * table["head_loss_cm"][-1] * length / 600
