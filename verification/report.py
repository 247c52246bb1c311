"""The report: a table for the terminal, ``REPORT.md`` for the diff, ``index.html`` with pictures and environment.

REPORT.md holds no time and no environment, and numbers only to their tolerance: a run that measures the same writes the
same file.
"""

from __future__ import annotations

import html
import platform
import shutil
from importlib.metadata import version
from pathlib import Path

from verification import pictures
from verification.case import CASES, STAGES, Result

FOLDER = Path(__file__).parent / "report"
PACKAGES = ("numpy", "scipy", "scikit-fem", "shapely", "mmgpy", "fipy", "py-pde", "matplotlib")
TITLES = {"flow": "Flow (2.1, 3.2)", "transport": "Substrates (2.2, 3.3)", "growth": "Growth mechanics (2.3, 3.4)",
          "reprojection": "Reprojection and transfer (3.4, 3.5)", "mesh_motion": "Mesh motion (3.5)",
          "coupling": "Coupling"}
INTRODUCTION = ("Each case compares the implementation with a closed form, with an independent code, or with what "
                "must be conserved. Verdicts follow from the numbers below; orders are judged two-sidedly, between "
                "neighbours of a series "
                "of unrelated meshes.")


def table(results: list[Result]) -> str:
    """The cases, what fell short in each, and the count."""
    lines = []
    for result in results:
        lines.append(f"{result.verdict:12} {result.id:28} {result.seconds:6.1f} s  {CASES[result.id].claim}")
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
    shutil.rmtree(FOLDER / "pictures", ignore_errors=True)
    (FOLDER / "pictures").mkdir(parents=True)
    (FOLDER / "REPORT.md").write_text(markdown(results), encoding="utf-8")
    for result in results:
        pictures.draw(result, FOLDER / "pictures")
    (FOLDER / "index.html").write_text(page(results), encoding="utf-8")
    return FOLDER / "index.html"


def markdown(results: list[Result]) -> str:
    """REPORT.md: an index, then every number with what is expected of it and why."""
    parts = ["# Verification\n", f"{INTRODUCTION} Written by `make verify`.\n", f"{summary(results)}\n",
             "| case | claim | kind | verdict |", "|---|---|---|---|"]
    parts += [f"| {r.id} | {CASES[r.id].claim} | {CASES[r.id].kind} | {r.verdict} |" for r in results]
    for stage, chosen in _by_stage(results):
        parts.append(f"\n## {TITLES[stage]}")
        for result in chosen:
            parts += ["", *_section(result)]
    return "\n".join(parts) + "\n"


def _by_stage(results: list[Result]):
    for stage in STAGES:
        chosen = [r for r in results if CASES[r.id].stage == stage]
        if chosen:
            yield stage, chosen


def _section(result: Result) -> list[str]:
    case = CASES[result.id]
    rows = [f"| {p.quantity} | {p.measured} | {p.expected} | {p.origin} | {'yes' if p.holds else 'NO'} |"
            for p in result.outcome.measured]
    head = [f"### {result.id}: {result.verdict}", f"{case.claim}.", "",
            f"Norm: {case.norm}. Must fail with: {case.mutant}.", ""]
    if result.error:
        return [*head, "Stopped by an error: " + result.error.strip().splitlines()[-1]]
    return [*head, "| quantity | measured | expected | origin | holds |", "|---|---|---|---|---|", *rows]


def page(results: list[Result]) -> str:
    """index.html: the same, with seconds, pictures and the environment."""
    head = _row("th", "case", "claim", "kind", "measured (expected)", "verdict", "must fail with", "seconds")
    index = "".join(_index_row(result) for result in results)
    stages = "".join(f"<h2>{TITLES[stage]}</h2>{''.join(map(_article, found))}" for stage, found in _by_stage(results))
    return (f"<!doctype html><html lang='en'><meta charset='utf-8'><title>Verification</title><style>{STYLE}</style>"
            f"<body><h1>Verification</h1><p>{INTRODUCTION}<p><b>{summary(results)}</b><table>{head}{index}</table>"
            f"{stages}<h2>Environment</h2><p>{_environment()}</body></html>\n")


STYLE = """body {font: 15px/1.5 sans-serif; max-width: 1200px; margin: 2em auto; padding: 0 1em; color: #222}
table {border-collapse: collapse; font-size: 13px} .no {background: #fbe3e0} img {max-width: 100%}
td, th {border-bottom: 1px solid #ddd; padding: 3px 8px; text-align: left; vertical-align: top}"""


def _row(kind: str, *cells: str, holds: bool = True) -> str:
    """A row of a table, its cells HTML already; red where something does not hold."""
    return f"<tr class='{'yes' if holds else 'no'}'>" + "".join(f"<{kind}>{cell}" for cell in cells)


def _index_row(result: Result) -> str:
    case = CASES[result.id]
    return _row("td", f"<a href='#{result.id}'>{result.id}</a>", _safe(case.claim), case.kind, _worst(result),
                result.verdict, _safe(case.mutant), f"{result.seconds:.1f}", holds=result.holds)


def _safe(text: str) -> str:
    return html.escape(text)


def _worst(result: Result) -> str:
    """What fell short, else the first number."""
    short = [p for p in result.outcome.measured if not p.holds] or list(result.outcome.measured[:1])
    return _safe("; ".join(f"{p.quantity}: {p.measured} ({p.expected})" for p in short))


def _article(result: Result) -> str:
    case = CASES[result.id]
    head = _row("th", "quantity", "measured", "expected", "origin")
    rows = "".join(_row("td", _safe(p.quantity), p.measured, p.expected, _safe(p.origin), holds=p.holds)
                   for p in result.outcome.measured)
    images = "".join(f"<img src='pictures/{name}' alt='{name}'>" for name in pictures.names(result))
    return (f"<h3 id='{result.id}'>{result.id}: {result.verdict}</h3><p>{_safe(case.claim)}."
            f"<p>Norm: {_safe(case.norm)}. Must fail with: {_safe(case.mutant)}.<pre>{_safe(result.error)}</pre>"
            f"<table>{head}{rows}</table>{images}")


def _environment() -> str:
    packages = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    return f"Python {platform.python_version()}, {platform.system()} {platform.machine()}; {packages}."
