"""The report as text: a table for the terminal, and ``REPORT.md`` for the diff.

REPORT.md holds no time and no environment, and numbers only to their tolerance: a run that measures the same writes the
same file. The pages with pictures, seconds and the environment are made by :mod:`verification.pages`.
"""

from __future__ import annotations

from pathlib import Path

from verification import hard_cases, mutants, pages, speed
from verification.case import CASES, STAGES, Result

FOLDER = Path(__file__).parent / "report"
TITLES = {"flow": "Flow (2.1, 3.2)", "transport": "Substrates (2.2, 3.3)", "growth": "Growth mechanics (2.3, 3.4)",
          "reprojection": "Reprojection and transfer (3.4, 3.5)", "mesh_motion": "Mesh motion (3.5)",
          "coupling": "Coupling", "hard": "Hard cases"}
INTRODUCTION = (
    "Each case compares the implementation with a closed form, with a manufactured solution, with an independent code, "
    "or with what must be conserved. Verdicts follow from the numbers; orders are judged two-sidedly, between "
    "neighbours of a series of unrelated meshes. Each case names changes of the code (mutants) with which it must fall "
    "short; `make mutants` runs each of these until a case catches it.")


def table(results: list[Result]) -> str:
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
    held, numbers = sum(r.holds for r in results), sum(len(r.outcome.measured) for r in results)
    return f"{held} of {len(results)} cases pass; {numbers} numbers judged."


def write(results: list[Result]) -> Path:
    """Write the report of a whole run; returns the path of its first page."""
    FOLDER.mkdir(exist_ok=True)
    (FOLDER / "REPORT.md").write_text(markdown(results), encoding="utf-8")
    hard_cases.record(results)
    speed.write_page(FOLDER)
    return pages.write(results, FOLDER)


def by_stage(results: list[Result]) -> list[tuple[str, list[Result]]]:
    """(stage, its results) of the stages that have any."""
    grouped = [(stage, [r for r in results if CASES[r.id].stage == stage]) for stage in STAGES]
    return [(stage, chosen) for stage, chosen in grouped if chosen]


def headline(result: Result) -> tuple[str, str]:
    """(measured, expected) of what fell short, else of the first number, with how many there are besides."""
    parts = result.outcome.measured
    short = [part for part in parts if not part.holds] or list(parts)
    if not short:
        return "nothing", "a number"
    more = f" (and {len(parts) - 1} more)" if len(parts) > 1 else ""
    return f"{short[0].quantity}: {short[0].measured}{more}", short[0].expected


def markdown(results: list[Result]) -> str:
    """REPORT.md: an index, every number with what is expected of it and why, and the mutants."""
    parts = ["# Verification\n", f"{INTRODUCTION} Written by `make verify`.\n", f"{summary(results)}\n",
             *_head("case", "claim", "kind", "measured", "expected", "verdict", "mutants")]
    parts += [_line(r.id, CASES[r.id].claim, CASES[r.id].kind, *headline(r), r.verdict, ", ".join(CASES[r.id].mutants))
              for r in results]
    for stage, chosen in by_stage(results):
        parts.append(f"\n## {TITLES[stage]}")
        for result in chosen:
            parts += ["", *_section(result)]
    return "\n".join([*parts, "", *_mutants()]) + "\n"


def _head(*cells: str) -> list[str]:
    return [_line(*cells), _line(*["---"] * len(cells))]


def _line(*cells: str) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _section(result: Result) -> list[str]:
    case = CASES[result.id]
    head = [f"### {result.id}: {result.verdict}", f"{case.claim}.", "",
            f"Norm: {case.norm}. Must fall short with: {', '.join(case.mutants)}.", ""]
    if result.error:
        return [*head, "Stopped by an error: " + result.error.strip().splitlines()[-1]]
    rows = [_line(p.quantity, p.measured, p.expected, p.origin, "yes" if p.holds else "NO")
            for p in result.outcome.measured]
    return [*head, *_head("quantity", "measured", "expected", "origin", "holds"), *rows]


def mutant_rows() -> list[tuple[str, str, str, str]]:
    """(mutant, stage, what is wrong with it, cases that caught it in the last whole hunt)."""
    caught, _ = mutants.recorded()
    return [(mutant.id, stage, mutant.says, ", ".join(case for case, _ in caught.get(mutant.id, [])) or "not caught")
            for stage, chosen in mutants.load().items() for mutant in chosen.values()]


def mutant_state() -> str:
    """Is the record of mutants that of the present code?"""
    caught, fresh = mutants.recorded()
    known = mutants.everything()
    count = f"{sum(bool(caught.get(id)) for id in known)} of {len(known)} mutants caught"
    return f"{count} by `make mutants`, {'run on this code' if fresh else 'run BEFORE THE LAST CHANGE of the code'}."


def _mutants() -> list[str]:
    return ["## Mutants", mutant_state(), "", *_head("mutant", "stage", "what is wrong with it", "caught by"),
            *(_line(*row) for row in mutant_rows())]
