"""The paper's scheme (section 3). Compare it line by line with :mod:`repro.schemes.curved`."""

from dataclasses import replace

from repro.schemes.scheme import Scheme

PAPER = Scheme(
    # Straight triangles with linear functions. Velocity and pressure need tau (3.2, flow.Linear).
    # Uptake is lumped at the nodes (3.3, space.Lumped). |grad P|^2 stabilises the pressure of
    # growth (3.4, growth.PressureGradient). Contact surfaces grow node by node (2.3.3).
    elements="linear",
    # Elements follow no boundary layers or fronts (3.1).
    follows_layers=False,
    # Edges at the tips of an outline have the length W / (200 refinement^2).
    edges_at_tips=200.0,
    # The lumped reaction keeps the concentrations positive in every step of Gear's method (3.3).
    undershoot=0.0,
    # Concentrations may exceed the supply where the cell Peclet number is above 2.
    overshoot=None,
    # Sequential coupling: flow, substrates, biomass and shape, every growth.time_step (section 2).
    steps="updates",
    # w = u - tau grad p carries the substrates, not u as printed.
    carrier="w",
    # u_x(y) in (11), not u_ave as printed [E4].
    inlet="local",
    # Galerkin's projection, not the printed interpolation (3.5) [E8].
    transfer="projection",
    # Newton's method factorises a new derivative in every iterate.
    modified_newton=False,
)

#: PAPER with three choices as printed. It does not conserve mass. The preset as_printed also uses
#: Gear's method (3.3), by numerics.transport.
PRINTED = replace(
    PAPER,
    # In linear elements u has sources: substrates appear and vanish in the water.
    carrier="u",
    # If C varies across the inlet, u_ave supplies more than u_x(y) carries away (11) [E4].
    inlet="mean",
    # Linear interpolation to a new mesh (3.5) [E8].
    transfer="interpolation",
)
