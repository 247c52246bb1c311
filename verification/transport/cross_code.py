"""Dual Monod uptake in a slab under plug flow, steady: against scipy's collocation, and against FiPy's finite volumes.

Peclet numbers u l / D_A are 0.1, 1 and 5. Thiele's modulus l sqrt(k F X / (K_A D_A)) is 0.6, 1.9 and 6; the last slab,
at Peclet number 0.1, is starved: three ten-thousandths of the acceptor's supply leave it.

Diffusion into biomass in two dimensions, without flow, against py-pde's finite differences.

A box whose ends hold the supply; D is the same in fluid and biomass, as py-pde's Laplacian has it. Both codes are
refined together, elements as long as cells: around a block whose sides follow the cells, and around the paper's
half-disc, which cuts them. Thiele's modulus is SIDE sqrt(k F X / (K_A D_A)); at 7 the donor is used up, at 4.3 a few
percent of it are left.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np

from reference import channel_bvp, channel_fipy
from reference import diffusion_reaction_pypde as pypde
from repro.fem.space import Space
from repro.model import gear, transport
from repro.model.kinetics import Sink
from verification.kernel.case import Check, Outcome, Profile, at_most, case, refine, study
from verification.problems import meshes, norms
from verification.problems.channels import (
    CROSSED,
    EXPECTED,
    NAMES,
    SCENE,
    SECOND,
    SIZES,
    SLAB,
    WIDE,
    WORDS,
    along,
    apart,
    at_heights,
    averaged,
    both,
    distance,
    filled,
    following,
    pair,
    problem,
    rates,
    sample,
    spaced,
    speed_of,
    steady,
)

PECLETS, DENSITIES = (0.1, 1.0, 5.0), (3e3, 3e4, 3e5)
#: Errors of a density X of both substrates: ours, and ours less FiPy's.
CEILINGS = {3e3: (1e-6, 1e-6), 3e4: (3e-5, 6e-6), 3e5: (4e-4, 5e-5)}
STARVED = (PECLETS[0], DENSITIES[-1])
COMBINATIONS = tuple((peclet, density) for peclet in PECLETS for density in DENSITIES)


def given(peclet: float, density: float):
    """What the references take."""
    return (speed_of(peclet), pair("supply"), pair("diffusivity"), pair("diffusivity_in_aggregate"), density,
            rates(SCENE.kinetics), SLAB)


def titled(peclet: float, density: float) -> str:
    """The combination in words."""
    return f"Pe = {peclet:g}, X = {density:g} mg/L"


@cache
def found(size: float, sample: int, peclet: float, density: float, order: int = 1, ends=CROSSED) -> np.ndarray:
    """(2, n) C_A and C_D on one of the meshes of a size."""
    return both(steady(problem(spaced(size, sample, order, ends), speed_of(peclet)), density))


@cache
def exact(peclet: float, density: float, tolerance: float = 1e-8):
    """x -> (C_A, C_D), by solve_bvp."""
    return channel_bvp.solution(*given(peclet, density), tolerance=tolerance)


@cache
def fipy(size: float, peclet: float, density: float):
    """(x, C (2, n)) at the centres of FiPy's cells, half as long as our edges."""
    channel = channel_fipy.Channel(round(2 * (CROSSED[1] - CROSSED[0]) / size), CROSSED, *given(peclet, density))
    return channel.x, channel.steady()


@case("transport-monod-collocation", kind="cross-code",
      norm="L2 of each substrate over the mesh, relative; starved: root mean square over the slab of C_A over its own "
           "value; several meshes a size",
      claim="Dual Monod uptake under plug flow is solve_bvp's at Peclet 0.1, 1, 5 times Thiele numbers 0.6, 1.9, 6, "
            "from barely touched to starved",
      mutants=("decay-demand", "ratio-on-the-donor-only", "reaction-in-the-fluid", "exchanged-substrates"),
      ways="1", because="orders 2, 3: transport-monod-higher")
def collocation() -> Outcome:
    studies = [part for combination in COMBINATIONS for part in _collocation(*combination)]
    errors = refine(lambda size: averaged(_relative_error, size, *STARVED), SIZES)["acceptor"]
    studies.append(study(f"C_A in the starved slab over itself, {titled(*STARVED)}", SIZES, errors, 2, SECOND,
                         ceiling=6e-4))
    return Outcome(studies=tuple(studies))


def _collocation(peclet: float, density: float):
    errors = refine(lambda size: averaged(_distances, size, peclet, density), SIZES)
    return [study(f"{name}, {titled(peclet, density)}", SIZES, errors[name], 2, SECOND, ceiling=CEILINGS[density][0])
            for name in NAMES]


def _distances(size: float, sample: int, peclet: float, density: float) -> dict[str, float]:
    gaps = distance(spaced(size, sample), found(size, sample, peclet, density), exact(peclet, density))
    return dict(zip(NAMES, gaps))


def _relative_error(size: float, sample: int, peclet: float, density: float) -> dict[str, float]:
    pieces = spaced(size, sample).reaction
    nodes = pieces.cells[:, 0]
    there = spaced(size, sample).points[nodes, 0]
    ratio = found(size, sample, peclet, density)[0, nodes] / exact(peclet, density)(there)[0]
    return {"acceptor": np.sqrt(np.average((ratio - 1) ** 2, weights=pieces.dx[:, 0]))}


#: Peclet numbers of order 2; random meshes of each size (um), and solve_bvp's tolerance, which takes no less at Peclet
#: 5: cubic elements are judged at Peclet 1, on coarser meshes, as solve_bvp is good to 1e-11 or so.
FASTER = (0.5, 1.0, 5.0)
HIGHER = {2: ({3.2: 12, 1.6: 6, 0.8: 3, 0.4: 1}, 1e-10), 3: ({6.4: 12, 3.2: 8, 1.6: 4, 0.8: 2}, 1e-12)}


def higher_errors(size: float, sample: int, order: int, peclet: float, density: float) -> dict[str, float]:
    """Mean size of the elements, and root mean square of both substrates over the larger supply."""
    space, truth = spaced(size, sample, order, WIDE), exact(peclet, density, HIGHER[order][1])
    gaps, _ = apart(space, found(size, sample, peclet, density, order, WIDE), lambda x, y: truth(x))
    return {"size": norms.mean_size(space.mesh), "C": float(np.hypot(*gaps)) / pair("supply")[0]}


def _higher(order: int, peclet: float, density: float, ceiling: float):
    samples = HIGHER[order][0]
    errors = refine(lambda size: averaged(higher_errors, size, order, peclet, density, samples=samples), samples)
    return study(titled(peclet, density), errors["size"], errors["C"], *EXPECTED[order], ceiling=ceiling)


#: Peclet numbers and the last error, for each order.
FAST_MONOD = {2: (FASTER, 1e-7), 3: ((1.0,), 1e-9)}


@case("transport-monod-higher", kind="cross-code", slow=True,
      norm="root mean square over the mesh of both substrates less solve_bvp, over the supply",
      claim="Dual Monod uptake under plug flow on quadratic and cubic triangles is solve_bvp's, to third and fourth "
            "order, at Peclet 0.5, 1, 5 (cubic: 1) times Thiele numbers 0.6, 1.9, 6, from barely touched to starved",
      mutants=("uptake-without-decay", "fluid-diffusivity", "reaction-evenly-weighted"),
      over={WORDS[order]: (order,) for order in FAST_MONOD}, because="order 1: transport-monod-collocation")
def higher(order: int):
    peclets, ceiling = FAST_MONOD[order]
    for peclet, density in product(peclets, DENSITIES):
        yield _higher(order, peclet, density, ceiling)
        if order == 2:
            yield _quadratic_profile(peclet, density)


def _quadratic_profile(peclet: float, density: float) -> Profile:
    space, truth = spaced(1.6, 0, 2, WIDE), exact(peclet, density)
    ours, x, curves = found(1.6, 0, peclet, density, 2, WIDE), np.linspace(*WIDE, 121), []
    for k, name in enumerate(NAMES):
        curves += [(name, "ours", x, along(space, ours[k], x)),
                   (f"{name}, solve_bvp", "exact", x[::6], truth(x[::6])[k])]
    return Profile(titled(peclet, density), "x (um)", "C (mg/L)", tuple(curves))


@case("transport-monod-fipy", kind="cross-code",
      norm="root mean square over FiPy's cells, at five heights, of each substrate over its supply, and in the starved "
           "slab over its own value; several meshes a size",
      claim="Dual Monod uptake under plug flow is FiPy's, both codes refined together, at Peclet 0.1, 1, 5 times "
            "Thiele numbers 0.6, 1.9, 6, from barely touched to starved",
      mutants=("decay-demand", "no-inlet-flux"), slow=True, ways="1", because="orders 2, 3: transport-monod-higher")
def finite_volumes() -> Outcome:
    studies = [part for combination in COMBINATIONS for part in _finite_volumes(*combination)]
    errors = refine(lambda size: averaged(_relative_to_fipy, size, *STARVED), SIZES)["acceptor"]
    studies.append(study(f"C_A in the starved slab over itself, {titled(*STARVED)}", SIZES, errors, 2, BOTH,
                         ceiling=6e-4))
    return Outcome(studies=tuple(studies), profiles=tuple(profile(*combination) for combination in COMBINATIONS))


BOTH = "both codes are of second order"


def _finite_volumes(peclet: float, density: float):
    errors = refine(lambda size: averaged(_from_fipy, size, peclet, density), SIZES)
    return [study(f"{name} less FiPy's, {titled(peclet, density)}", SIZES, errors[name], 2, BOTH,
                  ceiling=CEILINGS[density][1])
            for name in NAMES]


def _from_fipy(size: float, sample: int, peclet: float, density: float) -> dict[str, float]:
    x, theirs = fipy(size, peclet, density)
    gap = _at_cells(size, sample, peclet, density, x) - theirs[:, None]
    return {name: np.sqrt(np.mean(gap[k] ** 2)) / pair("supply")[k] for k, name in enumerate(NAMES)}


def _at_cells(size: float, sample: int, peclet: float, density: float, x) -> np.ndarray:
    return at_heights(spaced(size, sample), found(size, sample, peclet, density), x)


def _relative_to_fipy(size: float, sample: int, peclet: float, density: float) -> dict[str, float]:
    x, theirs = fipy(size, peclet, density)
    inside = (x > 0) & (x < SLAB)
    ratio = _at_cells(size, sample, peclet, density, x[inside])[0] / theirs[0, inside]
    return {"acceptor": np.sqrt(np.mean((ratio - 1) ** 2))}


def profile(peclet: float, density: float) -> Profile:
    """Along the channel: ours, FiPy's and solve_bvp's."""
    (x, theirs), trusted = fipy(SIZES[-1], peclet, density), exact(peclet, density)
    space, ours, curves = spaced(SIZES[-1], 0), found(SIZES[-1], 0, peclet, density), []
    for k, name in enumerate(NAMES):
        curves += [(name, "ours", x, along(space, ours[k], x)), (f"{name}, FiPy", "reference", x, theirs[k]),
                   (f"{name}, solve_bvp", "exact", x[::12], trusted(x[::12])[k])]
    return Profile(titled(peclet, density), "x (um)", "C (mg/L)", tuple(curves))


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
        return meshes.space_on(following(2 * SIDE**2, cell, number, (-BOX, BOX), BOX,
                                         lambda x, y: (np.abs(x) < SIDE) & (y < SIDE), across=(-SIDE, SIDE),
                                         along=(SIDE,)), order)
    return meshes.half_disc_space(SIDE, DISC[cell], (-BOX, BOX), BOX, order)


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


def _still_higher(density: float, ceilings) -> list:
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
      mutants=("one-supply-held", "reaction-in-the-fluid"), slow=True, ways="1 2 3")
def block() -> Outcome:
    rows, studies = {1e5: (2e-5, 3e-5), 1e6: (1e-4, 3e-4), 4e6: (2e-4, 1e-3)}, []
    for density, ceilings in rows.items():
        studies += _studies("block", BLOCK, density, "both of second order", ceilings)
    studies += _still_higher(1e6, (1e-4, 3e-4))
    return Outcome(studies=tuple(studies),
                   profiles=tuple(_profile("block", min(BLOCK), density) for density in rows))


@case("transport-half-disc", kind="cross-code",
      norm="root mean square over py-pde's cells over the supply; that of C_D in the biomass over itself",
      claim="Diffusion into a half-disc is py-pde's, both codes refined together, at Thiele numbers 0.7, 2.2 and 7; "
            "with quadratic and cubic elements the transient scheme comes to rest in what py-pde's cells come to",
      mutants=("ratio-on-the-donor-only",), slow=True, ways="1 2 3")
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
