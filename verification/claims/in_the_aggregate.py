"""C30, C32, C33: substrates and stresses in the aggregate, over base and wide."""

from __future__ import annotations

import numpy as np
import shapely

from repro.fem.space import Space
from verification.claims import Finding, at_least, at_most, between, claim
from verification.claims.accuracy import FEW, FEW_WORDS
from verification.claims.levels import WIDE_SIZES
from verification.claims.restored import Body, bodies, body, equivalent, in_plane, stress
from verification.claims.runs import BASE, WIDE, at, scene, series

PLOTTED = 19.2
SUBSTRATES = ("acceptor", "donor")


def least(run: tuple[str, ...], name: str) -> np.ndarray:
    """(rows,) smallest concentration of a substrate in the aggregate over K_s."""
    half = getattr(scene(*run).substrates, name).half_saturation
    return np.array([found.node(f"{name}_mg_per_L")[found.grid.body].min() for found in bodies(run)]) / half


@claim("C30", "2.2", "oxygen is always present", "python -m verification.claims C30", (BASE, WIDE),
       sizes=WIDE_SIZES)
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
    reason = (f"in wide, whose supply of 10 K_s is assumed, the front takes all the oxygen: behind it C_A falls under "
              f"K_s at {since:g} h and to {wide.min():.1g} K_s at {hours[wide.argmin()]:g} h, where it is not zero, "
              f"but {share_under(last, 1.0):.0f} % of the biomass has less than K_s and {share_under(last, 0.1):.0f} % "
              "less than K_s / 10, and hardly decays any more")
    lost = 100 * (1 - np.exp(-scene(*WIDE).kinetics.decay_coefficient * max(hours[-1] - since, 0.0)))
    return Finding(checks, reason=reason, note="What that leaves out is small: decay at its full rate b since then "
                   f"would have taken {lost:.1f} % of that biomass, at most.")


def share_under(found: Body, bound: float) -> float:
    """Percentage of the active biomass at nodes with C_A under a bound (mg/L)."""
    mass = Space(found.grid, 1).lumped(found.grid.biomass) * found.node("active_biomass")
    return 100 * float(mass[found.node("acceptor_mg_per_L") < bound].sum() / mass.sum())


#: Base goes on past the paper's end, on a coarser mesh, to see until when it is fully penetrated.
LONGER = ("base", "numerics.refinement=0.5", 'growth.end="22 h"')


@claim("C33", "4", "Base is fully penetrated, C >> K_s", "python -m verification.claims C33", (BASE,), words=(LONGER,))
def penetrated() -> Finding:
    """Smallest C / K_s in the aggregate of base, slowest over fastest uptake in it; and until when, on a longer run.

    Fully penetrated: uptake is nowhere more than a tenth slower than elsewhere. The paper says C >> K_s of a state
    whose effluent acceptor is 4.19 K_s, from a supply of 10: >> is taken as 3 at least, 3/4 of the zero-order rate.
    """
    until = series(*BASE)["time_h"] <= PLOTTED + 1e-6
    checks = (at_least("19.2 h: slowest over fastest uptake in the aggregate", "fully penetrated",
                       evenness(body(BASE, PLOTTED)), 0.9, "within a tenth"),
              *(at_least(f"until 19.2 h: smallest concentration of the {name} (K_s)", ">> 1",
                         least(BASE, name)[until].min(), 3.0, "3/4 of the zero-order rate, at least")
                for name in SUBSTRATES))
    return Finding(checks, note=_until_when)


def _until_when() -> str:
    """Penetration of the longer run, in words."""
    hours, acceptor = series(*LONGER)["time_h"], least(LONGER, "acceptor")
    told = ", ".join(f"{bound} K_s until {hours[acceptor >= bound][-1]:g} h" for bound in (9, 6, 4, 3, 2, 1))
    even = hours[[evenness(found) >= 0.9 for found in bodies(LONGER)]][-1]
    return (f"Until when, on a coarser mesh to {hours[-1]:g} h: the acceptor has at least {told}; uptake is even to a "
            f"tenth until {even:g} h. In the strict sense, the zero-order rate to a tenth, that is 9 K_s, C >> K_s "
            "ends long before the instant that the paper shows.")


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


@claim("C32", "5", "minor deformation stresses, so that how new biomass is born hardly matters",
       "python -m verification.claims C32", (BASE, WIDE, (*BASE, FREE), (*WIDE, FREE)), sizes=WIDE_SIZES)
def stresses() -> Finding:
    """Largest stresses over mu_L in every row of base and wide; both with stress-free new biomass.

    The in-plane shear stress, and the equivalent (von Mises) stress of the whole deviator. Minor: that of a strain of a
    few percent. Outlines are compared by the area that only one of the two covers.
    """
    minor, why = 2 * FEW, f"minor: 2 mu_L times a strain of {100 * FEW:g} %"
    found = {run[0]: peaks(run) for run in (BASE, WIDE)}
    checks = [at_most(f"{name}: {what} / mu_L", "minor", value, minor, why) for name, pair in found.items()
              for what, value in zip(("in-plane shear stress", "equivalent stress"), pair)]
    for run, time in ((BASE, PLOTTED), (WIDE, float(series(*WIDE)["time_h"][-1]))):
        label = f"{run[0]}, {time:g} h, born stress-free"
        checks += [at_most(f"{label}: outlines apart (% of the area)", "not affected", apart(run, time),
                           100 * FEW, FEW_WORDS),
                   between(f"{label}: change of the conductivity (%)", "not affected", conductivity_change(run, time),
                           -100 * FEW, 100 * FEW, FEW_WORDS)]
    uniform = 2.5 ** (-5 / 3) * (2.5 - 1)
    reason = ("across the plane the stress is not minor: plane strain keeps growth from expanding that way, and that "
              f"alone makes the equivalent stress of uniform growth theta^(-5/3) (theta - 1), {uniform:.3f} at its "
              "largest, for theta = 2.5. It does no work on the shape, and what the paper concludes from minor "
              "stresses holds")
    return Finding(tuple(checks), reason=reason, note=f"In wide the in-plane shear stress reaches "
                   f"{relative_peak(WIDE):.2g} of the local modulus mu_L theta^(-2/3) after contact: the shear strains "
                   "are large there, and small only in units of mu_L.")


def peaks(run: tuple[str, ...]) -> tuple[float, float]:
    """Largest in-plane shear and equivalent stress over mu_L, in all rows of a run."""
    found = [stress(each, scene(*run).growth.shear_modulus) for each in bodies(run)]
    return max(float(in_plane(s).max()) for s in found), max(float(equivalent(s).max()) for s in found)


def relative_peak(run: tuple[str, ...]) -> float:
    """Largest in-plane shear stress over mu_L J^(-2/3), in all rows of a run."""
    modulus = scene(*run).growth.shear_modulus
    return max(float((in_plane(stress(each, modulus)) * each.cell("J") ** (2 / 3)).max()) for each in bodies(run))


def apart(run: tuple[str, ...], time: float) -> float:
    """Area that only one of the outlines covers, with new biomass stressed and stress-free, in percent of the area."""
    ours, other = (shapely.Polygon(body((*run, *more), time).outline.points) for more in ((), (FREE,)))
    return 100 * float(ours.symmetric_difference(other).area / ours.area)


def conductivity_change(run: tuple[str, ...], time: float) -> float:
    """Change (%) of the conductivity when new biomass is born stress-free."""
    ours, other = (at((*run, *more), time)["conductivity_m_per_d"] for more in ((), (FREE,)))
    return 100 * (other / ours - 1)
