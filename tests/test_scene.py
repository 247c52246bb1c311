"""Scenes: Table 1 in internal units, --set, the round trip, and one clear line for everything that is not accepted."""
import dataclasses
import math
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from repro.scene import SceneError, load_scene, packaged_scenes, parse_scene, scene_hash, scene_tables


def refusal(source, *overrides) -> str:
    """The message of the SceneError, which is one line of bearable length."""
    with pytest.raises(SceneError) as caught:
        load_scene(source, overrides)
    message = str(caught.value)
    assert message.isprintable() and len(message) < 500 and "Traceback" not in message
    return message


def written(tmp_path, text, encoding="utf-8") -> Path:
    path = tmp_path / "mine.toml"
    path.write_bytes(text.encode(encoding))
    return path


# ---------------------------------------------------------------- Table 1

TABLE_1 = {  # worked out by hand: 1 m = 1e6 um, 1 cm2 = 1e8 um2, 1 day = 24 h, 1 cm2/s = 3.6e11 um2/h
    "pore.length": 600.0,
    "pore.width": 100.0,
    "aggregate.radius": 5.0,
    "flow.viscosity_ratio": 2000.0,
    "flow.kinematic_viscosity": 3.6108e9,
    "flow.gravity": 1.271376e14,
    "flow.density": 998000.0,
    "substrates.acceptor.supply": 10.0,
    "substrates.donor.supply": 10.0,
    "substrates.acceptor.half_saturation": 1.0,
    "substrates.donor.half_saturation": 1.0,
    "substrates.acceptor.diffusivity": 2.32e8 / 24,
    "substrates.acceptor.diffusivity_in_aggregate": 1.85e8 / 24,
    "substrates.donor.diffusivity": 1.01e8 / 24,
    "substrates.donor.diffusivity_in_aggregate": 0.81e8 / 24,
    "substrates.boundary": "open",
    "kinetics.maximum_utilization_rate": 0.3875,
    "kinetics.yield_coefficient": 0.61,
    "kinetics.decay_coefficient": 0.005,
    "kinetics.degradable_fraction": 0.8,
    "kinetics.decay_oxygen_demand": 1.42,
    "kinetics.acceptor_to_donor_ratio": 1.52,
    "kinetics.maximum_density": 30000.0,
    "growth.time_step": 0.2,
    "growth.shear_modulus": 0.01,
    "growth.minimum_contact_angle": 16.7 * math.pi / 180,
    "growth.minimum_film": 2.0,
    "growth.new_biomass": "stressed",
    "numerics.preset": "paper",
    "numerics.transport": "quasi_steady",
    "numerics.transfer": "conserving",
    "numerics.extent": "central",
    "numerics.interface": "laplacian",
    "numerics.inlet": "local",
    "numerics.fixed_point": "kept",
    "numerics.refinement": 1.0,
    "numerics.flow_stabilisation": 100.0,
    "numerics.mesh_compressibility": 1.0,
}
GIVEN = {"name", "growth.end", "flow.head", "flow.mean_velocity", "output.times"}


def flat(section, prefix="") -> dict:
    values = {f"{prefix}{f.name}": getattr(section, f.name) for f in dataclasses.fields(section)}
    nested = {k: v for k, v in values.items() if dataclasses.is_dataclass(v)}
    leaves = {k: v for k, v in values.items() if k not in nested}
    return leaves | {k: v for name, part in nested.items() for k, v in flat(part, f"{name}.").items()}


@pytest.fixture
def everything():
    """Every section, as empty as it may be."""
    tables = {"aggregate": {}, "flow": {"head": "1e-3 cm"}, "substrates": {}, "growth": {"end": "1 h"}}
    return parse_scene(tables, "everything", "mine.toml")


def test_defaults_are_table_1(everything):
    values = {key: value for key, value in flat(everything).items() if key not in GIVEN}
    assert set(values) == set(TABLE_1)
    for key, value in TABLE_1.items():
        assert values[key] == (value if isinstance(value, str) else pytest.approx(value, rel=1e-15)), key


def test_units_give_the_papers_velocity_in_a_clean_channel():
    scene = load_scene("base")
    conductivity = scene.flow.gravity * scene.pore.width**2 / (12 * scene.flow.kinematic_viscosity)
    velocity = conductivity * scene.flow.head / scene.pore.length
    assert velocity * 24e-6 == pytest.approx(2.934, abs=0.001)  # m/day


def test_paper_rounds_the_acceptor_to_donor_ratio(everything):
    kinetics = everything.kinetics
    assert kinetics.acceptor_to_donor_ratio != pytest.approx(2.38 - kinetics.yield_coefficient * 1.42, abs=0.005)


# ---------------------------------------------------------------- packaged scenes and sections


def test_packaged_scenes():
    assert packaged_scenes() == ("base", "flow_only", "initial_mesh", "wide")
    base, wide = load_scene("base"), load_scene("wide")
    assert (base.pore.width, base.pore.length, base.aggregate.radius) == (50, 600, 5)
    assert (base.flow.head, base.flow.mean_velocity, base.growth.end) == (10, None, 19.4)
    assert (wide.pore.width, wide.pore.length, wide.aggregate.radius) == (100, 600, 5)
    assert (wide.flow.head, wide.growth.end) == (None, 45)
    assert wide.flow.mean_velocity == pytest.approx(2.9e6 / 24, rel=1e-15)
    assert {s.supply for x in (base, wide) for s in (x.substrates.acceptor, x.substrates.donor)} == {10}


@pytest.mark.parametrize("name, absent", [
    ("base", set()),
    ("wide", set()),
    ("initial_mesh", {"flow", "substrates", "kinetics", "growth"}),
    ("flow_only", {"substrates", "kinetics", "growth"}),
])
def test_an_absent_section_is_none(name, absent):
    scene = load_scene(name)
    assert scene.name == name
    assert {f.name for f in dataclasses.fields(scene) if getattr(scene, f.name) is None} == absent


def test_kinetics_come_with_substrates_and_aggregate():
    assert load_scene("flow_only", ["substrates={}"]).kinetics.yield_coefficient == 0.61
    assert parse_scene({"substrates": {}}, "clean", "mine.toml").kinetics is None
    assert "[substrates]" in refusal("flow_only", "kinetics.yield_coefficient=0.5")


def test_a_file_is_read_with_its_stem_for_a_name(tmp_path):
    path = written(tmp_path, '\ufeff[pore]\r\nwidth = "0.08 mm"\r\n[aggregate]\r\nradius = "20 µm"\r\n')
    for source in (path, str(path)):
        scene = load_scene(source)
        assert (scene.name, scene.pore.width, scene.pore.length, scene.aggregate.radius) == ("mine", 80, 600, 20)


def test_pint_is_not_imported_before_a_scene_is_read():
    script = "import repro.scene, sys; sys.exit('pint' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0


# ---------------------------------------------------------------- units


@pytest.mark.parametrize("override, section, key, value", [
    ('growth.end="1164 min"', "growth", "end", 19.4),
    ('growth.end="69840 s"', "growth", "end", 19.4),
    ("growth.end=1 day", "growth", "end", 24.0),
    ("growth.end=+.5e1h", "growth", "end", 5.0),
    ("growth.minimum_contact_angle=0.25 rad", "growth", "minimum_contact_angle", 0.25),
    ("growth.shear_modulus=5 kPa", "growth", "shear_modulus", 0.005),
    ("flow.head=0.01 mm", "flow", "head", 10.0),
    ("flow.gravity=1 m/s**2", "flow", "gravity", 1.296e13),
    ("flow.density=1 g/cm^3", "flow", "density", 1e6),
    ("flow.kinematic_viscosity=1e-6 m^2 s^-1", "flow", "kinematic_viscosity", 3.6e9),
    ("kinetics.decay_coefficient=0.48 /day", "kinetics", "decay_coefficient", 0.02),
    ("kinetics.maximum_utilization_rate=4.8 mg/mg/day", "kinetics", "maximum_utilization_rate", 0.2),
    ("kinetics.maximum_density=30 g/L", "kinetics", "maximum_density", 30000.0),
    ("flow.viscosity_ratio=500", "flow", "viscosity_ratio", 500.0),
])
def test_conversion_is_rounded_once(override, section, key, value):
    read = getattr(getattr(load_scene("base", [override]), section), key)
    assert read == value and isinstance(read, float)


# ---------------------------------------------------------------- --set


@pytest.mark.parametrize("quoted, bare", [
    ('growth.end="5 h"', "growth.end=5 h"),
    ("growth.end='5 h'", " growth.end = 5 h "),
    ('aggregate.radius="20 um"', "aggregate.radius=20 um"),
    ('numerics.transport="gear"', "numerics.transport=gear"),
    ('substrates.acceptor.supply="0 mg/L"', "substrates.acceptor.supply=0 mg/L"),
])
def test_set_reads_a_bare_string_like_a_quoted_one(quoted, bare):
    changed = load_scene("base", [quoted])
    assert changed == load_scene("base", [bare])
    assert changed != load_scene("base")


def test_set_reads_lists_and_numbers_and_the_last_one_wins():
    times = 'output.times=["16 h", "30 min", "8 h", "0.5 h"]'
    overrides = [times, "flow.viscosity_ratio=1", "flow.viscosity_ratio=2e2"]
    scene = load_scene("base", overrides)
    assert scene.output.times == (0.5, 8.0, 16.0)
    assert scene.flow.viscosity_ratio == 200


def test_set_creates_an_absent_section():
    scene = load_scene("initial_mesh", ["flow.head=1e-3 cm", "substrates.donor.supply=3 mg/L", "growth.end=0 h"])
    assert (scene.flow.head, scene.substrates.donor.supply, scene.growth.end) == (10, 3, 0)
    assert scene.substrates.acceptor.supply == 10
    assert load_scene("initial_mesh").flow is None


def test_a_value_cannot_smuggle_in_another_key():
    assert "pore.width" in refusal("base", 'pore.width="9 um"\nlength="9 um"')


@pytest.mark.parametrize("override", ["", "pore.width", "=5 um", " = 5", "pore.=5 um", ".width=5 um", "a..b=5 um"])
def test_set_needs_a_key_and_a_value(override):
    assert "KEY=VALUE is needed" in refusal("base", override)


# ---------------------------------------------------------------- refusals


LENGTH = 'a length is needed, such as "100 um" (greater than zero)'


@pytest.mark.parametrize("override, said", [
    # unknown keys and sections
    ('pore.widht="50 um"', 'pore.widht = "50 um": there is no such key; [pore] takes width, length (did you mean'),
    ("substrates.oxygen.supply=1 mg/L", "[substrates] takes acceptor, donor, boundary"),
    ("substrates.donor.suply=1 mg/L", "(did you mean supply?)"),
    ("por.width=50 um", "(did you mean pore?)"),
    ("name=x", "a scene takes pore, aggregate, flow, substrates, kinetics, growth, numerics, output"),
    # wrong dimension, no unit, no number
    ('pore.width="50 s"', f'base: pore.width = "50 s": {LENGTH}'),
    ("pore.width=50", f"base: pore.width = 50: {LENGTH}"),
    ("pore.width=50.0", LENGTH),
    ("pore.width=true", f"pore.width = true: {LENGTH}"),
    ("pore.width=nan", LENGTH),
    ("pore.width=nan um", LENGTH),
    ("pore.width=inf um", LENGTH),
    ("pore.width=", f'pore.width = "": {LENGTH}'),
    ("pore.width=um", LENGTH),
    ("pore.width=50 furlongsies", LENGTH),
    ("pore.width=50 um^9^9^9^9", LENGTH),
    ("pore.width=50 um*(1+1)", LENGTH),
    ("pore.width=__import__('os') um", LENGTH),
    ("pore.width=50 um_", LENGTH),
    ("pore.width=1e400 um", LENGTH),
    ("pore.width=1e308 m", LENGTH),
    ("pore.width=1e-400 um", LENGTH),
    ("pore.width=1e999999999999 um", LENGTH),
    ("pore.width=1e-999999999999 um", LENGTH),
    (f"pore.width={'9' * 100_000} um", LENGTH),
    (f"pore.width=5 {'u' * 100_000}", LENGTH),
    ("pore.width=12:30:00", LENGTH),
    ('pore.width=["50 um"]', f'pore.width = ["50 um"]: {LENGTH}'),
    ('growth.end="soon"', 'growth.end = "soon": a time is needed, such as "19.4 h" (zero or more)'),
    ("growth.end=5 um", "a time is needed"),
    ("growth.minimum_contact_angle=3 ppm", "an angle is needed"),
    ("growth.shear_modulus=1 N", "a pressure or modulus is needed"),
    ("flow.head=10 Pa", "a length is needed"),
    ("flow.kinematic_viscosity=1 Pa s", "kinematic viscosity is needed"),
    ("flow.gravity=9.81 m/s", "an acceleration is needed"),
    ("substrates.donor.supply=1 mol/L", "a concentration or density is needed"),
    ("kinetics.decay_coefficient=0.1", "a rate is needed"),
    ("flow.viscosity_ratio=5 um", 'flow.viscosity_ratio = "5 um": a plain number is needed, such as 2000'),
    ('flow.viscosity_ratio="500"', "a plain number is needed"),
    ("flow.viscosity_ratio=nan", "a plain number is needed"),
    ("flow.viscosity_ratio=inf", "a plain number is needed"),
    ("flow.viscosity_ratio=true", "a plain number is needed"),
    (f"flow.viscosity_ratio=1{'0' * 400}", "a plain number is needed"),
    (f"flow.viscosity_ratio=0x{'f' * 9000}", "a plain number is needed"),
    # a table for a value and the reverse
    ("pore.width={}", LENGTH),
    ("pore.width.value=5 um", "pore.width"),
    ("pore=5", "pore = 5: a table [pore] is needed, with the keys width, length"),
    ("substrates.acceptor=5 mg/L", "a table [substrates.acceptor] is needed"),
    ("pore=[{}]", "a table [pore] is needed"),
    # ranges
    ('pore.width="-50 um"', LENGTH),
    ('pore.length="0 um"', "pore.length"),
    ("aggregate.radius=0 um", "greater than zero"),
    ("flow.head=0 um", "greater than zero"),
    ("flow.viscosity_ratio=-1", "greater than zero"),
    ("flow.viscosity_ratio=0", "greater than zero"),
    ("flow.kinematic_viscosity=0 cm^2/s", "greater than zero"),
    ("flow.gravity=-9.81 m/s^2", "greater than zero"),
    ("flow.density=0 g/L", "greater than zero"),
    ("substrates.acceptor.supply=-1 mg/L", "zero or more"),
    ("substrates.acceptor.half_saturation=0 mg/L", "greater than zero"),
    ("substrates.donor.diffusivity=0 cm^2/day", "greater than zero"),
    ("substrates.donor.diffusivity_in_aggregate=-1 cm^2/day", "greater than zero"),
    ("kinetics.maximum_utilization_rate=-1 1/day", "zero or more"),
    ("kinetics.decay_coefficient=-1 1/day", "zero or more"),
    ("kinetics.yield_coefficient=0", "greater than 0, at most 1"),
    ("kinetics.yield_coefficient=1.01", "greater than 0, at most 1"),
    ("kinetics.degradable_fraction=-0.1", "from 0 to 1"),
    ("kinetics.degradable_fraction=1.1", "from 0 to 1"),
    ("kinetics.decay_oxygen_demand=0", "greater than zero"),
    ("kinetics.acceptor_to_donor_ratio=0", "greater than zero"),
    ("kinetics.maximum_density=0 mg/L", "greater than zero"),
    ("growth.end=-1 h", "zero or more"),
    ("growth.time_step=0 h", "greater than zero"),
    ("growth.shear_modulus=0 MPa", "greater than zero"),
    ("growth.minimum_film=0 um", "greater than zero"),
    ("growth.minimum_contact_angle=0 deg", "between 0 and 90 deg"),
    ("growth.minimum_contact_angle=90 deg", "between 0 and 90 deg"),
    ("numerics.refinement=0", "greater than zero"),
    ("numerics.flow_stabilisation=0", "greater than zero"),
    ("numerics.mesh_compressibility=-1", "greater than zero"),
    # words
    ("numerics.preset=best", 'numerics.preset = "best": "paper" is needed'),
    ("numerics.transport=bdf", '"quasi_steady" or "gear" is needed'),
    ("numerics.transfer=exact", '"conserving" or "linear" is needed'),
    ("numerics.extent=half", '"central" or "full" is needed'),
    ("numerics.interface=none", '"laplacian" or "traction" is needed'),
    ("numerics.inlet=none", '"local" or "mean" is needed'),
    ("numerics.fixed_point=none", '"kept" or "rechosen" is needed'),
    ("numerics.transport=1", "numerics.transport = 1"),
    ("substrates.boundary=shut", '"open" or "closed" is needed'),
    ("growth.new_biomass=none", '"stressed" or "stress_free" is needed'),
    # several keys
    ('aggregate.radius="80 um"', 'aggregate.radius = "80 um": less than pore.width (50 um)'),
    ("aggregate.radius=50 um", "aggregate.radius"),
    ("pore.length=10 um", 'aggregate.radius = "5 um": less than pore.width (50 um) and half of pore.length (10 um)'),
    ('flow.mean_velocity="1 m/day"', 'flow.mean_velocity = "1 m/day": flow.head (10.0 um) is given too'),
    ("substrates.boundary=closed", 'substrates.boundary = "closed": "open" is needed with [flow]'),
    ("growth.minimum_film=50 um", "growth.minimum_film"),
    ("pore.width=1.5 um", "aggregate.radius"),
    # times
    ("output.times=5 h", "a list of times is needed"),
    ("output.times=[]", "a list of times is needed"),
    ("output.times=[5 h, 6 h]", "a list of times is needed"),
    ("output.times=[5]", "a list of times is needed"),
    ('output.times=["5 um"]', "a list of times is needed"),
    ('output.times=["-1 h", "1 h"]', "a list of times is needed"),
    ('output.times=[["1 h"]]', "a list of times is needed"),
    ('output.times=["1 h", "19.5 h"]', "none after 19.4 h is accepted: growth.end is 19.4 h"),
])
def test_refused(override, said):
    message = refusal("base", override)
    assert message.startswith("base: ") and said in message
    assert override.split("=")[0].removesuffix(".value").split(".")[-1] in message  # the key that was set


@pytest.mark.parametrize("source, overrides, said", [
    ("wide", ["flow.mean_velocity=0 m/day"], 'flow.mean_velocity = "0 m/day": greater than zero is needed, or num'),
    ("wide", ["flow.mean_velocity=-1 m/day"], "a velocity is needed"),
    ("wide", ["flow.head=1 cm"], 'flow.mean_velocity = "2.9 m/day": flow.head (10000.0 um) is given too'),
    ("initial_mesh", ["flow.viscosity_ratio=5"], "flow.head is missing: it or flow.mean_velocity is needed"),
    ("initial_mesh", ["substrates.boundary=closed"], '"open" is needed, or numerics.transport = "gear"'),
    ("flow_only", ["growth.end=1 h"], "growth = "),
    ("flow_only", ["substrates={}", "growth.time_step=1 h"], 'growth.end is missing: a time is needed'),
    ("flow_only", ['output.times=["1 h"]'], "none after 0 h is accepted: there is no [growth]"),
])
def test_refused_by_what_else_the_scene_says(source, overrides, said):
    message = refusal(source, *overrides)
    assert message.startswith(f"{source}: ") and said in message


def test_growth_needs_an_aggregate():
    with pytest.raises(SceneError, match=r"mine.toml: growth = .*: \[aggregate\] and \[substrates\] are needed"):
        parse_scene({"substrates": {}, "growth": {"end": "1 h"}}, "mine", "mine.toml")


def test_a_default_that_does_not_fit_is_shown():
    with pytest.raises(SceneError, match=r'mine.toml: aggregate.radius = "5.0 um": less than pore.width \(4 um\)'):
        parse_scene({"pore": {"width": "4 um"}, "aggregate": {}}, "mine", "mine.toml")


@pytest.mark.parametrize("source, overrides", [
    ("base", ["growth.end=0 h"]),
    ("base", ["growth.end=0 h", 'output.times=["0 h"]']),
    ("base", ['output.times=["19.4 h", "1164 min"]']),
    ("flow_only", ['output.times=["0 h"]']),
    ("base", ["substrates.acceptor.supply=0 mg/L", "substrates.donor.supply=-0 mg/L"]),
    ("base", ["kinetics.decay_coefficient=0 1/day", "kinetics.maximum_utilization_rate=0 1/day"]),
    ("base", ["kinetics.degradable_fraction=0", "kinetics.yield_coefficient=1"]),
    ("base", ["aggregate.radius=49.9 um"]),
    ("wide", ["flow.mean_velocity=0 m/day", "numerics.transport=gear"]),
    ("flow_only", ["flow.mean_velocity=0 m/day"]),
    ("initial_mesh", ["substrates.boundary=closed", "numerics.transport=gear"]),
    ("initial_mesh", ["substrates={}"]),
])
def test_the_edge_of_what_is_accepted(source, overrides):
    scene = load_scene(source, overrides)
    assert parse_scene(scene_tables(scene), scene.name, "again") == scene


# ---------------------------------------------------------------- files


def test_a_missing_file_is_answered_with_the_packaged_names():
    said = "neither a file nor a packaged scene (base, flow_only, initial_mesh, wide)"
    assert refusal("no_such_scene.toml") == f"no_such_scene.toml: {said}"
    for source in ("", "base\0", "x" * 200 + "/\n", "BASE"):
        assert said in refusal(source)


def test_a_directory_is_refused(tmp_path):
    assert "a directory, not a packaged scene" in refusal(tmp_path)


def test_a_file_that_cannot_be_read_is_refused(tmp_path, monkeypatch):
    path = written(tmp_path, "[pore]")

    def denied(self):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "read_bytes", denied)
    assert "mine.toml: cannot be read (Permission denied)" in refusal(str(path))


def test_not_toml_gives_the_parsers_line(tmp_path):
    message = refusal(written(tmp_path, '[pore]\nwidth = 50 um\n'))
    assert "mine.toml: not TOML: " in message and "line 2" in message


@pytest.mark.parametrize("text", ["a = " + "[" * 100_000, "a = " + "9" * 5000, "[pore]\n[pore]", "a = 1\na = 2"])
def test_hostile_toml_is_refused(tmp_path, text):
    assert "not TOML: " in refusal(written(tmp_path, text))


def test_keys_nested_by_the_thousand_are_refused(tmp_path):
    assert "there is no such key" in refusal(written(tmp_path, ".".join("a" * 5000) + " = 1"))


def test_not_utf_8_is_refused(tmp_path):
    assert "not UTF-8 text (at byte 3)" in refusal(written(tmp_path, "# µ", "latin-1"))


def test_control_characters_do_not_break_the_line(tmp_path):
    assert "there is no such key" in refusal(written(tmp_path, '[pore]\n"wid\\nth\\u001b[31m" = "5\\n um"'))
    assert "\\n" in refusal(written(tmp_path, '[pore]\nwidth = "5\\n um"'))


def test_what_is_long_is_shortened():
    assert len(refusal("base", f"pore.width={'x' * 10_000}")) < 200
    assert len(refusal("base", f"pore.{'x' * 10_000}=1")) < 200
    assert len(refusal("base", "x" * 10_000)) < 200


def test_what_would_never_end_is_refused():
    """Mutants: no bound on the number of shape updates, on the size of the seed, on the refinement."""
    for entry in ("growth.time_step=1e-9 h", "aggregate.radius=1e-6 um", "numerics.refinement=1e9"):
        with pytest.raises(SceneError, match=entry.split("=")[0]):
            load_scene("base", [entry])


# ---------------------------------------------------------------- round trip and hash


def test_round_trip_of_every_packaged_scene(everything):
    for scene in (everything, *map(load_scene, packaged_scenes())):
        assert parse_scene(scene_tables(scene), scene.name, "again") == scene


@given(st.floats(1e-300, 1e300), st.floats(0, math.pi / 2, exclude_min=True, exclude_max=True), st.floats(0, 1e300))
def test_round_trip_is_exact(size, angle, velocity):
    tables = {
        "pore": {"width": f"{10 * size!r} um", "length": f"{100 * size!r} um"},
        "aggregate": {"radius": f"{size!r} um"},
        "flow": {"mean_velocity": f"{velocity!r} um/h", "viscosity_ratio": size},
        "substrates": {"donor": {"diffusivity": f"{size!r} um^2/h", "supply": f"{velocity!r} mg/L"}},
        "growth": {"end": f"{velocity!r} h", "minimum_contact_angle": f"{angle!r} rad",
                   "time_step": f"{max(velocity, 1e-300)!r} h", "minimum_film": f"{size!r} um"},
        "numerics": {"transport": "gear"},
        "output": {"times": [f"{velocity!r} h"]},
    }
    scene = parse_scene(tables, "drawn", "drawn")
    assert (scene.aggregate.radius, scene.growth.minimum_contact_angle) == (size, angle)
    assert (scene.substrates.donor.supply, scene.output.times) == (velocity, (velocity,))
    assert parse_scene(scene_tables(scene), "drawn", "again") == scene


def test_tables_spell_out_every_default_and_nothing_absent():
    assert set(scene_tables(load_scene("flow_only"))) == {"pore", "aggregate", "flow", "numerics", "output"}
    assert scene_tables(load_scene("base"))["growth"]["minimum_film"] == "2.0 um"
    assert "mean_velocity" not in scene_tables(load_scene("base"))["flow"]


def test_hash_is_of_what_is_said_not_of_how(tmp_path):
    base = load_scene("base")
    same = load_scene("base", ["growth.end=1164 min", "flow.viscosity_ratio=2000", "kinetics.yield_coefficient=0.61"])
    renamed = dataclasses.replace(base, name="another")
    assert scene_hash(base) == scene_hash(same) == scene_hash(renamed)
    zeros = [load_scene("base", [f"kinetics.degradable_fraction={zero}"]) for zero in ("0", "-0.0")]
    assert scene_hash(zeros[0]) == scene_hash(zeros[1])
    assert len(scene_hash(base)) == 16 and int(scene_hash(base), 16) >= 0


@pytest.mark.parametrize("override", [
    "growth.end=19.2 h",
    "numerics.transport=gear",
    "substrates.donor.supply=9 mg/L",
    'output.times=["1 h"]',
    "kinetics.acceptor_to_donor_ratio=1.5138",
])
def test_hash_changes_with_every_part(override):
    assert scene_hash(load_scene("base", [override])) != scene_hash(load_scene("base"))


def test_hash_is_the_same_in_another_process():
    script = "from repro.scene import *; print(scene_hash(load_scene('base')))"
    run = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True)
    assert run.stdout.strip() == scene_hash(load_scene("base"))
