"""Active and inert biomass, X_A and X_I ((9)-(10), (28)-(34)): masses at the reaction's points.

A mass stays with its material when the aggregate changes its shape. At the nodes of linear elements
this is (34), X'_i = X_i S_i / S'_i with the lumped areas S. Quadratic elements apply (34) at every
quadrature point. A density is a mass over the weight (um2) of its point. Uptake and growth use the
same masses at the same points, so that

    biomass made = Y donor - (acceptor - F donor) / d_c

is valid at every point, and for the aggregate. On a new mesh the transfer of masses conserves their
sum, except for the paper's interpolation [E8].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from repro.errors import GrowthError, failing_as
from repro.fem import transfer
from repro.fem.space import Space
from repro.fem.transfer import Located
from repro.model import kinetics
from repro.model.kinetics import RateLaw
from repro.model.transport import Concentrations

if TYPE_CHECKING:
    from repro.model.pore import Pore

Amounts: TypeAlias = tuple[np.ndarray, ...]


@dataclass(frozen=True, eq=False)
class Rates:
    """Rates per active biomass, (r, q) 1/h.

    growth: F3 / X_A, of active biomass; remains: F4 / X_A, of inert biomass.
    """

    growth: np.ndarray
    remains: np.ndarray

    @property
    def total(self) -> np.ndarray:
        """(r, q) 1/h, rate of active plus inert biomass, per active biomass."""
        return self.growth + self.remains


def rates(space: Space, state: Concentrations, law: RateLaw) -> Rates:
    """The rates (9)-(10) at the points of the reaction."""
    pieces = space.reaction
    concentrations = state.fields[:, pieces.cells] @ pieces.values.T
    return Rates(law.growth_rate(*concentrations), law.inert_rate(*concentrations))


@failing_as(GrowthError)
def grow(pore: Pore, rates: Rates, duration: float) -> Pore:
    """Integrate (9)-(10) over a duration (h) at constant rates."""
    active, inert = kinetics.grow(pore.active, pore.inert, rates.growth, rates.remains, duration)
    return pore.with_masses(active, inert)


def change(first: Rates, second: Rates, weight: np.ndarray) -> float:
    """Mean difference (1/h) of two rates over the aggregates; zero without aggregates.

    weight: (r, q) um2, of the points.
    """
    if not weight.size:
        return 0.0
    return float(np.vdot(weight, np.abs(second.total - first.total)) / weight.sum())


def transfer_amounts(method: str, old: Space, new: Space, at: Located, amounts: Amounts,
                     masses: np.ndarray) -> Amounts:
    """Transfer masses of biomass to a new mesh.

    Parameters
    ----------
    method : {"projection", "interpolation", "shares"}
        Transfer of the scheme: of densities at the nodes of straight triangles, or of fractions of
        the biomass.
    old, new : Space
    at : Located
        The nodes of the new mesh's aggregate in the old mesh.
    amounts : tuple of (r, q) arrays
        Active and inert masses, then other amounts in the biomass, um2 mg/L.
    masses : (r, q) float
        Biomass at the new mesh's points at the density X_m, um2 mg/L.

    Returns
    -------
    tuple of (r, q) arrays
        The amounts at the new mesh's points.

    Notes
    -----
    With "shares" the biomass on the new mesh is ``masses``. This removes the error of J = theta
    within a triangle. Each amount keeps its fraction of the biomass, and its sum in each aggregate.
    """
    return TRANSFERS[method](old, new, at, amounts, masses)


def _inside(old: Space, new: Space, at: Located, amounts: Amounts, masses: np.ndarray) -> Amounts:
    """Transfer the fraction of inert biomass to smaller aggregates within the old ones. The new
    biomass is ``masses``."""
    inert = _shares(old, new, at, amounts[:2])[0] * masses
    return masses - inert, inert


def _by_shares(old: Space, new: Space, at: Located, amounts: Amounts,
               masses: np.ndarray) -> Amounts:
    """Transfer fractions of the biomass; the biomass on the new mesh is ``masses``."""
    inside = _shares(old, new, at, amounts)
    transferred = [np.zeros_like(masses) for _ in amounts]
    for before, after in zip(old.mesh.regions, new.mesh.regions):
        were = old.integration.rows(before)
        rows = new.integration.rows(after)
        inert, *rest = [share[rows] for share in inside]
        inert = _conserved(inert, masses[rows], amounts[1][were].sum())
        transferred[0][rows] = masses[rows] * (1 - inert)
        transferred[1][rows] = masses[rows] * inert
        for new_amount, share, amount in zip(transferred[2:], rest, amounts[2:]):
            new_amount[rows] = _scaled(share * masses[rows], amount[were].sum())
    return tuple(transferred)


def _shares(old: Space, new: Space, at: Located, amounts: Amounts) -> list[np.ndarray]:
    """Interpolate fractions of the biomass to the points of the new mesh.

    Returns one (r, q) for the inert mass, and one for each further amount.
    """
    total = amounts[0] + amounts[1]
    shares = np.column_stack([old.integration.to_nodes(amount / total)
                              for amount in amounts[1:]])
    nodal = new.mesh.from_body(at.field(shares, old.mesh.cells[old.mesh.biomass]))
    return [np.clip(new.integration.to_points(column), 0.0, 1.0) for column in nodal.T]


def _by_densities(carried: Callable[..., np.ndarray], old: Space, new: Space, at: Located,
                  amounts: Amounts, masses: np.ndarray) -> Amounts:
    """Transfer amounts as densities at the nodes of straight triangles.

    carried: function of :mod:`repro.fem.transfer`.
    """
    old_nodes = old.reaction.cells[:, 0]
    new_nodes = new.reaction.cells[:, 0]
    densities = np.column_stack([amount[:, 0] / old.reaction.dx[:, 0] for amount in amounts])
    projected = carried(
        old.mesh.points[old_nodes], old.mesh.straight.topology.body_cells, densities,
        new.mesh.points[new_nodes], new.mesh.straight.topology.body_cells)
    return tuple(column[:, None] * new.reaction.dx for column in projected.T)


def _scaled(amount: np.ndarray, total: float) -> np.ndarray:
    """An amount (r, q) scaled to the sum ``total``; an amount of zero stays zero."""
    present = float(amount.sum())
    return amount * (total / present) if present > 0 else amount


def _conserved(share: np.ndarray, weight: np.ndarray, total: float) -> np.ndarray:
    """Fractions (r, q) corrected to the weighted sum ``total``.

    The correction is a multiple of share (1 - share), so that fractions stay between zero and one.
    """
    room = float(np.vdot(weight, share * (1 - share)))
    deficit = total - float(np.vdot(weight, share))
    return share + deficit / room * share * (1 - share) if abs(deficit) < room else share


#: {transfer of the scheme: function}; "inside" is for erosion.
TRANSFERS: dict[str, Callable[..., Amounts]] = {
    "projection": partial(_by_densities, transfer.project),
    "interpolation": partial(_by_densities, transfer.interpolated),
    "shares": _by_shares,
    "inside": _inside,
}
