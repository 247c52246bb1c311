"""The hunt for mutants that no test sees, and what is kept of it.

A mutant's row is written when it is done, and kept as long as its module, its line and the tests that reach it are the
same: a hunt that was interrupted goes on, and after a change of the tests survivors are tried again, and mutants whose
catcher is gone. A mutant of a changed module meets the test that caught it before, alone, and all others only if that
one lets it pass.

What is committed of a hunt: ``report/sampled.json``, the rows, and ``report/sampled.md``, told to a reader.
"""

from __future__ import annotations

import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from importlib.util import cache_from_source
from itertools import accumulate, chain
from pathlib import Path

from verification.evidence import writing
from verification.evidence.writing import REPORT, Block, append, lines, markdown, table
from verification.kernel.trying import ENDED, Ran, copied, run
from verification.sampled.drawing import SEED, Mutant, mutated, sources
from verification.sampled.reach import LIVE, Measured, Reach, digest

KEPT = LIVE / "sampled.jsonl"
RECORD = REPORT / "sampled.json"
#: Hours that a round of trials may take, at a release.
HOURS = 4.0
#: Seconds of processor time of a mutant's first trial, and of a survivor's second one.
LIMIT, WHOLE = 60.0, 1800.0
#: A test that takes so much longer than it did, in multiples of that and seconds besides, does not end.
LONGER, BESIDES = 5.0, 10.0


@dataclass(frozen=True)
class Row:
    """What came of a mutant. ``verdict``: caught, timeout or survivor; ``test``: that caught it, or did not end;
    ``tried``: tests that were run, of ``reached`` that reach it; ``module``, ``tests``: digests of what it rests on."""

    name: str
    file: str
    line: int
    operator: str
    old: str
    new: str
    module: str
    verdict: str
    test: str = ""
    how: str = ""
    tried: int = 0
    reached: int = 0
    tests: str = ""
    seconds: float = 0.0
    #: Does the test that caught it pass without it, in the same place?
    sure: bool = False


def kept() -> dict[str, Row]:
    """Rows by the name of the mutant, the newest."""
    record = writing.load(RECORD, {"mutants": []})["mutants"]
    return {row["name"]: Row(**row) for row in [*record, *lines(KEPT)]}


def rows_of(sample: list[Mutant]) -> list[Row]:
    """Those of a sample that have any, in its order."""
    rows = kept()
    return [rows[mutant.name] for mutant in sample if mutant.name in rows]


def due(sample: list[Mutant], rows: dict[str, Row], reach: Reach, whole: bool) -> list[Mutant]:
    """Mutants without a row, or with one that no longer stands; ``whole``: survivors that tests were left for too."""
    texts = sources()
    return [mutant for mutant in sample if not _stands(rows.get(mutant.name), mutant, texts[mutant.file], reach, whole)]


def _stands(row: Row | None, mutant: Mutant, text: str, reach: Reach, whole: bool) -> bool:
    if row is None or row.module != digest(text):
        return False
    if row.verdict == "caught":
        return row.test in {test.id for test in reach.tests}
    tests = reach.of(mutant.file, text, mutant.line)
    return row.tests == _names(tests) and not (whole and row.tried < row.reached)


def _names(tests: list[Measured]) -> str:
    return digest(*sorted(test.id for test in tests))


def hunt(sample: list[Mutant], reach: Reach, jobs: int, whole: bool = False) -> None:
    """Try those of the mutants that are due, several side by side, and write a row for each; none is begun after
    HOURS."""
    rows, ends = kept(), time.time() + 3600 * HOURS
    caught = {name: row.test for name, row in rows.items() if row.verdict == "caught"}
    mutants = due(sample, rows, reach, whole)

    def shift(number: int) -> None:
        with copied() as there:
            for mutant in mutants[number::jobs]:
                if time.time() < ends:
                    _write(tried(mutant, there, reach, whole, caught.get(mutant.name, "")))

    with ThreadPoolExecutor(jobs) as pool:
        list(pool.map(shift, range(jobs)))


def _write(row: Row) -> None:
    append(asdict(row), KEPT)
    counted = f"{row.tried} of {row.reached} tests, {row.seconds:.0f} s"
    print(f"{row.verdict:9} {row.file}:{row.line} {row.new!r} {row.test} ({counted})", flush=True)


def tried(mutant: Mutant, there: Path, reach: Reach, whole: bool, before: str) -> Row:
    """Run a mutant in the copy ``there`` against the tests that reach it: the one that caught it ``before`` first, then
    as many of the cheapest as take no more than LIMIT; or all, for WHOLE."""
    limit = WHOLE if whole else LIMIT
    path, text = there / "repro" / mutant.file, sources()[mutant.file]
    tests = reach.of(mutant.file, text, mutant.line, whole)
    chosen = [test.id for test in (tests if whole else within(tests))]
    alone = before in {test.id for test in tests}
    put(path, mutated(text, mutant))
    found = run(there, [before] if alone else chosen, limit)
    if alone and not found.failures:
        found = run(there, chosen, limit)
    put(path, text)
    row = Row(mutant.name, mutant.file, mutant.line, mutant.operator, mutant.old, mutant.new, digest(text), "survivor",
              reached=len(tests), tests=_names(reach.of(mutant.file, text, mutant.line)), tried=len(chosen),
              seconds=round(found.seconds, 1))
    return _verdict(row, found, {test.id: test.seconds for test in tests}, limit)


def _verdict(row: Row, found: Ran, usual: dict[str, float], limit: float) -> Row:
    if found.failures:
        test, how = found.failures[0]
        return replace(row, verdict="caught", test=test, how=how.strip().splitlines()[-1].strip()[-160:])
    if found.status in ENDED:
        test = found.last["starts"]
        long = limit - found.last["spent"] > LONGER * usual.get(test, 0.0) + BESIDES
        return replace(row, verdict="timeout" if long else "survivor", test=test,
                       tried=len({report["test"] for report in found.reports}))
    return row


def confirm(rows: list[Row]) -> None:
    """Run the tests that caught mutants once more without any: one that fails now has caught nothing."""
    unsure = [row for row in rows if row.verdict == "caught" and not row.sure and "::" in row.test]
    if unsure:
        with copied() as there:
            failed = dict(run(there, {row.test for row in unsure}, WHOLE, every=True).failures)
        for row in unsure:
            how = f"{row.test} fails without the mutant too"
            _write(replace(row, verdict="survivor", how=how) if row.test in failed else replace(row, sure=True))


def within(tests: list[Measured]) -> list[Measured]:
    """The cheapest tests that together take no longer than LIMIT; one at least."""
    costs = accumulate(test.seconds for test in tests)
    return [test for test, cost in zip(tests, costs) if cost <= LIMIT] or tests[:1]


def put(path: Path, text: str) -> None:
    """Write a module, and remove what was compiled of it before."""
    path.write_text(text, encoding="utf-8")
    Path(cache_from_source(path)).unlink(missing_ok=True)


#: Survivors that no test can tell from the code, each with the reason, by (file of repro/, line or lines as they are,
#: as they become).
EQUIVALENT: dict[tuple[str, str, str], str] = {
    ("fem/elements.py", "EDGE_DEGREES = {1: 2, 2: 6, 3: 9}", "EDGE_DEGREES = {1: 3, 2: 6, 3: 9}"):
        "The same rule: Gauss' two points, which scikit-fem gives for degree 2, are exact to degree 3.",
    ("fem/linear.py", "dominant = np.tile((np.ones((k, k)) + k * np.eye(k)).ravel(), len(elements))",
     "dominant = np.tile((np.ones((k, k)) + k - np.eye(k)).ravel(), len(elements))"):
        "Identical orders of elimination for every system of base in the three presets: they follow from which entries "
        "there are, and the values only keep the factorisation, which is thrown away, from a zero pivot.",
    ("fem/transfer.py", "return np.where(lost[:, None], 99.0, local)",
     "return np.where(lost[:, None], 100.0, local)"):
        "Either is outside of every triangle, places found are from -2 to 3, and is brought back to the same place of "
        "its edge.",
    ("model/flow.py", "@dataclass(frozen=True, eq=False)", "@dataclass(frozen=True, eq=True)"):
        "Bubble has no fields and is not compared, nor a key of anything: it is called.",
    ("model/flow.py", "@dataclass(frozen=True, eq=False) class Bubble:", "class Bubble:"):
        "Bubble has no fields: what the decorator makes of it, but for the text that shows it, a class has by itself.",
    ("model/gear.py", "still = np.zeros_like(fields), np.zeros_like(biomass), np.zeros((2, 3))",
     "still = np.zeros_like(fields), np.zeros_like(biomass), np.zeros(( 1, 3))"):
        "A row of zeros, added to two rows, is two rows of zeros.",
    ("model/flow.py", "if velocity.order == 1:", "if velocity.order >= 1:"):
        "Elements of order 2 and 3 hold the parabola exactly: what is scaled then is scaled by one.",
    ("model/transport.py", "return state.reshape(2, -1)[:, pieces.cells] @ pieces.values.T",
     "return state.reshape(2, - 2)[:, pieces.cells] @ pieces.values.T"):
        "numpy takes any negative length of one axis for the one that is left.",
    ("report/quantities.py", 'made = run.series.get("remeshed", run.times * np.nan) == 1',
     'made = run.series.get("remeshed", run.times * np.nan) >= 1'):
        "The column is 0 or 1, and NaN is neither.",
    ("results/arrays.py", 'kind = "triangle" if pore.mesh.geometry == 1 else "triangle6"',
     'kind = "triangle" if pore.mesh.geometry <= 1 else "triangle6"'):
        "A mesh has geometry 1 or 2.",
    ("model/growth.py", "MOST_ITERATIONS = 25", "MOST_ITERATIONS = 24"):
        "Identical outputs of base in the three presets, whose equilibria take 5, 5 and 3 iterations at most.",
    ("results/vtu.py",
     """components = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else \"\"""",
     """components = f' NumberOfComponents="{values.shape[1]}"' if values.ndim >= 2 else \"\""""):
        "Arrays of a file have one or two axes.",
    ("run/folder.py", '(folder / "fields").mkdir(parents=True, exist_ok=True)',
     '(folder / "fields").mkdir(parents=False, exist_ok=True)'):
        "The folder is there already: it is made with those above it for its lock.",
    ("run/stored.py", '_refuse(not all(in_range(plain[key], 0.0, end) for key in ("time_h", "row_h")), "its time")',
     '_refuse(not all(in_range(plain[key], -1.0, end) for key in ("time_h", "row_h")), "its time")'):
        "A time below zero is refused all the same, by the steps and rows that stand beside it: -0.001 and -0.5 h of "
        "both were, in three presets.",
    ("report/run_page.py", 'several=hidden[packed["of"] > 1])', 'several=hidden[packed["of"] != 1])'):
        "There is one frame or more: without any, nothing is packed, and nothing shown.",
}

#: Survivors that are left: (effect, why no test).
LEFT: dict[tuple[str, str, str], tuple[str, str]] = {
    ("run/__init__.py", "INTERVAL = 60.0", "INTERVAL = 59.0"):
        ("Checkpoints are written every 59 s, and the help says so.",
         "It is a choice; what a run makes does not depend on it."),
    ("model/transport.py", "woken = (iterate.fractions <= 0) & (predicted <= 0) & (there > 0)",
     "woken = (iterate.fractions <= 0) & (predicted != 0) & (there > 0)"):
        ("Newton's method goes on from another fraction where one was zero and another is predicted; what it ends at "
         "is the same to its tolerance.", "It takes more or fewer iterations in starved pores, which nothing bounds."),
}


PAGE = RECORD.with_suffix(".md")
#: Of those not shown equivalent, the share to be caught; of all, the share that may be shown equivalent.
CAUGHT, EXCUSED = 0.95, 0.10


def judged(rows: list[Row]) -> dict[str, list[Row]]:
    """Rows by verdict: caught, timeout, survivor, equivalent."""
    found: dict[str, list[Row]] = {"caught": [], "timeout": [], "survivor": [], "equivalent": []}
    for row in rows:
        excused = row.verdict != "caught" and key(row) in EQUIVALENT
        found["equivalent" if excused else row.verdict].append(row)
    return found


def key(row: Row) -> tuple[str, str, str]:
    """What a reason is given for: the file and the change."""
    return row.file, row.old, row.new


def holds(found: dict[str, list[Row]]) -> bool:
    """Are 95 % of those not shown equivalent caught, and at most 10 % of all shown equivalent? What does not end is not
    counted as caught."""
    caught, equivalent = shares(found)
    return caught >= CAUGHT and equivalent <= EXCUSED


def shares(found: dict[str, list[Row]]) -> tuple[float, float]:
    """The share that is caught of those not shown equivalent, and that of these of all."""
    total, equivalent = sum(map(len, found.values())), len(found["equivalent"])
    return len(found["caught"]) / max(total - equivalent, 1), equivalent / max(total, 1)


def told(found: dict[str, list[Row]], wanted: int) -> str:
    """The numbers in one sentence or two."""
    total = sum(map(len, found.values()))
    return (f"{total} of {wanted} mutants tried, seed {SEED}: {len(found['caught'])} caught, {len(found['timeout'])} "
            f"without end (timeouts), {len(found['survivor'])} survive, {len(found['equivalent'])} shown equivalent. "
            f"Caught of those not shown equivalent: {100 * shares(found)[0]:.1f} % (at least {100 * CAUGHT:g} %).")


def record(rows: list[Row], wanted: int) -> int:
    """Write both files; 0 if the mutants are caught as they are to be."""
    found = judged(rows)
    print(told(found, wanted))
    for row in [*found["survivor"], *found["timeout"]]:
        print(f"{row.verdict}: {row.file}:{row.line}: {row.old!r} -> {row.new!r} {row.how}")
    if len(rows) == wanted:
        writing.save({"seed": SEED, "mutants": [asdict(row) for row in rows]}, RECORD)
        PAGE.write_text(text(found), encoding="utf-8")
    return 0 if holds(found) and len(rows) == wanted else 1


def text(found: dict[str, list[Row]]) -> str:
    """The page, of a sample that was tried whole."""
    drawn = Counter(row.file for row in chain(*found.values()))
    caught = Counter(row.file for row in found["caught"])
    survivors = [(*_changed(row), *LEFT.get(key(row), ("", "")), f"{row.tried} of {row.reached}")
                 for row in found["survivor"]]
    equivalent = [(*_changed(row), EQUIVALENT[key(row)]) for row in found["equivalent"]]
    counts = [(file, str(drawn[file]), str(caught[file])) for file in sorted(drawn)]
    blocks = [Block("text", INTRODUCTION), Block("text", told(found, drawn.total())),
              *_section("Survivors", survivors, "effect", "why no test", "tests run"),
              *_section("Shown equivalent", equivalent, "why"),
              Block("heading", "By module"), table(("module", "mutants", "caught"), counts)]
    return f"# Mutants made by machine\n\n{markdown(blocks, level=2)}\n"


def _section(title: str, rows: list[tuple[str, ...]], *more: str) -> list[Block]:
    """A table of changes and what is told of them besides; nothing where there are none."""
    return [Block("heading", title), table(("where", "was", "is", *more), rows)] if rows else []


def _changed(row: Row) -> tuple[str, str, str]:
    """Where, from what and to what."""
    return f"{row.file}:{row.line}", f"`{row.old}`", f"`{row.new}`"


INTRODUCTION = (
    "`make mutants-sampled` draws them from all that cosmic-ray's operators can make of `repro/`, spread over its "
    f"modules by size, and runs each for at most {LIMIT:g} s of processor time against the tests that call the "
    "function it is in, the cheapest first; with `--whole`, survivors against all of these. A timeout is a "
    "mutant that makes a test run without end, and is not counted as caught. Each mutant with the test that catches it "
    "is in `sampled.json`.")
