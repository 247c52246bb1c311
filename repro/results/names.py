"""Words and units of the columns and arrays of a run's files, by name."""

from __future__ import annotations

from repro.results.arrays import ARRAYS
from repro.results.columns import LEDGER, SERIES
from repro.results.quantities import Quantity, ending, unit_of

#: Every column and array by its name.
KNOWN: dict[str, Quantity] = {quantity.name: quantity for quantity in (*LEDGER, *SERIES, *ARRAYS)}
#: Pure numbers that stand for yes (1) and no (0).
YES_NO = {name for name, quantity in KNOWN.items() if quantity.yes_no}
#: Relative defects of balances.
DEFECTS = {name for name in KNOWN if name.endswith("_balance")}


def words(name: str) -> str:
    """The words of a name, without its unit; an unknown name without underscores."""
    if name in KNOWN:
        return KNOWN[name].words
    return name.removesuffix(ending(name)).replace("_", " ")


def udunits(name: str) -> str:
    """The unit of a name in the spelling of UDUNITS, "1" for a pure number."""
    return unit_of(name).udunits


def unit(name: str) -> str:
    """The unit of a name for readers, empty for a pure number."""
    return unit_of(name).symbol


def with_unit(name: str) -> str:
    """Words and unit: "mean velocity (m/day)"."""
    return f"{words(name)} ({unit(name)})" if unit(name) else words(name)
