"""Dual Monod uptake in a slab under plug flow, steady: against scipy's collocation, and against FiPy's finite volumes.

Peclet numbers u l / D_A are 0.1, 1 and 5. Thiele's modulus l sqrt(k F X / (K_A D_A)) is 0.6, 1.9 and 6; the last slab,
at Peclet number 0.1, is starved: three ten-thousandths of the acceptor's supply leave it.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from reference import channel_bvp, channel_fipy
from verification import norms
from verification.case import Outcome, Profile, case
from verification.convergence import refine, study
from verification.transport.channels import (
    CROSSED,
    EXPECTED,
    NAMES,
    SCENE,
    SECOND,
    SIZES,
    SLAB,
    WIDE,
    along,
    apart,
    at_heights,
    averaged,
    both,
    distance,
    pair,
    problem,
    rates,
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
      mutants=("decay-demand", "ratio-on-the-donor-only", "reaction-in-the-fluid", "exchanged-substrates"))
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


@case("transport-curved-monod", kind="cross-code", slow=True,
      norm="root mean square over the mesh of both substrates less solve_bvp, over the supply",
      claim="Dual Monod uptake under plug flow on quadratic triangles is solve_bvp's, to third order, at Peclet 0.5, "
            "1, 5 times Thiele numbers 0.6, 1.9, 6, from barely touched to starved",
      mutants=("uptake-without-decay", "fluid-diffusivity"))
def quadratic() -> Outcome:
    combinations = [(peclet, density) for peclet in FASTER for density in DENSITIES]
    studies = tuple(_higher(2, peclet, density, 1e-7) for peclet, density in combinations)
    return Outcome((), studies, tuple(_quadratic_profile(peclet, density) for peclet, density in combinations))


def _quadratic_profile(peclet: float, density: float) -> Profile:
    space, truth = spaced(1.6, 0, 2, WIDE), exact(peclet, density)
    ours, x, curves = found(1.6, 0, peclet, density, 2, WIDE), np.linspace(*WIDE, 121), []
    for k, name in enumerate(NAMES):
        curves += [(name, "ours", x, along(space, ours[k], x)),
                   (f"{name}, solve_bvp", "exact", x[::6], truth(x[::6])[k])]
    return Profile(titled(peclet, density), "x (um)", "C (mg/L)", tuple(curves))


@case("transport-cubic-monod", kind="cross-code", slow=True,
      norm="root mean square over the mesh of both substrates less solve_bvp, over the supply",
      claim="Dual Monod uptake under plug flow on cubic triangles is solve_bvp's, to fourth order, from barely touched "
            "to starved biomass",
      mutants=("reaction-evenly-weighted", "uptake-without-decay"))
def cubic() -> Outcome:
    return Outcome(studies=tuple(_higher(3, 1.0, density, 1e-9) for density in DENSITIES))


@case("transport-monod-fipy", kind="cross-code",
      norm="root mean square over FiPy's cells, at five heights, of each substrate over its supply, and in the starved "
           "slab over its own value; several meshes a size",
      claim="Dual Monod uptake under plug flow is FiPy's, both codes refined together, at Peclet 0.1, 1, 5 times "
            "Thiele numbers 0.6, 1.9, 6, from barely touched to starved",
      mutants=("decay-demand", "no-inlet-flux"), slow=True)
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
