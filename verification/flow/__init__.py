"""Flow (2.1, 3.2): closed forms, manufactured flow, Taylor-Hood elements, and what holds of any viscous flow."""

from verification.flow import (  # noqa: F401
    bubble,
    closed_forms,
    cross_code,
    graded,
    inclusion,
    layers,
    manufactured,
    permeable,
    properties,
    rise,
)
