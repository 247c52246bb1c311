"""A small picture of the pore and key figures, for a notebook that shows a run."""

from __future__ import annotations

import base64
import struct
import zlib
from collections.abc import Mapping
from html import escape

import numpy as np

from repro.fem.transfer import interpolate
from repro.results import names

#: Pixels along the meshed part; across the pore at most as many.
ALONG = 480
#: Fields; the first one that the run has is shown.
FIELDS = ("acceptor_mg_per_L", "velocity_m_per_d")
#: Colours (red, green, blue) of the least value, of the largest, and between them: viridis.
COLOURS = np.array([[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]])
#: Levels of colour; the next one is the colour of the aggregate's boundary.
LEVELS = 255
#: Columns whose first and last values are shown.
FIGURES = ("conductivity_m_per_d", "thickness_um", "aggregate_area_um2",
           "effluent_acceptor_mg_per_L", "effluent_donor_mg_per_L")


def key_figures(columns: Mapping[str, np.ndarray]) -> str:
    """First and last values of a run's columns, and the time of contact with the opposite wall."""
    time = columns["time_h"]
    texts = []
    for name in FIGURES:
        if name in columns:
            first, last = columns[name][[0, -1]]
            change = f" → {last:.4g}" if len(time) > 1 else ""
            texts.append(f"{names.words(name)} {first:.4g}{change} {names.unit(name)}")
    touching = time[columns["contact"] == 1] if "contact" in columns else time[:0]
    if len(touching):
        texts.append(f"contact with the opposite wall from t = {touching[0]:.4g} h on")
    return f"t = {time[0]:.4g} to {time[-1]:.4g} h: {'; '.join(texts)}"


def figure(fields: Mapping[str, np.ndarray], time: float) -> str:
    """A field at a time (h) as HTML with a picture; empty if the run has none of FIELDS."""
    name = next((name for name in FIELDS if name in fields), "")
    if not name:
        return ""
    values = fields[name]
    values = np.linalg.norm(values, axis=1) if values.ndim == 2 else values
    picture = base64.b64encode(png(fields, values)).decode("ascii")
    caption = escape(f"{names.with_unit(name)}, {values.min():.4g} (dark) to {values.max():.4g} "
                  f"(light), at t = {time:.4g} h; white: boundary of the aggregate")
    return (f'<figure><img alt="{caption}" src="data:image/png;base64,{picture}">'
            f"<figcaption>{caption}</figcaption></figure>")


def png(fields: Mapping[str, np.ndarray], values: np.ndarray) -> bytes:
    """Values (N,) at the nodes of a run's fields as the bytes of a PNG, upstream on the left."""
    from scipy import ndimage

    points = fields["places_um"]
    cells = fields["triangles"]
    x, y = _pixels(points)
    places = np.column_stack([np.tile(x, len(y)), np.repeat(y, len(x))])
    inside = np.zeros(len(points))
    inside[cells[fields["region"] > 0.5]] = 1.0
    interpolated = interpolate(points, cells, np.column_stack([values, inside]), places)
    shades, shares = interpolated.T.reshape(2, len(y), len(x))
    body = shares > 0.999
    least = values.min()
    span = values.max() - least or 1.0
    levels = np.clip((shades - least) / span * (LEVELS - 1), 0, LEVELS - 1).astype(np.uint8)
    levels[body & ~ndimage.binary_erosion(body, border_value=1)] = LEVELS
    return _encoded(levels[::-1])


def _pixels(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """x and y (um) of the middles of square pixels over a mesh."""
    low, high = points.min(axis=0), points.max(axis=0)
    size = max(high - low) / ALONG
    counts = np.maximum(1, np.round((high - low) / size)).astype(int)
    x, y = (a + (np.arange(n) + 0.5) * (b - a) / n for a, b, n in zip(low, high, counts))
    return x, y


def _encoded(levels: np.ndarray) -> bytes:
    """A PNG of (rows, columns) levels of the palette."""
    along = np.linspace(0, len(COLOURS) - 1, LEVELS)
    shades = [np.interp(along, np.arange(len(COLOURS)), column) for column in COLOURS.T]
    palette = np.vstack([np.column_stack(shades), [255, 255, 255]]).round().astype(np.uint8)
    height, width = levels.shape
    rows = np.column_stack([np.zeros(height, np.uint8), levels])  # each behind its filter, none
    parts = {b"IHDR": struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0),
             b"PLTE": palette.tobytes(), b"IDAT": zlib.compress(rows.tobytes(), 9), b"IEND": b""}
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(kind, data) for kind, data in parts.items())


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
