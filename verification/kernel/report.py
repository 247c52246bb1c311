"""The report: a table for the terminal, and Markdown for the diff.

What is committed (``REPORT.md``, a page a stage, ``mutants.md``, ``mutants_read.md``, ``matrix.md``) holds verdicts,
orders and accepted ranges, and numbers to half of their tolerance: a run on another machine writes the same files.
Digits and times are in ``live/``, which is not committed.
"""

from __future__ import annotations

import platform
from collections.abc import Iterable, Mapping
from importlib.metadata import version
from itertools import chain, groupby
from os.path import commonprefix
from pathlib import Path

from verification.kernel import matrix, mutants
from verification.kernel.case import CASES, WAYS, Outcome, Result
from verification.kernel.mutants import Mutant
from verification.kernel.writing import REPORT, Block, link, markdown, save, table

TITLES = {"flow": "Flow (2.1, 3.2)", "transport": "Substrates (2.2, 3.3)", "growth": "Growth mechanics (2.3, 3.4)",
          "reprojection": "Reprojection and transfer (3.4, 3.5)", "mesh_motion": "Mesh motion (3.5)",
          "coupling": "Coupling", "hard": "Hard cases"}
INTRODUCTION = (
    "Each case compares the implementation with a closed form, with a manufactured solution, with an independent code, "
    "or with what must be conserved. Verdicts follow from the numbers; orders are judged two-sidedly, between "
    "neighbours of a series of unrelated meshes. Each case names changes of the code (mutants) with which it must fall "
    "short; `make mutants` runs each of these until a case catches it, and those that tests must catch against these.")
OF_READERS = "Mutants of what users read"
PACKAGES = ("numpy", "scipy", "scikit-fem", "shapely", "mmgpy", "fipy", "py-pde", "matplotlib")


def terminal(results: list[Result]) -> str:
    """The cases, what fell short in each, and the count."""
    lines = []
    for result in results:
        lines.append(f"{result.verdict:12} {result.id:34} {result.seconds:6.1f} s  {CASES[result.id].claim}")
        lines += [f"{'':14}{part.quantity}: {part.measured}; expected {part.expected} ({part.origin})"
                  for part in result.outcome.measured if not part.holds]
        lines += [f"{'':14}{line}" for line in result.error.splitlines()]
    return "\n".join([*lines, summary(results)])


def summary(results: list[Result]) -> str:
    """How many hold, in one line."""
    numbers = sum(len(result.outcome.measured) for result in results)
    return f"{sum(result.holds for result in results)} of {len(results)} cases pass; {numbers} numbers judged."


def write(results: list[Result]) -> Path:
    """Write the report of a whole run; returns the path of its first page."""
    for name, text in texts(results).items():
        (REPORT / name).write_text(text, encoding="utf-8")
    cases = {result.id: _live(result) for result in results}
    save({"environment": environment(), "cases": cases}, REPORT / "live" / "measured.json")
    return REPORT / "REPORT.md"


def texts(results: list[Result]) -> dict[str, str]:
    """What is committed: {file: Markdown}."""
    of_stages = mutants.load()
    read = {"results": of_stages.pop("results")}
    found = {"REPORT.md": ("Verification", index(results)), "mutants.md": ("Mutants", mutant_blocks(of_stages)),
             "mutants_read.md": (OF_READERS, mutant_blocks(read))}
    for stage, title in TITLES.items():
        chosen = of_stage(stage, results)
        found[f"{stage}.md"] = title, [Block("text", summary(chosen)), *chain.from_iterable(map(article, chosen))]
    pages = {name: f"# {title}\n\n{markdown(blocks, 2)}\n" for name, (title, blocks) in found.items()}
    return {**pages, "matrix.md": matrix.text()}


def of_stage(stage: str, results: list[Result]) -> list[Result]:
    """Those of a stage's cases."""
    return [result for result in results if CASES[result.id].stage == stage]


#: What is judged elsewhere.
BESIDES = ((link("The paper's claims", "../../paper_figures/replication.md"), "`make claims`"),
           (link("Ambiguities and misprints of the paper", "../../reference/ERRATA.md"), "`verification.errata`"),
           (link("What the rounding of Table 1 allows", "../sensitivity/sensitivity.md"), "`make sensitivity`"),
           (link("The law for networks", "../../docs/network.md"), "`python -m verification.network`"),
           (link("Mutants made by machine", "sampled.md"), "`make mutants-sampled`"))


def index(results: list[Result]) -> list[Block]:
    """The first page: stages, and a line a case."""
    stages = [(link(title, stage), summary(of_stage(stage, results))) for stage, title in TITLES.items()]
    more = ((link("Mutants", "mutants"), mutant_state()),
            (link(OF_READERS, "mutants_read"), "those of them that tests must catch"),
            (link("Equation, module, case, reference, mutant, claim", "matrix"), "what is verified by what, with which "
             "elements and presets"))
    return [Block("text", f"{INTRODUCTION} Written by `make verify`."), Block("text", f"**{summary(results)}**"),
            table(("stage", ""), (*stages, *more)),
            table(("besides", ""), BESIDES),
            table(("case", "kind", "runs with", "numbers", "verdict", "must fall short with"),
                  map(_index_row, results))]


def _index_row(result: Result) -> tuple:
    case = CASES[result.id]
    ways = " ".join(case.ways) if case.ways != WAYS else "all"
    return (link(case.id, case.stage, case.id), case.kind, ways, str(len(result.outcome.measured)), result.verdict,
            ", ".join(case.mutants))


def article(result: Result) -> list[Block]:
    """A case: what it says and how, its verdict, and what is accepted."""
    case = CASES[result.id]
    told = f"**{result.verdict}**. {case.claim} ({case.kind}). Norm: {case.norm}."
    stopped = [Block("text", "Stopped by an error: " + result.error.splitlines()[-1])] if result.error else []
    return [Block("heading", result.id), Block("text", told), *stopped, *judged(result.outcome)]


def judged(found: Outcome) -> list[Block]:
    """A table of what is accepted and why, and of the quantities that are, or are not; those alike in a row."""
    alike: dict[tuple[str, str, str], list[str]] = {}
    for quantity, expected, origin, holds in found.lines():
        alike.setdefault((expected, origin, "yes" if holds else "NO"), []).append(quantity)
    rows = [(shared(names), *key) for key, names in alike.items()]
    return [table(("quantities", "expected", "origin", "hold"), rows)] if rows else []


def shared(names: list[str]) -> str:
    """Names in a list, those that begin alike up to a comma together: "C, linear; C, cubic" is "C: linear; cubic", and
    beginnings with the same list too."""
    begins: dict[str, list[str]] = {}
    for name in names:
        begins.setdefault(name.partition(", ")[0], []).append(name)
    lists: dict[str, list[str]] = {}
    for first, alike in begins.items():
        rest = listed([name[len(first) + 2:] for name in alike]) if len(alike) > 1 else ""
        lists.setdefault(rest, []).append(first if rest else alike[0])
    return " / ".join(f"{', '.join(firsts)}: {rest}" if rest else " / ".join(firsts) for rest, firsts in lists.items())


def listed(labels: list[str]) -> str:
    """Labels in a row; what several that follow each other tell alike at their ends, in brackets, once, and the parts
    after a comma that three or more end with too."""
    split = [label.rpartition(" (") if label.endswith(")") else (label, "", "") for label in labels]
    rows = []
    for told, group in groupby(split, key=lambda parts: parts[2]):
        names = [parts[0] for parts in group]
        rows.append(_ended_alike(names) + (f" ({'each ' * (len(names) > 1)}{told}" if told else ""))
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
    """Is the record of mutants that of the present code?"""
    caught, fresh = mutants.recorded()
    known = mutants.everything()
    count = f"{sum(bool(caught.get(id)) for id in known)} of {len(known)} mutants caught"
    return f"{count} by `make mutants`, {'run on this code' if fresh else 'run BEFORE THE LAST CHANGE of the code'}."


def mutant_blocks(of_stages: Mapping[str, Iterable[Mutant]]) -> list[Block]:
    """Mutants, a table a stage, with the cases or tests that caught them in the last whole hunt."""
    caught, _ = mutants.recorded()
    blocks = [Block("text", mutant_state())]
    for stage, chosen in of_stages.items():
        rows = [(mutant.id, mutant.says, ", ".join(caught.get(mutant.id, [])) or "not caught") for mutant in chosen]
        blocks += [Block("heading", stage), table(("mutant", "what is wrong with it", "caught by"), rows)]
    return blocks


def _live(result: Result) -> dict:
    measured = {part.quantity: part.measured for part in result.outcome.measured}
    return {"verdict": result.verdict, "seconds": round(result.seconds, 2), "measured": measured}


def environment() -> str:
    """Versions of Python and of what the numbers depend on."""
    packages = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    return f"Python {platform.python_version()}, {platform.system()} {platform.machine()}; {packages}."
