"""The page of one run."""

from __future__ import annotations

import html

import numpy as np

from repro.report import answer, charts, fields, page, quantities
from repro.report.colours import viridis
from repro.report.reading import Run
from repro.results import names

#: The physics of each section of a scene.
PHYSICS = {
    "flow": "Stokes flow through pore and aggregate (2.1)",
    "substrates": "electron acceptor and donor, or one of them (2.2)",
    "aggregate": "one or more aggregates of biomass on the walls",
    "kinetics": "uptake, growth and decay (2.2)",
    "growth": "growth of the aggregate as a neo-Hookean body (2.3)",
}
#: Keys of ``run.json`` that have their own place in the page.
OWN_PLACE = {"scene", "hash", "sha256", "tables", "versions", "status", "rows", "wall_time_s",
        "wall_time_by_stage_s", "newton_iterations", "remeshes", "warnings", "files", "origin"}

NESTED = ("Each bar is the time within a stage. A stage includes the time of those that it calls, "
          "such as factorising and solving, so the sum of the bars exceeds the total time.")
#: Simplifications that a scene may choose; those of [numerics] apply if the section in NEEDED is
#: present.
ASSUMED = {
    ("growth", "fluid_forces", "neglected"):
        "the fluid's traction on the aggregate neglected (2.3.3)",
    ("growth", "new_biomass", "stressed"): "strain counted from t = 0 (2.3)",
    ("numerics", "transport", "quasi_steady"): "substrates at rest in each shape (quasi-steady)",
    ("numerics", "extent", "central"): "a clean channel outside of the meshed part (3.1)",
}
NEEDED = {"transport": "substrates", "extent": "aggregate"}
#: The numerics in the head of the page, and the section without which they do not matter. Runs of
#: earlier versions may have elements and time.
NUMERICS = {"preset": None, "elements": None, "refinement": None, "transport": "substrates",
            "time": "growth"}

#: Colours of a field. Neighbours cannot be told apart.
BANDS = 128

CONTROLS = """<div class="controls"><label>Field <select id="field"></select></label>
<label><input type="checkbox" id="lines"> mesh</label>
<label{aggregate}><input type="checkbox" id="outline" checked> outline of the aggregate</label>
<label{several}><input type="checkbox" id="fixed"> one colour scale for all times</label>
<label{several}><input type="checkbox" id="whole" checked> one frame for all times</label>
<button type="button" id="save">Save the picture</button></div>
<div class="time"{several}><button type="button" id="play">Play</button>
<input type="range" id="frame" min="0" value="0" step="1" aria-label="time">\
<output id="now"></output></div>
<div class="scroll"><svg id="picture" role="img" tabindex="0" font-size="12" \
font-family="system-ui, sans-serif"></svg></div>\
<output id="probe" aria-live="polite">&nbsp;</output>"""


def build(run: Run) -> str:
    """The text of the page. Raises OutputError if a file of fields cannot be read."""
    drawn = _charts(run)
    before = []
    if "before_expansion.pvd" in run.record["files"]:
        before = fields.index(run.folder, "before_expansion.pvd")
    packed = fields.packed(fields.index(run.folder), before, len(drawn))
    more = ""
    if packed:
        start = _first_shown(packed, quantities.contact(run))
        more = page.data("fields", packed | {"start": start, "colours": viridis(BANDS)})
    tables = run.record["tables"]
    missing = [name for name in PHYSICS if name not in tables]
    note = f'<p class="note">Not modelled: {", ".join(missing)}.</p>' if missing else ""
    scene = "".join(page.table(f"[{name}]", [], _pairs(part)) for name, part in tables.items())
    if scene:
        scene = ("<details><summary>The scene, every key</summary>"
                 f'<div class="tables">{scene}</div></details>')
    body = (_head(run) + _fields(run, packed) + drawn
            + f'<div class="pair">{_numbers(run)}{_cost(run)}</div>'
            + page.section("What was modelled", note, scene) + _provenance(run))
    scripts = ["errors.js", "charts.js", *(["mesh.js", "fields.js"] if packed else [])]
    return page.page(f"{run.record['scene']}: a pore", body + more, scripts)


def _first_shown(packed: dict, contact: list[float]) -> dict[str, str | int]:
    """The field and the frame that the page opens with: the acceptor at the last time before
    contact, or at the end."""
    names_shown = [field["name"] for field in packed["fields"]]
    first = "acceptor_mg_per_L"
    before = [k for k, frame in enumerate(packed["frames"])
              if not contact or frame["time"] < contact[0]]
    return {"field": first if first in names_shown else names_shown[0],
            "frame": before[-1] if before else len(packed["frames"]) - 1}


def _head(run: Run) -> str:
    status = run.record["status"]
    stopped = "" if status == "completed" else " stopped"
    items = "".join(f"<li>Warning: <b>{html.escape(warning['key'])}</b>: "
                    f"{html.escape(warning['text'])}</li>" for warning in run.record["warnings"])
    warnings = f'<ul class="warnings" aria-label="warnings">{items}</ul>' if items else ""
    modelled = "; ".join(words for name, words in PHYSICS.items() if name in run.record["tables"])
    return (f"<header><h1>{html.escape(run.record['scene'])}</h1>"
            f'<p class="status{stopped}">{html.escape(status[0].upper() + status[1:])}</p>'
            f"{answer.build(run)}"
            f"{warnings}"
            f"<p>Modelled: {html.escape(modelled or 'the geometry and its mesh')}. "
            f"{html.escape(_assumed(run))} {html.escape(_numerics(run))}</p></header>\n")


def _assumed(run: Run) -> str:
    """The simplifications of the scene in words."""
    tables = run.record["tables"]
    assumptions = [words for (part, key, value), words in ASSUMED.items()
            if tables.get(part, {}).get(key) == value
            and (part != "numerics" or NEEDED[key] in tables)]
    ends = {"bonding_strength", "tensile_strength"} & tables.get("growth", {}).keys()
    fate = "a run ends where the aggregate detaches or tears" if ends else "no detachment"
    if tables.get("growth", {}).get("after_detachment") == "continue":
        fate = "an aggregate that detaches leaves the pore"
    if "erosion" in tables.get("growth", {}):
        fate += ", surfaces erode"
    bodies = tables.get("aggregate")
    count = f"{len(bodies)} aggregates" if isinstance(bodies, list) else "one aggregate"
    assumptions.insert(0, f"a pore in the plane, {count}, {fate}")
    return f"Assumed: {'; '.join(assumptions)}."


def _numerics(run: Run) -> str:
    """The most important numerical choices in words."""
    tables = run.record["tables"]
    numerics = tables["numerics"]
    choices = [f"{key} {page.format_value(numerics[key])}".replace("_", "-")
               for key, part in NUMERICS.items()
               if key in numerics and (part is None or part in tables)]
    return f"Numerics: {', '.join(choices)}." if choices else ""


def _fields(run: Run, packed: dict) -> str:
    if not packed:
        return ""
    hidden = {True: "", False: " hidden"}
    controls = CONTROLS.format(aggregate=hidden["aggregate" in run.record["tables"]],
                               several=hidden[packed["of"] > 1])
    return page.section("Fields and mesh", controls, f'<p class="note">{_field_note(packed)}</p>')


def _field_note(packed: dict) -> str:
    quadratic = packed["meshes"][0]["per"] == 6
    note = "Quadratic triangles, drawn curved" if quadratic else "Linear triangles"
    if packed["nodes"] > fields.MOST_NODES:
        note = f"A mesh of {packed['nodes']} nodes, shown on a regular grid of triangles"
    unexpanded = sum("note" in frame for frame in packed["frames"])
    count, total = len(packed["frames"]) - unexpanded, packed["of"]
    times = f"all {total} times shown" if total > 1 else "one time"
    times = f"{count} of {total} times shown" if count < total else times
    besides = ", those grown and not yet expanded besides" if unexpanded else ""
    in_bodies = any(field["body"] for field in packed["fields"])
    fluid = ", and the fluid where a field exists in the aggregate alone" if in_bodies else ""
    slider = " Arrow keys also move the slider." if total > 1 else ""
    return (f"{note}; {times}{besides}. Values are rounded to 1/65534 of their range; the .vtu "
            "files have every time and digit. Colours span the values that are shown, on a "
            "logarithmic scale from a factor of 100 on, over four decades at most. Grey is the "
            f"part of the pore that is not meshed at that time{fluid}. Point at the picture for a "
            f"value, or focus it and press the arrow keys.{slider}")


def _charts(run: Run) -> str:
    """Charts of the pore and, apart from them, of the mesh and its numerics."""
    drawn = quantities.charts_of(run)
    if not drawn:
        return ""
    note = ("Point at a chart for its values, or focus it and press the arrow keys; a click or "
            "Enter shows the fields of that time.")
    if touching := quantities.contact(run):
        note += f" Dotted: contact with the opposite wall, t = {touching[0]:.6g} h."
    if len(run.times) > charts.MOST_POINTS:
        note += f" {charts.MOST_POINTS} of {len(run.times)} rows are drawn."
    constant = quantities.constants_of(run)
    listed = f"<p>Constant: {html.escape('; '.join(constant))}.</p>" if constant else ""
    figures = {True: "", False: ""}
    for chart in drawn:
        figures[chart.of_mesh] += charts.svg(chart)
    of_pore, of_mesh = (figures[kind] and f'<div class="charts">{figures[kind]}</div>'
                        for kind in (False, True))
    return (page.section("Over time", f'<p class="note">{note}</p>', listed, of_pore)
            + page.section("Of the mesh and the balances, not of the pore", of_mesh))


def _numbers(run: Run) -> str:
    """The first and the last row."""
    if not len(run.times):
        return page.section("Numbers", "<p>The run has no row: it stopped before the first.</p>")
    ends = [0, -1] if len(run.times) > 1 else [0]
    rows = []
    for name, series in run.series.items():
        values = series[ends]
        if name in names.YES_NO and np.isfinite(values).all():
            rows.append([names.words(name), *map(page.format_value, (values == 1).tolist())])
        elif name != "time_h" and np.isfinite(values).all():
            symbol, factor = names.readable_unit(name, [values])
            rows.append([names.with_unit(name, symbol),
                         *map(charts.number, (factor * values).tolist())])
    head = ["", *(f"t = {time:.6g} h" for time in run.times[ends])]
    return page.section("Numbers", page.table("", head, rows))


def _pairs(part: object) -> list[tuple[str, str]]:
    """(key, value as text) of a part of the record."""
    return [(key, page.format_value(value)) for key, value in page.flat(part).items()]


def _cost(run: Run) -> str:
    record, total = run.record, run.record["wall_time_s"]
    iterations = page.flat(record["newton_iterations"])
    counts = [(f"Newton iterations, {name}", value) for name, value in iterations.items() if value]
    if "growth" in record["tables"]:
        counts.append(("new meshes", record["remeshes"]))
    total_text = f"<p>{total:.3g} s in all, without this page.</p>"
    bars = _bars(record["wall_time_by_stage_s"], total)
    return page.section("Cost", total_text, bars, page.table("", [], counts))


def _bars(stages: dict, total: float) -> str:
    """Seconds by stage, the longest first; the lengths are parts of the total. Empty without any.
    """
    positive = sorted((-value, name) for name, value in stages.items() if value > 0)
    rows = ""
    for k, (negative, name) in enumerate(positive):
        top, width = 22 * k, 150 * min(1.0, -negative / total)
        rows += (f'<text x="0" y="{top + 15}">{html.escape(name)}</text>'
                 f'<rect x="135" y="{top + 4}" width="{width:.1f}" height="14"/>'
                 f'<text x="{140 + width:.1f}" y="{top + 15}">{-negative:.3g} s</text>')
    return rows and (f'<svg class="bars" viewBox="0 0 340 {22 * len(positive) + 4}" role="img" '
                     f'aria-label="seconds by stage">{rows}</svg><p class="note">{NESTED}</p>')


def _provenance(run: Run) -> str:
    """Versions, the hash of the scene, and the other keys of ``run.json``."""
    record = run.record
    rest = {key: value for key, value in record.items() if key not in OWN_PLACE}
    versions = [("scene hash", record["hash"]),
                *page.flat(record["versions"]).items()]
    return page.section("Made with", page.table("", [], versions),
                        page.table("Also recorded", [], _pairs(rest)))
