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

from reference import diffusion_reaction_pypde as pypde
from repro.fem.mesher import generate
from repro.fem.outline import half_disc as half_disc_outline
from repro.fem.sizing import ACROSS_AGGREGATE, Sizing
from repro.fem.space import Space
from repro.model import gear, transport
from repro.model.kinetics import Sink
from verification.case import Check, Outcome, Profile, at_most, case
from verification.convergence import refine, study
from verification.transport.channels import (
    NAMES,
    SCENE,
    WORDS,
    averaged,
    both,
    filled,
    following,
    pair,
    rates,
    sample,
    space_on,
)

BOX, SIDE = 16.0, 8.0
SUBSTRATES = replace(SCENE.substrates, **{
    name: replace(getattr(SCENE.substrates, name), diffusivity=spread, diffusivity_in_aggregate=spread)
    for name, spread in zip(NAMES, (8e6, 4e6))})
#: Cells (um), and how many meshes of elements as long around the block.
BLOCK = {2.0: 6, 1.0: 4, 0.5: 2, 0.25: 1}
#: Elements (um) of order 2 and 3 around either, which err less than a tenth as much as the finest cells.
FINE = {"block": {2: 0.5, 3: 1.0}, "half-disc": {2: 1 / 3, 3: 2 / 3}}
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
def _spaced(cell: float, number: int, shape: str, order: int = 1) -> Space:
    if shape == "block":
        return space_on(following(2 * SIDE**2, cell, number, (-BOX, BOX), BOX,
                                  lambda x, y: (np.abs(x) < SIDE) & (y < SIDE), across=(-SIDE, SIDE), along=(SIDE,)),
                        order)
    outline = half_disc_outline(SIDE, ACROSS_AGGREGATE * DISC[cell], min(order, 2))
    return Space(generate(outline, (-BOX, BOX), Sizing(BOX, DISC[cell], 2.0), min(order, 2))[0], order)


def _ours(space: Space, density: float, where: np.ndarray, transient: bool = False) -> np.ndarray:
    """(2, n) at places (n, 2); transient: by the transient scheme, where it comes to rest."""
    made, sink = transport.problem(space, None, SUBSTRATES, SCENE.kinetics), Sink(filled(space, density))
    found = gear.settle(made, sink, None) if transient else transport.steady(made, sink)
    return sample(space, both(found), where)


def _apart(cell: float, number: int, density: float, shape: str) -> dict[str, float]:
    """Ours on elements as long as py-pde's cells."""
    return _less(_ours(_spaced(cell, number, shape), density, _pypde(cell, density, shape)[0]), cell, density, shape)


def _less(ours: np.ndarray, cell: float, density: float, shape: str) -> dict[str, float]:
    """Differences of both substrates over their supply, and of the donor in the biomass, the scarcer, over itself."""
    _, theirs, part = _pypde(cell, density, shape)
    over = np.sqrt(np.mean((ours - theirs) ** 2, axis=1)) / pair("supply")
    ratio = (ours / theirs)[1, part == 1] - 1
    return {**dict(zip(NAMES, over)), "donor in the biomass, over itself": np.sqrt(np.mean(ratio**2))}


def _studies(shape: str, samples: dict[float, int], density: float, origin: str, ceilings) -> list:
    errors = refine(lambda cell: averaged(_apart, cell, density, shape, samples=samples), samples)
    return [study(f"{name}, X = {density:g} mg/L", list(samples), errors[name], 2, origin, ceiling=ceiling)
            for name, ceiling in zip(errors, (ceilings[0], *ceilings))]


def _higher(density: float, ceilings) -> list:
    """py-pde's cells around the block against one mesh of quadratic, one of cubic elements, which err less than a tenth
    as much; by the transient scheme, at rest."""
    studies = []
    for order, size in FINE["block"].items():
        errors = refine(_at_rest, BLOCK, size, density, "block", order)
        studies += [study(f"{name}, of py-pde less {WORDS[order]} elements', X = {density:g} mg/L", list(BLOCK),
                          errors[name], 2, "py-pde's second order", ceiling=ceiling)
                    for name, ceiling in zip(errors, (ceilings[0], *ceilings))]
    return studies


def _cut_cells(cell: float, density: float, ceilings) -> tuple[Check, ...]:
    """The same around the half-disc, on the finest cells alone: one after the other they are off to one side or to the
    other, by no steady order."""
    checks = []
    for order, size in FINE["half-disc"].items():
        errors = _at_rest(cell, size, density, "half-disc", order)
        checks += [at_most(f"{name}, of py-pde less {WORDS[order]} elements', X = {density:g} mg/L", errors[name],
                           ceiling, "py-pde's error") for name, ceiling in zip(errors, ceilings)]
    return tuple(checks)


def _at_rest(cell: float, size: float, density: float, shape: str, order: int) -> dict[str, float]:
    """Differences to py-pde's cells of elements of another size, by the transient scheme."""
    where = _pypde(cell, density, shape)[0]
    return _less(_ours(_spaced(size, 0, shape, order), density, where, True), cell, density, shape)


@case("transport-block", kind="cross-code",
      norm="root mean square over py-pde's cells over the supply; that of C_D in the biomass over itself; "
           "several meshes a size",
      claim="Diffusion into a block of biomass on a wall is py-pde's, both codes refined together, at Thiele numbers "
            "0.7, 2.2 and 4.3; with quadratic and cubic elements the transient scheme comes to rest in what py-pde's "
            "cells come to",
      mutants=("one-supply-held", "reaction-in-the-fluid"), slow=True)
def block() -> Outcome:
    rows, studies = {1e5: (2e-5, 3e-5), 1e6: (1e-4, 3e-4), 4e6: (2e-4, 1e-3)}, []
    for density, ceilings in rows.items():
        studies += _studies("block", BLOCK, density, "both of second order", ceilings)
    studies += _higher(1e6, (1e-4, 3e-4))
    return Outcome(studies=tuple(studies),
                   profiles=tuple(_profile("block", min(BLOCK), density) for density in rows))


@case("transport-half-disc", kind="cross-code",
      norm="root mean square over py-pde's cells over the supply; that of C_D in the biomass over itself",
      claim="Diffusion into a half-disc is py-pde's, both codes refined together, at Thiele numbers 0.7, 2.2 and 7; "
            "with quadratic and cubic elements the transient scheme comes to rest in what py-pde's cells come to",
      mutants=("ratio-on-the-donor-only",), slow=True)
def half_disc() -> Outcome:
    rows, studies = {1e5: (2e-5, 3e-5), 1e6: (1e-4, 4e-4), 1e7: (3e-4, 1e-2)}, []
    origin = ("second order: what the cut cells of py-pde take up is right, its place is off now to one side, now to "
              "the other (with whole cells in or out it is 0.8 to 1.9)")
    samples = dict.fromkeys(DISC, 1)
    for density, ceilings in rows.items():
        studies += _studies("half-disc", samples, density, origin, ceilings)
    profiles = tuple(_profile("half-disc", min(DISC), density) for density in rows)
    return Outcome(_cut_cells(min(DISC), 1e6, (1e-5, 1.5e-5, 4e-5)), tuple(studies), profiles)


def _profile(shape: str, cell: float, density: float) -> Profile:
    """Across the box, over the middle of the biomass."""
    points, theirs, _ = _pypde(cell, density, shape)
    ours = _ours(_spaced(cell, 0, shape), density, points)
    on, curves = points[:, 0] == points[points[:, 0] > 0, 0].min(), []
    for k, name in enumerate(NAMES):
        curves += [(name, "ours", points[on, 1], ours[k, on]),
                   (f"{name}, py-pde", "reference", points[on, 1], theirs[k, on])]
    return Profile(f"{shape}, X = {density:g} mg/L, x = 0", "y (um)", "C (mg/L)", tuple(curves))
