"""Files of fields are written and read back to the last bit, by this package and by meshio alike."""

import meshio
import numpy as np
import pytest

from repro.results import vtu
from repro.results.vtu import Cells, Grid


def grid(kind, seed=3):
    """A grid of random numbers, not-a-number among them, arrays of both layouts."""
    rng = np.random.default_rng(seed)
    cells = rng.integers(0, 50, (40, {"triangle": 3, "triangle6": 6}[kind]))
    nodal = {"plain": rng.normal(size=50), "vector": rng.normal(size=(50, 3)), "empty": np.full(50, np.nan)}
    nodal["strided"] = np.asfortranarray(rng.normal(size=(50, 3)))
    return Grid(rng.normal(size=(50, 3)), [Cells(kind, cells)], nodal, {"region": [rng.normal(size=80)[::2]]})


def same(one, other):
    pairs = [(one.points, other.points), (one.cells[0].data, other.cells[0].data)]
    pairs += [(one.point_data[name], other.point_data[name]) for name in (*one.point_data, *other.point_data)]
    pairs += [(one.cell_data[name][0], other.cell_data[name][0]) for name in (*one.cell_data, *other.cell_data)]
    return one.cells[0].type == other.cells[0].type and all(
        np.array_equal(left, right, equal_nan=True) and left.shape == right.shape for left, right in pairs)


@pytest.mark.parametrize("kind", ["triangle", "triangle6"])
def test_what_is_written_is_read(tmp_path, kind):
    made = grid(kind)
    vtu.write(tmp_path / "one.vtu", made)
    assert same(vtu.read(tmp_path / "one.vtu"), made) and same(meshio.read(tmp_path / "one.vtu"), made)


def test_what_meshio_has_written_is_read(tmp_path):
    """Runs of earlier versions, in blocks of 32 kB."""
    made = grid("triangle6")
    long = np.random.default_rng(5).normal(size=(20_000, 3))
    meshio.Mesh(long, [("triangle6", made.cells[0].data)], {"head_cm": long[:, 1]}).write(tmp_path / "one.vtu")
    read = vtu.read(tmp_path / "one.vtu")
    assert np.array_equal(read.points, long) and np.array_equal(read.point_data["head_cm"], long[:, 1])
    assert np.array_equal(read.cells[0].data, made.cells[0].data)


@pytest.mark.parametrize("content", ["", "<VTKFile/>", "not XML"])
def test_what_is_no_grid_is_refused(tmp_path, content):
    (tmp_path / "one.vtu").write_text(content)
    with pytest.raises((ValueError, SyntaxError)):
        vtu.read(tmp_path / "one.vtu")
