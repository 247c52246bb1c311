"""The expansion theta that results from the growth of biomass (28)-(29)."""

from __future__ import annotations

import numpy as np

from repro.fem.space import Space
from repro.model.pore import Pore


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
    return previous.theta * GAINS[previous.space.order](previous.space, before, total,
                                                        maximum_density)


def _gain_of_mass(space: Space, before: np.ndarray, total: np.ndarray,
                  maximum_density: float) -> np.ndarray:
    """(t, q) factor on theta: that of the mass at each point."""
    return total / before


def _gain_of_area(space: Space, before: np.ndarray, total: np.ndarray,
                  maximum_density: float) -> np.ndarray:
    """(t, 1) factor on theta, from the area that the new mass needs at X_m (mg/L)."""
    more = (total - before) / space.reaction.dx / maximum_density
    return 1 + space.integration.to_growth_points(more)


#: Growth of theta in a step, by the order of the functions.
GAINS = {1: _gain_of_area, 2: _gain_of_mass}


def restart_theta(pore: Pore, maximum_density: float) -> np.ndarray:
    """(t, q) J times the density over X_m (mg/L), in the points where growth is integrated: on
    straight triangles the mean density of their nodes (29), on curved ones that of each point."""
    J = pore.body.strained(pore.mesh.points[pore.mesh.body]).J
    density = (pore.active + pore.inert) / pore.space.reaction.dx / maximum_density
    return J * pore.space.integration.to_growth_points(density)
