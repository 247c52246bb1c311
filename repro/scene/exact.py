"""Symbols of common units as exact fractions of SI units, and their products.

:mod:`repro.scene.units` converts all other units with pint, also names such as "micrometers".
Importing pint takes half a second. A test compares each factor with that of pint.
"""
import re
from fractions import Fraction
from typing import NamedTuple

PREFIXES = {"": 0, "n": -9, "u": -6, "\u00b5": -6, "\u03bc": -6, "m": -3, "c": -2, "d": -1,
            "h": 2, "k": 3, "M": 6, "G": 9}
PI = Fraction("3.1415926535897932384626433832795028841971693993751")  # as many digits as pint's
FACTOR = re.compile(r"(?P<sign>[*/ ]*)(?P<name>[^\W\d_]+)(?:(?:\^|\*\*)?(?P<power>-?[1-9]))?")


class Unit(NamedTuple):
    """A unit of `size` m^length kg^mass s^time."""

    size: Fraction
    length: int = 0
    mass: int = 0
    time: int = 0

    def __pow__(self, power: int) -> "Unit":
        return Unit(self.size**power, *(power * exponent for exponent in self[1:]))

    def by(self, other: "Unit") -> "Unit":
        """The product of two units."""
        return Unit(self.size * other.size, *(a + b for a, b in zip(self[1:], other[1:])))


#: Units that take prefixes.
PREFIXED = {"m": Unit(Fraction(1), length=1), "g": Unit(Fraction(1, 1000), mass=1),
            "s": Unit(Fraction(1), time=1),
            "L": Unit(Fraction(1, 1000), length=3), "l": Unit(Fraction(1, 1000), length=3),
            "Pa": Unit(Fraction(1), -1, 1, -2)}
#: Other units, each with its names.
NAMED = {"min minute minutes": Unit(Fraction(60), time=1),
         "h hr hour hours": Unit(Fraction(3600), time=1),
         "d day days": Unit(Fraction(86_400), time=1),
         "rad radian radians": Unit(Fraction(1)), "deg degree degrees": Unit(PI / 180)}
#: Every known spelling.
UNITS = {prefix + name: unit._replace(size=unit.size * Fraction(10) ** power)
         for name, unit in PREFIXED.items() for prefix, power in PREFIXES.items()}
UNITS |= {name: unit for names, unit in NAMED.items() for name in names.split()}


def conversion(from_unit: str, unit: str) -> Fraction | None:
    """Factor from `from_unit` to `unit`; None if either contains a unit that is not listed here.

    Both are products and quotients like "mg/L", "1/day", "m^2 s^-1", "m2 s-1". Raises ValueError if
    their dimensions differ.
    """
    source = _product(from_unit)
    target = _product(unit)
    if source is None or target is None:
        return None
    if source[1:] != target[1:]:
        raise ValueError(f"{from_unit} is not convertible to {unit}")
    return source.size / target.size


def _product(text: str) -> Unit | None:
    """Evaluate a product of units from left to right; None if a unit is unknown."""
    product = Unit(Fraction(1))
    for factor in FACTOR.finditer(text.removeprefix("1")):
        if factor["name"] not in UNITS:
            return None
        power = int(factor["power"] or 1)
        product = product.by(UNITS[factor["name"]] ** (-power if "/" in factor["sign"] else power))
    return product
