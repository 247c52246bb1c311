"""Reported quantities: name, unit, words and formula.

A name ends in its unit (``conductivity_m_per_d``, ``aggregate_area_um2``); a name without a unit
denotes a pure number. Formulas give the package's own units (um, h, mg/L, MPa); only this module
converts them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from math import isnan
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from repro.model.solving import Solved


@dataclass(frozen=True)
class Unit:
    """A unit of reported quantities.

    Parameters
    ----------
    udunits : str
        Its spelling in UDUNITS and CF.
    symbol : str
        Its spelling for readers.
    factor : float
        How many of this unit are one of the package's own unit of the same kind.
    smaller : tuple of (str, float)
        Symbol and factor of the units in which pages show small values, the largest unit first.

    Examples
    --------
    >>> from repro.results.quantities import Unit
    >>> Unit("cm", "cm", 1e-4).factor  # one um is 1e-4 cm
    0.0001
    """

    udunits: str
    symbol: str
    factor: float = 1
    smaller: tuple[tuple[str, float], ...] = ()


#: By the endings of names.
UNITS = {"_m_per_d": Unit("m d-1", "m/day", 24e-6), "_mg_per_L": Unit("mg L-1", "mg/L"),
         "_pg_per_m": Unit("pg m-1", "pg/m"), "_ug_per_m": Unit("ug m-1", "ug/m", 1e-6),
         "_ug_per_m_per_h": Unit("ug m-1 h-1", "ug/m/h", 1e-6),
         "_um3": Unit("um3", "um³"), "_um2": Unit("um2", "um²"), "_um": Unit("um", "um"),
         "_cm": Unit("cm", "cm", 1e-4), "_h": Unit("h", "h"),
         "_s": Unit("s", "s"),
         "_MPa": Unit("MPa", "MPa", smaller=(("kPa", 1e3), ("Pa", 1e6))),
         "_uN_per_m": Unit("uN m-1", "uN/m", 1e6), "_nN": Unit("nN", "nN", 1e3),
         "_uL_per_min": Unit("uL min-1", "uL/min", 1e-9 / 60),
         "_pg_per_h": Unit("pg h-1", "pg/h", 1e-6)}


@dataclass(frozen=True)
class Quantity:
    """A reported quantity.

    Parameters
    ----------
    name : str
        Key in tables and files, with the unit at its end.
    words : str
        Name for readers.
    formula : str
        Definition for readers.
    value : callable
        The same definition in Python, in the package's own units.
    label : str
        Short name, for legends and heads of columns.
    needs : str
        Parts that the scene must model, like "aggregate and flow": words of ``NEEDS`` in
        :mod:`columns` or :mod:`arrays`. Empty if there are none.
    yes_no : bool
        True if its values 1 and 0 mean yes and no.
    signed : bool
        True if it may be negative.
    jumps : str
        Parts of the scene whose tables over time make it jump: "flow", "flow and substrates"
        without stored substrates, or "flow and forces" with the fluid's forces. Empty if it does
        not jump.

    Examples
    --------
    >>> from repro.results.quantities import Quantity
    >>> area = Quantity("area_um2", "area", "W L", lambda width, length: width * length)
    >>> area.unit.symbol, area.reported(2.0, 3.0)
    ('um²', 6.0)
    """

    name: str
    words: str
    formula: str
    value: Callable[..., Any]
    label: str = ""
    needs: str = ""
    yes_no: bool = False
    signed: bool = False
    jumps: str = ""

    @property
    def unit(self) -> Unit:
        """The unit at the end of its name."""
        return unit_of(self.name)

    def reported(self, *arguments: Any) -> Any:
        """Return the value in the unit of the name; None if it is None."""
        value = self.value(*arguments)
        return value if value is None or self.unit.factor == 1 else self.unit.factor * value


def is_modelled(quantity: Quantity, conditions: dict[str, Callable[..., bool]],
                *arguments: Any) -> bool:
    """Return whether all parts are modelled that the quantity needs."""
    needed = quantity.needs.split(" and ") if quantity.needs else []
    return all(conditions[word](*arguments) for word in needed)


def is_solved(solved: Solved, substrate: str) -> bool:
    """Return whether the state has concentrations of a substrate."""
    return getattr(solved.concentrations, substrate, None) is not None


def none_if_nan(value: float) -> float | None:
    """Return a float, or None for not-a-number."""
    return None if isnan(value) else float(value)


def ending(name: str) -> str:
    """Return the longest ending of a name that is a unit; empty for a pure number."""
    return max((each for each in UNITS if name.endswith(each)), key=len, default="")


@cache
def unit_of(name: str) -> Unit:
    """Return the unit at the end of a name."""
    return UNITS.get(ending(name), Unit("1", ""))


def plain(name: str) -> str:
    """Return the unit as a name spells it ("m/d", "um2"), "1" for a pure number."""
    return ending(name).removeprefix("_").replace("_per_", "/") or "1"
