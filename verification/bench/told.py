"""What the benchmark has measured, told: verdicts, lines for a terminal, pictures.

What is claimed of speed and accuracy is judged here by the numbers of a record; the verdicts are written nowhere else.
Ratios are of wall times of one run; those of processor times, which other users of the machine disturb less, are told
beside them.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import nan
from pathlib import Path

from verification.bench import runs
from verification.bench.record import envelope, reading
from verification.bench.record import line as line_of

#: (error, least ratio, aim) of the paper's scheme at its own best speed over a preset.
FASTER = {runs.FAST: (0.01, 5.0, 10.0), runs.ACCURATE: (0.001, 20.0, 20.0)}
WIDE, ACCURATE_RUN = 12.0, 3.0
OTHERS, TIMES_FASTER = ("fipy", "py-pde, compiled"), 10.0
#: Largest ratio of a growth step to its floor: from 2500 nodes on, and at 600, which is between the two of SMALL.
FLOOR, SMALL_FLOOR, SMALL = 1.5, 2.0, (500, 1500)
#: What a scene may take above the stages that it needs, over the whole model's time.
EXCESS = 0.1
NOT_MEASURED = "not measured"


def judged(record: dict) -> list[dict]:
    """All verdicts of a record; what it has not measured neither holds nor fails."""
    parts = record["parts"]
    return [*_base(parts.get("base", {})), *_others(parts), *_steps(parts.get("size", {})),
            *_scenes(parts.get("scenes", {})), *_memory(parts.get("memory", {}))]


def verdict(claim: str, wanted: str, measured: str = NOT_MEASURED, holds: bool | None = None) -> dict:
    """One of them."""
    return {"claim": claim, "measured": measured, "wanted": wanted, "holds": None if holds is None else bool(holds)}


def _base(part: dict) -> Iterator[dict]:
    paper = (line_of(part, runs.PRESET_PAPER) or {}).get("points", [])
    for name, (error, least, aim) in FASTER.items():
        point = next(iter((line_of(part, name) or {}).get("points", [])), None)
        claim = f"base: the error of {name} is at most {100 * error:g} %"
        if point is None:
            yield verdict(claim, f"at most {100 * error:g} %")
        else:
            yield verdict(claim, f"at most {100 * error:g} %", f"{100 * point['error']:.2g} %", point["error"] <= error)
        yield _faster(name, paper, point, error, f"{100 * error:g} %", least, aim)
        if point is not None and point["error"] > 0:
            yield _faster(name, paper, point, point["error"], "the error that the preset has", least, aim)
    point = next(iter((line_of(part, runs.ACCURATE) or {}).get("points", [])), None)
    claim, wanted = f"base: {runs.ACCURATE} takes about {ACCURATE_RUN:g} s", f"at most {ACCURATE_RUN:g} s"
    yield verdict(claim, wanted, _seconds(point), point["seconds"] <= ACCURATE_RUN) if point else verdict(claim, wanted)
    yield _wide(part.get("wide"))


def _faster(name: str, paper: list[dict], point: dict | None, error: float, words: str, least: float,
            aim: float) -> dict:
    claim = f"base: {name} is faster than the paper's scheme at its own best speed for {words}"
    wanted = f"at least {least:g} times" + (f" (aim {aim:g})" if aim > least else "")
    best = reading(paper, error)
    if point is None or best is None:
        return verdict(claim, wanted)
    ratio, cpu = best.seconds / point["seconds"], best.cpu / point["cpu"]
    told = f"{ratio:.1f} times (processor time {cpu:.1f}): {best.seconds:.2f} s, {best.how}"
    told += f" with slope {best.slope:.2f}" if best.how == "extrapolated" else ""
    return verdict(claim, wanted, f"{told}, against {point['seconds']:.2f} s",
                   ratio >= least and point["error"] <= error)


def _seconds(point: dict) -> str:
    return f"{point['seconds']:.2f} s (processor time {point['cpu']:.2f} s)"


def _wide(runs: list[dict] | None) -> dict:
    claim, wanted = "wide in preset fast takes about 10 s", f"at most {WIDE:g} s"
    if not runs:
        return verdict(claim, wanted)
    run = runs[0]
    if "failed" in run:
        return verdict(claim, wanted, run["failed"], False)
    return verdict(claim, wanted, f"{_seconds(run)} to {run['end']:g} h, {run['steps']} steps", run["seconds"] <= WIDE)


def _others(parts: dict) -> Iterator[dict]:
    """At each point of another code: its time over that of the order-2 line, read at its error; the least of them."""
    for name in ("box", "channel"):
        for other in OTHERS:
            claim = f"transport, {name}: faster than {other.split(',')[0]} at equal error (compilation left out)"
            yield _least_ratio(claim, line_of(parts.get(name, {}), "order 2 (fast, accurate)"),
                               line_of(parts.get(name, {}), other))


def _least_ratio(claim: str, ours: dict | None, theirs: dict | None) -> dict:
    wanted = f"at least {TIMES_FASTER:g} times"
    if not ours or not theirs or not theirs["points"]:
        return verdict(claim, wanted)
    rows = [(point, reading(ours["points"], point["error"])) for point in theirs["points"]]
    ratios = [(p["seconds"] / r.seconds, p["cpu"] / r.cpu, p["error"]) for p, r in rows if r]
    if not ratios:
        return verdict(claim, wanted)
    least, cpu, error = min(ratios)
    return verdict(claim, wanted, f"{least:.1f} times (processor time {cpu:.1f}) at an error of {error:.1e}, the least "
                   f"of {len(ratios)}", least >= TIMES_FASTER)


def _steps(part: dict) -> Iterator[dict]:
    for method in runs.METHODS:
        points = (line_of(part, method) or {}).get("points", [])
        for claimed, bound, chosen in (
                ("from 2500 nodes on", FLOOR, [p for p in points if p["nodes"] > SMALL[1]]),
                ("at 600 nodes", SMALL_FLOOR, [p for p in points if SMALL[0] <= p["nodes"] <= SMALL[1]])):
            claim = f"a growth step over its factorise-and-solve time, {method}, {claimed}"
            told = ", ".join(f"{p['ratio']:.2f} at {p['nodes']}" for p in chosen)
            yield verdict(claim, f"at most {bound:g}", told or NOT_MEASURED,
                          max(p["ratio"] for p in chosen) <= bound if chosen else None)


def _scenes(part: dict) -> Iterator[dict]:
    for name in runs.SCENES:
        if name == "whole":
            continue
        claim = f"{name}: a scene costs what its own stages cost"
        wanted = f"no other stage runs; at most {100 * EXCESS:g} % of the whole model's first solution above them"
        rows = [(row, _row(part, "whole", row["method"])) for row in part.get("rows", ()) if row["scene"] == name]
        if not rows:
            yield verdict(claim, wanted)
            continue
        strange = sorted({stage for row, _ in rows for stage in row["unneeded"]})
        worst = max(excess(row, whole) for row, whole in rows)
        told = f"{round(100 * worst)} % at most above them; other stages: {', '.join(strange) or 'none'}"
        yield verdict(claim, wanted, told, not strange and worst <= EXCESS)


def _row(part: dict, scene: str, method: str) -> dict:
    return next(row for row in part["rows"] if (row["scene"], row["method"]) == (scene, method))


def excess(row: dict, whole: dict) -> float:
    """Processor time of a scene less that of the whole without the stages that the scene does not have, over the
    whole's; what these have of it is what they had of the wall time of one run."""
    spared = sum(seconds for stage, seconds in whole["stages"].items() if stage not in row["stages"])
    return row["cpu"] / whole["cpu"] - 1 + spared / whole["took"]


def _memory(part: dict) -> Iterator[dict]:
    for preset in runs.MEMORY_PRESETS:
        row = next((row for row in part.get("rows", ()) if row["method"] == f"preset {preset}"), None)
        claim = f"preset {preset}: live memory does not grow with the number of steps"
        wanted = f"under {runs.PART:g} of one nodal field a step"
        yield verdict(claim, wanted) if row is None else verdict(
            claim, wanted, f"{row['slope']:.0f} bytes a step over {row['steps']} steps; {row['bound']:.0f} allowed",
            row["slope"] <= row["bound"])


def part_lines(name: str, found: dict) -> str:
    """The table of a part."""
    head = [f"\n{name}: {found['title']}"]
    head += [f"  {key}: {found[key]}" for key in ("error", "reference") if key in found]
    head.append(f"  repeats: {found.get('repeats', 1)}")
    rows = _size_lines(found) if name == "size" else _lines(found) if "lines" in found else _rows(found)
    return "\n".join([*head, *rows])


def _lines(found: dict) -> Iterator[str]:
    for line in found["lines"]:
        yield f"  {line['method']}"
        for point in line["points"]:
            more = "".join(f"  {key} {point[key]:.1e}" for key in ("drift", "beyond") if key in point)
            yield (f"    {point['label']:<32} {point['seconds']:9.4f} s  {point['cpu']:9.4f} s (processor)  "
                   f"error {point['error']:.1e}{more}")
        for failed in line["failed"]:
            yield f"    {failed['label']:<32} FAILED: {failed['reason']}"
    for row in found.get("apart", ()):
        yield f"  apart: {row['what']}: {row['seconds']:.1f} s"
    for run in found.get("wide", ()):
        told = run.get("failed") or f"{run['seconds']:.2f} s, {run['steps']} steps to {run['end']:g} h"
        yield f"  wide, preset {run['preset']}: {told}"


def _size_lines(found: dict) -> Iterator[str]:
    names = (*runs.STAGES, runs.FLOOR)
    for line in found["lines"]:
        yield f"  {line['method']}: milliseconds"
        yield "     nodes     step " + "".join(f"{name:>20}" for name in names) + "   ratio   memory (MB)"
        for point in line["points"]:
            stages = "".join(f"{1e3 * point['stages'][name]:20.1f}" for name in names)
            yield (f"    {point['nodes']:6d} {1e3 * point['seconds']:8.1f} {stages}  {point['ratio']:6.2f}   "
                   f"{point['memory_MB']:.0f}")
        fits = found["fits"].get(line["method"], {})
        yield "    exponents: " + ", ".join(f"{name} {value:.2f}" for name, value in fits.items() if value is not None)
        for failed in line["failed"]:
            yield f"    {failed['label']} FAILED: {failed['reason']}"


def _rows(found: dict) -> Iterator[str]:
    for row in found["rows"]:
        if "slope" in row:
            yield (f"  {row['method']:<16} {row['steps']} steps, {row['nodes']} nodes: {row['slope']:.0f} bytes a "
                   f"step, {row['bound']:.0f} allowed; {row['live_MB']:.1f} MB live")
        else:
            stages = ", ".join(f"{name} {1e3 * seconds:.1f}" for name, seconds in row["stages"].items())
            yield (f"  {row['method']:<16} {row['scene']:<15} {1e3 * row['seconds']:8.1f} ms  "
                   f"{1e3 * row['cpu']:8.1f} ms (processor)  {stages}")
    for step in found.get("steps", ()):
        yield f"  {step['method']:<16} {'a step':<15} {1e3 * step['seconds']:8.1f} ms  of {60 * step['hours']:.0f} min"


def verdicts(found: list[dict]) -> str:
    """A line each."""
    words = {True: "holds", False: "DOES NOT HOLD", None: "not measured"}
    return "\n".join(["\nVerdicts"] + [f"  {words[one['holds']]:<14} {one['claim']}: {one['measured']}; wanted "
                                       f"{one['wanted']}" for one in found])


def machine(about: dict) -> str:
    """What the times are of."""
    imports = ", ".join(f"{name} {seconds:.2f} s" for name, seconds in about.get("import_seconds", {}).items())
    return (f"{about['processor']}, {about['cores']} cores, {about['threads']} thread(s); {about['platform']}; "
            f"Python {about['python']}\nimporting, in no time below: {imports or 'not measured'}")


MARKS = "os^vDP*X<>hd"
COLORS = (*(f"C{k}" for k in range(10)), "black", "navy", "darkgreen", "darkred")


def draw(parts: dict, folder: Path) -> list[Path]:
    """Draw what the parts have; the files."""
    from matplotlib import pyplot
    folder.mkdir(parents=True, exist_ok=True)
    made = []
    for name, part in parts.items():
        if not part.get("lines"):
            continue
        figure = _size_picture(pyplot, part) if name == "size" else _precision(pyplot, part)
        made.append(folder / f"bench_{name}.svg")
        figure.savefig(made[-1], metadata={"Date": None})
        pyplot.close(figure)
    return made


def _precision(pyplot, part: dict):
    """Each method's points and its envelope; methods that failed throughout are named in the legend."""
    figure, axis = pyplot.subplots(figsize=(7.8, 4.6), layout="constrained")
    for k, line in enumerate(part["lines"]):
        points = [p for p in line["points"] if p["error"] > 0]
        label = line["method"] + (f" ({len(line['failed'])} failed)" if line["failed"] else "")
        if not points:
            axis.plot([], [], " ", label=label)
            continue
        color, mark = COLORS[k % len(COLORS)], MARKS[k % len(MARKS)]
        axis.loglog([p["seconds"] for p in points], [p["error"] for p in points], mark, ms=4, color=color, alpha=0.6)
        best = envelope(points)
        axis.loglog([p["seconds"] for p in best], [p["error"] for p in best], f"-{mark}", ms=4, color=color,
                    label=label)
    axis.set_title(part["title"], fontsize=9)
    axis.set_xlabel("wall time (s)", fontsize=8)
    axis.set_ylabel(part["error"] if len(part["error"]) < 60 else "largest error", fontsize=8)
    axis.grid(which="major", lw=0.3)
    axis.tick_params(labelsize=7, which="both")
    figure.legend(fontsize=6, loc="outside right upper")
    return figure


def _size_picture(pyplot, part: dict):
    """Seconds by stage against nodes, and memory."""
    lines = [line for line in part["lines"] if line["points"]]
    figure, axes = pyplot.subplots(1, len(lines) + 1, figsize=(3.9 * (len(lines) + 1), 3.4), layout="constrained")
    for axis, line in zip(axes, lines):
        nodes = [p["nodes"] for p in line["points"]]
        axis.loglog(nodes, [p["seconds"] for p in line["points"]], "k-o", ms=4, label="step")
        for name in (*runs.STAGES, runs.FLOOR):
            values = [p["stages"].get(name, 0.0) for p in line["points"]]
            if any(values):
                axis.loglog(nodes, [v or nan for v in values], "--" if name == runs.FLOOR else "-", label=name)
        more = [p for p in line["points"] if p["memory_MB"] > 0]
        axes[-1].loglog([p["nodes"] for p in more], [p["memory_MB"] for p in more], "-o", ms=4, label=line["method"])
        axis.set_title(line["method"], fontsize=9)
        axis.set_ylabel("seconds a growth step", fontsize=8)
    axes[-1].set_title("memory above the start's", fontsize=9)
    axes[-1].set_ylabel("MB", fontsize=8)
    for axis in axes:
        axis.set_xlabel("nodes", fontsize=8)
        axis.tick_params(labelsize=7, which="both")
        axis.legend(fontsize=6)
    return figure
