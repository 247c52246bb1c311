"""The RO-Crate: its metadata tell the files that are in it, and nothing else; `make crate` has it validated."""

import hashlib
import json
from pathlib import Path

import pytest

from paper_figures import FIGURES, crate, manifest
from tests.test_architecture import faults
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


@pytest.fixture(scope="module")
def made(out, tmp_path_factory):
    return crate.write(out, tmp_path_factory.mktemp("made") / "crate")


def entities(made):
    told = json.loads((made / crate.METADATA).read_text(encoding="utf-8"))["@graph"]
    found = {entity["@id"]: entity for entity in told}
    assert len(found) == len(told)
    return found


def several(value):
    return value if isinstance(value, list) else [value]


def refers(entity, key):
    return [one["@id"] for one in several(entity.get(key, []))]


def test_every_file_is_told_as_it_is(made):
    """And none that is not there."""
    told = {name: entity for name, entity in entities(made).items() if "File" in several(entity["@type"])}
    there = {path.relative_to(made).as_posix() for path in made.rglob("*") if path.is_file()} - {crate.METADATA}
    assert told.keys() == there and len(there) > 300
    for name, entity in told.items():
        content = (made / name).read_bytes()
        assert entity["contentSize"] == str(len(content)), name
        assert entity["sha256"] == hashlib.sha256(content).hexdigest(), name


def test_what_is_referred_to_is_told(made):
    """Every reference, and every file from the root."""
    found = entities(made)
    values = [one for entity in found.values() for value in entity.values() for one in several(value)]
    pointed = {one["@id"] for one in values if isinstance(one, dict)}
    assert pointed - found.keys() <= {"https://w3id.org/ro/crate/1.1", "https://www.python.org"}
    parts, left = set(), ["./"]
    while left:
        new = set(refers(found[left.pop()], "hasPart")) - parts
        parts |= new
        left += new
    kept = {name for name, entity in found.items() if {"File", "Dataset"} & set(several(entity["@type"]))}
    assert kept - {"./"} == parts


def test_the_run_is_that_of_the_figures(made):
    """Scenes and locks in, every picture out, by the workflow that is the crate's main entity."""
    found = entities(made)
    assert refers(found["./"], "mainEntity") == refers(found["#figures"], "instrument") == [crate.WORKFLOW]
    used, drawn = refers(found["#figures"], "object"), refers(found["#figures"], "result")
    assert {Path(name).name for name in used} == {"base.toml", "wide.toml", "initial_mesh.toml", "pyproject.toml",
                                                  "requirements.lock"}
    assert {Path(name).stem for name in drawn} == {*FIGURES, "manifest"} and len(drawn) == 2 * len(FIGURES) + 1
    judged = refers(found["#claims"], "result")
    assert {Path(name).name for name in judged} == {"replication.md", "claims.json"}
    told = json.loads((made / "verification/claims/claims.json").read_text(encoding="utf-8"))
    assert [each["id"] for each in told] == list(EXPECTED) and {each["verdict"] for each in told} <= set(VERDICTS)


def test_no_other_record_of_the_claims_is_packed(made):
    """One list of verdicts: a copy that nothing writes comes to tell others."""
    others = [path for path in made.rglob("*.json") if path.name not in ("claims.json", crate.METADATA)
              and '"verdict"' in path.read_text(encoding="utf-8") and '"C01"' in path.read_text(encoding="utf-8")]
    assert others == []


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


def test_the_lock_of_the_validator_holds_pins_and_hashes_and_no_address():
    lock = (crate.ROOT / ".ci" / "crate.lock").read_text(encoding="utf-8")
    assert faults(lock) == [] and "\nroc-validator==" in lock and "\nrocrate==" in lock
