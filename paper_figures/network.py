"""The law for networks: what aggregates add to the resistance of their pores. Not in the paper."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from paper_figures import style
from repro import added_resistance
from repro.results.network import known
from verification.network.law import RATIO, SEED, judged, read

TITLE = "Addition. A law for networks: the resistance that an aggregate adds to its pore"
RUNS = ()
CLAIMS = ("C16", "C17", "C44")

#: Viscosity ratios of the curves; the one of the points has the bounds drawn.
RATIOS = (100.0, RATIO, 10000.0)
COLOURS = (style.SKY, style.BLUE, style.RED)
POINTS = 300


@style.styled
def draw() -> Figure:
    """The law with the shapes of its fit, and shapes that the fit has not seen against its bounds."""
    made = style.figure(3.0)
    law, new = made.subplots(1, 2, width_ratios=[1.25, 1])
    _law(law)
    _new(new)
    style.number_panels(law, new)
    return made


def _law(axes: Axes) -> None:
    """r against A / W^2, before contact and after it."""
    for ratio, colour in zip(RATIOS, COLOURS):
        for spanned in (False, True):
            share = np.geomspace(*known(spanned), POINTS)
            found = added_resistance(share, 1.0, spanned, ratio)
            label = None if spanned else rf"$\lambda$ = {ratio:g}"
            axes.plot(share, found.length, color=colour, linestyle="--" if spanned else "-", label=label)
            if ratio == RATIO:
                axes.fill_between(share, found.least, found.most, color=colour, alpha=0.2, linewidth=0)
    seen = read(unseen=False)
    axes.plot(seen["area_over_width2"], seen["added_length_over_width"], ".", color=style.BLACK, markersize=1.5)
    axes.set(xscale="log", yscale="log", xlabel=r"area of the aggregate, $A / W^2$",
             ylabel=r"added length of empty pore, $r$ (of $W$)", title="half-discs (full) and plugs (dashed)")
    axes.legend()


def _new(axes: Axes) -> None:
    """Shapes that the fit has not seen: where they lie between the law, 0, and its bounds, 1 and -1."""
    columns = read(unseen=True)
    found = judged(columns)
    side = np.sign(found.apart) * found.beyond
    for grown, label, colour in ((0, "drawn", style.BLUE), (1, "grown", style.RED)):
        chosen = columns["grown"] == grown
        axes.plot(columns["area_over_width2"][chosen], side[chosen], "o", color=colour, markersize=3, label=label)
    for bound in (-1, 1):
        axes.axhline(bound, color=style.FAINT, linewidth=0.8)
    axes.set(xscale="log", xlabel=r"$A / W^2$", ylabel="departure from the law (of its bound)", ylim=(-1.6, 1.6),
             title=f"{found.count} shapes that the fit has not seen")
    axes.legend(loc="lower left")


def caption() -> str:
    """What is seen, and how many of the unseen shapes the law's bounds hold."""
    seen, found = read(unseen=False), judged(read(unseen=True))
    worst = 100 * np.expm1(np.abs(found.apart))
    return (f"(a) The length of empty pore that resists as much as an aggregate adds, against its area: half-discs on "
            f"one wall (full lines) and bodies that span the pore (dashed), for viscosity ratios of {RATIOS[0]:g}, "
            f"{RATIOS[1]:g} and {RATIOS[2]:g}, with the law's bounds and the {len(seen['grown'])} shapes of its fit at "
            f"{RATIO:g}. Velocity and width of the pore drop out. (b) {found.count} shapes that the fit has not seen, "
            f"drawn at random (seed {SEED}), between the law (0) and its bounds (1 and -1): {found.inside} are "
            f"within, half of them within {np.median(worst):.1f} % of the law, the worst {worst.max():.0f} % from it.")
