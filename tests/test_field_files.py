"""A file without fields is refused. `test_vtk.py` reads fields back as they were written."""

import numpy as np
import pytest

from repro.errors import OutputError
from repro.results import field_files
from repro.results.field_files import Grid


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
