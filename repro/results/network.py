"""A law for networks: the hydraulic resistance that an aggregate adds to a pore (section 5).

A network model knows the area A of the aggregate in a pore of width W and needs the pore's head
loss. Stokes flow is linear, so the mean velocity drops out; W is the only length, so areas count in
W^2. The rest depends on lambda and the shape, and is in a table,

    head loss = 12 nu u_ave / (g W^2) (L + r W),        r = r(A / W^2, lambda, spanned).

r is a length of empty pore, over W: it resists as much as the aggregate adds. Before the aggregate
spans the pore it is a half-disc on one wall, and r hardly depends on lambda while the film is wide.
After that r is nearly (lambda - 1) (A / W^2 - 0.4). A plug with straight ends has exactly
(lambda - 1) A / W^2; rounded ends let more water pass.

``python -m verification.network`` makes ``network.csv``. It has r of half-discs, and the mean r of
plugs that have grown. Its bounds are the least and the largest r of other grown shapes, in pores of
40 to 150 um at 0.5 to 6 m/d and W^2 / 2500 to 20 mg/L of both substrates, and of similar drawn
shapes: 1 % thinner or 3 % thicker than a half-disc, or leaning by 5 %.
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
    """Lengths of empty pore, over W, that resist as much as aggregates add.

    length: r; least, most: bounds of r for other shapes of the same area. All have the shape of the
    areas.
    """

    length: np.ndarray
    least: np.ndarray
    most: np.ndarray


def added_resistance(area: ArrayLike, width: ArrayLike, spanned: ArrayLike,
                     viscosity_ratio: float = 2000.0) -> AddedResistance:
    """Resistance that aggregates add to pores, as a length of empty pore over W.

    Parameters
    ----------
    area : array_like
        Areas of the aggregates, in any unit of area and of any shape.
    width : array_like
        Widths of the pores, in the square root of that unit. Its shape broadcasts with the areas.
    spanned : array_like of bool
        True if the aggregate touches both walls. Its shape broadcasts with the areas.
    viscosity_ratio : float
        Viscosity of the aggregates over that of water, lambda, without unit.

    Returns
    -------
    AddedResistance
        Arrays of the broadcast shape, without unit.

    Raises
    ------
    ValueError
        If a width is not positive, or area / width^2 or viscosity_ratio is outside the table: 0.004
        to 1.5 before contact, 1.6 to 4.5 after it, lambda 100 to 10 000. An empty pore is outside.

    Notes
    -----
    The head loss of a pore is 12 nu u_ave / (g W^2) (L + length W), with the viscous aggregate of
    2.1 and the paper's condition on its surface [E2], at least 1.5 W from the pore's ends.

    Examples
    --------
    >>> import repro
    >>> added = repro.added_resistance(500.0, 50.0, False)
    >>> bool(added.least <= added.length <= added.most)
    True
    """
    width = np.asarray(width, float)
    if not (width > 0).all():
        raise ValueError("added_resistance: width is not known; more than zero is accepted")
    share = np.asarray(area, float) / width**2
    share, spanned = np.broadcast_arrays(share, np.asarray(spanned, bool))
    results = np.empty((3, *share.shape))
    for kind in (False, True):
        is_kind = spanned == kind
        results[:, is_kind] = _law(kind, share[is_kind], viscosity_ratio)
    return AddedResistance(*results)


def known(spanned: bool) -> tuple[float, float]:
    """Return the least and the largest A / W^2 in the table."""
    shares, _, _ = _table(spanned)
    return float(shares[0]), float(shares[-1])


def _law(spanned: bool, share: np.ndarray, ratio: float) -> np.ndarray:
    """Interpolate (3, n) r and its bounds at A / W^2 (n,) for one kind of aggregate.

    Logarithms are interpolated: those of r by monotone cubics, those of its bounds over r linearly.
    """
    from scipy.interpolate import PchipInterpolator  # its import takes a quarter of a second

    shares, ratios, values = _table(spanned)
    _refuse("viscosity_ratio", np.array([ratio]), ratios, "an aggregate")
    _refuse("area / width^2", share, shares, KINDS[spanned])
    length, *bounds = PchipInterpolator(np.log(ratios), values, axis=1)(np.log(ratio))
    place, nodes = np.log(share), np.log(shares)
    length = PchipInterpolator(nodes, length)(place)
    return np.exp([length, *(length + np.interp(place, nodes, bound) for bound in bounds)])


def _refuse(name: str, values: np.ndarray, known: np.ndarray, kind: str) -> None:
    """Raise ValueError for values outside the table, and for not-a-number."""
    outside = values[~((values >= known[0]) & (values <= known[-1]))]
    if outside.size:
        raise ValueError(f"added_resistance: {name} = {outside.flat[0]:.6g} is not known for "
                         f"{kind}; {known[0]:.4g} to {known[-1]:.4g} is accepted")


@cache
def _table(spanned: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Read the table of one kind of aggregate.

    It has A / W^2 (m,), lambda (l,), and (3, l, m) the logarithms of r and of its bounds over r.
    """
    columns = read_table(TABLE)
    rows = columns["spanned"] == spanned
    ratios = np.unique(columns["viscosity_ratio"][rows])
    share, *values = (columns[name][rows].reshape(len(ratios), -1) for name in
                      ("area_over_width2", "added_length_over_width", "least", "most"))
    return share[0], ratios, np.log(values)
