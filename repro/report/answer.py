"""The beginning of the page of a run: its answer in words, a small table and a picture."""

from __future__ import annotations

from html import escape

import numpy as np

from repro.report import charts, fields, page, quantities
from repro.report.reading import Run
from repro.results import field_files, names
from repro.results.columns import DETACHED
from repro.results.field_files import Grid

#: Rows of the table, and outlines in the picture, without a row for the contact.
SEVERAL = 5
#: A relative change that the sentence does not name.
UNCHANGED = 1e-3
WIDTH = 640  # of the picture
MARGIN = 8
#: Edges of a triangle by its nodes: two corners and, if sides are curved, the middle.
EDGES: dict[int, list[tuple[int, ...]]] = {
    3: [(0, 1), (1, 2), (2, 0)],
    6: [(0, 1, 3), (1, 2, 4), (2, 0, 5)]}


def build(run: Run) -> str:
    """Sentence, table and picture; a sentence alone of a run without rows."""
    if not len(run.times):
        return "<p>The run has no row: it stopped before the first.</p>"
    table = page.table("", ["t (h)", *map(names.with_unit, _columns(run))], _rows(run))
    return f'<p class="answer">{escape(sentence(run))}</p>{table}{_picture(run)}'


def sentence(run: Run) -> str:
    """The answer in words: last row, end, contact, conductivity, effluents."""
    count, last = len(run.times), run.times[-1]
    parts = [f"{count} rows, to t = {last:g} h." if count > 1 else f"One row, at t = {last:g} h."]
    if count > 1 and "growth" in run.record["tables"]:
        parts += [_end(run), _contact(run)]
    parts += [_detached(run), _change("conductivity", "conductivity_m_per_d", run, ratio=True)]
    parts += [_change(f"{name} in the effluent", f"effluent_{name}_mg_per_L", run)
              for name in ("acceptor", "donor")]
    if "conductivity_m_per_d" not in _columns(run) and count > 1:
        parts.append(_change("area of the aggregate", "aggregate_area_um2", run, ratio=True))
    return " ".join(filter(None, parts))


def _detached(run: Run) -> str:
    """The times at which aggregates have left the pore; empty if none has."""
    masses = run.ledger.get(DETACHED.name, np.zeros(0))
    if not masses.any():
        return ""
    times = ", ".join(f"{time:.6g}" for time in run.ledger["end_h"][masses > 0])
    return f"An aggregate leaves the pore at t = {times} h."


def _end(run: Run) -> str:
    """The end that the scene asks for; the status of the run names any other one."""
    reached = run.record.get("status") == "completed"
    return "The run reaches growth.end." if reached else ""


def _contact(run: Run) -> str:
    touching = quantities.contact(run)
    if touching:
        return f"An aggregate touches the opposite wall from t = {touching[0]:.6g} h on."
    return "No aggregate touches the opposite wall."


def _change(noun: str, name: str, run: Run, ratio: bool = False) -> str:
    """The first and the last value of a column; ratio: with the factor between them."""
    if name not in _columns(run):
        return ""
    values = run.series[name]
    first, last = values[np.isfinite(values)][[0, -1]]
    if abs(last - first) <= UNCHANGED * abs(first):
        stays = "stays at" if len(values) > 1 else "is"
        return f"The {noun} {stays} {_short(first)} {names.unit(name)}."
    verb = "falls" if last < first else "rises"
    low, high = sorted((first, last))
    factor = f", by a factor of {_short(high / low)}" if ratio and low > 0 else ""
    return f"The {noun} {verb} from {_short(first)} to {_short(last)} {names.unit(name)}{factor}."


def _short(value: float) -> str:
    return charts.number(float(f"{value:.3g}"))


def _columns(run: Run) -> list[str]:
    return [name for name in names.ANSWER if np.isfinite(run.series.get(name, np.nan)).any()]


def _rows(run: Run) -> list[list[str]]:
    """Rows at the start, at the end, evenly between them, and at the contact."""
    evenly = np.linspace(run.times[0], run.times[-1], SEVERAL)
    times = {*(run.times[np.abs(run.times - time).argmin()] for time in evenly),
             *quantities.contact(run)}
    return [[f"{time:.6g}", *(_cell(run.series[name][run.times == time][-1])
                              for name in _columns(run))] for time in sorted(times)]


def _cell(value: float) -> str:
    return _short(value) if np.isfinite(value) else "-"


def _picture(run: Run) -> str:
    """The outlines of the aggregates at several times; empty without fields of an aggregate."""
    entries = fields.index(run.folder) if "aggregate" in run.record["tables"] else []
    if not entries:
        return ""
    evenly = np.linspace(0, len(entries) - 1, SEVERAL).round().astype(int)
    chosen = [entries[k] for k in np.unique(evenly)]
    return outlines([time for time, _ in chosen], [field_files.read(path) for _, path in chosen])


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
    cells = grid.cells[grid.cell_data["region"] > 0.5]
    edges = np.vstack([cells[:, edge] for edge in EDGES[grid.cells.shape[1]]])
    _, first, counts = np.unique(np.sort(edges[:, :2], axis=1), axis=0, return_index=True,
                                 return_counts=True)
    nodes = grid.points[edges[first[counts == 1]], :2]
    middle = nodes[:, 2] if nodes.shape[1] == 3 else nodes.mean(axis=1)
    return np.stack([nodes[:, 0], middle, nodes[:, 1]], axis=1)


def _path(sides: np.ndarray, colour: int) -> str:
    """Sides as arcs of parabolas through their middles."""
    control = 2 * sides[:, 1] - sides[:, [0, 2]].mean(axis=1)
    text = "".join(f"M{charts.point(*start)}Q{charts.point(*bend)} {charts.point(*end)}"
                   for (start, _, end), bend in zip(sides.tolist(), control.tolist()))
    return f'<path class="line{colour % charts.COLOURS}" d="{text}"/>'
