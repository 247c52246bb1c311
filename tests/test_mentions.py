"""Texts speak of nothing that the repository does not hold: files, modules, statements, errata, other places."""
import re
from functools import cache
from pathlib import Path

import pytest

from tests.blocks import ROOT
from tests.test_architecture import own

FOLDERS = ("repro", "reference", "verification", "tests", "docs", "paper_figures")
PAGES = ("README.md", "CONTRIBUTING.md", "Makefile", "codecheck.author.yml", "CITATION.cff", "MANIFEST.in")
KINDS = (".py", ".md", ".toml")
#: What commands make; names in tests of what is not there, and words that stand for any name of their kind.
MADE = {"claims.md", "codecheck.yml", "paper_figures/out/manifest.json"}
EXAMPLES = {"repro/a.py", "repro.utils", "C38", "C99", "repro/m.py", "tests/__init__.py", "tests/test_m.py",
            "tests/test_gone.py"}
PLACEHOLDER = re.compile(r"(?<![A-Za-z])(NAME|STAGE|N|ID)(?![A-Za-z])")
ENDINGS = r"(?:py|md|toml|json|yml|yaml|cff|lock|css|js|svg)"
#: A file by its place in the repository, or any page of text by its name.
FILE = re.compile(rf"(?<![\w./-])((?:{'|'.join(FOLDERS)})/[\w./-]+\.{ENDINGS}|(?:\w[\w./-]*/)?[\w-]+\.md)\b")
MODULE = re.compile(r"(?<![\w./])(?:repro|verification|paper_figures|tests)(?:\.[A-Za-z]\w*)+")
STATEMENT = re.compile(r"(?<![\w-])C\d\d(?!\w)")
ERRATUM = re.compile(r"\[(E\d+)\]")
#: Numbered lists that are kept elsewhere, and places on somebody's machine.
ELSEWHERE = re.compile(r"\b(?:traps?|issues?|tickets?|themes?|lessons?)\b[ #]*\d+"
                       r"|(?<![\w.])/(?:work|home|root|Users)/\w+", re.I)


@cache
def held():
    """Paths of all files."""
    found = {str(path.relative_to(ROOT)) for folder in FOLDERS for path in own(folder, "*")}
    return found | {path.name for path in ROOT.iterdir() if path.is_file()}


@cache
def texts():
    """{path in the repository: text} of what people read, but for this file's own examples."""
    inside = [path for path in sorted(held()) if path.startswith(FOLDERS) and path.endswith(KINDS)]
    own = str(Path(__file__).relative_to(ROOT))
    return {path: (ROOT / path).read_text(encoding="utf-8") for path in (*inside, *PAGES) if path != own}


def is_file(name):
    """Is a file there, by its place or by the end of it?"""
    name = name.removeprefix("../")
    return name in held() or any(path.endswith(f"/{name}") for path in held())


def is_module(name):
    """Is a module there, with the name that is asked of it, if any, in its text?"""
    parts = name.split(".")
    for count in range(len(parts), 0, -1):
        path = "/".join(parts[:count])
        for source in (f"{path}.py", f"{path}/__init__.py"):
            if source in held():
                rest = parts[count:]
                text = (ROOT / source).read_text(encoding="utf-8")
                return not rest or re.search(rf"\b{rest[0]}\b", text) is not None
        if (ROOT / path).is_dir() and count == len(parts):
            return True
    return False


@cache
def statements():
    """Numbers of the paper's statements that are judged."""
    sources = [path.read_text(encoding="utf-8") for path in (ROOT / "verification" / "claims").glob("*.py")]
    return set(re.findall(r'@claim\("(C\d\d)"', "\n".join(sources)))


@cache
def errata():
    """Numbers of the errata."""
    page = (ROOT / "reference" / "ERRATA.md").read_text(encoding="utf-8")
    return set(re.findall(r"^## (E\d+)\.", page, re.M))


def unheld(text):
    """What a text speaks of that is not there."""
    files = {name for name in FILE.findall(text) if not (name in MADE | EXAMPLES or PLACEHOLDER.search(name))}
    found = {name for name in files if not is_file(name)}
    modules = {name for name in MODULE.findall(text) if not re.search(rf"\.{ENDINGS}$", name)}
    found |= {name for name in modules - EXAMPLES if not is_module(name)}
    found |= set(STATEMENT.findall(text)) - statements() - EXAMPLES
    found |= set(ERRATUM.findall(text)) - errata()
    return sorted(found | set(ELSEWHERE.findall(text)))


def test_nothing_is_spoken_of_that_is_not_there():
    """In texts, statements and errata that there are."""
    assert len(texts()) > 200 and len(statements()) > 30 and len(errata()) > 15
    assert {path: found for path, text in texts().items() if (found := unheld(text))} == {}


@pytest.mark.parametrize("text", [
    "as `numer" + "ics.md` has it",
    "(tr" + "ap 3)",
    "Iss" + "ue #12: round-off",
    "see `docs/no" + "where.md`",
    "`repro/cur" + "ved/flow.py` is",
    ":mod:`repro.cur" + "ved.flow`",
    "repro.fem.mesh.No" + "Mesh",
    "by claim C" + "97",
    "as said in [E" + "99]",
    "in /wo" + "rk/notes",
])
def test_the_check_sees_one(text):
    assert len(unheld(text)) == 1
