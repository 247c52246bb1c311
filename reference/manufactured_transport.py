"""Manufactured concentrations around a half-disc of biomass, and the forcing that makes them solutions of (7)-(8).

The stream function psi = u_ave W (3 e^2 - 2 e^3 + 3/2 sin(2 pi x / W) e^2 (1 - e)^2), e = y / W, gives a parabola that
bends up and down. It is divergence-free, and no water passes the walls. With s = (x^2 + y^2) / R^2 - 1, zero on the
interface, and any smooth g,

    C = c + g s D_B / D

is continuous at the interface, and so is its flux D dC/dn = D_B g ds/dn, although D is not. sympy derives the forcing
from the strong form on either side of the interface:

    f = -div(D grad C) + u . grad C + X q(C_A, C_D)

with an independent q as in :mod:`reference.monod`, X = X_0 (1 + x / (3 R)) in the biomass and no uptake in the fluid. A
solver adds f and the flux through every side.
"""
from dataclasses import dataclass

import sympy as sy

X, Y = sy.symbols("x y", real=True)
TILT = sy.Rational(3, 2)


@dataclass(frozen=True)
class Field:
    """One substrate on one side of the interface; each a function of x and y (arrays): value is C, flux (D dC/dx, D
    dC/dy), forcing f."""

    value: object
    flux: object
    forcing: object


def velocity(width, mean):
    """(u_x, u_y) as expressions of X and Y."""
    e = Y / width
    stream = mean * width * (3 * e**2 - 2 * e**3 + TILT * sy.sin(2 * sy.pi * X / width) * e**2 * (1 - e) ** 2)
    return sy.diff(stream, Y), -sy.diff(stream, X)


def concentrations(width, radius, diffusivity, in_biomass, side):
    """(C_A, C_D) on a side, "fluid" or "biomass", as expressions; diffusivity, in_biomass: pairs."""
    s = (X**2 + Y**2) / radius**2 - 1
    shapes = (sy.cos(X / width + Y / (2 * width)) / (2 + (X / width) ** 2),
              sy.exp(-(X / width) ** 2) * (1 + Y / width) / 3)
    ratio = [b / d if side == "fluid" else 1 for d, b in zip(diffusivity, in_biomass)]
    return tuple(c + g * s * r for c, g, r in zip((2, sy.Rational(3, 2)), shapes, ratio))


def density(radius, largest):
    """X in the biomass, as an expression."""
    return largest * (1 + X / (3 * radius))


def uptake(acceptor, donor, rates):
    """(q_A, q_D), (7)-(8) over X, as expressions."""
    m_a, m_d = acceptor / (acceptor + rates["K_A"]), donor / (donor + rates["K_D"])
    return m_a * (rates["k"] * rates["F"] * m_d + rates["decay"]), rates["k"] * m_a * m_d


def fields(width, radius, mean, diffusivity, in_biomass, largest, rates):
    """{side: (acceptor, donor)} of :class:`Field`; mean: u_ave; largest: X_0; rates: those of reference.monod."""
    return {side: _fields_on(side, width, radius, mean, diffusivity, in_biomass, largest, rates)
            for side in ("fluid", "biomass")}


def _fields_on(side, width, radius, mean, diffusivity, in_biomass, largest, rates):
    substrates = concentrations(width, radius, diffusivity, in_biomass, side)
    sinks = uptake(*substrates, rates) if side == "biomass" else (0, 0)
    diffusivities = in_biomass if side == "biomass" else diffusivity
    u, v = velocity(width, mean)
    forcing = [-d * (sy.diff(c, X, 2) + sy.diff(c, Y, 2)) + u * sy.diff(c, X) + v * sy.diff(c, Y)
               + density(radius, largest) * q for c, d, q in zip(substrates, diffusivities, sinks)]
    return tuple(Field(function(c), function((d * sy.diff(c, X), d * sy.diff(c, Y))), function(f))
                 for c, d, f in zip(substrates, diffusivities, forcing))


def function(expression):
    """A function of x and y (arrays)."""
    return sy.lambdify((X, Y), expression, "numpy", cse=True)
