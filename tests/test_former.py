"""Keys of earlier versions: scenes are refused with what to write instead, old runs still load."""
import json
import shutil
from dataclasses import replace
from functools import reduce

import pytest

import repro
from repro.cli import main
from repro.report import comparison
from repro.report.reading import read
from repro.scene import KEYS, former, load_scene, load_tables, parse_scene, scene_hash, scene_tables, without_former
from tests.pages import cached_run
from tests.shell import files, flags, read_record, refusal, rewrite

CHANGES = ("growth.end=0.4 h", "numerics.preset=fast", "output.every=0.2 h")
SCENE = load_scene("base", CHANGES)


@pytest.fixture
def removed(monkeypatch):
    """A key of an imagined earlier version."""
    monkeypatch.setitem(former.KEYS, "numerics.colour", former.Former("blue", "leave it out"))


@pytest.fixture
def earlier(removed, tmp_path):
    """The folder of a run, and a function that changes keys of [numerics] in its record."""
    folder = tmp_path / "earlier"
    shutil.copytree(cached_run(SCENE), folder)

    def change(**keys):
        record = read_record(folder)
        numerics = {**record["tables"]["numerics"], **keys}
        rewrite(folder, tables={**record["tables"], "numerics": numerics})

    return folder, change


@pytest.mark.parametrize("value", ["red", "blue"])
def test_a_former_key_is_refused_with_what_to_write(removed, tmp_path, capsys, value):
    """Whatever its value, in one line with exit status 2; from --set, a file and Python."""
    line = f'numerics.colour = "{value}": this key was removed; leave it out\n'
    assert refusal(tmp_path, capsys, "run", "base", "--set", f"numerics.colour={value}", "--out", tmp_path / "run"
                   ) == f"repro: base: {line}"
    scene = tmp_path / "mine.toml"
    scene.write_text(f'[numerics]\ncolour = "{value}"\n')
    assert refusal(tmp_path, capsys, "check", scene) == f"repro: {scene}: {line}"
    with pytest.raises(repro.SceneError) as error:
        load_scene({"numerics": {"colour": value}})
    assert f"{error.value}\n" == f"scene: {line}"


def test_no_former_key_is_a_key_of_a_scene():
    """Each with a value names a section that every scene has."""
    assert not former.KEYS.keys() & set(KEYS)
    assert {section for section, *_ in former._parts()} <= {"pore", "numerics", "output"}


@pytest.mark.parametrize("key, value", [
    (f"{section}.{key}", each.value_in({"preset": "fast"})) for section, key, each in former._parts()])
def test_the_advice_is_accepted(key, value):
    """Without a former key the scene is accepted."""
    change = f"{key}={value}"
    with pytest.raises(repro.SceneError, match=f"{key} = .*was removed"):
        load_scene("base", [change])
    assert replace(load_scene(load_tables("base", [change]), unset=[key]), name="base") == load_scene("base")


@pytest.mark.parametrize("keys, shown", [({"colour": "blue"}, []), ({"colour": "red"}, ["numerics.colour"])])
def test_a_run_of_an_earlier_version_loads_plots_and_compares(earlier, tmp_path, keys, shown):
    """Only a value that present scenes do not have is a difference from a run of this version."""
    folder, change = earlier
    change(**keys)
    results, present = repro.load_run(folder), repro.load_run(cached_run(SCENE))
    assert dict(results.columns).keys() == dict(present.columns).keys() and len(results.time) > 1
    assert (results["aggregate_area_um2"] == present["aggregate_area_um2"]).all()
    assert results.fields(results.time[-1])["places_um"].shape == present.fields(present.time[-1])["places_um"].shape
    assert [key for key, *_ in comparison.differences([read(cached_run(SCENE)), read(folder)])] == shown
    for command in (["plot", folder, "--out", tmp_path / "mine.svg"], ["check", folder],
                    ["plot", folder, "velocity", "--time", "0.4 h", "--out", tmp_path / "field.svg"],
                    ["compare", folder, cached_run(SCENE), "--out", tmp_path / "both.html"]):
        assert main([*map(str, command)]) == 0


def test_a_run_of_an_earlier_version_is_known_and_continues(earlier, tmp_path, capsys):
    """If its key has the value of present scenes: its hash counts the key, and a longer run needs no change."""
    folder, change = earlier
    change(colour="blue")
    before = files(folder)
    assert read_record(folder)["hash"] == scene_hash(SCENE)
    assert main(["run", "base", *flags(*CHANGES), "--out", str(folder)]) == 0 and files(folder) == before
    assert repro.resume(folder, ["growth.end=0.6 h"]).time[-1] == 0.6
    change(colour="red")
    assert 'numerics.colour = "red": this key was removed' in refusal(tmp_path, capsys, "run", "--resume", folder)


def test_the_hash_counts_former_keys(monkeypatch):
    """With the value that every scene has; so that removing a key changes no hash."""
    before = scene_hash(SCENE)
    monkeypatch.setitem(former.KEYS, "numerics.colour", former.Former("blue", "leave it out"))
    blue = scene_hash(SCENE)
    monkeypatch.setitem(former.KEYS, "numerics.colour", former.Former("red", "leave it out"))
    assert len({before, blue, scene_hash(SCENE)}) == 3


TABLE = [["0.0 h", "0.001 cm"], ["0.4 h", "0.003 cm"]]
SUPPLY = [["0.0 h", "4 mg/L"], ["4.0 h", "1 mg/L"]]
#: Hashes of base with these tables, by the key and `interpolation`, in commit f2a81844, which had this key.
HASHES = {
    ("flow.head", "steps"): "0f9105cf4e430e86",
    ("flow.head", "linear"): "0fc732b79f062e1f",
    ("substrates.acceptor.supply", "steps"): "0bf6ed84376382fe",
    ("substrates.acceptor.supply", "linear"): "9f31578c8de8dd51",
    ("substrates.donor.supply", "steps"): "2e9e8a75468e40d8",
    ("substrates.donor.supply", "linear"): "5a99eddaf4f84575",
}


@pytest.mark.parametrize("key, table", [
    ("flow.head", TABLE), ("substrates.acceptor.supply", SUPPLY), ("substrates.donor.supply", SUPPLY)])
@pytest.mark.parametrize("between", ["steps", "linear"])
def test_a_record_with_an_interpolation_is_that_of_the_present_table(key, table, between):
    """A scene with the former key is refused with what to write. Hashes are those of the earlier version."""
    section, _, name = key.rpartition(".")
    with pytest.raises(repro.SceneError, match=f"{section}.interpolation = .* was removed; write it in a table"):
        load_scene("base", [f"{section}.interpolation={between}"])
    present = load_scene("base", [f'{key}={{table={json.dumps(table)}, between="{between}"}}'])
    record = scene_tables(present)
    part = reduce(dict.__getitem__, section.split("."), record)
    part |= {name: table, "interpolation": between}
    assert parse_scene(without_former(record), "base", "run.json") == present
    assert scene_hash(present) == HASHES[key, between]


@pytest.mark.parametrize("tables", [
    {"flow": 3, "substrates": []}, {"flow": {"interpolation": ["linear"]}}, {"substrates": {"donor": 3}},
    {"substrates": {"donor": {"interpolation": "jumps", "supply": "1 mg/L"}}}])
def test_tables_that_a_user_has_altered_stay_as_they_are(tables):
    assert without_former(tables) == tables


@pytest.mark.parametrize("biomass, changes, hash", [
    ("viscous", [], "258d43232f9734d3"), ("brinkman", ["flow.permeability=1e-15 m^2"], "a38358ec5974b21d")])
def test_a_record_with_the_kind_of_biomass_is_that_of_the_present_keys(biomass, changes, hash):
    """Hashes are those of commit f2a81844, which had the key. Without its permeability a former kind stays."""
    # `fast` had one contact element when the hashes were made.
    present = load_scene("base", ["numerics.preset=fast", "numerics.contact_elements=1", *changes])
    record = scene_tables(present)
    record["flow"]["biomass"] = biomass
    assert parse_scene(without_former(record), "base", "run.json") == present and scene_hash(present) == hash
    other = {"flow": {"biomass": biomass, **({} if changes else {"permeability": "1e-15 m^2"})}}
    assert without_former(other) == other


@pytest.mark.parametrize("key, preset, kept, other", [
    (key, *case) for key, fast, paper in (("jacobian", "reused", "fresh"), ("elements", "quadratic", "linear"),
                                          ("time", "midpoint", "updates"))
    for case in (("fast", fast, paper), ("paper", paper, fast))])
def test_a_former_value_is_that_of_its_preset(key, preset, kept, other):
    """Newton's derivative, elements and steps were keys, and their values depended on the preset. A record with the
    value of its preset is that of the present scene; the hash of "fast" is that of commit f2a81844, which had these
    keys. Another value stays."""
    elements = ["numerics.contact_elements=1"] if preset == "fast" else []  # those of `fast` at this commit
    present = load_scene("base", [f"numerics.preset={preset}", *elements])
    record = scene_tables(present)
    record["numerics"][key] = kept
    assert parse_scene(without_former(record), "base", "run.json") == present
    assert preset == "paper" or scene_hash(present) == "258d43232f9734d3"
    record["numerics"][key] = other
    assert without_former(record) == record
