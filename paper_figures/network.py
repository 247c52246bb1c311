"""The law for networks: the resistance that aggregates add to their pores. Not in the paper."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from paper_figures import style
from repro import added_resistance
from repro.network.resistance import share_range
from verification.network.law import RATIO, SEED, judged, read

TITLE = "Addition. A law for networks: the resistance that an aggregate adds to its pore"
RUNS = ()
CLAIMS = ("C16", "C17", "C44")

#: Viscosity ratios of the curves. The bounds are drawn for the viscosity ratio of the points.
RATIOS = (100.0, RATIO, 10000.0)
COLOURS = (style.SKY, style.BLUE, style.RED)
#: Widths of the lines, so that each is seen where they coincide.
WIDTHS = (3.0, 1.8, 0.8)
POINTS = 300


@style.styled
def draw() -> Figure:
    """The law with the shapes of its fit, and other shapes relative to its bounds."""
    figure = style.figure(3.0)
    law, new = figure.subplots(1, 2, width_ratios=[1.25, 1])
    _law(law)
    _new(new)
    style.number_panels(law, new)
    return figure


def _law(axes: Axes) -> None:
    """r against A / W^2, before contact and after it."""
    for ratio, colour, width in zip(RATIOS, COLOURS, WIDTHS):
        for spanned in (False, True):
            share = np.geomspace(*share_range(spanned), POINTS)
            resistance = added_resistance(share, 1.0, spanned, ratio)
            label = None if spanned else rf"$\lambda$ = {ratio:g}"
            axes.plot(share, resistance.length, color=colour, linestyle="--" if spanned else "-", linewidth=width,
                      label=label, zorder=3)
            if ratio == RATIO:
                axes.fill_between(share, resistance.least, resistance.most, color=colour, alpha=0.2, linewidth=0)
    fitted = read(unseen=False)
    axes.plot(fitted["area_over_width2"], fitted["added_length_over_width"], "o", color=style.FAINT, markersize=4,
              markerfacecolor="none", markeredgewidth=0.5, zorder=2)
    axes.set(xscale="log", yscale="log", xlabel=r"area of the aggregate, $A / W^2$",
             ylabel=r"added length of empty pore, $r$ (of $W$)", title="half-discs (full) and plugs (dashed)")
    axes.legend()


def _new(axes: Axes) -> None:
    """Shapes that are not in the fit, relative to the law (0) and its bounds (1 and -1)."""
    columns = read(unseen=True)
    verdict = judged(columns)
    side = np.sign(verdict.apart) * verdict.beyond
    for grown, label, colour in ((0, "drawn", style.BLUE), (1, "grown", style.RED)):
        selected = columns["grown"] == grown
        axes.plot(columns["area_over_width2"][selected], side[selected], "o", color=colour, markersize=3, label=label)
    for bound in (-1, 1):
        axes.axhline(bound, color=style.FAINT, linewidth=0.8)
    axes.set(xscale="log", xlabel=r"$A / W^2$", ylabel="departure from the law (of its bound)", ylim=(-1.6, 1.6),
             title=f"{verdict.count} shapes that are not in the fit")
    axes.legend(loc="lower left")


def caption() -> str:
    """Caption, with the number of unseen shapes within the law's bounds."""
    fitted, verdict = read(unseen=False), judged(read(unseen=True))
    worst = 100 * np.expm1(np.abs(verdict.apart))
    return (f"(a) The length of empty pore with the resistance that an aggregate adds, against the aggregate's area, "
            f"for half-discs on one wall (full lines) and bodies that span the pore (dashed) at viscosity ratios of "
            f"{RATIOS[0]:g}, {RATIOS[1]:g} and {RATIOS[2]:g}. For {RATIO:g}, the law's bounds and the "
            f"{len(fitted['grown'])} shapes of its fit (grey circles) are shown. The law does not depend on "
            f"velocity and width of the pore. (b) {verdict.count} shapes that are not in the fit, drawn at random "
            f"(seed {SEED}), relative to the "
            f"law (0) and its bounds (1 and -1): {verdict.inside} lie within the bounds. Half of the shapes lie within "
            f"{np.median(worst):.1f} % of the law, and the worst deviates by {worst.max():.0f} %.")
