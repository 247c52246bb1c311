"""Active and inert biomass, X_A and X_I ((9)-(10), (28)-(34)): masses at the reaction's points.

A mass stays with its material when the aggregate changes its shape: that is (34), X'_i = X_i S_i /
S'_i with the lumped areas S of linear elements, at the nodes; and the same at every quadrature
point with those of higher order. Densities are masses over the points' weights (um2). Uptake and
growth see the same masses in the same points, so that

    biomass made = Y donor - (acceptor - F donor) / d_c

of what is taken up, in every point and so in all. A new mesh gets the masses by a transfer that
conserves their sum, or by the paper's interpolation, which does not [E8].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from repro.fem import elements, transfer
from repro.fem.space import Space
from repro.fem.transfer import Located
from repro.model.kinetics import RateLaw, Sink
from repro.model.transport import Concentrations

Amounts: TypeAlias = tuple[np.ndarray, ...]

#: Of densities at the nodes of straight triangles, by the names that scenes have for them.
TRANSFERS = {"conserving": transfer.project, "bounded": transfer.project_bounded,
             "linear": transfer.interpolated}


@dataclass(frozen=True, eq=False)
class Rates:
    """Growth of active biomass F3 / X_A and gain of inert biomass F4 / X_A, (r, q) 1/h."""

    growth: np.ndarray
    remains: np.ndarray

    @property
    def total(self) -> np.ndarray:
        """Of both, per active biomass."""
        return self.growth + self.remains


def rates(space: Space, state: Concentrations, law: RateLaw) -> Rates:
    """The rates (9)-(10) at the points of the reaction."""
    pieces = space.reaction
    both = np.stack([state.acceptor, state.donor])
    acceptor, donor = both[:, pieces.cells] @ pieces.values.T
    return Rates(law.growth_rate(acceptor, donor), law.inert_rate(acceptor))


def change(first: Rates, second: Rates, weight: np.ndarray) -> float:
    """Mean over the aggregate, by the points' weights (r, q), of how much two rates differ, 1/h."""
    return float(np.vdot(weight, np.abs(second.total - first.total)) / weight.sum())


def sink(active: np.ndarray | None, duration: float = 0.0) -> Sink | None:
    """What takes up substrates: active masses (r, q), None without biomass; over a duration (h)."""
    return None if active is None else Sink(active, duration)


def at_nodes(space: Space, field: np.ndarray) -> np.ndarray:
    """(N,) at the mesh's nodes of a field (r, q) in the points of the reaction, zero where there is
    no biomass: the mean of what the triangles around a node fit to theirs, linear in each; with
    lumping the nodal values themselves."""
    mesh = space.mesh
    pieces = space.reaction
    found = np.zeros(len(mesh.points))
    if space.order == 1:
        found[pieces.cells[:, 0]] = field[:, 0]
        return mesh.with_middles(found[: mesh.corners])
    fitted = field @ _fit(space).T
    cells = mesh.cells[mesh.biomass]
    count = np.bincount(cells.ravel(), minlength=len(found))
    summed = np.bincount(cells.ravel(), fitted.ravel(), len(found))
    return np.divide(summed, count, out=found, where=count > 0)


def at_points(space: Space, nodal: np.ndarray) -> np.ndarray:
    """(r, q) in the points of the reaction of a field (N,) at the mesh's nodes."""
    mesh = space.mesh
    if space.order == 1:
        return nodal[space.reaction.cells]
    return nodal[mesh.cells[mesh.biomass]] @ elements.values_on(mesh.geometry, space.table).T


def _fit(space: Space) -> np.ndarray:
    """(g, q) from values at a triangle's points to those of their linear least-squares fit at its
    nodes."""
    nodes = elements.values(1, elements.nodes(space.mesh.geometry))
    return nodes @ elements.linear_fit(space.table)


def carried(how: str, old: Space, new: Space, at: Located, amounts: Amounts,
            density: float) -> Amounts:
    """Amounts (r, q) on a new mesh: active and inert masses, and others of the same material.

    how: "conserving", "bounded" or "linear", for linear elements; at: the new mesh's aggregate in
    the old one; density: X_m, mg/L. With higher orders the new mesh's masses are X_m all together,
    so that what the constraint leaves of J - theta within a triangle is worked off, and each amount
    keeps its share of them and its sum.
    """
    if old.order == 1:
        return _linear(how, old, new, amounts)
    total = amounts[0] + amounts[1]
    shares = np.column_stack([at_nodes(old, amount / total) for amount in amounts[1:]])
    nodal = np.zeros((len(new.mesh.points), shares.shape[1]))
    nodal[new.mesh.body] = at.field(shares, old.mesh.cells[old.mesh.biomass], old.mesh.geometry)
    inside = [np.clip(at_points(new, column), 0.0, 1.0) for column in nodal.T]
    masses = density * new.reaction.dx
    inert = _conserved(inside[0], masses, amounts[1].sum())
    others = [_scaled(share * masses, amount.sum())
              for share, amount in zip(inside[1:], amounts[2:])]
    return (masses * (1 - inert), masses * inert, *others)


def _linear(how: str, old: Space, new: Space, amounts: Amounts) -> Amounts:
    """Densities at the nodes of straight triangles, by the chosen transfer."""
    nodes = old.reaction.cells[:, 0]
    there = new.reaction.cells[:, 0]
    densities = np.column_stack([amount[:, 0] / old.reaction.dx[:, 0] for amount in amounts])
    found = TRANSFERS[how](old.mesh.points[nodes], old.mesh.straight.topology.body_cells, densities,
                           new.mesh.points[there], new.mesh.straight.topology.body_cells)
    return tuple(column[:, None] * new.reaction.dx for column in found.T)


def _scaled(amount: np.ndarray, wanted: float) -> np.ndarray:
    """An amount (r, q) scaled to the sum ``wanted``; what is zero everywhere stays zero."""
    total = float(amount.sum())
    return amount * (wanted / total) if total > 0 else amount


def _conserved(share: np.ndarray, weight: np.ndarray, wanted: float) -> np.ndarray:
    """Shares (r, q) with the weighted sum ``wanted``: a multiple of share (1 - share) is added, so
    that they stay between zero and one."""
    room = float(np.vdot(weight, share * (1 - share)))
    lacking = wanted - float(np.vdot(weight, share))
    return share + lacking / room * share * (1 - share) if abs(lacking) < room else share
