"""Write the sections on speed and error in ``docs/performance.md`` and, for the presets alone, in the README.

``python -m verification.speed`` reads the measurements from ``bench.json`` (`make bench`), ``audit.json``
(`make bench`) and ``hard_cases.json`` (`make verify`) in ``verification/report``. Each Markdown section stands between
two marks and is never edited by hand; a test compares it with the records.
"""

from collections.abc import Iterator
from pathlib import Path

from verification import audit
from verification.bench import after_contact, report, runs
from verification.bench.record import points
from verification.evidence import hard_cases
from verification.evidence.writing import REPORT, ROOT, load, table

README, PERFORMANCE = ROOT / "README.md", ROOT / "docs" / "performance.md"
BEGIN, END = "<!-- speed: begin (python -m verification.speed) -->", "<!-- speed: end -->"
QUANTITIES = ("velocity", "conductivity", "area", "thickness", "upstream", "downstream", "acceptor out", "donor out")
PAPER_LABEL = "refinement 1, 12 min"


def records() -> dict[str, dict]:
    """Measurements by name; an entry is empty if its record is missing."""
    return {name: load(REPORT / f"{name}.json", {}) for name in ("bench", "audit", "hard_cases")}


def blocks(records: dict[str, dict]) -> Iterator[str]:
    """Yield all blocks of the section."""
    for name, section in {"bench": _bench, "hard_cases": hard_cases.blocks, "audit": audit.blocks}.items():
        if records[name]:
            yield from section(records[name])


def summary(records: dict[str, dict]) -> Iterator[str]:
    """Yield the blocks of the README: the presets on base, and the diagram of all methods."""
    yield report.machine(records["bench"]["machine"])
    parts = records["bench"]["parts"]
    typed = {row["method"]: f"{row['seconds']:.2f}" for row in parts.get("command", {}).get("rows", ())}
    rows = ((*row[:2], typed.get(row[0], report.NOT_MEASURED), *row[2:4]) for row in _presets(parts["base"]))
    yield table((*PRESETS[:2], "command as typed (s)", *PRESETS[2:]), rows)
    yield PICTURE.format("verification")


PRESETS = ("preset", "solver (s)", "faster than paper", "largest error")
#: The diagram of base, to be formatted with the path from the page to the folder verification.
PICTURE = "![error against time of the whole base run]({}/report/bench_base.svg)"


def _bench(record: dict) -> Iterator[str]:
    yield report.machine(record["machine"])
    part = record["parts"]["base"]
    yield PICTURE.format("../verification")
    yield f"The presets on base. Error: {part['error']}. Reference: {part['reference']}."
    yield table((*PRESETS, *QUANTITIES), _presets(part))
    if "wide" in record["parts"]:
        yield from _after_contact(record["parts"]["wide"])
    yield report.verdicts(record["verdicts"])


def _after_contact(part: dict) -> Iterator[str]:
    """Yield the diagram of wide after contact, and the errors of the presets."""
    yield "![error against time of wide at 39.3 h, after contact](../verification/report/bench_wide.svg)"
    yield f"{part['title']}. Error: {part['error']}. Reference: {part['reference']}."
    drawn, rows = after_contact.TIMES.index(after_contact.DRAWN), []
    for name, point in _preset_points(part).items():
        errors = (f"{100 * error:.2g} %" for error in point["errors"][drawn])
        rows.append((name, f"{point['seconds']:.2f}", *errors))
    yield table(("preset", "time (s)", *after_contact.NUMBERS), rows)


def _preset_points(part: dict) -> dict[str, dict]:
    """{preset: its own point} of a part."""
    return {line["method"].split()[1]: line["points"][0] for line in part["lines"] if line["method"] in runs.PRESETS}


def paper_point(part: dict) -> dict:
    """The point of the paper's scheme on base, with the paper's own elements and steps."""
    return next(point for point in points(part, runs.PRESET_PAPER) if point["label"] == PAPER_LABEL)


def _presets(part: dict) -> Iterator[tuple[str, ...]]:
    slow = paper_point(part)
    for name, point in {"paper": slow, **_preset_points(part)}.items():
        errors = (f"{100 * error:.2g} %" for error in (point["error"], *point["errors"]))
        yield (name, f"{point['seconds']:.2f}", f"{slow['seconds'] / point['seconds']:.1f} times", *errors)


def pages_of(records: dict[str, dict]) -> dict[Path, str]:
    """Markdown sections by page."""
    return {file: "\n\n".join(section(records)) for file, section in ((README, summary), (PERFORMANCE, blocks))}


def within(text: str, section: str) -> str:
    """Return the page with the section between its marks."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n\n{section}\n\n{END}{after}"


def main() -> None:
    """Write all sections."""
    for file, section in pages_of(records()).items():
        file.write_text(within(file.read_text(encoding="utf-8"), section), encoding="utf-8")


if __name__ == "__main__":
    main()
