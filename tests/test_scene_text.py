"""`repro scene` writes every key with its default, unit, range and source; its output is the scene that was read."""

import re
import tomllib
from runpy import run_path

import pytest

from repro.cli import main
from repro.scene import PRESETS, Scene, load_scene, packaged_scenes, parse_scene
from repro.scene.reading import entries
from repro.scene.text import scene_text
from tests.blocks import ROOT

#: Keys that exclude another one that is set: they stay commented out.
OTHER_DRIVE = {"head", "mean_velocity", "rate"}
#: Keys without a default: the text has an example.
EXAMPLES = {"times", "every", "outline", "name", "donor_oxygen_demand", "permeability", "bonding_strength",
            "tensile_strength", "depth"}


def fields(kind, above=""):
    """(dotted key, field) of every key and section."""
    for key, entry in entries(kind).items():
        yield above + key, entry
        if "section" in entry.metadata:
            yield from fields(entry.metadata["section"], f"{above}{key}.")


def parsed(text, name):
    return parse_scene(tomllib.loads(text), name, "again")


def uncommented(text, left_out=()):
    """The text with every key and section active."""
    def active(line):
        key = line[1:].partition(" ")[0]
        return line[1:] if re.match(r"#[\[a-z]", line) and key not in left_out else line
    return "\n".join(map(active, text.splitlines()))


def test_the_page_of_keys_has_a_row_and_an_anchor_for_each_key():
    """With its default, what it accepts and its source; a section has a heading."""
    page = run_path(str(ROOT / "docs" / "site" / "scene_keys.py"))["render"]()
    rows = {line.partition('"></a>')[0].rpartition('"')[2]: line for line in page.splitlines() if "<a id=" in line}
    keys = {key: entry for key, entry in fields(Scene) if "section" not in entry.metadata}
    assert rows.keys() == keys.keys() and page.count("<a id=") == len(keys)
    assert all(re.search(rf"^## `\[{key}\]`$", page, re.M) for key, entry in fields(Scene) if key not in keys)
    for key, entry in keys.items():
        assert entry.metadata["kind"].accepted in rows[key] and rows[key].endswith(f"| {entry.metadata['source']} |")
    assert '| um | a length, from 1 nm to 1 m | "100 um" |' in rows["pore.width"]


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("name", packaged_scenes())
def test_the_output_is_the_scene_alone(name, preset, capsys):
    """The scene stays the same if all defaults of its sections are made active."""
    change = f"numerics.preset={preset}"
    assert main(["scene", name, "--set", change]) == 0
    text, errors = capsys.readouterr()
    lines, inside = [], True
    for line in text.splitlines():
        inside = line.startswith("[") if re.match(r"#?\[", line) else inside
        lines.append(line if inside else "")
    active = uncommented("\n".join(lines), left_out={*OTHER_DRIVE, *EXAMPLES})
    assert parsed(text, name) == parsed(active, name) == load_scene(name, [change])
    assert errors == "" and text.isascii()


@pytest.mark.parametrize("name", packaged_scenes())
def test_every_key_may_be_made_active_at_once(name):
    drive = load_scene(name).flow
    excluded = {"rate", "head" if drive and drive.head is None else "mean_velocity"}
    text, _ = without_erosion(scene_text(name))
    scene = parsed(uncommented(text, left_out={*excluded, "outline", "permeability"}), name)
    assert None not in (scene.aggregate, scene.flow, scene.substrates, scene.kinetics, scene.growth)
    assert scene.output.times == (5.0, 18.0)


def without_erosion(text):
    """The text without [growth.erosion], which excludes the stress of growth and other keys, and this section."""
    section = text[text.index("#[growth.erosion]"):text.index("[numerics]")]
    return text.replace(section, ""), section


def test_the_section_of_erosion_may_be_made_active():
    """With the key of its law alone, and what it needs."""
    _, section = without_erosion(scene_text("base"))
    section = uncommented(section, left_out={"thickness_coefficient", "shear_coefficient"})
    tables = tomllib.loads(f'[aggregate]\n[substrates]\n[growth]\nend = "1 h"\nnew_biomass = "stress_free"\n{section}')
    assert parse_scene(tables, "base", "again").growth.erosion.speed == 0.1


@pytest.mark.parametrize("name", packaged_scenes())
def test_every_key_is_written_with_its_range_and_source(name):
    text = re.sub(r"\n# ", " ", scene_text(name))
    for _, entry in fields(Scene):
        accepted = entry.metadata["kind"].accepted if "kind" in entry.metadata else ""
        expected = {entry.metadata["about"], entry.metadata["source"], accepted}
        assert {words for words in expected if words not in text} == set()


def test_a_file_keeps_its_own_values(tmp_path, capsys):
    """The name of the file adds no key."""
    path = tmp_path / 'mine\n[growth]\nend = "1 h"\u00e9.toml'
    path.write_text('# mine\n[pore]\nwidth = "0.08 mm"\n[aggregate]\n[flow]\nmean_velocity = "1 m/day"\n')
    assert main(["scene", str(path), "--set", "flow.viscosity_ratio=500"]) == 0
    text = capsys.readouterr().out
    assert 'width = "0.08 mm"' in text and "\nviscosity_ratio = 500\n" in text and '#length = "600 um"' in text
    assert parsed(text, path.stem) == load_scene(path, ["flow.viscosity_ratio=500"]) and text.isascii()


def test_the_text_has_the_defaults_of_presets():
    text = scene_text("base", ["numerics.preset=accurate"])
    assert "#refinement = 0.45" in text
    assert "0.2 (fast), 0.45 (accurate), 0.7 (exact), 1.0 (paper)" in text.replace("\n# ", " ")


def test_the_command_without_a_scene_lists_the_packaged_ones(capsys):
    assert main(["scene"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(packaged_scenes())
    assert "Figure 6: a wider pore" in lines[-1]
