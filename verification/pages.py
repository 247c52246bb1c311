"""The report as pages: an index of all cases, a page a stage with its pictures, the mutants, and the environment."""

from __future__ import annotations

import html
import platform
import shutil
from importlib.metadata import version
from pathlib import Path

from verification import pictures, report
from verification.case import CASES, Result

PACKAGES = ("numpy", "scipy", "scikit-fem", "shapely", "mmgpy", "fipy", "py-pde", "matplotlib")
STYLE = """body {font: 15px/1.5 sans-serif; max-width: 1200px; margin: 2em auto; padding: 0 1em; color: #222}
table {border-collapse: collapse; font-size: 13px; margin: 1em 0} .no {background: #fbe3e0} img {max-width: 100%}
td, th {border-bottom: 1px solid #ddd; padding: 3px 8px; text-align: left; vertical-align: top} pre {color: #a00}"""


def write(results: list[Result], folder: Path) -> Path:
    """Write index.html, a page a stage and their pictures; returns the path of the index."""
    shutil.rmtree(folder / "pictures", ignore_errors=True)
    (folder / "pictures").mkdir(parents=True)
    for result in results:
        pictures.draw(result, folder / "pictures")
    for stage, chosen in report.by_stage(results):
        (folder / f"{stage}.html").write_text(_stage(stage, chosen), encoding="utf-8")
    (folder / "index.html").write_text(_index(results), encoding="utf-8")
    return folder / "index.html"


def page(title: str, *parts: str) -> str:
    """A whole page."""
    return (f"<!doctype html><html lang='en'><meta charset='utf-8'><title>{_safe(title)}</title><style>{STYLE}</style>"
            f"<body><h1>{_safe(title)}</h1>{''.join(parts)}</body></html>\n")


def _index(results: list[Result]) -> str:
    stages = report.by_stage(results)
    links = " · ".join(f"<a href='{stage}.html'>{_safe(report.TITLES[stage])}</a> ({len(chosen)})"
                       for stage, chosen in stages)
    links += " · <a href='speed.html'>Speed against error, hard cases, assumptions</a>"
    head = row("th", "case", "claim", "kind", "measured", "expected", "verdict", "must fall short with", "seconds")
    rows = "".join(_index_row(result) for result in results)
    return page("Verification", f"<p>{_safe(report.INTRODUCTION)}<p><b>{report.summary(results)}</b><p>{links}",
                 f"<table>{head}{rows}</table>", _mutants(), f"<h2>Environment</h2><p>{environment()}")


def _index_row(result: Result) -> str:
    case = CASES[result.id]
    measured, expected = map(_safe, report.headline(result))
    return row("td", f"<a href='{case.stage}.html#{case.id}'>{case.id}</a>", _safe(case.claim), case.kind, measured,
                expected, result.verdict, _safe(", ".join(case.mutants)), f"{result.seconds:.1f}", holds=result.holds)


def _mutants() -> str:
    body = "".join(row("td", *map(_safe, one), holds=one[-1] != "not caught") for one in report.mutant_rows())
    head = row("th", "mutant", "stage", "what is wrong with it", "caught by")
    return f"<h2>Mutants</h2><p>{_safe(report.mutant_state())}<table>{head}{body}</table>"


def _stage(stage: str, results: list[Result]) -> str:
    back = f"<p><a href='index.html'>All cases</a>. {report.summary(results)}"
    contents = "".join(f"<li><a href='#{r.id}'>{r.id}</a>: {_safe(CASES[r.id].claim)}" for r in results)
    return page(report.TITLES[stage], back, f"<ul>{contents}</ul>", *map(_article, results),
                 f"<h2>Environment</h2><p>{environment()}")


def _article(result: Result) -> str:
    case = CASES[result.id]
    head = row("th", "quantity", "measured", "expected", "origin")
    rows = "".join(row("td", _safe(p.quantity), p.measured, p.expected, _safe(p.origin), holds=p.holds)
                   for p in result.outcome.measured)
    images = "".join(f"<img src='pictures/{name}' alt='{name}'>" for name in pictures.names(result))
    error = f"<pre>{_safe(result.error)}</pre>" if result.error else ""
    return (f"<h2 id='{result.id}'>{result.id}: {result.verdict}</h2><p>{_safe(case.claim)} ({case.kind}; "
            f"{result.seconds:.1f} s).<p>Norm: {_safe(case.norm)}. Must fall short with: "
            f"{_safe(', '.join(case.mutants))}.{error}<table>{head}{rows}</table>{images}")


def row(kind: str, *cells: str, holds: bool = True) -> str:
    """A row of a table, its cells HTML already; red where something does not hold."""
    return f"<tr class='{'yes' if holds else 'no'}'>" + "".join(f"<{kind}>{cell}" for cell in cells)


def _safe(text: str) -> str:
    return html.escape(text)


def environment() -> str:
    """Versions of Python and of what the numbers depend on."""
    packages = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    return f"Python {platform.python_version()}, {platform.system()} {platform.machine()}; {packages}."
