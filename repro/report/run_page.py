"""The page of one run."""

import html

import numpy as np

from repro.preflight.modelled import describe_model
from repro.report import answer, charts, fields, page, quantities
from repro.report.colours import viridis
from repro.report.reading import Run
from repro.results import names
from repro.scene import SceneError

#: Keys of ``run.json`` that have their own place in the page.
OWN_PLACE = {"scene", "hash", "sha256", "tables", "versions", "status", "rows", "wall_time_s",
        "wall_time_by_stage_s", "newton_iterations", "remeshes", "warnings", "files", "origin"}

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
        colours = viridis(128)  # neighbours look alike
        more = page.data("fields", packed | {"start": start, "colours": colours})
    tables = run.record["tables"]
    scene = "".join(page.table(f"[{name}]", [], _pairs(part)) for name, part in tables.items())
    if scene:
        scene = ("<details><summary>The scene, every key</summary>"
                 f'<div class="tables">{scene}</div></details>')
    body = (_head(run) + _fields(run, packed) + drawn
            + f'<div class="pair">{_numbers(run)}{_cost(run)}</div>'
            + page.section("What was modelled", scene) + _provenance(run))
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
    try:
        sections = describe_model(run.scene)
    except SceneError as error:
        sections = [("not read", str(error))]
    modelled = "".join(f"<li><b>{section}</b>: {html.escape(words)}</li>"
                       for section, words in sections)
    return (f"<header><h1>{html.escape(run.record['scene'])}</h1>"
            f'<p class="status{stopped}">{html.escape(status[0].upper() + status[1:])}</p>'
            f"{answer.build(run)}"
            f"{warnings}"
            f"<p>Modelled, by the sections of the scene:</p><ul>{modelled}</ul></header>\n")


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
    return (f"{note}; {times}{besides}. Values are rounded to 1/{fields.LEVELS} of their range; "
            "the .vtu files have every time and digit. Colours span the values that are shown, on "
            "a logarithmic scale from a factor of 100 on, over four decades at most. Grey is the "
            f"part of the pore that is not meshed at that time{fluid}. Point at the picture for a "
            f"value, or focus it and press the arrow keys.{slider}")


def _charts(run: Run) -> str:
    """Charts of the pore and, apart from them, of the mesh and its numerics."""
    drawn = quantities.charts_of(run)
    if not drawn:
        return ""
    note = ("Point at a chart for its values, or focus it and press the arrow keys; a click or "
            "Enter shows the fields of that time. Numbers has what does not change.")
    if touching := quantities.contact(run):
        note += f" Dotted: contact with the opposite wall, t = {touching[0]:.6g} h."
    if len(run.times) > charts.MOST_POINTS:
        note += f" {charts.MOST_POINTS} of {len(run.times)} rows are drawn."
    figures = {True: "", False: ""}
    for chart in drawn:
        figures[chart.of_mesh] += charts.svg(chart)
    of_pore, of_mesh = (figures[kind] and f'<div class="charts">{figures[kind]}</div>'
                        for kind in (False, True))
    return (page.section("Over time", f'<p class="note">{note}</p>', of_pore)
            + page.section("Of the mesh and the balances, not of the pore", of_mesh))


def _numbers(run: Run) -> str:
    """The first and the last row; empty without rows."""
    if not len(run.times):
        return ""
    ends = [0, -1][:len(run.times)]
    rows = []
    for name, series in run.series.items():
        values = series[ends]
        quantity = names.known(name)
        if quantity and quantity.yes_no and np.isfinite(values).all():
            rows.append([quantity.words, *map(page.format_value, (values == 1).tolist())])
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
    stages = sorted(((seconds, name) for name, seconds in record["wall_time_by_stage_s"].items()
                     if seconds > 0), reverse=True)
    times = page.table("", [], [(name, f"{seconds:.3g} s") for seconds, name in stages])
    note = times and ('<p class="note">A stage includes the time of those that it calls, such as '
                      "factorising and solving, so the sum of the stages exceeds the total time."
                      "</p>")
    return page.section("Cost", total_text, times, note, page.table("", [], counts))


def _provenance(run: Run) -> str:
    """Versions, the hash of the scene, and the other keys of ``run.json``."""
    record = run.record
    rest = {key: value for key, value in record.items() if key not in OWN_PLACE}
    versions = [("scene hash", record["hash"]),
                *page.flat(record["versions"]).items()]
    return page.section("Made with", page.table("", [], versions),
                        page.table("Also recorded", [], _pairs(rest)))
