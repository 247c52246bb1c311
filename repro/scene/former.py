"""Keys of earlier versions, and what to write instead.

A scene that names one of them is refused. The runs of earlier versions keep them in ``run.json``:
their hashes stay valid, and the reader writes them as the present version would.
"""
from collections.abc import Callable, Iterator
from typing import NamedTuple


class Former(NamedTuple):
    """A former key: the value that is the present behaviour, and what to write instead.

    The value is None if other keys of the section say it (:func:`_earlier`, :func:`_present`), and
    a dict if it depends on the preset.
    """

    value: str | float | dict[str, str] | None
    instead: str

    def value_in(self, section: dict) -> str | float | None:
        """The value in a section, by its preset."""
        if not isinstance(self.value, dict):
            return self.value
        preset = section.get("preset")
        return self.value.get(preset) if isinstance(preset, str) else None


IN_TABLE = Former(None, "write it in a table: "
                        '{ table = [["0 h", VALUE], ["5 h", VALUE]], between = "linear" }; '
                        "a list has steps")
OF_SCHEME = ('leave it out: numerics.preset = "paper" and "as_printed" have linear elements and '
             "updates, the other presets quadratic elements and the midpoint rule; scheme= of "
             "repro.solve has other combinations")
PRINTED = 'numerics.preset = "as_printed" has the printed one, and'


def _by_preset(curved: str, paper: str) -> dict[str, str]:
    """Values by the preset: those of the curved scheme, and those of the paper's."""
    return {**dict.fromkeys(("fast", "accurate", "exact"), curved),
            **dict.fromkeys(("paper", "as_printed"), paper)}


#: By dotted keys.
KEYS: dict[str, Former] = {
    "flow.biomass": Former(None, "leave it out: an aggregate is permeable with flow.permeability, "
                                 "else viscous"),
    "flow.interpolation": IN_TABLE,
    "substrates.acceptor.interpolation": IN_TABLE,
    "substrates.donor.interpolation": IN_TABLE,
    "numerics.elements": Former(_by_preset("quadratic", "linear"), OF_SCHEME),
    "numerics.fixed_point": Former(
        "kept", "leave it out: the point in the middle of a new contact surface stays in place"),
    "numerics.flow_element": Former(
        "stabilised", "leave it out: linear velocities are stabilised, quadratic ones are stable"),
    "numerics.flow_stabilisation": Former(
        100.0, "leave it out: it is 100 (repro.model.flow.STABILISATION)"),
    "numerics.inlet": Former(
        "local", f"leave it out; {PRINTED} scheme=replace(PAPER, inlet=\"mean\") of repro.solve "
                 "has it alone"),
    "numerics.jacobian": Former(
        _by_preset("reused", "fresh"),
        "leave it out; scheme=replace(CURVED, modified_newton=False) of repro.solve has a new one "
        "in every iterate"),
    "numerics.mesh_compressibility": Former(
        1.0, "leave it out: it is 1 (repro.model.mesh_motion.COMPRESSIBILITY)"),
    "numerics.ordering": Former("degree", "leave it out: SuperLU orders the nodes"),
    "numerics.time": Former(_by_preset("midpoint", "updates"), OF_SCHEME),
    "numerics.transfer": Former(
        "conserving", f"leave it out; {PRINTED} scheme=replace(PAPER, transfer=\"interpolation\") "
                      "of repro.solve has it alone"),
    "output.timeseries": Former(
        "csv", "leave it out, and write NetCDF by repro.load_run(FOLDER).to_netcdf(FILE)"),
}


def instead_of_key(key: str) -> str:
    """Requirement where a scene has a former key; empty for other keys."""
    return f"this key was removed; {KEYS[key].instead}" if key in KEYS else ""


def with_former(tables: dict) -> dict:
    """Return the tables of a scene as earlier versions wrote them, as its hash counts them."""
    tables = _translated(tables, _earlier)
    for section, key, former in _parts():
        tables[section] = {**tables[section], key: former.value_in(tables[section])}
    return tables


def without_former(tables: object) -> object:
    """Return the tables of a record of any version as the present one writes them.

    A former key stays if its value is not the present behaviour. Tables that a user has altered may
    be anything.
    """
    if not isinstance(tables, dict):
        return tables
    tables = _translated(tables, _present)
    for section, key, former in _parts():
        table = tables.get(section)
        if isinstance(table, dict) and key in table and table[key] == former.value_in(table):
            tables[section] = {name: value for name, value in table.items() if name != key}
    return tables


def _translated(tables: dict, translate: Callable[[dict], dict]) -> dict:
    """Return the tables with [flow] and each substrate translated."""
    tables = dict(tables)
    if isinstance(tables.get("flow"), dict):
        tables["flow"] = translate(tables["flow"])
    if isinstance(tables.get("substrates"), dict):
        tables["substrates"] = {name: translate(part) if isinstance(part, dict) else part
                                for name, part in tables["substrates"].items()}
    return tables


def _earlier(section: dict) -> dict:
    """A section with keys for what a table or a permeability says; none has its default."""
    lists = {key: value["table"] for key, value in section.items() if isinstance(value, dict)}
    said = {"interpolation": "linear"} if lists else {}
    said |= {"biomass": "brinkman"} if "permeability" in section else {}
    return {**section, **lists, **said}


def _present(section: dict) -> dict:
    """A section whose tables and permeability say what keys said."""
    section = dict(section)
    if section.get("biomass") == ("brinkman" if "permeability" in section else "viscous"):
        del section["biomass"]
    if section.get("interpolation") in ("steps", "linear"):
        if section.pop("interpolation") == "linear":
            section |= {key: {"table": value, "between": "linear"}
                        for key, value in section.items() if isinstance(value, list)}
    return section


def _parts() -> Iterator[tuple[str, str, Former]]:
    """Section, key and entry of each former key that no other key says."""
    for dotted, former in KEYS.items():
        if former.value is not None:
            section, _, key = dotted.rpartition(".")
            yield section, key, former
