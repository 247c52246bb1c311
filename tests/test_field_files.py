"""Field files are read back as written, and a file without fields is refused."""

import numpy as np
import pytest

from repro.errors import OutputError
from repro.results import field_files
from repro.results.field_files import Grid
from tests.strategies import arrays_of, same_arrays


@pytest.mark.parametrize("nodes", [3, 6])
def test_fields_are_read_as_written(tmp_path, nodes):
    """They agree to the last bit, with NaN, arrays of any layout and more than one of the writer's blocks of 32 kB."""
    rng = np.random.default_rng(3)
    nodal = {"plain": rng.normal(size=5000), "vector": rng.normal(size=(5000, 3)), "empty": np.full(5000, np.nan)}
    nodal["strided"] = np.asfortranarray(rng.normal(size=(5000, 3)))
    celled = {"region": rng.normal(size=80)[::2]}
    written = Grid(rng.normal(size=(5000, 3)), rng.integers(0, 5000, (40, nodes)), nodal, celled, 100 / 3)
    field_files.write(tmp_path / "one.vtu", written)
    read = field_files.read(tmp_path / "one.vtu")
    assert same_arrays(arrays_of(read), arrays_of(written)) and read.time == 100 / 3


@pytest.mark.parametrize("damage", [
    lambda text: "", lambda text: text[:-40], lambda text: text.replace("TimeValue", "Time"),
    lambda text: text.replace('Points="3"', 'Points="4"'),
    lambda text: text.replace('Components="3"', 'Components="2"'),
    lambda text: text.replace('type="UnstructuredGrid"', 'type="PolyData"')])
def test_a_file_without_fields_is_refused_by_name(tmp_path, capsys, damage):
    path = tmp_path / "one.vtu"
    field_files.write(path, Grid(np.eye(3), np.array([[0, 1, 2]])))
    path.write_text(damage(path.read_text()))
    with pytest.raises(OutputError, match="one.vtu: it holds no fields: ."):
        field_files.read(path)
    assert capsys.readouterr() == ("", "")


def test_a_file_longer_than_fields_may_be_is_not_read(tmp_path, monkeypatch):
    field_files.write(tmp_path / "one.vtu", Grid(np.eye(3), np.array([[0, 1, 2]])))
    monkeypatch.setattr(field_files, "MOST_DATA", 100)
    with pytest.raises(OutputError, match="longer than 100 bytes"):
        field_files.read(tmp_path / "one.vtu")
