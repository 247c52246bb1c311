"""C19: how far from the aggregate the pore must be meshed (3.1)."""

from __future__ import annotations

import numpy as np

from verification.claims import OF_SCHEME, Finding, at_most, claim
from verification.claims.levels import ALONE, BESIDE
from verification.claims.runs import BASE, scene
from verification.claims.states import full_biomass, half_disc, solution

RADII, PARTS = (5.0, 10.0, 20.0, 30.0), (0.25, 0.5, 1.0, 1.5)


@claim("C19", "3.1", "meshing to min(5 R, 1 W) from the aggregate suffices", about=OF_SCHEME, sizes=BESIDE, steps=ALONE,
       fixed="nothing moves in it")
def truncation() -> Finding:
    """Conductivity and effluents of half-discs of X_m meshed to parts of min(5 R, W), against the whole pore meshed.

    On meshes of half the default size, whose own error in the long clean part is a quarter.
    """
    said = scene(*BASE, "numerics.refinement=2")
    errors = {radius: _errors(said, radius) for radius in RADII}
    checks = tuple(at_most(f"largest error at min(5 R, W), R = {radius:g} um (%)", "suffices",
                           found[PARTS.index(1.0)].max(), 0.5, "0.5 %: as little as the time step is to matter")
                   for radius, found in errors.items())
    told = "; ".join(f"R = {radius:g} um: " + ", ".join(f"{part:g}: {'/'.join(f'{e:.2g}' for e in row)}"
                                                         for part, row in zip(PARTS, found))
                     for radius, found in errors.items())
    return Finding(checks, reason="what two unrelated meshes differ by is larger than the errors "
                   "around the smaller half-discs, so that their bars reach over the bound",
                   note="Errors (%) of conductivity/acceptor effluent/donor effluent at parts of min(5 R, W): "
                   f"{told}.")


def _errors(said, radius: float) -> np.ndarray:
    """(parts, 3) errors in percent at each distance."""
    distances = [part * min(5 * radius, said.pore.width) for part in PARTS]
    values = np.array([_numbers(said, radius, reach) for reach in (*distances, None)])
    return 100 * np.abs(values[:-1] / values[-1] - 1)


def _numbers(said, radius: float, reach: float | None) -> list[float]:
    """Conductivity and both effluents around a half-disc meshed to a distance (um)."""
    grid = half_disc(said, radius, reach)
    found = solution(said, grid, full_biomass(said, grid))
    return [found.flow.conductivity, *(flux.effluent for flux in found.fluxes)]
