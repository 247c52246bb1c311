"""The beginning of the page of a run: its answer in words, a small table and a picture."""

from html import escape

import numpy as np

from repro.report import charts, fields, page, quantities
from repro.report.reading import Run
from repro.results import field_files, names
from repro.results.columns import DETACHED, SUBSTRATES
from repro.results.field_files import Grid
from repro.results.outlines import boundary

#: Rows of the table, and outlines in the picture, without a row for the contact.
SEVERAL = 5
WIDTH = 640  # of the picture
MARGIN = 8


def build(run: Run) -> str:
    """Sentence, table and picture; a sentence alone of a run without rows."""
    if not len(run.times):
        return "<p>The run has no row: it stopped before the first.</p>"
    table = page.table("", ["t (h)", *map(names.with_unit, _columns(run))], _rows(run))
    picture = ""
    if entries := fields.index(run.folder) if "aggregate" in run.record["tables"] else []:
        evenly = np.linspace(0, len(entries) - 1, SEVERAL).round().astype(int)
        chosen = [entries[k] for k in np.unique(evenly)]
        picture = outlines([time for time, _ in chosen],
                           [field_files.read(path) for _, path in chosen])
    return f'<p class="answer">{escape(sentence(run))}</p>{table}{picture}'


def sentence(run: Run) -> str:
    """The answer in words: last row, end, contact, conductivity, effluents.

    It names the end that the scene asks for; the status of the run names any other one.
    """
    count, last = len(run.times), run.times[-1]
    columns = _columns(run)
    parts = [f"{count} rows, to t = {last:g} h." if count > 1 else f"One row, at t = {last:g} h."]
    if count > 1 and "growth" in run.record["tables"]:
        if run.record.get("status") == "completed":
            parts.append("The run reaches growth.end.")
        touching = quantities.contact(run)
        parts.append(f"An aggregate touches the opposite wall from t = {touching[0]:.6g} h on."
                     if touching else "No aggregate touches the opposite wall.")
    masses = run.ledger.get(DETACHED.name, np.zeros(0))
    if masses.any():
        if "erosion" not in run.record["tables"]["growth"]:
            times = ", ".join(f"{time:.6g}" for time in run.ledger["end_h"][masses > 0])
            parts.append(f"An aggregate leaves the pore at t = {times} h.")
        parts.append(f"In all, {_short(masses.sum() / 1e6)} ug/m of biomass detaches.")
    changes = {"conductivity_m_per_d": "conductivity",
               **{f"effluent_{name}_mg_per_L": f"{name} in the effluent" for name in SUBSTRATES}}
    if "conductivity_m_per_d" not in columns and count > 1:
        changes["aggregate_area_um2"] = "area of the aggregate"
    parts += [_change(noun, name, run) for name, noun in changes.items() if name in columns]
    return " ".join(parts)


def _change(noun: str, name: str, run: Run) -> str:
    """The first and the last value of a column, and the factor between those of the pore."""
    values = run.series[name]
    first, last = values[np.isfinite(values)][[0, -1]]
    if _short(first) == _short(last):
        stays = "stays at" if len(values) > 1 else "is"
        return f"The {noun} {stays} {_short(first)} {names.unit(name)}."
    verb = "falls" if last < first else "rises"
    low, high = sorted((first, last))
    has_factor = low > 0 and not name.startswith("effluent")
    factor = f", by a factor of {_short(high / low)}" if has_factor else ""
    return f"The {noun} {verb} from {_short(first)} to {_short(last)} {names.unit(name)}{factor}."


def _short(value: float) -> str:
    return charts.number(float(f"{value:.3g}")) if np.isfinite(value) else "-"


def _columns(run: Run) -> list[str]:
    return [name for name in names.ANSWER if np.isfinite(run.series.get(name, np.nan)).any()]


def _rows(run: Run) -> list[list[str]]:
    """Rows at the start, at the end, evenly between them, and at the contact."""
    evenly = np.linspace(run.times[0], run.times[-1], SEVERAL)
    times = {*(run.times[np.abs(run.times - time).argmin()] for time in evenly),
             *quantities.contact(run)}
    return [[f"{time:.6g}", *(_short(run.series[name][run.times == time][-1])
                              for name in _columns(run))] for time in sorted(times)]


def outlines(times: list[float], grids: list[Grid]) -> str:
    """A figure with the outlines of the aggregates between the walls, a line a time."""
    sides = [_sides(grid) for grid in grids]
    top = max(grid.points[:, 1].max() for grid in grids)
    x = np.hstack([side[:, :, 0].ravel() for side in sides])
    left, right = (x.min() - top, x.max() + top) if len(x) else (-top, top)
    scale = (WIDTH - 2 * MARGIN) / (right - left)
    height = scale * top + 2 * MARGIN
    factor, origin = np.array([scale, -scale]), [MARGIN - scale * left, height - MARGIN]
    walls = "".join(f'<line class="tick" x1="0" x2="{WIDTH}" y1="{y:.1f}" y2="{y:.1f}"/>'
                    for y in (MARGIN, height - MARGIN))
    lines = "".join(_path(factor * side + origin, k) for k, side in enumerate(sides))
    legend = "".join(f"<span>{charts.swatch(k)}{time:.6g} h</span>"
                     for k, time in enumerate(times))
    return (f'<figure class="outlines"><svg viewBox="0 0 {WIDTH} {height:.0f}" role="img" '
            f'aria-label="outlines of the aggregates">{walls}{lines}</svg><figcaption>Outlines '
            f'between the walls, which are {top:.4g} um apart<span class="legend">{legend}</span>'
            "</figcaption></figure>")


def _sides(grid: Grid) -> np.ndarray:
    """(E, 3, 2) um: start, middle and end of each side of a triangle on an outline."""
    edges, _ = boundary(grid.cells, grid.cell_data["region"] > 0.5)
    nodes = grid.points[edges, :2]
    middle = nodes[:, 1] if nodes.shape[1] == 3 else nodes.mean(axis=1)
    return np.stack([nodes[:, 0], middle, nodes[:, -1]], axis=1)


def _path(sides: np.ndarray, colour: int) -> str:
    """Sides as arcs of parabolas through their middles."""
    control = 2 * sides[:, 1] - sides[:, [0, 2]].mean(axis=1)
    text = "".join(f"M{charts.point(*start)}Q{charts.point(*bend)} {charts.point(*end)}"
                   for (start, _, end), bend in zip(sides.tolist(), control.tolist()))
    return f'<path class="line{colour % charts.COLOURS}" d="{text}"/>'
