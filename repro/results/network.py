"""A law for networks: what an aggregate adds to the hydraulic resistance of a pore (section 5).

A network model knows the area A of the aggregate in a pore of width W and asks for the pore's head
loss. Stokes flow is linear, so the mean velocity drops out; it has no length of its own, so W does;
and what is left of lambda and of the shape is in a table,

    head loss = 12 nu u_ave / (g W^2) (L + r W),        r = r(A / W^2, lambda, spanned),

r being the length of empty pore, over W, that resists as much as the aggregate adds. Until the pore
is spanned the aggregate is a half-disc on one wall, and r hardly depends on lambda while the film
is wide. Once it is spanned r is nearly (lambda - 1) (A / W^2 - 0.4): that of a plug with straight
ends, (lambda - 1) A / W^2 exactly, less what its rounded ends let pass.

``network.csv``, which ``python -m verification.network`` makes, has r on half-discs, and the mean
of plugs that growth has made. Its bounds are the least and the largest r of other shapes that
growth makes, in pores of 40 to 150 um at 0.5 to 6 m/d and W^2 / 2500 to 20 mg/L of both substrates,
and of drawn ones alike: thinner by 1 % or thicker by 3 % than a half-disc, or leaning by 5 %.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from repro.results import read_table

TABLE = Path(__file__).with_name("network.csv")
KINDS = ("a half-disc before contact (spanned=False)", "a plug (spanned=True)")


class AddedResistance(NamedTuple):
    """length: r, of empty pore that resists as much as the aggregate adds, over W; least, most: of
    shapes of the same area. All are shaped as the areas."""

    length: np.ndarray
    least: np.ndarray
    most: np.ndarray


def added_resistance(area: ArrayLike, width: ArrayLike, spanned: ArrayLike,
                     viscosity_ratio: float = 2000.0) -> AddedResistance:
    """What aggregates add to the resistance of pores, as a length of empty pore over W.

    area: of the aggregates; width: of the pores, in the root of that unit; spanned: does the
    aggregate touch both walls? Numbers, or arrays that broadcast. viscosity_ratio: lambda of all.
    The head loss of a pore is 12 nu u_ave / (g W^2) (L + length W), with the viscous aggregate of
    2.1 and the paper's condition on its surface [E2], 1.5 W or more from the pore's ends.

    Raises ValueError where a width is not above zero, or where area / width^2, for such an
    aggregate, or viscosity_ratio is outside the table (0.004 to 1.5 before contact, 1.6 to 4.5
    after it, lambda 100 to 10 000): an empty pore is not in it.
    """
    width = np.asarray(width, float)
    if not (width > 0).all():
        raise ValueError("added_resistance: width is not known; more than zero is accepted")
    share = np.asarray(area, float) / width**2
    share, spanned = np.broadcast_arrays(share, np.asarray(spanned, bool))
    found = np.empty((3, *share.shape))
    for kind in (False, True):
        here = spanned == kind
        found[:, here] = _law(kind, share[here], viscosity_ratio)
    return AddedResistance(*found)


def known(spanned: bool) -> tuple[float, float]:
    """The least and the largest A / W^2 that the law does not refuse."""
    shares, _, _ = _table(spanned)
    return float(shares[0]), float(shares[-1])


def _law(spanned: bool, share: np.ndarray, ratio: float) -> np.ndarray:
    """(3, n) r, the least and the most for A / W^2 (n,) of one kind of aggregate: in logarithms,
    r interpolated by monotone cubics, the bounds over r linearly."""
    from scipy.interpolate import PchipInterpolator  # a quarter of a second

    shares, ratios, values = _table(spanned)
    _refuse("viscosity_ratio", np.array([ratio]), ratios, "an aggregate")
    _refuse("area / width^2", share, shares, KINDS[spanned])
    length, *bounds = PchipInterpolator(np.log(ratios), values, axis=1)(np.log(ratio))
    place, nodes = np.log(share), np.log(shares)
    found = PchipInterpolator(nodes, length)(place)
    return np.exp([found, *(found + np.interp(place, nodes, bound) for bound in bounds)])


def _refuse(name: str, values: np.ndarray, known: np.ndarray, kind: str) -> None:
    """Raises ValueError for values outside those that are known, not-a-number too."""
    outside = values[~((values >= known[0]) & (values <= known[-1]))]
    if outside.size:
        raise ValueError(f"added_resistance: {name} = {outside.flat[0]:.6g} is not known for "
                         f"{kind}; {known[0]:.4g} to {known[-1]:.4g} is accepted")


@cache
def _table(spanned: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A / W^2 (m,), lambda (l,), and the logarithms of r and of its bounds over r (3, l, m) of one
    kind of aggregate."""
    columns = read_table(TABLE)
    rows = columns["spanned"] == spanned
    ratios = np.unique(columns["viscosity_ratio"][rows])
    share, *values = (columns[name][rows].reshape(len(ratios), -1) for name in
                      ("area_over_width2", "added_length_over_width", "least", "most"))
    return share[0], ratios, np.log(values)
