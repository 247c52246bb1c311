"""Growth against erosion: closed forms and ordinary differential equations, in any consistent units.

A half-disc that grows by mu without stress on a wall along which it slides stays a half-disc. Its area grows by mu, so
its radius by mu / 2; a surface that recedes by v takes v from the radius:

    R' = mu R / 2 - v

A layer that cannot spread grows in thickness alone (Wanner and Gujer 1986; Abbas, Sudarsan and Eberl 2012):

    H' = mu H - s(H),    s = k H^2  or  k max(tau - tau_c, 0)

In plane flow of a discharge q past a flat layer, whose surface is at rest, the shear is that of a channel of the
remaining width, tau = 6 rho nu q / (W - H)^2.
"""
import numpy as np
from scipy.integrate import solve_ivp

#: Relative error of the integration.
ERROR = 1e-10


def half_disc(radius, growth, speed, time):
    """R at a time: from R(0) = radius, with mu = growth > 0 and v = speed."""
    steady = 2 * speed / growth
    return steady + (radius - steady) * np.exp(growth * time / 2)


def layer(thickness, growth, coefficient, time):
    """H at a time with s = k H^2, the logistic curve, from H(0) = thickness with mu = growth > 0, k = coefficient."""
    steady = growth / coefficient
    return steady / (1 + (steady / thickness - 1) * np.exp(-growth * time))


def at_velocity(width, viscosity, speed):
    """tau(H) at a mean velocity ``speed`` in the width W; viscosity: rho nu."""
    return lambda H: 6 * viscosity * speed * width / (width - H) ** 2


def at_head(width, viscosity, pressure, length, covered):
    """tau(H) under a pressure over a channel of a length, of which a layer covers a part: the losses of both parts,
    12 rho nu q / (W - H)^3 and 12 rho nu q / W^3 per length, add up."""
    def shear(H):
        open_width = width - H
        discharge = pressure / (12 * viscosity) / (covered / open_width**3 + (length - covered) / width**3)
        return 6 * viscosity * discharge / open_width**2
    return shear


def sheared_layer(thickness, growth, coefficient, critical, shear, time):
    """H at a time with s = k max(tau - tau_c, 0) and tau = shear(H), from H(0) = thickness with mu = growth."""
    def rate(_, H):
        return growth * H - coefficient * np.maximum(shear(H) - critical, 0.0)
    return float(solve_ivp(rate, (0.0, time), [thickness], rtol=ERROR, atol=ERROR * thickness).y[0, -1])
