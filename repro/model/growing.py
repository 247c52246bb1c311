"""The expansion theta that results from the growth of biomass (28)-(29)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from repro.model.pore import Pore


def compute_theta(previous: Pore, grown: Pore, maximum_density: float) -> tuple[np.ndarray, ...]:
    """Compute theta after growth from the increase of X_A + X_I over X_m, (28)-(29).

    Parameters
    ----------
    previous, grown : Pore
        The pore before and after growth, in the same geometry.
    maximum_density : float
        X_m, mg/L.

    Returns
    -------
    tuple of (t, q) float
        Expansion of each aggregate since t = 0. On curved triangles it grows with the mass at each
        point.
    """
    expansions = []
    for body, after, region in zip(previous.bodies, grown.bodies, previous.mesh.regions):
        before = body.active + body.inert
        total = after.active + after.inert
        gain = previous.space.integration.gain(region, before, total, maximum_density)
        expansions.append(body.theta * gain)
    return tuple(expansions)


def with_restarted_theta(pore: Pore, maximum_density: float) -> Pore:
    """The pore with theta = J times the density over X_m (mg/L), where growth is integrated.

    The density is the mean over the nodes of a straight triangle (29), or the value at each point
    of a curved triangle.
    """
    space = pore.space
    bodies = []
    for body, region in zip(pore.bodies, pore.mesh.regions):
        J = body.solid.strained(pore.mesh.points[region.nodes]).J
        dx = pore.of(region, space.reaction.dx)
        density = (body.active + body.inert) / dx / maximum_density
        theta = J * space.integration.to_growth_points(region, density)
        bodies.append(replace(body, theta=theta))
    return replace(pore, bodies=tuple(bodies))
