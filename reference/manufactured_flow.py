"""Manufactured Stokes flow through an interface where the viscosity jumps. The force balances the chosen field.

s runs across the straight interface s = 0 and t along it. Both are rotated by ANGLE, so that no axis is special.
On either side u = (psi_y, -psi_x), which is divergence-free, from

    psi = A(t) + B s + C(t) s^2 + D(t) s^3

with the same A and B on both sides: u is continuous. On the interface du/ds is 0 across and -2 C along it, and the
shear of grad u + grad u^T is A'' - 2 C. Both sides have the same shear stress T(t) and the same pressure there; the
pressure's slope differs. Each form makes one stress continuous, which requires

    nu du/dn - p n:                     C = -T / (2 nu)              "laplacian" [E2]
    nu (grad u + grad u^T) n - p n:     C = (A'' - T / nu) / 2       "traction"

D and the curvature of A scale with 1 / nu, so that stresses are of order one. The force is the residual of the strong
form of each phase, f = -div(nu grad u) + grad p or -div(nu (grad u + grad u^T)) + grad p, derived by sympy.
"""
from dataclasses import dataclass
from operator import attrgetter

import numpy as np
import sympy as sp

ANGLE = 0.5
X, Y = sp.symbols("x y", real=True)
S = X * sp.cos(ANGLE) + Y * sp.sin(ANGLE)
T = Y * sp.cos(ANGLE) - X * sp.sin(ANGLE)


@dataclass(frozen=True)
class Phase:
    """The solution on one side, symbols in X and Y: velocity (2, 1), pressure, and stress (2, 2), without unit."""

    viscosity: float
    velocity: sp.Matrix
    pressure: sp.Expr
    stress: sp.Matrix

    @property
    def force(self):
        """(2, 1): -div of the stress."""
        return -sp.Matrix([sp.diff(self.stress[i, 0], X) + sp.diff(self.stress[i, 1], Y) for i in (0, 1)])


def phases(ratio, interface):
    """(fluid, biomass) as :class:`Phase`: s < 0 and s > 0, of viscosities one and ``ratio``."""
    return _phase(1.0, ratio, interface, 2.0), _phase(ratio, ratio, interface, -1.0)


def _phase(viscosity, ratio, interface, slope):
    """One side; ``slope`` is the part of dp/ds that differs between the sides."""
    t = sp.Symbol("t")
    A = t + t**2 / 2 + sp.sin(3 * t) / (9 * ratio)
    shear = sp.cos(2 * t)
    D = sp.sin(2 * t + 1) / viscosity
    C = -shear / (2 * viscosity) if interface == "laplacian" else (sp.diff(A, t, 2) - shear / viscosity) / 2
    psi = (A + S / 2 + C * S**2 + D * S**3).subs(t, T)
    velocity, pressure = sp.Matrix([sp.diff(psi, Y), -sp.diff(psi, X)]), sp.cos(2 * S + T) + slope * S
    gradient = velocity.jacobian([X, Y])
    viscous = gradient if interface == "laplacian" else gradient + gradient.T
    return Phase(viscosity, velocity, pressure, viscosity * viscous - pressure * sp.eye(2))


def evaluate(ratio, interface):
    """(velocity, pressure, force), functions of places (x, y): arrays (..., 2), (...) and (..., 2)."""
    pair = phases(ratio, interface)
    velocity, force = (_at([*map(attrgetter(field), pair)]) for field in ("velocity", "force"))
    pressure = _at([sp.Matrix([phase.pressure]) for phase in pair])
    return velocity, lambda x, y: pressure(x, y)[..., 0], force


def _at(sides):
    """f(x, y) of the symbolic (fluid, biomass), stacked along the last axis."""
    fluid, biomass = (sp.lambdify((X, Y), list(side), "numpy", cse=True) for side in sides)
    across = sp.lambdify((X, Y), S, "numpy")
    return lambda x, y: np.where((across(x, y) > 0)[..., None], *(np.stack(f(x, y), axis=-1) for f in (biomass, fluid)))
