"""The aggregate in its reference configuration, and its deformation.

:mod:`repro.model.growth` solves for the deformation.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from repro.fem import elements
from repro.fem.assembly import ElementSystem, saddle_system
from repro.fem.brief import brief
from repro.fem.elements import Table
from repro.fem.forms import Basis, basis
from repro.fem.linear import DEFAULT, Method
from repro.fem.mesh import Connections, Region
from repro.fem.space import Space
from repro.model.energies import NEO_HOOKEAN, Energy


@dataclass(frozen=True, eq=False)
class Shape(Connections):
    """Connections of an aggregate's triangles, in its own numbering, corners first.

    degree: of the quadrature; method: solver of the linear systems.
    """

    degree: int
    method: Method = DEFAULT
    _constrained: dict[str, ElementSystem] = field(init=False, repr=False, default_factory=dict)

    @property
    def table(self) -> Table:
        """The functions of the displacements at the quadrature points."""
        return elements.table(self.geometry, self.degree)

    @cached_property
    def unconstrained(self) -> ElementSystem:
        """The sparse system of positions and pressure without prescribed unknowns."""
        constrained = np.zeros((int(self.cells.max()) + 1, 2), bool)
        return saddle_system(self.cells, self.triangles, constrained, method=self.method)

    def constrained(self, rows: np.ndarray) -> ElementSystem:
        """The system with prescribed unknowns ``rows`` (2n + corners,). The last one is cached."""
        last = self._constrained.get("last")
        if last is None or not np.array_equal(last.constrained, rows):
            last = self.unconstrained.with_constrained(rows)
            self._constrained["last"] = last
        return last


@brief
@dataclass(frozen=True, eq=False)
class Solid:
    """The aggregate in its reference configuration.

    shape: its connections; reference: (n, 2) um, positions of its nodes; energy: its elastic
    energy.
    """

    shape: Shape
    reference: np.ndarray
    energy: Energy = field(default=NEO_HOOKEAN, kw_only=True)

    @cached_property
    def at(self) -> Basis:
        """The functions of the displacements in the reference configuration."""
        cells = self.shape.cells
        return basis(cells, len(self.reference), self.reference[cells], self.shape.table)

    @cached_property
    def pressures(self) -> Basis:
        """The linear functions of the pressure."""
        linear = self.shape.table.linear
        return Basis(self.shape.triangles, self.shape.corners, linear, self.at.dx)

    def strained(self, position: np.ndarray) -> Strained:
        """The deformation F (t, q, 2, 2) from the reference to positions (n, 2) um, and its terms
        in the stress."""
        F = self.at.gradient(position)
        return Strained(elements.by_component(F.transpose(1, 3, 0, 2)), self.energy)


def material(space: Space, region: Region, reference: np.ndarray, energy: Energy) -> Solid:
    """An aggregate of a mesh; reference: (n, 2) um, positions of its nodes in the reference
    configuration."""
    shape = Shape(region.own_cells, len(region.corner_nodes), space.gradient_degree,
                  space.mesh.topology.method)
    return Solid(shape, reference, energy=energy)


@dataclass(frozen=True, eq=False)
class Strained:
    """Plane deformations F (..., 2, 2) and their terms in the stress.

    Each term is computed on first use, so J can be tested before a division by J.
    """

    F: np.ndarray
    energy: Energy = NEO_HOOKEAN

    @cached_property
    def J(self) -> np.ndarray:
        """(...) det F."""
        return elements.determinant(self.F)

    @cached_property
    def H(self) -> np.ndarray:
        """(..., 2, 2) F^-T."""
        return elements.inverse_transpose(self.F, self.J)

    @cached_property
    def isochoric(self) -> np.ndarray:
        """(...) J^(-2/3)."""
        return self.J ** (-2 / 3)

    @cached_property
    def invariant(self) -> np.ndarray:
        """(...) I = J^(-2/3) tr C."""
        return self.isochoric * self.trace

    @property
    def admissible(self) -> bool:
        """Is J positive, and I below the limit of the energy?"""
        return bool(self.J.min() > 0 and (self.invariant < self.energy.invariant_limit).all())

    @cached_property
    def A(self) -> np.ndarray:
        """(...) a J^(-2/3), see :class:`Energy`."""
        return self.isochoric * self.energy.stiffness(self.invariant)

    @cached_property
    def trace(self) -> np.ndarray:
        """(...) tr C."""
        return np.sum(self.F**2, axis=(-2, -1)) + 1

    @cached_property
    def G(self) -> np.ndarray:
        """(..., 2, 2) J^(-2/3) (F - tr C / 3 H): half of the derivative of I by F."""
        return self.isochoric[..., None, None] * (
            self.F - self.trace[..., None, None] / 3 * self.H)

    def piola(self, P: np.ndarray) -> np.ndarray:
        """First Piola-Kirchhoff stress (..., 2, 2) at a pressure P (...), both over mu_L.

        It is the derivative of (21) by F.
        """
        volumetric = P * self.J - self.A * self.trace / 3
        return self.A[..., None, None] * self.F + volumetric[..., None, None] * self.H
