"""E2, E10: choices that the flow's equations leave open; E7, E12, E13, E16, E25: the order of operations in a step, and
parameters that are not printed; E20, E26: contact surfaces."""

import numpy as np

from reference import gold_flow
from repro.fem.assembly import saddle_system
from repro.fem.mesh import Mesh
from repro.fem.mesher import generate_around
from repro.fem.space import Space
from repro.model import flow, meshing
from repro.model.interface import interface_of
from repro.model.resistance import Viscous
from verification import switches
from verification.cases import flow_gold
from verification.cases.flow import FORMS
from verification.claims.levels import COMPARED, CONVERGED, MANY, Level, at_level
from verification.claims.rheology import VARIANTS, WIDE_TO_END, conductivity_change
from verification.claims.runs import (
    BASE,
    CONSTANTS,
    END,
    LAST,
    RECHOSEN,
    WIDE,
    at,
    grown,
    half_disc,
    history,
    load_packaged,
    plug,
    series,
    until,
)
from verification.claims.scheme import PAPER_CORRECTION
from verification.errata import (
    STATE_HEAD,
    Numbers,
    consumed_ratio,
    erratum,
    percent,
    state,
    state_row,
)
from verification.evidence.writing import table
from verification.problems.runs import density
from verification.switches import CHOICES, PLOTTED, changed, course, explicit, near, restarting_as_j

TRACTION = CHOICES["traction"].run


@erratum(
    "E2", "the interface condition of the flow is not stated",
    printed="""(1) is written with the Laplacian of u on both sides of the interface and a viscosity that jumps
        there; the paper does not say what is continuous across it.""",
    reading="""The Galerkin form of (1) makes nu du/dn - phi n continuous ("laplacian", our default). The
        traction of a viscous fluid is continuous if the symmetric gradient takes its place (`numerics.interface
        = "traction"`).""",
    consequence="""
        Head loss of the whole 600 um pore, traction against laplacian, W = 50 um, lambda = 2000, at the default
        mesh and at element sizes divided by two:

        {table}

        Around half-discs the two forms differ by less than the meshes do. Plugs differ by more. In the laplacian
        form Poiseuille flow passes through a plug undisturbed (its loss is the exact
        12 nu u_ave (L + 1999 l) / (g W^2) within {mesh_error} %). In the traction form the profile changes near both
        faces, where the water exerts almost no shear on the biomass. The loss of every plug is smaller by about the
        same amount, the loss of {saved} of plug. Base at 19.2 h: velocity {velocity} m/d with traction, {deviation}
        against ours. The table has the conductivity of wide: in whole runs of the converged solution with each form,
        and the effect of traction on one outline, that of a run in laplacian form, by NGSolve
        (`reference/gold/flow.json`) and by the preset `accurate`:

        {wide}

        NGSolve's numbers are the reference: the package resolves the traction form less well at contact lines. After
        contact this choice matters more than any other choice of the flow.""")
def interface_forms() -> Numbers:
    """Both forms around half-discs and through plugs of the pore's whole width."""
    width, rows = 50.0, []
    scenes = [load_packaged("flow_only", f"numerics.refinement={r}") for r in (1, 2)]
    for share in (0.1, 0.3, 0.5, 0.7, 0.9):
        grids = [half_disc(s, share * width, min(10 * share, 1.5) * width) for s in scenes]
        rows.append([f"half-disc, R / W = {share}", *map(interface_difference, grids)])
    for share in (0.25, 0.5, 1.0, 2.0):
        grids = [plug(s, -share * width / 2, share * width / 2) for s in scenes]
        rows.append([f"plug, length / W = {share}", *map(interface_difference, grids)])
    laplacian, traction = losses(plug(scenes[1], -width / 2, width / 2))
    exact = flow.poiseuille_loss(600 + 1999 * width, width)
    saved = (laplacian - traction) / flow.poiseuille_loss(2000.0, width)
    return {"table": table(["", "default mesh", "twice finer"], rows), "saved": f"{saved:.1f} um",
            "mesh_error": f"{100 * abs(laplacian / exact - 1):.1f}", "velocity": f"{state(TRACTION)[0]:.3f}",
            "deviation": percent(state(TRACTION)[0] / state(BASE)[0]), "wide": table(
                ["wide at", "laplacian (ours), m/d", "traction, m/d", "one outline, NGSolve",
                 "one outline, `accurate`"], _in_wide())}


#: Hours of wide before and after contact, at 34.3 h.
AROUND_CONTACT = (33.0, 35.0, 39.3, 45.0)


def _in_wide() -> list[list[str]]:
    """Conductivity of wide with both forms from the seed on, and the effect on one outline after contact."""
    plain = ("wide", *until(*AROUND_CONTACT))
    rows = []
    with at_level(Level(CONVERGED, COMPARED[0])):
        for hour in AROUND_CONTACT:
            ours, other = (at(run, hour)["conductivity_m_per_d"]
                           for run in (plain, (*plain, 'numerics.interface="traction"')))
            rows.append([f"{hour:g} h", f"{ours:.4g}", f"{other:.4g} ({percent(other / ours)})",
                         *_on_outline(f"wide, {hour:g} h")])
    return rows


def _on_outline(name: str) -> list[str]:
    """Conductivity with traction against laplacian on an outline of `reference/gold_flow.py`, by NGSolve and by the
    preset `accurate`; empty for an outline that it does not have."""
    if name not in gold_flow.outlines():
        return ["", ""]
    laplacian, traction = (sum(flow_gold.added_length(name, "accurate", form)) for form in FORMS)
    return [percent(gold_flow.traction_effect(name)), percent(laplacian / traction)]


def in_forms(grid: Mesh, ratio: float) -> list[flow.UnitFlow]:
    """Unit flow in both forms, laplacian first."""
    return [flow.unit_flow(Space(grid), Viscous(ratio), interface=interface_of(form)) for form in FORMS]


def losses(grid: Mesh) -> list[float]:
    """Loss (1/um) of the whole pore of 600 um in both forms."""
    rest = flow.poiseuille_loss(600 - float(np.ptp(grid.ends)), grid.width)
    return [form.loss + rest for form in in_forms(grid, 2000.0)]


def interface_difference(grid: Mesh) -> str:
    """Traction against laplacian head loss."""
    laplacian, traction = losses(grid)
    return percent(traction / laplacian)


@erratum(
    "E10", "the outlet of the flow",
    printed="(4): du/dx = 0 at the outlet, and the mean of phi over it is zero.",
    reading="""In the laplacian form nu du/dx - phi n = 0 is the natural condition. It makes the mean of phi zero,
        because the mean of du_x/dx over the outlet is zero (div u = 0, u_y = 0 on the walls). Poiseuille flow does
        not satisfy the natural condition of the traction form (E2): there we add u_y = 0 at the outlet.""",
    consequence="""
        A clean channel meshed over 3 W, with the exact solution Poiseuille flow; largest |u_y| over u_ave, and the
        head loss of the meshed part against 12 nu u_ave l / (g W^2):

        {table}

        Without u_y = 0 the flow spreads at the outlet like a jet that leaves the channel.""",
    quick=True, spread=0.2)
def outlet() -> Numbers:
    """Poiseuille flow in three forms on two meshes."""
    rows = []
    for refinement in (1.0, 2.0):
        scene = load_packaged("flow_only", f"numerics.refinement={refinement}")
        grid, _ = generate_around([], (-75.0, 75.0), meshing.sized(scene))
        laplacian, traction = in_forms(grid, 1.0)
        cases = {"laplacian (ours)": (laplacian.velocity, laplacian.loss),
                 "traction, u_y = 0 at the outlet": (traction.velocity, traction.loss),
                 "traction, u_y free at the outlet": free_outlet(grid)}
        exact = flow.poiseuille_loss(150.0, grid.width)
        rows += [[name, f"{refinement:g}", f"{np.abs(u[:, 1]).max():.1g}", percent(loss / exact)]
                 for name, (u, loss) in cases.items()]
    return {"table": table(["form", "refinement", "largest u_y", "head loss"], rows)}


def free_outlet(grid: Mesh) -> tuple[np.ndarray, float]:
    """Velocity and loss of unit flow in a clean channel, traction form, nothing prescribed at the outlet."""
    space, count = Space(grid), len(grid.points)
    topology = grid.topology
    constrained = np.zeros((count, 2), bool)
    constrained[topology.walls] = constrained[topology.inlet] = True
    viscosity = np.ones(len(grid.triangles))
    pair = flow.Linear.on(space, viscosity)
    elements = flow.stokes(space, viscosity, interface_of("traction"), pair.lower)
    system = saddle_system(space.cells, space.cells, constrained)
    value = np.append(pair.prescribed(), np.zeros(count))
    solution = system.solve(elements, np.zeros(3 * count), value)
    ends = [np.trapezoid(solution[2 * count + nodes], grid.points[nodes, 1])
            for nodes in (topology.inlet, topology.outlet)]
    return solution[: 2 * count].reshape(2, -1).T, float(ends[0] - ends[1]) / grid.width


HALF_STEP = switches.changed('growth.time_step="6 min"')


@erratum(
    "E7", "theta and the density drift apart",
    printed="""(28) multiplies theta by 1 + dX / X_m, although after (34) the density is X_m only to the accuracy of
        the constraint J = theta. At a remesh J follows from the transferred positions at t = 0.""",
    reading="""(28) as printed between remeshes. At a remesh theta restarts as J times the density over X_m, the
        expansion that returns each triangle to X_m. Errors then do not accumulate. The paper seems to restart from J
        alone, which treats the present density as exact. The curved presets interpolate theta instead if strain counts
        from t = 0, because J is rough beside contact lines.""",
    consequence="""
        Largest |X / X_m - 1|, X = X_A + X_I, of any node (wide: in whole hours):

        {table}

        After contact the largest deviations are at the contact lines, where biomass, water and wall meet and films
        close. At {time} h, the worst hour, the root mean square over the aggregate is {rms}.""")
def density_drift() -> Numbers:
    """Drift of the density in base and wide if theta restarts as J X / X_m or as J. The rows of wide are split at
    contact with the opposite wall."""
    rows = []
    for run in (BASE, WIDE):
        contact = series(*run)["contact"]
        columns_of_run = switches.run_columns(run)
        default = columns_of_run["drift"]
        as_j = near(course(run, restarting_as_j).columns, "drift", columns_of_run["time"])
        for name, chosen in (("before contact", contact == 0), ("in contact", contact == 1)):
            if chosen.any():
                remeshes = sum(row.remeshes for row, is_chosen in zip(history(*run).instants, chosen) if is_chosen)
                drifts = [f"{100 * drift[chosen].max():.2g} %" for drift in (default, as_j)]
                rows.append([f"{run[0]}, {name}", remeshes, *drifts])
    worst = int(np.argmax(default))  # of wide, the last
    return {"table": table(["run", "remeshes", "restart as J X / X_m (ours)", "restart as J"], rows),
            "time": f"{columns_of_run['time'][worst]:g}",
            "rms": f"{100 * density_rms(load_packaged(*WIDE), history(*WIDE).instants[worst].pore):.1f} %"}


def density_rms(scene, pore) -> float:
    """Root of the mean square of X / X_m - 1 over the aggregate."""
    return float(np.sqrt(np.average((density(scene, pore) - 1) ** 2, weights=pore.space.reaction.dx)))


@erratum(
    "E12", "which state is that of 19.4 h",
    printed="""Section 4 gives values at 19.4 h, and plots (Plate 1) biomass "before the aggregate expands".""",
    reading="""At 19.4 h = 97 x 12 min a shape update is due. Before it the shape is still that of 19.2 h, with
        the biomass that has grown since. The velocity is that of the shape. It is not certain whether the printed
        effluents belong to the biomass of 19.2 h or to that of 19.4 h. Raised by the paper's own 1.6 % (E18), they are
        near those of 19.2 h.""",
    consequence="""
        The paper prints 1.5 m/d, 4.19 and 6.13, and 210 um. Base in the converged solution, with the difference of the
        effluents from the printed ones and from those raised by 1.6 %, 4.257 and 6.228:

        {table}

        In this update the velocity falls by {fall}. The best evidence: around the shape of 19.2 h, rule 3.1 gives
        {plotted} um (C08; printed: 210); around that of 19.4 h, {last}.""")
def plotted_state() -> Numbers:
    """Base at 19.2 h, and at 19.4 h before and after the expansion."""
    with at_level(Level(CONVERGED, 2**-0.5)):
        before = [flux.effluent for flux in grown(BASE, PLOTTED)[1].fluxes]
        rows = [["19.2 h", *state(BASE)], ["19.4 h, before the expansion", state(BASE)[0], *before],
                ["19.4 h, after it", *state(BASE, END)]]
        spans = [at(BASE, time)["downstream_um"] - at(BASE, time)["upstream_um"] for time in (PLOTTED, END)]
    printed = np.array([4.19, 6.13])
    formatted = [[name, f"{velocity:.3f}", *map("{:.3f}".format, effluents),
                  *(" and ".join(percent(value, 1) for value in effluents / (factor * printed))
                    for factor in (1.0, PAPER_CORRECTION)), f"{consumed_ratio(*effluents):.3f}"]
                 for name, velocity, *effluents in rows]
    head = [*STATE_HEAD, "from the printed ones", "from those raised", "acceptor / donor consumed"]
    return {"table": table(head, formatted), "fall": f"{100 * (1 - rows[2][1] / rows[0][1]):.1f} %",
            **{name: f"{span + 3 * 50:.1f}" for name, span in zip(("plotted", "last"), spans)}}


@erratum(
    "E13", "numbers that are not printed",
    printed="""No value is given for gamma of (35), for the constant of the Stokes stabilisation (3.2), or for
        the size of the elements.""",
    reading="""gamma = 1; tau = h^2 / (100 nu), with nu the element's own viscosity. The element size at the interface
        is a tenth of the aggregate's thickness, or a fourteenth of the pore's width, divided by
        `numerics.refinement`.""",
    consequence="""
        Base at 19.2 h, with one parameter changed at a time:

        {table}

        E9 lists the concentrations 60 um from the aggregate.""")
def sensitivity() -> Numbers:
    """Base with other stabilisation, mesh compressibility and refinement."""
    runs = {"c = 100, gamma = 1, refinement = 1 (ours)": BASE,
             **{change: changed(change) for change in CONSTANTS},
             **{f"refinement = {value}": changed(f"numerics.refinement={value}") for value in (0.7, 1.4)}}
    nodes = [[*state_row(name, run), f"{at(run, PLOTTED)['nodes']:.0f}"] for name, run in runs.items()]
    return {"table": table([*STATE_HEAD, "nodes"], nodes)}


@erratum(
    "E16", "one explicit increment agrees with the paper by accident",
    printed="""(28)-(29) take the "total increase" of the biomass during 12 min; section 3.3 integrates (7)-(10)
        with steps of minutes down to seconds.""",
    reading="""(9)-(10) are integrated over the 12 min. (28) may also mean one explicit increment dX = dt F_3 at the
        rates of the start. That is another model: the biomass doubles in three to four hours, and each step makes
        too little of it.""",
    consequence="""
        Deviations are from the integrated model with 12 min:

        {table}

        The explicit increment gives the printed 1.5 m/d at 19.4 h after the expansion. But the paper prints another
        state (E12), in which the increment gives another velocity. Its effluents agree neither with the printed 4.19
        and 6.13 nor with 4.257 and 6.228, in either state. The integrated model hardly changes with shorter steps.""")
def explicit_increment() -> Numbers:
    """Base with one explicit Euler increment a shape update, against ours with both steps."""
    compared = switches.run_columns(BASE), switches.run_columns(HALF_STEP), course(BASE, explicit).columns
    rows = []
    for time in (PLOTTED, END):
        integrated, half, increment = ([near(columns, name, time) for name in ("velocity", "area", "acceptor", "donor")]
                                       for columns in compared)
        rows.append([f"{time:g} h", "integrated, 12 min (ours)", f"{integrated[0]:.3f}", f"{integrated[1]:.0f}",
                     *map("{:.3f}".format, integrated[2:])])
        for name, values in (("integrated, 6 min", half), ("one explicit increment, 12 min", increment)):
            changes = [percent(value / ours, 1) for value, ours in zip(values, integrated)]
            rows.append([f"{time:g} h", name, f"{values[0]:.3f} ({changes[0]})", f"{values[1]:.0f} ({changes[1]})",
                         *(f"{value:.3f} ({change})" for value, change in zip(values[2:], changes[2:]))])
    return {"table": table(["", "", "mean velocity, m/d", "area, um2", "acceptor effluent", "donor effluent"], rows)}


RECHOSEN_RUNS = {BASE: (*BASE, RECHOSEN, LAST), WIDE: (*WIDE, RECHOSEN)}
COLUMNS = {"mean_velocity_m_per_d": "mean velocity, m/d", "conductivity_m_per_d": "conductivity, m/d",
           "upstream_um": "upstream, um", "downstream_um": "downstream, um", "aggregate_area_um2": "area, um2"}


@erratum(
    "E20", "which point of a contact surface stays",
    printed="""2.3.3 keeps the middle point of each contact surface fixed, and does not say whether this point stays
        the same material as the surface grows.""",
    reading="""The fixed point is the material point in the middle when the surface first forms (the origin, on the
        lower wall). It does not change. The alternative, rechosen, takes the node nearest to the present middle at
        every update.""",
    consequence="Rechosen against kept, where growth is nearly symmetric and where it is not:\n\n{table}")
def fixed_point() -> Numbers:
    """Base at 19.2 h and wide at 45 h with both choices."""
    rows = []
    for run, time in ((BASE, PLOTTED), (WIDE, 45.0)):
        fixed, rechosen = at(run, time), at(RECHOSEN_RUNS[run], time)
        rows.append([f"{run[0]}, {time:g} h, kept (ours)", *(f"{fixed[key]:.4g}" for key in COLUMNS)])
        moved = (f"{rechosen[key]:.4g} ({percent(rechosen[key] / fixed[key], 1)})" for key in COLUMNS)
        rows.append([f"{run[0]}, {time:g} h, rechosen", *moved])
    return {"table": table(["", *COLUMNS.values()], rows)}


@erratum(
    "E25", "when a new mesh is needed",
    printed="""A new mesh if the quality is under 0.6 in more than six triangles (3.5), and if the aggregate comes too
        close to an end of the mesh (3.1).""",
    reading="""Both, and two more: if the contact of the aggregate with a wall changes, because nodes that join the
        wall divide triangles, and if an edge of the interface is more than twice as long as in a new mesh, because the
        growing aggregate would otherwise keep the edges of the seed.""",
    consequence="""
        Updates with a new mesh: {base} of {base_updates} in base, {before} of {before_updates} in wide before contact,
        and {after} of {after_updates} after it, when each update moves a contact line.""")
def new_meshes() -> Numbers:
    """Count the updates with a new mesh in base and wide."""
    numbers = {}
    for name, run, contact in (("base", BASE, 0), ("before", WIDE, 0), ("after", WIDE, 1)):
        rows = [instant for instant, touches in zip(history(*run).instants, series(*run)["contact"])
                if touches == contact]
        numbers |= {name: str(sum(row.remeshes for row in rows)),
                    f"{name}_updates": str(sum(len(row.ledgers) for row in rows))}
    return numbers


@erratum(
    "E26", "how the least angle and the least film are enforced",
    printed="""The minimum tangent of contact is "arbitrarily set to 0.3", and contact is enforced where the film is
        thinner than 2 um (2.3.3). The paper does not say how the shape changes to satisfy both.""",
    reading="""Nodes of the free surface join the wall, from the contact line on, until the rest of the surface has at
        least this angle and this film. No node is moved back, and the water between nodes and wall leaves. With linear
        triangles
        entire
        edges join, with curved ones parts of an edge.""",
    consequence="""
        The rule decides how much of the narrow wedges beside a contact is filled. Conductivity of wide in the converged
        solution with other values, against ours:

        {table}

        The film decides when contact occurs, and little after it.""")
def joining() -> Numbers:
    """Wide with film and angle halved and doubled: conductivity after contact."""
    rows = []
    with at_level(Level(CONVERGED, MANY[0])):
        for name in ("film halved", "film doubled", "angle halved", "angle doubled"):
            run = (*WIDE_TO_END, VARIANTS[name])
            rows.append([name, *(f"{conductivity_change(run, (hour,)):+.1f} %" for hour in (35.0, 39.0, 45.0))])
    return {"table": table(["", "35 h", "39 h", "45 h"], rows)}
