"""Substrates in slabs of biomass against closed forms: (26) with the Robin channel, and Monod's two limits at rest."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from reference import robin_channel, slab
from repro.model import transport
from verification import norms
from verification.case import Outcome, Profile, at_most, case
from verification.convergence import refine, study
from verification.transport.channels import (
    CROSSED,
    FILM,
    SCENE,
    SECOND,
    SIZES,
    SLAB,
    WIDTH,
    along,
    averaged,
    changed,
    decay_demand,
    filled,
    meshed,
    problem,
)

LARGE = 1e9
ACCEPTOR, DONOR = SCENE.substrates.acceptor, SCENE.substrates.donor
#: No growth: the acceptor is taken up by decay alone, d_c f_d b X m_A, whatever the donor.
DECAY_ALONE = replace(SCENE.kinetics, maximum_utilization_rate=0.0)


@case("transport-robin-channel", kind="exact", norm="L2 of C over the mesh, relative; several meshes a size",
      claim="First-order uptake in a slab under plug flow follows its closed form, (26) upstream included, at Peclet "
            "0.1, 1, 10, wherever the inlet is put",
      mutants=("fluid-diffusivity", "half-of-the-advection", "no-inlet-flux", "weights-of-the-ends"))
def robin() -> Outcome:
    studies = [study(f"C, Pe = {peclet:g}", SIZES, _robin(peclet, CROSSED), 2, SECOND, ceiling=ceiling)
               for peclet, ceiling in ((0.1, 2e-4), (1.0, 2e-4), (10.0, 5e-5))]
    near = study("C, Pe = 1, inlet 4 um from the slab", SIZES, _robin(1.0, (-4.0, 60.0)), 2, SECOND, ceiling=2e-4)
    return Outcome(studies=(*studies, near), profiles=tuple(_robin_profile(peclet) for peclet in (0.1, 1.0, 10.0)))


UPTAKE = 2e4


def _robin(peclet: float, ends) -> np.ndarray:
    return refine(lambda size: averaged(_robin_errors, size, peclet, ends), SIZES)["C"]


def _robin_errors(size: float, sample: int, peclet: float, ends) -> dict[str, float]:
    grid, exact = meshed(size, sample, ends), _robin_exact(peclet)
    return {"C": norms.l2_error(grid.points, grid.triangles, _robin_found(grid, peclet), lambda x, y: exact(x))}


def _robin_found(grid, peclet: float) -> np.ndarray:
    """The donor, its half saturation far above the supply: q_D = C_D k / K_D; the acceptor never falls."""
    substrates = replace(changed("donor", half_saturation=LARGE), acceptor=replace(ACCEPTOR, half_saturation=1 / LARGE))
    law = replace(SCENE.kinetics, maximum_utilization_rate=LARGE, decay_coefficient=0.0, acceptor_to_donor_ratio=1e-12)
    given = problem(grid, _robin_speed(peclet), substrates, law)
    return transport.steady(given, filled(grid, UPTAKE)).donor


def _robin_speed(peclet: float) -> float:
    return peclet * DONOR.diffusivity / SLAB


def _robin_exact(peclet: float):
    return lambda x: robin_channel.strip(x, _robin_speed(peclet), DONOR.supply, DONOR.diffusivity,
                                         DONOR.diffusivity_in_aggregate, UPTAKE, SLAB)


def _robin_profile(peclet: float) -> Profile:
    x, grid = np.linspace(*CROSSED, 81), meshed(SIZES[-1], 0)
    return _curves(f"Pe = {peclet:g}", x, along(grid, _robin_found(grid, peclet), x), _robin_exact(peclet)(x))


def _curves(title: str, x, ours, exact) -> Profile:
    return Profile(title, "x (um)", "C (mg/L)", (("ours", "ours", x, ours), ("closed form", "exact", x, exact)))


@cache
def _at_rest(size: float, sample: int, sink: float, half_saturation: float, film: float):
    """Mesh, C_A and its fluxes in a slab without flow, the supply held at both ends.

    sink: largest uptake, d_c f_d b X (mg/L/h); half_saturation: K (mg/L).
    """
    grid = meshed(size, sample, (-SLAB - film, SLAB + film), (-SLAB, SLAB))
    given = problem(grid, None, changed("acceptor", half_saturation=half_saturation), DECAY_ALONE)
    active = filled(grid, sink / decay_demand(DECAY_ALONE))
    state = transport.steady(given, active)
    return grid, state.acceptor, transport.fluxes(given, active, state)[0]


def _sides(film: float) -> dict[str, float]:
    """Geometry and diffusivities for the references."""
    return {"half": SLAB, "in_slab": ACCEPTOR.diffusivity_in_aggregate, "film": film,
            "diffusivity": ACCEPTOR.diffusivity}


@case("transport-first-order-slab", kind="exact",
      norm="L2 of C over the mesh, relative; what is taken up, relative; several meshes a size",
      claim="A slab that takes up kappa C has the profile cosh(phi x / l) and the effectiveness tanh(phi) / phi of "
            "Thiele's modulus 0.1, 1, 10, and those of its films where it has some",
      mutants=("decay-demand", "one-supply-held", "quarter-of-a-triangle", "fluid-diffusivity"))
def first_order() -> Outcome:
    rows = [(0.1, 0.0, 3e-7, 3e-7), (1.0, 0.0, 4e-5, 4e-5), (10.0, 0.0, 4e-3, 4e-3), (1.0, FILM, 3e-5, 3e-5)]
    studies = [part for modulus, film, *ceilings in rows for part in _first_order(modulus, film, ceilings)]
    return Outcome(studies=tuple(studies), profiles=tuple(_first_order_profile(*row[:2]) for row in rows))


def _first_order(modulus: float, film: float, ceilings):
    errors = refine(lambda size: averaged(_first_order_errors, size, modulus, film), SIZES)
    return [study(f"{name}, {_titled(modulus, film)}", SIZES, errors[name], 2, SECOND, ceiling=ceiling)
            for name, ceiling in zip(("C", "taken up"), ceilings)]


def _titled(modulus: float, film: float) -> str:
    return f"phi = {modulus:g}" + (f", films of {film:g} um" if film else "")


def _kappa(modulus: float) -> float:
    """Uptake (1/h) of a Thiele modulus."""
    return ACCEPTOR.diffusivity_in_aggregate * (modulus / SLAB) ** 2


def _first_order_errors(size: float, sample: int, modulus: float, film: float) -> dict[str, float]:
    kappa = _kappa(modulus)
    grid, field, flux = _at_rest(size, sample, kappa * LARGE, LARGE, film)
    effectiveness = slab.first_order(0.0, ACCEPTOR.supply, kappa, **_sides(film))[1]
    taken = flux.consumed / (kappa * ACCEPTOR.supply * 2 * SLAB * WIDTH)
    exact = norms.l2_error(grid.points, grid.triangles, field,
                           lambda x, y: slab.first_order(x, ACCEPTOR.supply, kappa, **_sides(film))[0])
    return {"C": exact, "taken up": abs(taken / effectiveness - 1)}


def _first_order_profile(modulus: float, film: float) -> Profile:
    grid, field, _ = _at_rest(SIZES[-1], 0, _kappa(modulus) * LARGE, LARGE, film)
    x = np.linspace(-SLAB - film, SLAB + film, 121)
    exact = slab.first_order(x, ACCEPTOR.supply, _kappa(modulus), **_sides(film))[0]
    return _curves(_titled(modulus, film), x, along(grid, field, x), exact)


DEPTH, LIMIT, LEAST = 20.0, (0.3, 0.1, 0.03, 0.01), 1e-3


@case("transport-zero-order-slab", kind="exact",
      norm="L2 of C over the mesh, relative; depth = what enters a side over s, relative; several meshes a size",
      claim="Where half saturation is small against the supply, uptake s goes on at its full rate down to the depth of "
            "penetration sqrt(2 D C_s / s), or that of its films, and nothing is left beyond; on the way there the "
            "slab follows Monod's first integral",
      mutants=("reaction-in-the-fluid", "decay-demand"), slow=True)
def zero_order() -> Outcome:
    rows = [(0.1, 0.0, 3e-4, 4e-5), (0.03, 0.0, 4e-4, 4e-5), (0.01, FILM, 1e-4, 3e-5)]
    studies = [part for half_saturation, film, *ceilings in rows for part in _monod(half_saturation, film, ceilings)]
    return Outcome((*_exhausted(0.0), *_exhausted(FILM)), (*studies, *_limit()),
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


def _monod_errors(size: float, sample: int, half_saturation: float, film: float) -> dict[str, float]:
    grid, field, flux = _at_rest(size, sample, _sink(film), half_saturation, film)

    def exact(x):
        return slab.monod(x, ACCEPTOR.supply, _sink(film), half_saturation, **_sides(film))

    return {"C": norms.l2_error(grid.points, grid.triangles, field, lambda x, y: exact(x)[0]),
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
    grid, field, flux = _at_rest(SIZES[-1], 0, sink, half_saturation, 0.0)
    depth = slab.penetration(ACCEPTOR.supply, sink, ACCEPTOR.diffusivity_in_aggregate)
    return (norms.l2_error(grid.points, grid.triangles, field,
                           lambda x, y: slab.zero_order(x, ACCEPTOR.supply, sink, **_sides(0.0))),
            abs(_depth(flux, sink) / depth - 1))


def _exhausted(film: float):
    """What is left beyond the depth of penetration."""
    grid, field, _ = _at_rest(SIZES[-2], 0, _sink(film), LEAST, film)
    beyond = np.abs(grid.points[:, 0]) < SLAB - DEPTH - 4 * SIZES[-2]
    title = f"K = {LEAST:g} mg/L, " + (f"films of {film:g} um" if film else "no films")
    return [at_most(f"C beyond the depth of penetration, {title}, over the supply",
                    field[beyond].max() / ACCEPTOR.supply, 1e-8, "falls by h^2 s / (D K), 20 or more, an element"),
            at_most(f"least C, {title}, over the supply", field.min() / ACCEPTOR.supply, 1e-8, "C >= 0 (trap 1)")]


def _depth_profile(film: float) -> Profile:
    grid, field, _ = _at_rest(SIZES[-1], 0, _sink(film), LIMIT[-1], film)
    x = np.linspace(-SLAB - film, SLAB + film, 121)
    given = {"x": x, "supply": ACCEPTOR.supply, "sink": _sink(film), **_sides(film)}
    curves = (("ours", "ours", x, along(grid, field, x)),
              ("Monod, closed form", "reference", x, slab.monod(half_saturation=LIMIT[-1], **given)[0]),
              ("zero order", "exact", x, slab.zero_order(**given)))
    return Profile(f"K = {LIMIT[-1]:g} mg/L" + (", films" if film else ""), "x (um)", "C (mg/L)", curves)
