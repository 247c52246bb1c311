"""C23, C24: what reprojection keeps, and what becomes of the mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from repro.fem.mesh import POOR, POOR_ALLOWED
from repro.march import updates
from repro.model import biomass, contact, remeshing
from repro.model.pore import Pore
from verification.claims import OF_SCHEME, Finding, at_least, at_most, claim, without_limit
from verification.claims.levels import ALONE
from verification.claims.restored import bodies, solved_pore
from verification.claims.runs import BASE, ledger, nearest, scene, series

INSTANTS = (0.0, 5.0, 10.0, 15.0, 19.2)


@claim("C23", "3.4", "reprojection conserves each node's mass locally, and the total",
       about=OF_SCHEME)
def reprojection_conserves() -> Finding:
    """(34) in five updates of base: the mass of every node before and after; the total over every update of the run."""
    book = ledger(*BASE)
    before, made, after = (book[f"biomass_{part}_pg_per_m"] for part in ("before", "made", "after"))
    checks = (at_most("mass of a node: largest relative change", "conserved",
                      max(node_defect(nearest(BASE, time)) for time in INSTANTS), 1e-12, "(33) is exact; round-off"),
              at_most("total: largest relative defect of an update", "conserved",
                      np.abs((after - before - made) / after).max(), 1e-10, "set beforehand; remeshes are in it"))
    return Finding(checks, note=_kept)


def _kept() -> str:
    """Densities, and what the paper's transfer would do, in words."""
    rows = series(*BASE)
    return (f"The density over X_m stays between {rows['biomass_density_min'].min():.5f} and "
            f"{rows['biomass_density_max'].max():.5f} [E7]. The paper's linear interpolation would change the total by "
            f"{100 * linear_defect(15.0):+.2g} % at a remesh at 15 h [E8]; the default does not.")


def node_defect(time: float) -> float:
    """Largest relative change of a node's mass of X_A or X_I in the update of base that starts at a time (h)."""
    said, (now, solved) = scene(*BASE), solved_pore(BASE, time)
    made, _, _ = updates.make_biomass(said, now, solved, said.growth.time_step)
    expanded, *_ = contact.expand(said, made, updates.enlarged(said, now, made))
    pairs = zip(node_masses(made), node_masses(expanded))
    return max(float(np.abs(after / before - 1).max()) for before, after in pairs)


def node_masses(now: Pore) -> tuple[np.ndarray, np.ndarray]:
    """X_A and X_I of the aggregate's nodes, times the areas around them: um2 mg/L."""
    area = now.space.lumped(now.mesh.biomass)[now.mesh.body]
    return tuple(area * biomass.at_nodes(now.space, mass / now.space.reaction.dx)[now.mesh.body]
                 for mass in (now.active, now.inert))


def linear_defect(time: float) -> float:
    """Relative change of the total at a remesh of base with the paper's linear transfer."""
    now, solved = solved_pore(BASE, time)
    new, _ = remeshing.remesh(scene(*BASE, 'numerics.transfer="linear"'), now, now, solved.flow.mean_velocity)
    return new.mass / now.mass - 1


@dataclass(frozen=True)
class Quality:
    """Meshes of some rows of a run.

    least: smallest quality; poor: most triangles under 0.6; fall: largest fall of the smallest quality in an update
    without a remesh; remeshes: their number; between: fewest updates between two of them.
    """

    least: float
    poor: int
    fall: float
    remeshes: int
    between: int


@claim("C24", "3.5", "the mesh degrades gradually; the remesh criterion keeps it acceptable", about=OF_SCHEME,
       steps=ALONE, fixed="it is counted in updates of 12 min, and what an update does is asked")
def mesh_quality() -> Finding:
    """Quality of every mesh of base, its fall in an update, and the updates between remeshes.

    Of base alone: the paper says it of its mesher, and after contact a growing contact surface asks for a new mesh in
    every update, whose quality is our mesher's.
    """
    found, kept = quality(BASE), "the paper's criterion: not more than six"
    checks = (at_most("base: largest fall of the least quality in an update", "gradually", found.fall, 0.05,
                      "twice the strain of an update, 2.4 %: what a triangle can lose"),
              at_least("base: fewest updates between remeshes", "gradually", found.between, 5, "many updates, not one"),
              at_most("base: most triangles under 0.6", "6", found.poor, POOR_ALLOWED, kept),
              at_least("base: least quality", "acceptable", found.least, 1e-3, "no triangle is turned over, or flat"))
    return Finding(tuple(map(without_limit, checks)), reason="not on every mesh",
                   note=f"{found.remeshes} remeshes, at least {found.between} updates apart, least quality "
                   f"{found.least:.2f}.")


def quality(run: tuple[str, ...]) -> Quality:
    """Of the rows of a run that has one a shape update."""
    meshes = [found.grid for found in bodies(run)]
    least, new = np.array([grid.quality.min() for grid in meshes]), series(*run)["remeshed"]
    return Quality(float(least.min()), max(int(np.count_nonzero(grid.quality < POOR)) for grid in meshes),
                   float(-np.diff(least)[new[1:] == 0].min(initial=0.0)), int(new.sum()),
                   int(np.diff(np.flatnonzero(new)).min()))
