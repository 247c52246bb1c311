"""E8, E15: fields on a new mesh, and the motion of a mesh."""

from __future__ import annotations

import numpy as np

from repro.fem import transfer
from repro.fem.mesh import triangle_areas
from repro.fem.mesher import generate
from repro.fem.outline import half_disc as seed
from repro.fem.sizing import ACROSS_AGGREGATE, Sizing
from repro.model import mesh_motion
from verification.claims.runs import BASE, half_disc, ledger, scene
from verification.errata import LINEAR, erratum, percent, small, table


@erratum(
    "E8", "linear interpolation at a remesh",
    printed="""At a remesh the values at the new nodes are interpolated linearly in the old mesh (3.5), X_A and
        X_I among them.""",
    reading="""That does not conserve mass. The default projects X_A and X_I by Galerkin's method over the
        common pieces of both meshes, which does; `numerics.transfer = "linear"` is the paper's.""",
    consequence="""
        Relative defects of the mass of X_A + X_I, of one step or remesh at its worst and of a whole run:

        {table}

        In base X is X_m nearly everywhere, so that there is nothing to lose. The chain carries exp(-(R - r) /
        l), l = 6 um, in a half-disc of R = 30 um through 40 unrelated meshes of the default size: interpolation
        on chords always errs upwards in a convex field. The projection keeps the mass, but is not bounded by
        the old values: it overshoots the largest by {overshoot} at its worst.""",
    scenes=(BASE, LINEAR))
def transfers() -> dict[str, str]:
    """Mass defects in base and in a chain of remeshes."""
    chains = {"linear": chain("linear"), "conserving": chain("conserving")}
    rows = []
    for name, run in (("linear", LINEAR), ("conserving", BASE)):
        defects, masses = biomass_defects(run), chains[name][0]
        steps, whole = np.diff(masses) / masses[:-1], masses[-1] / masses[0]
        rows.append([name, small(np.abs(defects).max()), small(np.sum(defects)), small(np.abs(steps).max()),
                     percent(whole, 0) if name == "linear" else small(whole - 1)])
    head = ["transfer", "base: worst step", "base: whole run", "chain: worst remesh", "chain: 40 remeshes"]
    return {"table": table(head, rows), "overshoot": f"{100 * (chains['conserving'][1] - 1):.1f} %"}


def biomass_defects(run) -> np.ndarray:
    """Relative defect of the biomass in each step of a run."""
    steps = ledger(*run)
    before, made, after = (steps[f"biomass_{part}_pg_per_m"] for part in ("before", "made", "after"))
    return (after - before - made) / after


#: How the field of :func:`chain` goes to the next mesh.
TRANSFER = {"linear": transfer.interpolated, "conserving": transfer.project}


def chain(how: str, radius: float = 30.0, decay: float = 6.0, count: int = 40) -> tuple[np.ndarray, float]:
    """Masses (count + 1,) of a steep field through a chain of remeshes of one half-disc, and its largest value."""
    outline, field, masses, largest, old = seed(radius, ACROSS_AGGREGATE), None, [], 0.0, ()
    for k in range(count + 1):
        refinement = 1.0 + 0.3 * (0.618 * k % 1)
        grid, _ = generate(outline, (-105.0, 105.0), Sizing(50.0, refinement, 2.0))
        points, triangles = grid.points[grid.body], grid.topology.body_cells
        if field is None:
            field = np.exp((np.linalg.norm(points, axis=1) - radius) / decay)[:, None]
        else:
            field = TRANSFER[how](*old, field, points, triangles)
        old, largest = (points, triangles), max(largest, float(field.max()))
        masses.append(float(triangle_areas(points, triangles) @ field[triangles, 0].mean(axis=1)))
    return np.array(masses), largest


@erratum(
    "E15", "the sign of gamma in (35)",
    printed="""(35): div u - gamma P~ = 0, in the place of (2) in the Stokes flow formulation, whose (1) reads
        lap u - grad P~ = 0.""",
    reading="""div u + gamma P~ = 0. Then -lap u - grad(div u) / gamma = 0, an elastic body that resists
        compression. As printed the second term changes sign: a compression wave then has the stiffness 1 -
        1 / gamma, none at gamma = 1 and a negative one below, and for some values of gamma between 0 and 1 (the
        Cosserat spectrum of the domain) there is no solution at all. (With the opposite sign of grad P~ in the
        momentum equation the print would be right; the paper does not write that equation again.)""",
    consequence="""
        The mesh around a half-disc of R = 10 um in a 50 um pore follows a growth of its radius by 10 %. Largest
        displacement of a fluid node over that of the interface (one is right), and smallest quality of a
        triangle (negative: turned over):

        {table}

        Most values of gamma get by with the printed sign; near a resonance it throws the mesh about.""",
    quick=True)
def compressibility_sign() -> dict[str, str]:
    """Mesh motion with both signs of gamma."""
    grid = half_disc(scene("initial_mesh"), 10.0, 75.0)
    body, rows = 1.1 * grid.points[grid.body], []
    for gamma in (0.1, 0.5, 0.7, 0.8, 0.9, 1.0, 2.0):
        moved = [grid.moved(mesh_motion.move(grid, body, sign * gamma, 100.0)) for sign in (1, -1)]
        farthest = [np.linalg.norm(m.points - grid.points, axis=1).max() for m in moved]
        rows.append([f"{gamma:g}", *(f"{d:.2f}, {m.quality.min():.2f}" for d, m in zip(farthest, moved))])
    return {"table": table(["gamma", "div u + gamma P~ = 0 (ours)", "div u - gamma P~ = 0 (printed)"], rows)}
