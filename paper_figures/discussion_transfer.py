"""No a priori mass transfer coefficient: Sherwood numbers over time, velocity, supply and shape. Not in the paper."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from paper_figures import style
from verification.claims.base_run import upstream_means
from verification.claims.discussed import RADIUS, in_one_shape, sherwood, textbooks
from verification.claims.levels import CONVERGED, PAIRED, Level, at_level, cached
from verification.claims.runs import BASE, UPDATE, Body, bodies, grown_anew

TITLE = "Addition. Mass transfer to the growing aggregate"
RUNS = ()
CLAIMS = ("C39", "C05")
COMPUTED = CLAIMS

#: How finely is computed here: as with the preset "fast".
LEVEL = Level(CONVERGED, PAIRED[1])
RUN = BASE
#: Until the state that section 4 plots.
UNTIL = 19.2
HEADS = 1e-3 * 2.0 ** np.arange(-4, 5)
SUPPLIES = 10.0 ** np.arange(-0.5, 2.51, 0.5)
RADII = np.linspace(5.0, 45.0, 9)
#: Distances upstream of the aggregate (um).
UPSTREAM = np.linspace(0.0, 250.0, 101)
NAMES, COLOURS = ("acceptor", "donor"), (style.BLUE, style.RED)


@style.styled
def draw() -> Figure:
    """Over time, in one shape by velocity and by supply, by shape; and what the aggregate pulls from upstream."""
    made = style.figure(4.6)
    panels = made.subplot_mosaic([["time"] * 3 + ["pull"] * 3, ["velocity"] * 2 + ["supply"] * 2 + ["shape"] * 2])
    with at_level(LEVEL):
        _over_time(panels["time"])
        _pull(panels["pull"])
        driven = [in_one_shape(head=float(head)) for head in HEADS]
        speeds = [24e-6 * found.solved.flow.mean_velocity for found in driven]
        _panel(panels["velocity"], speeds, driven, "mean velocity (m/d)", True)
        supplied = [in_one_shape(supply=float(each)) for each in SUPPLIES]
        _panel(panels["supply"], SUPPLIES, supplied, "supply (K$_s$)", True)
        _panel(panels["shape"], RADII, [in_one_shape(radius=float(each)) for each in RADII], "radius (µm)", False)
    for name, axes in panels.items():
        style.grid(axes)
        if name in ("velocity", "supply", "shape"):
            axes.set(ylim=(0, None), title=f"half-disc at rest, by {name if name != 'shape' else 'radius'}")
    panels["velocity"].set_ylabel("Sherwood number")
    panels["time"].legend(ncols=2, loc="upper left")
    panels["pull"].legend()
    style.number_panels(*(panels[name] for name in ("time", "pull", "velocity", "supply", "shape")))
    return made


@cached
def early() -> tuple[Body, ...]:
    """The aggregate in each row until UNTIL."""
    return tuple(found for found in bodies(RUN) if found.pore.time <= UNTIL + 1e-6)


def _over_time(axes: Axes) -> None:
    hours = [found.pore.time for found in early()]
    _pairs(axes, hours, [sherwood(found) for found in early()], [textbooks(found) for found in early()])
    axes.set(title="the growing aggregate of Base", xlabel="time (h)", ylabel="Sherwood number", ylim=(0, 1.1))


def _panel(axes: Axes, x, found: list[Body], label: str, log: bool) -> None:
    _pairs(axes, x, [sherwood(each) for each in found], [textbooks(each) for each in found])
    axes.set(xlabel=label, xscale="log" if log else "linear")


def _pairs(axes: Axes, x, numbers: list[tuple[float, float]], given: list[tuple[float, float]]) -> None:
    """Both substrates, and a textbook's numbers dashed."""
    for name, colour, ours, theirs in zip(NAMES, COLOURS, np.transpose(numbers), np.transpose(given)):
        axes.plot(x, ours, color=colour, label=name)
        axes.plot(x, theirs, "--", color=colour, label=f"{name}, Lévêque")


def _pull(axes: Axes) -> None:
    """Of the state that the paper tells of: the shape of UNTIL with what has grown in it since [E12]."""
    last = early()[-1].pore.time
    state = grown_anew(RUN, last)
    means = np.array([upstream_means(*state, float(distance)) for distance in UPSTREAM])
    for name, colour, values in zip(NAMES, COLOURS, means.T):
        axes.plot(UPSTREAM, values, color=colour, label=name)
    axes.axvline(60, color=style.FAINT, linewidth=0.8, linestyle=":")
    axes.plot(60, 7, "o", color=style.BLACK, markersize=4, label="paper: ~7 K$_s$ at 60 µm", linestyle="none")
    axes.set(title=f"the pull upstream at {last + UPDATE:g} h", xlabel="distance from the aggregate (µm)",
             ylabel="flow-weighted mean (K$_s$)", ylim=(0, 10.3), xlim=(0, UPSTREAM[-1]))


def caption() -> str:
    """What is seen, with the numbers at both ends."""
    with at_level(LEVEL):
        first, last = (sherwood(found) for found in (early()[0], early()[-1]))
        given, hours = textbooks(early()[-1]), early()[-1].pore.time
        slow, fast = (sherwood(in_one_shape(head=float(head))) for head in (HEADS[0], HEADS[-1]))
        poor, rich = (sherwood(in_one_shape(supply=float(each))) for each in (SUPPLIES[0], SUPPLIES[-1]))
    return ("Sherwood numbers: uptake over interface and drop from the supply, times thickness over diffusivity "
            "(full), and those of a flat patch as long as the aggregate in the same shear flow (dashed; Lévêque). (a) "
            f"Base from 0 to {hours:g} h: acceptor {first[0]:.3g} to {last[0]:.3g}, donor {first[1]:.3g} to "
            f"{last[1]:.3g}, where the textbook says {given[0]:.2g} and {given[1]:.2g}. (b) Concentrations upstream of "
            f"the aggregate, where its uptake has steepened them, in the shape of {hours:g} h with what has grown by "
            f"{hours + UPDATE:g} h, the state that the paper tells of (E12). (c)-(e) A half-disc at rest, of "
            f"{RADIUS:g} µm in (c) "
            f"and (d): from {slow[0]:.2g} to {fast[0]:.2g} (acceptor) with velocity, but {poor[0]:.3g} to "
            f"{rich[0]:.3g} from a supply of {SUPPLIES[0]:.1g} to one of {SUPPLIES[-1]:.0f} K_s: the number follows "
            "shape and flow, and hardly the sink, while the aggregate is penetrated.")
