"""The published texts are complete, consistent and correct: note and register have the computed numbers, the commands
of README and tutorial run, and texts refer only to files, modules and claims that exist."""
import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from functools import cache
from pathlib import Path
from pkgutil import resolve_name

import matplotlib.pyplot as plt
import numpy as np
import pytest
from PIL import Image

import paper_figures
import repro
from paper_figures import replication
from repro import check
from repro.scene import load_scene, parse_scene
from tests.blocks import ROOT, blocks, execute, is_repro, is_target, printed_lines
from tests.test_architecture import source_files
from verification.claims import EXPECTED
from verification.evidence.cases import STAGES, cases


def text(name):
    return (ROOT / name).read_text(encoding="utf-8")


ERRATA = re.findall(r"^## (E\d+)\.", text("reference/ERRATA.md"), re.M)


@pytest.fixture(scope="module")
def record():
    return replication.read_records()


@pytest.mark.parametrize("page, template", replication.TEMPLATES.items(), ids=lambda path: path.stem)
def test_the_note_and_the_register_have_the_computed_numbers(page, template, record):
    filled = replication.fill_template(template.read_text(encoding="utf-8"), record)
    assert filled == page.read_text(encoding="utf-8")


def test_the_templates_have_no_number_that_a_run_computes():
    """Their only decimals, besides references and identifiers, are those of the paper: its scenes, its printed values,
    and its correction of the effluents."""
    for template in replication.TEMPLATES.values():
        body = template.read_text(encoding="utf-8").partition("## References")[0]
        plain = re.sub(r"\{\{.*?\}\}|`[^`]*`|\(https?://\S+\)|\[doi:.*?\]", "", body, flags=re.S)
        assert set(re.findall(r"\d+\.\d+", plain)) <= {"2.9", "1.5", "4.19", "6.13", "1.6", "19.2", "19.4"}


#: Largest number of words and of pictures of the note, which is read in five minutes. Spaces separate words.
WORDS, PICTURES = 1800, 4


def test_the_note_is_short_and_its_pictures_exist():
    """Its first paragraph states the consequences for a model of clogging, with numbers."""
    note = replication.NOTE.read_text(encoding="utf-8")
    read = re.sub(r"<!--.*?-->|\(https?://\S+\)", "", note, flags=re.S)
    pictures = re.findall(r"^!\[.+\]\((\S+)\)$", note, re.M)
    assert 900 < len(read.split()) <= WORDS and 1 <= len(pictures) <= PICTURES
    assert all((replication.FOLDER / picture).stat().st_size > 10_000 for picture in pictures)
    first = note.partition("\n## ")[2].partition("\n\n")[2].partition("\n\n")[0]
    assert len(re.findall(r"\d", first)) > 5 and "#" not in first


def test_every_claim_and_erratum_is_in_the_register(record):
    """Contradicted, undecided and dependent claims have a reason, and so do those of degree. The note names every
    contradicted claim. Counts of verdicts in all texts agree with the record."""
    page = replication.REGISTER.read_text(encoding="utf-8")
    ids = re.findall(r"^\| \*\*(C\d\d)", page, re.M)
    assert ids == list(EXPECTED) == [claim["id"] for claim in record["claims"]]
    by_kind = {kind: [] for kind in replication.NAMES.values()}
    for claim in record["claims"]:
        kind = replication.NAMES[claim["verdict"]]
        by_kind[kind].append(claim["id"])
        assert claim["reason"] or kind not in ("contradicted", "depends", "undecided", "unjudged"), claim["id"]
    for name in ("README.md", "paper_figures/replication.md", "paper_figures/register.md", "docs/scope.md",
                 "codecheck.yml"):
        counts = re.findall(r"\b(\d+) (?:claims )?(?:are )?(reproduced|contradicted|undecided)\b", text(name))
        assert all(int(count) == len(by_kind[kind]) for count, kind in counts), name
    assert set(by_kind["contradicted"]) <= set(STATEMENT.findall(replication.NOTE.read_text(encoding="utf-8")))
    listed = re.findall(r"^- \*\*(E\d+)\*\*", page, re.M)
    assert listed == ERRATA and len(ERRATA) >= 20


def test_the_codecheck_lists_what_make_figures_makes():
    content = text("codecheck.yml")
    listed = re.findall(r"^  - file: (\S+)$", content, re.M)
    figures = [f"paper_figures/out/{name}.pdf" for name in paper_figures.FIGURES] + ["paper_figures/out/manifest.json"]
    assert listed[: len(figures)] == figures
    assert all((ROOT / record).is_file() for record in listed[len(figures):]) and len(listed) > len(figures)
    title = replication.NOTE.read_text(encoding="utf-8").partition("\n")[0].removeprefix("# ")
    assert f'title: "{title}"' in content


def test_the_paper_has_the_form_that_joss_requires():
    """Its sections, between 750 and 1750 words, and a reference with a DOI for each citation."""
    body = text("docs/paper.md").rpartition("---\n")[2]
    assert re.findall(r"^# (.+)$", body, re.M) == [
        "Summary", "Statement of need", "State of the field", "Software design", "Research impact statement",
        "AI usage disclosure", "Acknowledgements", "References"]
    assert 750 <= len(body.split()) <= 1750
    entries = dict(re.findall(r"^@\w+\{(\w+), (.+)$", text("docs/paper.bib"), re.M))
    assert {*re.findall(r"@(\w+)", body)} == {*entries} and all("doi = {10." in entry for entry in entries.values())


@pytest.mark.thorough
def test_wheel_and_source_distribution_are_complete(tmp_path):
    """The wheel has the solver and its scenes alone, the source distribution the files of the checkout."""
    checkout = tmp_path / "checkout"
    subprocess.run(["git", "checkout-index", "--all", f"--prefix={checkout}/"], cwd=ROOT, check=True)
    tracked = [str(path.relative_to(checkout)) for path in checkout.rglob("*")]
    subprocess.run([sys.executable, "-m", "build", "--no-isolation", "--outdir", tmp_path / "dist", checkout],
                   capture_output=True, check=True)
    (wheel,), (source,) = ((tmp_path / "dist").glob(kind) for kind in ("*.whl", "*.tar.gz"))
    members = zipfile.ZipFile(wheel).namelist()
    data = {f"repro/scene/packaged/{path.name}" for path in (ROOT / "repro" / "scene" / "packaged").glob("*.toml")}
    data |= {"repro/network/resistance.csv", "repro/py.typed"}
    assert {name.partition("/")[0] for name in members} == {"repro", f"dupin2001_repro-{repro.__version__}.dist-info"}
    assert data <= set(members) and len(data) >= 5
    with tarfile.open(source) as archive:
        packed = {name.partition("/")[2] for name in archive.getnames()}
        kinds = (".py", ".md", ".toml", ".json", ".lock", ".yml", ".cff", ".bib", ".css", ".js", ".html")
        required = {name for name in tracked if name.endswith(kinds)}
    assert required - packed == set()


#: Next questions of a study, as they are typed into the search of the site.
QUESTIONS = ("two colonies", "acetate", "windows", "converging throat", "two strains", "1000 pores",
             "is it fine enough", "K-porosity", "what follows detachment")


@pytest.mark.parametrize("question", QUESTIONS)
def test_the_next_questions_have_a_short_answer_with_a_link(question):
    """One section has all words of the question; it has two sentences or more, and links to the page with the rest."""
    sections = text("docs/questions.md").split("\n## ")[1:]
    words = set(re.findall(r"\w+", question.lower())) - {"is", "it", "what"}
    answers = [section for section in sections if words <= set(re.findall(r"\w+", section.lower()))]
    assert answers and len(answers[0]) < 900 and len(re.findall(r"[.:?] ", answers[0])) >= 2
    for page, anchor in re.findall(r"\]\(([^)#]*)(?:#([^)]*))?\)", answers[0]):
        slugs = {re.sub(r"[^\w -]", "", head.lower()).replace(" ", "-")
                 for head in re.findall(r"^#+ (.+)$", text(f"docs/{page}"), re.M)}
        assert not anchor or anchor in slugs, (page, anchor)


# The examples of the README and the tutorial.
PAGE, TUTORIAL = ROOT / "README.md", ROOT / "docs" / "tutorial.md"
BLOCKS = blocks(PAGE)


def test_every_block_is_of_a_kind_that_is_executed():
    """Besides pages that the site executes, only README and tutorial have blocks. The README begins with two
    commands, a picture and a scene."""
    assert {block.language for block in BLOCKS} <= {"", "console", "sh", "python", "toml"}
    assert all(is_repro(words) or is_target(words) for block in BLOCKS for words in block.commands)
    others = {"tutorial.md", "index.md", "figures.md"}
    pages = [page for page in (ROOT / "docs").glob("*.md") if page.name not in others]
    assert len(pages) >= 3 and [page.name for page in pages if "```" in page.read_text(encoding="utf-8")] == []
    readme = PAGE.read_text(encoding="utf-8")
    assert len(readme.encode()) < 8_500 and readme.index("overview.png") < readme.index("make env") < 2_500


@pytest.mark.thorough
def test_the_examples_of_the_readme_run(tmp_path, capsys, monkeypatch):
    """Its commands run in their order in one folder; its scene is base; its Python runs."""
    monkeypatch.chdir(tmp_path)
    for words in [words for block in BLOCKS for words in block.commands if is_repro(words)]:
        assert execute(words, capsys)[0] == 0, words
    assert {path.name for path in (tmp_path / "runs").iterdir()} >= {"base", "mine"}
    (scene,) = (block.text for block in BLOCKS if block.language == "toml")
    assert parse_scene(tomllib.loads(scene), "base", "README.md") == load_scene("base")
    (example,) = (block.text for block in BLOCKS if block.language == "python")
    exec(compile(example, str(PAGE), "exec"), {})
    conductivity, shape = capsys.readouterr().out.splitlines()
    assert 160 < float(conductivity.removesuffix(" m/d")) < 175 and shape == "(783,)"


@pytest.mark.thorough
def test_the_examples_of_the_tutorial_run(tmp_path, capsys, monkeypatch):
    """Its commands, scene and Python run one after the other in one folder."""
    monkeypatch.chdir(tmp_path)
    printed, statuses = [], []
    names: dict = {}
    for block in blocks(TUTORIAL):
        if block.language == "toml":
            Path(re.match(r"# (\S+)\n", block.text)[1]).write_text(block.text)
        elif block.language == "python":
            exec(compile(block.text, str(TUTORIAL), "exec"), names)
        for words in block.commands:
            assert is_repro(words), words
            status, out, err = execute(words, capsys)
            printed.append(out)
            statuses.append(status)
            assert [err.strip()] == printed_lines(block) if status else printed_lines(block) == [], err
    plt.close("all")
    assert statuses == [0] * 7 + [2] + [0] * 7
    assert load_scene("mine.toml").pore == load_scene("base").pore
    assert (tmp_path / "runs" / "narrow" / "timeseries.csv").exists()
    assert (tmp_path / "oxygen.png").stat().st_size > 1000
    assert "WARNING" not in printed[3] and "contact with the opposite wall from t = " in printed[4]


@pytest.mark.thorough
def test_the_examples_of_the_how_to_pages_run(tmp_path, capsys, monkeypatch):
    """With a run of base to 1 h as runs/mine. test_sweep_cluster has clusters; PyVista reads and does not draw."""
    monkeypatch.chdir(tmp_path)
    assert execute(["repro", "run", "base", "--out", "runs/mine", "--set", 'growth.end="1 h"'], capsys)[0] == 0
    Image.fromarray(np.tri(100, 80, -40, dtype=np.uint8)).save("colony.png")
    seen = set()
    for page in sorted((ROOT / "docs" / "howto").glob("*.md")):
        for block in blocks(page):
            seen.add(block.language)
            for words in block.commands:
                if "--scheduler" not in words and words[0] != "dask":
                    assert execute(words, capsys)[0] == 0, words
            if block.language == "toml":
                words = {"outline.md": ("spline through 5 points", "straight lines between"),
                         "several_aggregates.md": ("2: a half-disc",)}[page.name]
                described = str(check(tomllib.loads(block.text)))
                seen |= {word for word in words if word in described}
            elif block.language == "python":
                names: dict = {}
                exec(compile(block.text.replace("mesh.plot(", "drawn = dict("), str(page), "exec"), names)
                if "drawn" in names:
                    assert names["drawn"]["scalars"] in names["mesh"].array_names
                    seen.add("drawn")
    plt.close("all")
    assert seen == {"console", "toml", "python", "drawn", "spline through 5 points", "straight lines between",
                    "2: a half-disc"}


def test_the_reference_lists_all_public_names_and_files(fast):
    """They are the names of the package and the files of a run. A run that ends has no checkpoint of its last step."""
    directives = re.findall(r"^\.\. auto(?:function|class|exception):: (\w+)$", text("docs/reference/api.md"), re.M)
    assert {*directives} == {*repro.__all__, "SceneError", "OutputError", "SimulationError", "PoreEnd", "Fold"}
    listed = set(re.findall(r"`([\w.]+)`", text("docs/reference/files.md").partition("## A sweep")[0]))
    written = {path.name for path in fast.iterdir() if path.is_file()}
    assert written <= listed and {"run.json", "ledger.csv", "report.html"} <= written


def test_the_page_of_the_model_names_existing_cases_and_each_equation():
    """Names of modules and errata are tested with those of all texts."""
    page = text("docs/model.md")
    named = set(re.findall(rf"`((?:{'|'.join(STAGES)})-[\w-]+)`", page))
    assert named <= set(cases()) and len(named) > 40
    labels = re.findall(r"\(eq-([\d-]+)\)$", page, re.M)
    ranges = [[int(number) for number in label.split("-")] for label in labels]
    assert {number for ends in ranges for number in range(ends[0], ends[-1] + 1)} == {*range(1, 35)}
    assert "(35)" in page
    relative = [name for row in re.findall(r"`repro\.model\.\w+`(?:, `\.\w+`)+", page)
                for name in re.findall(r"`\.(\w+)`", row)]
    assert relative and all(is_module(f"repro.model.{name}") for name in relative)


# Texts refer to existing files, modules, statements and errata.
FOLDERS = ("repro", "reference", "verification", "docs", "paper_figures", "tests")
PAGES = ("README.md", "CONTRIBUTING.md", "Makefile", "codecheck.yml", "CITATION.cff", "MANIFEST.in")
#: Files that commands make, and placeholders for names.
GENERATED = {"claims.md", "paper_figures/out/manifest.json"}
PLACEHOLDER = re.compile(r"(?<![A-Za-z])(NAME|STAGE|N|ID)(?![A-Za-z])")
ENDINGS = r"(?:py|md|toml|json|yml|yaml|cff|lock|css|js|svg)"
#: The path of a file in the repository, or the name of a page.
FILE = re.compile(rf"(?<![\w./-])((?:{'|'.join(FOLDERS)})/[\w./-]+\.{ENDINGS}|(?:\w[\w./-]*/)?[\w-]+\.md)\b")
MODULE = re.compile(rf"(?<![\w./])(?:repro|verification|paper_figures|tests)(?:\.(?!{ENDINGS}\b)[A-Za-z]\w*)+")
STATEMENT = re.compile(r"(?<![\w-])C\d\d(?!\w)")
ERRATUM = re.compile(r"\[(E\d+)\]")
#: Numbered lists of other documents, and paths of somebody's machine.
ELSEWHERE = re.compile(r"\b(?:traps?|issues?|tickets?|themes?|lessons?)\b[ #]*\d+"
                       r"|(?<![\w.])/(?:work|home|root|Users)/\w+", re.I)


@cache
def repository_files():
    """Paths of all files."""
    paths = {str(path.relative_to(ROOT)) for folder in FOLDERS for path in source_files(folder, "*")}
    return paths | {path.name for path in ROOT.iterdir() if path.is_file()}


def is_file(name):
    """Return whether the repository has a file with this path, or with a path that ends with it."""
    name = name.removeprefix("../")
    return name in repository_files() or any(path.endswith(f"/{name}") for path in repository_files())


@cache
def is_module(name):
    """Return whether the module, or its attribute, exists."""
    try:
        resolve_name(name)
    except (ImportError, AttributeError):
        return False
    return True


def unknown_references(text):
    """References of a text to files, modules, claims and errata that do not exist."""
    files = {name for name in FILE.findall(text) if name not in GENERATED and not PLACEHOLDER.search(name)}
    unknown = {name for name in files if not is_file(name)}
    unknown |= {name for name in MODULE.findall(text) if not is_module(name)}
    unknown |= set(STATEMENT.findall(text)) - set(EXPECTED) | set(ERRATUM.findall(text)) - set(ERRATA)
    return sorted(unknown | set(ELSEWHERE.findall(text)))


def test_texts_refer_only_to_existing_names():
    """In all pages and sources except tests, whose examples are made up."""
    texts = [path for path in repository_files() if path.endswith((".py", ".md", ".toml"))]
    paths = [path for path in texts if path.startswith(FOLDERS[:-1])]
    assert len(paths) > 200
    assert {path: unknown for path in (*paths, *PAGES) if (unknown := unknown_references(text(path)))} == {}
