"""A manufactured growth: position, pressure and theta are chosen, and sympy derives the loads in equilibrium with them.

The unit square goes to

    x = X (1 + X / 2) + Y^2 / 2,   y = Y (1 + Y) - X^2 / 4,   theta = det F = (1 + X)(1 + 2 Y) + X Y / 2,

with a shear of up to one. theta is 1 at one corner and 6.5 at the opposite one. With a pressure P(X, Y) the
first Piola-Kirchhoff stress S is the derivative of the energy 1/2 (J^(-2/3) (F : F + 1) - 3) + P (J - theta) by F (21),
the body force per volume at t = 0 is f = -Div S, and the traction on a side with normal N is S N. All are over mu_L.

Two pressures: "sloping" everywhere, and "flat on the rim", with grad P = 0 there.
"""
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import sympy as sp

X, Y = sp.symbols("X Y", real=True)
PLACE = sp.Matrix([X * (1 + X / 2) + Y**2 / 2, Y * (1 + Y) - X**2 / 4])
PRESSURES = {"sloping": sp.cos(2 * X + Y) / 5 - sp.Rational(1, 10),
             "flat on the rim": (sp.sin(sp.pi * X) * sp.sin(sp.pi * Y)) ** 2 / 2 - sp.Rational(1, 10)}


@dataclass(frozen=True)
class Growth:
    """Functions of arrays X, Y (...): place (..., 2), pressure and theta (...), force (..., 2), stress (..., 2, 2)."""

    place: Callable
    pressure: Callable
    theta: Callable
    force: Callable
    stress: Callable


@cache
def growth(pressure):
    """The :class:`Growth` with one of PRESSURES."""
    P = PRESSURES[pressure]
    S = _stress(PLACE.jacobian([X, Y]), P)
    force = -(S.col(0).diff(X) + S.col(1).diff(Y))
    theta = PLACE.jacobian([X, Y]).det()
    return Growth(*map(_function, (PLACE, sp.Matrix([[P]]), sp.Matrix([[theta]]), force, S)))


def _stress(gradient, P):
    """Derivative of the energy by F, at F = ``gradient``."""
    F = sp.Matrix(2, 2, sp.symbols("F11 F12 F21 F22"))
    energy = (F.det() ** sp.Rational(-2, 3) * (sum(f**2 for f in F) + 1) - 3) / 2 + P * F.det()
    return energy.diff(F).subs(dict(zip(F, gradient)))


def _function(matrix):
    """Convert expressions (m, n) to a function of arrays. A column gives (..., m), a single expression (...)."""
    components = [sp.lambdify((X, Y), component, "numpy", cse=True) for component in matrix]
    shape = tuple(size for size in matrix.shape if size > 1)

    def function(x, y):
        values = np.stack([np.broadcast_to(component(x, y), np.shape(x)) for component in components], axis=-1)
        return values.reshape((*np.shape(x), *shape))
    return function
