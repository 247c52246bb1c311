"""What is committed of a hunt: ``report/sampled.json``, the rows, and ``report/sampled.md``, told to a reader."""

from __future__ import annotations

import json
from dataclasses import asdict

from verification.kernel.writing import Block, markdown, table
from verification.sampled.drawing import SEED, digest, sources
from verification.sampled.hunting import LIMIT, RECORD, Row

#: Survivors that no test can tell from the code, each with the reason, by (file of repro/, line or lines as they are,
#: as they become).
EQUIVALENT: dict[tuple[str, str, str], str] = {
    ("cli/check.py", "say(json.dumps(found.tables(), indent=2) if chosen.json else report(found))",
     "say(json.dumps(found.tables(), indent= 3) if chosen.json else report(found))"):
        "The same JSON to every reader; there is a blank more at the start of lines.",
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
    ("march/updates.py", "update = min(round(count * growth.time_step, 9), scene.corner(time))",
     "update = min(round(count * growth.time_step, 10), scene.corner(time))"):
        "The same times for every update of base in the three presets, and so the same outputs: a time step needs more "
        "than nine decimals to differ, by less than the 1e-9 h to which times are told apart.",
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
    ("results/__init__.py", 'write_text(path, json.dumps(content, indent=2, allow_nan=False) + "\\n")',
     'write_text(path, json.dumps(content, indent= 1, allow_nan=False) + "\\n")'):
        "The same JSON to every reader; there is a blank less at the start of lines.",
    ("results/arrays.py", 'kind = "triangle" if pore.mesh.geometry == 1 else "triangle6"',
     'kind = "triangle" if pore.mesh.geometry <= 1 else "triangle6"'):
        "A mesh has geometry 1 or 2.",
    ("model/growth.py", "MOST_ITERATIONS = 25", "MOST_ITERATIONS = 24"):
        "Identical outputs of base in the three presets, whose equilibria take 5, 5 and 3 iterations at most.",
    ("results/vtu.py",
     """components = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else \"\"""",
     """components = f' NumberOfComponents="{values.shape[1]}"' if values.ndim >= 2 else \"\""""):
        "Arrays of a file have one or two axes.",
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
    ("report/charts.py", "digits = max(0, -math.floor(math.log10(step) + 1e-9))",
     "digits = max(0, -math.floor(math.log10(step) // 1e-9))"):
        ("Ticks get as many digits as there is memory for.",
         "The first test that draws a chart never ends, which is told as a timeout."),
    ("run/cache.py", "if len(missing) > 1:", "if len(missing) == 1:"):
        ("Several runs are made one after the other and not side by side; they are the same.",
         "It takes as many cores as it saves time for, which no test can count on."),
    ("scene/units.py", "@dataclass(frozen=True)", "@dataclass(frozen=False)"):
        ("What a key accepts could be changed after it was made.",
         "test_states_are_made_and_not_changed fails with it, but cheaper tests take the 60 s before its turn."),
    ("sweep/cluster.py", "except TimeoutError:", "except CosmicRayTestingException:"):
        ("A scheduler that does not answer is told of by another error than the one line that names it.",
         "Tests with a cluster run in make test-thorough alone."),
}


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
