"""What is committed of a hunt: ``report/sampled.json``, the rows, and ``report/sampled.md``, told to a reader."""

from __future__ import annotations

import json
from dataclasses import asdict

from verification.kernel.writing import Block, markdown, table
from verification.sampled.drawing import SEED, digest, sources
from verification.sampled.equivalent import EQUIVALENT, LEFT
from verification.sampled.hunting import LIMIT, RECORD, Row

PAGE = RECORD.with_suffix(".md")
#: Of those not shown equivalent, the share to be caught; of all, the share that may be shown equivalent.
CAUGHT, EXCUSED = 0.95, 0.10


def judged(rows: list[Row]) -> dict[str, list[Row]]:
    """Rows by verdict: caught, timeout, survivor, equivalent."""
    found: dict[str, list[Row]] = {"caught": [], "timeout": [], "survivor": [], "equivalent": []}
    for row in rows:
        found[_word(row)].append(row)
    return found


def key(row: Row) -> tuple[str, str, str]:
    """What a reason is given for: the file and the change."""
    return row.file, row.old, row.new


def holds(found: dict[str, list[Row]]) -> bool:
    """Are 95 % of those not shown equivalent caught, and at most 10 % of all shown equivalent? What does not end is not
    counted as caught."""
    total = sum(map(len, found.values()))
    counted = total - len(found["equivalent"])
    return bool(counted) and len(found["caught"]) >= CAUGHT * counted and len(found["equivalent"]) <= EXCUSED * total


def told(found: dict[str, list[Row]], count: int) -> str:
    """The numbers in one sentence or two."""
    total = sum(map(len, found.values()))
    counted = total - len(found["equivalent"])
    share = 100 * len(found["caught"]) / counted if counted else 0.0
    return (f"{total} of {count} mutants tried, seed {SEED}: {len(found['caught'])} caught, {len(found['timeout'])} "
            f"without end (timeouts), {len(found['survivor'])} survive, {len(found['equivalent'])} shown equivalent. "
            f"Caught of those not shown equivalent: {share:.1f} % (at least {100 * CAUGHT:g} %).")


def fresh(rows: list[Row]) -> str:
    """Are the rows those of the present code?"""
    texts = sources()
    stale = [row for row in rows if digest(texts.get(row.file, "")) != row.module]
    return f"{len(rows) - len(stale)} of {len(rows)} rows are of the present text of their module."


def record(rows: list[Row], count: int) -> int:
    """Write both files; 0 if the mutants are caught as they are to be."""
    found = judged(rows)
    print(told(found, count))
    for row in [*found["survivor"], *found["timeout"]]:
        print(f"{row.verdict}: {row.file}:{row.line}: {row.old!r} -> {row.new!r} {row.how}")
    if len(rows) == count:
        kept = [asdict(row) for row in rows]
        RECORD.write_text(json.dumps({"seed": SEED, "mutants": kept}, indent=1) + "\n", encoding="utf-8")
        PAGE.write_text(text(rows, count), encoding="utf-8")
    return 0 if holds(found) and len(rows) == count else 1


def text(rows: list[Row], count: int) -> str:
    """The page."""
    found = judged(rows)
    blocks = [Block("text", INTRODUCTION), Block("text", told(found, count)), *_survivors(found), *_equivalent(found)]
    by_module = table(("module", "mutants", "caught"), _counts(rows))
    whole = markdown([*blocks, Block("heading", "By module"), by_module], level=2)
    return f"# Mutants made by machine\n\n{whole}\n"


def _counts(rows: list[Row]) -> list[tuple[str, str, str]]:
    """How many of each module are drawn, and caught; each is in the record."""
    files = sorted({row.file for row in rows})
    verdicts = {file: [row.verdict for row in rows if row.file == file] for file in files}
    return [(file, str(len(found)), str(found.count("caught"))) for file, found in verdicts.items()]


INTRODUCTION = (
    "`make mutants-sampled` draws them from all that cosmic-ray's operators can make of `repro/`, spread over its "
    f"modules by size, and runs each for at most {LIMIT:g} s of processor time against the tests that call the "
    "function it is in, the cheapest first; with `--whole`, survivors against all of these. A timeout is a "
    "mutant that makes a test run without end, and is not counted as caught. Each mutant with the test that catches it "
    "is in `sampled.json`.")


def _word(row: Row) -> str:
    return "equivalent" if row.verdict != "caught" and key(row) in EQUIVALENT else row.verdict


def _survivors(found: dict[str, list[Row]]) -> list[Block]:
    if not found["survivor"]:
        return []
    rows = [(f"{row.file}:{row.line}", f"`{row.old}`", f"`{row.new}`", *LEFT.get(key(row), ("", "")),
             f"{row.tried} of {row.reached}") for row in found["survivor"]]
    heads = ("where", "was", "is", "effect", "why no test", "tests run")
    return [Block("heading", "Survivors"), table(heads, rows)]


def _equivalent(found: dict[str, list[Row]]) -> list[Block]:
    rows = [(f"{row.file}:{row.line}", f"`{row.old}`", f"`{row.new}`", EQUIVALENT[key(row)])
            for row in found["equivalent"]]
    return [Block("heading", "Shown equivalent"), table(("where", "was", "is", "why"), rows)] if rows else []
