"""The RO-Crate: its metadata tell the files that are in it, and nothing else; `make crate` has it validated."""
import hashlib
import json
from pathlib import Path

import pytest

from paper_figures import FIGURES, crate, manifest
from verification.claims import EXPECTED, VERDICTS


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    """A folder as `make figures` leaves it, with pictures that are none."""
    folder = tmp_path_factory.mktemp("figures")
    told = json.loads(manifest.COMMITTED.read_text(encoding="utf-8"))
    told["environment"]["source"] = crate.source_hash()
    (folder / manifest.NAME).write_text(json.dumps(told))
    for name in (name for figure in told["figures"].values() for name in figure["pictures"]):
        (folder / name).write_bytes(name.encode())
    return folder


def several(value):
    return value if isinstance(value, list) else [value]


def test_every_file_is_told_as_it_is_and_the_run_is_that_of_the_figures(out, tmp_path):
    """No file is told that is not there; scenes and locks in, every picture out; what is referred to is told."""
    made = crate.write(out, tmp_path / "crate")
    graph = json.loads((made / crate.METADATA).read_text(encoding="utf-8"))["@graph"]
    found = {entity["@id"]: entity for entity in graph}
    told = {name for name, entity in found.items() if "File" in several(entity["@type"])}
    there = {path.relative_to(made).as_posix() for path in made.rglob("*") if path.is_file()} - {crate.METADATA}
    assert told == there and len(there) > 300 and len(found) == len(graph)
    for name in told:
        content = (made / name).read_bytes()
        assert found[name]["contentSize"] == str(len(content)), name
        assert found[name]["sha256"] == hashlib.sha256(content).hexdigest(), name
    values = [one for entity in graph for value in entity.values() for one in several(value)]
    pointed = {one["@id"] for one in values if isinstance(one, dict)}
    assert pointed - found.keys() <= {"https://w3id.org/ro/crate/1.1", "https://www.python.org"}
    drawn = {Path(one["@id"]).stem for one in found["#figures"]["result"]}
    assert drawn == {*FIGURES, "manifest"}
    claims = json.loads((made / "verification/claims/claims.json").read_text(encoding="utf-8"))
    assert [each["id"] for each in claims] == list(EXPECTED) and {each["verdict"] for each in claims} <= set(VERDICTS)


@pytest.mark.parametrize("source, why", [(None, "there are no figures; `make figures` makes them"),
                                         ("another", "those of another source"),
                                         (crate.source_hash(), "a figure is missing")])
def test_there_is_no_crate_without_figures_of_this_source(out, tmp_path, monkeypatch, capsys, source, why):
    """One line, status 2, nothing written."""
    monkeypatch.setattr(manifest, "OUT", tmp_path)
    if source:
        told = json.loads((out / manifest.NAME).read_text())
        told["environment"]["source"] = source
        (tmp_path / manifest.NAME).write_text(json.dumps(told))
    before = list(tmp_path.iterdir())
    assert crate.main() == 2 and list(tmp_path.iterdir()) == before
    assert why in capsys.readouterr().err
