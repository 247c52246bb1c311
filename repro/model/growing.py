"""Growth of the biomass in a pore (9)-(10), and the expansion theta by which it grows (28)-(29)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from repro.fem.space import Space
from repro.model import kinetics
from repro.model.biomass import Rates
from repro.model.pore import Pore


def grow(pore: Pore, rates: Rates, duration: float) -> Pore:
    """Integrate (9)-(10) over a duration (h) at constant rates."""
    active, inert = kinetics.grow(pore.active, pore.inert, rates.growth, rates.remains, duration)
    return replace(pore, active=active, inert=inert)


def compute_theta(previous: Pore, grown: Pore, maximum_density: float) -> np.ndarray:
    """Compute theta after growth: (28)-(29), from the increase of X_A + X_I over X_m.

    Parameters
    ----------
    previous, grown : Pore
        The pore before and after growth, in the same geometry.
    maximum_density : float
        X_m, mg/L.

    Returns
    -------
    (t, q) float
        Expansion since t = 0. On curved triangles it grows with the mass at each point.
    """
    before = previous.active + previous.inert
    total = grown.active + grown.inert
    if previous.space.order > 1:
        return previous.theta * (total / before)
    more = (total - before) / previous.space.reaction.dx / maximum_density
    return previous.theta * (1 + at_growth_points(previous.space, more))


def restart_theta(pore: Pore, maximum_density: float) -> np.ndarray:
    """(t, q) J times the density over X_m (mg/L), in the points where growth is integrated: on
    straight triangles the mean density of their nodes (29), on curved ones that of each point."""
    J = pore.body.strained(pore.mesh.points[pore.mesh.body]).J
    density = (pore.active + pore.inert) / pore.space.reaction.dx / maximum_density
    return J * at_growth_points(pore.space, density)


def at_growth_points(space: Space, field: np.ndarray) -> np.ndarray:
    """(t, q) values at the points where growth is integrated, from a field (r, q) at the points of
    the reaction: the mean over the nodes of each straight triangle (29); on curved triangles the
    points are the same, and the field is returned unchanged."""
    if space.order > 1:
        return field
    return field[space.mesh.straight.topology.body_cells, 0].mean(axis=1, keepdims=True)
