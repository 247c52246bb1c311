"""C30, C32, C33: substrates and stresses in the aggregate, over base and wide."""

from __future__ import annotations

import numpy as np

from verification.claims import Finding, at_least, at_most, between, claim
from verification.claims.accuracy import FEW, FEW_WORDS
from verification.claims.levels import TOLD, WIDE_FINE, at_level
from verification.claims.restored import Body, bodies, body, equivalent, in_plane, polygon, stress
from verification.claims.runs import BASE, WIDE, at, scene, series

PLOTTED = 19.2
SUBSTRATES = ("acceptor", "donor")


def least(run: tuple[str, ...], name: str) -> np.ndarray:
    """(rows,) smallest concentration of a substrate in the aggregate over K_s."""
    half = getattr(scene(*run).substrates, name).half_saturation
    return np.array([found.node(f"{name}_mg_per_L")[found.grid.body].min() for found in bodies(run)]) / half


@claim("C30", "2.2", "oxygen is always present", fine=WIDE_FINE)
def oxygen() -> Finding:
    """Smallest C_A in the aggregate over K_s, in every row of base and wide.

    The paper says it of decay, which (9)-(10) let go on in proportion to m_A = C_A / (C_A + K_s). Present is so taken
    as m_A >= 1/2, that is C_A >= K_s: decay then has at least half of the rate that it has with plenty of oxygen.
    """
    base, wide, why = least(BASE, "acceptor"), least(WIDE, "acceptor"), "m_A >= 1/2: decay at half its rate, at least"
    checks = (at_least("base: smallest C_A / K_s", "present", base.min(), 1.0, why),
              at_least("wide: smallest C_A / K_s", "present", wide.min(), 1.0, why),
              at_least("the smaller of both", "present", min(base.min(), wide.min()), np.finfo(float).tiny, "not zero"))
    hours, last = series(*WIDE)["time_h"], bodies(WIDE)[-1]
    since = hours[wide < 1][0] if (wide < 1).any() else np.inf
    reason = ("it holds in base; in wide, whose supply of 10 K_s is assumed, the front takes all the oxygen: behind it "
              f"C_A falls under K_s at {since:g} h and to {wide.min():.1g} K_s at {hours[wide.argmin()]:g} h, where it "
              f"is not zero, but {share_under(last, 1.0):.0f} % of the biomass has less than K_s and "
              f"{share_under(last, 0.1):.0f} % less than K_s / 10, and hardly decays any more")
    lost = 100 * (1 - np.exp(-scene(*WIDE).kinetics.decay_coefficient * max(hours[-1] - since, 0.0)))
    return Finding(checks, reason=reason, note="What that leaves out is small: decay at its full rate b since then "
                   f"would have taken {lost:.1f} % of that biomass, at most.")


def share_under(found: Body, bound: float) -> float:
    """Percentage of the active biomass at nodes with C_A under a bound (mg/L)."""
    pieces, acceptor = found.pore.space.reaction, found.solved.concentrations.acceptor
    under = acceptor[pieces.cells] @ pieces.values.T < bound
    return 100 * float(found.pore.active[under].sum() / found.pore.active.sum())


#: Base goes on past the paper's end, to see until when it is fully penetrated.
LONGER = ("base", 'growth.end="22 h"', "output.times=[" + ", ".join(f'"{hour} h"' for hour in range(1, 23)) + "]")
#: C >> K_s, as the zero order of section 4 needs it: uptake within a tenth of its most.
ZERO_ORDER = 9.0


@claim("C33", "4", "Base is fully penetrated, C >> K_s")
def penetrated() -> Finding:
    """Slowest over fastest uptake in the aggregate of base, and smallest C / K_s, until 19.2 h.

    Fully penetrated: uptake is nowhere more than a tenth slower than elsewhere. C >> K_s is what the paper concludes
    zero order from (C15), so that m is within a tenth of one: 9 K_s.
    """
    until = series(*BASE)["time_h"] <= PLOTTED + 1e-6
    lowest = {name: least(BASE, name)[until].min() for name in SUBSTRATES}
    checks = (at_least("19.2 h: slowest over fastest uptake in the aggregate", "fully penetrated",
                       evenness(body(BASE, PLOTTED)), 0.9, "within a tenth"),
              *(at_least(f"until 19.2 h: smallest concentration of the {name} (K_s)", ">> 1", lowest[name],
                         ZERO_ORDER, "m within a tenth of one, the zero order of C15", date="2026-11-22")
                for name in SUBSTRATES))
    reason = (f"it is fully penetrated, uptake is even; but at {lowest['acceptor']:.2g} K_s of acceptor uptake has "
              "fallen well below its most, as it must for the effluents printed, and C15 shows what that does")
    return Finding(checks, reason=reason, note=_until_when)


def _until_when() -> str:
    """Penetration of the longer run, in words."""
    with at_level(TOLD):
        hours, acceptor = series(*LONGER)["time_h"], least(LONGER, "acceptor")
        even = hours[[evenness(found) >= 0.9 for found in bodies(LONGER)]][-1]
    told = ", ".join(f"{bound} K_s until {float(np.interp(-bound, -acceptor, hours)):.1f} h"
                     for bound in (9, 6, 4, 3, 2, 1) if acceptor[-1] < bound)
    return (f"Until when, in a run to {hours[-1]:g} h: the acceptor has at least {told}; in whole hours, uptake is "
            f"even to a tenth until {even:g} h.")


def evenness(found: Body) -> float:
    """Smallest over largest m_A m_D in the aggregate, with the K_s of base."""
    rate = 1.0
    for name in SUBSTRATES:
        field = found.node(f"{name}_mg_per_L")[found.grid.body]
        half = getattr(scene(*BASE).substrates, name).half_saturation
        rate = rate * field / (field + half)
    return float(rate.min() / rate.max())


#: New biomass born without stress.
FREE = 'growth.new_biomass="stress_free"'


@claim("C32", "5", "minor deformation stresses, so that how new biomass is born hardly matters", fine=WIDE_FINE)
def stresses() -> Finding:
    """Largest stresses over mu_L in every row of base and wide; both with stress-free new biomass.

    The in-plane shear stress, and the equivalent (von Mises) stress of the whole deviator. Minor: that of a strain of a
    few percent. Outlines are compared by the area that only one of the two covers. After contact both are means over
    the rows: a contact surface grows by whole edges, with which single rows jump, in either run at other times.
    """
    minor, why = 2 * FEW, f"minor: twice the modulus times a strain of {100 * FEW:g} %"
    found = {run[0]: peaks(run) for run in (BASE, WIDE)}
    kinds = ("in-plane shear stress / mu_L", "equivalent stress / mu_L",
             "in-plane shear stress / (mu_L theta^(-2/3))")
    checks = [at_most(f"{name}: {what}", "minor", value, minor, why) for name, triple in found.items()
              for what, value in zip(kinds, triple)]
    for run, times, when in ((BASE, (PLOTTED,), f"{PLOTTED:g} h"), (WIDE, after_contact(), "mean after contact")):
        label = f"{run[0]}, {when}, born stress-free"
        checks += [at_most(f"{label}: outlines apart (% of the area)", "not affected",
                           float(np.mean([apart(run, time) for time in times])), 100 * FEW, FEW_WORDS),
                   between(f"{label}: change of the conductivity (%)", "not affected", conductivity_change(run, times),
                           -100 * FEW, 100 * FEW, FEW_WORDS)]
    uniform = 2.5 ** (-5 / 3) * (2.5 - 1)
    reason = ("it hangs on the modulus: in the plane the stress is minor against mu_L, that of t = 0, and in base also "
              f"against that of the grown material, mu_L theta^(-2/3); in wide it reaches {found['wide'][2]:.2g} of "
              "the latter after contact. Across the plane it is minor against neither: plane strain keeps growth from "
              "expanding that way, and that alone makes the equivalent stress of uniform growth theta^(-5/3) "
              f"(theta - 1), {uniform:.3f} at its largest, for theta = 2.5. It does no work on the shape, and what the "
              "paper concludes from minor stresses holds")
    return Finding(tuple(checks), reason=reason)


def peaks(run: tuple[str, ...]) -> tuple[float, float, float]:
    """Largest in-plane shear and equivalent stress over mu_L, and largest in-plane shear stress over mu_L J^(-2/3), in
    all rows of a run."""
    modulus = scene(*run).growth.shear_modulus
    triples = [(in_plane(s).max(), equivalent(s).max(), (in_plane(s) * each.cell("J") ** (2 / 3)).max())
               for each in bodies(run) for s in (stress(each, modulus),)]
    return tuple(float(value) for value in np.max(triples, axis=0))


def apart(run: tuple[str, ...], time: float) -> float:
    """Area that only one of the outlines covers, with new biomass stressed and stress-free, in percent of the area."""
    ours, other = (polygon(body((*run, *more), time).outline) for more in ((), (FREE,)))
    return 100 * float(ours.symmetric_difference(other).area / ours.area)


def after_contact() -> tuple[float, ...]:
    """Times (h) of the rows of wide in which the aggregate touches the opposite wall, however new biomass is born."""
    rows, free = series(*WIDE), series(*WIDE, FREE)
    return tuple(map(float, rows["time_h"][(rows["contact"] == 1) & (free["contact"] == 1)]))


def conductivity_change(run: tuple[str, ...], times: tuple[float, ...]) -> float:
    """Change (%) of the conductivity when new biomass is born stress-free: geometric mean at some times (h)."""
    ours, other = ([at((*run, *more), time)["conductivity_m_per_d"] for time in times] for more in ((), (FREE,)))
    return 100 * float(np.exp(np.mean(np.log(other) - np.log(ours))) - 1)
