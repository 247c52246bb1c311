"""Files of fields are written and read back to the last bit, by this package and by meshio alike."""

import meshio
import numpy as np

from repro.results import vtu
from repro.results.vtu import Cells, Grid
from tests.strategies import arrays_of, same_arrays


def test_what_is_written_is_read(tmp_path):
    """Of random numbers, not-a-number among them, in arrays of any layout."""
    rng = np.random.default_rng(3)
    nodal = {"plain": rng.normal(size=50), "vector": rng.normal(size=(50, 3)), "empty": np.full(50, np.nan)}
    nodal["strided"] = np.asfortranarray(rng.normal(size=(50, 3)))
    made = Grid(rng.normal(size=(50, 3)), [Cells("triangle", rng.integers(0, 50, (40, 3)))], nodal,
                {"region": [rng.normal(size=80)[::2]]})
    vtu.write(tmp_path / "one.vtu", made)
    for found in (vtu.read(tmp_path / "one.vtu"), meshio.read(tmp_path / "one.vtu")):
        assert same_arrays(arrays_of(found), arrays_of(made)) and found.cells[0].type == "triangle"


def test_what_meshio_has_written_is_read(tmp_path):
    """Runs of earlier versions, in blocks of 32 kB."""
    rng = np.random.default_rng(5)
    long = rng.normal(size=(20_000, 3))
    made = meshio.Mesh(long, [("triangle6", rng.integers(0, 50, (40, 6)))], {"head_cm": long[:, 1]})
    made.write(tmp_path / "one.vtu")
    assert same_arrays(arrays_of(vtu.read(tmp_path / "one.vtu")), arrays_of(made))
