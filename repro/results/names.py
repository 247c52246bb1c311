"""Words and units of the columns and arrays of a run's files, by name."""

from collections.abc import Iterable

import numpy as np

from repro.results.arrays import ARRAYS
from repro.results.columns import BODY, DETACHED, LEDGER, RATES, SERIES, TOTALS, of_body
from repro.results.quantities import Quantity, ending, unit_of

#: Every column and array by its name.
KNOWN: dict[str, Quantity] = {quantity.name: quantity
                              for quantity in (*LEDGER, DETACHED, *SERIES, *RATES, *TOTALS,
                                               *ARRAYS)}
#: Ends of the columns that are coordinates. A percentage of one has no meaning.
COORDINATES = ("stream_um", "_x_um", "_y_um")
#: Columns without a value between rows, and relative defects of balances, which are round-off.
NOT_COMPARED = {"time_h", "nodes", *(name for name, quantity in KNOWN.items()
                                     if quantity.yes_no or name.endswith("_balance"))}
#: The columns that answer what becomes of a pore.
ANSWER = ("conductivity_m_per_d", "aggregate_area_um2", "thickness_um",
          "effluent_acceptor_mg_per_L", "effluent_donor_mg_per_L")


def known(name: str) -> Quantity | None:
    """The quantity of a name, also that of one aggregate among several; None if it is unknown."""
    of_bodies = (of_body(quantity, label_in(name, quantity)) for quantity in BODY
                 if label_in(name, quantity))
    return KNOWN.get(name) or next(of_bodies, None)


def label_in(name: str, quantity: Quantity) -> str:
    """The label of the aggregate in the name of a quantity of ``BODY``; empty in other names."""
    before, after = quantity.name.split("NAME")
    matches = len(name) > len(before + after) and name.startswith(before) and name.endswith(after)
    return name[len(before):-len(after)] if matches else ""


def label(name: str) -> str:
    """The short name of a column, for a legend; its words if it has none."""
    quantity = known(name)
    return (quantity and quantity.label) or words(name)


def words(name: str) -> str:
    """The words of a name, without its unit; an unknown name without underscores."""
    quantity = known(name)
    return quantity.words if quantity else name.removesuffix(ending(name)).replace("_", " ")


def attributes(name: str) -> dict[str, str]:
    """The attributes of a variable by the conventions of CF: unit and words."""
    return {"units": unit_of(name).udunits, "long_name": words(name)}


def unit(name: str) -> str:
    """The unit of a name for readers, empty for a pure number."""
    return unit_of(name).symbol


def with_unit(name: str, symbol: str | None = None) -> str:
    """Words and unit: "mean velocity (m/day)". symbol: of another unit."""
    symbol = unit(name) if symbol is None else symbol
    return f"{words(name)} ({symbol})" if symbol else words(name)


def readable_unit(name: str, values: Iterable[np.ndarray]) -> tuple[str, float]:
    """Symbol of the unit in which a page shows values, and the factor from the unit of the name.

    It is the largest unit in which some value reaches one, or the smallest unit if no value does.
    """
    largest = max((float(np.nanmax(np.abs(each))) for each in values if np.isfinite(each).any()),
                  default=0.0)
    units = ((unit(name), 1.0), *unit_of(name).smaller)
    if not largest:
        return units[0]
    return next((each for each in units if largest * each[1] >= 1), units[-1])
