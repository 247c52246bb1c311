"""Pictures of a case: errors against size with a slope triangle; profiles, ours solid, reference dashed, exact dots."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np

from verification.kernel.case import Result

matplotlib.use("Agg")

STYLES = {"ours": {"ls": "-"}, "reference": {"ls": "--", "color": "k"},
          "exact": {"ls": "", "marker": ".", "ms": 4, "color": "0.35"},
          "points": {"ls": "", "marker": ".", "ms": 2}}
COLUMNS = 3


def names(result: Result) -> list[str]:
    """File names of a case's pictures."""
    kinds = (("orders", result.outcome.studies), ("profiles", result.outcome.profiles))
    return [f"{result.id}-{kind}.svg" for kind, parts in kinds if parts]


def draw(result: Result, folder: Path) -> None:
    """Draw all of them."""
    from matplotlib import pyplot
    with np.errstate(all="ignore"):
        for name in names(result):
            parts = result.outcome.studies if name.endswith("orders.svg") else result.outcome.profiles
            figure, axes = _panels(pyplot, len(parts))
            for axis, part in zip(axes, parts):
                (_study if name.endswith("orders.svg") else _profile)(axis, part)
            figure.savefig(folder / name)
            pyplot.close(figure)


def _panels(pyplot, count: int):
    """A figure with ``count`` axes; the rest of the grid hidden."""
    columns = min(COLUMNS, count)
    rows = -(-count // columns)
    figure, grid = pyplot.subplots(rows, columns, figsize=(3.9 * columns, 3.1 * rows), layout="constrained",
                                   squeeze=False)
    for axis in grid.ravel()[count:]:
        axis.axis("off")
    return figure, grid.ravel()[:count]


def _study(axis, study) -> None:
    axis.loglog(study.sizes, study.errors, "o-", ms=4)
    order = (study.low + study.high) / 2
    x = study.sizes[-1] * np.array([1.0, 1.6])
    y = 0.5 * study.errors[-1] * (x / x[0]) ** order
    axis.loglog([x[0], x[1], x[1], x[0]], [y[0], y[0], y[1], y[0]], "k-", lw=0.8)
    axis.text(x[1] * 1.03, np.sqrt(y[0] * y[1]), f"{order:.3g}", fontsize=8, va="center")
    axis.set_title(study.quantity, fontsize=9)
    axis.set_xlabel("size of element or step", fontsize=8)
    axis.set_ylabel("error", fontsize=8)
    axis.tick_params(labelsize=7, which="both")


def _profile(axis, profile) -> None:
    for name, kind, x, y in profile.curves:
        axis.plot(x, y, label=name, **STYLES[kind])
    axis.set_title(profile.title, fontsize=9)
    axis.set_xlabel(profile.x_label, fontsize=8)
    axis.set_ylabel(profile.y_label, fontsize=8)
    axis.tick_params(labelsize=7)
    axis.legend(fontsize=6)
