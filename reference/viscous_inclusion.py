"""A circular viscous inclusion in an unbounded fluid under pure shear: exact velocity and pressure.

The fluid has viscosity one, the inclusion |z| < R lambda, z = x + i y. Far away u + i v = E z*, with E = exp(2 i angle)
and z* the conjugate of z: stretching of rate one along ``angle``, shortening across it. Two analytic functions give any
plane Stokes flow of viscosity one (Muskhelishvili),

    2 (u + i v) = phi - z phi'* - psi*,       p = -2 Re phi'

and Schmid & Podladchikov (2003), Geophys. J. Int. 155, 269-288, derive those of this problem:

    phi = -2 A E R^2 / z,   psi = -2 E* z - 2 A E R^4 / z^3   outside;      u + i v = (1 - A) E z*,   p = 0   inside.

At the circle, R^2 / z = z*, the velocities agree for any A. The full traction, (2 nu e - p I) n, is continuous for
their A = (lambda - 1) / (lambda + 1) ("traction"). The Laplacian form makes nu du/dn - p n continuous [E2], which is
lambda (1 - A) E z* / R inside and, by differentiation, (1 + 3 A) E z* / R outside: A = (lambda - 1) / (lambda + 3).
"""
import numpy as np


def _strength(ratio, interface):
    """The amplitude A of the disturbance."""
    return (ratio - 1) / (ratio + {"traction": 1, "laplacian": 3}[interface])


def outside(x, y, radius, ratio, interface, angle):
    """(velocity (..., 2), pressure) of the fluid at points on or outside the circle."""
    z = np.asarray(x) + 1j * np.asarray(y)
    E = np.exp(2j * angle)
    A = _strength(ratio, interface)
    phi, slope = -2 * A * E * radius**2 / z, 2 * A * E * radius**2 / z**2
    psi = -2 * np.conj(E) * z - 2 * A * E * radius**4 / z**3
    return _pair((phi - z * np.conj(slope) - np.conj(psi)) / 2), -2 * slope.real


def inside(x, y, ratio, interface, angle):
    """(velocity (..., 2), pressure) of the inclusion: uniform strain and zero pressure."""
    z = np.asarray(x) + 1j * np.asarray(y)
    E = np.exp(2j * angle)
    A = _strength(ratio, interface)
    return _pair((1 - A) * E * np.conj(z)), np.zeros(z.shape)


def fields(x, y, radius, ratio, interface, angle):
    """(velocity (..., 2), pressure (...)) at places x, y (...).

    Lengths in any unit, velocities in that unit times the far strain rate, the pressure in it times the fluid's
    viscosity; ``ratio`` is lambda.
    """
    is_inside = np.hypot(x, y) < radius
    beyond = np.where(is_inside, radius, x), np.where(is_inside, 0.0, y)
    (u, p), (u_in, p_in) = outside(*beyond, radius, ratio, interface, angle), inside(x, y, ratio, interface, angle)
    return np.where(is_inside[..., None], u_in, u), np.where(is_inside, p_in, p)


def _pair(w):
    return np.stack([w.real, w.imag], axis=-1)
