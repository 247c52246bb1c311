"""Scenes that are refused: one line names file, key, value and the accepted values."""
import re
import subprocess
import time
import tomllib
from datetime import date
from functools import reduce
from pathlib import Path

import numpy as np
import pint
import pytest

from repro.scene import Scene, exact, files, load_scene, load_tables, parse_scene, scene_tables, units
from repro.scene.reading import NOT_MODELLED, SCOPE, toml
from tests.blocks import ROOT
from tests.test_scene import refusal, write_scene
from tests.test_scene_text import fields

LENGTH = 'a length is needed, such as "100 um" (from 1 nm to 1 m)'
DEEP = ".".join("a" * 20_000)
SCOPED = "is not modelled, see `repro docs scope`"
DONOR = "substrates.donor.supply"
MOLES = "; moles need a molar mass, which is not known here: give milligrams"


#: {part of the message: entries of --set}.
REFUSED = {
    # unknown keys and sections
    'pore.widht = "50 um": there is no such key; [pore] takes width, length, upper_wall, depth (did you mean': [
        'pore.widht="50 um"'],
    "[substrates] takes acceptor, donor, boundary": ["substrates.oxygen.supply=1 mg/L"],
    "(did you mean supply?)": ["substrates.donor.suply=1 mg/L"],
    "a scene takes pore, aggregate, flow, substrates, kinetics, growth, numerics, output": ["name=x"],
    "KEY=VALUE is needed": ["", "pore.width", "=5 um", " = 5", "pore.=5 um", ".width=5 um", "a..b=5 um", "x" * 10_000],
    "a key of at most 8 parts is needed": [f"{DEEP}=1"],
    # wrong dimension, no unit, no number, a table for a value
    f'base: pore.width = "50 s": {LENGTH}': ['pore.width="50 s"'],
    f"base: pore.width = 50: {LENGTH}": ["pore.width=50"],
    f"pore.width = true: {LENGTH}": ["pore.width=true"],
    f'pore.width = "": {LENGTH}': ["pore.width="],
    f'pore.width = ["50 um"]: {LENGTH}': ['pore.width=["50 um"]'],
    LENGTH: ["pore.width=50.0", "pore.width=nan", "pore.width=nan um", "pore.width=inf um", "pore.width=um",
             "pore.width=50 furlongsies", "pore.width=50 um^9^9^9^9", "pore.width=50 um*(1+1)", "pore.width=50 um_",
             "pore.width=__import__('os') um", "pore.width=1e400 um", "pore.width=1e308 m", "pore.width=1e-400 um",
             "pore.width=1e999999999999 um", "pore.width=1e-999999999999 um", f"pore.width={'9' * 100_000} um",
             f"pore.width=5 {'u' * 100_000}", "pore.width=12:30:00", "pore.width={}", 'pore.width="-50 um"',
             "pore.width=80 %", f"pore.width={{{DEEP}=1}}", "pore.width=1e-300 um", "pore.width=0.9 nm",
             "pore.width=1.1 m", "pore.width=1e160 um"],
    'growth.end = "soon": a time is needed, such as "19.4 h" (zero or more)': ['growth.end="soon"'],
    "a time is needed": ["growth.end=5 um", "growth.end=80 %"],
    "kinematic viscosity is needed": ["flow.kinematic_viscosity=1 Pa s", "substrates.donor.diffusivity=80 %"],
    "a concentration or density is needed": ["substrates.donor.supply=1 mol/L"],
    'flow.viscosity_ratio = "5 um": a plain number is needed, such as 2000': ["flow.viscosity_ratio=5 um"],
    "a plain number is needed": ['flow.viscosity_ratio="500"', "flow.viscosity_ratio=nan", "flow.viscosity_ratio=inf",
                                 "flow.viscosity_ratio=true", f"flow.viscosity_ratio=1{'0' * 400}",
                                 f"flow.viscosity_ratio=0x{'f' * 9000}"],
    # a value for a table
    "pore.width": ["pore.width.value=5 um"],
    "pore = 5: a table [pore] is needed, with the keys width, length": ["pore=5"],
    "a table [substrates.acceptor] is needed": ["substrates.acceptor=5 mg/L"],
    "a table [pore] is needed": ["pore=[{}]", f"pore={{{DEEP}=1}}"],
    # ranges
    "greater than zero": [
        'pore.length="0 um"', "aggregate.radius=0 um", "flow.head=0 um", "flow.viscosity_ratio=-1",
        "flow.viscosity_ratio=0", "flow.kinematic_viscosity=0 cm^2/s", "flow.gravity=-9.81 m/s^2", "flow.density=0 g/L",
        "substrates.acceptor.half_saturation=0 mg/L", "substrates.donor.diffusivity=0 cm^2/day",
        "substrates.donor.diffusivity_in_aggregate=-1 cm^2/day", "kinetics.decay_oxygen_demand=0",
        "kinetics.acceptor_to_donor_ratio=0", "kinetics.maximum_density=0 mg/L", "growth.time_step=0 h",
        "growth.shear_modulus=0 MPa", "growth.minimum_film=0 um", "numerics.refinement=0",
        'flow.head=[["0 h", "1 cm"], ["2 h", "0 cm"]]'],
    "zero or more": ["substrates.acceptor.supply=-1 mg/L", "kinetics.maximum_utilization_rate=-1 1/day",
                     "kinetics.decay_coefficient=-1 1/day", "growth.end=-1 h"],
    "from 0 to 1": ["kinetics.degradable_fraction=-0.1", "kinetics.degradable_fraction=1.1"],
    "greater than zero, at most 20": ["numerics.refinement=20.1", "numerics.refinement=1e9"],
    "greater than zero, at most 1": ["kinetics.yield_coefficient=0", "kinetics.yield_coefficient=1.01",
                                     *(f"numerics.tolerance={value}" for value in (0, -0.5, 1.1))],
    "1e-06 h or more is needed": ["growth.time_step=9e-7 h"],
    "between 0 and 90 deg": ["growth.minimum_contact_angle=0 deg", "growth.minimum_contact_angle=90 deg"],
    # shares, and F by the oxygen demand
    'a diffusivity or kinematic viscosity is needed, such as "1.85 cm^2/day" (greater than zero), or a share of '
    'diffusivity up to "100 %"': [
        f'substrates.acceptor.diffusivity_in_aggregate="{value}"' for value in (
            "0 %", "-5 %", "100.1 %", "%", "nan %", "1e999999999 %", "1e-999999999 %", "80 %%", "80 % um^2/h", "0.8",
            "eighty %", "9" * 100 + " %")],
    "kinetics.donor_oxygen_demand = 0.8: more than Y d_c (0.8662) is needed: F = COD - Y d_c is positive": [
        "kinetics.donor_oxygen_demand=0.8"],
    "a plain number is needed, such as 2.38 (greater than zero)": [
        f"kinetics.donor_oxygen_demand={value}" for value in ("0", "2 mg/mg", "nan")],
    # what is not modelled
    "[growth] takes end,": ["growth.detachment=1 1/day"],
    f'; "detachment" {SCOPED}': ["growth.detachment=1 1/day", "detachment_rate=1 1/day"],
    "did you mean substrates.donor.inhibition_constant?": ["kinetics.inhibition_constant=5 mg/L"],
    f'; "temperature" {SCOPED}': ["kinetics.Temperature=20"],
    "aggregate.1 and aggregate.2 overlap or touch": ["aggregate=[{radius=\"5 um\"}, {}]"],
    "; give mg/L (in water 1 ppm is about 1 mg/L, 1 ppb about 1 ug/L)": [
        "substrates.donor.supply=20 ppm", "kinetics.maximum_density=20ppb"],
    MOLES: [
        *(f"substrates.donor.supply={value}" for value in ("8 mmol/L", "8mmol/L", "8 mol/m^3", "8 mM", "8 \u00b5M",
                                                           "0.1 M", "3 micromoles/l", "2 molar")),
        'kinetics.acceptor_to_donor_ratio="7 mol/mol"', "kinetics.maximum_utilization_rate=7 mmol/g/day"],
    # what may have been meant
    '(did you mean "50 um"?)': ["pore.width=50", 'pore.width="50"'],
    '(did you mean "19.4 h"?)': ["growth.end=19.4"],
    "(did you mean 500?)": ['flow.viscosity_ratio="500 um"'],
    '(did you mean ["5 h"]?)': ["output.times=5 h"],
    '(did you mean "gear"?)': ["numerics.transport=geer"],
    '(did you mean "paper"?)': ["numerics.preset=Paper"],
    "(did you mean yield_coefficient?)": ["kinetics.yield=0.5"],
    "(did you mean aggregate.radius?)": ["pore.radius=5 um", "radius=5 um"],
    "(did you mean substrates.acceptor?)": ["acceptor.supply=5 mg/L"],
    "(did you mean substrates.acceptor.supply or substrates.donor.supply?)": ["substrates.supply=5 mg/L"],
    "(did you mean pore?)": ["por.width=50 um", "PORE.width=5 um"],
    "(did you mean pore.width?)": ["pore.widht", "pore.width.value=5 um"],
    # the aggregate
    'aggregate.position = "295 um": less than half of pore.length (600 um) less aggregate.radius (5 um), upstream or '
    "downstream, is needed": ["aggregate.position=295 um"],
    "upstream or downstream, is needed": ["aggregate.position=-1 m"],
    'a length is needed, such as "0 um" (of either sign) (did you mean "20 um"?)': ["aggregate.position=20"],
    'a length is needed, such as "0 um" (of either sign)': ["aggregate.position=5 h", "aggregate.position=inf um"],
    "aggregate.smooth = true: true is accepted only with aggregate.outline": ["aggregate.smooth=true"],
    "true or false is needed, without quotes (did you mean true?)": ['aggregate.smooth="true"'],
    "aggregate.smooth = 1: true or false is needed": ["aggregate.smooth=1"],
    "a plain number is needed, such as 0 (zero or more, less than 1)": ["aggregate.inert_fraction=1"],
    "zero or more, less than 1": ["aggregate.inert_fraction=-0.1", "aggregate.inert_fraction=nan"],
    "(did you mean 0.3?)": ['aggregate.inert_fraction="0.3"'],
    # several keys, see PAIRS; here with the value as it was written
    'aggregate.radius = "80 um": less than pore.width (50 um)': ['aggregate.radius="80 um"'],
    "aggregate.radius": ["aggregate.radius=50 um"],
    "growth.minimum_film": ["growth.minimum_film=50 um"],
    # tables over time
    "a table of 1 to 1000 entries is needed": [f"{DONOR}=[]"],
    'the time of the first entry of a table must be "0 h"': [f'{DONOR}=[["1 h", "1 mg/L"]]'],
    "2 h of entry 3 is not after 2 h": [f'{DONOR}=[["0 h", "1 mg/L"], ["2 h", "1 mg/L"], ["2 h", "0 mg/L"]]'],
    "entry 2 of a table must be a time of zero or more and a concentration": [
        f'{DONOR}=[["0 h", "1 mg/L"], ["2 h", "{value}"]]' for value in ("1 um", "-1 mg/L")],
    "entry 1 of a table must be a time": [
        f"{DONOR}={value}" for value in ('[["0 mg/L", "1 h"]]', '[["0 h"]]', '["0 h", "1 mg/L"]')],
    'or a list of [time, value] pairs such as [["0 h", "10 mg/L"], ["5 h", "10 mg/L"]] (did you mean "3 mg/L"?)': [
        f"{DONOR}=3"],
    "flow.head (10 um) is set too": ['flow.mean_velocity=[["0 h", "1 m/day"]]'],
    '{ table = [["0 h", "1e-3 cm"], ["5 h", "1e-3 cm"]], between = "linear" }': [
        'flow.head={table="1 cm", between="linear"}', 'flow.head={table=[["0 h", "1 cm"]]}',
        'flow.head={table=[["0 h", "1 cm"]], between="jumps"}', 'flow.head={table=[["0 h", "1 cm"]], between=1}',
        'flow.head={table=[["0 h", "1 cm"]], between="linear", after="2 h"}'],
    # times
    "a list of times is needed": ["output.times=5 h", "output.times=[]", "output.times=[5 h, 6 h]", "output.times=[5]",
                                  'output.times=["5 um"]', 'output.times=["-1 h", "1 h"]', 'output.times=[["1 h"]]'],
    "times up to 19.4 h are accepted: growth.end is 19.4 h": ['output.times=["1 h", "19.5 h"]'],
}


@pytest.mark.parametrize("override, part", [(override, part) for part, each in REFUSED.items() for override in each])
def test_a_wrong_entry_is_refused(override, part):
    message = refusal("base", override)
    assert message.startswith("base: ") and part in message
    assert override.split("=")[0].removesuffix(".value").split(".")[-1][:40] in message  # the key that was set


def test_every_key_refuses_values_of_another_kind():
    """The message has the key and the accepted values. A section has no other keys."""
    for key, entry in fields(Scene):
        if "section" in entry.metadata:
            assert "there is no such key" in refusal("base", f"{key}.xyzzy=5 um")
        for bad in ("{}", "5 um^9", "nan", "1979-05-27", "[{}]") if "kind" in entry.metadata else ():
            message = refusal("base", f"{key}={bad}")
            assert message.startswith(f"base: {key} = ")
            assert bad == "[{}]" or entry.metadata["kind"].requirement in message


@pytest.mark.parametrize("source, overrides, part", [
    ("wide", ["flow.mean_velocity=-1 m/day"], "a velocity is needed"),
    ("wide", ['flow.mean_velocity=[["0 h", "1 m/day"], ["2 h", "0 m/day"]]'], "greater than zero is needed"),
    ("initial_mesh", ["flow.viscosity_ratio=5"], "flow.head is missing: it, flow.mean_velocity or flow.rate is needed"),
    ("base", ["flow.permeability=1e-15 m^2", "flow.viscosity_ratio=5"],
     "flow.viscosity_ratio (5.0) is set too; only one of them is accepted"),
    ("base", ["flow.biomass=brinkman"], "this key was removed; leave it out: an aggregate is permeable with flow.perm"),
    ("base", ["flow.permeability=1e-15 m^2"],
     'flow.permeability = "1e-15 m^2": numerics.preset = "fast", "accurate", "exact" or "sketch" is needed with it'),
    ("base", ["numerics.elements=cubic"], 'numerics.elements = "cubic": this key was removed; leave it out'),
    ("base", ["numerics.preset=fast", "flow.permeability=2.49e-20 m^2"],
     'flow.permeability = "2.49e-20 m^2": "2.5e-20 m^2" or more is needed in a pore 50 um wide'),
    ("base", ["kinetics.donor_oxygen_demand=0.8", "kinetics.acceptor_to_donor_ratio=1.52"],
     "more than Y d_c (0.8662) is needed"),
    ("base", ["flow.permeability=0 m^2"], "a permeability"),
    ("base", ['flow.head=[["0 h", "1 cm"], ["2 h", "2 cm"]]', "flow.mean_velocity=1 m/day"],
     "flow.mean_velocity = \"1 m/day\": flow.head (a table) is set too"),
    ("base", ["flow.head=1 cm", 'flow.mean_velocity=[["0 h", "1 m/day"], ["2 h", "2 m/day"]]'],
     "flow.head (10000 um) is set too"),
    *(("base", [f"substrates.{name}.diffusivity_in_aggregate=1e-200 %", f"substrates.{name}.diffusivity=1e-200 um^2/h"],
       f"base: substrates.{name}.diffusivity_in_aggregate = ") for name in ("acceptor", "donor")),
    ("flow_only", ["growth.end=1 h"], "growth = "),
    ("flow_only", ["aggregate.inert_fraction=0.3"], "aggregate.inert_fraction = 0.3: 0 is needed without [substrates]"),
    ("flow_only", ["substrates={}", "growth.time_step=1 h"], 'growth.end is missing: a time is needed'),
    ("flow_only", ['output.times=["1 h"]'], "times up to 0 h are accepted: there is no [growth]"),
])
def test_an_entry_that_conflicts_with_the_scene_is_refused(source, overrides, part):
    message = refusal(source, *overrides)
    assert message.startswith(f"{source}: ") and part in message


@pytest.mark.parametrize("text, part", [
    ('[flow]\nhead = "1e-3 cm"\npermeability = "1e-15 m^2"\n', "[aggregate] is needed with it"),
    ('[aggregate]\n[substrates.acceptor]\n[kinetics]\nlaw = "Haldane"\n',
     'kinetics.law = "Haldane": [substrates.donor] is needed'),
    ('[aggregate]\n[substrates.donor]\ninhibition_constant = "5 mg/L"\n', 'kinetics.law = "Haldane" is needed with it'),
    ('[substrates]\n[growth]\nend = "1 h"\n', ": [aggregate] and [substrates] are needed"),
    ('[aggregate]\n[substrates]\n[growth]\nend = "1 h"\nfluid_forces = "included"\n', "without [flow]"),
    ('[pore]\nwidth = "4 um"\n[aggregate]\n', 'pore.width = "4 um": more than aggregate.radius (5 um)'),
    ('[aggregate]\n[substrates]\n[growth]\nend = "1e9 h"\n',
     'growth.end = "1e9 h": at most 100000 times growth.time_step (0.2 h)'),
    ('[[aggregate]]\nradius = "5 um"\n[[aggregate]]\nradius = "6 um"\n',
     "aggregate.1 and aggregate.2 overlap or touch"),
])
def test_a_file_is_refused_by_its_own_key(tmp_path, text, part):
    """This includes a shown default that conflicts with a key that is set."""
    path = write_scene(tmp_path, text)
    message = refusal(path)
    assert message.startswith(f"{path}: ") and part in message


@pytest.mark.parametrize("source, overrides", [
    ("base", ["growth.end=0 h"]),
    ("base", ["numerics.preset=fast", "flow.permeability=2.5e-20 m^2"]),
    ("base", ["growth.end=0 h", 'output.times=["0 h"]']),
    ("base", ['output.times=["19.4 h", "1164 min"]']),
    ("flow_only", ['output.times=["0 h"]']),
    ("base", ["substrates.acceptor.supply=0 mg/L", "substrates.donor.supply=-0 mg/L"]),
    ("base", ["kinetics.decay_coefficient=0 1/day", "kinetics.maximum_utilization_rate=0 1/day"]),
    ("base", ["kinetics.degradable_fraction=0", "kinetics.yield_coefficient=1"]),
    ("base", ["aggregate.radius=49.9 um", "numerics.tolerance=1"]),
    ("wide", ["flow.mean_velocity=0 m/day", "numerics.transport=gear"]),
    ("flow_only", ["flow.mean_velocity=0 m/day"]),
    ("initial_mesh", ["substrates.boundary=closed", "numerics.transport=gear"]),
    ("initial_mesh", ["substrates={}"]),
    ("initial_mesh", ["substrates.donor.supply=1000 mg/L", "substrates.acceptor={}"]),
    ("base", ["aggregate.position=-294.9 um", "aggregate.inert_fraction=0.999999"]),
    ("flow_only", ["aggregate.inert_fraction=0.3", "substrates={}"]),
])
def test_values_at_the_bounds_are_accepted(source, overrides):
    scene = load_scene(source, overrides)
    assert parse_scene(scene_tables(scene), scene.name, "again") == scene


OUTLINED = ("initial_mesh --unset aggregate.radius",
            'aggregate.outline=[["-5 um","0 um"],["0 um","9 um"],["5 um","0 um"]]')
#: Two conflicting keys, each set by --set on a file that has the other, and the message about each.
PAIRS = [
    ("initial_mesh", "aggregate.radius=30 um", "pore.width=20 um", "less than pore.width (20 um)",
     "more than aggregate.radius (30 um) is needed"),
    ("initial_mesh", "aggregate.radius=30 um", "pore.length=60 um", "half of pore.length (60 um) is needed",
     "more than twice aggregate.radius (30 um) is needed"),
    ("initial_mesh", "aggregate.radius=0.04 um", "pore.width=50 um", "a thousandth of pore.width (50 um) or more",
     "at most a thousand times aggregate.radius (0.04 um)"),
    ("initial_mesh", "aggregate.position=50 um", "pore.length=100 um", "less than half of pore.length (100 um) less",
     "more than twice aggregate.radius (5 um) and the distance of aggregate.position (50 um)"),
    ("initial_mesh", "aggregate.position=20 um", "aggregate.radius=45 um; pore.length=120 um",
     "less aggregate.radius (45 um), upstream or downstream, is needed",
     "less than half of pore.length (120 um) less the distance of aggregate.position (20 um) is needed"),
    (*OUTLINED, "pore.width=8 um", "0 < y <= pore.width (8 um) at point 2 (0 um, 9 um) is needed",
     "y of point 2 (0 um, 9 um) of aggregate.outline, or more, is needed"),
    (*OUTLINED, "pore.length=9 um", "|x| < half of pore.length (9 um) at point 1",
     "more than twice |x| of point 1 (-5 um, 0 um) of aggregate.outline is needed"),
    (*OUTLINED, "aggregate.radius=9 um", "aggregate.radius (9 um) is set too; only one of them is accepted "
     "(unset aggregate.radius removes it)", "(unset aggregate.outline removes it)"),
    ("initial_mesh", "flow.head=1 cm", "flow.mean_velocity=1 m/day",
     "flow.mean_velocity (1 m/day) is set too; only one of them is accepted (unset flow.mean_velocity removes",
     "flow.head (10000 um) is set too; only one of them is accepted (unset flow.head removes it)"),
    ("initial_mesh", "flow.mean_velocity=0 m/day", "substrates.boundary=open; numerics.transport=quasi_steady",
     'greater than zero is needed, or numerics.transport = "gear"', '"gear" is needed with flow.mean_velocity = 0'),
    ("initial_mesh", "substrates.boundary=closed", "flow.head=1 cm", '"open" is needed with [flow]',
     'substrates.boundary = "open" is needed with it'),
    ("initial_mesh", "substrates.boundary=closed", "numerics.transport=quasi_steady",
     '"open" is needed, or numerics.transport = "gear"', '"gear" is needed with substrates.boundary = "closed"'),
    ("initial_mesh", "flow.mean_velocity=0 m/day",
     "substrates.boundary=open; numerics.extent=central; numerics.transport=gear",
     'numerics.extent = "full" is needed with 0 m/day', '"full" is needed with substrates in water at rest'),
    ("base", "growth.time_step=1e-4 h", "growth.end=11 h", "growth.end (11 h) over 100000 or more is needed",
     "at most 100000 times growth.time_step (0.0001 h) is needed"),
    ("base", "growth.minimum_film=30 um", "pore.width=20 um", "less than pore.width (20 um) is needed",
     "more than growth.minimum_film (30 um) is needed"),
    ("base", "growth.fluid_forces=included", "growth.new_biomass=stress_free",
     "because the aggregate would yield at every update",
     '"stressed" is needed with growth.fluid_forces = "included"'),
    ("base", "numerics.transport=gear", "numerics.preset=fast",
     '"quasi_steady" is needed with the midpoint rule of numerics.preset = "fast"',
     '"paper" or "as_printed" is needed with numerics.transport = "gear"'),
    ("base", "kinetics.donor_oxygen_demand=1.2", "kinetics.yield_coefficient=1", "more than Y d_c (1.42) is needed",
     "a smaller value is needed: Y d_c (1.42) is not less than kinetics.donor_oxygen_demand (1.2)"),
    ("base", "kinetics.donor_oxygen_demand=1.2", "kinetics.decay_oxygen_demand=4", "more than Y d_c (2.44) is needed",
     "a smaller value is needed: Y d_c (2.44) is not less than kinetics.donor_oxygen_demand (1.2)"),
    ("base", 'output.times=["5 h"]', "growth.end=4 h", "times up to 4 h are accepted: growth.end is 4 h",
     "5 h or more, the last of output.times, is needed"),
    *(("base", f"growth.{key}={value}", "pore.upper_wall=symmetry", 'pore.upper_wall = "no slip" is needed with it',
       f'"no slip" is needed with growth.{key}: forces on an aggregate beside a plane of symmetry are not verified')
      for key, value in (("fluid_forces", "included"), ("wall", "bonded"), ("bonding_strength", "1 kPa"),
                         ("tensile_strength", "1 kPa"))),
    *(("base", f"growth.{key}=1 kPa", "growth.new_biomass=stress_free", 'new_biomass = "stressed" is needed with it',
       f'"stressed" is needed with growth.{key} = 0.001 MPa') for key in ("bonding_strength", "tensile_strength")),
]


@pytest.mark.parametrize("source, first, second, of_first, of_second", PAIRS)
def test_the_key_that_was_set_is_named(tmp_path, source, first, second, of_first, of_second):
    """The message names the key of --set, not that of the file."""
    name, _, unset = source.partition(" --unset ")
    for entries, last, part in ((second, first, of_first), (first, second, of_second)):
        path = write_scene(tmp_path, toml(load_tables(name, entries.split("; "), [unset] if unset else [])))
        message = refusal(path, *last.split("; "))
        key = message.removeprefix(f"{path}: ").partition(" = ")[0]  # or its section
        assert part in message and any(entry.startswith(key) for entry in last.split("; "))


@pytest.mark.parametrize("override, unsaid", [
    *((override, ("mg/L", "`repro docs scope`")) for override in (
        "growth.minimum_contact_angle=3 ppm", "growth.shear_modulus=1 MPaz", "pore.depht=5 um", "numerics=[{}]",
        "pore.width=5 M/s")),
    *((override, ("moles", "milligrams")) for override in (
        "growth.end=20 M", "growth.end=20 mol", "pore.width=5 M", "flow.head=5 M", "growth.shear_modulus=5 MPa M")),
    *((override, ("did you mean",)) for override in (
        "pore.width=50 mil", "pore.width=50 ppm", "pore.width=50 deg", "growth.end=20 percent", f"{DONOR}=5 mg/kg",
        "flow.viscosity_ratio=50 %", "flow.viscosity_ratio=50 percent", "flow.viscosity_ratio=5 mil/inch",
        "flow.viscosity_ratio=1,5", "kinetics.yield_coefficient=0.5 deg")),
    *((override, ("did you mean",)) for override in (
        "pore.width=-50", "pore.width=true", "pore.width={}", "numerics.preset=7", "pore.xyzzy=5 um",
        "aggregate.left=3", f"pore.width=0x{'f' * 9000}",
        "growth.detachment=1 1/day", "substrates.donor.supply=8 mM"))])
def test_hints_are_given_only_if_they_help(override, unsaid):
    message = refusal("base", override)
    assert not [hint for hint in unsaid if hint in message]


# ---------------------------------------------------------------- refusals name the reason

LENGTHS = [["-5 um", "0 um"], ["0 um", "5 um"], ["5 um", "0 um"]]
#: {place of a quantity, by kind of key: the key, a unit there, and the value with a quantity at that place}.
PLACES = {
    "quantity": ("pore.width", "um", lambda one: one),
    "quantity or table": ("flow.head", "cm", lambda one: one),
    "share": ("substrates.donor.diffusivity_in_aggregate", "cm^2/day", lambda one: one),
    "time of a table": (DONOR, "h", lambda one: [["0 h", "1 mg/L"], [one, "2 mg/L"]]),
    "value of a table": (DONOR, "mg/L", lambda one: [["0 h", one]]),
    "list of times": ("output.times", "h", lambda one: ["1 h", one]),
    "x of an outline": ("aggregate.outline", "um", lambda one: [[one, "0 um"], *LENGTHS[1:]]),
    "y of an outline": ("aggregate.outline", "um", lambda one: [LENGTHS[0], ["0 um", one], LENGTHS[2]]),
}
#: {what the message names: quantities without their unit}.
FAULTS = {
    "U+00A0 (no-break space)": ["5\u00a0{}", "\u00a05 {}", "5 {}\u00a0"],
    "U+2009 (thin space)": ["5\u2009{}"],
    "U+2013 (en dash)": ["\u20135 {}", "5e\u20133 {}"],
    'the character "," is not accepted; the decimal sign is a point': ["5,5 {}", "1,000 {}"],
    'the character "%" (percent sign)': ["5 % {}"],
    "it does not start with a number": ["about 5 {}", "nan {}"],
    **{f'"{word}" is not accepted in this unit': [f"5 {{}} {word}", f"5 {word} {{}}", f"5 {{}}*{word}"]
       for word in ("deg", "percent", "ppm", "mil", "rad", "count", "COD", "O2", "N")},
    '"deg" is not a unit of this kind': ["5 deg"],
}


def refused_value(key, value) -> str:
    """The message about a value of a dict."""
    tables = load_tables("base", unset=["aggregate.radius"] if key == "aggregate.outline" else [])
    *above, last = key.split(".")
    reduce(lambda table, name: table.setdefault(name, {}), above, tables)[last] = value
    return refusal(tables)


@pytest.mark.parametrize("name, text", [(name, text) for name, texts in FAULTS.items() for text in texts])
@pytest.mark.parametrize("place", PLACES)
def test_a_refusal_names_the_character_or_the_word(place, name, text):
    key, unit, value = PLACES[place]
    message = refused_value(key, value(text.format(unit)))
    assert message.startswith(f"scene: {key} = ") and name in message and "did you mean" not in message


@pytest.mark.parametrize("key, value, name", [
    *((key, at(value), name) for key, _, at in PLACES.values() for value, name in (
        (np.float32(5), "numpy.float32"), (True, "bool"), ({}, "dict"), (date(2001, 1, 1), "datetime.date"))),
    *((PLACES[place][0], PLACES[place][2](("5 um",)), "tuple") for place in (
        "quantity", "share", "time of a table", "list of times", "x of an outline")),
    *((key, value, "tuple") for key, value in {
        "kinetics.yield_coefficient": (0.5,), "numerics.preset": ("fast",), "aggregate.smooth": (True,)}.items()),
    ("numerics.preset", pint.Quantity(0.5, "um"), "pint.Quantity"),
    ("kinetics.yield_coefficient", np.array([0.5]), "numpy.ndarray"), ("output.times", {}, "dict"),
    ("aggregate.outline", True, "bool"), ("aggregate.smooth", np.float64(1), "numpy.float64"),
    ("numerics.preset", 5.5j, "complex"), ("kinetics.yield_coefficient", 5j, "complex")])
def test_a_refusal_names_the_type(key, value, name):
    assert f"it is of the type {name}" in refused_value(key, value)


def test_a_quantity_of_pint_has_the_rules_of_its_text():
    assert '"second" is not a unit of this kind' in refused_value("pore.width", pint.Quantity(50, "s"))
    assert 'pore.width = 50.0: ' in (message := refused_value("pore.width", np.float32(50)))
    assert '(did you mean "50.0 um"?)' in message


@pytest.mark.parametrize("key, plain, others", [
    ("kinetics.yield_coefficient", 0.5, [np.float32(0.5), np.float64(0.5)]),
    ("flow.viscosity_ratio", 500, [np.int64(500), np.uint16(500), np.float16(500)]),
    ("numerics.preset", "accurate", [np.str_("accurate")]), ("pore.width", "60 um", [np.str_("60 um")]),
    ("output.times", ["1 h", "30 min"], [("1 h", "30 min"), np.array(["1 h", "30 min"])]),
    (DONOR, [["0 min", "1 g/m3"], ["60 min", "2 g/m3"]], [
        (("0 min", "1 g/m3"), ("60 min", "2 g/m3")), np.array([["0 min", "1 g/m3"], ["60 min", "2 g/m3"]])]),
    ("aggregate.outline", LENGTHS, [tuple(map(tuple, LENGTHS)), np.array(LENGTHS), [*map(np.array, LENGTHS)]])])
def test_values_of_numpy_and_tuples_are_accepted(key, plain, others):
    """The scene is the same, in the same units."""
    unset = ["aggregate.radius"] if key == "aggregate.outline" else []
    *above, last = key.split(".")
    scenes = []
    for value in (plain, *others):
        tables = load_tables("base", unset=unset)
        reduce(lambda table, name: table.setdefault(name, {}), above, tables)[last] = value
        scenes.append(load_scene(tables))
    assert all(scene == scenes[0] and scene_tables(scene) == scene_tables(scenes[0]) for scene in scenes)
    assert load_scene("base", unset=unset) != scenes[0]


@pytest.mark.parametrize("name", [*(name for name, unit in exact.UNITS.items() if not any(unit[1:])), "percent", "ppm",
                                  "mil", "count", "bit", "sr", "turn", "dimensionless"])
def test_a_factor_without_dimension_is_refused(name):
    """This holds in every position and for every internal unit; an angle alone has such a unit."""
    for unit in units.NOUNS:
        for text in (f"5 {unit} {name}", f"5 {name} {unit}", f"5 {unit}*{name}^2", f"5 {unit} / {name}"):
            with pytest.raises(ValueError, match="in this unit|of this kind" if unit == "rad" else f'"{name}'):
                units.to_internal(text, unit)
    if name not in ("deg", "degree", "degrees", "rad", "radian", "radians"):
        pytest.raises(ValueError, units.to_internal, f"5 {name}", "rad")


@pytest.mark.parametrize("word", [word for _, words in NOT_MODELLED.values() for word in words.split()])
def test_a_word_of_another_model_is_answered_with_the_page(word):
    """A section, a key of a section and a part of its name; the page has the word."""
    sentence = next(text for text, words in NOT_MODELLED.values() if word in words.split()).format(word=word)
    for tables in ({f"{word}_1": {}}, {word.upper(): [{}]}, {"flow": {f"{word}_rate": "1 1/h"}},
                   {"pore": {f"a-{word}": 1}}):
        assert refusal(tables).endswith(f"; {sentence}, see {SCOPE}")
    assert re.search(rf"\b{word[:5]}", (ROOT / "docs" / "scope.md").read_text(encoding="utf-8").casefold())


@pytest.mark.parametrize("section", [section for section in NOT_MODELLED if section])
def test_several_tables_of_a_section_are_answered_with_the_page(section):
    sentence = f"{NOT_MODELLED[section][0]}, see {SCOPE}"
    lists = [] if section == "aggregate" else [{section: [{}, {}]}, {section: ({},)}]
    for tables in (*lists, {section: {"xyzzy": {}}}):
        assert sentence in refusal(tables)
    if section != "kinetics":
        assert sentence in refusal({f"{section}_2": {}}) and sentence in refusal({f"{section.rstrip('s')}s3": {}})


@pytest.mark.parametrize("key", ["aggregate", "pore", "kinetics", "substrates", "substrates.donor"])
def test_a_misspelt_key_is_not_one_of_another_model(key):
    tables = reduce(lambda inner, name: {name: inner}, reversed((key[:-1] + "x").split(".")), {})
    assert f"(did you mean {key.rpartition('.')[2]}?)" in refusal(tables)


# ---------------------------------------------------------------- files


def test_a_missing_file_is_answered_with_the_packaged_names():
    expected = "neither a file nor a packaged scene (base, flow_only, initial_mesh, wide)"
    assert refusal("no_such_scene.toml") == f"no_such_scene.toml: {expected}"
    for source in ("", "base\0", "x" * 200 + "/\n", "BASE"):
        assert expected in refusal(source)
    assert refusal("wid").endswith("(did you mean wide?)")


def test_a_directory_is_refused(tmp_path):
    assert "a directory, not a packaged scene" in refusal(tmp_path)


def test_a_file_that_cannot_be_read_is_refused(tmp_path, monkeypatch):
    path = write_scene(tmp_path, "[pore]")

    def deny(self, mode):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", deny)
    assert "mine.toml: cannot be read (Permission denied)" in refusal(str(path))


@pytest.mark.parametrize("text, part", [
    *((text, "not TOML: ") for text in ("a = " + "[" * 100_000, "a = " + "9" * 5000, "a = 1\na = 2")),
    ("[pore]\nwidth = 50 um\n", "line 2, column 12): width = 50 um; a value with a unit stands in quotes"),
    ('[aggregate]\noutline = { file = "C:\\Users\\a.png" }', "; a path has / or stands in single quotes, "),
    ('[pore]\nwidth = "50 um\n', 'line 2, column 15): width = "50 um'),
    ("[pore]\r\n\r\n[pore]\r\n", "line 3, column 6): [pore]"),
    ("a = 1\nb = " + "x" * 500, "line 2, column 5): b = xxx"),
    ('[pore]\nwidth\u00a0= "50 um"', 'width = "50 um"; the character U+00A0 (no-break space) is not accepted'),
    ('[pore]\r\n\u00a0width = "50 um"', "; the character U+00A0 (no-break space) is not accepted"),
    ("[pore]\nwidth = \u201c50 um\u201d", "; the character U+201C (left double quotation mark) is not accepted"),
    ("[pore]\nwidth = \u201350", "; the character U+2013 (en dash) is not accepted"),
    ("", "an empty scene: one section or more is needed of [pore], [aggregate], "), ("\ufeff# no\n", "an empty scene"),
])
def test_a_file_that_is_not_toml_is_refused_with_its_line(tmp_path, text, part):
    message = refusal(write_scene(tmp_path, text))
    assert "mine.toml: " in message and part in message
    assert ("stands in quotes" in message) == ("stands in quotes" in part)


POINTS = "".join(f'["{k / 10 - 4} um", "3.0 um"], ' for k in range(80))
DOTTED = f"""# {"." * 99}
[pore] # a.b.c.d.e.f.g.h.i.j.k.l.m.n.o.p.q.r.s.t.u.v.w.x.y.z = 1
width = "50 um" # 1.2.3.4.5.6.7.8.9.10.11.12.13.14.15.16.17.18.19.20.21.22
[aggregate]
outline = [["-5.0 um", "0.0 um"], {POINTS} ["5.0 um", "0.0 um"]]
"""


@pytest.mark.parametrize("text, line", [
    (f"{DEEP} = 1", 1), (f"[pore]\n\n[{DEEP}]", 3), (f"a = {{{DEEP} = 1}}", 1), (f"a = [{{{DEEP} = 1}}]", 1),
    (DEEP.replace(".", " .\t") + " = 1", 1), (DEEP.replace("a", '"a.\\""') + " = 1", 1),
    (DEEP.replace("a", "'a.\"'") + " = 1", 1), ('a = """\n\\" "" x"""\n' + f"{DEEP} = 1", 3),
    ("a = '''\n\"'' '''\n" + f"{DEEP} = 1", 3), (f"a = '#'\n{DEEP}", 2), (".".join("a" * 9) + " = 1", 1),
])
def test_keys_of_many_parts_are_refused_before_they_are_parsed(tmp_path, monkeypatch, text, line):
    """Their memory grows with the square of the number of parts: 1.5 GB here."""
    monkeypatch.setattr(tomllib, "loads", None)
    expected = f"a key of more than 8 parts (at line {line}); one of a scene has at most 3"
    assert expected in refusal(write_scene(tmp_path, text))


def test_dots_outside_of_keys_are_read(tmp_path):
    """Dots in comments, texts and numbers, and keys of 8 parts, are read."""
    assert len(load_scene(write_scene(tmp_path, DOTTED)).aggregate.outline) == 82
    assert "there is no such key" in refusal(write_scene(tmp_path, ".".join("a" * 8) + " = 1"))


@pytest.mark.parametrize("piece", ["a", '"', '\\"', "'", "a.", "a .", '"a', "#", '"""', "'''", "\\", " ", '"\\'])
def test_the_search_for_deep_keys_is_linear_in_the_size(piece):
    """The time is linear in the size, for the largest accepted file of any content."""
    text = "x = 1\n" + (piece * files.LARGEST)[:files.LARGEST]
    start = time.process_time()
    files.line_of_a_deep_key(text)
    assert time.process_time() - start < 10


@pytest.mark.exact_lengths
def test_a_large_file_is_refused_unread(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_bytes(b"[pore]\n#" + b"x" * (files.LARGEST - 8))
    assert load_scene(path).pore.width == 100
    with path.open("ab") as file:
        file.truncate(10**11)
    assert "mine.toml: more than 300000 bytes; a scene has a few thousand" in refusal(path)


@pytest.mark.exact_lengths
def test_a_file_that_is_not_utf_8_is_refused(tmp_path):
    """The message has a command that makes it a scene."""
    for encoding in ("latin-1", "utf-16"):
        path = write_scene(tmp_path, '# µ\n[pore]\nwidth = "60 µm"', encoding)
        message = refusal(path)
        assert f"not UTF-8 text (at byte {1 if encoding == 'utf-16' else 3})" in message
        assert "saved with the encoding UTF-8 of the editor" in message
        command = message.rpartition("converted by: ")[2]
        converted = subprocess.run([*command.split(), str(path)], capture_output=True, check=True).stdout
        path.write_bytes(converted)
        assert load_scene(path).pore.width == 60


def test_a_wrong_unset_is_refused_with_a_hint():
    expected = 'base: unset "flow.haed": the scene does not set it (did you mean flow.head?)'
    assert refusal("base", unset=["flow.haed"]) == expected
    for key in ("flow.mean_velocity", "", "flow.head.deep", ".", "a" * 9000):
        assert "the scene does not set it" in refusal("base", unset=[key])
