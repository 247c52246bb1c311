"""Fields as VTK's XML files of unstructured grids (``.vtu``), written and read with meshio.

Arrays are compressed by zlib, in base64; ParaView, PyVista and VTK read these files. meshio is
imported with the first file, because many commands neither write nor read one.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from repro.errors import OutputError
from repro.results.files import MOST_DATA
from repro.results.files import read as read_file

#: The names of a run's files in its folder.
NAME = re.compile(r"fields/(?:fields|before_expansion)_\d{4,}\.vtu")
#: The name by which VTK's readers know the time of a grid.
TIME = "TimeValue"
#: meshio's name of a triangle, by its number of nodes.
CELL_TYPES = {3: "triangle", 6: "triangle6"}


@dataclass(frozen=True, eq=False)
class Grid:
    """Fields on a mesh at one time.

    points: (N, 3) um; cells: (T, 3) nodes of each triangle, or (T, 6) with those in the middles of
    its edges; point_data, cell_data: values (N, ...) at points and (T, ...) in triangles, by name;
    time: h.
    """

    points: np.ndarray
    cells: np.ndarray
    point_data: dict[str, np.ndarray] = field(default_factory=dict)
    cell_data: dict[str, np.ndarray] = field(default_factory=dict)
    time: float = 0.0

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """The arrays by name, as Python's results have them."""
        return {"places_um": self.points[:, :2], "triangles": self.cells, **self.point_data,
                **self.cell_data}


def write(path: Path, grid: Grid) -> None:
    """Write a grid. Raises OSError if the file cannot be written."""
    import meshio

    cells = [(CELL_TYPES[grid.cells.shape[1]], grid.cells)]
    in_cells = {name: [values] for name, values in grid.cell_data.items()}
    mesh = meshio.Mesh(grid.points, cells, dict(grid.point_data), in_cells)
    meshio.vtu.write(path, mesh, header_type="UInt32")
    tree = ElementTree.parse(path)  # meshio reads field data, such as the time, and writes none
    fields = ElementTree.Element("FieldData")
    value = ElementTree.SubElement(fields, "DataArray", type="Float64", Name=TIME,
                                   NumberOfTuples="1", format="ascii")
    value.text = repr(float(grid.time))
    tree.getroot()[0].insert(0, fields)
    tree.write(path, encoding="utf-8", xml_declaration=True)


def read(path: Path) -> Grid:
    """Read the grid in a file.

    Raises OutputError if the file cannot be read, is longer than MOST_DATA, or contains no grid.
    """
    import meshio

    try:
        read_file(path, MOST_DATA)
        mesh = meshio.vtu.read(path)
        (cells,) = mesh.cells
        in_cells = {name: values for name, (values,) in mesh.cell_data.items()}
        time = float(mesh.field_data[TIME][0])
        return Grid(mesh.points, cells.data, mesh.point_data, in_cells, time)
    except Exception as error:  # meshio has no error of its own for most damages
        why = f"{type(error).__name__}: {error}".removesuffix(": ")
        raise OutputError(f"{path}: it holds no fields: {why}") from error
