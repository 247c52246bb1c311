"""Keys and choices of earlier versions, and what to write instead.

A scene that names one of them is refused. The runs of earlier versions keep them in ``run.json``:
their hashes stay valid, and the reader drops a former key if its value is the present behaviour.
"""
from collections.abc import Iterator
from typing import NamedTuple


class Former(NamedTuple):
    """A former key: the value that is the present behaviour, and what to write instead."""

    value: str | float
    instead: str


#: By dotted keys.
KEYS: dict[str, Former] = {
    "numerics.fixed_point": Former(
        "kept", "leave it out: the point in the middle of a new contact surface stays in place"),
    "numerics.flow_element": Former(
        "stabilised", "leave it out: linear velocities are stabilised, quadratic ones are stable"),
    "numerics.flow_stabilisation": Former(
        100.0, "leave it out: it is 100 (repro.model.flow.STABILISATION)"),
    "numerics.mesh_compressibility": Former(
        1.0, "leave it out: it is 1 (repro.model.mesh_motion.COMPRESSIBILITY)"),
    "numerics.ordering": Former("degree", "leave it out: SuperLU orders the nodes"),
    "output.timeseries": Former(
        "csv", "leave it out, and write NetCDF by repro.load_run(FOLDER).to_netcdf(FILE)"),
}
#: What to write instead of a choice, by its dotted key and the choice.
CHOICES: dict[tuple[str, str], str] = {
    ("numerics.elements", "cubic"):
        'write "quadratic", which takes half of the time and errs as little around an aggregate',
    ("numerics.transfer", "bounded"):
        'write "conserving", from which it differed by 0.002 %',
}


def instead_of_key(key: str) -> str:
    """Requirement where a scene has a former key; empty for other keys."""
    return f"this key was removed; {KEYS[key].instead}" if key in KEYS else ""


def instead_of_choice(key: str, value: object) -> str:
    """Requirement where a scene has a former choice; empty for other values."""
    named = (key, value) if isinstance(value, str) else None
    return f"this choice was removed; {CHOICES[named]}" if named in CHOICES else ""


def with_former(tables: dict) -> dict:
    """Return the tables of a scene with all former keys, as its hash counts them."""
    tables = dict(tables)
    for section, key, former in _parts():
        tables[section] = {**tables[section], key: former.value}
    return tables


def without_former(tables: object) -> object:
    """Return the tables of a record without the former keys whose value is the present behaviour.

    Tables that a user has altered may be anything.
    """
    if not isinstance(tables, dict):
        return tables
    tables = dict(tables)
    for section, key, former in _parts():
        table = tables.get(section)
        if isinstance(table, dict) and table.get(key) == former.value:
            tables[section] = {name: value for name, value in table.items() if name != key}
    return tables


def _parts() -> Iterator[tuple[str, str, Former]]:
    """Section, key and entry of each former key."""
    for dotted, former in KEYS.items():
        section, _, key = dotted.rpartition(".")
        yield section, key, former
