"""C09, C18: times that follow from Table 1 alone, and those of the run."""

from __future__ import annotations

from math import log

from repro.model.kinetics import growth_rate
from verification.claims import ARITHMETIC, Finding, at_least, at_most, between, claim, printed
from verification.claims.runs import BASE, at, scene

SECONDS = 3600.0
#: Concentration that stands for saturation, mg/L.
ENDLESS = 1e12


@claim("C09", "4", "doubling time about 3 h; decay half-time about 5.8 d")
def doubling() -> Finding:
    """Doubling time of base's aggregate, mean over 19.2 h, and of a seed at the supply; ln 2 / b."""
    said, row = scene(*BASE), at(BASE, 19.2)
    supply, half = said.substrates.acceptor.supply, log(2) / said.kinetics.decay_coefficient / 24
    mean = row["time_h"] * log(2) / log(row["aggregate_area_um2"] / at(BASE, 0.0)["aggregate_area_um2"])
    fastest, endless = (_doubling_time(said, value, value) for value in (supply, ENDLESS))
    checks = (printed("doubling time of base's aggregate, mean to 19.2 h (h)", "~3", mean, input="doubling"),
              printed("doubling time at the supply of 10 K_s (h)", "~3", fastest, rests_on=ARITHMETIC,
                      input="doubling_at_supply"),
              printed("decay half-time (d)", "~5.8", half, rests_on=ARITHMETIC))
    reason = (f"{endless:.2f} h is the doubling time at saturation, C without bound; at the supply of 10 K_s, which "
              f"nothing in base exceeds, it is {fastest:.2f} h, and base doubles every {mean:.2f} h")
    return Finding(checks, reason=reason)


def _doubling_time(said, acceptor: float, donor: float) -> float:
    """ln 2 / (F3 / X_A), h."""
    return log(2) / float(growth_rate(acceptor, donor, said.substrates, said.kinetics))


@claim("C18", "1", "within a 600 um pore: flow << 1 s, advection a few seconds, diffusion of the order of minutes, "
       "growth hours")
def time_scales() -> Finding:
    """W^2 / nu, L / u_ave, L^2 / D of both substrates, and the doubling time at the supply."""
    said = scene(*BASE)
    viscous, advection, diffusion, growth = _scales(said)
    apart = min(advection / viscous, growth * 60 / max(diffusion))
    tenfold = "of the order: one to ten of the unit"
    checks = (at_most("flow, W^2 / nu (s)", "<< 1", viscous, 0.1, "much less: a tenth"),
              between("advection, L / u_ave at t = 0 (s)", "a few", advection, 2, 10, "a few: two to ten"),
              *(between(f"diffusion of the {name}, L^2 / D (min)", "order of minutes", value, 1, 10, tenfold)
                for name, value in zip(("acceptor", "donor"), diffusion)),
              between("growth, doubling time at the supply (h)", "hours", growth, 1, 10, tenfold),
              at_least("substrates over flow, growth over substrates (times)", "sequential", apart, 10,
                       "an order of magnitude, of both ratios"))
    slow = advection * at(BASE, 0.0)["mean_velocity_m_per_d"] / at(BASE, 19.2)["mean_velocity_m_per_d"]
    reason = (f"over 600 um at the paper's own 2.9 m/d it is {advection:.0f} s, {advection / 1.5:.0f} s on the axis of "
              f"the pore, and {slow:.0f} s at the velocity of 19.2 h; {advection / 6:.0f} s are what it takes over 100 "
              f"um. The order of the scales, which the sequential coupling needs, holds")
    across = SECONDS * said.pore.width**2 / said.substrates.donor.diffusivity
    return Finding(checks, reason=reason, note=f"Diffusion across the pore, W^2 / D of the donor: {across:.1f} s.")


def _scales(said) -> tuple[float, float, tuple[float, float], float]:
    """Flow (s), advection at t = 0 (s), diffusion of acceptor and donor (min), growth at the supply (h)."""
    kinds = said.substrates.acceptor, said.substrates.donor
    speed = at(BASE, 0.0)["mean_velocity_m_per_d"] / 24e-6
    diffusion = tuple(60 * said.pore.length**2 / s.diffusivity for s in kinds)
    return (SECONDS * said.pore.width**2 / said.flow.kinematic_viscosity, SECONDS * said.pore.length / speed, diffusion,
            _doubling_time(said, *(s.supply for s in kinds)))
