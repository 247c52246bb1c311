"""What is claimed of speed and accuracy, each judged by the numbers of a record; the verdicts are written nowhere else.

Ratios are of wall times of one run; those of processor times, which other users of the machine disturb less, are told
beside them.
"""

from __future__ import annotations

from collections.abc import Iterator

from verification.bench import base, memory, scenes, size
from verification.bench.envelope import reading
from verification.bench.record import line

#: (error, least ratio, aim) of the paper's scheme at its own best speed over a preset.
FASTER = {base.FAST: (0.01, 5.0, 10.0), base.ACCURATE: (0.001, 20.0, 20.0)}
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
    paper = (line(part, base.PRESET_PAPER) or {}).get("points", [])
    for name, (error, least, aim) in FASTER.items():
        point = next(iter((line(part, name) or {}).get("points", [])), None)
        claim = f"base: the error of {name} is at most {100 * error:g} %"
        if point is None:
            yield verdict(claim, f"at most {100 * error:g} %")
        else:
            yield verdict(claim, f"at most {100 * error:g} %", f"{100 * point['error']:.2g} %", point["error"] <= error)
        yield _faster(name, paper, point, error, f"{100 * error:g} %", least, aim)
        if point is not None and point["error"] > 0:
            yield _faster(name, paper, point, point["error"], "the error that the preset has", least, aim)
    point = next(iter((line(part, base.ACCURATE) or {}).get("points", [])), None)
    claim, wanted = f"base: {base.ACCURATE} takes about {ACCURATE_RUN:g} s", f"at most {ACCURATE_RUN:g} s"
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
            yield _least_ratio(claim, line(parts.get(name, {}), "order 2 (fast, accurate)"),
                               line(parts.get(name, {}), other))


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
    for method in size.METHODS:
        points = (line(part, method) or {}).get("points", [])
        for claimed, bound, chosen in (
                ("from 2500 nodes on", FLOOR, [p for p in points if p["nodes"] > SMALL[1]]),
                ("at 600 nodes", SMALL_FLOOR, [p for p in points if SMALL[0] <= p["nodes"] <= SMALL[1]])):
            claim = f"a growth step over its factorise-and-solve time, {method}, {claimed}"
            told = ", ".join(f"{p['ratio']:.2f} at {p['nodes']}" for p in chosen)
            yield verdict(claim, f"at most {bound:g}", told or NOT_MEASURED,
                          max(p["ratio"] for p in chosen) <= bound if chosen else None)


def _scenes(part: dict) -> Iterator[dict]:
    for name in scenes.SCENES:
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
    for preset in memory.PRESETS:
        row = next((row for row in part.get("rows", ()) if row["method"] == f"preset {preset}"), None)
        claim = f"preset {preset}: live memory does not grow with the number of steps"
        wanted = f"under {memory.PART:g} of one nodal field a step"
        yield verdict(claim, wanted) if row is None else verdict(
            claim, wanted, f"{row['slope']:.0f} bytes a step over {row['steps']} steps; {row['bound']:.0f} allowed",
            row["slope"] <= row["bound"])
