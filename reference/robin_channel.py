"""One substrate in plug flow through a channel with first-order uptake in a strip: (7) in one dimension, closed form.

Fluid upstream, x < 0; the strip 0 < x < l takes up kappa C; fluid downstream, x > l. Steady, velocity u throughout:

    u C' = D C'' (fluid),      u C' = D_B C'' - kappa C (strip),      u C - D C' = u C_s at any inlet x = -a  (11).

*Upstream* the flux u C - D C' does not depend on x. It is u C_s for any position of the inlet, so
C = C_s (1 - alpha exp(u x / D)): this is (26), with alpha = 1 - C(0)/C_s. *Downstream* C = const, the only solution
with C' = 0 at the outlet (12). Flux and C are continuous at x = 0 and x = l, so the strip satisfies

    u C - D_B C' = u C_s at x = 0,      C' = 0 at x = l

whose solution is C = A exp(r x) + B exp(q x) with r, q = (u +- sqrt(u^2 + 4 kappa D_B)) / (2 D_B), r > 0 > q: from
C'(l) = 0, A = -B (q/r) exp((q - r) l); from the flux at 0, u C_s = A (u - D_B r) + B (u - D_B q), where u - D_B r =
D_B q and u - D_B q = D_B r.
"""
import numpy as np


def strip(x, velocity, supply, diffusivity, in_strip, uptake, length):
    """C(x) with x = 0 where the strip begins; uptake is kappa > 0, in_strip is D_B, length is l."""
    x = np.asarray(x, float)
    root = np.sqrt(velocity**2 + 4 * uptake * in_strip)
    r, q = (velocity + root) / (2 * in_strip), (velocity - root) / (2 * in_strip)
    share = -(q / r) * np.exp((q - r) * length)
    b = velocity * supply / (in_strip * (share * q + r))
    inside = np.clip(x, 0.0, length)
    c = b * (share * np.exp(r * inside) + np.exp(q * inside))
    return np.where(x < 0, supply - (supply - c) * np.exp(velocity * np.minimum(x, 0.0) / diffusivity), c)
