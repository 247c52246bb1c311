"""No a priori mass transfer coefficient: Sherwood numbers over time, velocity, supply and shape. Not in the paper."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from paper_figures import style
from verification.claims.base_run import upstream_means
from verification.claims.discussed import RADIUS, in_one_shape, leveque_numbers, sherwood
from verification.claims.levels import CONVERGED, PAIRED, Level, at_level, cached
from verification.claims.runs import BASE, UPDATE, Body, bodies, grown_on_new_mesh

TITLE = "Addition. Mass transfer to the growing aggregate"
RUNS = ()
CLAIMS = ("C39", "C47", "C05")
COMPUTED = CLAIMS

#: Resolution of the computed numbers: that of the preset "fast".
LEVEL = Level(CONVERGED, PAIRED[1])
RUN = BASE
#: Time (h) of the state that section 4 plots.
UNTIL = 19.2
HEADS = 1e-3 * 2.0 ** np.arange(-4, 5)
SUPPLIES = 10.0 ** np.arange(-0.5, 2.51, 0.5)
RADII = np.linspace(5.0, 45.0, 9)
#: Distances upstream of the aggregate (um).
UPSTREAM = np.linspace(0.0, 250.0, 101)
NAMES, COLOURS = ("acceptor", "donor"), (style.BLUE, style.RED)


@style.styled
def draw() -> Figure:
    """Sherwood numbers over time, velocity, supply and radius; and the concentrations upstream of the aggregate."""
    figure = style.figure(4.6)
    panels = figure.subplot_mosaic([["time"] * 3 + ["upstream"] * 3, ["velocity"] * 2 + ["supply"] * 2 + ["shape"] * 2])
    with at_level(LEVEL):
        _over_time(panels["time"])
        _upstream_depletion(panels["upstream"])
        driven = [in_one_shape(head=float(head)) for head in HEADS]
        speeds = [24e-6 * body.solved.flow.mean_velocity for body in driven]
        _panel(panels["velocity"], speeds, driven, "mean velocity (m/d)", True)
        supplied = [in_one_shape(supply=float(supply)) for supply in SUPPLIES]
        _panel(panels["supply"], SUPPLIES, supplied, "supply (K$_s$)", True)
        _panel(panels["shape"], RADII, [in_one_shape(radius=float(radius)) for radius in RADII], "radius (µm)", False)
    for name, axes in panels.items():
        style.grid(axes)
        if name in ("velocity", "supply", "shape"):
            axes.set(ylim=(0, None), title=f"steady half-disc, by {name if name != 'shape' else 'radius'}")
    panels["velocity"].set_ylabel("Sherwood number")
    panels["time"].legend(ncols=2, loc="upper left")
    panels["upstream"].legend()
    style.number_panels(*(panels[name] for name in ("time", "upstream", "velocity", "supply", "shape")))
    return figure


@cached
def bodies_before_end() -> tuple[Body, ...]:
    """The aggregates of the rows up to UNTIL."""
    return tuple(body for body in bodies(RUN) if body.pore.time <= UNTIL + 1e-6)


def _over_time(axes: Axes) -> None:
    hours = [body.pore.time for body in bodies_before_end()]
    computed = [sherwood(body) for body in bodies_before_end()]
    _pairs(axes, hours, computed, [leveque_numbers(body) for body in bodies_before_end()])
    axes.set(title="the growing aggregate of Base", xlabel="time (h)", ylabel="Sherwood number", ylim=(0, 1.1))


def _panel(axes: Axes, x, bodies_at_rest: list[Body], label: str, log: bool) -> None:
    _pairs(axes, x, [sherwood(body) for body in bodies_at_rest], [leveque_numbers(body) for body in bodies_at_rest])
    axes.set(xlabel=label, xscale="log" if log else "linear")


def _pairs(axes: Axes, x, numbers: list[tuple[float, float]], leveque: list[tuple[float, float]]) -> None:
    """Draw the computed numbers of both substrates (full) and those of a textbook (dashed)."""
    for name, colour, computed, textbook in zip(NAMES, COLOURS, np.transpose(numbers), np.transpose(leveque)):
        axes.plot(x, computed, color=colour, label=name)
        axes.plot(x, textbook, "--", color=colour, label=f"{name}, Lévêque")


def _upstream_depletion(axes: Axes) -> None:
    """Concentrations in the state that the paper reports: the shape of UNTIL with the biomass grown in it [E12]."""
    last = bodies_before_end()[-1].pore.time
    state = grown_on_new_mesh(RUN, last)
    means = np.array([upstream_means(*state, float(distance)) for distance in UPSTREAM])
    for name, colour, values in zip(NAMES, COLOURS, means.T):
        axes.plot(UPSTREAM, values, color=colour, label=name)
    axes.axvline(60, color=style.FAINT, linewidth=0.8, linestyle=":")
    axes.plot(60, 7, "o", color=style.BLACK, markersize=4, label="paper: ~7 K$_s$ at 60 µm", linestyle="none")
    axes.set(title=f"concentrations upstream at {last + UPDATE:g} h", xlabel="distance from the aggregate (µm)",
             ylabel="flow-weighted mean (K$_s$)", ylim=(0, 10.3), xlim=(0, UPSTREAM[-1]))


def caption() -> str:
    """Caption, with the first and last numbers of each panel."""
    with at_level(LEVEL):
        first, last = (sherwood(body) for body in (bodies_before_end()[0], bodies_before_end()[-1]))
        leveque, hours = leveque_numbers(bodies_before_end()[-1]), bodies_before_end()[-1].pore.time
        slow, fast = (sherwood(in_one_shape(head=float(head))) for head in (HEADS[0], HEADS[-1]))
        poor, rich = (sherwood(in_one_shape(supply=float(supply))) for supply in (SUPPLIES[0], SUPPLIES[-1]))
    return ("Sherwood numbers (full lines): uptake over interface and over the drop from the supply, times thickness "
            "over diffusivity. Dashed: those of a flat patch of the aggregate's length in the same shear flow "
            f"(Lévêque). (a) Base from 0 to {hours:g} h: acceptor {first[0]:.3g} to {last[0]:.3g}, donor "
            f"{first[1]:.3g} to {last[1]:.3g}; the textbook gives {leveque[0]:.2g} and {leveque[1]:.2g} at the end. "
            "(b) Concentrations upstream of the aggregate, which its uptake lowers, in the shape of "
            f"{hours:g} h with the biomass of {hours + UPDATE:g} h, the state that the paper reports (E12). (c)-(e) "
            f"Steady half-discs, of {RADIUS:g} µm in (c) and (d). The number of the acceptor rises from {slow[0]:.2g} "
            f"to {fast[0]:.2g} with velocity, and goes from {poor[0]:.3g} to {rich[0]:.3g} between supplies of "
            f"{SUPPLIES[0]:.1g} and {SUPPLIES[-1]:.0f} K_s. With the drop from the supply the number depends on shape "
            "and flow more than on the sink; with the drop from the aggregate's edge it depends on the sink (C39).")
