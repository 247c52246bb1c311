"""C10-C12: where the aggregate grows, in `base` while it is fully penetrated and in `wide` once it spans the pore."""

from __future__ import annotations

import numpy as np
import shapely

from repro.model import biomass
from repro.model.pore import Pore, Solved
from verification.claims import Finding, at_least, at_most, between, claim, without_limit
from verification.claims.accuracy import FEW, FEW_WORDS
from verification.claims.levels import WIDE_FINE
from verification.claims.restored import Body, bodies, body, polygon, solved_pore
from verification.claims.runs import BASE, WIDE, around_contact, at, grown, scene

PLOTTED, END, LAST_HOURS = 19.2, 19.4, 5.0


def growth_rates(now: Pore, solved: Solved) -> np.ndarray:
    """(N,) (F3 + F4) / X_m, 1/h, at the mesh's nodes, zero in the fluid: how fast each place makes biomass."""
    rates = biomass.rates(now.space, solved.concentrations, solved.problem.substrates, solved.problem.kinetics)
    density = now.active / now.space.reaction.dx / solved.problem.kinetics.maximum_density
    return biomass.at_nodes(now.space, density * rates.total)


@claim("C10", "4, Plate 1", "fastest growth on the upgradient side, slowest on the wall between centre and "
       "downgradient side")
def extremes() -> Finding:
    """Places of the largest and the smallest growth rate over the aggregate's nodes; x = 0 is the seed's centre."""
    now, solved = grown(BASE, PLOTTED)
    rate, grid = growth_rates(now, solved), now.mesh
    nodes = grid.body
    fast, slow = nodes[np.argmax(rate[nodes])], nodes[np.argmin(rate[nodes])]
    (x_fast, y_fast), (x_slow, y_slow) = grid.points[fast], grid.points[slow]
    first, last = now.boundary.upstream, now.boundary.downstream
    checks = (at_most("x of the fastest growth (um)", "upgradient side", x_fast, 0.0, "the words"),
              between("x of the slowest growth (um)", "centre to downgradient side", x_slow, 0.0, last, "the words"),
              between("y of the slowest growth (um)", "on the wall", y_slow, 0.0, 0.0, "the words"))
    note = (f"The aggregate reaches from {first:.1f} to {last:.1f} um; the rate is largest, {rate[fast]:.4f} 1/h, at "
            f"({x_fast:.1f}, {y_fast:.1f}), and smallest, {rate[slow]:.4f} 1/h, at ({x_slow:.1f}, {y_slow:.1f}). "
            "The place of an extreme is a node's, so that it has no bar but its range.")
    return Finding(tuple(map(without_limit, checks)), note=note)


@claim("C11", "4, Plate 2", "asymmetry minor while fully penetrated: a few percent")
def asymmetry() -> Finding:
    """Upstream against downstream half at 19.4 h: extents, growth rates, and expansion since t = 0, in percent."""
    row, after = at(BASE, END), body(BASE, END)
    before = Body(scene(*BASE), *grown(BASE, PLOTTED))
    rate = growth_rates(before.pore, before.solved)
    theta = (after.pore.theta * after.pore.body.at.dx).sum(axis=1) / after.pore.body.at.dx.sum(axis=1)
    compared = {"extent": (-row["upstream_um"], row["downstream_um"]),
                "growth rate": mean_rates(before, rate),
                "expansion since t = 0": [expansion(after, half) for half in sides(after)]}
    checks = tuple(at_most(f"{name}, upstream over downstream half (%)", "a few", 100 * abs(up / down - 1), 100 * FEW,
                           FEW_WORDS) for name, (up, down) in compared.items())
    fastest, slowest = (f(rate[before.grid.body]) for f in (max, min))
    note = (f"Point by point, growth is {100 * (fastest / slowest - 1):.1f} % faster where it is fastest than where it "
            f"is slowest; theta at 19.4 h lies between {theta.min():.2f} and {theta.max():.2f}; the smallest "
            f"concentrations are {row['acceptor_min_mg_per_L']:.2f} K_sA and {row['donor_min_mg_per_L']:.2f} K_sD.")
    return Finding(checks, note=note)


def sides(found: Body) -> tuple[np.ndarray, np.ndarray]:
    """(t,) biomass triangles upstream and downstream of the centre of the seed."""
    x = found.grid.points[found.grid.triangles[found.grid.biomass]].mean(axis=1)[:, 0]
    return x < 0, x > 0


def made(found: Body, rate: np.ndarray) -> list[float]:
    """Integrals of a rate (N,) over both sides, um2/h."""
    mean, area = rate[found.grid.triangles[found.grid.biomass]].mean(axis=1), found.areas[found.grid.biomass]
    return [float(area[half] @ mean[half]) for half in sides(found)]


def mean_rates(found: Body, rate: np.ndarray) -> list[float]:
    """Means of a rate (N,) over both sides."""
    area = found.areas[found.grid.biomass]
    return [total / float(area[half].sum()) for total, half in zip(made(found, rate), sides(found))]


def expansion(found: Body, half: np.ndarray) -> float:
    """Area of a side over the area that its material had at t = 0."""
    return float(found.areas[found.grid.biomass][half].sum() / found.pore.body.at.dx[half].sum())


@claim("C12", "4, Fig 6", "after the pore is spanned, growth is strongly asymmetric, on the upgradient side only",
       fine=WIDE_FINE)
def upgradient_only() -> Finding:
    """Share of the new area, and of the biomass made, upgradient of the seed's centre, at the end of `wide`."""
    last, end = bodies(WIDE)[-1], float(bodies(WIDE)[-1].pore.time)
    contact = float(around_contact(*WIDE)["time_h"][1])
    spanned = next(each for each in bodies(WIDE) if each.pore.time >= contact)
    late, since = (upgradient_share(first, last) for first in (body(WIDE, end - LAST_HOURS), spanned))
    up, down = made(last, growth_rates(*solved_pore(WIDE, end)))
    bound = "95 %, set beforehand"
    checks = (at_least("new area upgradient, last 5 h (%)", "only upgradient", 100 * late, 95, bound),
              at_least(f"biomass made upgradient, rate at {end:g} h (%)", "only upgradient", 100 * up / (up + down), 95,
                       bound))
    note = (f"Contact with the opposite wall comes at {contact:.2f} h; of the area that is new between "
            f"{spanned.pore.time:g} h and {end:g} h, {100 * since:.1f} % lies upgradient.")
    return Finding(checks, note=note)


def upgradient_share(first: Body, last: Body) -> float:
    """Share of the area covered at one time and not at an earlier one that lies at x < 0."""
    new = shapely.difference(polygon(last.outline), polygon(first.outline))
    return shapely.area(shapely.clip_by_rect(new, -1e6, -1e6, 0.0, 1e6)) / shapely.area(new)
