"""The coupled loop: the whole run against its averaged pore, special cases with a known answer, what is conserved, the
order in the time step, and what must not matter."""

from verification.coupling import (  # noqa: F401
    averaged_base,
    averaged_mixing,
    averaged_supply,
    averaged_thin,
    averaged_uptake,
    balances,
    conservation,
    contact,
    exact,
    exponential,
    presets,
    schemes,
    special_cases,
    symmetry,
    traction,
    traction_shapes,
)
