"""Pictures of convergence, ``verification/report/STAGE.svg``: a panel a case, with the errors of its studies.

The series are those of ``evidence.json``, to two digits. A dashed line through the last error of a quantity has the
order in the middle of its band.
"""

from collections.abc import Mapping
from itertools import zip_longest
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from verification.evidence.checks import Study
from verification.evidence.results import Result
from verification.evidence.writing import saved_figure

COLUMNS = 2
#: Largest number of quantities in a legend.
MAX_NAMED = 5
#: Largest ratio of the sizes with labels besides powers of ten.
MANY_DECADES = 200.0


def series(result: Result) -> dict[str, list[list[float]]]:
    """{quantity: [sizes, errors, [the order in the middle of the band]]} of the studies of a case."""
    studies = [part for part in result.measured if isinstance(part, Study) and (part.errors > 0).all()]
    return {study.quantity: [_two_digits(study.sizes), _two_digits(study.errors), [(study.low + study.high) / 2]]
            for study in studies}


def _two_digits(values: np.ndarray) -> list[float]:
    return [float(f"{value:.1e}") for value in values if np.isfinite(value)]


def draw(cases: Mapping[str, Mapping[str, list]], target: Path) -> None:
    """Write the picture of the series of some cases: {case: {quantity: series}}."""
    columns = min(COLUMNS, len(cases))
    rows = -(-len(cases) // columns)
    figure = Figure(figsize=(4.5 * columns, 3.3 * rows + 0.2), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for axis, case in zip_longest(axes, cases):
        if case is None:
            axis.remove()
        else:
            _panel(axis, case, cases[case])
    saved_figure(figure, target)


def _panel(axis, case: str, studies: Mapping[str, list]) -> None:
    """Draw the studies of a case. Names that are equal up to a comma share a colour and an entry of the legend."""
    names = list(dict.fromkeys(quantity.partition(",")[0] for quantity in studies))
    named: set[str] = set()
    for quantity, (sizes, errors, (order,)) in studies.items():
        name = quantity.partition(",")[0]
        color = f"C{names.index(name) % 10}"
        label = name if name not in named and len(named) < MAX_NAMED else None
        axis.loglog(sizes, errors, ".-", color=color, lw=0.8, ms=4, label=label)
        axis.loglog(sizes, errors[-1] * (np.array(sizes) / sizes[-1]) ** order, "--", color=color, lw=0.4, alpha=0.6)
        named.add(name)
    low, high = axis.get_xlim()
    axis.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if high < MANY_DECADES * low else (1,)))
    axis.xaxis.set_major_formatter("{x:g}")
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.set_title(case, fontsize=10)
    axis.set_xlabel("size of elements or steps", fontsize=8)
    axis.set_ylabel("error", fontsize=8)
    axis.tick_params(labelsize=8, which="both")
    axis.legend(fontsize=7)
