"""The paper's scheme (section 3). :mod:`repro.schemes.curved` has the same lines."""

from dataclasses import replace

from repro.schemes.scheme import Scheme

PAPER = Scheme(
    # Straight triangles with linear functions. Velocity and pressure need tau (3.2, flow.Linear).
    # Uptake is lumped at the nodes (3.3, space.Lumped). |grad P|^2 stabilises the pressure of
    # growth (3.4, growth.PressureGradient). Entire nodes join a wall (2.3.3).
    elements="linear",
    # Sequential coupling: flow, substrates, biomass and shape, every growth.time_step (section 2).
    steps="updates",
    # w = u - tau grad p, and not u as printed.
    carrier="w",
    # u_x(y) in (11), and not u_ave as printed [E4].
    inlet="local",
    # Galerkin's projection, and not the printed interpolation (3.5) [E8].
    transfer="projection",
    # Newton's method factorises a new derivative in every iterate.
    modified_newton=False,
)

#: What the paper prints where PAPER departs from it: mass is not conserved. numerics.transport of
#: the preset as_printed has Gear's method (3.3) besides.
PRINTED = replace(
    PAPER,
    # u, which has sources in linear elements: substrates appear and vanish in the water.
    carrier="u",
    # u_ave supplies more than u_x(y) carries away, if C varies across the inlet (11) [E4].
    inlet="mean",
    # Linear interpolation to a new mesh (3.5) [E8].
    transfer="interpolation",
)
