"""C09, C18: times that follow from Table 1 alone, and those of the run."""

from __future__ import annotations

from math import log

from repro.model.kinetics import growth_rate
from verification.claims import Finding, at_least, at_most, between, claim, near
from verification.claims.runs import BASE, at, scene

SECONDS = 3600.0
#: Concentration that stands for saturation, mg/L.
ENDLESS = 1e12


@claim("C09", "4", "doubling time about 3 h; decay half-time about 5.8 d", "python -m verification.claims C09",
       words=(BASE,))
def doubling() -> Finding:
    """ln 2 over the net growth rate at saturation; ln 2 / b."""
    said = scene(*BASE)
    half = log(2) / said.kinetics.decay_coefficient / 24
    checks = (near("doubling time at saturation (h)", "~3", _doubling_time(said, ENDLESS, ENDLESS), 3, absolute=0.5,
                   why="half a unit of the digit printed"),
              near("decay half-time (d)", "~5.8", half, 5.8, absolute=0.05, why="half a unit of the last digit"))
    return Finding(checks, change=_at_saturation)


def _at_saturation() -> str:
    """Doubling times of base itself, in words."""
    said, first, row = scene(*BASE), at(BASE, 0.0), at(BASE, 19.2)
    supply = said.substrates.acceptor.supply
    slowest = _doubling_time(said, row["acceptor_min_mg_per_L"], row["donor_min_mg_per_L"])
    mean = row["time_h"] * log(2) / log(row["aggregate_area_um2"] / first["aggregate_area_um2"])
    return (f"the doubling time is the one at saturation, C >> K_s; at the supply of 10 K_s it is "
            f"{_doubling_time(said, supply, supply):.2f} h, at base's lowest concentrations of 19.2 h {slowest:.2f} h, "
            f"and the area of base doubles every {mean:.2f} h on average")


def _doubling_time(said, acceptor: float, donor: float) -> float:
    """ln 2 / (F3 / X_A), h."""
    return log(2) / float(growth_rate(acceptor, donor, said.substrates, said.kinetics))


@claim("C18", "1", "within a 600 um pore: flow << 1 s, advection a few seconds, diffusion of the order of minutes, "
       "growth hours", "python -m verification.claims C18", (BASE,))
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
