"""The pages of the verification: a page a stage, an index, the mutants, and the matrix.

Pages are committed. They contain verdicts, orders, intervals, and numbers rounded to half of their tolerance. A run on
another machine therefore writes the same files. All pages follow from ``evidence.json``, which has an entry for each
case. A run of some cases replaces their entries and does not change the others.
"""

import re
from collections import defaultdict
from collections.abc import Iterable, Mapping
from itertools import chain, groupby
from os.path import commonprefix

from verification.evidence import convergence, hard_cases, matrix
from verification.evidence.cases import NUMERICS, Case, cases
from verification.evidence.results import PASSES, Result
from verification.evidence.writing import REPORT, link, load, page, save, table
from verification.mutants import runner
from verification.mutants.runner import Mutant

RECORD = REPORT / "evidence.json"
TITLES = {"flow": "Flow (2.1, 3.2)", "transport": "Substrates (2.2, 3.3)", "growth": "Growth mechanics (2.3, 3.4)",
          "reprojection": "Reprojection and transfer (3.4, 3.5)", "mesh_motion": "Mesh motion (3.5)",
          "coupling": "Coupling", "hard": "Hard cases"}
INTRODUCTION = (
    "Each case compares the implementation with a closed form, a manufactured solution, an independent code, or a "
    "conserved quantity. Verdicts follow from the numbers. Orders are judged on both sides, between neighbours of a "
    "series of unrelated meshes. Each case names wrong changes of the code (mutants) with which it must fail; "
    "`make mutants` runs each mutant until a case catches it, or against the tests that it names.")
OF_READERS = "Mutants that tests must catch"
TEST = re.compile(r"tests/test_(\w+)\.py::test_")
NOT_RUN = {"verdict": "not run", "numbers": 0, "errors": [], "table": []}


def write(results: Iterable[Result]) -> None:
    """Record the cases that ran with every variant, write all pages, and draw the pictures whose series changed."""
    known = cases()
    before = recorded()
    complete = [result.in_order(known[result.id].variants) for result in results
                if result.evidence.keys() >= known[result.id].variants.keys()]
    records = {**load(RECORD, {}), **{result.id: entry(result) for result in complete}}
    save({id: records[id] for id in known if id in records}, RECORD)
    hard_cases.record(complete)
    for stage in TITLES:
        series, target = studies(of_stage(stage, recorded())), REPORT / f"{stage}.svg"
        if series and (series != studies(of_stage(stage, before)) or not target.exists()):
            convergence.draw(series, target)
    for name, text in texts(recorded()).items():
        (REPORT / name).write_text(text, encoding="utf-8")


def entry(result: Result) -> dict:
    """The record of a case: verdict, count of judged numbers, errors that stopped variants, table, and studies."""
    stopped = [f"{label}: {error}" if label else error for label, error in result.errors.items()]
    return {"verdict": result.verdict, "numbers": len(result.measured), "errors": stopped,
            "table": grouped(hard_cases.lines(result.cells.values()) if result.cells else lines(result)),
            "studies": convergence.series(result)}


def studies(records: Mapping[str, Mapping]) -> dict[str, dict]:
    """{case: its series} of the cases whose records have series."""
    return {id: record["studies"] for id, record in records.items() if record.get("studies")}


def lines(result: Result) -> list[tuple[str, str, str, bool]]:
    """Rows of the table of a case: quantity with its reproducible number, interval, origin, whether it holds."""
    return [(part.quantity + (f" ({part.reproducible})" if part.reproducible else ""), part.interval(3), part.origin,
             part.holds) for part in result.measured]


def grouped(rows: Iterable[tuple[str, str, str, bool]]) -> list[list[str]]:
    """Rows of a table. Quantities with the same interval, origin and outcome share a row."""
    names: dict[tuple[str, str, str], list[str]] = {}
    for quantity, interval, origin, holds in rows:
        names.setdefault((interval, origin, "yes" if holds else "NO"), []).append(quantity)
    return [[shared(quantities), *key] for key, quantities in names.items()]


def recorded() -> dict[str, dict]:
    """The records of all cases; a case that never ran has a placeholder."""
    records = load(RECORD, {})
    return {id: records.get(id, NOT_RUN) for id in cases()}


def summary(records: Iterable[Mapping]) -> str:
    """The number of passing cases, in one line."""
    verdicts = [record["verdict"] for record in records]
    numbers = sum(record["numbers"] for record in records)
    return f"{verdicts.count(PASSES)} of {len(verdicts)} cases pass; {numbers} numbers judged."


def texts(records: Mapping[str, Mapping]) -> dict[str, str]:
    """Every page: {file: Markdown}."""
    stages = runner.load_mutants()
    read = {"results": stages.pop("results")}
    state = mutant_state()
    pages = {"REPORT.md": ("Verification", index(records, state)),
             "mutants.md": ("Mutants", mutant_blocks(stages, state)),
             "mutants_read.md": (OF_READERS, mutant_blocks(read, state))}
    for stage, title in TITLES.items():
        chosen = of_stage(stage, records)
        articles = [article(cases()[id], record) for id, record in chosen.items()]
        head = [summary(chosen.values()), *picture(stage, chosen)]
        pages[f"{stage}.md"] = title, [*head, *chain.from_iterable(articles)]
    return {**{name: page(*parts) for name, parts in pages.items()}, "matrix.md": matrix.text()}


def picture(stage: str, records: Mapping[str, Mapping]) -> list[str]:
    """The picture of convergence of a stage, if the records of its cases have series."""
    caption = "errors against sizes of meshes or steps, a panel a case; dashed: the expected order"
    return [f"![{caption}](./{stage}.svg)"] if studies(records) else []


def of_stage(stage: str, records: Mapping[str, Mapping]) -> dict[str, Mapping]:
    """The records of the cases of a stage."""
    return {id: record for id, record in records.items() if cases()[id].stage == stage}


#: Other pages on verification and judgement.
OTHER_PAGES = ((link("The paper's claims", "../../paper_figures/replication.md"), "`make claims`"),
           (link("Ambiguities and misprints of the paper", "../../reference/ERRATA.md"), "`verification.errata`"),
           (link("What the rounding of Table 1 allows", "../sensitivity/sensitivity.md"), "`make sensitivity`"),
           (link("The law for networks", "../../docs/network.md"), "`python -m verification.network`"),
           (link("Mutants made by machine", "sampled.md"), "`make mutants-sampled`"))


def index(records: Mapping[str, Mapping], state: str) -> list[str]:
    """The first page: stages, the state of the mutants, and a line a case."""
    stages = [(link(title, stage), summary(of_stage(stage, records).values())) for stage, title in TITLES.items()]
    more = ((link("Mutants", "mutants"), state),
            (link(OF_READERS, "mutants_read"), "files, columns, charts and messages that users read"),
            (link("Equation, module, case, reference, mutant, claim", "matrix"), "what verifies what, with which "
             "elements and presets"))
    return [f"{INTRODUCTION} Written by `make verify`.",
            f"**{summary(records.values())}**",
            table(("stage", "result"), (*stages, *more)),
            table(("judged besides", "command"), OTHER_PAGES),
            table(("case", "kind", "runs with", "numbers", "verdict", "must fall short with"),
                  (_index_row(cases()[id], record) for id, record in records.items()))]


def _index_row(case: Case, record: Mapping) -> tuple:
    numerics = " ".join(case.numerics) if case.numerics != NUMERICS else "all"
    return (link(case.id, case.stage, case.id), case.kind, numerics, record["numbers"], record["verdict"],
            ", ".join(case.mutants))


def article(case: Case, record: Mapping) -> list[str]:
    """A case: its claim, verdict, norm, references and mutants, and a table of quantities, intervals and origins."""
    references = f" References: {', '.join(case.references)}." if case.references else ""
    about = (f"**{record['verdict']}**. {case.claim} ({case.kind}). Norm: {case.norm}.{references} "
             f"Must fail with: {', '.join(case.mutants)}.")
    stopped = [f"Stopped by an error: {error}" for error in record["errors"]]
    head = ("quantities", "expected", "origin", "hold")
    judged = [table(head, record["table"])] if record["table"] else []
    return [f"## {case.id}", about, *stopped, *judged]


def shared(names: list[str]) -> str:
    """Names as one list. Names that begin alike up to a comma share the beginning, "C: linear; quadratic", and
    beginnings with the same list share the list."""
    begins: dict[str, list[str]] = {}
    for name in names:
        begins.setdefault(name.partition(", ")[0], []).append(name)
    lists: dict[str, list[str]] = {}
    for first, alike in begins.items():
        rest = listed([name[len(first) + 2:] for name in alike]) if len(alike) > 1 else ""
        lists.setdefault(rest, []).append(first if rest else alike[0])
    return " / ".join(f"{', '.join(firsts)}: {rest}" if rest else " / ".join(firsts) for rest, firsts in lists.items())


def listed(labels: list[str]) -> str:
    """Labels as one list. Neighbours share a final number in brackets. Three or more labels share their final
    parts after a comma."""
    split = [label.rpartition(" (") if label.endswith(")") else (label, "", "") for label in labels]
    rows = []
    for ending, group in groupby(split, key=lambda parts: parts[2]):
        names = [parts[0] for parts in group]
        rows.append(_ended_alike(names) + (f" ({'each ' * (len(names) > 1)}{ending}" if ending else ""))
    return "; ".join(rows)


def _ended_alike(names: list[str]) -> str:
    rows = []
    for _, group in groupby(names, key=lambda name: name.rpartition(", ")[2]):
        alike = [name.split(", ") for name in group]
        most = min(map(len, alike)) - 1 if len(alike) > 2 else 0
        ends = commonprefix([parts[::-1] for parts in alike])[:most]
        heads = [", ".join(parts[:len(parts) - len(ends)]) for parts in alike]
        rows.append("; ".join(heads) + (f", each {', '.join(ends[::-1])}" if ends else ""))
    return "; ".join(rows)


def mutant_state() -> str:
    """The numbers of caught mutants and of records of the present code."""
    records = runner.recorded()
    caught = sum(bool(record["caught_by"]) for record in records.values())
    stale = len(records) - len(runner.fresh())
    count = f"{caught} of {len(records)} mutants caught"
    state = f"{stale} of them run BEFORE THE LAST CHANGE of the code" if stale else "run on this code"
    return f"{count} by `make mutants`, {state}."


def _catchers(names: Iterable[str]) -> str:
    """Cases and tests, each file of tests once."""
    files = defaultdict(list)
    for name in names:
        file, _, test = TEST.sub(r"\1: ", name).rpartition(": ")
        files[file].append(test)
    return ", ".join((f"{file}: " if file else "") + ", ".join(tests) for file, tests in files.items()) or "not caught"


def mutant_blocks(stages: Mapping[str, Iterable[Mutant]], state: str) -> list[str]:
    """A table a stage: mutants, and the cases or tests that caught them when they were last run.

    A test is written as its file and its name without "test", and a file only once in a row, so that the page stays
    short.
    """
    records = runner.recorded()
    blocks = [state]
    for stage, chosen in stages.items():
        rows = [(mutant.id, mutant.says, _catchers(records[mutant.id]["caught_by"])) for mutant in chosen]
        blocks += [f"## {stage}", table(("mutant", "what is wrong with it", "caught by"), rows)]
    return blocks
