"""Speed against error, told in ``docs/performance.md`` and in the README, which has the presets alone, from what was
measured.

``python -m verification.speed`` writes them from ``bench.json`` (`make bench`), ``audit.json`` (`make bench`) and
``hard_cases.json`` (`make verify`) in ``verification/report``. A section in Markdown stands between two marks and is
never edited by hand; a test holds it to the records.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from verification import audit
from verification.bench import runs, told
from verification.bench.record import points
from verification.evidence import hard_cases
from verification.evidence.writing import Block, load, markdown, table

FOLDER = Path(__file__).parent / "report"
ROOT = Path(__file__).parents[1]
README, PERFORMANCE = ROOT / "README.md", ROOT / "docs" / "performance.md"
BEGIN, END = "<!-- speed: begin (python -m verification.speed) -->", "<!-- speed: end -->"
QUANTITIES = ("velocity", "conductivity", "area", "thickness", "upstream", "downstream", "acceptor out", "donor out")
PAPER_AS_IT_IS = "refinement 1, 12 min"


def records() -> dict[str, dict]:
    """What was measured, by name; empty where nothing was."""
    return {name: load(FOLDER / f"{name}.json", {}) for name in ("bench", "audit", "hard_cases")}


def blocks(found: dict[str, dict]) -> Iterator[Block]:
    """All that is told."""
    for name, tell in {"bench": _bench, "hard_cases": hard_cases.blocks, "audit": audit.blocks}.items():
        if found[name]:
            yield from tell(found[name])


def summary(found: dict[str, dict]) -> Iterator[Block]:
    """What the README tells: the presets on base, and the diagram of all methods."""
    yield told.machine(found["bench"]["machine"])
    yield table(PRESETS, (row[:4] for row in _presets(found["bench"]["parts"]["base"])))
    yield PICTURE


PRESETS = ("preset", "time (s)", "faster than paper", "largest error")
PICTURE = Block("picture", "bench_base.svg: error against time of the whole base run")


def _bench(record: dict) -> Iterator[Block]:
    yield told.machine(record["machine"])
    part = record["parts"]["base"]
    yield PICTURE
    yield Block("text", f"The presets on base. Error: {part['error']}. Reference: {part['reference']}.")
    yield table((*PRESETS, *QUANTITIES), _presets(part))
    yield told.verdicts(record["verdicts"])


def as_it_is(part: dict) -> dict:
    """The point of base of the paper's scheme with its own elements and steps."""
    return next(point for point in points(part, runs.PRESET_PAPER) if point["label"] == PAPER_AS_IT_IS)


def _presets(part: dict) -> Iterator[tuple[str, ...]]:
    slow = as_it_is(part)
    others = {line["method"].split()[1]: line["points"][0] for line in part["lines"] if line["method"] in runs.PRESETS}
    for name, point in {"paper": slow, **others}.items():
        errors = (f"{100 * error:.2g} %" for error in (point["error"], *point["errors"]))
        yield (name, f"{point['seconds']:.2f}", f"{slow['seconds'] / point['seconds']:.1f} times", *errors)


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
    for file, section in pages_of(records()).items():
        file.write_text(within(file.read_text(encoding="utf-8"), section), encoding="utf-8")


if __name__ == "__main__":
    main()
