"""Conversion of TOML tables to the dataclasses of a scene and back, and refusals.

A refusal is one line that names the file, the key, the value, the accepted values and, if there is
one, the nearest accepted value.
"""
import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, Field, dataclass, fields, replace

from repro.errors import shortened
from repro.scene import bodies, former
from repro.scene.units import (
    Quantity,
    Refused,
    SceneError,
    as_list,
    because,
    nearest,
    plain,
)

SCOPE = "`repro docs scope`"
#: {section: (what a scene has of it, words in the keys of models with more)}. Another table in the
#: section is refused with the same sentence, and so is a list of tables. A noun with a number, such
#: as aggregate2, counts as its plural. The last words belong to no section.
NOT_MODELLED = {
    "aggregate": ("several aggregates are tables [[aggregate]]",
                  "aggregates seeds colony colonies clusters"),
    "pore": ("one pore is modelled, a straight channel",
             "pores throat throats grains network column aquifer inlet outlet shape converging "
             "roughness"),
    "substrates": ("one acceptor and one donor are modelled",
                   "substrates acceptors donors oxygen nitrate nitrite ammonium sulfate acetate "
                   "glucose phenol"),
    "kinetics": ("one species of bacteria is modelled", "strain strains species"),
    "": ('"{word}" is not modelled',
         "attachment detachment sloughing dimension dimensions temperature inertia "
         "turbulence precipitation maintenance quorum ph gas"),
}


@dataclass(frozen=True)
class Place:
    """A key of a file, as messages name it; known: all dotted keys that the file may have."""

    file: str
    key: str = ""
    known: tuple[str, ...] = ()

    @property
    def single(self) -> str:
        """What a scene has of the section; empty where it is not in NOT_MODELLED."""
        section = self.key.partition(".")[0]
        return NOT_MODELLED[section][0] if section and section in NOT_MODELLED else ""

    def below(self, key: str) -> "Place":
        key = shortened(key)
        return replace(self, key=f"{self.key}.{key}" if self.key else key)

    def refuse(self, value: object, requirement: str) -> SceneError:
        stated = f"{self.key} is missing" if value is MISSING else f"{self.key} = {quote(value)}"
        return SceneError(f"{self.file}: {stated}: {requirement}")


def entries(kind: type) -> dict[str, Field]:
    """The keys of a section: its fields with metadata."""
    return {entry.metadata.get("key", entry.name): entry for entry in fields(kind)
            if entry.metadata}


def dotted(kind: type, above: str = "") -> Iterator[str]:
    """All keys of a section and its subsections, including the sections themselves."""
    for key, entry in entries(kind).items():
        yield above + key
        if "section" in entry.metadata:
            yield from dotted(entry.metadata["section"], f"{above}{key}.")


def read_table(kind: type, table: object, place: Place, **extra):
    """Read a TOML table into the dataclass `kind`; extra: fields that are not keys.

    Raises SceneError if the table is not accepted.
    """
    keys = entries(kind)
    if not isinstance(table, dict):
        several = place.single if as_list(table) else ""
        reason = f"{several}, see {SCOPE}: " if several else ""
        requirement = f"{reason}a table [{place.key}] is needed, with the keys {', '.join(keys)}"
        raise place.refuse(table, requirement)
    for key in table:
        if not isinstance(key, str):  # Python may have made the table
            where = f"[{place.key}]: " if place.key else ""
            raise SceneError(f"{place.file}: {where}the key {quote(key)}: a text is needed")
    for key in table:
        if key not in keys:
            below = place.below(key)
            raise below.refuse(table[key], former.instead_of_key(below.key)
                               or _instead(key, table[key], [*keys], place))
    for key, entry in keys.items():
        if key not in table and entry.default is MISSING and entry.default_factory is MISSING:
            raise place.below(key).refuse(MISSING, entry.metadata["kind"].requirement)
    read = {keys[key].name: _read_entry(keys[key], table[key], place.below(key)) for key in table}
    return kind(**extra, **read)


def _read_entry(entry: Field, value: object, place: Place):
    """Read a value, a table or, where there may be several, the tables of a list, each at the place
    of its name or number."""
    section = entry.metadata.get("section")
    if section:
        tables = as_list(value) if "key" in entry.metadata else None
        if tables is None:
            part = read_table(section, value, place)
            return (part,) if "key" in entry.metadata else part
        if not tables:
            raise place.refuse(value, f"a table [{place.key}] is needed, or one or more "
                                      f"[[{place.key}]]")
        names = [table.get("name") if isinstance(table, dict) else None for table in tables]
        return tuple(read_table(section, table, place.below(label))
                     for table, label in zip(tables, bodies.labels(names)))
    kind = entry.metadata["kind"]
    try:
        return kind.read(value)
    except Refused as error:
        raise place.refuse(value, str(error)) from None
    except (ValueError, OverflowError) as error:
        hint = because(error) + did_you_mean(kind.near(value))
        raise place.refuse(value, kind.requirement + hint) from None


def write_table(part, units: Mapping[str, str] | None = None, above: str = "") -> dict:
    """Write a dataclass as a TOML table with units, without fields that are None.

    units: of dotted keys; other keys have the unit of their example. None: all have the internal
    units. above: the dotted key of the table, with a dot at its end.
    """
    table = {}
    for key, entry in entries(type(part)).items():
        value = getattr(part, entry.name)
        if value is not None and value != ():
            table[key] = _write_entry(entry, value, units, above + key)
    return table


def _write_entry(entry: Field, value, units: Mapping[str, str] | None, key: str):
    if isinstance(value, tuple) and "section" in entry.metadata:
        if len(value) == 1:
            return write_table(value[0], units, f"{key}.")
        return [write_table(part, units, f"{key}.{number}.")
                for number, part in enumerate(value, 1)]
    if "section" in entry.metadata:
        return write_table(value, units, f"{key}.")
    kind = entry.metadata["kind"]
    if units is None or not isinstance(kind, Quantity):
        return kind.write(value)
    return kind.write(value, units.get(key, kind.usual_unit))


def toml_value(value: object) -> str:
    """Write a value as TOML in one line, in ASCII. Raises TypeError for one that TOML lacks."""
    value = plain(value)
    if isinstance(value, dict):
        parts = ", ".join(f"{key} = {toml_value(part)}" for key, part in value.items())
        return f"{{ {parts} }}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml_value, value))}]"
    if not isinstance(value, str | int | float):
        raise TypeError(f"not {type(value).__name__}")
    return json.dumps(value)


def assignments(changes: dict) -> list[str]:
    """Write a dict of changes as the texts KEY=VALUE of --set. Raises TypeError if one is none."""
    texts = []
    for key, value in changes.items():
        if not isinstance(key, str):
            raise TypeError(f"the key {quote(key)}: a text such as pore.width is needed")
        try:
            texts.append(f"{key}={toml_value(value)}")
        except TypeError as error:
            raise TypeError(f"{key}: a text with a unit, a number, true or false, a list, or a "
                            f"value of NumPy or pint is needed, {error}") from None
    return texts


def toml(tables: dict, head: str = "", above: str = "") -> str:
    """Format tables as a TOML file in ASCII, values before subtables.

    head: the line before them; above: their dotted key, with a dot at its end.
    """
    lines = [head] if head else []
    inner = {key: value for key, value in tables.items() if isinstance(value, dict)
             or isinstance(value, list) and value and isinstance(value[0], dict)}
    lines += [f"{key} = {json.dumps(value)}" for key, value in tables.items() if key not in inner]
    parts = ["\n".join(lines)] if len(lines) > bool(head) else []
    for key, value in inner.items():
        name = f"{above}{key}"
        each, head = (value, f"[[{name}]]") if isinstance(value, list) else ([value], f"[{name}]")
        parts += [toml(table, head, f"{name}.") for table in each]
    return "\n\n".join(parts)


def _instead(key: str, value: object, keys: list[str], place: Place) -> str:
    table = f"[{place.key}]" if place.key else "a scene"
    message = f"there is no such key; {table} takes {', '.join(keys)}"
    is_table = isinstance(value, dict)
    near = nearest(key, keys) or elsewhere(key, tuple(
        known for known in place.known
        if not is_table or any(other.startswith(f"{known}.") for other in place.known)))
    sentence = out_of_scope(key) or (place.single if is_table and not near else "")
    return f"{message}; {sentence}, see {SCOPE}" if sentence else message + did_you_mean(near)


def out_of_scope(key: str) -> str:
    """The sentence of NOT_MODELLED for a key of another model; empty for other keys."""
    folded = key.casefold()
    plural = re.sub(r"([a-z])s?[-_]?[0-9]+$", r"\1s", folded)
    for word in re.findall("[a-z]+", f"{folded} {plural}"):
        for sentence, words in NOT_MODELLED.values():
            if word in words.split():
                return sentence.format(word=word)
    return ""


def elsewhere(key: str, keys: tuple[str, ...]) -> str:
    """The known keys nearest to a dotted key or to its last part, joined by "or".

    Empty if there are none. In another section, three letters of four are the same.
    """
    full_key = nearest(key, keys) if "." in key else ""
    lasts = [other.rpartition(".")[2] for other in keys]
    last = nearest(key.rpartition(".")[2], lasts, cutoff=0.75)
    same_last = [other for other, end in zip(keys, lasts) if last and end == last]
    return full_key or " or ".join(same_last)


def did_you_mean(near: str) -> str:
    """A hint in brackets; empty without a near key or value."""
    return f" (did you mean {near}?)" if near else ""


def quote(value: object, longest: int = 60) -> str:
    """Quote a value in a message: as TOML writes it, shortened."""
    try:
        text = json.dumps(value, ensure_ascii=False, default=_plain)
    except (ValueError, RecursionError):  # thousands of digits, tables nested by the thousand
        text = type(value).__name__
    return shortened(text, longest)


def _plain(value: object) -> object:
    """A value of another type than those of JSON, as a message shows it."""
    converted = plain(value)
    return str(value) if converted is value else converted
