"""Fields as VTK's XML files of unstructured grids (``.vtu``).

Arrays are compressed by zlib, in base64; ParaView, PyVista, VTK and meshio read these files. An
array's text is the count of its blocks, the length of a block and of the last one, the lengths of
the compressed blocks, and then these blocks. This module writes one block, and reads any number.
"""

from __future__ import annotations

import zlib
from base64 import b64decode, b64encode
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from repro.errors import OutputError
from repro.results.files import MOST_DATA
from repro.results.files import read as read_file

#: The name by which VTK's readers know the time of a grid.
TIME = "TimeValue"
#: VTK's number of a triangle, by its number of nodes.
CELL_TYPES = {3: 5, 6: 22}
#: NumPy's types by VTK's names.
TYPES = {"Float64": "<f8", "Int64": "<i8", "UInt8": "|u1"}
NAMES = {kind: name for name, kind in TYPES.items()}
#: The default level of zlib, 6, saves 2 % of a file's length and takes 1.4 times the time.
LEVEL = 1
FORM = {"type": "UnstructuredGrid", "version": "0.1", "byte_order": "LittleEndian",
        "header_type": "UInt32", "compressor": "vtkZLibDataCompressor"}


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


def write(path: Path, grid: Grid) -> None:
    """Write a grid. Raises OSError if the file cannot be written."""
    count, nodes = grid.cells.shape
    connections = {"connectivity": grid.cells.ravel(),
                   "offsets": nodes * np.arange(1, count + 1),
                   "types": np.full(count, CELL_TYPES[nodes], np.uint8)}
    sections = {"Points": {"Points": grid.points}, "Cells": connections,
                "PointData": grid.point_data, "CellData": grid.cell_data}
    form = " ".join(f'{name}="{value}"' for name, value in FORM.items())
    lines = ['<?xml version="1.0"?>', f"<VTKFile {form}>", "<UnstructuredGrid>",
             f'<FieldData><DataArray type="Float64" Name="{TIME}" NumberOfTuples="1" '
             f'format="ascii">{float(grid.time)!r}</DataArray></FieldData>',
             f'<Piece NumberOfPoints="{len(grid.points)}" NumberOfCells="{count}">']
    for section, arrays in sections.items():
        lines += [f"<{section}>", *map(_element, arrays, arrays.values()), f"</{section}>"]
    lines += ["</Piece>", "</UnstructuredGrid>", "</VTKFile>", ""]
    path.write_text("\n".join(lines), encoding="utf-8", newline="")


def _element(name: str, values: np.ndarray) -> str:
    """The XML element of an array (N,) or (N, components)."""
    little = values.astype(values.dtype.newbyteorder("<"), copy=False)
    content = little.tobytes()
    compressed = zlib.compress(content, LEVEL)
    header = np.array([1, len(content), len(content), len(compressed)], "<u4").tobytes()
    components = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else ""
    return (f'<DataArray type="{NAMES[little.dtype.str]}" Name="{name}"{components} '
            f'format="binary">{(b64encode(header) + b64encode(compressed)).decode()}</DataArray>')


def read(path: Path) -> Grid:
    """Read the grid in a file.

    Raises OutputError if the file cannot be read, is longer than MOST_DATA, or contains no grid.
    """
    try:
        root = ElementTree.fromstring(read_file(path, MOST_DATA))
        if root.attrib != FORM:
            raise ValueError("its form is another one")
        return _grid(root[0])
    except Exception as error:  # XML, zlib and NumPy have errors of their own for each damage
        why = f"{type(error).__name__}: {error}".removesuffix(": ")
        raise OutputError(f"{path}: it holds no fields: {why}") from error


def _grid(element: ElementTree.Element) -> Grid:
    """The grid of an element ``UnstructuredGrid``."""
    times = {each.get("Name"): each.text for each in element.iterfind("FieldData/DataArray")}
    piece = element.find("Piece")
    count, cells = (int(piece.get(f"NumberOf{name}")) for name in ("Points", "Cells"))
    sections = {section: dict(_arrays(piece.find(section), size)) for section, size in
                (("Points", count), ("Cells", cells), ("PointData", count), ("CellData", cells))}
    points = sections["Points"]["Points"]
    triangles = sections["Cells"]["connectivity"]
    if points.shape != (count, 3) or triangles.shape[1] not in CELL_TYPES:
        raise ValueError("its points or triangles have another shape")
    return Grid(points, triangles, sections["PointData"], sections["CellData"], float(times[TIME]))


def _arrays(section: ElementTree.Element, count: int) -> Iterator[tuple[str, np.ndarray]]:
    """Names and arrays (count,) or (count, components) of a section."""
    for element in section:
        values = np.frombuffer(_content(element.text.strip()), TYPES[element.get("type")])
        name = element.get("Name")
        components = element.get("NumberOfComponents", -1 if name == "connectivity" else 0)
        shape = (count, int(components)) if components else (count,)
        yield name, values.reshape(shape).copy()


def _content(text: str) -> bytes:
    """The bytes of an array from its text."""
    blocks = int(np.frombuffer(b64decode(text[:8])[:4], "<u4")[0])
    length = 4 * -(-4 * (3 + blocks) // 3)
    sizes = np.frombuffer(b64decode(text[:length]), "<u4")[3:]
    compressed = b64decode(text[length:])
    ends = np.cumsum(sizes)
    return b"".join(zlib.decompress(compressed[end - size:end]) for size, end in zip(sizes, ends))
