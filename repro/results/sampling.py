"""Values of fields at places: probes, line profiles and regular grids."""

from collections.abc import Mapping

import numpy as np

from repro.fem.transfer import located


def sample(fields: Mapping[str, np.ndarray], name: str, places: np.ndarray) -> np.ndarray:
    """(k,) or (k, 3) values of a field at places (k, 2) um; NaN beside the meshed part.

    A field at nodes is evaluated by the functions of its elements, one in triangles by that around
    the place.
    """
    points, cells, values = fields["places_um"], fields["triangles"], fields[name]
    inside = ((places >= points.min(axis=0)) & (places <= points.max(axis=0))).all(axis=1)
    sampled = np.full((len(places), *values.shape[1:]), np.nan)
    if inside.any():
        at = located(points, cells, places[inside])
        in_triangles = len(values) == len(cells)
        sampled[inside] = values[at.triangle] if in_triangles else at.field(values, cells)
    return sampled


def grid(box: np.ndarray, across: int) -> tuple[np.ndarray, np.ndarray]:
    """x and y (um) of a regular grid over a box (2, 2), with ``across`` points over its width."""
    (left, low), (right, high) = box
    along = round((across - 1) * (right - left) / (high - low)) + 1
    return np.linspace(left, right, along), np.linspace(low, high, across)
