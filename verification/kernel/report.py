"""The report: a table for the terminal; Markdown for the diff; pages with pictures, digits, seconds and environment.

What is committed (``REPORT.md``, a page a stage, ``mutants.md``, ``matrix.md``) holds verdicts, orders and accepted
ranges, and numbers to half of their tolerance: a run on another machine writes the same files. Digits and times are in
``live/`` and on the pages, which are not committed. Pictures of a case: errors against size with a slope triangle;
profiles, ours solid, reference dashed, exact dots.
"""

from __future__ import annotations

import platform
import shutil
from collections.abc import Callable
from importlib.metadata import version
from itertools import groupby
from pathlib import Path

import matplotlib
import numpy as np

from verification.kernel import matrix, mutants
from verification.kernel.case import CASES, STAGES, WAYS, Outcome, Profile, Result, Study
from verification.kernel.writing import Block, Link, markdown, page, save, table

FOLDER = Path(__file__).parents[1] / "report"
TITLES = {"flow": "Flow (2.1, 3.2)", "transport": "Substrates (2.2, 3.3)", "growth": "Growth mechanics (2.3, 3.4)",
          "reprojection": "Reprojection and transfer (3.4, 3.5)", "mesh_motion": "Mesh motion (3.5)",
          "coupling": "Coupling", "hard": "Hard cases"}
INTRODUCTION = (
    "Each case compares the implementation with a closed form, with a manufactured solution, with an independent code, "
    "or with what must be conserved. Verdicts follow from the numbers; orders are judged two-sidedly, between "
    "neighbours of a series of unrelated meshes. Each case names changes of the code (mutants) with which it must fall "
    "short; `make mutants` runs each of these until a case catches it, and those that tests must catch against these.")
#: How curves are drawn, and how many panels side by side.
STYLES = {"ours": {"ls": "-"}, "reference": {"ls": "--", "color": "k"},
          "exact": {"ls": "", "marker": ".", "ms": 4, "color": "0.35"},
          "points": {"ls": "", "marker": ".", "ms": 2}}
COLUMNS = 3
PACKAGES = ("numpy", "scipy", "scikit-fem", "shapely", "mmgpy", "fipy", "py-pde", "matplotlib")

matplotlib.use("Agg")


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


def write(results: list[Result], folder: Path = FOLDER) -> Path:
    """Write the report of a whole run; returns the path of its first page."""
    folder.mkdir(exist_ok=True)
    for name, text in texts(results).items():
        (folder / name).write_text(text, encoding="utf-8")
    _write_live(results, folder / "live")
    return _write_pages(results, folder)


def texts(results: list[Result]) -> dict[str, str]:
    """What is committed: {file: Markdown}."""
    found = {"REPORT.md": ("Verification", index(results)), "mutants.md": ("Mutants", mutant_blocks()),
             "matrix.md": (matrix.TITLE, matrix.blocks())}
    for stage, chosen in by_stage(results):
        found[f"{stage}.md"] = TITLES[stage], [Block("text", summary(chosen)), *articles(chosen)]
    return {name: f"# {title}\n\n{markdown(blocks, 2)}\n" for name, (title, blocks) in found.items()}


def by_stage(results: list[Result]) -> list[tuple[str, list[Result]]]:
    """(stage, its results) of the stages that have any."""
    ordered = sorted(results, key=lambda result: STAGES.index(CASES[result.id].stage))
    grouped = groupby(ordered, key=lambda result: CASES[result.id].stage)
    return [(stage, list(chosen)) for stage, chosen in grouped]


#: What is judged elsewhere.
BESIDES = ((Link("The paper's claims", "../../paper_figures/replication.md"), "`make claims`"),
           (Link("Ambiguities and misprints of the paper", "../../reference/ERRATA.md"), "`verification.errata`"),
           (Link("What the rounding of Table 1 allows", "../sensitivity/sensitivity.md"), "`make sensitivity`"),
           (Link("The law for networks", "../../docs/network.md"), "`python -m verification.network`"),
           (Link("Mutants made by machine", "sampled.md"), "`make mutants-sampled`"))


def index(results: list[Result]) -> list[Block]:
    """The first page: stages, and a line a case."""
    stages = [(Link(TITLES[stage], stage), summary(chosen)) for stage, chosen in by_stage(results)]
    more = ((Link("Mutants", "mutants"), mutant_state()),
            (Link("Equation, module, case, reference, mutant, claim", "matrix"), "what is verified by what, with which "
             "elements and presets"))
    return [Block("text", f"{INTRODUCTION} Written by `make verify`."), Block("text", f"**{summary(results)}**"),
            table(("stage", ""), (*stages, *more)),
            table(("besides", ""), BESIDES),
            table(("case", "kind", "runs with", "numbers", "verdict", "must fall short with"),
                  map(_index_row, results)),
            table(("case", "claim", "measured", "expected", "seconds"), map(_live_row, results), detail=True)]


def _index_row(result: Result) -> tuple:
    case = CASES[result.id]
    ways = " ".join(case.ways) if case.ways != WAYS else "all"
    return (Link(case.id, case.stage, case.id), case.kind, ways, str(len(result.outcome.measured)), result.verdict,
            ", ".join(case.mutants))


def _live_row(result: Result) -> tuple:
    case = CASES[result.id]
    return Link(case.id, case.stage, case.id), case.claim, *headline(result), f"{result.seconds:.1f}"


def headline(result: Result) -> tuple[str, str]:
    """(measured, expected) of what fell short, else of the first number, with how many there are besides."""
    parts = result.outcome.measured
    short = [part for part in parts if not part.holds] or list(parts)
    if not short:
        return "nothing", "a number"
    more = f" (and {len(parts) - 1} more)" if len(parts) > 1 else ""
    return f"{short[0].quantity}: {short[0].measured}{more}", short[0].expected


def articles(results: list[Result]) -> list[Block]:
    """Cases, one after the other."""
    return [block for result in results for block in article(result)]


def article(result: Result) -> list[Block]:
    """A case: what it says and how, its verdict, what is accepted, and, on pages, every number."""
    case = CASES[result.id]
    told = f"**{result.verdict}**. {case.claim} ({case.kind}). Norm: {case.norm}."
    blocks = [Block("heading", result.id), Block("text", told),
              Block("text", f"Must fall short with: {', '.join(case.mutants)}.", detail=True)]
    if result.error:
        blocks += [Block("text", "Stopped by an error: " + result.error.strip().splitlines()[-1]),
                   Block("error", result.error, detail=True)]
    rows = [(p.quantity, p.measured, p.expected, p.origin, _word(p.holds)) for p in result.outcome.measured]
    return [*blocks, *judged(result.outcome),
            table(("quantity", "measured", "expected", "origin", "holds"), rows, detail=True),
            *(Block("picture", f"pictures/{name}", detail=True) for name in pictures(result))]


def judged(found: Outcome) -> list[Block]:
    """A table of what is accepted and why, and of the quantities that are, or are not; those alike in a row."""
    alike: dict[tuple[str, str, str], list[str]] = {}
    for quantity, expected, origin, holds in found.lines():
        alike.setdefault((expected, origin, _word(holds)), []).append(quantity)
    rows = [(shared(names), *key) for key, names in alike.items()]
    return [table(("quantities", "expected", "origin", "hold"), rows, brief=True)] if rows else []


def shared(names: list[str]) -> str:
    """Names in a list, those that begin alike up to a comma together: "C, linear; C, cubic" is "C: linear; cubic", and
    beginnings with the same list too."""
    begins: dict[str, list[str]] = {}
    for name in names:
        begins.setdefault(name.partition(", ")[0], []).append(name)
    lists: dict[str, list[str]] = {}
    for first, alike in begins.items():
        single = len(alike) == 1
        rest = "" if single else listed([name[len(first) + 2:] for name in alike])
        lists.setdefault(rest, []).append(alike[0] if single else first)
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
        count = 0
        while count < most and len({tuple(parts[-count - 1:]) for parts in alike}) == 1:
            count += 1
        heads = [", ".join(parts[:len(parts) - count]) for parts in alike]
        rows.append("; ".join(heads) + (f", each {', '.join(alike[0][-count:])}" if count else ""))
    return "; ".join(rows)


def _word(holds: bool) -> str:
    return "yes" if holds else "NO"


def pictures(result: Result) -> dict[str, tuple[Callable, tuple]]:
    """{file name: (what draws a panel, a part for each)} of a case."""
    kinds = {"orders": (_study, result.outcome.studies), "profiles": (_profile, result.outcome.profiles)}
    return {f"{result.id}-{kind}.svg": found for kind, found in kinds.items() if found[1]}


def draw(result: Result, folder: Path) -> None:
    """Draw all of them."""
    from matplotlib import pyplot
    with np.errstate(all="ignore"):
        for name, (panel, parts) in pictures(result).items():
            figure, axes = _panels(pyplot, len(parts))
            for axis, part in zip(axes, parts):
                panel(axis, part)
            figure.savefig(folder / name)
            pyplot.close(figure)


def _panels(pyplot, count: int):
    """A figure with ``count`` axes; the rest of the grid hidden."""
    columns = min(COLUMNS, count)
    rows = -(-count // columns)
    figure, grid = pyplot.subplots(rows, columns, figsize=(3.9 * columns, 3.1 * rows), layout="constrained",
                                   squeeze=False)
    for axis in grid.ravel()[count:]:
        axis.axis("off")
    return figure, grid.ravel()[:count]


def _study(axis, study: Study) -> None:
    axis.loglog(study.sizes, study.errors, "o-", ms=4)
    order = (study.low + study.high) / 2
    x = study.sizes[-1] * np.array([1.0, 1.6])
    y = 0.5 * study.errors[-1] * (x / x[0]) ** order
    axis.loglog([x[0], x[1], x[1], x[0]], [y[0], y[0], y[1], y[0]], "k-", lw=0.8)
    axis.text(x[1] * 1.03, np.sqrt(y[0] * y[1]), f"{order:.3g}", fontsize=8, va="center")
    labelled(axis, study.quantity, "size of element or step", "error")


def _profile(axis, profile: Profile) -> None:
    for name, kind, x, y in profile.curves:
        axis.plot(x, y, label=name, **STYLES[kind])
    labelled(axis, profile.title, profile.x_label, profile.y_label)
    axis.legend(fontsize=6)


def labelled(axis, title: str, x_label: str, y_label: str) -> None:
    """Title and labels of axes, small."""
    axis.set_title(title, fontsize=9)
    axis.set_xlabel(x_label, fontsize=8)
    axis.set_ylabel(y_label, fontsize=8)
    axis.tick_params(labelsize=7, which="both")


def mutant_state() -> str:
    """Is the record of mutants that of the present code?"""
    caught, fresh = mutants.recorded()
    known = mutants.everything()
    count = f"{sum(bool(caught.get(id)) for id in known)} of {len(known)} mutants caught"
    return f"{count} by `make mutants`, {'run on this code' if fresh else 'run BEFORE THE LAST CHANGE of the code'}."


def mutant_blocks() -> list[Block]:
    """All mutants, a table a stage, with the cases or tests that caught them in the last whole hunt."""
    caught, _ = mutants.recorded()
    blocks = [Block("text", mutant_state())]
    for stage, chosen in mutants.load().items():
        rows = [(mutant.id, mutant.says, ", ".join(caught.get(mutant.id, [])) or "not caught") for mutant in chosen]
        blocks += [Block("heading", stage), table(("mutant", "what is wrong with it", "caught by"), rows)]
    return blocks


def _write_live(results: list[Result], folder: Path) -> None:
    """Every number with all its digits, and the seconds of this machine."""
    cases = {result.id: _live(result) for result in results}
    save({"environment": environment(), "cases": cases}, folder / "measured.json")


def _live(result: Result) -> dict:
    measured = {part.quantity: part.measured for part in result.outcome.measured}
    return {"verdict": result.verdict, "seconds": round(result.seconds, 2), "measured": measured}


def _write_pages(results: list[Result], folder: Path) -> Path:
    """Write index.html, a page a stage and their pictures; returns the path of the index."""
    shutil.rmtree(folder / "pictures", ignore_errors=True)
    (folder / "pictures").mkdir(parents=True)
    for result in results:
        draw(result, folder / "pictures")
    about, back = Block("text", environment()), table((Link("All cases", "index"),), ())
    found = {stage: (TITLES[stage], [back, *articles(chosen)]) for stage, chosen in by_stage(results)}
    speed = table((Link("Speed against error, hard cases, assumptions", "speed"),), ())
    found["index"] = "Verification", [*index(results), speed]
    found["mutants"] = "Mutants", [back, *mutant_blocks()]
    found["matrix"] = "What is verified by what", [back, *matrix.blocks()]
    for name, (title, blocks) in found.items():
        (folder / f"{name}.html").write_text(page(title, [*blocks, about]), encoding="utf-8")
    return folder / "index.html"


def environment() -> str:
    """Versions of Python and of what the numbers depend on."""
    packages = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    return f"Python {platform.python_version()}, {platform.system()} {platform.machine()}; {packages}."
