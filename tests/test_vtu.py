"""Files of fields are written and read back to the last bit, by this package and by meshio alike."""

import meshio
import numpy as np
import pytest

from repro.results import vtu
from repro.results.vtu import Cells, Grid
from tests.strategies import arrays_of, same_arrays


def grid(kind, seed=3):
    """A grid of random numbers, not-a-number among them, arrays of both layouts."""
    rng = np.random.default_rng(seed)
    cells = rng.integers(0, 50, (40, {"triangle": 3, "triangle6": 6}[kind]))
    nodal = {"plain": rng.normal(size=50), "vector": rng.normal(size=(50, 3)), "empty": np.full(50, np.nan)}
    nodal["strided"] = np.asfortranarray(rng.normal(size=(50, 3)))
    return Grid(rng.normal(size=(50, 3)), [Cells(kind, cells)], nodal, {"region": [rng.normal(size=80)[::2]]})


@pytest.mark.parametrize("kind", ["triangle", "triangle6"])
def test_what_is_written_is_read(tmp_path, kind):
    made = grid(kind)
    vtu.write(tmp_path / "one.vtu", made)
    for found in (vtu.read(tmp_path / "one.vtu"), meshio.read(tmp_path / "one.vtu")):
        assert same_arrays(arrays_of(found), arrays_of(made)) and found.cells[0].type == kind


def test_what_meshio_has_written_is_read(tmp_path):
    """Runs of earlier versions, in blocks of 32 kB."""
    long = np.random.default_rng(5).normal(size=(20_000, 3))
    made = meshio.Mesh(long, [("triangle6", grid("triangle6").cells[0].data)], {"head_cm": long[:, 1]})
    made.write(tmp_path / "one.vtu")
    assert same_arrays(arrays_of(vtu.read(tmp_path / "one.vtu")), arrays_of(made))


@pytest.mark.parametrize("content", ["", "<VTKFile/>", "not XML"])
def test_what_is_no_grid_is_refused(tmp_path, content):
    (tmp_path / "one.vtu").write_text(content)
    with pytest.raises((ValueError, SyntaxError)):
        vtu.read(tmp_path / "one.vtu")
