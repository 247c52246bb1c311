"""Field files are read back as written, and a file without fields is refused."""

import meshio
import numpy as np
import pytest

from repro.errors import OutputError
from repro.results import field_files
from repro.results.field_files import Grid
from tests.strategies import arrays_of, same_arrays


def rewrite_with_meshio(path, time):
    """Write the grid in a file again, in blocks of 32 kB, as meshio does; meshio writes no time."""
    meshio.vtu.write(path, meshio.vtu.read(path), header_type="UInt32")
    field = f'<FieldData><DataArray type="Float64" Name="TimeValue" format="ascii">{time!r}</DataArray></FieldData>'
    path.write_text(path.read_text().replace("<UnstructuredGrid>", "<UnstructuredGrid>" + field))


@pytest.mark.parametrize("again", [lambda path, time: None, rewrite_with_meshio], ids=["alone", "meshio"])
@pytest.mark.parametrize("nodes", [3, 6])
def test_fields_are_read_as_written(tmp_path, nodes, again):
    """They agree to the last bit, with NaN and arrays of any layout, also if meshio has read and written them."""
    rng = np.random.default_rng(3)
    nodal = {"plain": rng.normal(size=5000), "vector": rng.normal(size=(5000, 3)), "empty": np.full(5000, np.nan)}
    nodal["strided"] = np.asfortranarray(rng.normal(size=(5000, 3)))
    celled = {"region": rng.normal(size=80)[::2]}
    written = Grid(rng.normal(size=(5000, 3)), rng.integers(0, 5000, (40, nodes)), nodal, celled, 100 / 3)
    field_files.write(tmp_path / "one.vtu", written)
    again(tmp_path / "one.vtu", written.time)
    read = field_files.read(tmp_path / "one.vtu")
    assert same_arrays(arrays_of(read), arrays_of(written)) and read.time == 100 / 3


@pytest.mark.parametrize("damage", [
    lambda text: "", lambda text: text[:-40], lambda text: text.replace("TimeValue", "Time"),
    lambda text: text.replace('Points="3"', 'Points="4"'),
    lambda text: text.replace('Components="3"', 'Components="2"'),
    lambda text: text.replace('type="UnstructuredGrid"', 'type="PolyData"'),
    lambda text: text.replace("LittleEndian", "BigEndian")])
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
