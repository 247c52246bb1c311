"""Hard cases of whole runs: units that make every number huge or tiny, and parameters drawn at random."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from functools import partial

import numpy as np

from repro.scene import Scene, parse_scene
from verification.case import at_most
from verification.hard import common
from verification.hard.common import TOLERANCE, HardCase

#: Powers of length and time in the unit of each key that has one.
POWERS = {
    "width": (1, 0), "length": (1, 0), "radius": (1, 0), "head": (1, 0), "mean_velocity": (1, -1),
    "kinematic_viscosity": (2, -1), "gravity": (1, -2), "diffusivity": (2, -1), "diffusivity_in_aggregate": (2, -1),
    "maximum_utilization_rate": (0, -1), "decay_coefficient": (0, -1), "end": (0, 1), "time_step": (0, 1),
    "minimum_film": (1, 0),
}
#: Powers of the columns that have a unit of length or time.
COLUMNS = {
    "time_h": (0, 1), "mean_velocity_m_per_d": (1, -1), "head_loss_cm": (1, 0), "conductivity_m_per_d": (1, -1),
    "aggregate_area_um2": (2, 0), "thickness_um": (1, 0), "upstream_um": (1, 0), "downstream_um": (1, 0),
    "meshed_length_um": (1, 0),
}
SAME = ("effluent_acceptor_mg_per_L", "effluent_donor_mg_per_L", "acceptor_min_mg_per_L", "inert_fraction")


def scaled(section, length: float, time: float):
    """A scene, or a section of it, with its unit of length and of time so many times larger."""
    changes = {}
    for key in fields(section):
        value = getattr(section, key.name)
        if is_dataclass(value):
            changes[key.name] = scaled(value, length, time)
        elif key.name == "times" and value:
            changes[key.name] = tuple(time * t for t in value)
        elif key.name in POWERS and value is not None and not (key.name == "length" and not isinstance(value, float)):
            along, during = POWERS[key.name]
            changes[key.name] = value * length**along * time**during
    return replace(section, **changes)


def units(preset: str, length: float, time: float) -> list:
    """Base from 15 um for 1.2 h, in other units."""
    made = common.scene("base", preset, 'aggregate.radius="15 um"', 'growth.end="1.2 h"', 'output.times=["1.2 h"]')
    plain, other = common.ran(made), common.ran(scaled(made, length, time))
    exact = np.log2(length) % 1 == 0
    bound, origin = (1e-9, "dimensions; round-off") if exact else (
        TOLERANCE[preset], "round-off makes another mesh; " + common.PROMISED[preset])
    checks = []
    for column, (along, during) in (*COLUMNS.items(), *((name, (0, 0)) for name in SAME)):
        unit = length**along * time**during
        checks.append(at_most(f"{column}, relative difference", abs(other.last[column] / unit / plain.last[column] - 1),
                              bound, origin))
    return [plain, other, *checks]


SCALES = {"lengths x 1e6": (1e6, 1.0), "lengths x 2^20": (2.0**20, 1.0), "lengths / 2^10": (2.0**-10, 1.0),
          "times x 1e-6": (1.0, 1e-6), "times x 1e6": (1.0, 1e6), "times x 1e-9": (1.0, 1e-9)}
UNITS = HardCase(
    17, "units", "Extreme units: lengths times 1e6, times times 1e-6",
    "The same numbers times their unit",
    "A length or a time that is written into the code: a tolerance, a smallest step, a size",
    {told: partial(units, length=length, time=time) for told, (length, time) in SCALES.items()},
    refusable=tuple(SCALES),
    mutants=("hard-absolute-time", "length-scale"))

#: What is drawn: key of the scene, its unit, and its physical range; all but the radius by its logarithm.
RANGES = {
    "pore.width": ("um", 20.0, 200.0), "aggregate.radius": ("of the width", 0.04, 0.8),
    "flow.mean_velocity": ("m/day", 0.03, 30.0), "flow.viscosity_ratio": ("", 1.0, 1e5),
    "substrates.acceptor.supply": ("mg/L", 0.1, 50.0), "substrates.donor.supply": ("mg/L", 0.1, 50.0),
    "substrates.acceptor.half_saturation": ("mg/L", 0.05, 10.0), "substrates.donor.half_saturation": ("mg/L", 0.05, 10.0),
    "kinetics.maximum_utilization_rate": ("1/day", 0.5, 12.0), "kinetics.decay_coefficient": ("1/day", 0.02, 0.5),
    "kinetics.maximum_density": ("mg/L", 5e3, 1e5), "growth.minimum_contact_angle": ("deg", 5.0, 45.0),
    "growth.end": ("h", 0.4, 3.0),
}


def drawn(shares: Mapping[str, float], preset: str) -> Scene:
    """The scene whose values lie so far (0 to 1) between the ends of their ranges, by their logarithms."""
    tables: dict = {"numerics": {"preset": preset}}
    value = {key: low * (high / low) ** shares[key] for key, (_, low, high) in RANGES.items()}
    value["aggregate.radius"] *= value["pore.width"]
    for key, (unit, _, _) in RANGES.items():
        *path, name = key.split(".")
        table = tables
        for part in path:
            table = table.setdefault(part, {})
        unit = "um" if key == "aggregate.radius" else unit
        table[name] = f"{value[key]!r} {unit}" if unit else value[key]
    tables["output"] = {"times": [f"{value['growth.end']!r} h"]}
    return parse_scene(tables, "drawn", "drawn")


def at_random(preset: str, seed: int) -> list:
    """One draw."""
    random = np.random.default_rng(seed)
    return [common.ran(drawn({key: random.uniform() for key in RANGES}, preset))]


DRAWS = range(10)
RANDOM = HardCase(
    22, "random", "Parameters drawn at random within physical ranges",
    "Balances, bounds and area by biomass in every run, or a refusal that says what to change",
    "A run that ends with a number that is none, or with mass made or lost",
    {f"draw {seed}": partial(at_random, seed=seed) for seed in DRAWS},
    refusable=tuple(f"draw {seed}" for seed in DRAWS),
    mutants=("curved-mass-lost", "reprojection-left-out"))

CASES = (UNITS, RANDOM)
