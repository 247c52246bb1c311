"""A permeable aggregate instead of a viscous one: Brinkman's drag, for quadratic velocities.

The biomass, of permeability k, adds its drag ``(u / k, v)`` to a(u, v) of :mod:`repro.model.flow`.
Along the interface and the walls the velocity changes within layers of thickness sqrt(k). A
triangle of biomass resolves its layer where its longest edge h is at most ``ACROSS`` sqrt(k). This
module solves Brinkman's equation unchanged there. In every larger triangle it widens the layer:

- **Thickness.** The viscosity over that of water becomes nu_r = d^2 / k, so that the layer is
  d = h / ``ACROSS`` thick. Darcy's flow u = -k grad p does not change: div u = 0 makes every
  component harmonic, and nu_r lap u = 0. Head loss and flux through the aggregate stay those of k.
- **Walls.** A layer on a wall takes sqrt(k) U from the flow along the wall, with U the flow beyond
  the layer; the widened one would take d U. Therefore the velocity slides on the wall against a
  friction (b u_x, v_x) with b = d / (sqrt(k) (d - sqrt(k))), which restores sqrt(k) U. On a
  contact line, which belongs to the fluid too, u = 0.

Both limits are exact: where h falls, every triangle resolves its layer; where k falls, the velocity
tends to one that does not depend on k.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from repro.fem import elements
from repro.fem.space import Space

#: Longest edge over the thickness of the layer. In one dimension a node overshoots where a
#: quadratic element is more than 6.3 times as long as the layer is thick.
ACROSS = 6.0


@dataclass(frozen=True, eq=False)
class Drag:
    """The terms that the drag of biomass of a permeability (um2) adds to the flow's system."""

    velocity: Space
    permeability: float

    @cached_property
    def thickness(self) -> np.ndarray:
        """(T,) um, thickness d of the layer as each triangle represents it, at least sqrt(k)."""
        longest = np.linalg.norm(self.velocity.mesh.sides, axis=2).max(axis=1)
        return np.maximum(np.sqrt(self.permeability), longest / ACROSS)

    @cached_property
    def widened(self) -> np.ndarray:
        """(T,) True in biomass where the layer is thicker than sqrt(k)."""
        return self.velocity.mesh.biomass & (self.thickness > np.sqrt(self.permeability))

    @property
    def viscosity(self) -> np.ndarray:
        """(T,) nu_r."""
        return np.where(self.widened, self.thickness**2 / self.permeability, 1.0)

    def constrained(self, no_slip: np.ndarray) -> np.ndarray:
        """(2n + m,) constrained unknowns: those of u = 0 on all walls, ``no_slip``, without u_x at
        wall nodes that touch only widened triangles."""
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
        """(T, k, k) of (b u_x, v_x) over the walls under widened triangles."""
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
