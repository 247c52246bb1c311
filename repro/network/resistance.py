"""The resistance that an aggregate adds to a throat.

Stokes flow is linear, so the mean velocity drops out of the head loss; W is the only length, so
areas count in W^2. The rest depends on lambda and the shape, and is in a table,

    head loss = 12 nu u_ave / (g W^2) (L + r W),        r = r(A / W^2, lambda, spanned).

r is a length of empty pore, over W: it resists as much as the aggregate adds. Before the aggregate
spans the pore it is a half-disc on one wall, and r hardly depends on lambda while the film is wide.
After that r is nearly (lambda - 1) (A / W^2 - 0.4). A plug with straight ends has exactly
(lambda - 1) A / W^2; rounded ends let more water pass.

``resistance.csv`` has r of half-discs, and the mean r of plugs that have grown. Its bounds are the
least and the largest r of two kinds of shapes. Grown shapes are from pores of 40 to 150 um, at 0.5
to 6 m/d and W^2 / 2500 to 20 mg/L of both substrates. Drawn shapes are 1 % thinner or 3 % thicker
than a half-disc, or lean by 5 %.
"""

from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from repro.network.arguments import SHARE, Check, area_share
from repro.results import read_table

TABLE = Path(__file__).with_name("resistance.csv")
#: A / W^2 between which an aggregate may touch both walls or not. A film of 2 um closes under a
#: half-disc of 1.42 W^2 in a pore of 40 um, and of 1.53 W^2 in one of 150 um.
CONTACT = (1.41, 1.6)
#: r / A of a half-disc falls by this factor times its thickness over W, within 0.4 % between
#: thicknesses of 0.01 and 0.05 W, for lambda of 100 to 10 000.
THINNER = 1.25
#: A plug resists like one with straight ends that is shorter by this length, over W.
ROUNDED = 0.4
#: Per A / W^2 below 1.6, the lower bound of plugs falls by this part of r: contact surfaces that
#: have just formed are short. With 0.9, one of the fit's shapes was below it by 0.2 %.
EARLY = 1.25


class AddedResistance(NamedTuple):
    """Lengths of empty pore, over W, that resist as much as aggregates add.

    length: r; least, most: bounds of r for other shapes of the same area. All have the shape of the
    areas.
    """

    length: np.ndarray
    least: np.ndarray
    most: np.ndarray


def resistance(area: ArrayLike, width: ArrayLike, spanned: ArrayLike | None, ratio: float,
               outside: str = "raise", *, shapes: np.ndarray | None = None,
               largest: float = np.inf) -> AddedResistance:
    """Return the law; arguments as for :func:`repro.added_resistance`.

    shapes: (m, 3) grown shapes that r follows: whether they touch both walls, A / W^2 and r;
    largest: A / W^2 up to which it does.
    """
    ratios = _table(False).ratios
    Check("added_resistance", "raise").within("viscosity_ratio", ratio, ratios[0], ratios[-1])
    area, width = np.broadcast_arrays(np.asarray(area, float), np.asarray(width, float))
    share = area_share(area, width)
    touches = is_plug(share) if spanned is None else np.asarray(spanned, bool)
    share, width, touches = np.broadcast_arrays(share, width, touches)
    check = Check("added_resistance", outside)
    is_known = check.positive("width", width)
    (_, before), (_, after) = map(share_range, (False, True))
    if spanned is None:
        is_known = is_known & check.within(SHARE, share, 0.0, after)
    else:
        is_known = (is_known
                    & check.within(f"{SHARE} before contact (spanned=False)", share, 0.0, before,
                                   ~touches)
                    & check.within(f"{SHARE} of a plug (spanned=True)", share, CONTACT[0], after,
                                   touches))
    is_known &= check.within(SHARE, share, 0.0, largest)
    results = np.full((3, *share.shape), np.nan)
    for kind in (False, True):
        selected = is_known & (touches == kind)
        results[:, selected] = _law(kind, share[selected], ratio)
    if spanned is None:  # the area does not determine the kind everywhere
        either = (share >= CONTACT[0]) & (share <= CONTACT[1])
        kinds = [_law(kind, np.minimum(share[either], most), ratio)
                 for kind, most in ((False, before), (True, after))]
        results[1, either] = np.min(kinds, axis=0)[1]
        results[2, either] = np.max(kinds, axis=0)[2]
    if shapes is not None:
        factor = _of_shapes(shapes, touches, share, ratio)
        results *= np.stack([factor, np.minimum(factor, 1.0), np.maximum(factor, 1.0)])
    return AddedResistance(*results)


def _of_shapes(shapes: np.ndarray, touches: np.ndarray, share: np.ndarray,
               ratio: float) -> np.ndarray:
    """(...) r of shapes over that of the law, at A / W^2 (...); 1 if none is of the same kind."""
    factor = np.ones_like(share)
    for kind in (False, True):
        _, shares, lengths = shapes[shapes[:, 0] == kind].T
        law = resistance(shares, 1.0, np.full(len(shares), kind), ratio, "nan").length
        known = np.isfinite(law)
        if known.any():
            of_kind = np.interp(share, shares[known], lengths[known] / law[known])
            factor = np.where(touches == kind, of_kind, factor)
    return factor


def share_range(spanned: bool) -> tuple[float, float]:
    """Return the least and the largest A / W^2 in the table."""
    shares = _table(spanned).shares
    return float(shares[0]), float(shares[-1])


def is_plug(share: np.ndarray) -> np.ndarray:
    """Return where an aggregate of A / W^2 touches both walls, if the area decides."""
    return share > share_range(False)[1]


def _law(spanned: bool, share: np.ndarray, ratio: float) -> np.ndarray:
    """Interpolate (3, n) r and its bounds at A / W^2 (n,) for one kind of aggregate.

    Logarithms are interpolated: those of r by monotone cubics, those of its bounds over r linearly.
    Below the first area of the table, half-discs are in a shear flow, where r is proportional to
    the area; its profile is a parabola, which reduces r / A in proportion to the thickness. Plugs
    with less area have just touched both walls.
    """
    from scipy.interpolate import PchipInterpolator  # its import takes a quarter of a second

    table = _table(spanned)
    ratios, nodes = np.log(table.ratios), np.log(table.shares)
    length, *bounds = PchipInterpolator(ratios, table.logarithms, axis=1)(np.log(ratio))
    inside = np.maximum(share, table.shares[0])
    place = np.log(inside)
    length = PchipInterpolator(nodes, length)(place)
    rows = np.exp([length, *(length + np.interp(place, nodes, bound) for bound in bounds)])
    if not spanned:
        thickness, first = np.sqrt(2 * share / np.pi), np.sqrt(2 * inside / np.pi)
        return rows * (share / inside * (1 + THINNER * (first - thickness)))
    rows[1] *= 1 - EARLY * (inside - share)
    return rows * ((share - ROUNDED) / (inside - ROUNDED))


class Table(NamedTuple):
    """The table of one kind of aggregate.

    shares: (m,) A / W^2; ratios: (l,) lambda; logarithms: (3, l, m) those of r and of its bounds
    over r.
    """

    shares: np.ndarray
    ratios: np.ndarray
    logarithms: np.ndarray


@cache
def _table(spanned: bool) -> Table:
    """Read the table of one kind of aggregate."""
    columns = read_table(TABLE)
    rows = columns["spanned"] == spanned
    ratios = np.unique(columns["viscosity_ratio"][rows])
    share, *values = (columns[name][rows].reshape(len(ratios), -1) for name in
                      ("area_over_width2", "added_length_over_width", "least", "most"))
    return Table(share[0], ratios, np.log(values))
