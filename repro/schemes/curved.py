"""The scheme on curved triangles. Compare it line by line with :mod:`repro.schemes.paper`."""

from repro.schemes.scheme import UNRESOLVED, Scheme

CURVED = Scheme(
    # Curved triangles with quadratic functions. Velocity and pressure need no tau
    # (flow.TaylorHood). Uptake is integrated by the quadrature for products (space.Quadrature).
    # A term in J - theta stabilises growth (growth.GradDiv). A contact line may lie anywhere on an
    # edge.
    elements="quadratic",
    # Elements are refined at boundary layers and fronts.
    follows_layers=True,
    # Edges at the tips of an outline have the length W / (5000 refinement^2), W / 200 in the preset
    # fast.
    edges_at_tips=5000.0,
    # A step of Gear's method may end as far below zero as profiles at rest.
    undershoot=UNRESOLVED,
    # A concentration above its supply by more than 2 % is not resolved.
    overshoot=0.02,
    # The midpoint rule, with steps as long as numerics.tolerance allows (march.stepping).
    steps="midpoint",
    # w = u - grad psi carries the substrates, not u.
    carrier="w",
    # u_x(y) in (11).
    inlet="local",
    # The fraction of X_I is transferred; the density becomes X_m.
    transfer="shares",
    # Newton's method keeps its derivative as long as it converges fast.
    modified_newton=True,
)
