"""The configuration from which strain counts: the shape at t = 0 (2.3), or the last shape (section
5).

``growth.new_biomass`` selects it by :func:`configuration_of`. Both classes have

    accumulates    does strain add up over the steps? Folds and stresses have a meaning only then
    restarted      the configuration at the start of a step, from positions (n, 2) um of the nodes
    unstrained     (n, 2) um, positions of a solid's nodes in the configuration
    carried        the configuration on another mesh, from a function that carries positions (n, 2)
    strained       the solid in the configuration, and its expansion (t, q) since then, from theta
                   (t, q) since t = 0
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from repro.model.solid import Solid
from repro.scene import Growth


@dataclass(frozen=True)
class FromStart:
    """Strain counts from t = 0, for new biomass too."""

    accumulates = True

    def restarted(self, positions: np.ndarray) -> FromStart:
        """The same configuration."""
        return self

    def unstrained(self, solid: Solid) -> np.ndarray:
        """The reference of the solid."""
        return solid.reference

    def carried(self, carry: Callable[[np.ndarray], np.ndarray]) -> FromStart:
        """The same configuration: the reference is carried with the solid."""
        return self

    def strained(self, solid: Solid, theta: np.ndarray) -> tuple[Solid, np.ndarray]:
        """The solid and its theta."""
        return solid, theta


@dataclass(frozen=True, eq=False)
class FromPrevious:
    """New biomass has no stress: strain counts from the last shape.

    positions: (n, 2) um, of the nodes in the last shape.
    """

    positions: np.ndarray
    accumulates = False

    def restarted(self, positions: np.ndarray) -> FromPrevious:
        """The configuration with these positions."""
        return FromPrevious(positions)

    def unstrained(self, solid: Solid) -> np.ndarray:
        """The positions."""
        return self.positions

    def carried(self, carry: Callable[[np.ndarray], np.ndarray]) -> FromPrevious:
        """The positions on the other mesh."""
        return FromPrevious(carry(self.positions))

    def strained(self, solid: Solid, theta: np.ndarray) -> tuple[Solid, np.ndarray]:
        """The solid at the positions, and the expansion theta / J, with J of the last shape. The
        quotient removes the error of J = theta, so the area follows the mass without drift."""
        return replace(solid, reference=self.positions), theta / solid.strained(self.positions).J


ReferenceConfiguration: TypeAlias = FromStart | FromPrevious


def configuration_of(growth: Growth | None, positions: np.ndarray) -> ReferenceConfiguration:
    """The configuration of a scene's growth; positions: (n, 2) um, of the last shape."""
    if growth and growth.new_biomass == "stress_free":
        return FromPrevious(positions)
    return FromStart()
