"""Verdicts, tables and pictures of a benchmark.

The numbers of a record judge the claims about speed and accuracy. Ratios compare wall times of one run. Each verdict
also has the ratio of processor times, which other loads of the machine disturb less.
"""

from collections import defaultdict
from collections.abc import Callable, Iterator
from itertools import cycle, product
from math import inf

import numpy as np
from matplotlib.figure import Figure

from verification.bench import after_contact, runs
from verification.bench.record import envelope, points, reading
from verification.evidence.writing import REPORT, saved_figure, table

#: (error, least ratio, aim) of the paper's scheme at its own best speed over a preset.
FASTER = {runs.FAST: (0.01, 5.0, 10.0), runs.ACCURATE: (0.001, 20.0, 20.0)}
WIDE, ACCURATE_RUN = 12.0, 3.0
OTHER_CODES, TIMES_FASTER = ("fipy", "py-pde, compiled"), 10.0
#: Largest ratio of a growth step to its floor, above and up to a number of nodes.
FLOORS = {"from 2500 nodes on": (1.5, 1500, inf), "at 600 nodes": (2.0, 499, 1500)}
#: Time that a scene may use beyond its own stages, over that of the complete model.
EXCESS = 0.1
#: Largest processor time of a run with all of its rows, over that with two.
MOST_OVER_FEW_ROWS = {"fast": 2.0, "accurate": 1.5, "exact": 1.5}
MOST_OVER_IMPORTS = 2.0
NOT_MEASURED = "not measured"


def judged(record: dict) -> list[dict]:
    """All verdicts of a record. A claim without a measurement neither holds nor fails."""
    parts = defaultdict(dict, record["parts"])
    return [*_base(parts["base"]), *_other_codes(parts), *_steps(parts["size"]), *_scenes(parts["scenes"]),
            *_memory(parts["memory"]), *_commands(parts["command"]),
            *(_after_contact(parts["wide"]) if parts["wide"] else ())]


def verdict(claim: str, required: str, measure: Callable[..., tuple[str, bool]], *arguments) -> dict:
    """A verdict. ``measure(*arguments)`` returns the measurement in words and whether the claim holds, or raises
    LookupError if the record lacks it."""
    try:
        measured, holds = measure(*arguments)
        holds = bool(holds)
    except LookupError:
        measured, holds = NOT_MEASURED, None
    return {"claim": claim, "measured": measured, "wanted": required, "holds": holds}


def _base(part: dict) -> Iterator[dict]:
    for name, (error, least, aim) in FASTER.items():
        percent = f"{100 * error:g} %"
        yield verdict(f"base: the error of {name} is at most {percent}", f"at most {percent}",
                      _error, part, name, error)
        required = f"at least {least:g} times" + (f" (aim {aim:g})" if aim > least else "")
        for words, at in ((percent, error), ("the error that the preset has", None)):
            yield verdict(f"base: {name} is faster than the paper's scheme at its own best speed for {words}", required,
                          _faster, part, name, at, least)
    yield verdict(f"base: {runs.ACCURATE} takes about {ACCURATE_RUN:g} s", f"at most {ACCURATE_RUN:g} s",
                  _accurate_time, part)
    yield verdict("wide in preset fast takes about 10 s", f"at most {WIDE:g} s", _wide_time, part)


def _error(part: dict, name: str, error: float) -> tuple[str, bool]:
    computed = points(part, name)[0]["error"]
    return f"{100 * computed:.2g} %", computed <= error


def _faster(part: dict, name: str, error: float | None, least: float) -> tuple[str, bool]:
    """error: the error at which the times are compared; None: that of the preset."""
    point = points(part, name)[0]
    required = point["error"] if error is None else error
    best = reading(points(part, runs.PRESET_PAPER), required)
    ratio, cpu = best.seconds / point["seconds"], best.cpu / point["cpu"]
    description = f"{ratio:.1f} times (processor time {cpu:.1f}): {best.seconds:.2f} s, {best.how}"
    return f"{description}, against {point['seconds']:.2f} s", ratio >= least and point["error"] <= required


def _accurate_time(part: dict) -> tuple[str, bool]:
    point = points(part, runs.ACCURATE)[0]
    return _seconds(point), point["seconds"] <= ACCURATE_RUN


def _seconds(point: dict) -> str:
    return f"{point['seconds']:.2f} s (processor time {point['cpu']:.2f} s)"


def _wide_time(part: dict) -> tuple[str, bool]:
    run = part["wide"][0]
    return f"{_seconds(run)} to {run['end']:g} h, {run['steps']} steps", run["seconds"] <= WIDE


def _other_codes(parts: dict) -> Iterator[dict]:
    for name, other in product(("box", "channel"), OTHER_CODES):
        claim = f"transport, {name}: faster than {other.split(',')[0]} at equal error (compilation left out)"
        yield verdict(claim, f"at least {TIMES_FASTER:g} times", _least_ratio, parts[name], other)


def _least_ratio(part: dict, other: str) -> tuple[str, bool]:
    """Least ratio over the points of another code: its time over that of the order-2 line at the same error."""
    order_2, other_points = points(part, "order 2 (fast, accurate)"), points(part, other)
    rows = [(point, reading(order_2, point["error"])) for point in other_points]
    ratios = sorted((p["seconds"] / r.seconds, p["cpu"] / r.cpu, p["error"]) for p, r in rows)
    least, cpu, error = ratios[0]
    return (f"{least:.1f} times (processor time {cpu:.1f}) at an error of {error:.1e}, the least of {len(ratios)}",
            least >= TIMES_FASTER)


def _steps(part: dict) -> Iterator[dict]:
    for method, (size_range, (bound, low, high)) in product(runs.METHODS, FLOORS.items()):
        yield verdict(f"a growth step over its factorise-and-solve time, {method}, {size_range}", f"at most {bound:g}",
                      _floor, part, method, bound, low, high)


def _floor(part: dict, method: str, bound: float, low: float, high: float) -> tuple[str, bool]:
    ratios = {point["nodes"]: point["ratio"] for point in points(part, method) if low < point["nodes"] <= high}
    listed = ", ".join(f"{ratio:.2f} at {nodes}" for nodes, ratio in ratios.items())
    return listed, sorted(ratios.values())[-1] <= bound


def _scenes(part: dict) -> Iterator[dict]:
    required = f"no other stage runs; at most {100 * EXCESS:g} % of the whole model's first solution above them"
    for name in list(dict.fromkeys(row["scene"] for row in part.get("rows", ())))[1:]:
        yield verdict(f"{name}: a scene costs what its own stages cost", required, _stage_cost, part, name)


def _stage_cost(part: dict, name: str) -> tuple[str, bool]:
    rows = [row for row in part["rows"] if row["scene"] == name]
    complete = {row["method"]: row for row in part["rows"] if row["scene"] == "whole"}
    unneeded = sorted({stage for row in rows for stage in row["unneeded"]})
    worst = sorted(excess(row, complete[row["method"]]) for row in rows)[-1]
    return (f"{round(100 * worst)} % at most above them; other stages: {', '.join(unneeded) or 'none'}",
            not unneeded and worst <= EXCESS)


def excess(row: dict, complete: dict) -> float:
    """Relative excess of a scene's processor time over that of the complete model without the stages that the scene
    lacks. The share of these stages in the processor time is their share in the wall time of one run."""
    spared = sum(seconds for stage, seconds in complete["stages"].items() if stage not in row["stages"])
    return row["cpu"] / complete["cpu"] - 1 + spared / complete["took"]


def _memory(part: dict) -> Iterator[dict]:
    for preset in runs.MEMORY_PRESETS:
        yield verdict(f"preset {preset}: live memory does not grow with the number of steps",
                      f"under {runs.PART:g} of one nodal field a step", _memory_slope, part, f"preset {preset}")


def _memory_slope(part: dict, method: str) -> tuple[str, bool]:
    row = {row["method"]: row for row in part["rows"]}[method]
    description = f"{row['slope']:.0f} bytes a step over {row['steps']} steps; {row['bound']:.0f} allowed"
    return description, row["slope"] <= row["bound"]


def _after_contact(part: dict) -> Iterator[dict]:
    for preset, aims in after_contact.AIMS.items():
        hours = ", ".join(f"{time:g}" for time in after_contact.TIMES)
        percent = ", ".join(f"{100 * aim:g}" for aim in aims)
        yield verdict(f"wide at {hours} h: conductivity, both tips and length of contact in {preset}",
                      f"at most {percent} %, with the uncertainty of the reference", _converged, part, preset, aims)


def _converged(part: dict, preset: str, aims: tuple[float, ...]) -> tuple[str, bool]:
    """The largest error of each number over the times. A number holds if its error plus the uncertainty of the
    reference is within its aim."""
    errors = np.array(points(part, f"preset {preset}")[0]["errors"])
    changes = np.array(part["reference_changes"])
    listed = ", ".join(f"{name} {100 * error:.2g} %" for name, error in
                       zip(after_contact.NUMBERS, errors.max(axis=0)))
    uncertain = ", ".join(f"{100 * change:.2g}" for change in changes.max(axis=0))
    return f"{listed}; reference uncertain by {uncertain} %", bool((errors + changes <= aims).all())


def _commands(part: dict) -> Iterator[dict]:
    """Verdicts on a user's own runs; none before they are measured."""
    rows = {row["method"]: row for row in part.get("rows", ())}
    for preset, most in MOST_OVER_FEW_ROWS.items() if rows else ():
        yield verdict(f"base: a run in {preset} with all of its rows over one with two", f"at most {most:g} times",
                      _ratio, rows.get(preset, {}), "over_few_rows", most)
    if "fast" in rows:
        yield verdict("repro run base in fast, as typed, over the import of its packages",
                      f"at most {MOST_OVER_IMPORTS:g} times", _ratio, rows["fast"], "over_imports", MOST_OVER_IMPORTS)


def _ratio(row: dict, key: str, most: float) -> tuple[str, bool]:
    return f"{row[key]:.2f} times (processor time)", row[key] <= most


WORDS = {True: "holds", False: "does not hold", None: NOT_MEASURED}


def machine(about: dict) -> str:
    """The machine and the packages that the times belong to."""
    return (f"Measured by `make bench` on {about['cores']} cores of {about['processor']}, one thread, Python "
            f"{about['python']}; importing the packages is not counted. Times of another machine differ, ratios less.")


def verdicts(rows: list[dict]) -> str:
    """A table of verdicts."""
    return table(("claim", "wanted", "measured", ""), (
        (row["claim"], row["wanted"], row["measured"], WORDS[row["holds"]]) for row in rows))


def blocks(name: str, part: dict) -> list[str]:
    """The blocks of a part with all its points."""
    description = "; ".join(f"{key}: {part[key]}" for key in ("error", "reference", "repeats") if key in part)
    return [f"## {name}: {part['title']}", description,
            table(("method", "", "seconds and errors"), _rows(part))]


def _rows(part: dict) -> Iterator[tuple[str, ...]]:
    for line in part.get("lines", ()):
        yield from ((line["method"], point["label"], _numbers(point)) for point in line["points"])
        yield from ((line["method"], failed["label"], f"failed: {failed['reason']}") for failed in line["failed"])
    yield from ((row["method"], row.get("scene", ""), _numbers(row)) for row in part.get("rows", ()))


def _numbers(point: dict) -> str:
    """All measurements at a point, including its stages."""
    numbers = {**point, **point.get("stages", {})}
    return ", ".join(f"{name} {value:.3g}" for name, value in numbers.items() if isinstance(value, float))


MARKS = "os^vDP*X<>hd"
COLORS = (*(f"C{k}" for k in range(10)), "black", "navy", "darkgreen", "darkred")


def draw(parts: dict) -> None:
    """Draw the errors of the parts."""
    for name, part in parts.items():
        if "error" in part:
            saved_figure(_precision(part), REPORT / f"bench_{name}.svg")


def _precision(part: dict) -> Figure:
    """Draw the points and the envelope of each method; the legend counts failures."""
    figure = Figure(figsize=(7.8, 6.2), layout="constrained")
    axis = figure.subplots()
    for line, color, mark in zip(part["lines"], cycle(COLORS), cycle(MARKS)):
        positive = [p for p in line["points"] if p["error"] > 0]
        label = line["method"] + (f" ({len(line['failed'])} failed)" if line["failed"] else "")
        _curve(axis, positive, mark, color=color, alpha=0.6)
        _curve(axis, envelope(positive), f"-{mark}", color=color, label=label)
    axis.set_title(part["title"], fontsize=9)
    axis.set_xlabel("wall time (s)", fontsize=8)
    axis.set_ylabel(part["error"] if len(part["error"]) < 60 else "largest error", fontsize=8)
    axis.tick_params(labelsize=8, which="both")
    axis.grid(which="major", lw=0.3)
    figure.legend(fontsize=8, loc="outside lower center", ncols=2)
    return figure


def _curve(axis, points_drawn, look: str, **how) -> None:
    """Error against time."""
    axis.loglog([p["seconds"] for p in points_drawn], [p["error"] for p in points_drawn], look, ms=4, **how)
