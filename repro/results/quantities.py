"""What a reported number is: its name, with the ending of its unit, its words, its formula.

A name ends in its unit (``conductivity_m_per_d``, ``aggregate_area_um2``); one that ends in none is
a pure number. Formulas give the package's own units (um, h, mg/L, MPa); what a unit is of these is
told here and nowhere else.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Unit:
    """udunits: as UDUNITS (and so CF) writes it; shown: as a reader does; factor: how many there
    are in the package's own unit of the same kind."""

    udunits: str
    shown: str
    factor: float = 1


#: By the endings of names.
UNITS = {"_m_per_d": Unit("m d-1", "m/day", 24e-6), "_mg_per_L": Unit("mg L-1", "mg/L"),
         "_pg_per_m": Unit("pg m-1", "pg/m"), "_ug_per_m": Unit("ug m-1", "ug/m", 1e-6),
         "_ug_per_m_per_h": Unit("ug m-1 h-1", "ug/m/h", 1e-6), "_um2": Unit("um2", "um²"),
         "_um": Unit("um", "um"), "_cm": Unit("cm", "cm", 1e-4), "_h": Unit("h", "h"),
         "_s": Unit("s", "s"), "_MPa": Unit("MPa", "MPa")}
PURE = Unit("1", "")


@dataclass(frozen=True)
class Quantity:
    """A reported quantity.

    words: what it is called; formula: how it is made, for people to read, and value: the same for
    the computer, in the package's own units; label: a short name, in legends and above columns;
    needs: what must be modelled, such as "aggregate and flow" (words that :mod:`columns` or
    :mod:`arrays` explains; empty: nothing); yes_no: does it stand for yes (1) and no (0)? signed:
    may it be negative?
    """

    name: str
    words: str
    formula: str
    value: Callable[..., Any]
    label: str = ""
    needs: str = ""
    yes_no: bool = False
    signed: bool = False

    @property
    def unit(self) -> Unit:
        """That its name ends in."""
        return unit_of(self.name)

    def reported(self, *of: Any) -> Any:
        """The value in the unit of the name."""
        value = self.value(*of)
        return value if self.unit.factor == 1 else self.unit.factor * value


def is_modelled(quantity: Quantity, conditions: dict[str, Callable[..., bool]], *of: Any) -> bool:
    """Does everything hold that the quantity needs?"""
    needed = quantity.needs.split(" and ") if quantity.needs else []
    return all(conditions[word](*of) for word in needed)


def ending(name: str) -> str:
    """The ending of a name that is a unit, the longest one; empty where there is none."""
    return max((each for each in UNITS if name.endswith(each)), key=len, default="")


def unit_of(name: str) -> Unit:
    """The unit that a name ends in."""
    return UNITS.get(ending(name), PURE)


def plain(name: str) -> str:
    """Its unit as the name spells it ("m/d", "um2"), "1" for a pure number."""
    return ending(name).removeprefix("_").replace("_per_", "/") or "1"
