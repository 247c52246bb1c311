"""Substrates in slabs of biomass against closed forms: (26) with the Robin channel, and Monod's two limits at rest."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from reference import robin_channel, slab
from repro.fem.space import Space
from repro.model import transport
from repro.model.kinetics import Sink
from verification.kernel.case import BAND, Outcome, Profile, at_most, case, refine, study
from verification.problems import norms
from verification.problems.channels import (
    CROSSED,
    EXPECTED,
    FILM,
    FUNCTIONAL,
    SAMPLES,
    SCENE,
    SECOND,
    SIZES,
    SLAB,
    WIDE,
    WIDTH,
    WORDS,
    along,
    apart,
    averaged,
    changed,
    decay_demand,
    filled,
    problem,
    relative,
    spaced,
    steady,
)

LARGE = 1e13
ACCEPTOR, DONOR = SCENE.substrates.acceptor, SCENE.substrates.donor
#: No growth: the acceptor is taken up by decay alone, d_c f_d b X m_A, whatever the donor.
DECAY_ALONE = replace(SCENE.kinetics, maximum_utilization_rate=0.0)
UPTAKE = 2e4


@case("transport-robin-channel", kind="exact", norm="L2 of C over the mesh, relative; several meshes a size",
      claim="First-order uptake in a slab under plug flow follows its closed form, (26) upstream included, at Peclet "
            "0.1, 1, 10, wherever the inlet is put",
      mutants=("fluid-diffusivity", "half-of-the-advection", "no-inlet-flux", "weights-of-the-ends"),
      ways="1", because="orders 2, 3: transport-robin-higher")
def robin() -> Outcome:
    studies = [study(f"C, Pe = {peclet:g}", SIZES, _robin(peclet, CROSSED), 2, SECOND, ceiling=ceiling)
               for peclet, ceiling in ((0.1, 2e-4), (1.0, 2e-4), (10.0, 5e-5))]
    near = study("C, Pe = 1, inlet 4 um from the slab", SIZES, _robin(1.0, (-4.0, 60.0)), 2, SECOND, ceiling=2e-4)
    return Outcome(studies=(*studies, near), profiles=tuple(_robin_profile(peclet) for peclet in (0.1, 1.0, 10.0)))


def _robin(peclet: float, ends) -> np.ndarray:
    return refine(lambda size: averaged(_robin_errors, size, peclet, ends), SIZES)["C"]


def _robin_errors(size: float, sample: int, peclet: float, ends) -> dict[str, float]:
    space, exact = spaced(size, sample, 1, ends), _robin_exact(peclet)
    return {"C": relative(space, _robin_found(space, peclet)[1].donor, exact)}


def _robin_found(space: Space, peclet: float):
    """The donor, its half saturation far above the supply: q_D = C_D k / K_D; the acceptor never falls."""
    substrates = replace(changed("donor", half_saturation=LARGE), acceptor=replace(ACCEPTOR, half_saturation=1 / LARGE))
    law = replace(SCENE.kinetics, maximum_utilization_rate=LARGE, decay_coefficient=0.0, acceptor_to_donor_ratio=1e-12)
    made = problem(space, _robin_speed(peclet), substrates, law)
    return made, steady(made, UPTAKE)


def _robin_speed(peclet: float) -> float:
    return peclet * DONOR.diffusivity / SLAB


def _robin_exact(peclet: float):
    return lambda x: robin_channel.strip(x, _robin_speed(peclet), DONOR.supply, DONOR.diffusivity,
                                         DONOR.diffusivity_in_aggregate, UPTAKE, SLAB)


def _robin_profile(peclet: float) -> Profile:
    x, space = np.linspace(*CROSSED, 81), spaced(SIZES[-1], 0)
    found = _robin_found(space, peclet)[1].donor
    return _curves(f"Pe = {peclet:g}", x, along(space, found, x), _robin_exact(peclet)(x))


def _curves(title: str, x, ours, exact) -> Profile:
    return Profile(title, "x (um)", "C (mg/L)", (("ours", "ours", x, ours), ("closed form", "exact", x, exact)))


#: Random meshes of each size over which errors are averaged: those of few triangles differ by a third.
FEWER = {2: {3.2: 12, 1.6: 6, 0.8: 3, 0.4: 1}, 3: {3.2: 12, 1.6: 8, 0.8: 4, 0.4: 1}}


def higher_errors(size: float, sample: int, order: int, peclet: float) -> dict[str, float]:
    """Mean size of the elements; root mean square of C, and C leaving, both over the supply."""
    space, exact = spaced(size, sample, order, WIDE), _robin_exact(peclet)
    made, state = _robin_found(space, peclet)
    gap, _ = apart(space, state.donor[None], lambda x, y: exact(x)[None])
    leaving = transport.fluxes(made, Sink(filled(space, UPTAKE)), state)[1].effluent
    return {"size": norms.mean_size(space.mesh), "C": float(gap[0]) / DONOR.supply,
            "out": abs(leaving - float(exact(SLAB))) / DONOR.supply}


def _higher(order: int, peclet: float) -> dict[str, np.ndarray]:
    samples = FEWER[order]
    return refine(lambda size: averaged(higher_errors, size, order, peclet, samples=samples), samples)


#: Peclet numbers with the last error of C, where and how large that of C leaving may be, for each order.
ROBIN = {2: (((0.1, 3e-9), (1.0, 1.5e-8), (10.0, 1e-7)), -1, 6e-9), 3: (((1.0, 2e-11), (10.0, 1e-9)), 1, 1e-11)}


@case("transport-robin-higher", kind="exact", slow=True,
      norm="root mean square of C over the mesh, and C leaving, over the supply",
      claim="Quadratic and cubic concentrations follow the closed form of first-order uptake in a slab to third and "
            "fourth order, the inlet's (11) included, at Peclet 0.1, 1, 10 (cubic: 1, 10)",
      mutants=("outlet-forgotten", "fluid-diffusivity", "reaction-evenly-weighted"),
      over={WORDS[order]: (order,) for order in ROBIN}, because="order 1: transport-robin-channel")
def robin_of_higher_order(order: int):
    peclets, at, bound = ROBIN[order]
    for peclet, ceiling in peclets:
        errors = _higher(order, peclet)
        yield study(f"C, Pe = {peclet:g}", errors["size"], errors["C"], *EXPECTED[order], ceiling=ceiling)
        yield at_most(f"C leaving, Pe = {peclet:g}", errors["out"][at], bound, FUNCTIONAL[order][1])


@cache
def _at_rest(size: float, sample: int, sink: float, half_saturation: float, film: float, order: int = 1):
    """Space, C_A and its fluxes in a slab without flow, the supply held at both ends.

    sink: largest uptake, d_c f_d b X (mg/L/h); half_saturation: K (mg/L).
    """
    space = spaced(size, sample, order, (-SLAB - film, SLAB + film), (-SLAB, SLAB))
    given = problem(space, None, changed("acceptor", half_saturation=half_saturation), DECAY_ALONE)
    density = sink / decay_demand(DECAY_ALONE)
    state = steady(given, density)
    return space, state.acceptor, transport.fluxes(given, Sink(filled(space, density)), state)[0]


def _sides(film: float) -> dict[str, float]:
    """Geometry and diffusivities for the references."""
    return {"half": SLAB, "in_slab": ACCEPTOR.diffusivity_in_aggregate, "film": film,
            "diffusivity": ACCEPTOR.diffusivity}


#: Thiele's modulus, film (um), and the last errors of C and of what is taken up, for each order.
THIELE = {1: ((0.1, 0.0, 3e-7, 3e-7), (1.0, 0.0, 4e-5, 4e-5), (10.0, 0.0, 4e-3, 4e-3), (1.0, FILM, 3e-5, 3e-5)),
          2: ((0.1, 0.0, 1e-12, 3e-12), (1.0, 0.0, 1e-8, 1e-11), (10.0, 0.0, 2e-5, 3e-7), (1.0, FILM, 7e-9, 1e-11)),
          3: ((1.0, 0.0, 2e-11, 3e-12), (10.0, 0.0, 2e-7, 1e-10), (1.0, FILM, 2e-11, 3e-12))}
#: Elements (um), and how many meshes of each.
THIELE_MESHES = {1: SAMPLES, 2: {4.0: 8, 2.0: 4, 1.0: 2, 0.5: 1}, 3: SAMPLES}


NORM = "L2 of C over the mesh, relative; what is taken up, relative; several meshes a size"


@case("transport-first-order-slab", kind="exact", norm=NORM,
      claim="A slab that takes up kappa C has the profile cosh(phi x / l) and the effectiveness tanh(phi) / phi of "
            "Thiele's modulus 0.1, 1, 10, and those of its films where it has some",
      mutants=("decay-demand", "one-supply-held", "quarter-of-a-triangle", "fluid-diffusivity"),
      ways="1", because="orders 2, 3: transport-first-order-slab-higher")
def first_order():
    return _first_orders(1), [_first_order_profile(*row[:2]) for row in THIELE[1]]


@case("transport-first-order-slab-higher", kind="exact", norm=NORM, slow=True,
      claim="With quadratic and cubic elements the slab that takes up kappa C has its profile to third and fourth "
            "order, and its effectiveness to fourth and sixth",
      mutants=("reaction-evenly-weighted", "one-supply-held", "fluid-diffusivity"), ways="2 3",
      because="order 1: transport-first-order-slab")
def first_order_of_higher_order():
    return _first_orders(2), _first_orders(3)


def _first_orders(order: int) -> list:
    """Checks and studies of one order of the elements."""
    return [_first_order(order, modulus, film, ceilings) for modulus, film, *ceilings in THIELE[order]]


def _first_order(order: int, modulus: float, film: float, ceilings) -> list:
    samples = THIELE_MESHES[order]
    errors = refine(lambda size: averaged(_first_order_errors, size, modulus, film, order, samples=samples), samples)
    told = f"{_titled(modulus, film)}, {WORDS[order]}"
    found = [study(f"C, {told}", errors["size"], errors["C"], *EXPECTED[order], ceiling=ceilings[0])]
    if order == 1 or (order == 2 and modulus > 1):
        taken = study(f"taken up, {told}", errors["size"], errors["taken up"], *FUNCTIONAL[order], ceiling=ceilings[1],
                      band=order * BAND)
    else:  # soon at round-off
        taken = at_most(f"taken up, {told}", errors["taken up"][-1], ceilings[1], FUNCTIONAL[order][1])
    return [*found, taken]


def _titled(modulus: float, film: float) -> str:
    return f"phi = {modulus:g}" + (f", films of {film:g} um" if film else "")


def _kappa(modulus: float) -> float:
    """Uptake (1/h) of a Thiele modulus."""
    return ACCEPTOR.diffusivity_in_aggregate * (modulus / SLAB) ** 2


def _first_order_errors(size: float, sample: int, modulus: float, film: float, order: int) -> dict[str, float]:
    kappa = _kappa(modulus)
    space, field, flux = _at_rest(size, sample, kappa * LARGE, LARGE, film, order)
    effectiveness = slab.first_order(0.0, ACCEPTOR.supply, kappa, **_sides(film))[1]
    taken = flux.consumed / (kappa * ACCEPTOR.supply * 2 * SLAB * WIDTH)
    gap = relative(space, field, lambda x: slab.first_order(x, ACCEPTOR.supply, kappa, **_sides(film))[0])
    return {"size": size if order == 1 else norms.mean_size(space.mesh), "C": gap,
            "taken up": abs(taken / effectiveness - 1)}


def _first_order_profile(modulus: float, film: float) -> Profile:
    space, field, _ = _at_rest(SIZES[-1], 0, _kappa(modulus) * LARGE, LARGE, film)
    x = np.linspace(-SLAB - film, SLAB + film, 121)
    exact = slab.first_order(x, ACCEPTOR.supply, _kappa(modulus), **_sides(film))[0]
    return _curves(_titled(modulus, film), x, along(space, field, x), exact)


DEPTH, LIMIT, LEAST = 20.0, (0.3, 0.1, 0.03, 0.01), 1e-3


@case("transport-zero-order-slab", kind="exact",
      norm="L2 of C over the mesh, relative; depth = what enters a side over s, relative; several meshes a size",
      claim="Where half saturation is small against the supply, uptake s goes on at its full rate down to the depth of "
            "penetration sqrt(2 D C_s / s), or that of its films, and nothing is left beyond; on the way there the "
            "slab follows Monod's first integral",
      mutants=("reaction-in-the-fluid", "decay-demand"), slow=True, ways="1 2 3")
def zero_order() -> Outcome:
    rows = [(0.1, 0.0, 3e-4, 4e-5), (0.03, 0.0, 4e-4, 4e-5), (0.01, FILM, 1e-4, 3e-5)]
    studies = [part for half_saturation, film, *ceilings in rows for part in _monod(half_saturation, film, ceilings)]
    higher = [_higher_monod(order) for order in HIGHER]
    checks = (*_exhausted(0.0), *_exhausted(FILM), *(check for check, _ in higher))
    return Outcome(checks, (*studies, *_limit(), *(part for _, part in higher)),
                   tuple(_depth_profile(film) for film in (0.0, FILM)))


def _sink(film: float) -> float:
    """s (mg/L/h) that zero order brings DEPTH deep."""
    b = film * ACCEPTOR.diffusivity_in_aggregate / ACCEPTOR.diffusivity
    return 2 * ACCEPTOR.diffusivity_in_aggregate * ACCEPTOR.supply / ((DEPTH + b) ** 2 - b**2)


def _depth(flux, sink: float) -> float:
    return flux.consumed / (2 * WIDTH * sink)


def _monod(half_saturation: float, film: float, ceilings):
    errors = refine(lambda size: averaged(_monod_errors, size, half_saturation, film), SIZES)
    title = f"K = {half_saturation:g} mg/L" + (f", films of {film:g} um" if film else "")
    return [study(f"{name}, {title}", SIZES, errors[name], 2, SECOND, ceiling=ceiling)
            for name, ceiling in zip(("C", "depth"), ceilings)]


#: Elements (um) of order 2 and 3 with how many meshes of each, and the last errors of C and of the depth.
HIGHER = {2: ({4.0: 6, 2.0: 4, 1.0: 2, 0.5: 1}, 6e-7, 2e-10), 3: ({5.6: 10, 2.8: 6, 1.4: 3, 0.75: 3}, 4e-8, 1e-11)}


def _higher_monod(order: int):
    """The depth and a study of C with K = 0.1 mg/L, no films: with more of it what is left in the middle shows."""
    samples, ceiling, depth = HIGHER[order]
    errors = refine(lambda size: averaged(_monod_errors, size, 0.1, 0.0, order, samples=samples), samples)
    told = f"K = 0.1 mg/L, {WORDS[order]}"
    return (at_most(f"depth, {told}", errors["depth"][-1], depth, FUNCTIONAL[order][1]),
            study(f"C, {told}", errors["size"], errors["C"], *EXPECTED[order], ceiling=ceiling))


def _monod_errors(size: float, sample: int, half_saturation: float, film: float, order: int = 1) -> dict[str, float]:
    space, field, flux = _at_rest(size, sample, _sink(film), half_saturation, film, order)

    def exact(x):
        return slab.monod(x, ACCEPTOR.supply, _sink(film), half_saturation, **_sides(film))

    return {"size": norms.mean_size(space.mesh), "C": relative(space, field, lambda x: exact(x)[0]),
            "depth": abs(_depth(flux, _sink(film)) / exact(0.0)[1] - 1)}


def _limit():
    """How the slab without films goes to zero order as its half saturation does to zero, on one fine mesh."""
    rows = [_from_zero_order(half_saturation) for half_saturation in LIMIT]
    origin = "C_s / K large: K / (2 C_s) ln(1 + C_s / K) for the depth; the mesh's error is 30 times smaller"
    return [study(f"{name} less zero order's, K = {LIMIT[0]:g} to {LIMIT[-1]:g} mg/L", LIMIT, [row[k] for row in rows],
                  0.8, origin, band=0.1, ceiling=ceiling)
            for k, (name, ceiling) in enumerate((("C", 1e-2), ("depth", 4e-3)))]


def _from_zero_order(half_saturation: float) -> tuple[float, float]:
    sink = _sink(0.0)
    space, field, flux = _at_rest(SIZES[-1], 0, sink, half_saturation, 0.0)
    depth = slab.penetration(ACCEPTOR.supply, sink, ACCEPTOR.diffusivity_in_aggregate)
    return (relative(space, field, lambda x: slab.zero_order(x, ACCEPTOR.supply, sink, **_sides(0.0))),
            abs(_depth(flux, sink) / depth - 1))


def _exhausted(film: float):
    """What is left beyond the depth of penetration."""
    space, field, _ = _at_rest(SIZES[-2], 0, _sink(film), LEAST, film)
    beyond = np.abs(space.points[:, 0]) < SLAB - DEPTH - 4 * SIZES[-2]
    title = f"K = {LEAST:g} mg/L, " + (f"films of {film:g} um" if film else "no films")
    return [at_most(f"C beyond the depth of penetration, {title}, over the supply",
                    field[beyond].max() / ACCEPTOR.supply, 1e-8, "falls by h^2 s / (D K), 20 or more, an element"),
            at_most(f"least C, {title}, over the supply", field.min() / ACCEPTOR.supply, 1e-8, "C >= 0")]


def _depth_profile(film: float) -> Profile:
    space, field, _ = _at_rest(SIZES[-1], 0, _sink(film), LIMIT[-1], film)
    x = np.linspace(-SLAB - film, SLAB + film, 121)
    given = {"x": x, "supply": ACCEPTOR.supply, "sink": _sink(film), **_sides(film)}
    curves = (("ours", "ours", x, along(space, field, x)),
              ("Monod, closed form", "reference", x, slab.monod(half_saturation=LIMIT[-1], **given)[0]),
              ("zero order", "exact", x, slab.zero_order(**given)))
    return Profile(f"K = {LIMIT[-1]:g} mg/L" + (", films" if film else ""), "x (um)", "C (mg/L)", curves)
