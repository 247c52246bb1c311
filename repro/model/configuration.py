"""The configuration from which strain counts: that of t = 0 (2.3), or the last shape (section 5).

``growth.new_biomass`` chooses it; :func:`configuration_of` alone knows its words. Both classes have

    accumulates    True: strain adds up over the steps. Only then do folds and
                   stresses have a meaning.
    restarted      the configuration of a step from given positions (n, 2) um of the nodes
    unstrained     (n, 2) um, the nodes of a solid in it
    carried        the same on another mesh, to which a function carries positions (n, 2)
    strained       the solid in it, and its expansion since then, from theta (t, q) since t = 0
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
    """New biomass takes part in the strain since t = 0."""

    accumulates = True

    def restarted(self, positions: np.ndarray) -> FromStart:
        """This configuration."""
        return self

    def unstrained(self, solid: Solid) -> np.ndarray:
        """The solid's reference."""
        return solid.reference

    def carried(self, carry: Callable[[np.ndarray], np.ndarray]) -> FromStart:
        """The same, because the solid is carried."""
        return self

    def strained(self, solid: Solid, theta: np.ndarray) -> tuple[Solid, np.ndarray]:
        """The solid and its theta."""
        return solid, theta


@dataclass(frozen=True, eq=False)
class FromPrevious:
    """New biomass has no stress; positions: (n, 2) um, the nodes in the last shape."""

    positions: np.ndarray
    accumulates = False

    def restarted(self, positions: np.ndarray) -> FromPrevious:
        """These positions."""
        return FromPrevious(positions)

    def unstrained(self, solid: Solid) -> np.ndarray:
        """The positions."""
        return self.positions

    def carried(self, carry: Callable[[np.ndarray], np.ndarray]) -> FromPrevious:
        """The positions on the other mesh."""
        return FromPrevious(carry(self.positions))

    def strained(self, solid: Solid, theta: np.ndarray) -> tuple[Solid, np.ndarray]:
        """The expansion is theta / J. This removes the error of J = theta, so the area follows the
        mass without drift."""
        return replace(solid, reference=self.positions), theta / solid.strained(self.positions).J


ReferenceConfiguration: TypeAlias = FromStart | FromPrevious


def configuration_of(growth: Growth | None, positions: np.ndarray) -> ReferenceConfiguration:
    """The configuration of a scene's growth; positions: (n, 2) um, of the last shape."""
    if growth and growth.new_biomass == "stress_free":
        return FromPrevious(positions)
    return FromStart()
