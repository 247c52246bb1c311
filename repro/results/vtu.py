"""Fields as VTK's XML files of unstructured grids (``.vtu``), written and read back.

Arrays are little-endian, compressed by zlib, in base64: what ParaView, PyVista, VTK and meshio
read.
A grid is laid out as meshio's ``Mesh`` is, which this package has no need to import: that takes
longer than writing all the fields of a short run.
"""

from __future__ import annotations

import base64
import zlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from repro.results.files import MOST_DATA
from repro.results.files import read as read_file

#: VTK's numbers of the cells that there are, and their nodes.
TYPES = {"triangle": 5, "triangle6": 22}
KINDS = {"<f8": "Float64", "<i8": "Int64", "<i4": "Int32", "|u1": "UInt8"}
HEADER = "<u4"
#: Of zlib: more takes several times as long, for files a tenth smaller.
LEVEL = 1


class Cells(NamedTuple):
    """Cells of one type, and their nodes (T, k)."""

    type: str
    data: np.ndarray


@dataclass(frozen=True, eq=False)
class Grid:
    """Points (N, 3), the cells on them in one block, values at points (N, ...), and in the cells
    (T, ...), in a list of one block; field_data: values of the whole, such as its time."""

    points: np.ndarray
    cells: list[Cells]
    point_data: dict[str, np.ndarray] = field(default_factory=dict)
    cell_data: dict[str, list[np.ndarray]] = field(default_factory=dict)
    field_data: dict[str, np.ndarray] = field(default_factory=dict)


def write(path: Path, grid: Grid) -> None:
    """Write a grid. Raises OSError where the file cannot be written."""
    kind, cells = grid.cells[0]
    offsets = cells.shape[1] * np.arange(1, len(cells) + 1)
    topology = {"connectivity": cells.ravel(), "offsets": offsets,
                "types": np.full(len(cells), TYPES[kind], np.uint8)}
    in_cells = {name: values for name, (values,) in grid.cell_data.items()}
    path.write_text(
        '<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="0.1" '
        'byte_order="LittleEndian" header_type="UInt32" compressor="vtkZLibDataCompressor">\n'
        f'<UnstructuredGrid>\n{_of_the_whole(grid.field_data)}'
        f'<Piece NumberOfPoints="{len(grid.points)}" '
        f'NumberOfCells="{len(cells)}">\n{_section("Points", {"Points": grid.points})}'
        f'{_section("Cells", topology)}{_section("PointData", grid.point_data)}'
        f'{_section("CellData", in_cells)}</Piece>\n</UnstructuredGrid>\n</VTKFile>\n',
        encoding="utf-8", newline="")


def _of_the_whole(arrays: dict[str, np.ndarray]) -> str:
    told = [f'<DataArray type="Float64" Name="{name}" NumberOfTuples="{len(values)}" '
            f'format="ascii">{" ".join(map(repr, values.tolist()))}</DataArray>\n'
            for name, values in arrays.items()]
    return f"<FieldData>\n{''.join(told)}</FieldData>\n" if told else ""


def _section(name: str, arrays: dict[str, np.ndarray]) -> str:
    return f"<{name}>\n{''.join(map(_array, arrays, arrays.values()))}</{name}>\n"


def _array(name: str, values: np.ndarray) -> str:
    little = np.ascontiguousarray(values, values.dtype.newbyteorder("<"))
    components = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else ""
    return (f'<DataArray type="{KINDS[little.dtype.str]}" Name="{name}"{components} '
            f'format="binary">{_encoded(little.tobytes())}</DataArray>\n')


def _encoded(data: bytes) -> str:
    """One block: how many there are, its size, that of a shorter last one, its compressed size."""
    block = zlib.compress(data, LEVEL)
    header = np.array([1, len(data), 0, len(block)], HEADER).tobytes()
    return (base64.b64encode(header) + base64.b64encode(block)).decode("ascii")


def read(path: Path) -> Grid:
    """The grid in a file that :func:`write` or meshio has written.

    Raises OSError where it cannot be read, and ValueError where it is none.
    """
    try:
        return parse(read_file(path, MOST_DATA))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def parse(content: bytes) -> Grid:
    """The grid in the content of a file. Raises ValueError where there is none."""
    try:
        return _grid(ElementTree.fromstring(content))
    except (ElementTree.ParseError, LookupError, TypeError, ValueError, zlib.error) as error:
        raise ValueError(f"no unstructured grid: {error}") from error


def _grid(root: ElementTree.Element) -> Grid:
    """The grid in a file's elements."""
    piece = root.find("UnstructuredGrid/Piece")
    if piece is None:
        raise ValueError("there is no piece")
    parts = {name: _arrays(piece.find(name))
             for name in ("Points", "Cells", "PointData", "CellData")}
    points = parts["Points"].popitem()[1]
    kinds = {number: kind for kind, number in TYPES.items()}
    kind = kinds[int(parts["Cells"]["types"][0])]
    cells = parts["Cells"]["connectivity"].reshape(len(parts["Cells"]["types"]), -1)
    in_cells = {name: [values] for name, values in parts["CellData"].items()}
    return Grid(points, [Cells(kind, cells)], parts["PointData"], in_cells)


def _arrays(section: ElementTree.Element | None) -> dict[str, np.ndarray]:
    """The arrays of a section, by name; none where there is no such section."""
    kinds = {name: kind for kind, name in KINDS.items()}
    found = {}
    for entry in section if section is not None else ():
        values = np.frombuffer(_decoded(entry.text or ""), kinds[entry.get("type")])
        count = int(entry.get("NumberOfComponents", "1"))
        found[entry.get("Name", "")] = values.reshape(-1, count) if count > 1 else values
    return found


def _decoded(text: str) -> bytes:
    """The blocks of an array, one after the other."""
    text = text.strip()
    count = int(np.frombuffer(base64.b64decode(text[:8]), HEADER, 1)[0])
    length = -(-4 * (3 + count) // 3) * 4
    sizes = np.frombuffer(base64.b64decode(text[:length]), HEADER)[3:]
    data = base64.b64decode(text[length:])
    ends = np.cumsum(sizes).tolist()
    return b"".join(map(zlib.decompress, (data[end - size:end] for size, end in zip(sizes, ends))))
