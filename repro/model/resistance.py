"""The resistance of biomass to flow: a viscosity (2.1), or a permeability (section 5).

Both classes have

    permeable           True: the water exerts a drag in the biomass; False: a traction on its
                        surface
    contact_elements    least number of elements per thickness of the least film, beside contact
                        lines with the opposite wall
    pressure_jumps      does the pressure jump between water and biomass?
    terms               the system with the constraints in biomass, nu_r (T,), and element matrices
                        (T, 2k, 2k) of the drag, None without drag
    loss                head loss in a channel of a width (um) full of biomass, over the loss in
                        water
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
        """Does the viscosity jump?"""
        return self.ratio != 1

    def terms(self, velocity: Space, system: ElementSystem
              ) -> tuple[ElementSystem, np.ndarray, None]:
        """The viscosity, without drag."""
        return system, np.where(velocity.mesh.biomass, self.ratio, 1.0), None

    def loss(self, width: float) -> float:
        """The ratio of the viscosities, by Poiseuille's flow."""
        return self.ratio


@dataclass(frozen=True)
class Permeable:
    """Biomass with a permeability (um2); see :mod:`repro.model.brinkman`.

    Water enters a permeable aggregate that spans the pore near its contact lines with the opposite
    wall. Elements are therefore small there.
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
        """One plus Darcy's loss over the loss of Poiseuille's flow."""
        return 1 + width**2 / 12 / self.permeability


Resistance: TypeAlias = Viscous | Permeable
WATER = Viscous(1.0)


def resistance_of(drive: Drive) -> Resistance:
    """The resistance that a section [flow] states."""
    if drive.permeability is not None:
        return Permeable(drive.permeability)
    return Viscous(needed(drive.viscosity_ratio, "flow.viscosity_ratio"))
