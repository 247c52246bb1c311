"""The curved scheme, which is not the paper's. :mod:`repro.schemes.paper` has the same lines."""

from repro.schemes.scheme import Scheme

CURVED = Scheme(
    # Curved triangles with quadratic functions. Velocity and pressure need no tau
    # (flow.TaylorHood). Uptake has the quadrature of products (space.Quadrature). J - theta
    # stabilises the pressure of growth (growth.GradDiv). Contact lines lie anywhere on an edge.
    elements="quadratic",
    # The midpoint rule, as long as numerics.tolerance allows (march.stepping).
    steps="midpoint",
    # w = u - grad psi, and not u.
    carrier="w",
    # u_x(y) in (11).
    inlet="local",
    # The shares of X_I, at the density X_m.
    transfer="shares",
    # Newton's method keeps its derivative while the iterates converge fast.
    modified_newton=True,
)
