"""What one value of a scene may be, and its number in the units of the package.

Inside the package a length and a head are in um, a time in h, a concentration in mg/L, a modulus in MPa and an angle in rad,
and what is made of them likewise (a velocity in um/h). A scene's values are converted here and nowhere else: exactly, and rounded
once, so that "1164 min" and "19.4 h" are the same number.

A kind of value has `read` (what TOML gave -> what the model uses; ValueError or OverflowError when it is not accepted), its inverse
`write`, and `wanted`, the sentence that says what is accepted.
"""
import json
import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
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
ANGLES = ("deg", "degree", "degrees", "rad", "radian", "radians")  # to pint any dimensionless unit, "ppm" say, is an angle
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


def to_internal(value: object, unit: str) -> float:
    """The number in the internal `unit` that a text such as "50 um" stands for; ValueError or OverflowError if it is none."""
    match = _QUANTITY.fullmatch(value) if isinstance(value, str) and len(value) <= LONGEST else None
    if match is None:
        raise ValueError("not a number with a unit")
    number, given = match.groups()
    return float(Fraction(float(number)) * _conversion(given, unit))


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
    return value


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
