"""C45: what an aggregate takes up, beside layers that have its biomass.

A layer of uniform thickness covers a wall of the whole pore, or both of them half each. A section then mixes faster
than it is passed, W^2 / D against L / u, and the layer is thin, X q h^2 < D C, so that concentrations hang on x alone:

    u C' = D_mean C'' - X f q(C_A, C_D),     D_mean = (1 - f) D + f D_B,     f the share of the pore that is biomass

with (11) and (12): a strip crossed by plug flow, the pore itself (`reference.channel_bvp`). It does not tell one layer
from two. The model itself, with such a layer as its aggregate, is beside it, to tell what that leaves out.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from reference import channel_bvp
from repro.march import simulation
from repro.scene import Scene
from verification.claims import Finding, between, claim
from verification.claims.accuracy import FEW, FEW_WORDS
from verification.claims.discussed import REDUCED, filled_at
from verification.claims.levels import WIDE_FINE
from verification.claims.runs import WIDE, scene, series
from verification.problems.channels import pair, rates

NEW = "2026-11-22"
#: "Not crucial": a tenth, as what is small in C26.
NOT_CRUCIAL = 0.1
#: Of a layer in the model's pore, um: the distance of its ends from those of the pore.
MARGIN = 2.0


@claim("C45", "1", "continuous or patchy, the distinction is not crucial in modelling the consumption of substrates",
       fine=WIDE_FINE)
def not_crucial() -> Finding:
    """Acceptor taken up by the aggregate of wide over that of layers with its biomass, at the same mean velocity and
    supply, when it has reduced the conductivity to given parts; and of one layer in the model over the reference."""
    said, rows = scene(*WIDE), series(*WIDE)
    checks, told = [], []
    for reduced in REDUCED:
        part = filled_at(reduced)
        ours, other = aggregates_share(part), layers_share(said, part)
        checks.append(between(f"K / K_clean = {reduced:g}: acceptor taken up over that of layers", "not crucial",
                              ours / other, 1 - NOT_CRUCIAL, 1 + NOT_CRUCIAL, "not crucial: within a tenth", date=NEW))
        told.append(f"{100 * ours:.0f} % against {100 * other:.0f} % of the supply with {100 * part:.1f} % filled")
    part = filled_at(REDUCED[0])
    checks.append(between("layer on one wall, acceptor taken up in the model over the reference", "the same",
                          in_the_model(part) / layers_share(said, part), 1 - FEW, 1 + FEW, FEW_WORDS, date=NEW))
    reason = "an aggregate lets more of the supply pass than layers of the same biomass do: " + "; ".join(told)
    return Finding(tuple(checks), reason=reason, note="Acceptor taken up, the aggregate against layers: "
                   f"{'; '.join(told)}. At the end of wide the aggregate takes up "
                   f"{100 * shares(rows)[-1]:.1f} %.")


def shares(rows: dict[str, np.ndarray], supply: float = 10.0) -> np.ndarray:
    """(n,) parts of the acceptor supplied that an aggregate takes up, from the columns of its run."""
    return 1 - rows["effluent_acceptor_mg_per_L"] / supply


def aggregates_share(part: float) -> float:
    """Part of the acceptor supplied that the aggregate of wide takes up when it fills a part of the pore."""
    said, rows = scene(*WIDE), series(*WIDE)
    return float(np.interp(part, rows["aggregate_area_um2"] / (said.pore.width * said.pore.length), shares(rows)))


@cache
def layers_share(said: Scene, part: float, velocity: float = 2.9e6 / 24) -> float:
    """Part of the acceptor supplied that layers take up which fill a part of the pore, at a mean velocity (um/h)."""
    supply = tuple(each.supply for each in (said.substrates.acceptor, said.substrates.donor))
    water, inside = (np.array(pair(name, said.substrates)) for name in ("diffusivity", "diffusivity_in_aggregate"))
    mean = (1 - part) * water + part * inside
    found = channel_bvp.solution(velocity, supply, mean, mean, part * said.kinetics.maximum_density,
                                 rates(said.kinetics, said.substrates), said.pore.length)
    return 1 - float(found(np.array([said.pore.length]))[0, 0]) / supply[0]


def in_the_model(part: float) -> float:
    """The same of the model, one layer on the lower wall as its aggregate."""
    said = scene(*WIDE)
    height, end = part * said.pore.width, 0.5 * said.pore.length - MARGIN
    corners = ((-end, 0.0), (-end + MARGIN, height), (end - MARGIN, height), (end, 0.0))
    layer = simulation.shaped(scene(*WIDE, 'growth.end="0 h"', 'output.times=["0 h"]'), corners)
    found = next(simulation.simulate(layer))
    return 1 - found.solved.fluxes[0].effluent / said.substrates.acceptor.supply
