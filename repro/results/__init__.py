"""Results of a run: ``timeseries.csv``, ``ledger.csv``, ``run.json``, and fields as ``.vtu``.

    quantities    a reported quantity: name with its unit, words, formula
    columns       quantities of the time series and the ledger
    arrays        quantities of the fields
    names         words and units of all quantities, by name
    tables        results in Python
    permeability  laws for models on the Darcy scale
    drawing       curves, fields and films with matplotlib

A file that :func:`write_text` writes is complete or absent, and so are tables, lists and JSON. An
empty field of a table is a quantity that the scene does not model.
"""

import csv
import io
import json
import platform
from collections.abc import Iterable
from dataclasses import asdict
from functools import cache
from importlib import metadata
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from repro.results.arrays import fields
from repro.results.columns import (
    COLUMNS,
    LEDGER_COLUMNS,
    column_names,
    ledger_columns,
    ledger_row,
    row,
)
from repro.results.files import MOST_TABLE, atomic_path, read, sealed
from repro.results.quantities import UNITS
from repro.scene import Scene, scene_hash, scene_tables

#: Factor from um/h to m/d.
M_PER_D = UNITS["_m_per_d"].factor
#: Packages whose versions belong to the origin of a result.
PACKAGES = ("numpy", "scipy", "scikit-fem", "meshio", "mmgpy", "shapely", "pint")


def write_text(path: Path, text: str) -> None:
    """Write a complete text file, or none. Line ends stay; bytes that are no text are escaped."""
    with atomic_path(path) as beside:
        beside.write_text(text, encoding="utf-8", errors="backslashreplace", newline="")


def write_index(path: Path, entries: list[tuple[float, str]]) -> None:
    """Write the ``.pvd`` index of fields: (time in h, file name) pairs."""
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    collection = ElementTree.SubElement(root, "Collection")
    for time, name in entries:
        ElementTree.SubElement(collection, "DataSet", timestep=repr(time), part="0", file=name)
    ElementTree.indent(root)
    content = ElementTree.tostring(root, encoding="unicode")
    write_text(path, f'<?xml version="1.0"?>\n{content}\n')


def write_table(path: Path, columns: list[str], rows: Iterable[Iterable]) -> None:
    """Write a CSV table; None is an empty field, floats keep every digit."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([columns, *rows])
    write_text(path, text.getvalue())


def read_table(path: Path) -> dict[str, np.ndarray]:
    """The columns of a CSV table that a run has written; an empty field is not-a-number.

    Raises ValueError if a line is cut short or a field is no number, and OSError if the file cannot
    be read.
    """
    return parse_table(read(path, MOST_TABLE))


def parse_table(content: bytes) -> dict[str, np.ndarray]:
    """The columns of a CSV table, as :func:`read_table` returns them, from the file's content."""
    text = content.decode()
    if not text.endswith("\n"):
        raise ValueError("it is empty, or its last line is cut short")
    head, *rows = csv.reader(io.StringIO(text))
    numbers = [[float(cell or "nan") for cell in line] for line in rows]
    columns = np.array(numbers, dtype=float).reshape(len(rows), len(head)).T
    return dict(zip(head, np.ascontiguousarray(columns)))


def provenance(scene: Scene) -> dict:
    """The scene as read, its hash, and the versions of the packages that compute its numbers.

    A scheme that is not that of the preset has an entry of its own.
    """
    versions = {"dupin2001-repro": version("dupin2001-repro"),
                "python": platform.python_version()}
    versions |= {name: version(name) for name in PACKAGES}
    exchanged = scene.numerics.exchanged
    scheme = {} if exchanged is None else {"scheme": asdict(exchanged)}
    return {"scene": scene.name, "hash": scene_hash(scene), "tables": scene_tables(scene),
            "versions": versions, **scheme}


#: The version of an installed package; it is read from the disk once.
version = cache(metadata.version)


def write_json(path: Path, content: dict) -> None:
    """Write a JSON file. Raises ValueError for not-a-number."""
    write_text(path, json.dumps(content, indent=2, allow_nan=False) + "\n")


def write_sealed(path: Path, content: dict) -> None:
    """Write a JSON file that ends with its own checksum."""
    write_text(path, sealed(content))
