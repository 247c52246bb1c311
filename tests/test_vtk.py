"""The fields as ParaView and PyVista read them: through VTK's own reader, meshio's and PyVista's."""
from dataclasses import replace
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest
import pyvista
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import reference
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

from repro import results
from repro.march.simulation import shaped, simulate
from repro.model import flow, pore
from repro.model.pore import Solved
from repro.model.transport import Concentrations
from repro.run import running
from repro.scene import load_scene
from tests.strategies import ORDERS

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
    folder, _, _ = made
    found = entries(folder)
    assert list(found) == results.read_table(folder / "timeseries.csv")["time_h"].tolist() == [0.0, 1.0]
    assert all(path.is_file() for path in found.values())
    assert sorted(found.values()) == sorted((folder / "fields").glob("fields_*"))


def test_vtk_reads_what_was_computed(made):
    """Cells, places and every array, to the last bit."""
    folder, kind, computed = made
    grid = by_vtk(entries(folder)[1.0])
    cells = computed.cells[0].data
    assert {grid.GetCellType(k) for k in range(grid.GetNumberOfCells())} == {KINDS[kind][0]}
    assert (vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(cells.shape) == cells).all()
    assert (vtk_to_numpy(grid.GetPoints().GetData()) == computed.points).all()
    points, in_cells = arrays(grid.GetPointData()), arrays(grid.GetCellData())
    assert sorted(points) == sorted(NODES) and sorted(in_cells) == sorted([*AGGREGATE, "region"])
    for name, value in points.items():
        assert value.dtype == np.float64 and np.array_equal(value, computed.point_data[name], equal_nan=True), name
    for name, value in in_cells.items():
        assert value.dtype == np.float64 and np.array_equal(value, computed.cell_data[name][0], equal_nan=True), name


def test_middle_nodes_are_where_vtk_expects_them(made):
    """VTK's interpolation at the middle of each side is the middle node."""
    folder, kind, _ = made
    grid = by_vtk(entries(folder)[1.0])
    assert (grid.GetCell(0).GetNumberOfPoints() == 3) == (kind == "linear")
    for k in [] if kind == "linear" else range(grid.GetNumberOfCells()):
        cell, place = grid.GetCell(k), [0.0] * 3
        for node, (r, s) in zip((3, 4, 5), ((0.5, 0), (0.5, 0.5), (0, 0.5))):
            cell.EvaluateLocation(reference(0), (r, s, 0.0), place, [0.0] * 6)
            assert np.allclose(place, cell.GetPoints().GetPoint(node), atol=1e-12)
            ends = [np.array(cell.GetPoints().GetPoint(i)) for i in ((0, 1), (1, 2), (2, 0))[node - 3]]
            assert np.linalg.norm(np.mean(ends, 0) - place) < 0.2 * np.linalg.norm(ends[1] - ends[0])


#: An aggregate that leans; how it is strained, its expansion, P / mu_L, and when.
SHAPE = [(-21, 0), (-19, 9), (-12, 15), (3, 14), (12, 12), (17, 0)]
STRETCH = np.array([[1.3, 0.2], [-0.1, 1.6]])
THETA, PUSH = 1.9, 0.37
TIME = 7.25
ALL = [*NODES, *AGGREGATE, "region"]


def known(order):
    """(scene, Pore, Solved) of fields that can be written down, at the nodes of each its own space."""
    scene = shaped(load_scene("base", ["numerics.preset=fast", f"numerics.elements={ORDERS[order]}",
                                       'growth.shear_modulus="0.003 MPa"']), SHAPE)
    now = pore.seeded(scene)
    full = scene.kinetics.maximum_density * now.space.reaction.dx
    body = replace(now.body, reference=now.mesh.points[now.mesh.body] @ np.linalg.inv(STRETCH).T)
    now = replace(now, time=TIME, active=0.7 * full, inert=0.25 * full, theta=THETA + 0 * now.theta, body=body,
                  pressure=np.where(np.isin(np.arange(now.mesh.corners), now.mesh.body), PUSH, 0.0))
    place = now.space.points
    carried = flow.Flow(1.0, written(place)["velocity"], written(flow.pressure_space(now.space).points)["head"], None,
                        1.0, 1.0, 1.0)
    return scene, now, Solved(carried, None, Concentrations(written(place)["acceptor"], written(place)["donor"]))


def written(place):
    """The fields at places (n, 2) um, in um/h, um and mg/L: squares at most, but for the head."""
    x, y = place.T / 50
    return {"velocity": 1e4 * np.column_stack([3 + x - y**2, 0.5 + x * y]), "head": 30 - 20 * x + 7 * y,
            "acceptor": 5 + x - x * y, "donor": 3 - x + y**2}


def wanted(place, inside):
    """{array: value} at nodes (n, 2) um, of which the aggregate has those inside (n,); one number of each of its
    triangles."""
    found, away = written(place), np.where(inside, 0.0, np.nan)[:, None]
    three = np.zeros((len(place), 1))
    origin = np.hstack([place @ np.linalg.inv(STRETCH).T, three]) + away
    J, B = np.linalg.det(STRETCH), np.eye(3)
    B[:2, :2] = STRETCH @ STRETCH.T
    stress = 0.003 * (J ** (-5 / 3) * (B - np.trace(B) / 3 * np.eye(3)) + PUSH * np.eye(3))
    return {"velocity_m_per_d": 24e-6 * np.hstack([found["velocity"], three]), "head_cm": 1e-4 * found["head"],
            "acceptor_mg_per_L": found["acceptor"], "donor_mg_per_L": found["donor"], "active_biomass": 0.7 * inside,
            "inert_biomass": 0.25 * inside, "position_t0_um": origin,
            "displacement_um": np.hstack([place, three]) - origin, "pressure_MPa": 0.003 * PUSH + away[:, 0],
            "theta": THETA, "J": J, "stress_xx_MPa": stress[0, 0], "stress_yy_MPa": stress[1, 1],
            "stress_zz_MPa": stress[2, 2], "stress_xy_MPa": stress[0, 1],
            "largest_principal_stress_MPa": np.linalg.eigvalsh(stress)[-1]}


def told_by_vtk(path):
    grid = by_vtk(path)
    cells = vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(grid.GetNumberOfCells(), -1)
    told = arrays(grid.GetPointData()) | arrays(grid.GetCellData())
    return vtk_to_numpy(grid.GetPoints().GetData()), cells, told, arrays(grid.GetFieldData())["TimeValue"]


def told_by_meshio(path):
    found = meshio.read(path)
    told = found.point_data | {name: values for name, (values,) in found.cell_data.items()}
    return found.points, found.cells[0].data, told, found.field_data["TimeValue"]


def told_by_pyvista(path):
    found = pyvista.read(path)
    told = {name: np.array(found[name]) for name in ALL}
    cells = next(iter(found.cells_dict.values()))
    return np.array(found.points), cells, told, np.array(found.field_data["TimeValue"])


@pytest.mark.parametrize("read", [told_by_vtk, told_by_meshio, told_by_pyvista])
@pytest.mark.parametrize("order", ORDERS)
def test_known_fields_come_out_of_every_reader_as_they_are(order, read, tmp_path):
    """With their time; what the fluid has not is NaN there, biomass zero, and nodes of the interface are the
    aggregate's."""
    results.write_fields(tmp_path / "fields.vtu", results.fields(*known(order)))
    points, cells, told, time = read(tmp_path / "fields.vtu")
    assert sorted(told) == sorted(ALL) and time.tolist() == [TIME]
    inside = np.isin(np.arange(len(points)), cells[told["region"] == 1])
    assert inside.any() and not inside.all()
    for name, value in wanted(points[:, :2], inside).items():
        if name in AGGREGATE:
            value = np.where(told["region"] == 1, value, np.nan)
        assert told[name] == pytest.approx(value, rel=1e-9, abs=1e-12, nan_ok=True), name
