"""Curves, fields and films of a run with matplotlib, an optional package."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from repro.errors import printable, shortened
from repro.results import names, outlines, quantities
from repro.results.files import output_path
from repro.results.jumps import with_jumps
from repro.scene.needed import package
from repro.scene.units import to_internal

if TYPE_CHECKING:
    from repro.results.tables import Results

#: The panels of curves, each with columns in one unit; a panel without columns is left out.
PANELS: tuple[tuple[str, ...], ...] = (
    ("conductivity_m_per_d",), ("thickness_um",),
    ("effluent_acceptor_mg_per_L", "effluent_donor_mg_per_L"))
#: Width of a figure, height of a panel of curves, and room above and below a field, in inches.
WIDTH, PANEL, ROOM = 7.0, 1.9, 1.2
#: Time of a frame of a film, ms; resolution, dots per inch.
FRAME, RESOLUTION = 120, 110
#: Dots per inch of a picture in a notebook.
SMALL = 80
PYPLOT = "matplotlib.pyplot"
#: Nodes of the straight triangles that draw a triangle, by its number of nodes.
PARTS = {3: [[0, 1, 2]], 6: [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]]}
#: A curve has a logarithmic axis where its largest value is this many times the least one.
DECADES = 100.0


@dataclass(frozen=True)
class Style:
    """How a picture shows a quantity.

    log: is its scale logarithmic? None: where a curve is positive and spans two decades; unit,
    title, cmap: None for those of the quantity, the run and matplotlib.
    """

    log: bool | None = None
    unit: str | None = None
    title: str | None = None
    cmap: str | None = None

    def unit_of(self, name: str) -> tuple[str, float]:
        """The unit in which a quantity is shown, and its factor from the unit of the name.

        Raises ValueError if it is no unit of this quantity.
        """
        if self.unit is None:
            return names.unit(name), 1.0
        try:
            return self.unit, to_internal(f"1 {quantities.plain(name)}", self.unit)
        except (ValueError, OverflowError):
            raise ValueError(f"unit: {self.unit!r}: a unit of {name}, such as "
                             f"{quantities.plain(name)}, is needed") from None

    def is_log(self, values: np.ndarray) -> bool:
        """Does a curve with these values have a logarithmic axis?"""
        shown = values[np.isfinite(values)]
        if self.log is not None or not len(shown):
            return bool(self.log)
        return shown.min() > 0 and shown.max() >= DECADES * shown.min()


PLAIN = Style()


#: Imports a module of matplotlib or Pillow. Raises ImportError with the packages to install.
optional = partial(package, install="matplotlib pillow")


def full_name(name: str, known: Sequence[str]) -> str:
    """The known name that a name equals, with or without its unit; empty if there is none."""
    matching = [candidate for candidate in known
                if name in (candidate, candidate.removesuffix(names.ending(candidate)))]
    return matching[0] if matching else ""


def curves(results: Results, drawn: Sequence[Sequence[str]], ax: Any = None,
           style: Style = PLAIN) -> list[Any]:
    """Draw columns over time, a panel for each tuple of names; returns the axes of the panels."""
    if ax is None:
        _, ax = optional(PYPLOT).subplots(len(drawn), sharex=True, layout="constrained",
                                          figsize=(WIDTH, PANEL * len(drawn) + 0.8))
    axes = list(np.ravel(ax))
    if len(axes) != len(drawn):
        raise ValueError(f"ax: {len(drawn)} axes are needed, not {len(axes)}")
    for panel, columns in zip(axes, drawn):
        _draw_panel(panel, results, columns, style)
    axes[-1].set_xlabel("time (h)")
    axes[0].set_title(_plain(style.title or shortened(results.name)), loc="left")
    return axes


def _plain(text: str) -> str:
    """The text as matplotlib draws it on one line, without mathematics between dollars."""
    return printable(text).replace("$", r"\$")


def _draw_panel(ax: Any, results: Results, columns: Sequence[str], style: Style) -> None:
    """Draw columns in one unit, and the time of contact; a point if there is one row."""
    marker = "o" if len(results.time) == 1 else ""
    unit, factor = style.unit_of(columns[0])
    for name in columns:
        times, values = with_jumps(name, results.time, results[name], results.tables)
        ax.plot(times, factor * values, marker=marker, label=names.label(name))
    if style.is_log(np.concatenate([results[name] for name in columns])):
        ax.set_yscale("log")
    if marker:
        ax.set_xticks(results.time)
    several = len(columns) > 1
    label = columns[0].partition("_")[0] if several else names.label(columns[0])
    ax.set_ylabel(f"{label}\n({unit or '1'})")
    ax.grid(alpha=0.3)
    touching = results.time[results["contact"] == 1] if "contact" in results else []
    if len(touching):
        ax.axvline(touching[0], color="0.4", linestyle=":", label="contact with the wall")
    if several or len(touching):
        ax.legend(frameon=False, fontsize="small")


def _axes(ax: Any, size: tuple[float, float]) -> Any:
    """The axes to draw in, by default those of a new figure of a size (inches)."""
    return ax or optional(PYPLOT).subplots(figsize=size, layout="constrained")[1]


def _add_lines(ax: Any, lines: Iterable[np.ndarray], **style: Any) -> Any:
    """Draw lines, each of points (n, 2); returns their collection."""
    collection = optional("matplotlib.collections").LineCollection(lines, linewidths=1.5, **style)
    ax.add_collection(collection)
    return collection


def field(fields: Mapping[str, np.ndarray], name: str, title: str, ax: Any = None, *,
          limits: np.ndarray | None = None, box: np.ndarray | None = None,
          style: Style = PLAIN) -> Any:
    """Draw a field with the outline of the aggregate and a colour bar; returns the axes.

    Values at nodes are drawn smoothly, values in triangles as they are, and vectors by their
    lengths; NaN stays empty. limits: values of the first and last colour; box: lower left and upper
    right corner (um). By default, they fit the field.
    """
    unit, _ = style.unit_of(name)
    values = shown(fields, name, style)
    limits = value_range(values) if limits is None else limits
    box = corners(fields) if box is None else box
    ax = _axes(ax, field_size(box))
    cells = fields["triangles"]
    parts = np.array(PARTS[cells.shape[1]])
    triangles = cells[:, parts].reshape(-1, 3)
    in_triangles = len(values) == len(cells)
    colours = np.repeat(values, len(parts)) if in_triangles else values
    missing = np.isnan(colours) if in_triangles else np.isnan(colours[triangles]).any(axis=1)
    kind = {"facecolors": colours[~missing]} if in_triangles else {"shading": "gouraud"}
    at_nodes = () if in_triangles else (np.nan_to_num(colours),)
    image = ax.tripcolor(*fields["places_um"].T, *at_nodes, triangles=triangles[~missing],
                         rasterized=True, cmap=style.cmap, **kind)
    if style.log:
        image.set_norm(optional("matplotlib.colors").LogNorm())
    image.set_clim(*limits)
    edges, shared = outlines.boundary(cells, fields["region"] > 0.5)
    lines = outlines.curved(fields["places_um"][edges[shared]])
    _add_lines(ax, lines, colors="#d7191c", capstyle="round")
    bar = ax.figure.colorbar(image, cax=ax.inset_axes([1.02, 0, 0.02, 1]))
    if not style.log:
        bar.formatter.set_powerlimits((-3, 4))
    ax.set(xlabel="x (um)", ylabel="y (um)", aspect="equal", facecolor="0.85",
           xlim=box[:, 0], ylim=box[:, 1])
    ax.set_title(_plain(f"{title}: {names.with_unit(name, unit)}"), loc="left")
    return ax


def shown(fields: Mapping[str, np.ndarray], name: str, style: Style) -> np.ndarray:
    """(N,) or (T,) values of a field in the unit of a picture; NaN where a logarithm has none."""
    values = style.unit_of(name)[1] * magnitude(fields[name])
    return np.where(values > 0, values, np.nan) if style.log else values


@dataclass(frozen=True)
class Photograph:
    """A microscope image: file or array, None without one, um per pixel, and (x, y) um of its lower
    left corner, by default with the middle of its lower edge at the origin."""

    image: Any
    um_per_pixel: float | None
    corner: Sequence[float] | None = None

    def check(self) -> None:
        """Raise ValueError if the image lacks its scale."""
        if self.image is self.um_per_pixel is self.corner is None:
            return
        if self.image is None or not (self.um_per_pixel and self.um_per_pixel > 0):
            raise ValueError("um_per_pixel: a number greater than zero is needed with an image")
        if self.corner is not None and len(self.corner) != 2:
            raise ValueError(f"corner: a place (x, y) in um is needed, not {self.corner!r}")

    def draw(self, ax: Any, factor: float) -> None:
        """Draw the image in the coordinates of the pore; factor: of their unit, from um."""
        read = optional(PYPLOT).imread
        pixels = read(self.image) if isinstance(self.image, str | Path) else self.image
        height, width = factor * self.um_per_pixel * np.array(np.shape(pixels)[:2])
        left, low = factor * np.array(self.corner) if self.corner else (-width / 2, 0.0)
        ax.imshow(pixels, extent=(left, left + width, low, low + height), cmap="gray")


def drawn_outlines(lines: Sequence[outlines.Outline], title: str, box: np.ndarray, ax: Any,
                   *, photograph: Photograph, style: Style) -> Any:
    """Draw outlines, coloured by their times, over an image if there is one; returns the axes.

    box: lower left and upper right corner (um) of the pore.
    """
    unit, factor = style.unit_of("outline_um")
    ax = _axes(ax, field_size(box))
    low, high = factor * box
    if photograph.image is not None:
        photograph.draw(ax, factor)
    else:
        ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        ax.hlines([low[1], high[1]], low[0], high[0], color="0.4")
    times = [each.time for each in lines]
    drawn = _add_lines(ax, [factor * each.points for each in lines], cmap=style.cmap,
                       array=np.array(times))
    if len(set(times)) > 1:
        ax.figure.colorbar(drawn, cax=ax.inset_axes([1.02, 0, 0.02, 1])).set_label("time (h)")
    ax.set(xlabel=f"x ({unit})", ylabel=f"y ({unit})", aspect="equal")
    ax.set_title(_plain(title), loc="left")
    return ax


def field_size(box: np.ndarray) -> tuple[float, float]:
    """Width and height (inches) of the figure of a field in a box (2, 2)."""
    length, width = box[1] - box[0]
    return WIDTH, 0.75 * WIDTH * width / length + ROOM


def against(frame: Any, factors: Sequence[Any], name: str, title: str, ax: Any = None) -> Any:
    """Draw a column of the runs of a sweep against the first varied key, a line for each
    combination of the others; returns the axes.

    frame: a ``pandas.DataFrame`` with a row for each run; factors: the varied keys.
    """
    ax = _axes(ax, (WIDTH, 2 * PANEL))
    first, *others = factors
    groups = [((), frame)] if not others else \
        frame.groupby([factor.column for factor in others], sort=False)
    for values, group in groups:
        label = ", ".join(f"{factor.key} = {factor.short(value)}"
                          for factor, value in zip(others, values))
        ordered = group.sort_values(first.column) if first.numeric else group
        ax.plot(ordered[first.column], ordered[name], marker="o", label=label or None)
    if first.is_log:
        ax.set_xscale("log")
    ax.set(xlabel=f"{first.key} ({first.unit})" if first.unit else first.key,
           ylabel=names.with_unit(name))
    if not frame[name].notna().any():
        ax.text(0.5, 0.5, "in no run", transform=ax.transAxes, ha="center")
    if others:
        ax.legend(frameon=False, fontsize="small")
    ax.set_title(_plain(shortened(title)), loc="left")
    ax.grid(alpha=0.3)
    return ax


def magnitude(values: np.ndarray) -> np.ndarray:
    """(N,) values, or the lengths of vectors (N, 3)."""
    return np.linalg.norm(values, axis=1) if values.ndim == 2 else values


def value_range(*values: np.ndarray) -> np.ndarray:
    """(2,) the least and the largest of values, without NaN."""
    every = np.concatenate(values)
    return np.array([np.nanmin(every), np.nanmax(every)])


def corners(*fields: Mapping[str, np.ndarray]) -> np.ndarray:
    """(2, 2) lower left and upper right corner of meshes, um."""
    points = np.vstack([each["places_um"] for each in fields])
    return np.array([points.min(axis=0), points.max(axis=0)])


def film(results: Results, name: str, file: Path, ax: Any = None, style: Style = PLAIN) -> Any:
    """Write the fields of all rows as an animated GIF or an MP4; returns the axes with the last
    one.

    Colours and the view are the same in all frames.
    """
    write = _write_mp4 if file.suffix == ".mp4" else _write_gif
    with output_path(file) as beside:
        return write(beside, partial(_frames, results, name, style), ax)


def _write_gif(file: Path, frames: Callable[[Any], Iterator[Any]], ax: Any) -> Any:
    """Write frames in one palette, in the layout of the first one.

    The palette covers the range of colours in at most ten frames. A palette of their most frequent
    colours would lack most of the colour bar.
    """
    image = optional("PIL.Image")
    contents: list[io.BytesIO] = []
    for last in frames(ax):
        contents.append(io.BytesIO())
        last.figure.savefig(contents[-1], format="png", dpi=RESOLUTION)
        last.figure.set_layout_engine("none")
    chosen = contents[::len(contents) // 10 + 1]
    sample = image.fromarray(np.vstack([image.open(each).convert("RGB") for each in chosen]))
    palette = sample.quantize(method=image.Quantize.MAXCOVERAGE)
    first, *others = (image.open(each).convert("RGB").quantize(palette=palette, dither=0)
                      for each in contents)
    first.save(file, format="GIF", save_all=True, append_images=others, duration=FRAME, loop=0)
    return last


def _write_mp4(file: Path, frames: Callable[[Any], Iterator[Any]], ax: Any) -> Any:
    """Write frames by ffmpeg. Raises ImportError if it is not installed."""
    writer = optional("matplotlib.animation").FFMpegWriter
    if not writer.isAvailable():
        raise ImportError("the program ffmpeg is not installed; a film as .gif needs none")
    even = "pad=ceil(iw/2)*2:ceil(ih/2)*2"  # sides, which the format of colours needs
    films = writer(fps=1000 / FRAME, extra_args=["-pix_fmt", "yuv420p", "-vf", even])
    for number, last in enumerate(frames(ax)):
        if number == 0:
            films.setup(last.figure, file, RESOLUTION)
        films.grab_frame()
        last.figure.set_layout_engine("none")
    films.finish()
    return last


def _frames(results: Results, name: str, style: Style, ax: Any) -> Iterator[Any]:
    """Draw the rows one after the other; yields the axes."""
    rows = list(map(results.fields, results.time))
    limits = value_range(*(shown(fields, name, style) for fields in rows))
    box = corners(*rows)
    for time, fields in zip(results.time, rows):
        if ax is not None:
            ax.clear()
        ax = field(fields, name, heading(results, time, style), ax, limits=limits, box=box,
                   style=style)
        yield ax


def heading(results: Results, time: float, style: Style = PLAIN) -> str:
    """The title of a picture, by default the name of the scene, and a time (h)."""
    return f"{style.title or shortened(results.name)}, t = {time:.4g} h"


def key_figures(columns: Mapping[str, np.ndarray]) -> str:
    """First and last values of a run's columns, and the time of contact with the opposite wall."""
    time = columns["time_h"]
    texts = []
    for name in names.ANSWER:
        if name in columns:
            first, last = columns[name][[0, -1]]
            change = f" → {last:.4g}" if len(time) > 1 else ""
            texts.append(f"{names.words(name)} {first:.4g}{change} {names.unit(name)}")
    touching = time[columns["contact"] == 1] if "contact" in columns else time[:0]
    if len(touching):
        texts.append(f"contact with the opposite wall from t = {touching[0]:.4g} h on")
    return f"t = {time[0]:.4g} to {time[-1]:.4g} h: {'; '.join(texts)}"


def figure(fields: Mapping[str, np.ndarray], title: str, time: float) -> str:
    """The acceptor, or the velocity without it, at a time (h) as HTML with a picture, for a
    notebook that shows a run; empty without these fields or matplotlib.
    """
    name = next((name for name in ("acceptor_mg_per_L", "velocity_m_per_d") if name in fields), "")
    if not name:
        return ""
    try:
        new_figure = optional("matplotlib.figure").Figure  # pyplot would show it once more
    except ImportError:
        return ""
    drawn = new_figure(figsize=field_size(corners(fields)), layout="constrained")
    field(fields, name, title, drawn.subplots())
    content = io.BytesIO()
    drawn.savefig(content, format="png", dpi=SMALL)
    picture = base64.b64encode(content.getvalue()).decode("ascii")
    low, high = value_range(magnitude(fields[name]))
    caption = escape(f"{names.with_unit(name)}, {low:.4g} (dark) to {high:.4g} (light), at "
                     f"t = {time:.4g} h; red: boundary of the aggregate")
    return (f'<figure><img alt="{caption}" src="data:image/png;base64,{picture}">'
            f"<figcaption>{caption}</figcaption></figure>")
