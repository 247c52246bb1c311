"""C01-C08: the numbers that section 4 prints for its run, `base`.

What it prints of effluents, uptake and inlet at 19.4 h is "before the aggregate expands" (Plate 1): the shape made at
19.2 h with what has grown in it since [E12]. The velocity, which does not see the density, is that of the same shape.
"""

from __future__ import annotations

import numpy as np

from repro.fem.transfer import interpolate
from repro.model.pore import Pore, Solved
from verification import sensitivity
from verification.claims import (
    CONSTRUCTION,
    OF_SCHEME,
    Finding,
    at_least,
    at_most,
    claim,
    printed,
    without_limit,
)
from verification.claims.runs import BASE, at, grown, scene, series

PLOTTED, END = 19.2, 19.4
SUPPLY = 10.0
SUBSTRATES = ("acceptor", "donor")
#: The paper's distances of the meshed inlet from the aggregate (um): its words; the least of 3.1; that of 210 um [E13].
DISTANCES = (60.0, 65.0, 75.0)


@claim("C01", "4", "mean velocity 2.9 m/d at t = 0")
def velocity_at_first() -> Finding:
    """Mean velocity in the seed's geometry under the head of 1e-3 cm."""
    return Finding((printed("mean velocity at t = 0 (m/d)", "2.9", at(BASE, 0.0)["mean_velocity_m_per_d"],
                            input="velocity_0"),))


@claim("C02", "4", "mean velocity 1.5 m/d at 19.4 h")
def velocity_at_last() -> Finding:
    """Mean velocity in the shape that the paper plots."""
    ours, after = (at(BASE, t)["mean_velocity_m_per_d"] for t in (PLOTTED, END))
    check = printed("mean velocity in the shape of 19.2 h (m/d)", "1.5", ours, input="velocity")
    return Finding((check,), note=f"After the expansion at 19.4 h: {after:.3f} m/d, {100 * (after / ours - 1):+.1f} %.")


@claim("C03", "4", "effluent acceptor 4.19 K_s, donor 6.13 K_s at 19.4 h")
def effluents() -> Finding:
    """Flow-weighted effluents of the state that the paper plots."""
    found = [flux.effluent for flux in grown(BASE, PLOTTED)[1].fluxes]
    checks = tuple(printed(f"effluent {name} (K_s)", text, value, input=f"effluent_{name}")
                   for name, text, value in zip(SUBSTRATES, ("4.19", "6.13"), found))
    plain, last = at(BASE, PLOTTED), at(BASE, END)
    told = "; ".join("{}: {} and {}".format(when, *(f"{row[f'effluent_{name}_mg_per_L']:.3f}" for name in SUBSTRATES))
                     for when, row in (("at 19.2 h", plain), ("after the expansion at 19.4 h", last)))
    ratio = (SUPPLY - found[0]) / (SUPPLY - found[1])
    reason = (f"with the printed inputs {found[0]:.3f} and {found[1]:.3f} leave; acceptor over donor consumed is "
              f"{ratio:.3f}, the printed effluents make it {(SUPPLY - 4.19) / (SUPPLY - 6.13):.3f}, less than F [E14]")
    return Finding(checks, reason=reason, rounding=sensitivity.verified_set,
                   note=f"{told}. With the paper's own 1.6 % its effluents are 4.257 and 6.228.")


@claim("C04", "4", "about 60 % of the influent acceptor is consumed by then")
def consumed_share() -> Finding:
    """Share of the supplied acceptor that does not leave."""
    share = 1 - grown(BASE, PLOTTED)[1].fluxes[0].effluent / SUPPLY
    return Finding((printed("acceptor consumed (%)", "~60", 100 * share, input="consumed",
                            why="half a unit of the one digit of ~60; the paper's own 4.19 gives 58.1"),))


@claim("C05", "4", '"donor" at the inlet of the meshed domain about 7 K_s, that is 60 um away')
def at_the_meshed_inlet() -> Finding:
    """Flow-weighted acceptor at the distances from the aggregate that the paper's words and rules give [E13]."""
    now, solved = grown(BASE, PLOTTED)
    means = {distance: upstream_means(now, solved, distance) for distance in DISTANCES}
    checks = tuple(printed(f"acceptor {distance:g} um from the aggregate (K_s)", "~7", pair[0],
                           input=f"acceptor_at_{distance:g}") for distance, pair in means.items())
    told = ", ".join(f"{pair[1]:.2f} at {distance:g} um" for distance, pair in means.items())
    change = f"the paper names the donor, but the number is the acceptor's [E9]: the donor is {told}"
    return Finding(checks, change=change, reason="it is not 7 K_s at every distance that may be meant")


def upstream_means(now: Pore, solved: Solved, distance: float) -> tuple[float, float]:
    """Flow-weighted C_A and C_D at a distance (um) upstream of the aggregate; beyond the mesh by (26)."""
    grid, problem = now.mesh, solved.problem
    x = now.boundary.upstream - distance
    height = np.linspace(0.0, grid.width, 201)
    where = np.column_stack([np.full_like(height, max(x, grid.ends[0])), height])
    state = solved.concentrations
    pair = np.column_stack([now.space.to_mesh(field) for field in (state.acceptor, state.donor)])
    found = interpolate(grid.points, grid.cells, pair, where)
    mean = np.trapezoid(6 * height[:, None] * (grid.width - height[:, None]) * found, height, axis=0) / grid.width**3
    beyond = min(x - grid.ends[0], 0.0)
    speed = solved.flow.mean_velocity
    return tuple(float(s.supply - (s.supply - m) * np.exp(speed * beyond / s.diffusivity))
                 for s, m in zip(problem.both, mean))


@claim("C06", "4", "inert remains under 0.5 % of the aggregate's mass at 19.4 h")
def inert_share() -> Finding:
    """Inert over total mass of the aggregate."""
    return Finding((at_most("inert fraction at 19.4 h (%)", "<0.5", 100 * at(BASE, END)["inert_fraction"], 0.5,
                            "the paper's bound", input="inert"),))


@claim("C07", "4, Fig 4", "initial meshed domain 110 um long", about=OF_SCHEME)
def first_length() -> Finding:
    """Meshed length around the seed: 2 (R + 10 R)."""
    return Finding((printed("meshed length at t = 0 (um)", "110", at(BASE, 0.0)["meshed_length_um"],
                            rests_on=CONSTRUCTION),))


@claim("C08", "4, Plate 2", "meshed domain 210 um long at 19.4 h", about=OF_SCHEME)
def last_length() -> Finding:
    """What the rules of 3.1 allow around our aggregate: between extension and generation. The length itself hangs on
    when the part was last regenerated, which has no limit as mesh and step are refined."""
    row, width = at(BASE, END), scene(*BASE).pore.width
    span = row["downstream_um"] - row["upstream_um"]
    low, high = (span + 2 * factor * width for factor in (1.3, 1.5))
    lengths, times = series(*BASE)["meshed_length_um"], series(*BASE)["time_h"]
    last = times[1:][np.diff(lengths) != 0][-1]
    note = (f"210 um is what the rule gives to an aggregate of half-width {0.5 * (210 - 3 * width):.0f} um at the "
            f"moment of a regeneration; ours, of {0.5 * span:.1f} um, was last regenerated at {last:g} h and is "
            f"{row['meshed_length_um']:.0f} um long.")
    checks = (at_most("least length that 3.1 allows at 19.4 h (um)", "210", low, 210.5,
                      "extended under 1.3 W from the aggregate", rests_on=CONSTRUCTION),
              at_least("largest length that 3.1 allows at 19.4 h (um)", "210", high, 209.5,
                       "generated at 1.5 W from the aggregate", rests_on=CONSTRUCTION))
    return Finding(tuple(map(without_limit, checks)), note=note, reason="not on every mesh, with every step")

