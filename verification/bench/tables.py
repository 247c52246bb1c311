"""What the benchmark has measured, in words and columns for a terminal."""

from __future__ import annotations

from collections.abc import Iterator

from verification.bench import size


def part(name: str, found: dict) -> str:
    """The table of a part."""
    head = [f"\n{name}: {found['title']}"]
    head += [f"  {key}: {found[key]}" for key in ("error", "reference") if key in found]
    head.append(f"  repeats: {found.get('repeats', 1)}")
    rows = _sizes(found) if name == "size" else _lines(found) if "lines" in found else _rows(found)
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


def _sizes(found: dict) -> Iterator[str]:
    names = (*size.STAGES, size.FLOOR)
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
