"""`index.html`: every figure with its caption, the commands of its runs and its claims, readable offline."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from html import escape
from pathlib import Path

from paper_figures.claims import STATEMENTS, judged, verdicts
from repro.results import write_text

LOOK = """
body { max-width: 60rem; margin: 2rem auto; padding: 0 1.25rem; color: #1c1c1c; background: #fff;
       font: 1rem/1.55 system-ui, sans-serif; }
h1 { font-size: 1.6rem; line-height: 1.25; } h2 { font-size: 1.2rem; margin: 0 0 .75rem; }
section { margin: 2.5rem 0; padding-top: 1.5rem; border-top: 1px solid #ddd; }
img { display: block; width: 100%; height: auto; }
pre { overflow-x: auto; padding: .6rem .8rem; background: #f4f4f2; border-radius: 4px; font-size: .85rem;
      white-space: pre-wrap; overflow-wrap: anywhere; }
h3 { font-size: .95rem; margin: 1rem 0 .25rem; } ul { margin: .25rem 0; padding-left: 1.25rem; }
nav a { margin-right: .9rem; white-space: nowrap; } a { color: #0072B2; } .note { color: #555; }
"""


@dataclass(frozen=True)
class Entry:
    """One figure of the page; `commands` reproduce its runs."""

    name: str
    title: str
    caption: str
    commands: tuple[str, ...]
    claims: tuple[str, ...]


def write(entries: Iterable[Entry], endings: Iterable[str], folder: Path) -> None:
    """Write `index.html` beside the pictures; `endings` describe how each run ended."""
    write_text(folder / "index.html", page(list(entries), endings))


def page(entries: list[Entry], endings: Iterable[str]) -> str:
    """The page as HTML that is well-formed XML."""
    links = "".join(f'<a href="#{escape(e.name)}">{escape(_short(e))}</a> ' for e in entries)
    return f"""<!DOCTYPE html>
<html lang="en">
<head><meta charset="utf-8"/><meta name="viewport" content="width=device-width, initial-scale=1"/>
<title>Figures of Dupin, Kitanidis &amp; McCarty (2001), recomputed</title><style>{LOOK}</style></head>
<body>
<h1>Figures of Dupin, Kitanidis &amp; McCarty (2001), recomputed</h1>
<p>Pore-scale modeling of biological clogging due to aggregate expansion: a material mechanics approach, Water
Resources Research, paper 2001WR000306. All numbers on this page are read from the runs behind it. <b>Figure 1</b> of
the paper is a photograph of an experiment and cannot be regenerated. Claims are judged by <code>make claims</code>,
with verdicts as recorded in <code>verification/claims/claims.json</code>, whose rows keep former verdicts.</p>
<nav>{links}</nav>
<ul class="note">{"".join(f"<li>{escape(ending)}</li>" for ending in endings)}</ul>
{"".join(map(_section, entries))}</body>
</html>
"""


def commands_of_claims(module) -> tuple[str, ...]:
    """Commands for the numbers that a figure computes with the functions of the claims in COMPUTED."""
    return tuple(f"python -m verification.claims {id}" for id in getattr(module, "COMPUTED", ()))


def caption_html(caption: str, claims: Iterable[str]) -> str:
    """The caption of a figure and the verdicts of its claims; words between backticks are code."""
    return re.sub("`(.+?)`", r"<code>\1</code>", escape(f"{caption} {judged(claims)}".strip()))


def _short(entry: Entry) -> str:
    """The number of a figure of the paper, or the title of an addition."""
    kind, _, title = entry.title.partition(". ")
    return title if kind == "Addition" else kind


def _section(entry: Entry) -> str:
    """The section of one figure."""
    name = escape(entry.name)
    run = "\n".join(entry.commands) or "# drawn from the geometry alone"
    claims = "".join(f"<li><b>{escape(key)}</b> {escape(STATEMENTS[key])}: "
                     f"<i>{escape(verdicts().get(key, 'not judged'))}</i></li>" for key in entry.claims)
    return f"""<section id="{name}">
<h2>{escape(entry.title)}</h2>
<img src="{name}.png" alt="{escape(entry.title)}"/>
<p>{caption_html(entry.caption, entry.claims)} <a href="{name}.pdf">PDF</a></p>
<h3>Commands</h3>
<pre>{escape(run)}</pre>
<h3>Claims</h3>
<ul>{claims}</ul>
</section>
"""
