"""The paper in JOSS's form on the site: its sections below one title, its citations as links to its references.

Pandoc, with which JOSS sets `docs/paper.md`, reads `[@key; @key]` and makes the list of references from `paper.bib`.
The file in the repository stays as Pandoc needs it.
"""

import re
from pathlib import Path

PAPER = "docs/paper"
CITATION = re.compile(r"\[(@\w+(?:; @\w+)*)\]")
#: One entry of a bibliography; a value has no braces, or pairs of them.
ENTRY = re.compile(r"^@\w+\{(\w+),(.+)\}$", re.M)
VALUE = re.compile(r"(\w+) = \{((?:[^{}]|\{[^{}]*\})*)\}")


def read_bibliography(text: str) -> dict[str, dict[str, str]]:
    """Return {key: {field: text}} of a bibliography with one entry a line."""
    return {key: {name: re.sub("[{}]", "", value) for name, value in VALUE.findall(fields)}
            for key, fields in ENTRY.findall(text)}


def cite(entry: dict[str, str]) -> str:
    """Return the first author and the year, as a sentence cites them."""
    families = [author.partition(",")[0] for author in entry["author"].split(" and ")]
    names = " and ".join(families) if len(families) < 3 and "others" not in families else f"{families[0]} and others"
    return f"{names}, {entry['year']}"


def format_reference(key: str, entry: dict[str, str]) -> str:
    """Return one item of the list of references."""
    names = entry["author"].replace(" and ", "; ").replace("; others", " and others")
    volume = f" {entry['volume']}" if "volume" in entry else ""
    pages = f", {entry['pages'].replace('--', '-')}" if "pages" in entry else ""
    doi = f"[doi:{entry['doi']}](https://doi.org/{entry['doi']})"
    return f"({key})=\n{names}: {entry['title']}. *{entry['journal']}*{volume}{pages} ({entry['year']}). {doi}"


def render(text: str, bibliography: dict[str, dict[str, str]]) -> str:
    """Return the paper with links for citations, its references, and its sections one level lower."""
    def links(match: re.Match) -> str:
        return "(" + "; ".join(f"[{cite(bibliography[key[1:]])}](#{key[1:]})" for key in match[1].split("; ")) + ")"

    cited = dict.fromkeys(key[1:] for match in CITATION.findall(text) for key in match.split("; "))
    body = re.sub(r"^# ", "## ", CITATION.sub(links, text), flags=re.M)
    return body.rstrip() + "\n\n" + "\n\n".join(format_reference(key, bibliography[key]) for key in cited) + "\n"


def render_paper(app, docname: str, source: list[str]) -> None:
    """Replace the source of the paper while Sphinx reads it."""
    if docname == PAPER:
        bibliography = Path(app.srcdir, PAPER).with_suffix(".bib").read_text(encoding="utf-8")
        source[0] = render(source[0], read_bibliography(bibliography))


def setup(app) -> dict:
    """Register the transformation."""
    app.connect("source-read", render_paper)
    return {"parallel_read_safe": True}
