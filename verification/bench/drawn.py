"""Pictures of the benchmark: error against time, one line a method, and cost against size."""

from __future__ import annotations

from math import nan
from pathlib import Path

from verification.bench import size
from verification.bench.envelope import envelope

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
        figure = _sizes(pyplot, part) if name == "size" else _precision(pyplot, part)
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


def _sizes(pyplot, part: dict):
    """Seconds by stage against nodes, and memory."""
    lines = [line for line in part["lines"] if line["points"]]
    figure, axes = pyplot.subplots(1, len(lines) + 1, figsize=(3.9 * (len(lines) + 1), 3.4), layout="constrained")
    for axis, line in zip(axes, lines):
        nodes = [p["nodes"] for p in line["points"]]
        axis.loglog(nodes, [p["seconds"] for p in line["points"]], "k-o", ms=4, label="step")
        for name in (*size.STAGES, size.FLOOR):
            values = [p["stages"].get(name, 0.0) for p in line["points"]]
            if any(values):
                axis.loglog(nodes, [v or nan for v in values], "--" if name == size.FLOOR else "-", label=name)
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
