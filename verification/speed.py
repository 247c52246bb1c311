"""Speed against error, told in ``docs/performance.md``, in the README, which has the presets alone, and on a page of
the report, all from what was measured.

``python -m verification.speed`` writes them from ``bench.json`` (`make bench`), ``audit.json`` (`make bench`) and
``hard_cases.json`` (`make verify`) in ``verification/report``. A section in Markdown stands between two marks and is
never edited by hand; a test holds it to the records.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

from verification.bench import runs
from verification.bench.record import line
from verification.kernel import writing
from verification.kernel.writing import Block, Link, markdown, table

FOLDER = Path(__file__).parent / "report"
ROOT = Path(__file__).parents[1]
README, PERFORMANCE = ROOT / "README.md", ROOT / "docs" / "performance.md"
BEGIN, END = "<!-- speed: begin (python -m verification.speed) -->", "<!-- speed: end -->"
QUANTITIES = ("velocity", "conductivity", "area", "thickness", "upstream", "downstream", "acceptor out", "donor out")
PAPER_AS_IT_IS = "refinement 1, 12 min"


def records(live: bool = False) -> dict[str, dict]:
    """What was measured, by name; empty where nothing was; live: the hard cases' numbers too, where this machine has
    run them."""
    found = {}
    for name in ("bench", "audit", "hard_cases"):
        file = FOLDER / f"{name}.json"
        if live and (there := FOLDER / "live" / file.name).exists():
            file = there
        found[name] = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    return found


def blocks(found: dict[str, dict]) -> Iterator[Block]:
    """All that is told; ``detail``: on the page alone."""
    yield from _bench(found["bench"])
    yield from _hard(found["hard_cases"])
    yield from _audit(found["audit"])


def summary(found: dict[str, dict]) -> Iterator[Block]:
    """What the README tells: the presets on base, and the diagram of all methods."""
    part = found["bench"].get("parts", {}).get("base")
    if part:
        yield _machine(found["bench"])
        rows = (row[:4] for row in _presets(part))
        yield Block("table", rows=(("preset", "time (s)", "faster than paper", "largest error"), *rows))
        yield Block("picture", "bench_base.svg: error against time of the whole base run")


def _machine(record: dict) -> Block:
    about = record["machine"]
    return Block("text", f"Measured by `make bench` on {about['cores']} cores of {about['processor']}, one thread, "
                         f"Python {about['python']}; importing the packages is not counted. Times of another machine "
                         "differ, ratios less.")


def _bench(record: dict) -> Iterator[Block]:
    if not record.get("parts"):
        return
    yield _machine(record)
    part = record["parts"].get("base")
    if part:
        yield Block("picture", "bench_base.svg: error against time of the whole base run")
        yield Block("text", f"The presets on base. Error: {part['error']}. Reference: {part['reference']}.")
        yield Block("table", rows=(("preset", "time (s)", "faster than paper", "largest error", *QUANTITIES),
                                   *_presets(part)))
    yield Block("table", rows=(("claim", "wanted", "measured", ""), *(
        (one["claim"], one["wanted"], one["measured"], _word(one["holds"])) for one in record["verdicts"])))
    for name, other in record["parts"].items():
        if other.get("lines") and name != "base":
            yield Block("heading", other["title"], detail=True)
            yield Block("text", other.get("reference", ""), detail=True)
            yield Block("picture", f"bench_{name}.svg: {other['title']}", detail=True)
            head = ("method", "", "seconds", "error, or what a step costs")
            yield Block("table", rows=(head, *_points(other)), detail=True)


def _presets(part: dict) -> Iterator[tuple[str, ...]]:
    slow = next(p for p in line(part, runs.PRESET_PAPER)["points"] if p["label"] == PAPER_AS_IT_IS)
    found = {name: line(part, name) for name in (runs.FAST, runs.ACCURATE, runs.EXACT)}
    measured = {name.split()[1]: one["points"][0] for name, one in found.items() if one}
    for name, point in {"paper": slow, **measured}.items():
        yield (name, f"{point['seconds']:.2f}", f"{slow['seconds'] / point['seconds']:.1f} times",
               _percent(point["error"]), *map(_percent, point["errors"]))


def _points(part: dict) -> Iterator[tuple[str, ...]]:
    for one in part["lines"]:
        for point in one["points"]:
            told = f"{point['error']:.1e}" if "error" in point else (
                f"{point['ratio']:.2f} times its linear systems, {point['memory_MB']:.0f} MB")
            yield one["method"], point["label"], f"{point['seconds']:.3g}", told
        for failed in one["failed"]:
            yield one["method"], failed["label"], "failed", failed["reason"]


def _hard(record: dict) -> Iterator[Block]:
    if not record:
        return
    presets = tuple(record["cases"][0]["cells"])
    yield Block("heading", "Hard cases")
    yield Block("text", "Right: the exact value, bound or conserved quantity of the case is met, and so are the "
                        "balances; refused: an error says which bound was met; wrong: anything else. `make verify` "
                        "runs them all; `python -m verification.hard_cases` shows the numbers.")
    yield Block("table", rows=(("", "case", "right is", *presets), *(
        (str(case["number"]), case["title"], case["right_is"], *(_cell(case, preset) for preset in presets))
        for case in record["cases"])))
    notes = tuple((str(case["number"]), preset, cell["message"]) for case in record["cases"]
                  for preset, cell in case["cells"].items() if cell.get("message"))
    yield Block("table", rows=(("case", "preset", "why it is not right"), *notes), detail=True)
    checks = tuple((str(case["number"]), preset, check["part"], check["quantity"], check["measured"], check["expected"],
                    check["origin"]) for case in record["cases"] for preset, cell in case["cells"].items()
                   for check in cell.get("checks", ()))
    yield Block("table", rows=(("case", "preset", "part", "quantity", "measured", "expected", "origin"), *checks),
                detail=True)


def _cell(case: dict, preset: str) -> str:
    cell = case["cells"].get(preset)
    return cell["verdict"] if cell else ""


def _audit(record: dict) -> Iterator[Block]:
    if not record:
        return
    yield Block("heading", "What the paper's choices cost and change")
    yield Block("text", f"{record['method']}.")
    head = ("choice", "default", "alternative", "cost", "velocity", "area", "acceptor out", "largest change",
            "in one state", "note")
    yield Block("table", rows=(head, *map(_choice, record["rows"])))


def _choice(row: dict) -> tuple[str, ...]:
    effect = row["effect"]
    return (row["choice"], row["default"], row["alternative"], f"{row['cost_ratio']:.2f}",
            *(_change(effect.get(name)) for name in ("velocity", "area", "acceptor leaving")), _largest(effect),
            _largest(row.get("one_state", {})), row["note"])


def _largest(effect: dict[str, float]) -> str:
    name = max(effect, key=lambda name: abs(effect[name]), default="")
    return f"{_change(effect[name])} ({name})" if name else ""


def _change(value: float | None) -> str:
    return "" if value is None else f"{100 * value:+.2g} %"


def _percent(value: float) -> str:
    return f"{100 * value:.2g} %"


def _word(holds: bool | None) -> str:
    return {True: "holds", False: "does not hold", None: "not measured"}[holds]


def page(found: list[Block]) -> str:
    """The page of the report."""
    back = table((Link("All cases", "index"),), ())
    return writing.page("Speed against error, hard cases, assumptions", [back, *found])


def pages_of(found: dict[str, dict]) -> dict[Path, str]:
    """The sections of the pages in Markdown."""
    return {README: markdown(summary(found)),
            PERFORMANCE: markdown(blocks(found), 2, "../verification/report")}


def within(text: str, section: str) -> str:
    """A page with the section between its marks."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n\n{section}\n\n{END}{after}"


def main() -> None:
    """Write all of them."""
    write_page(FOLDER)
    for file, section in pages_of(records()).items():
        file.write_text(within(file.read_text(encoding="utf-8"), section), encoding="utf-8")


def record(_: object = None) -> None:
    """Write the page: after a whole verification run, whose hard cases it tells."""
    write_page(FOLDER)


def write_page(folder: Path) -> Path:
    """Write the page into a folder; its path."""
    file = folder / "speed.html"
    file.write_text(page(list(blocks(records(live=True)))), encoding="utf-8")
    return file


if __name__ == "__main__":
    main()
