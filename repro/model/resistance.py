"""The resistance of biomass to flow: a viscosity (2.1), or a permeability (section 5).

Both classes have

    permeable           True: the water acts on the biomass by a drag in its volume; False: by a
                        traction on its surface
    contact_elements    least number of elements to the least film, beside upper contact lines
    pressure_jumps      does the pressure jump between water and biomass?
    terms               the system with the conditions within biomass, nu_r (T,), and element
                        matrices (T, 2k, 2k) of the drag
    loss                head loss in a channel of a width (um) full of biomass, over that of water
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal, TypeAlias

import numpy as np

from repro.fem.assembly import ElementSystem
from repro.fem.space import Space
from repro.model.brinkman import Drag
from repro.scene import Flow as Drive
from repro.scene import needed


@dataclass(frozen=True)
class Viscous:
    """Biomass that is ``ratio`` times as viscous as water."""

    ratio: float
    permeable: ClassVar[Literal[False]] = False
    contact_elements: ClassVar[float] = 0.0

    @property
    def pressure_jumps(self) -> bool:
        """It jumps with the viscosity."""
        return self.ratio != 1

    def terms(self, velocity: Space, system: ElementSystem
              ) -> tuple[ElementSystem, np.ndarray, None]:
        """Viscosity alone."""
        return system, np.where(velocity.mesh.biomass, self.ratio, 1.0), None

    def loss(self, width: float) -> float:
        """That of Poiseuille's flow."""
        return self.ratio


@dataclass(frozen=True)
class Permeable:
    """Biomass with a permeability (um2); see :mod:`repro.model.brinkman`.

    A permeable aggregate that spans the pore draws the water in at its upper contact lines, where
    elements are therefore small.
    """

    permeability: float
    permeable: ClassVar[Literal[True]] = True
    contact_elements: ClassVar[float] = 2.0
    pressure_jumps: ClassVar[bool] = False

    def terms(self, velocity: Space, system: ElementSystem
              ) -> tuple[ElementSystem, np.ndarray, np.ndarray]:
        """The terms of :class:`repro.model.brinkman.Drag`, for quadratic velocities."""
        drag = Drag(velocity, self.permeability)
        constrained = drag.constrained(system.constrained)
        return system.with_constrained(constrained), drag.viscosity, drag.matrices()

    def loss(self, width: float) -> float:
        """Darcy's loss beside that of Poiseuille's flow."""
        return 1 + width**2 / 12 / self.permeability


Resistance: TypeAlias = Viscous | Permeable
WATER = Viscous(1.0)


def resistance_of(drive: Drive) -> Resistance:
    """The resistance that a section [flow] states."""
    if drive.permeability is not None:
        return Permeable(drive.permeability)
    return Viscous(needed(drive.viscosity_ratio, "flow.viscosity_ratio"))
