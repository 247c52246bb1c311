"""The scheme on curved triangles. Compare it line by line with :mod:`repro.schemes.paper`."""

from repro.schemes.scheme import Scheme

CURVED = Scheme(
    # Curved triangles with quadratic functions. Velocity and pressure need no tau
    # (flow.TaylorHood). Uptake is integrated by the quadrature for products (space.Quadrature).
    # A term in J - theta stabilises growth (growth.GradDiv). A contact line may lie anywhere on an
    # edge.
    elements="quadratic",
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
