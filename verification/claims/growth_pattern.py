"""C10-C12: where the aggregate grows, in `base` while it is fully penetrated and in `wide` once it spans the pore."""

from __future__ import annotations

import numpy as np
import shapely

from verification.claims import Finding, at_least, at_most, between, claim
from verification.claims.accuracy import FEW, FEW_WORDS
from verification.claims.levels import WIDE_SIZES
from verification.claims.runs import BASE, PLATES, WIDE, at, before_expansion, fields_at, nearest, scene, series
from verification.claims.states import growth_rate, saved_mesh

END = 19.4


def grown_not_expanded():
    """Mesh and growth rate (F3 + F4) / X_m (N,) 1/h of Plate 1: t = 19.4 h before the expansion."""
    said, saved = scene(*PLATES), before_expansion(PLATES, END)
    return saved_mesh(saved, said.pore.width), growth_rate(said, saved)


@claim("C10", "4, Plate 1", "fastest growth on the upgradient side, slowest on the wall between centre and "
       "downgradient side", "python -m verification.claims C10", (PLATES,))
def extremes() -> Finding:
    """Places of the largest and the smallest growth rate over the aggregate's nodes; x = 0 is the seed's centre."""
    grid, rate = grown_not_expanded()
    body = grid.body
    fast, slow = body[np.argmax(rate[body])], body[np.argmin(rate[body])]
    (x_fast, y_fast), (x_slow, y_slow) = grid.points[fast], grid.points[slow]
    first, last = (f(grid.points[body, 0]) for f in (min, max))
    checks = (at_most("x of the fastest growth (um)", "upgradient side", x_fast, 0.0, "the words"),
              at_least("x of the slowest growth (um)", "centre to downgradient side", x_slow, 0.0, "the words"),
              between("y of the slowest growth (um)", "on the wall", y_slow, 0.0, 0.0, "the words"))
    note = (f"The aggregate reaches from {first:.1f} to {last:.1f} um; the rate is largest, {rate[fast]:.4f} 1/h, at "
            f"({x_fast:.1f}, {y_fast:.1f}), and smallest, {rate[slow]:.4f} 1/h, at ({x_slow:.1f}, {y_slow:.1f}).")
    return Finding(checks, note=note)


@claim("C11", "4, Plate 2", "asymmetry minor while fully penetrated: a few percent",
       "python -m verification.claims C11", (BASE, PLATES))
def asymmetry() -> Finding:
    """Upstream against downstream half at 19.4 h: extents, growth rates, and expansion since t = 0, in percent."""
    row, saved = at(BASE, END), fields_at(PLATES, END)
    before, rate = grown_not_expanded()
    after, theta = saved_mesh(saved, before.width), saved.cell_data_dict["theta"]["triangle"]
    compared = {"extent": (-row["upstream_um"], row["downstream_um"]),
                "growth rate": [made / area for made, area in zip(_made(before, rate), _areas(before))],
                "expansion since t = 0": [_expansion(after, theta, half) for half in _sides(after)]}
    checks = tuple(at_most(f"{name}, upstream over downstream half (%)", "a few", 100 * abs(up / down - 1), 100 * FEW,
                           FEW_WORDS) for name, (up, down) in compared.items())
    fastest, slowest = (f(rate[before.body]) for f in (max, min))
    note = (f"Point by point, growth is {100 * (fastest / slowest - 1):.1f} % faster where it is fastest than where it "
            f"is slowest; theta at 19.4 h lies between {theta[after.biomass].min():.2f} and "
            f"{theta[after.biomass].max():.2f}; the smallest concentrations are {row['acceptor_min_mg_per_L']:.2f} "
            f"K_sA and {row['donor_min_mg_per_L']:.2f} K_sD.")
    return Finding(checks, note=note)


def _sides(grid):
    """Biomass triangles (T,) upstream and downstream of the centre of the seed."""
    x = grid.points[grid.triangles].mean(axis=1)[:, 0]
    return grid.biomass & (x < 0), grid.biomass & (x > 0)


def _areas(grid) -> list[float]:
    """Areas of both sides, um2."""
    return [float(grid.areas[half].sum()) for half in _sides(grid)]


def _made(grid, rate: np.ndarray) -> list[float]:
    """Integrals of a rate (N,) over both sides."""
    mean = rate[grid.triangles].mean(axis=1)
    return [float(grid.areas[half] @ mean[half]) for half in _sides(grid)]


def _expansion(grid, theta: np.ndarray, half: np.ndarray) -> float:
    """Area of a side over the area that it had at t = 0."""
    return float(grid.areas[half].sum() / np.sum(grid.areas[half] / theta[half]))


@claim("C12", "4, Fig 6", "after the pore is spanned, growth is strongly asymmetric, on the upgradient side only",
       "python -m verification.claims C12", (WIDE,), sizes=WIDE_SIZES)
def upgradient_only() -> Finding:
    """Share of the new area, and of the biomass made, upgradient of the seed's centre, at the end of `wide`."""
    rows = series(*WIDE)
    end, contact = float(rows["time_h"][-1]), float(rows["time_h"][rows["contact"] == 1][0])
    late, since = (_upgradient_share(first, end) for first in (nearest(WIDE, end - 5), contact))
    saved = fields_at(WIDE, end)
    up, down = _made(_wide_mesh(end), growth_rate(scene(*WIDE), saved))
    bound = "95 %, set beforehand"
    checks = (at_least("new area upgradient, last 5 h (%)", "only upgradient", 100 * late, 95, bound),
              at_least(f"biomass made upgradient, rate at {end:g} h (%)", "only upgradient", 100 * up / (up + down), 95,
                       bound))
    note = (f"Contact with the opposite wall comes by {contact:g} h; of the area that is new between then and {end:g} "
            f"h, {100 * since:.1f} % lies upgradient.")
    return Finding(checks, note=note)


def _wide_mesh(time: float):
    """Mesh of `wide` at a time (h)."""
    return saved_mesh(fields_at(WIDE, time), scene(*WIDE).pore.width)


def _upgradient_share(first: float, last: float) -> float:
    """Share of the area covered at one time (h) and not at an earlier one that lies at x < 0."""
    before, after = (shapely.union_all(shapely.polygons(grid.points[grid.triangles[grid.biomass]]))
                     for grid in (_wide_mesh(first), _wide_mesh(last)))
    new = shapely.difference(after, before)
    return shapely.area(shapely.clip_by_rect(new, -1e6, -1e6, 0.0, 1e6)) / shapely.area(new)
