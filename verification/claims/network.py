"""C44: the pore as a part of a network."""

from __future__ import annotations

import numpy as np

from repro.results.network import added_resistance, known
from verification.claims import Finding, at_most, claim
from verification.claims.levels import WIDE_FINE
from verification.claims.permeability import clean
from verification.claims.runs import BASE, WIDE, scene, series

#: From this A / W^2 on, thicknesses of a quarter of W: what less of an aggregate adds is, in the scheme of 2001, under
#: the error of the empty channel.
LEAST = 0.1
INCORPORATED, BOUND = "can be incorporated", "one: the bound of the law, made of other runs and drawn shapes"


@claim("C44", "5", "the model of a pore can be incorporated into a network model", fine=WIDE_FINE)
def for_networks() -> Finding:
    """Added resistance of the aggregates of base and wide, which the law for networks has not seen, against it."""
    film, spanned = (beyond(WIDE, kind) for kind in (False, True))
    checks = tuple(at_most(f"{name}: largest ln(r / law's r) over that of the law's bound", INCORPORATED,
                           np.abs(values).max(), 1.0, BOUND)
                   for name, values in (("base", beyond(BASE, False)), ("wide before contact", film),
                                        ("wide after contact", spanned)))
    note = ("r is the length of empty pore, over W, that resists as much as the aggregate adds; all that a network "
            "must know of the pore is A / W^2, lambda and whether it is spanned: `repro.added_resistance`.")
    return Finding(checks, note=note, reason="the aggregate of these runs is not one of the shapes that the law knows")


def beyond(run: tuple[str, ...], spanned: bool) -> np.ndarray:
    """(n,) ln(r / law's r) of a run's rows in the law's range from LEAST on, over the ln of its bound on that side."""
    said, rows = scene(*run), series(*run)
    width = said.pore.width
    low, high = known(spanned)
    share = rows["aggregate_area_um2"] / width**2
    here = (rows["contact"] == spanned) & (share >= max(low, LEAST)) & (share <= high)
    resisted = 24e-6 * clean(said) / rows["conductivity_m_per_d"][here] - 1
    law, least, most = np.log(added_resistance(share[here], 1.0, spanned, said.flow.viscosity_ratio))
    apart = np.log(resisted * said.pore.length / width) - law
    return apart / np.where(apart < 0, law - least, most - law)
