"""The page of one run."""

from __future__ import annotations

import html

import numpy as np

from repro.report import charts, fields, page, quantities
from repro.report.reading import Run
from repro.results import names

#: What each section of a scene stands for.
PHYSICS = {
    "flow": "Stokes flow through pore and aggregate (2.1)",
    "substrates": "two substrates, an electron acceptor and a donor (2.2)",
    "aggregate": "an aggregate of biomass on the lower wall",
    "kinetics": "uptake, growth and decay (2.2)",
    "growth": "growth of the aggregate as a neo-Hookean body (2.3)",
}
#: What the page tells in a place of its own.
TOLD = {"scene", "hash", "sha256", "tables", "versions", "status", "rows", "wall_time_s",
        "wall_time_by_stage_s", "newton_iterations", "remeshes", "warnings", "files", "origin"}

NESTED = ("Each bar is the time within that stage, calls within calls counted in both: what is "
          "spent on factorising and solving is also in the stage that asked for it, so that the "
          "bars do not add up to the whole.")
#: Choices of a scene that leave something out, in words; those of [numerics] hold where NEEDED is.
ASSUMED = {
    ("growth", "fluid_forces", "neglected"):
        "the fluid's traction on the aggregate neglected (2.3.3)",
    ("growth", "new_biomass", "stressed"): "strain counted from t = 0 (2.3)",
    ("numerics", "transport", "quasi_steady"): "substrates at rest in each shape (quasi-steady)",
    ("numerics", "extent", "central"): "a clean channel outside of the meshed part (3.1)",
}
NEEDED = {"transport": "substrates", "extent": "aggregate"}
#: The numerics that the head of the page tells, and what must be modelled for them to matter.
NUMERICS = {"preset": None, "elements": None, "refinement": None, "transport": "substrates",
            "time": "growth", "transfer": "growth"}

CONTROLS = """<div class="controls"><label>Field <select id="field"></select></label>
<label><input type="checkbox" id="lines"> mesh</label>
<label{aggregate}><input type="checkbox" id="outline" checked> outline of the aggregate</label>
<label{several}><input type="checkbox" id="fixed" checked> one colour scale for all times</label>
<label{several}><input type="checkbox" id="whole" checked> one frame for all times</label></div>
<div class="time"{several}><button type="button" id="play">Play</button>
<input type="range" id="frame" min="0" value="0" step="1" aria-label="time">\
<output id="now"></output></div>
<div class="scroll"><canvas id="picture" role="img"></canvas></div>\
<output id="probe">&nbsp;</output>"""


def build(run: Run) -> str:
    """The page's text. Raises ValueError where a file of fields cannot be read."""
    drawn = _charts(run, quantities.charts_of(run))
    packed = _packed(run, len(drawn))
    body = (_head(run) + _fields(run, packed) + drawn
            + f'<div class="pair">{_numbers(run)}{_cost(run)}</div>' + _modelled(run)
            + _others(run))
    more = page.data("fields", packed) if packed else ""
    return page.page(f"{run.record.get('scene')}: a pore", body + more,
                     ["charts.js", *(["mesh.js", "fields.js"] if packed else [])])


def _packed(run: Run, spent: int) -> dict:
    try:
        own = "before_expansion.pvd" in _list(run.record.get("files"))
        before = fields.index(run.folder, "before_expansion.pvd") if own else []
        return fields.packed(fields.index(run.folder), before, spent)
    except (ValueError, LookupError, TypeError) as error:
        raise ValueError(f"{run.folder}: the fields cannot be read: {error!r}") from error


def _head(run: Run) -> str:
    status = str(run.record.get("status") or "status unknown")
    stopped = "" if status == "completed" else " stopped"
    there = [words for name, words in PHYSICS.items() if name in _tables(run)]
    return (f"<header><h1>{html.escape(str(run.record.get('scene')))}</h1>"
            f'<p class="status{stopped}">{html.escape(status[0].upper() + status[1:])}</p>'
            f"{_rows_note(run)}"
            f"{_warnings(run)}"
            f"<p>{html.escape(_sentence(there))} {html.escape(_assumed(run))} "
            f"{html.escape(_numerics(run))}</p></header>\n")


def _rows_note(run: Run) -> str:
    """How many rows there are, and to what time; nothing of a single row."""
    if len(run.times) < 2:
        return ""
    return f'<p class="note">{len(run.times)} rows, to t = {run.times[-1]:g} h.</p>'


def _warnings(run: Run) -> str:
    """The list of the record's warnings; nothing without any."""
    items = "".join(map(_warning, _list(run.record.get("warnings"))))
    return f'<ul class="warnings" aria-label="warnings">{items}</ul>' if items else ""


def _warning(one: object) -> str:
    """A warning of the record, which has the scene's key and a text, as an item of a list."""
    if not isinstance(one, dict):
        return f"<li>{html.escape(str(one))}</li>"
    key = html.escape(str(one.get("key")))
    return f"<li>Warning: <b>{key}</b>: {html.escape(str(one.get('text')))}</li>"


def _tables(run: Run) -> dict:
    return _table(run.record.get("tables"))


def _list(value: object) -> list:
    return value if isinstance(value, list) else [] if value is None else [value]


def _sentence(parts: list[str]) -> str:
    return f"Modelled: {'; '.join(parts)}." if parts else "Modelled: the geometry and its mesh."


def _assumed(run: Run) -> str:
    """The simplifications that the scene has chosen, in words."""
    tables = _tables(run)
    told = [words for (part, key, value), words in ASSUMED.items()
            if _table(tables.get(part)).get(key) == value
            and (part != "numerics" or NEEDED[key] in tables)]
    return f"Assumed: {'; '.join(['a pore in the plane, one aggregate, no detachment', *told])}."


def _numerics(run: Run) -> str:
    """The choices that matter most, in words."""
    tables = _tables(run)
    known = _table(tables.get("numerics"))
    told = [f"{key} {page.shown(known[key])}".replace("_", "-") for key, part in NUMERICS.items()
            if key in known and (part is None or part in tables)]
    return f"Numerics: {', '.join(told)}." if told else ""


def _fields(run: Run, packed: dict) -> str:
    if not packed:
        return ""
    hidden = {True: "", False: " hidden"}
    controls = CONTROLS.format(aggregate=hidden["aggregate" in _tables(run)],
                               several=hidden[packed["of"] > 1])
    return page.section("Fields and mesh", controls, f'<p class="note">{_field_note(packed)}</p>')


def _field_note(packed: dict) -> str:
    quadratic = packed["meshes"][0]["per"] == 6
    note = "Quadratic triangles, drawn curved" if quadratic else "Linear triangles"
    if packed["nodes"] > fields.MOST_NODES:
        note = f"A mesh of {packed['nodes']} nodes, shown on a regular grid of triangles"
    noted = sum("note" in frame for frame in packed["frames"])
    note += (f"; {_times_note(len(packed['frames']) - noted, packed['of'])}"
             f"{', those grown and not yet expanded besides' if noted else ''}. Values are rounded "
             "to 1/65534 of their range; the .vtu files have every time and digit.")
    if any(field["body"] for field in packed["fields"]):
        note += " Fields of the aggregate alone leave the fluid grey."
    return note + (" Arrow keys move the slider." if packed["of"] > 1 else "")


def _times_note(shown: int, of: int) -> str:
    """How many of the times with fields are shown."""
    if shown < of:
        return f"{shown} of {of} times shown"
    return f"all {of} times shown" if of > 1 else "one time"


def _charts(run: Run, drawn: list[charts.Chart]) -> str:
    if not drawn:
        return ""
    note = "Point at a chart for its values; a click shows the fields of that time."
    if touching := quantities.contact(run):
        note += f" Dotted: contact with the opposite wall, t = {touching[0]:.6g} h."
    if len(run.times) > charts.MOST_POINTS:
        note += f" {charts.MOST_POINTS} of {len(run.times)} rows are drawn."
    figures = "".join(map(charts.svg, drawn))
    return page.section("Over time", f'<p class="note">{note}</p>',
                        f'<div class="charts">{figures}</div>')


def _numbers(run: Run) -> str:
    """The first and the last row."""
    if not len(run.times):
        return page.section("Numbers", "<p>The run has no row: it stopped before the first.</p>")
    ends = [0, -1] if len(run.times) > 1 else [0]
    head = ["", *(f"t = {time:.6g} h" for time in run.times[ends])]
    rows = [(names.with_unit(name), *_told(name, values[ends]))
            for name, values in run.series.items()
            if name != "time_h" and np.isfinite(values[ends]).all()]
    return page.section("Numbers", page.table("", head, rows))


def _told(name: str, values: np.ndarray) -> list[str]:
    """The values of a column for people to read."""
    if name in names.YES_NO:
        return [page.shown(value == 1) for value in values.tolist()]
    return [charts.number(value) for value in values.tolist()]


def _modelled(run: Run) -> str:
    """The scene as read, a table a section."""
    tables = _tables(run)
    missing = [name for name in PHYSICS if name not in tables]
    note = f'<p class="note">Not modelled: {", ".join(missing)}.</p>' if missing else ""
    found = "".join(page.table(f"[{name}]", [], _pairs(part)) for name, part in tables.items())
    scene = ("<details><summary>The scene, every key</summary>"
             f'<div class="tables">{found}</div></details>')
    return page.section("What was modelled", note, scene if found else "")


def _pairs(part: object) -> list[tuple[str, str]]:
    """(key, value for people to read) of a part of the record."""
    return [(key, page.shown(value)) for key, value in page.flat(part).items()]


def _cost(run: Run) -> str:
    record, total = run.record, _positive(run.record.get("wall_time_s"))
    iterations = page.flat(_table(record.get("newton_iterations")))
    counts = [(f"Newton iterations, {name}", value) for name, value in iterations.items() if value]
    if "growth" in _tables(run) and "remeshes" in record:
        counts.append(("meshes made anew", record["remeshes"]))
    whole = f"<p>{total:.3g} s in all, without this page.</p>" if total else ""
    bars = _bars(_table(record.get("wall_time_by_stage_s")), total) if total else ""
    return page.section("Cost", whole, bars, page.table("", [], counts))


def _table(value: object) -> dict:
    return value if isinstance(value, dict) else {}


def _positive(value: object) -> float:
    """The value where it is a number of seconds that can be drawn, else zero."""
    return float(value) if isinstance(value, int | float) and 0 < value < 1e30 else 0.0


def _bars(stages: dict, total: float) -> str:
    """Seconds by stage, the longest first, as parts of the whole.

    Nothing where no stage has taken any time.
    """
    known = [(name, value) for name, value in stages.items() if _positive(value)]
    if not known:
        return ""
    known.sort(key=lambda each: -each[1])
    rows = "".join(_bar(22 * k, name, value, 150 * min(1.0, value / total))
                   for k, (name, value) in enumerate(known))
    return (f'<svg class="bars" viewBox="0 0 340 {22 * len(known) + 4}" role="img" '
            f'aria-label="seconds by stage">{rows}</svg><p class="note">{NESTED}</p>')


def _bar(top: float, name: str, seconds: float, width: float) -> str:
    return (f'<text x="0" y="{top + 15}">{html.escape(name)}</text>'
            f'<rect x="135" y="{top + 4}" width="{width:.1f}" height="14"/>'
            f'<text x="{140 + width:.1f}" y="{top + 15}">{seconds:.3g} s</text>')


def _others(run: Run) -> str:
    """Versions, the hash of the scene, and whatever else the run has recorded."""
    record = run.record
    rest = {key: value for key, value in record.items() if key not in TOLD}
    versions = [("scene hash", record.get("hash", "unknown")),
                *page.flat(_table(record.get("versions"))).items()]
    return page.section("Made with", page.table("", [], versions),
                        page.table("Also recorded", [], _pairs(rest)))
