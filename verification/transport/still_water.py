"""Diffusion into biomass in two dimensions, without flow, against py-pde's finite differences.

A box whose ends hold the supply; D is the same in fluid and biomass, as py-pde's Laplacian has it. Both codes are
refined together, elements as long as cells: around a block whose sides follow the cells, and around the paper's
half-disc, which cuts them. Thiele's modulus is SIDE sqrt(k F X / (K_A D_A)); at 7 the donor is used up, at 4.3 a few
percent of it are left.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from matplotlib.tri import LinearTriInterpolator, Triangulation

from reference import diffusion_reaction_pypde as pypde
from repro.fem import geometry, mesh
from repro.model import transport
from verification.case import Outcome, Profile, case
from verification.convergence import refine, study
from verification.transport.channels import SCENE, averaged, both, filled, following, pair, rates

BOX, SIDE, NAMES = 16.0, 8.0, ("acceptor", "donor")
SUBSTRATES = replace(SCENE.substrates, **{
    name: replace(getattr(SCENE.substrates, name), diffusivity=spread, diffusivity_in_aggregate=spread)
    for name, spread in zip(NAMES, (8e6, 4e6))})
#: Cells (um), and how many meshes of elements as long around the block.
BLOCK = {2.0: 6, 1.0: 4, 0.5: 2, 0.25: 1}
#: Cells (um), and the refinement that makes elements twice as long on average around the half-disc.
DISC = {4 / 3: 0.35, 2 / 3: 0.77, 1 / 3: 1.55, 1 / 6: 3.1}


@cache
def _pypde(cell: float, density: float, shape: str):
    """(centres (n, 2), C (2, n), part (n,) of each cell that is biomass)."""
    part = pypde.block(SIDE, SIDE) if shape == "block" else pypde.half_disc(SIDE)
    box = pypde.Box(round(BOX / cell), BOX, BOX, part)
    found = box.steady(pair("diffusivity", SUBSTRATES), pair("supply"), density, rates(SCENE.kinetics))
    return box.points, found, box.part


@cache
def _meshed(cell: float, sample: int, shape: str):
    if shape == "block":
        return following(2 * SIDE**2, cell, sample, (-BOX, BOX), BOX, lambda x, y: (np.abs(x) < SIDE) & (y < SIDE),
                         across=(-SIDE, SIDE), along=(SIDE,))
    return mesh.generate(geometry.seed(SIDE, DISC[cell]), (-BOX, BOX), geometry.Sizing(BOX, DISC[cell], 2.0))[0]


def _ours(cell: float, sample: int, density: float, shape: str) -> np.ndarray:
    """(2, n) at py-pde's centres."""
    grid = _meshed(cell, sample, shape)
    made = transport.problem(grid, None, SUBSTRATES, SCENE.kinetics)
    fields, where = both(transport.steady(made, filled(grid, density))), _pypde(cell, density, shape)[0]
    triangles = Triangulation(*grid.points.T, grid.triangles)
    return np.stack([LinearTriInterpolator(triangles, field)(*where.T).filled(np.nan) for field in fields])


def _apart(cell: float, sample: int, density: float, shape: str) -> dict[str, float]:
    """Differences of both substrates over their supply, and of the donor in the biomass, the scarcer, over itself."""
    ours, (_, theirs, part) = _ours(cell, sample, density, shape), _pypde(cell, density, shape)
    over = np.sqrt(np.mean((ours - theirs) ** 2, axis=1)) / pair("supply")
    ratio = (ours / theirs)[1, part == 1] - 1
    return {**dict(zip(NAMES, over)), "donor in the biomass, over itself": np.sqrt(np.mean(ratio**2))}


def _studies(shape: str, samples: dict[float, int], density: float, origin: str, ceilings) -> list:
    errors = refine(lambda cell: averaged(_apart, cell, density, shape, samples=samples), samples)
    return [study(f"{name}, X = {density:g} mg/L", list(samples), errors[name], 2, origin, ceiling=ceiling)
            for name, ceiling in zip(errors, (ceilings[0], *ceilings))]


@case("transport-block", kind="cross-code",
      norm="root mean square over py-pde's cells over the supply; that of C_D in the biomass over itself; "
           "several meshes a size",
      claim="Diffusion into a block of biomass on a wall is py-pde's, both codes refined together, at Thiele numbers "
            "0.7, 2.2 and 4.3",
      mutants=("one-supply-held", "reaction-in-the-fluid"), slow=True)
def block() -> Outcome:
    rows = {1e5: (2e-5, 3e-5), 1e6: (1e-4, 3e-4), 4e6: (2e-4, 1e-3)}
    return Outcome(studies=tuple(part for density, ceilings in rows.items()
                                 for part in _studies("block", BLOCK, density, "both of second order", ceilings)),
                   profiles=tuple(_profile("block", min(BLOCK), density) for density in rows))


@case("transport-half-disc", kind="cross-code",
      norm="root mean square over py-pde's cells over the supply; that of C_D in the biomass over itself",
      claim="Diffusion into a half-disc is py-pde's, both codes refined together, at Thiele numbers 0.7, 2.2 and 7",
      mutants=("ratio-on-the-donor-only",), slow=True)
def half_disc() -> Outcome:
    rows = {1e5: (2e-5, 3e-5), 1e6: (1e-4, 4e-4), 1e7: (3e-4, 1e-2)}
    origin = ("second order: what the cut cells of py-pde take up is right, its place is off now to one side, now to "
              "the other (with whole cells in or out it is 0.8 to 1.9)")
    samples = dict.fromkeys(DISC, 1)
    return Outcome(studies=tuple(part for density, ceilings in rows.items()
                                 for part in _studies("half-disc", samples, density, origin, ceilings)),
                   profiles=tuple(_profile("half-disc", min(DISC), density) for density in rows))


def _profile(shape: str, cell: float, density: float) -> Profile:
    """Across the box, over the middle of the biomass."""
    (points, theirs, _), ours = _pypde(cell, density, shape), _ours(cell, 0, density, shape)
    on, curves = points[:, 0] == points[points[:, 0] > 0, 0].min(), []
    for k, name in enumerate(NAMES):
        curves += [(name, "ours", points[on, 1], ours[k, on]),
                   (f"{name}, py-pde", "reference", points[on, 1], theirs[k, on])]
    return Profile(f"{shape}, X = {density:g} mg/L, x = 0", "y (um)", "C (mg/L)", tuple(curves))
