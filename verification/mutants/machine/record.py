"""The committed results of a session: ``report/sampled.json``, a row a mutant, and ``report/sampled.md``."""

import re
from collections import Counter
from collections.abc import Iterable
from itertools import chain
from pathlib import Path

from verification.evidence.writing import REPORT, load, page, save, table
from verification.mutants.machine.sample import COUNT, SEED
from verification.mutants.machine.survivors import EQUIVALENT, LEFT

RECORD = REPORT / "sampled.json"
PAGE = RECORD.with_suffix(".md")
#: Least share of caught mutants among those that are not equivalent, and largest share of equivalent mutants.
CAUGHT, EQUIVALENT_AT_MOST = 0.95, 0.10
FAILED = re.compile(r"^(?:FAILED|ERROR) (tests/\S+)", re.M)
INTRODUCTION = (
    "`make mutants-sampled` draws a sample of the mutants that cosmic-ray makes of `repro/`, spread over its modules "
    "by size. Each mutant is run for a minute against the tests that reach its line according to coverage.py, the "
    "cheapest first. If a test does not end, the mutant is a timeout and does not count as caught. `sampled.json` has "
    "each mutant with the test that catches it.")


def rows_of(session: Path) -> list[dict]:
    """A row for each mutant of a session that was run."""
    from cosmic_ray.work_db import use_db

    with use_db(str(session)) as known:
        results = dict(known.results)
        return [_row(item.mutations[0], results[item.job_id]) for item in known.work_items if item.job_id in results]


def _row(mutation, result) -> dict:
    old, new = _change(result.diff or "", mutation.operator_name)
    test = FAILED.search(result.output or "")
    verdict = "caught" if result.test_outcome == "killed" and test else "survivor"
    return {"file": mutation.module_path.relative_to("repro").as_posix(), "line": mutation.start_pos[0],
            "operator": mutation.operator_name, "old": old, "new": new,
            "verdict": "timeout" if result.output == "timeout" else verdict, "test": test[1] if test else ""}


def _change(diff: str, operator: str) -> tuple[str, str]:
    """The changed lines before and after. A decorator includes the line that follows it."""
    lines = diff.partition("\n@@")[2].splitlines()[1:]
    old = "\n".join(line[1:].strip() for line in lines if line.startswith("-"))
    new = "\n".join(line[1:].strip() for line in lines if line.startswith("+"))
    if operator.endswith("RemoveDecorator"):
        place = next(place for place, line in enumerate(lines) if line.startswith("-"))
        new = lines[place + 1][1:].strip()
        old = f"{old} {new}"
    return old, new


def judged(rows: Iterable[dict]) -> dict[str, list[dict]]:
    """Rows by verdict: caught, timeout, survivor, equivalent."""
    verdicts: dict[str, list[dict]] = {"caught": [], "timeout": [], "survivor": [], "equivalent": []}
    for row in rows:
        is_equivalent = row["verdict"] != "caught" and key(row) in EQUIVALENT
        verdicts["equivalent" if is_equivalent else row["verdict"]].append(row)
    return verdicts


def key(row: dict) -> tuple[str, str, str]:
    """The key of an explanation: the file and the change."""
    return row["file"], row["old"], row["new"]


def shares(verdicts: dict[str, list[dict]]) -> tuple[float, float]:
    """The share of caught mutants among those that are not equivalent, and the share of equivalent mutants."""
    total, equivalent = sum(map(len, verdicts.values())), len(verdicts["equivalent"])
    return len(verdicts["caught"]) / max(total - equivalent, 1), equivalent / max(total, 1)


def holds(verdicts: dict[str, list[dict]]) -> bool:
    """Whether enough are caught, and few enough are shown to be equivalent."""
    caught, equivalent = shares(verdicts)
    return caught >= CAUGHT and equivalent <= EQUIVALENT_AT_MOST


def summary(verdicts: dict[str, list[dict]]) -> str:
    """The numbers in two sentences."""
    count = {name: len(rows) for name, rows in verdicts.items()}
    return (f"{sum(count.values())} of {COUNT} mutants tried, seed {SEED}: {count['caught']} caught, "
            f"{count['timeout']} without end (timeouts), {count['survivor']} survive, {count['equivalent']} shown "
            "equivalent. "
            f"Caught of those not shown equivalent: {100 * shares(verdicts)[0]:.1f} % (at least {100 * CAUGHT:g} %).")


def write(rows: list[dict]) -> int:
    """Print the outcome. Write both files if the sample is complete. Return 0 if enough mutants are caught."""
    verdicts = judged(rows)
    print(summary(verdicts))
    for row in [*verdicts["survivor"], *verdicts["timeout"]]:
        print(f"{row['verdict']}: {row['file']}:{row['line']}: {row['old']!r} -> {row['new']!r}")
    complete = len(rows) == COUNT
    if complete:
        save({"seed": SEED, "mutants": rows}, RECORD)
        PAGE.write_text(text(), encoding="utf-8")
    return 0 if complete and holds(verdicts) else 1


def text() -> str:
    """The page of the record."""
    verdicts = judged(load(RECORD)["mutants"])
    drawn = Counter(row["file"] for row in chain(*verdicts.values()))
    caught = Counter(row["file"] for row in verdicts["caught"])
    survivors = [(*_place(row), *LEFT.get(key(row), ("", ""))) for row in verdicts["survivor"]]
    equivalent = [(*_place(row), EQUIVALENT[key(row)]) for row in verdicts["equivalent"]]
    counts = [(f"`{file}`", drawn[file], caught[file]) for file in sorted(drawn)]
    blocks = [INTRODUCTION, summary(verdicts),
              *_section("Survivors", survivors, "effect", "why no test"),
              *_section("Shown equivalent", equivalent, "why"),
              "## By module", table(("module", "mutants", "caught"), counts)]
    return page("Mutants made by machine", blocks)


def _section(title: str, rows: list[tuple[str, ...]], *columns: str) -> list[str]:
    """A table of changes; nothing if there are none."""
    return [f"## {title}", table(("where", "was", "is", *columns), rows)] if rows else []


def _place(row: dict) -> tuple[str, str, str]:
    """The place, the old text and the new text."""
    return f"`{row['file']}:{row['line']}`", f"`{row['old']}`", f"`{row['new']}`"
