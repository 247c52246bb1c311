"""Two aggregates in one pore: flow and substrates by NGSolve, without any code of this project.

    make gold

writes ``pair.json``: for each scene the length of clean pore with the loss that both aggregates add, the effluents, and
the uptake of each aggregate. It needs NGSolve (``.ci/gold.lock``) and nothing of this project.

The pore is meshed from end to end. Velocity and pressure are those of ``flow.py``. Both concentrations have
fourth-order elements and are continuous. They solve (7)-(8) in the velocity that the head drives, with (11) at the
inlet, where the local velocity carries the supply [E4], and (12) at the outlet. Constants are those of Table 1, with
the demand of decay of [E3]. The bar of a number is the difference between two meshes.
"""

import json
import math
from pathlib import Path

from ngsolve import (
    H1,
    BilinearForm,
    CoefficientFunction,
    Grad,
    GridFunction,
    InnerProduct,
    Integrate,
    Mesh,
    ds,
    dx,
    grad,
)

from reference.gold.flow import ORDER, RATIO, SIZE, channel, stokes

FOLDER = Path(__file__).parent
#: Width, length and head (um), and g / nu (1/(um h)).
WIDTH, LENGTH, HEAD = 50.0, 600.0, 10.0
GRAVITY_OVER_VISCOSITY = 9.81e6 / (0.01003e8) * 3600.0
#: k, b (1/h), F, d_c f_d, X_m (mg/L), K_s and supply (mg/L).
RATE, DECAY, FACTOR, DEMAND, DENSITY, HALF, SUPPLY = 9.3 / 24, 0.12 / 24, 1.52, 1.42 * 0.8, 3e4, 1.0, 10.0
#: D in water and in biomass (um2/h), of the acceptor and of the donor.
DIFFUSIVITIES = tuple(tuple(x * 1e8 / 24 for x in pair) for pair in ((2.32, 1.85), (1.01, 0.81)))
#: Half-discs: radius and x (um), and whether the lower wall has them.
SCENES = {
    "on opposite walls": ((15.0, -30.0, True), (12.0, 25.0, False)),
    "facing": ((20.0, 0.0, True), (18.0, 6.0, False)),
    "on one wall": ((18.0, -40.0, True), (24.0, 20.0, True))}
#: Arcs of a half-disc.
ARCS = 64


def half_disc(radius: float, x: float, lower: bool) -> dict:
    """Outline of a half-disc. Middles of its parabolas lie on the circle."""
    sign, level = (1.0, 0.0) if lower else (-1.0, WIDTH)
    points, wall = [], []
    for k in range(2 * ARCS):
        angle = math.pi * k / (2 * ARCS)
        points.append([x + radius * sign * math.cos(angle), level + radius * sign * math.sin(angle)])
        wall.append(0 if k else 1)
    return {"points": [*points, [x - radius * sign, level], [x, level]], "wall": [*wall, 1, 1], "width": WIDTH}


def numbers(discs: tuple, size: float) -> dict[str, float]:
    """The numbers of one scene."""
    geometry = channel([half_disc(*disc) for disc in discs], WIDTH, (-LENGTH / 2, LENGTH / 2), size)
    mesh = Mesh(geometry.GenerateMesh(maxh=size * WIDTH, grading=0.25))
    mesh.Curve(ORDER)
    velocity, viscous, _ = stokes(mesh, WIDTH, "laplacian", RATIO)
    whole = Integrate(InnerProduct(viscous, Grad(velocity)), mesh) / WIDTH * WIDTH**2 / 12
    speed = HEAD * GRAVITY_OVER_VISCOSITY / (12 / WIDTH**2 * whole)
    both = transported(mesh, speed * velocity)
    through = Integrate(velocity[0], mesh, definedon=mesh.Boundaries("outlet"))
    found = {"added_um": whole - LENGTH}
    for name, field in zip(("acceptor", "donor"), both.components):
        leaves = Integrate(velocity[0] * field, mesh, definedon=mesh.Boundaries("outlet"))
        found[f"effluent_{name}_mg_per_L"] = leaves / through
    for k in range(len(discs)):
        for name, uptake in zip(("acceptor", "donor"), taken_up(*both.components)):
            found[f"uptake_{name}_{k + 1}_um2_mg_per_L_h"] = Integrate(uptake, mesh,
                                                                      definedon=mesh.Materials(f"biomass{k}"))
    return found


def taken_up(acceptor, donor) -> tuple:
    """q_A X and q_D X in biomass, mg/L/h."""
    first, second = acceptor / (acceptor + HALF), donor / (donor + HALF)
    return (DENSITY * first * (RATE * FACTOR * second + DEMAND * DECAY), DENSITY * RATE * first * second)


def transported(mesh: Mesh, velocity: CoefficientFunction) -> GridFunction:
    """Both concentrations (mg/L) at rest, by Newton's method."""
    space = H1(mesh, order=ORDER) * H1(mesh, order=ORDER)
    trials, tests = space.TnT()
    form = BilinearForm(space)
    for c, v, pair in zip(trials, tests, DIFFUSIVITIES):
        diffusivity = CoefficientFunction([pair[name != "fluid"] for name in mesh.GetMaterials()])
        form += (diffusivity * InnerProduct(grad(c), grad(v)) + InnerProduct(velocity, grad(c)) * v) * dx
        form += velocity[0] * (c - SUPPLY) * v * ds("inlet")
    for uptake, v in zip(taken_up(*trials), tests):
        form += uptake * v * dx(definedon=mesh.Materials("biomass.*"))
    solution = GridFunction(space)
    for component in solution.components:
        component.Set(SUPPLY)
    defect, change = solution.vec.CreateVector(), solution.vec.CreateVector()
    for _ in range(30):
        form.Apply(solution.vec, defect)
        form.AssembleLinearization(solution.vec)
        change.data = form.mat.Inverse(space.FreeDofs(), inverse="umfpack") * defect
        solution.vec.data -= change
        if change.Norm() < 1e-11 * solution.vec.Norm():
            return solution
    raise RuntimeError("Newton's method did not converge")


def main() -> None:
    """Write the numbers and bars of every scene."""
    scenes = {}
    for name, discs in SCENES.items():
        coarse, fine = (numbers(discs, size) for size in (SIZE, SIZE / 2))
        values = {key: {"value": fine[key], "bar": abs(fine[key] - coarse[key])} for key in fine}
        scenes[name] = {"half_discs": [dict(zip(("radius_um", "x_um", "lower"), disc)) for disc in discs],
                        "numbers": values}
        print(name, {key: (each["value"], each["bar"]) for key, each in values.items()}, flush=True)
    (FOLDER / "pair.json").write_text(json.dumps(scenes, indent=1) + "\n")


if __name__ == "__main__":
    main()
