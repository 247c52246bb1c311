"""A small picture of the pore and key figures, for a notebook that shows a run."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping
from html import escape

import numpy as np

from repro.results import drawing, names

#: Fields; the first one that the run has is shown.
FIELDS = ("acceptor_mg_per_L", "velocity_m_per_d")
#: Dots per inch.
RESOLUTION = 80
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


def figure(fields: Mapping[str, np.ndarray], title: str, time: float) -> str:
    """A field at a time (h) as HTML with a picture; empty without a field of FIELDS or matplotlib.
    """
    name = next((name for name in FIELDS if name in fields), "")
    if not name:
        return ""
    try:
        picture = base64.b64encode(png(fields, name, title)).decode("ascii")
    except ImportError:
        return ""
    low, high = drawing.value_range(drawing.magnitude(fields[name]))
    caption = escape(f"{names.with_unit(name)}, {low:.4g} (dark) to {high:.4g} (light), at "
                     f"t = {time:.4g} h; red: boundary of the aggregate")
    return (f'<figure><img alt="{caption}" src="data:image/png;base64,{picture}">'
            f"<figcaption>{caption}</figcaption></figure>")


def png(fields: Mapping[str, np.ndarray], name: str, title: str) -> bytes:
    """A field as the bytes of a PNG, without pyplot, which would show the figure once more."""
    kind = drawing.optional("matplotlib.figure").Figure
    figure = kind(figsize=drawing.field_size(drawing.corners(fields)), layout="constrained")
    drawing.field(fields, name, title, figure.subplots())
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=RESOLUTION)
    return content.getvalue()
