"""What the values and tables of a scene may be, and their numbers in the units of the package.

Inside the package a length and a head are in um, a time in h, a concentration in mg/L, a modulus in MPa, an angle in
rad, and what is made of them likewise (a velocity in um/h). A scene's values are converted here and nowhere else:
exactly, and rounded once, so that "1164 min" and "19.4 h" are the same number.

A kind of value has `read` (what TOML gave -> what the model uses; ValueError or OverflowError when it is not accepted),
its inverse `write`, and `wanted`, the words that say what is accepted. A table of a scene is a dataclass, whose fields
carry their kind, or the dataclass of their section, in their metadata.
"""
import difflib
import json
import math
import re
from collections.abc import Callable
from dataclasses import MISSING, Field, dataclass, field, fields
from fractions import Fraction
from functools import cache, partial
from typing import NamedTuple

NOUNS = {
    "um": "a length",
    "h": "a time",
    "um/h": "a velocity",
    "um/h^2": "an acceleration",
    "um^2/h": "a diffusivity or kinematic viscosity",
    "1/h": "a rate",
    "mg/L": "a concentration or density",
    "MPa": "a pressure or modulus",
    "rad": "an angle",
}
ANGLES = ("deg", "degree", "degrees", "rad", "radian", "radians")  # to pint "ppm" is an angle too
LONGEST = 80  # characters of a value with its unit
_FACTOR = r"[A-Za-z\u00b5\u03bc]+(?:(?:\^|\*\*)-?[1-9])?"
_UNIT = rf"(?:1? ?/ ?)?{_FACTOR}(?:(?: ?[*/] ?| ){_FACTOR})*"
_QUANTITY = re.compile(rf"([+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?) *({_UNIT})")


class Range(NamedTuple):
    """The numbers accepted, in internal units: in words and as a test."""

    words: str
    holds: Callable[[float], bool]


POSITIVE = Range("greater than zero", lambda value: value > 0)
NON_NEGATIVE = Range("zero or more", lambda value: value >= 0)
FRACTION = Range("from 0 to 1", lambda value: 0 <= value <= 1)
POSITIVE_FRACTION = Range("greater than 0, at most 1", lambda value: 0 < value <= 1)
UP_TO_1 = Range("greater than zero, at most 1", lambda value: 0 < value <= 1)
UP_TO_20 = Range("greater than zero, at most 20", lambda value: 0 < value <= 20)
ACUTE = Range("between 0 and 90 deg", lambda value: 0 < value < math.pi / 2)


@dataclass(frozen=True)
class Quantity:
    """A number with a unit, such as "50 um", that can be converted to the internal `unit`."""

    unit: str
    example: str
    accepts: Range = POSITIVE

    @property
    def wanted(self) -> str:
        return f'{NOUNS[self.unit]} is needed, such as "{self.example}" ({self.accepts.words})'

    def read(self, value: object) -> float:
        return _within(self.accepts, to_internal(value, self.unit))

    def write(self, value: float) -> str:
        return f"{float(value)!r} {self.unit}"


@dataclass(frozen=True)
class Number:
    """A plain number, without a unit."""

    example: float
    accepts: Range = POSITIVE

    @property
    def wanted(self) -> str:
        return f"a plain number is needed, such as {self.example:g} ({self.accepts.words})"

    def read(self, value: object) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError("not a number")
        return _within(self.accepts, float(value))

    def write(self, value: float) -> float:
        return float(value)


@dataclass(frozen=True)
class Choice:
    """One of a few words."""

    words: tuple[str, ...]

    @property
    def wanted(self) -> str:
        return " or ".join(f'"{word}"' for word in self.words) + " is needed"

    def read(self, value: object) -> str:
        if value not in self.words:
            raise ValueError("not one of the words")
        return value

    def write(self, value: str) -> str:
        return value


@dataclass(frozen=True)
class Times:
    """A list of one or more times (h), in any order; read in ascending order, each once."""

    each = Quantity("h", "5 h", NON_NEGATIVE)
    wanted = 'a list of times is needed, such as ["5 h", "18 h"] (each zero or more)'

    def read(self, value: object) -> tuple[float, ...]:
        if not isinstance(value, list) or not value:
            raise ValueError("not a list of times")
        return tuple(sorted({self.each.read(time) for time in value}))

    def write(self, value: tuple[float, ...]) -> list[str]:
        return [self.each.write(time) for time in value]


def quantity(text: str, unit: str, accepts: Range = POSITIVE, **default) -> Field:
    """A value with a unit: `text` is its default, or only an example where another default is given."""
    default = default or {"default_factory": partial(to_internal, text, unit)}
    return field(metadata={"kind": Quantity(unit, text, accepts)}, **default)


def required(example: str, unit: str, accepts: Range = POSITIVE) -> Field:
    """A value with a unit that has no default."""
    return field(metadata={"kind": Quantity(unit, example, accepts)})


def number(default: float, accepts: Range = POSITIVE) -> Field:
    """A plain number."""
    return field(default=default, metadata={"kind": Number(default, accepts)})


def choice(*words: str) -> Field:
    """One of the words, the first by default."""
    return field(default=words[0], metadata={"kind": Choice(words)})


def times() -> Field:
    """A list of times, or None."""
    return field(default=None, metadata={"kind": Times()})


def section(kind: type, **default) -> Field:
    """A table, whose keys are those of the dataclass `kind`."""
    default = default or {"default_factory": kind}
    return field(metadata={"section": kind}, **default)


class SceneError(ValueError):
    """A scene that cannot be run; its message is one line naming file, key, value and what is accepted."""

    def __init__(self, message: str):
        super().__init__("".join(letter if letter.isprintable() else " " for letter in message))


@dataclass(frozen=True)
class Place:
    """A key of a file, to be named in a message."""

    file: str
    key: str = ""

    def below(self, key: str) -> "Place":
        key = key if len(key) <= 60 else key[:57] + "..."
        return Place(self.file, f"{self.key}.{key}" if self.key else key)

    def refuse(self, value: object, wanted: str) -> SceneError:
        stated = f"{self.key} is missing" if value is MISSING else f"{self.key} = {shown(value)}"
        return SceneError(f"{self.file}: {stated}: {wanted}")


def read_table(kind: type, table: object, place: Place, **given):
    """The dataclass `kind` that a TOML table describes, with `given` for what is no key; SceneError if not accepted."""
    entries = _entries(kind)
    if not isinstance(table, dict):
        raise place.refuse(table, f"a table [{place.key}] is needed, with the keys {', '.join(entries)}")
    for key in table:
        if key not in entries:
            raise place.below(key).refuse(table[key], _instead(key, list(entries), place.key))
    for key, entry in entries.items():
        if key not in table and entry.default is MISSING and entry.default_factory is MISSING:
            raise place.below(key).refuse(MISSING, entry.metadata["kind"].wanted)
    return kind(**given, **{key: _read_entry(entries[key], table[key], place.below(key)) for key in table})


def _read_entry(entry: Field, value: object, place: Place):
    if "section" in entry.metadata:
        return read_table(entry.metadata["section"], value, place)
    kind = entry.metadata["kind"]
    try:
        return kind.read(value)
    except (ValueError, OverflowError):
        raise place.refuse(value, kind.wanted) from None


def write_table(part) -> dict:
    """The TOML table of a dataclass, with units; what is None is left out."""
    entries, table = _entries(type(part)), {}
    for key, entry in entries.items():
        value = getattr(part, key)
        if value is not None:
            table[key] = entry.metadata["kind"].write(value) if "kind" in entry.metadata else write_table(value)
    return table


def _entries(kind: type) -> dict[str, Field]:
    """The keys of a section."""
    return {entry.name: entry for entry in fields(kind) if entry.metadata}


def _instead(key: str, keys: list[str], table: str) -> str:
    near = difflib.get_close_matches(key[:60], keys, n=1)
    hint = f" (did you mean {near[0]}?)" if near else ""
    return f"there is no such key; {f'[{table}]' if table else 'a scene'} takes {', '.join(keys)}{hint}"


def to_internal(value: object, unit: str) -> float:
    """The number in the internal `unit` of a text such as "50 um"; ValueError or OverflowError if it is none."""
    match = _QUANTITY.fullmatch(value) if isinstance(value, str) and len(value) <= LONGEST else None
    if match is None:
        raise ValueError("not a number with a unit")
    digits, factor = match[1], _conversion(match[2], unit)
    if not math.isfinite(float(digits)):
        raise OverflowError("too large")
    return float(Fraction(digits) * factor) if float(digits) else 0.0


def shown(value: object, longest: int = 60) -> str:
    """A value as a message quotes it: as TOML would write it, shortened."""
    try:
        text = json.dumps(value, ensure_ascii=False, default=str)
    except (ValueError, RecursionError):  # an integer of thousands of digits, tables nested by the thousand
        text = type(value).__name__
    return text if len(text) <= longest else text[: longest - 3] + "..."


def _within(accepts: Range, value: float) -> float:
    if not (math.isfinite(value) and accepts.holds(value)):
        raise ValueError(f"not {accepts.words}")
    return value + 0.0  # no negative zero


@cache
def _conversion(given: str, unit: str) -> Fraction:
    """How many internal units the unit `given` is; ValueError if it is no unit, or of another dimension."""
    if unit == "rad" and given not in ANGLES:
        raise ValueError(f"{given} is not a unit of angle")
    registry = _registry()
    try:
        one = registry.Quantity(Fraction(1), registry.Unit(re.sub("^ ?/", "1/", given)))
        return Fraction(one.to(unit).magnitude)
    except Exception as error:  # pint lets errors of its parser through: of the tokenizer, of types, ...
        raise ValueError(f"{given} is not convertible to {unit}") from error


@cache
def _registry():
    """The unit registry, in exact fractions; imported when first needed, for it takes half a second."""
    import pint

    return pint.UnitRegistry(non_int_type=Fraction)
