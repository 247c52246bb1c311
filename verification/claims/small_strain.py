"""C37: the small-strain limit of the stresses."""

from __future__ import annotations

import numpy as np

from repro.model import growth
from verification.claims import CLOSED, Finding, at_most, claim, near
from verification.claims.growth_mechanics import listed

#: Sizes of the displacement's gradient.
STRAINS = np.array([1e-2, 1e-3, 1e-4, 1e-5])


@claim("C37", "2.3.1", "neo-Hookean elasticity reduces to the linear one at small strain",
       about=CLOSED)
def small_strain() -> Finding:
    """Cauchy stress of F = I + e G against 2 mu_L dev(strain) + P, G random with rotations, e from 1e-2 to 1e-5."""
    generator = np.random.default_rng(2001)
    G, P = generator.uniform(-1, 1, (200, 2, 2)), generator.uniform(-1, 1, 200)
    errors = np.array([nonlinear_part(e * G, e * P) for e in STRAINS])
    slope = np.polyfit(np.log(STRAINS), np.log(errors), 1)[0]
    checks = (near("order at which the relative difference falls with strain", "reduces to", slope, 1.0, absolute=0.02,
                   why="exact 1: the first neglected term is quadratic"),
              at_most("relative difference at gradients of 1e-4", "reduces to", errors[2], 1e-3,
                      "ten times the gradient"))
    return Finding(checks, note=f"Largest relative differences at gradients of {listed(STRAINS)}: {listed(errors)}.")


def nonlinear_part(slope: np.ndarray, P: np.ndarray) -> float:
    """Largest difference of the stresses from linear elasticity over the largest linear stress, for mu_L = 1."""
    strain = 0.5 * (slope + np.swapaxes(slope, 1, 2))
    mean = np.trace(strain, axis1=1, axis2=2) / 3
    across = np.stack([strain[:, 0, 0] - mean, strain[:, 1, 1] - mean, -mean], axis=1)
    linear = np.column_stack([2 * across + P[:, None], 2 * strain[:, 0, 1]])
    return float(np.abs(growth.cauchy(np.eye(2) + slope, P) - linear).max() / np.abs(linear).max())
