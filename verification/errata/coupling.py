"""E7, E12, E13, E16: what happens in a step, and what is not printed."""

from __future__ import annotations

import numpy as np

from verification import switches
from verification.claims.runs import BASE, WIDE, at, grown, history, scene, series
from verification.errata import (
    END,
    STATE_HEAD,
    consumed_ratio,
    erratum,
    percent,
    state,
    state_row,
    table,
)
from verification.switches import CHOICES, NUMBERS, PLOTTED, course, explicit, near, restarting_as_j

HALF_STEP = CHOICES["half step"].run


@erratum(
    "E7", "theta and the density drift apart",
    printed="""(28) multiplies theta by 1 + dX / X_m, though after (34) the density is X_m only as well as the
        constraint J = theta holds; at a remesh J is taken from the places of t = 0 that were carried along.""",
    reading="""(28) as printed between remeshes. At a remesh theta restarts as J times the density over X_m, the
        expansion that would bring each triangle back to X_m, so that the error is worked off and does not add
        up. J alone (the paper's, as we understand it) declares the present density to be the right one.""",
    consequence="""
        Largest |X / X_m - 1|, X = X_A + X_I, of any node (wide: in whole hours):

        {table}

        After contact the worst nodes are at the contact lines, where biomass, water and wall meet and films close: at
        {time} h, when it is worst, the root mean square over the aggregate is {rms}.""")
def density_drift() -> dict[str, str]:
    """Base and wide, theta restarting as J X / X_m or as J, apart before and after contact with the opposite wall."""
    rows = []
    for run in (BASE, WIDE):
        contact, found = series(*run)["contact"], switches.columns(run)
        ours, as_j = found["drift"], near(course(run, restarting_as_j).columns, "drift", found["time"])
        for name, chosen in (("before contact", contact == 0), ("in contact", contact == 1)):
            if chosen.any():
                remeshes = sum(row.remeshes for row, kept in zip(history(*run).instants, chosen) if kept)
                drifts = [f"{100 * drift[chosen].max():.2g} %" for drift in (ours, as_j)]
                rows.append([f"{run[0]}, {name}", remeshes, *drifts])
    worst = int(np.argmax(ours))  # of wide, the last
    return {"table": table(["run", "remeshes", "restart as J X / X_m (ours)", "restart as J"], rows),
            "time": f"{found['time'][worst]:g}",
            "rms": f"{100 * density_rms(scene(*WIDE), history(*WIDE).instants[worst].pore):.1f} %"}


def density_rms(said, now) -> float:
    """Root of the mean square of X / X_m - 1 over the aggregate."""
    weights = now.space.reaction.dx
    density = (now.active + now.inert) / weights / said.kinetics.maximum_density
    return float(np.sqrt(np.average((density - 1) ** 2, weights=weights)))


@erratum(
    "E12", "which state is that of 19.4 h",
    printed="""Section 4 gives values at 19.4 h, and plots (Plate 1) biomass "before the aggregate expands".""",
    reading="""At 19.4 h = 97 x 12 min a shape update is due. Before it the shape is still that of 19.2 h, with
        the biomass grown since, and what is printed of effluents, uptake and inlet is that of this state; the
        velocity is that of the shape.""",
    consequence="""
        The paper prints 1.5 m/d, 4.19 and 6.13. Base:

        {table}

        Within that one update the velocity falls by {fall}.""")
def plotted_state() -> dict[str, str]:
    """Base at 19.2 h, and at 19.4 h before and after the expansion."""
    before = [flux.effluent for flux in grown(BASE, PLOTTED)[1].fluxes]
    rows = [["19.2 h", *state(BASE)], ["19.4 h, before the expansion", state(BASE)[0], *before],
            ["19.4 h, after it", *state(BASE, END)]]
    told = [[name, *(f"{value:.3f}" for value in (*values, consumed_ratio(*values[1:])))] for name, *values in rows]
    return {"table": table([*STATE_HEAD, "acceptor / donor consumed"], told),
            "fall": f"{100 * (1 - state(BASE, END)[0] / state(BASE)[0]):.1f} %"}


@erratum(
    "E13", "numbers that are not printed",
    printed="""No value is given for gamma of (35), for the constant of the Stokes stabilisation (3.2), or for
        the size of the elements.""",
    reading="""gamma = 1; tau = h^2 / (100 nu), with nu the element's own viscosity; a tenth of the aggregate's
        thickness, or a fourteenth of the pore's width, as the element size at the interface. All three are
        scene keys.""",
    consequence="""
        Base at 19.2 h, one thing changed at a time:

        {table}

        What the paper says to lie 60 um away from the aggregate is tabulated under E9.""")
def sensitivity() -> dict[str, str]:
    """Base with other stabilisation, mesh compressibility and refinement."""
    rows = [state_row("c = 100, gamma = 1, refinement = 1 (ours)", BASE)]
    rows += [state_row(f"{number.choice} = {number.alternative}", number.run) for number in NUMBERS]
    shown = (BASE, *(number.run for number in NUMBERS))
    nodes = [[*row, f"{at(run, PLOTTED)['nodes']:.0f}"] for row, run in zip(rows, shown)]
    return {"table": table([*STATE_HEAD, "nodes"], nodes)}


@erratum(
    "E16", "one explicit increment agrees with the paper by accident",
    printed="""(28)-(29) take the "total increase" of the biomass during 12 min; section 3.3 integrates (7)-(10)
        with steps of minutes down to seconds.""",
    reading="""(9)-(10) are integrated over the 12 min. A single explicit increment dX = dt F_3 at the rates of
        its beginning, as one may read (28), is another model: the biomass doubles in three to four hours, and
        what is lost in each step is lost for good.""",
    consequence="""
        Deviations are from the integrated model with 12 min:

        {table}

        The explicit increment hits the printed 1.5 m/d at 19.4 h, after the expansion, which is not the state
        that the paper prints (E12), and misses it where it should. With shorter steps the integrated model
        stays where it is.""")
def explicit_increment() -> dict[str, str]:
    """Base with one explicit Euler increment a shape update, against ours with both steps."""
    found = course(BASE, explicit).columns
    keys, rows = ("mean_velocity_m_per_d", "aggregate_area_um2"), []
    for time in (PLOTTED, END):
        ours, half = ([at(run, time)[key] for key in keys] for run in (BASE, HALF_STEP))
        increment = [near(found, name, time) for name in ("velocity", "area")]
        rows += [[f"{time:g} h", "integrated, 12 min (ours)", f"{ours[0]:.3f}", f"{ours[1]:.0f}"]]
        for name, (u, area) in (("integrated, 6 min", half), ("one explicit increment, 12 min", increment)):
            deviations = [percent(value / our, 1) for value, our in zip((u, area), ours)]
            rows += [[f"{time:g} h", name, f"{u:.3f} ({deviations[0]})", f"{area:.0f} ({deviations[1]})"]]
    return {"table": table(["", "", "mean velocity, m/d", "area, um2"], rows)}
