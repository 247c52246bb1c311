"""C23, C24: what reprojection keeps, and what becomes of the mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from repro.fem.mesh import POOR, POOR_ALLOWED
from repro.march import updates
from repro.model import biomass, contact, remeshing
from repro.model.pore import Pore
from repro.results import read_table
from verification.claims import Finding, at_least, at_most, claim, without_limit
from verification.claims.levels import ALONE, WIDE_SIZES
from verification.claims.restored import bodies, solved_pore
from verification.claims.runs import BASE, WIDE, folder, nearest, scene, series

INSTANTS = (0.0, 5.0, 10.0, 15.0, 19.2)


@claim("C23", "3.4", "reprojection conserves each node's mass locally, and the total",
       "python -m verification.claims C23", (BASE,))
def reprojection_conserves() -> Finding:
    """(34) in five updates of base: the mass of every node before and after; the total over every update of the run."""
    book = read_table(folder(*BASE) / "ledger.csv")
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


@claim("C24", "3.5", "the mesh degrades gradually; the remesh criterion keeps it acceptable",
       "python -m verification.claims C24", (BASE, WIDE), sizes=WIDE_SIZES, steps=ALONE,
       fixed="it is counted in updates of 12 min, and what an update does is asked")
def mesh_quality() -> Finding:
    """Quality of every mesh of base and wide, its fall in an update, and the updates between remeshes."""
    touched = series(*WIDE)["contact"] == 1
    parts = {"base": quality(BASE, series(*BASE)["time_h"] >= 0), "wide before contact": quality(WIDE, ~touched),
             "wide after contact": quality(WIDE, touched)}
    base, last, kept = parts["base"], parts["wide after contact"], "the paper's criterion: not more than six"
    checks = (at_most("base: largest fall of the least quality in an update", "gradually", base.fall, 0.05,
                      "twice the strain of an update, 2.4 %: what a triangle can lose"),
              at_least("base: fewest updates between remeshes", "gradually", base.between, 5, "many updates, not one"),
              *(at_most(f"{name}: most triangles under 0.6", "6", found.poor, POOR_ALLOWED, kept)
                for name, found in parts.items()),
              at_least("least quality of all", "acceptable", min(found.least for found in parts.values()), 1e-3,
                       "no triangle is turned over, or flat"))
    angle = scene(*WIDE).growth.minimum_contact_angle
    reason = (f"up to the contact it does; then a growing contact surface asks for a new mesh in every update, and at "
              f"once those have up to {last.poor} triangles under 0.6, least {last.least:.2f}, most of them in the "
              f"fluid at the contact lines: the wedge there goes down to {np.degrees(angle):.1f} deg, and its "
              "outline's nodes are still as close as the film needed that has closed (a triangle that fills the "
              f"wedge's tip has {tip(angle):.2f})")
    return Finding(tuple(map(without_limit, checks)), reason=reason, note="; ".join(
        f"{name}: {found.remeshes} remeshes, at least {found.between} updates apart, least quality {found.least:.2f}"
        for name, found in parts.items()) + ".")


def quality(run: tuple[str, ...], chosen: np.ndarray) -> Quality:
    """Of the rows of a run where ``chosen`` (rows,) is True."""
    meshes = [found.grid for found, wanted in zip(bodies(run), chosen) if wanted]
    least, new = np.array([grid.quality.min() for grid in meshes]), series(*run)["remeshed"][chosen]
    return Quality(float(least.min()), max(int(np.count_nonzero(grid.quality < POOR)) for grid in meshes),
                   float(-np.diff(least)[new[1:] == 0].min(initial=0.0)), int(new.sum()),
                   int(np.diff(np.flatnonzero(new)).min()))


def tip(angle: float) -> float:
    """Quality of an isosceles triangle with an angle (rad) between its equal sides."""
    return float(4 * np.sqrt(3) * 0.5 * np.sin(angle) / (2 + (2 * np.sin(angle / 2)) ** 2))
