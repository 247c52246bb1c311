"""A page of each case, with an index: ``python -m verification.evidence.case_pages FOLDER``.

`make docs` writes them into ``build/cases``; they are not committed. Each follows from the mark and the docstring of
its case, from its code, and from the records ``evidence.json`` and ``mutants.json``. No case is judged again.
"""

import inspect
import os
import re
import subprocess
import sys
from collections.abc import Mapping
from functools import cache
from importlib import import_module
from pathlib import Path

from verification import validation
from verification.evidence import convergence, pages
from verification.evidence.cases import KINDS, Case, cases
from verification.evidence.matrix import cases_of, parts, references_of
from verification.evidence.writing import REPORT, ROOT, load, page, table
from verification.mutants import runner

#: Texts on the drawing and on the picture of the errors.
GEOMETRY = "The first mesh that the case makes. Brown: biomass; blue: fluid."
ERRORS = "Recorded errors against sizes of meshes or steps. Dashed: the expected order."
#: Largest number of variants that a page lists.
MOST_LABELS = 24
#: Front matter of a page that no table of contents lists.
ORPHAN = "---\norphan: true\n---\n\n"


def write(folder: Path) -> None:
    """Write the pages of all cases, the pictures of their errors, and the index.

    Drawings are made anew if a case or a problem is newer than the index, pictures if the record is newer than they.
    """
    folder.mkdir(parents=True, exist_ok=True)
    records = pages.recorded()
    if _is_older(folder / "index.md", *_modules("cases"), *_modules("problems")):
        subprocess.run([sys.executable, "-m", "verification.evidence.first_mesh", str(folder)], check=True, cwd=ROOT,
                       env={**os.environ, "PYTHONPATH": str(ROOT)}, stdout=subprocess.DEVNULL)
    for id, studies in pages.studies(records).items():
        if _is_older(picture := folder / f"{id}.svg", pages.RECORD):
            convergence.draw({id: studies}, picture)
    for id, record in records.items():
        blocks = article(cases()[id], record, folder)
        _write_changed(folder / f"{id}.md", ORPHAN + page(id, blocks))
    (folder / "index.md").write_text(page("Verification cases", index(records)), encoding="utf-8")


def _write_changed(file: Path, text: str) -> None:
    """Write a page if its text has changed: Sphinx reads pages again that are newer than its last build."""
    if not file.exists() or file.read_text(encoding="utf-8") != text:
        file.write_text(text, encoding="utf-8")


def _is_older(file: Path, *sources: Path) -> bool:
    """Whether a file is older than one of its sources, or missing."""
    return not file.exists() or file.stat().st_mtime < max(source.stat().st_mtime for source in sources)


def _modules(room: str) -> list[Path]:
    return [*(ROOT / "verification" / room).glob("*.py")]


def index(records: Mapping[str, Mapping]) -> list[str]:
    """The blocks of the index: a line a case, and a line a section of the comparisons with measurements."""
    head = ("case", "stage", "kind", "elements and presets", "equations", "verdict", "claim")
    rows = [(f"[{id}]({id}.md)", cases()[id].stage, cases()[id].kind, "; ".join(cases()[id].numerics),
             "; ".join(equations()[id]), record["verdict"], cases()[id].claim) for id, record in records.items()]
    rows += _validations()
    kinds = "; ".join(f"*{kind}*, {words}" for kind, words in KINDS.items() if kind in {row[2] for row in rows})
    return [f"**{pages.summary(records.values())}** {pages.mutant_state()}",
            f"Kinds: {kinds}. Menus above the table choose stage, kind, elements, presets and equations; the field "
            "filters by words. Elements of order 1 are linear, those of order 2 quadratic. The last lines are the "
            "sections of the page [Validation](../../docs/validation.md).", table(head, rows)]


def _validations() -> list[tuple[str, ...]]:
    """A line for each section of the page of the validation, with the number of its rows by verdict."""
    text = validation.PAGE.read_text(encoding="utf-8")
    return [(f"[{heading.partition(':')[0]}](../../docs/validation.md#{_anchor(heading)})", "", "validation", "", "",
             f"{agree} agree, {disagree} disagree, {others} without a verdict", heading)
            for heading, agree, disagree, others in validation.counts(text, load(validation.RECORD, {}))]


def _anchor(heading: str) -> str:
    """The anchor of a heading on the site."""
    return re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-")


def article(case: Case, record: Mapping, folder: Path) -> list[str]:
    """The blocks of the page of a case. Pictures are those in the folder."""
    stopped = [f"Stopped by an error: {error}" for error in record["errors"]]
    head = ("quantities (recorded number)", "expected", "origin", "hold")
    judged = [table(head, record["table"])] if record["table"] else ["Nothing is recorded yet."]
    return [f"{case.claim}.", f"**{record['verdict']}**; {record['numbers']} numbers judged. Norm: {case.norm}.",
            *stopped, table(("", ""), _facts(case)),
            *_picture("Geometry", GEOMETRY, folder / f"{case.id}.png"),
            *_picture("Errors", ERRORS, folder / f"{case.id}.svg"), "## Numbers", *judged,
            "## Mutants", "The case must fail with each of these wrong changes of the code. Each is run until a case "
            "catches it.", table(("mutant", "what is wrong with it", "file", "caught by"), _mutants(case)),
            "## Run it", f"```sh\n{command(case)}\n```", "## Code", f"```python\n{source(case)}```",
            f"[All cases](index.md); [cases of this stage]({_report(case.stage)})"]


def _facts(case: Case) -> list[tuple[str, str]]:
    """Rows of the table of what a case declares; those without a value are left out."""
    slow = f"{len(case.slow_variants)} of {len(case.variants)} variants run with `make verify` alone"
    rows = {"stage": pages.TITLES[case.stage], "kind": case.kind, "equations": "; ".join(equations()[case.id]),
            "elements and presets": ", ".join(case.numerics), "others": case.omitted,
            "references": ", ".join(f"reference/{name}.py" for name in sorted(references_of(case))),
            "variants": _variants([*filter(None, case.variants)]), "slow": slow if case.slow_variants else ""}
    return [(name, text) for name, text in rows.items() if text]


def _variants(labels: list[str]) -> str:
    """The labels of the variants; of many ones the number, the first three and the last."""
    if len(labels) <= MOST_LABELS:
        return pages.listed(labels)
    return f"{len(labels)}: {'; '.join(labels[:3])}; ...; {labels[-1]}"


@cache
def equations() -> dict[str, list[str]]:
    """{case: the equations of the modules in which it must detect wrong changes, or the names of parts without any}."""
    named = [(id, part.equations or part.name) for part in parts() for id in cases_of(part)]
    return {id: [*dict.fromkeys(name for case, name in named if case == id)] for id in cases()}


def _picture(heading: str, text: str, file: Path) -> list[str]:
    """A picture with its heading, if the file exists."""
    return [f"## {heading}", f"![{text}](./{file.name})", text] if file.exists() else []


def _mutants(case: Case) -> list[tuple[str, ...]]:
    """A row a mutant of a case, with the cases that caught it when it was last run."""
    known, records = runner.mutants_by_id(), runner.recorded()
    return [(id, known[id].says, known[id].file, ", ".join(records[id]["caught_by"]) or "not caught")
            for id in case.mutants]


def command(case: Case) -> str:
    """The command that runs a case alone."""
    (test,) = {test.partition("[")[0] for test in case.variants.values()}
    beside = [id for id, other in cases().items() if _function(other) == test and id != case.id]
    longer = "".join(f" and not {id}" for id in beside if case.id in id)
    return f".venv/bin/python -m pytest {test}" + (f' -k "{case.id}{longer}"' if beside else "")


def _function(case: Case) -> str:
    """The test function of a case: the file and its name."""
    return next(iter(case.variants.values())).partition("[")[0]


def source(case: Case) -> str:
    """The code of the test function of a case, with its marks."""
    module = import_module(".".join(case.file.relative_to(ROOT).with_suffix("").parts))
    return inspect.getsource(getattr(module, _function(case).partition("::")[2]))


def _report(stage: str) -> str:
    """The page of a stage, from the folder of the site."""
    return f"../../{(REPORT / stage).relative_to(ROOT)}.md"


if __name__ == "__main__":
    write(Path(sys.argv[1]))
