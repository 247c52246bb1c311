"""Kinds of values in a scene, and their conversion to the units of the package.

Inside the package lengths and heads are in um, times in h, concentrations in mg/L, moduli in MPa,
angles in rad, and derived quantities accordingly (a velocity in um/h). Values of a scene are only
converted here: exactly, and rounded once, so that "1164 min" and "19.4 h" are the same number.

A kind of value has the methods `read` (TOML value -> value of the model; raises ValueError or
OverflowError with the reason if it is not accepted), its inverse `write`, and `near` (the accepted
value nearest to a refused one, empty if unknown), and the texts `accepted` and `requirement`, which
describe the accepted values. A section of a scene is a dataclass. The metadata of its fields hold
their kind, or the dataclass of a subsection, a description, and the source in the paper.
"""
import difflib
import json
import math
import re
import unicodedata
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from decimal import Decimal
from fractions import Fraction
from functools import cache, partial
from numbers import Real
from typing import ClassVar, NamedTuple

from repro.errors import Refusal, printable
from repro.scene import exact
from repro.scene.time_table import TimeTable

NOUNS = {
    "um": "a length",
    "h": "a time",
    "um^2": "a permeability",
    "um/h": "a velocity",
    "um^3/h": "a flow rate",
    "1/um/h": "a velocity per area",
    "um/h/MPa": "a velocity per pressure",
    "um/h^2": "an acceleration",
    "um^2/h": "a diffusivity or kinematic viscosity",
    "1/h": "a rate",
    "mg/L": "a concentration or density",
    "MPa": "a pressure or modulus",
    "rad": "an angle",
}
LONGEST = 80  # characters of a value with its unit
MOST_POINTS = 1000  # of an outline
DIGITS = r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_FACTOR = r"[A-Za-z\u00b5\u03bc]+(?:(?:\^|\*\*)?-?[1-9])?"
_UNIT = rf"(?:1? ?/ ?)?{_FACTOR}(?:(?: ?[*/] ?| ){_FACTOR})*"
#: Signs of printed units, as a keyboard writes them.
_PRINTED = str.maketrans("\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079"
                         "\u207b\u2212\u00b7\u22c5", "0123456789--**")
_MOLES = re.compile(r"(?<![A-Za-z])(?:[num\u00b5\u03bc]|milli|micro|nano)?"
                    r"(?:mol(?:es?|ars?)?|M)(?![A-Za-z])")
NOT_IN_PAPER = "Not in the paper"
NO_MOLES = "moles need a molar mass, which is not known here: give milligrams"


class Range(NamedTuple):
    """A range of accepted numbers, in internal units: in words and as a test."""

    words: str
    holds: Callable[[float], bool]


POSITIVE = Range("greater than zero", lambda value: value > 0)
NON_NEGATIVE = Range("zero or more", lambda value: value >= 0)
BELOW_1 = Range("zero or more, less than 1", lambda value: 0 <= value < 1)
#: Of a pore: below it water is no continuum; above it no pore is meant.
PORE_WIDTH = Range("from 1 nm to 1 m", lambda value: 1e-3 <= value <= 1e6)
ACUTE = Range("between 0 and 90 deg", lambda value: 0 < value < math.pi / 2)
EITHER_SIGN = Range("of either sign", math.isfinite)


def from_0_to(most: float) -> Range:
    """Return the range from 0 to ``most``."""
    return Range(f"from 0 to {most:g}", lambda value: 0 <= value <= most)


def up_to(most: float) -> Range:
    """Return the range of numbers greater than zero up to ``most``."""
    return Range(f"greater than zero, at most {most:g}", lambda value: 0 < value <= most)


class Stated(NamedTuple):
    """A quantity as a scene's text writes it, and its parts."""

    text: str
    number: float
    unit: str


class Plain:
    """A kind of values that TOML has itself, and for which nothing near a refused one is known."""

    def write(self, value):
        return value

    def near(self, value: object) -> str:
        return ""


@dataclass(frozen=True)
class Quantity:
    """A number with a unit, such as "50 um", that can be converted to the internal `unit`."""

    unit: str
    example: str
    accepts: Range = POSITIVE

    @property
    def default(self) -> dict:
        return {"default_factory": partial(self.read, self.example)}

    @property
    def accepted(self) -> str:
        return f"{NOUNS[self.unit]}, {self.accepts.words}"

    @property
    def requirement(self) -> str:
        return f'{NOUNS[self.unit]} is needed, such as "{self.example}" ({self.accepts.words})'

    def near(self, value: object) -> str:
        """Suggest a plain number with the unit of the example."""
        endless = isinstance(value, int) and abs(value) >= 10**LONGEST
        if isinstance(value, bool) or endless:
            return ""
        plain = isinstance(value, Real | str) and re.fullmatch(DIGITS, f"{value}")
        meant = f"{value} {self.usual_unit}" if plain else ""
        return f'"{meant}"' if _takes(self, meant) else ""

    def read(self, value: object) -> float:
        return _within(self.accepts, to_internal(value, self.unit))

    def write(self, value: float, unit: str = "") -> str:
        """Write a value in the internal unit, or in another one."""
        return in_unit(value, self.unit, unit) if unit else f"{float(value)!r} {self.unit}"

    def stated(self, value: float, unit: str) -> Stated:
        """Text, number and unit of a value; `value` is in the internal unit, the text in `unit`."""
        text = self.write(value, unit)
        return Stated(text, float(_parts(text)[0]), unit)

    @property
    def usual_unit(self) -> str:
        """The unit of the example."""
        return _parts(self.example)[1]


class Refused(ValueError):
    """A value is not accepted; the message replaces the requirement of its kind."""


@dataclass(frozen=True)
class Timed(Quantity):
    """A quantity, or a table of times (h) and values: read as a float, or as a TimeTable.

    A list is a table in steps, ``{table = LIST, between = "linear"}`` one that is interpolated.
    """

    clock = Quantity("h", "5 h", NON_NEGATIVE)

    @property
    def accepted(self) -> str:
        return (f"{super().accepted}; or a list of [time, value] pairs from 0 h on, such as "
                f"{self._table}, with jumps at these times; or {self._linear}")

    @property
    def requirement(self) -> str:
        return f"{super().requirement}, or a list of [time, value] pairs such as {self._table}"

    @property
    def _table(self) -> str:
        return json.dumps([["0 h", self.example], ["5 h", self.example]])

    @property
    def _linear(self) -> str:
        return f'{{ table = {self._table}, between = "linear" }}'

    def read(self, value: object) -> float | TimeTable:  # type: ignore[override]  # or a table
        between, entries = "steps", as_list(value)
        if isinstance(value, dict) and "table" in value:
            entries, between = as_list(value["table"]), value.get("between")
            if (value.keys() != {"table", "between"} or entries is None
                    or between not in ("steps", "linear")):
                raise Refused('a table and what is between its times, "steps" or "linear", are '
                              f"needed, such as {self._linear}")
        if entries is None:
            return super().read(value)
        if not 1 <= len(entries) <= MOST_POINTS:
            raise Refused(f"a table of 1 to {MOST_POINTS} entries is needed, such as {self._table}")
        times, values = zip(*map(self._entry, range(1, len(entries) + 1), entries))
        if times[0] != 0:
            raise Refused('the time of the first entry of a table must be "0 h"')
        for number, (one, other) in enumerate(zip(times, times[1:]), 2):
            if other <= one:
                raise Refused(f"times of a table must ascend: {other:g} h of entry {number} is not "
                              f"after {one:g} h")
        return TimeTable(times, values, between == "linear")

    def _entry(self, number: int, entry: object) -> tuple[float, float]:
        """Time and value of an entry of a table."""
        pair = as_list(entry)
        example = f'["5 h", "{self.example}"]'
        if pair is None or len(pair) != 2:
            raise Refused(f"entry {number} of a table must be a time and a value, such as "
                          f"{example}")
        try:
            return self.clock.read(pair[0]), super().read(pair[1])
        except (ValueError, OverflowError) as error:
            raise Refused(f"entry {number} of a table must be a time of zero or more and "
                          f"{super().accepted}, such as {example}{because(error)}") from None

    def write(self, value, unit=""):
        if not isinstance(value, TimeTable):
            return super().write(value, unit)
        table = [[self.clock.write(time), super(Timed, self).write(one, unit)]
                 for time, one in zip(value.times, value.values)]
        return {"table": table, "between": "linear"} if value.linear else table


@dataclass(frozen=True)
class Share(Quantity):
    """A quantity, read as a float, or a percentage of that of the key `of`, as a Fraction."""

    of: str = ""

    @property
    def accepted(self) -> str:
        return f'{super().accepted}, or a share of {self.of} such as "80 %"'

    @property
    def requirement(self) -> str:
        return f'{super().requirement}, or a share of {self.of} up to "100 %"'

    def read(self, value: object) -> float | Fraction:  # type: ignore[override]  # or a share
        text = value if isinstance(value, str) and len(value) <= LONGEST else ""
        match = re.fullmatch(rf"({DIGITS}) *%", text)
        if match is None:
            return super().read(value)
        if not 0 < float(match[1]) <= 100:
            raise ValueError
        return Fraction(match[1]) / 100


@dataclass(frozen=True)
class Number(Plain):
    """A plain number, without a unit."""

    example: float
    accepts: Range = POSITIVE

    @property
    def default(self) -> dict:
        return {"default": self.example}

    @property
    def accepted(self) -> str:
        return f"a plain number, {self.accepts.words}"

    @property
    def requirement(self) -> str:
        return f"a plain number is needed, such as {self.example:g} ({self.accepts.words})"

    def near(self, value: object) -> str:
        """Suggest the number of a text that has no unit or one with a dimension."""
        text = value if isinstance(value, str) and len(value) <= LONGEST else ""
        match = re.fullmatch(rf"({DIGITS})(?: *({_UNIT}))?", text)
        if match is None or not _takes(self, float(match[1])):
            return ""
        return "" if match[2] and _has_dimensionless_factor(match[2]) else match[1]

    def read(self, value: object) -> float:
        value = plain(value) if hasattr(value, "magnitude") else value
        if isinstance(value, bool) or not isinstance(value, Real):
            has_moles = isinstance(value, str) and _MOLES.search(value[:LONGEST])
            raise ValueError(NO_MOLES if has_moles else _fault(value))
        return _within(self.accepts, float(value))


@dataclass(frozen=True)
class Choice(Plain):
    """One of a few words."""

    words: tuple[str, ...]

    @property
    def default(self) -> dict:
        return {"default": self.words[0]}

    @property
    def accepted(self) -> str:
        return " or ".join(f'"{word}"' for word in self.words)

    @property
    def requirement(self) -> str:
        return f"{self.accepted} is needed"

    def near(self, value: object) -> str:
        word = nearest(value, self.words) if isinstance(value, str) else ""
        return f'"{word}"' if word else ""

    def read(self, value: object) -> str:
        if not isinstance(value, str) or value not in self.words:
            raise ValueError(_wrong_type(value))
        return str(value)


@dataclass(frozen=True)
class Word(Plain):
    """A name that is a key of TOML without quotes and no number."""

    default: ClassVar[dict] = {"default": None}
    example = "upstream"
    accepted = "a word of up to 30 letters, digits, - and _ that begins with a letter"
    requirement = f'{accepted} is needed, such as "{example}"'

    def accepts(self, value: object) -> bool:
        """Return whether a value is a name."""
        return (isinstance(value, str) and value.casefold() not in ("inf", "infinity", "nan")
                and re.fullmatch("[A-Za-z][A-Za-z0-9_-]{0,29}", value) is not None)

    def read(self, value: object) -> str:
        if not self.accepts(value):
            raise ValueError(_wrong_type(value))
        return str(value)


WORD = Word()


@dataclass(frozen=True)
class Times:
    """A list of one or more times (h), in any order; read in ascending order, each once."""

    each = Quantity("h", "5 h", NON_NEGATIVE)
    default: ClassVar[dict] = {"default": None}
    example = ["5 h", "18 h"]
    accepted = "a list of one or more times, each zero or more"
    requirement = 'a list of times is needed, such as ["5 h", "18 h"] (each zero or more)'

    def read(self, value: object) -> tuple[float, ...]:
        times = as_list(value)
        if not times:
            raise ValueError(_wrong_type(value))
        return tuple(sorted(set(_each("entry", self.each.read, times))))

    def write(self, value: tuple[float, ...]) -> list[str]:
        return [self.each.write(time) for time in value]

    def near(self, value: object) -> str:
        """Suggest a single time, in a list."""
        accepted = isinstance(value, str) and _takes(self.each, value)
        return f"[{json.dumps(value)}]" if accepted else ""


@dataclass(frozen=True)
class Drawn:
    """A file with an outline, and um per unit of its coordinates or per pixel."""

    file: str
    um_per_unit: float


@dataclass(frozen=True)
class Points:
    """A list of points (x, y), um, in their order, or a file with a polygon."""

    each = Quantity("um", "4 um", EITHER_SIGN)
    default: ClassVar[dict] = {"default": None}
    example = [["-5 um", "0 um"], ["0 um", "4 um"], ["5 um", "0 um"]]
    file = '{ file = "colony.geojson", um_per_unit = 1.0 }'
    listed = f"a list of 3 to {MOST_POINTS} points [x, y], each a pair of lengths"
    accepted = (f"{listed}; or a file .geojson, .csv or .png with a polygon or a mask, such as "
                f"{file}")
    requirement = f"{listed}, is needed, such as {json.dumps(example)}, or a file, such as {file}"
    scale = Number(1.0)

    def read(self, value: object) -> tuple[tuple[float, float], ...] | Drawn:
        if isinstance(value, dict):
            if value.keys() != {"file", "um_per_unit"} or not isinstance(value["file"], str):
                raise ValueError("a file has the keys file and um_per_unit")
            try:
                return Drawn(value["file"], self.scale.read(value["um_per_unit"]))
            except ValueError as error:
                raise Refused("um_per_unit, the length of a unit or pixel in um, is a plain number "
                              f"greater than zero{because(error)}") from None
        points = as_list(value)
        if points is None or not 3 <= len(points) <= MOST_POINTS:
            raise ValueError(_wrong_type(value))
        return tuple(_each("point", self._point, points))

    def _point(self, value: object) -> tuple[float, float]:
        pair = as_list(value)
        if pair is None or len(pair) != 2:
            raise ValueError("not a pair of lengths")
        return self.each.read(pair[0]), self.each.read(pair[1])

    def write(self, value: tuple[tuple[float, float], ...]) -> list[list[str]]:
        return [[self.each.write(x), self.each.write(y)] for x, y in value]

    def near(self, value: object) -> str:
        return ""


@dataclass(frozen=True)
class Flag(Plain):
    """Yes or no."""

    default: ClassVar[dict] = {"default": False}
    accepted = "true or false"
    requirement = "true or false is needed, without quotes"

    def read(self, value: object) -> bool:
        if not isinstance(value, bool):
            raise ValueError(_wrong_type(value))
        return value

    def near(self, value: object) -> str:
        """Suggest the word true or false without its quotes."""
        word = value.casefold() if isinstance(value, str) else ""
        return word if word in ("true", "false") else ""


Kind = Quantity | Number | Choice | Word | Times | Points | Flag


def scene_key(kind: Kind, *, about: str, source: str = NOT_IN_PAPER, stated: str = "", **default):
    """Declare a key of a scene: a field of a dataclass whose metadata describe the key.

    default: of the field, if it is not that of the kind; stated: describes a default that depends
    on other keys.
    """
    metadata = {"kind": kind, "about": about, "source": source, "stated": stated}
    return field(metadata=metadata, **(default or kind.default))


def quantity(text: str, unit: str, accepts: Range = POSITIVE, **described):
    """Declare a value with a unit: `text` is its default, or an example if `default` is set."""
    return scene_key(Quantity(unit, text, accepts), **described)


def timed_quantity(text: str, unit: str, accepts: Range = POSITIVE, **described):
    """Declare a value with a unit, like :func:`quantity`, or a table over time."""
    return scene_key(Timed(unit, text, accepts), **described)


def number(example: float, accepts: Range = POSITIVE, **described):
    """Declare a plain number; `example` is its default unless `default` is set."""
    return scene_key(Number(example, accepts), **described)


def choice(*words: str, **described):
    """Declare a key of a scene that is one of several words.

    Parameters
    ----------
    *words : str
        The accepted words. The first one is the default.
    **described : str
        ``about``, ``source`` and ``stated`` as in :func:`scene_key`, and ``default``.

    Returns
    -------
    dataclasses.Field
        The field of the section's dataclass.

    Examples
    --------
    >>> from repro.scene.units import choice
    >>> choice("steps", "linear", about="Between the times", source="Not in the paper").default
    'steps'
    """
    return scene_key(Choice(words), **described)


def section(kind: type, *, about: str, source: str = NOT_IN_PAPER, **default):
    """Declare a table, whose keys are those of the dataclass `kind`."""
    default = default or {"default_factory": kind}
    return field(metadata={"section": kind, "about": about, "source": source}, **default)


def sections(kind: type, key: str, *, about: str, source: str):
    """Declare a table, or a list of tables, under a key: a field with a tuple of `kind`."""
    metadata = {"section": kind, "key": key, "about": about, "source": source}
    return field(metadata=metadata, default=())


class SceneError(Refusal, ValueError):
    """A scene is not accepted: one line names the file, key, value and accepted values.

    Parameters
    ----------
    message : str
        The line. Unprintable letters become spaces.

    Examples
    --------
    >>> import repro
    >>> try:
    ...     repro.load_scene("base", ["pore.width=50"])
    ... except repro.SceneError as error:
    ...     print(str(error).partition(":")[0])
    base
    """

    def __init__(self, message: str):
        super().__init__(printable(message))


def to_internal(value: object, unit: str) -> float:
    """Convert a text such as "50 um" to a number in the internal `unit`.

    Raises ValueError or OverflowError if the text is not a quantity of this kind.
    """
    digits, from_unit = _parts(value)
    try:
        factor = _conversion(from_unit, unit)
    except ValueError:
        raise ValueError(_unfit(from_unit, unit)) from None
    if not math.isfinite(float(digits)):
        raise OverflowError("too large")
    return float(Fraction(digits) * factor) if float(digits) else 0.0


def _parts(value: object) -> tuple[str, str]:
    """Split a number with a unit into its digits and the unit. Raises ValueError for others."""
    value = plain(value) if hasattr(value, "magnitude") else value
    text = value.translate(_PRINTED) if isinstance(value, str) and len(value) <= LONGEST else ""
    match = re.fullmatch(rf"({DIGITS}) *({_UNIT})", text)
    if match is None:
        raise ValueError(_fault(value))
    return match[1], match[2]


def _fault(value: object) -> str:
    """Return why a value is not a number with a unit; empty if only the unit is missing."""
    if not isinstance(value, str):
        return _wrong_type(value)
    if len(value) > LONGEST:
        return f"it has more than {LONGEST} characters"
    odd = re.search(r"[^A-Za-z0-9\u00b5\u03bc .+*/^-]", value.translate(_PRINTED))
    if odd:
        return odd_character(odd[0])
    start = re.match(DIGITS, value)
    if start is None:
        return "it does not start with a number"
    unit = value[start.end():].strip()
    return f'"{unit}" is not a unit' if unit else ""


def odd_character(letter: str) -> str:
    """Return a sentence that names a letter that is not accepted."""
    if letter == ",":
        return 'the character "," is not accepted; the decimal sign is a point'
    name = unicodedata.name(letter, "a control character").lower()
    sign = f'"{letter}"' if letter.isascii() and letter.isprintable() else f"U+{ord(letter):04X}"
    return f"the character {sign} ({name}) is not accepted"


def _wrong_type(value: object) -> str:
    """Name the type of a refused value; empty for numbers, texts and lists."""
    kind = type(value)
    if kind in (int, float, str, list):
        return ""
    package = kind.__module__.partition(".")[0]
    name = kind.__name__ if package == "builtins" else f"{package}.{kind.__name__}"
    return f"it is of the type {name}"


def because(error: Exception) -> str:
    """Return the reason of a refusal after a semicolon; empty without a reason."""
    return f"; {error}" if str(error) else ""


def as_list(value: object) -> list | None:
    """Return a list, a tuple or an array as a list; None for other values."""
    listed = plain(value)
    return list(listed) if isinstance(listed, list | tuple) else None


def plain(value):
    """Return a value of NumPy or pint in the types of a TOML file, and other values unchanged.

    An array is a list. A quantity, which has ``magnitude`` and ``units``, is a text such as
    "50.0 micrometer", or a number if it is dimensionless.
    """
    if hasattr(value, "magnitude") and hasattr(value, "units"):
        unit = str(value.units).replace(" ** ", "^")
        return _with_unit(plain(value.magnitude), "" if unit == "dimensionless" else unit)
    return value.tolist() if type(value).__module__ == "numpy" else value


def _with_unit(magnitude, unit: str):
    """Return a magnitude, a number or a nested list of numbers, with its unit."""
    if isinstance(magnitude, list):
        return [_with_unit(each, unit) for each in magnitude]
    return f"{float(magnitude)!r} {unit}" if unit else magnitude


def _each(noun: str, read: Callable, values: list) -> Iterator:
    """Read every entry of a list; the reason of a refusal has its number."""
    for number, value in enumerate(values, 1):
        try:
            yield read(value)
        except (ValueError, OverflowError) as error:
            raise ValueError(f"{noun} {number} is not accepted{because(error)}") from None


def in_unit(value: float, unit: str, to_unit: str) -> str:
    """Write a number in the internal `unit` with another unit, so that it reads back unchanged."""
    converted = Fraction(value) / _conversion(to_unit, unit)
    texts = (f"{float(converted):.15g}", repr(float(converted)),
             str(Decimal(converted.numerator) / Decimal(converted.denominator)))
    return next(text for text in (f"{digits} {to_unit}" for digits in texts)
                if to_internal(text, unit) == value)


def units_of(tables: object, key: str = "") -> dict[str, str]:
    """Return the unit of each dotted key of TOML tables whose value has one.

    That of a list is the unit of its first entry.
    """
    units: dict[str, str] = {}
    if isinstance(tables, dict) and "table" in tables:
        tables = tables["table"]
    if isinstance(tables, list) and any(isinstance(part, dict) for part in tables):
        tables = {number: part for number, part in enumerate(tables, 1)}
    for name, part in tables.items() if isinstance(tables, dict) else ():
        units |= units_of(part, f"{key}.{name}" if key else str(name))
    first = (as_list(tables) or [tables])[0]
    try:
        return units or {key: _parts((as_list(first) or [first])[-1])[1]}
    except ValueError:
        return units


def alike(first: object, second: object) -> bool:
    """Return whether two values of TOML tables are the same, apart from unit and round-off."""
    if isinstance(first, list) and isinstance(second, list):
        return len(first) == len(second) and all(map(alike, first, second))
    try:
        unit = _parts(second)[1]
        return math.isclose(to_internal(first, unit), to_internal(second, unit), rel_tol=1e-14)
    except (ValueError, OverflowError):
        return first == second


def nearest(word: str, words: Iterable[str], cutoff: float = 0.6) -> str:
    """Return the word with similar letters, or with `word` as a part; empty if there is none.

    cutoff: similarity that it needs, as for difflib.
    """
    folded, word = {other.casefold(): other for other in words}, word[:60].casefold()
    parts = [other for other in folded if word in other.split("_")]
    matches = difflib.get_close_matches(word, list(folded), n=1, cutoff=cutoff) or parts
    return folded[matches[0]] if matches else ""


def _takes(kind: "Quantity | Number", value: object) -> bool:
    try:
        kind.read(value)
    except (ValueError, OverflowError):
        return False
    return True


def _within(accepts: Range, value: float) -> float:
    if not (math.isfinite(value) and accepts.holds(value)):
        raise ValueError
    return value + 0.0  # no negative zero


@cache
def _conversion(from_unit: str, unit: str) -> Fraction:
    """Factor from `from_unit` to the internal `unit`.

    Raises ValueError if it is no unit, or of another dimension.
    """
    angle = exact.UNITS["rad"][1:]
    if unit == "rad" and exact.UNITS.get(from_unit, (1,))[1:] != angle:  # to pint "ppm" is one too
        raise ValueError(f"{from_unit} is not a unit of angle")
    if unit != "rad" and _has_dimensionless_factor(from_unit):
        raise ValueError(f"{from_unit} has a factor without dimension")
    factor = exact.conversion(from_unit, unit)
    return _by_pint(from_unit, unit) if factor is None else factor


def _by_pint(from_unit: str, unit: str) -> Fraction:
    """Like `_conversion`, for any unit."""
    try:
        powers = re.sub(r"(?<=[^\W\d])(?=-?[1-9])", "^", re.sub("^ ?/", "1/", from_unit))
        one = _registry().Quantity(Fraction(1), _registry().Unit(powers))
        return Fraction(one.to(unit).magnitude)
    except Exception as error:  # pint lets errors of its parser through: of tokens, of types, ...
        raise ValueError(f"{from_unit} is not convertible to {unit}") from error


def _has_dimensionless_factor(unit: str) -> bool:
    """Whether a unit has a factor without dimension, such as "percent" or "deg"."""
    return any(_is_dimensionless(factor["name"]) for factor in exact.FACTOR.finditer(unit))


def _is_dimensionless(name: str) -> bool:
    known = exact.UNITS.get(name)
    try:
        return _registry().Unit(name).dimensionless if known is None else not any(known[1:])
    except Exception:  # not a unit; pint lets errors of its parser through
        return False


def _unfit(from_unit: str, unit: str) -> str:
    """Return why a unit is not one of the kind of `unit`.

    The reason names the factor without which the unit is accepted, else the whole unit.
    """
    if unit in ("mg/L", "1/h") and _MOLES.search(from_unit):  # values of other models
        return NO_MOLES
    if unit == "mg/L" and from_unit in ("ppm", "ppb"):
        return "give mg/L (in water 1 ppm is about 1 mg/L, 1 ppb about 1 ug/L)"
    for factor in exact.FACTOR.finditer(from_unit):
        rest = from_unit[:factor.start()] + from_unit[factor.end():]
        with suppress(ValueError):
            _conversion(rest.lstrip(" *"), unit)
            return f'"{factor[0].strip(" */")}" is not accepted in this unit'
    return f'"{from_unit}" is not a unit of this kind'


@cache
def _registry():
    """All units as exact fractions; built on first use, since this takes half a second."""
    import pint

    return pint.UnitRegistry(non_int_type=Fraction)
