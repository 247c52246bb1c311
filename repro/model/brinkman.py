"""A permeable aggregate instead of a viscous one: Brinkman's drag, for quadratic velocities.

Biomass of permeability k adds its drag ``(u / k, v)`` to a(u, v) of :mod:`repro.model.flow`. Along
the interface and the walls the velocity changes within layers of thickness sqrt(k). A triangle of
biomass resolves the layer if its longest edge h is at most ``ACROSS`` sqrt(k). There this module
solves Brinkman's equation unchanged. In every larger triangle it widens the layer:

- **Thickness.** The relative viscosity becomes nu_r = d^2 / k, so that the layer is
  d = h / ``ACROSS`` thick. Darcy's flow u = -k grad p does not change: div u = 0 makes every
  component harmonic, and nu_r lap u = 0. Head loss and flux through the aggregate stay the same.
- **Walls.** Let U be the velocity beyond a layer on a wall. The layer reduces the flux along the
  wall by sqrt(k) U; the widened layer would reduce it by d U. Therefore the velocity slides on the
  wall against a friction (b u_x, v_x) with b = d / (sqrt(k) (d - sqrt(k))), which restores
  sqrt(k) U. Contact lines also belong to the fluid, so u = 0 there.

Both limits are exact. As h decreases, every triangle resolves its layer. As k decreases, the
velocity tends to a limit that does not depend on k.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from repro.fem import elements
from repro.fem.space import Space

#: Longest edge over the thickness of the layer. In one dimension a node overshoots if a quadratic
#: element is longer than 6.3 times the thickness of the layer.
ACROSS = 6.0


@dataclass(frozen=True, eq=False)
class Drag:
    """The terms that the drag of biomass of a permeability (um2) adds to the flow's system."""

    velocity: Space
    permeability: float

    @cached_property
    def thickness(self) -> np.ndarray:
        """(T,) um, thickness d of the layer in each triangle, at least sqrt(k)."""
        longest = np.linalg.norm(self.velocity.mesh.sides, axis=2).max(axis=1)
        return np.maximum(np.sqrt(self.permeability), longest / ACROSS)

    @cached_property
    def widened(self) -> np.ndarray:
        """(T,) True for biomass triangles in which the layer is widened."""
        return self.velocity.mesh.biomass & (self.thickness > np.sqrt(self.permeability))

    @property
    def viscosity(self) -> np.ndarray:
        """(T,) nu_r."""
        return np.where(self.widened, self.thickness**2 / self.permeability, 1.0)

    def constrained(self, no_slip: np.ndarray) -> np.ndarray:
        """(2n + m,) constrained unknowns: ``no_slip`` without u_x at wall nodes whose triangles are
        all widened.

        no_slip: (2n + m,) constrained unknowns with u = 0 on the walls.
        """
        dofs = self.velocity.dofs
        slides = np.zeros(len(no_slip), bool)
        slides[dofs.walls] = True
        slides[self.velocity.cells[~self.widened]] = False
        slides[dofs.inlet] = False
        return no_slip & ~slides

    def matrices(self) -> np.ndarray:
        """(T, 2k, 2k) element matrices of drag and of friction on the walls."""
        velocity = self.velocity
        k = velocity.cells.shape[1]
        drag = velocity.mesh.biomass / self.permeability
        blocks = np.zeros((len(drag), 2 * k, 2 * k))
        along = velocity.at.mass(drag[:, None] * velocity.at.dx)
        blocks[:, :k, :k] += along + self._friction()
        blocks[:, k:, k:] += along
        return blocks

    def _friction(self) -> np.ndarray:
        """(T, k, k) of (b u_x, v_x) on the wall sides of widened triangles."""
        velocity = self.velocity
        mesh = velocity.mesh
        blocks = np.zeros((len(mesh.cells), *2 * velocity.cells.shape[1:]))
        root = np.sqrt(self.permeability)
        no_slip = [wall for wall in mesh.walls if wall.no_slip]
        for wall, side in product(no_slip, range(3)):
            chosen = np.flatnonzero(self.widened & mesh.on_wall(wall, side))
            d = self.thickness[chosen]
            values, weights, along = elements.side_table(mesh.geometry, side)
            dx = np.abs(mesh.points[mesh.cells[chosen], 0] @ along.T) * weights
            products = values[:, :, None] * values[:, None, :]
            factor = d / (root * (d - root))
            blocks[chosen] += np.tensordot(factor[:, None] * dx, products, 1)
        return blocks
