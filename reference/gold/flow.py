"""Flow through pores with an aggregate, by NGSolve: conductivities that no code of this project has computed.

    make gold

reads outlines from ``outlines.json`` and writes ``flow.json``. It needs NGSolve (``.ci/gold.lock``) and nothing of this
project. Stokes flow (1)-(5) has fourth-order velocities and third-order pressures, which are continuous in the
fluid and in the biomass alone: the pressure jumps where the viscosity does. Elements are curved and shrink towards the
contact lines. Each outline is solved
on two meshes. The second has elements of half the size and gives the number. The bar is the difference between the two.

The outlines of wide, in its pore and in narrower ones, are those of the preset exact at the times in their names. The
half-discs have 64 arcs. Coordinates are rounded to 1e-6 um.

A number is the length (um) of clean pore that has the loss that the aggregate adds. It does not depend on the pore's
length L: the conductivity is L / (L + added) of that of the clean pore.
"""

import json
import math
from pathlib import Path

import numpy as np
from netgen.occ import BezierCurve, Face, Glue, OCCGeometry, Pnt, Rectangle, Segment, Wire
from ngsolve import (
    H1,
    BilinearForm,
    CoefficientFunction,
    Grad,
    GridFunction,
    InnerProduct,
    Integrate,
    Mesh,
    VectorH1,
    div,
    dx,
    y,
)

FOLDER = Path(__file__).parent
#: Viscosity of the biomass over that of water (Table 1).
RATIO = 2000.0
#: Order of the velocities.
ORDER = 4
#: Length of clean pore before and after the aggregate, over the width.
CLEAN = 2.5
#: Largest elements over the width, in fluid and biomass, and elements at contact lines.
SIZE, AT_LINES = 0.3, 0.0005


def geometry(outline: dict, size: float) -> OCCGeometry:
    """Fluid and biomass around one outline, in the part of the pore that lies around it."""
    x = np.array(outline["points"])[:, 0]
    reach = CLEAN * outline["width"]
    return channel([outline], outline["width"], (x.min() - reach, x.max() + reach), size)


def channel(outlines: list[dict], width: float, ends: tuple[float, float], size: float) -> OCCGeometry:
    """Fluid and biomass between two ends (um). The points where the fluid meets biomass and a wall are contact lines.
    """
    low, high = ends
    fluid = Rectangle(high - low, width).Face().Move((low, 0, 0))
    bodies, lines = [], []
    for number, outline in enumerate(outlines):
        body, own_lines = aggregate(outline)
        body.faces.name = f"biomass{number}"
        fluid = fluid - body
        bodies.append(body)
        lines += own_lines
    fluid.faces.name = "fluid"
    parts = Glue([fluid, *bodies])
    parts.faces.maxh = size * width
    for vertex in parts.vertices:
        if any(math.dist((vertex.p.x, vertex.p.y), line) < 1e-6 * width for line in lines):
            vertex.maxh = AT_LINES * size / SIZE * width
    for edge in parts.edges:
        edge.name = {low: "inlet", high: "outlet"}.get(_at(edge, low, high), "inside")
        if edge.name == "inside" and any(abs(edge.center.y - level) < 1e-9 * width for level in (0.0, width)):
            edge.name = "wall"
    return OCCGeometry(parts, dim=2)


def aggregate(outline: dict) -> tuple[Face, list[np.ndarray]]:
    """The face of an outline, and its contact lines. An edge is a parabola through its start, middle and end; edges on
    a wall are one straight side."""
    points, wall = np.array(outline["points"]), np.array(outline["wall"])
    starts, middles, ends = points[::2], points[1::2], np.roll(points[::2], -1, axis=0)
    on = wall[1::2]
    first = next(k for k in range(len(on)) if on[k] and not on[k - 1])
    order = np.roll(np.arange(len(on)), -first)
    edges, k = [], 0
    while k < len(order):
        last = k
        while on[order[k]] and last + 1 < len(order) and on[order[last + 1]] == on[order[k]]:
            last += 1
        start, middle, end = starts[order[k]], middles[order[k]], ends[order[last]]
        if on[order[k]]:
            edges.append(Segment(_point(start), _point(end)))
        else:
            edges.append(BezierCurve([_point(start), _point(2 * middle - (start + end) / 2), _point(end)]))
        k = last + 1
    return Face(Wire(edges)), [starts[k] for k in range(len(on)) if bool(on[k]) != bool(on[k - 1])]


def _at(edge, low: float, high: float) -> float:
    return next((x for x in (low, high) if abs(edge.center.x - x) < 1e-9 * (high - low)), math.nan)


def _point(place: np.ndarray) -> Pnt:
    return Pnt(float(place[0]), float(place[1]), 0.0)


def added_length(outline: dict, size: float, interface: str, ratio: float = RATIO) -> tuple[float, int]:
    """Length (um) of clean pore with the added loss, and the number of unknowns.

    interface: "laplacian" or "traction", the form of the viscous term (E2).
    """
    width = outline["width"]
    mesh = Mesh(geometry(outline, size).GenerateMesh(maxh=size * width, grading=0.25))
    mesh.Curve(ORDER)
    speed, viscous, unknowns = stokes(mesh, width, interface, ratio)
    loss = Integrate(InnerProduct(viscous, Grad(speed)), mesh) / width
    x = np.array([place[0] for place in outline["points"]])
    length = x.max() - x.min() + 2 * CLEAN * width
    return loss * width**2 / 12 - length, unknowns


def stokes(mesh: Mesh, width: float, interface: str,
           ratio: float) -> tuple[GridFunction, CoefficientFunction, int]:
    """Velocity with the mean 1 um/h, its viscous stress over the water's viscosity, and the number of unknowns."""
    velocity = VectorH1(mesh, order=ORDER, dirichletx="wall|inlet",
                        dirichlety="wall|inlet" + ("|outlet" if interface == "traction" else ""))
    of_fluid, of_biomass = (H1(mesh, order=ORDER - 1, definedon=name) for name in ("fluid", "biomass.*"))
    space = velocity * of_fluid * of_biomass
    (u, p, r), (v, q, s) = space.TnT()
    viscosity = CoefficientFunction([1.0 if name == "fluid" else ratio for name in mesh.GetMaterials()])
    strain = Grad(u) + (Grad(u).trans if interface == "traction" else 0 * Grad(u))
    viscous = viscosity * InnerProduct(strain, Grad(v))
    form = BilinearForm(space, symmetric=True)
    form += viscous * dx
    form += (-p * div(v) - q * div(u)) * dx(definedon="fluid")
    form += (-r * div(v) - s * div(u)) * dx(definedon=mesh.Materials("biomass.*"))
    form.Assemble()
    solution = GridFunction(space)
    solution.components[0].Set(CoefficientFunction((6 * y / width * (1 - y / width), 0)),
                               definedon=mesh.Boundaries("inlet"))
    load = solution.vec.CreateVector()
    load.data = form.mat * solution.vec
    free = space.FreeDofs()
    solution.vec.data -= form.mat.Inverse(free, inverse="umfpack") * load
    speed = solution.components[0]
    strain = Grad(speed) + (Grad(speed).trans if interface == "traction" else 0 * Grad(speed))
    return speed, viscosity * strain, space.ndof


def main() -> None:
    """Write the number and the bar of every outline."""
    outlines = json.loads((FOLDER / "outlines.json").read_text())
    numbers = {}
    for name, outline in outlines.items():
        for interface in ("laplacian", "traction"):
            coarse, _ = added_length(outline, SIZE, interface)
            fine, unknowns = added_length(outline, SIZE / 2, interface)
            numbers[f"{name}, {interface}"] = {"added_um": fine, "bar_um": abs(fine - coarse), "unknowns": unknowns}
            print(name, interface, fine, fine - coarse, unknowns, flush=True)
    (FOLDER / "flow.json").write_text(json.dumps(numbers, indent=1) + "\n")


if __name__ == "__main__":
    main()
