"""E2, E10: what the flow's equations leave open at the interface and at the outlet."""

from __future__ import annotations

import numpy as np

from repro.fem.assembly import saddle_system
from repro.fem.mesh import Mesh
from repro.fem.mesher import generate
from repro.fem.outline import BOTTOM, TOP, Outline
from repro.fem.space import Space
from repro.model import flow, pore
from verification.claims.runs import BASE, half_disc, scene
from verification.errata import TRACTION, erratum, percent, state, table


@erratum(
    "E2", "the interface condition of the flow is not stated",
    printed="""(1) is written with the Laplacian of u on both sides of the interface and a viscosity that jumps
        there; nothing is said of what is continuous across it.""",
    reading="""The Galerkin form of (1) makes nu du/dn - phi n continuous ("laplacian", our default). The
        traction of a viscous fluid is continuous if the symmetric gradient takes its place (`numerics.interface
        = "traction"`).""",
    consequence="""
        Head loss of the whole 600 um pore, traction against laplacian, W = 50 um, lambda = 2000, at the default
        mesh and at element sizes divided by two:

        {table}

        Around half-discs the two forms differ by less than the meshes do. A plug is another matter: in the
        laplacian form Poiseuille flow passes through it undisturbed (its loss is the exact {exact} within
        {mesh_error} %); in the traction form the profile changes near both faces, where the water exerts next to
        no shear on the biomass, and every plug loses about the same head less, that of {saved} of plug. Base at
        19.2 h: velocity {velocity} m/d with traction, {deviation} against ours.""",
    scenes=(BASE, TRACTION))
def interface_forms() -> dict[str, str]:
    """Both forms around half-discs and through plugs of the pore's whole width."""
    discs, plugs, width = (0.1, 0.3, 0.5, 0.7, 0.9), (0.25, 0.5, 1.0, 2.0), 50.0
    said = [scene("flow_only", f"numerics.refinement={r}") for r in (1, 2)]
    rows = []
    for part in discs:
        grids = [half_disc(s, part * width, min(10 * part, 1.5) * width) for s in said]
        rows.append([f"half-disc, R / W = {part}", *map(interface_difference, grids)])
    for part in plugs:
        rows.append([f"plug, length / W = {part}", *(interface_difference(plug(s, part * width)) for s in said)])
    fine = plug(said[1], width)
    laplacian, traction = (losses(fine)[form] for form in ("laplacian", "traction"))
    exact = flow.poiseuille_loss(600 + 1999 * width, width)
    saved = (laplacian - traction) / flow.poiseuille_loss(2000.0, width)
    return {"table": table(["", "default mesh", "twice finer"], rows), "exact": "12 nu u_ave (L + 1999 l) / (g W^2)",
            "mesh_error": f"{100 * abs(laplacian / exact - 1):.1f}", "saved": f"{saved:.1f} um",
            "velocity": f"{state(TRACTION)[0]:.3f}", "deviation": percent(state(TRACTION)[0] / state(BASE)[0])}


def losses(grid: Mesh) -> dict[str, float]:
    """Loss (1/um) of the whole pore of 600 um in both forms."""
    rest = flow.poiseuille_loss(600 - float(np.ptp(grid.ends)), grid.width)
    space = Space(grid, 1)
    return {form: flow.unit_flow(space, 2000.0, interface=form).loss + rest for form in ("laplacian", "traction")}


def interface_difference(grid: Mesh) -> str:
    """Traction against laplacian head loss."""
    found = losses(grid)
    return percent(found["traction"] / found["laplacian"])


def plug(said, length: float) -> Mesh:
    """Biomass over the pore's whole width and a length (um), meshed to 1.5 W on both sides."""
    half, width = length / 2, said.pore.width
    points = np.array([[-half, 0.0], [half, 0.0], [half, width], [-half, width]])
    wall = np.repeat([BOTTOM, TOP], 2)
    outline = Outline(points, wall, np.zeros(4, bool), points)
    ends = -half - 1.5 * width, half + 1.5 * width
    return generate(outline, ends, pore.sized(said))[0]


@erratum(
    "E10", "the outlet of the flow",
    printed="(4): du/dx = 0 at the outlet, and the mean of phi over it is zero.",
    reading="""In the laplacian form nu du/dx - phi n = 0 is the natural condition; it makes the mean of phi
        vanish by itself, as the outlet's mean of du_x/dx does (div u = 0, u_y = 0 on the walls). In the
        traction form (E2) the natural condition is another, and Poiseuille flow does not satisfy it: there we
        add u_y = 0 at the outlet.""",
    consequence="""
        A clean channel meshed over 3 W, where Poiseuille flow is the answer; largest |u_y| over u_ave, and the
        head loss of the meshed part against 12 nu u_ave l / (g W^2):

        {table}

        Without u_y = 0 the flow fans out at the outlet, as a jet does that leaves the channel there.""",
    quick=True)
def outlet() -> dict[str, str]:
    """Poiseuille flow in three forms on two meshes."""
    rows = []
    for refinement in (1.0, 2.0):
        said = scene("flow_only", f"numerics.refinement={refinement}")
        grid, _ = generate(None, (-75.0, 75.0), pore.sized(said))
        found = {form: flow.unit_flow(Space(grid, 1), 1.0, interface=form) for form in ("laplacian", "traction")}
        cases = {"laplacian (ours)": (found["laplacian"].velocity, found["laplacian"].loss),
                 "traction, u_y = 0 at the outlet": (found["traction"].velocity, found["traction"].loss),
                 "traction, u_y free at the outlet": free_outlet(grid)}
        exact = flow.poiseuille_loss(150.0, grid.width)
        rows += [[name, f"{refinement:g}", f"{np.abs(u[:, 1]).max():.1g}", percent(loss / exact)]
                 for name, (u, loss) in cases.items()]
    return {"table": table(["form", "refinement", "largest u_y", "head loss"], rows)}


def free_outlet(grid: Mesh) -> tuple[np.ndarray, float]:
    """Velocity and loss of unit flow in a clean channel, traction form, nothing prescribed at the outlet."""
    space, count, topology = Space(grid, 1), len(grid.points), grid.topology
    held = np.zeros((count, 2), bool)
    held[topology.walls] = held[topology.inlet] = True
    viscosity = np.ones(len(grid.triangles))
    elements = flow.stokes(space, viscosity, "traction", flow.Stabilised().mobility(grid, viscosity, "traction"))
    system = saddle_system(space.cells, space.cells, held)
    solution = system.solve(elements, np.zeros(3 * count), flow.prescribed(space))
    ends = [np.trapezoid(solution[2 * count + nodes], grid.points[nodes, 1])
            for nodes in (topology.inlet, topology.outlet)]
    return solution[: 2 * count].reshape(2, -1).T, float(ends[0] - ends[1]) / grid.width
