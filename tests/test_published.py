"""What a publication needs is there, agrees with itself and works as it stands: the replication note says what was
computed, what README and tutorial show is executed, and texts speak of nothing that the repository does not hold."""
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
import pytest

import paper_figures
from paper_figures import replication
from repro.scene import load_scene, parse_scene
from tests.blocks import ROOT, blocks, execute, is_repro, is_target, told
from tests.test_architecture import own
from verification.claims import EXPECTED

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def text(name):
    return (ROOT / name).read_text(encoding="utf-8")


ERRATA = re.findall(r"^## (E\d+)\.", text("reference/ERRATA.md"), re.M)


@pytest.fixture(scope="module")
def record():
    return replication.told()


def test_the_note_tells_what_was_computed(record):
    template = replication.TEMPLATE.read_text(encoding="utf-8")
    assert replication.filled(template, record) == replication.NOTE.read_text(encoding="utf-8")


def test_the_template_has_no_number_that_a_run_computes():
    """Decimals outside of references, of the paper's own scenes and of identifiers."""
    body = replication.TEMPLATE.read_text(encoding="utf-8").partition("## References")[0]
    plain = re.sub(r"\{\{.*?\}\}|`[^`]*`|\(https?://\S+\)|\[doi:.*?\]", "", body, flags=re.S)
    assert set(re.findall(r"\d+\.\d+", plain)) == {"2.9", "19.2", "19.4"}


@pytest.mark.parametrize("field", ["{{C99 | contradicted}}", "{{C01 | contradicted}}", "{{C01 | no such | .2f}}",
                                   "{{no.such}}"])
def test_what_there_is_not_is_refused(record, field):
    with pytest.raises(LookupError):
        replication.filled(field, record)


def test_every_claim_and_erratum_is_in_the_note(record):
    """Each claim once, in the list of its verdict; a contradiction, or what is undecided, with its reason. A count of
    verdicts anywhere is the record's."""
    kinds = ("reproduced", "rounding", "changed", "contradicted", "undecided")
    named = {kind: re.findall(r"^- \*\*(C\d\d)\*\*", replication.filled(f"{{{{list.{kind}}}}}", record), re.M)
             for kind in kinds}
    assert sorted(sum(named.values(), [])) == list(EXPECTED)
    open_or_not = {*named["contradicted"], *named["undecided"]}
    assert all(claim["reason"] for claim in record["claims"] if claim["id"] in open_or_not)
    for name in ("README.md", "paper_figures/replication.md", "docs/scope.md", "codecheck.author.yml"):
        counts = re.findall(r"\b(\d+) (?:claims )?(?:are )?(reproduced|contradicted|undecided)\b", text(name))
        assert all(int(count) == len(named[kind]) for count, kind in counts), name
    listed = re.findall(r"^- \*\*(E\d+)\*\*", replication.filled("{{list.errata}}", record), re.M)
    assert listed == ERRATA and len(ERRATA) >= 20


def test_version_licence_and_name_agree():
    citation, licence = text("CITATION.cff"), text("LICENSE")
    assert f"version: {PROJECT['version']}\n" in citation and f"license: {PROJECT['license']}\n" in citation
    assert licence.startswith("BSD 3-Clause License") and PROJECT["license"] == "BSD-3-Clause"
    assert f"title: \"{PROJECT['name']}" in citation and "doi: 10.1029/2001WR000306" in citation


def test_the_codecheck_lists_what_make_figures_makes():
    content = text("codecheck.author.yml")
    listed = re.findall(r"^  - file: (\S+)$", content, re.M)
    made = [f"paper_figures/out/{name}.pdf" for name in paper_figures.FIGURES] + ["paper_figures/out/manifest.json"]
    assert listed == made
    title = replication.NOTE.read_text(encoding="utf-8").partition("\n")[0].removeprefix("# ")
    assert f'title: "{title}"' in content


@pytest.mark.parametrize("page", ["README.md", "CONTRIBUTING.md"])
def test_the_commands_are_targets_of_the_makefile(page):
    commands = set(re.findall(r"(?:`|^    )make ([a-z-]+)", text(page), re.M))
    assert len(commands) >= 5 and all(is_target(["make", command]) for command in commands)


@pytest.mark.thorough
def test_wheel_and_source_distribution_hold_what_they_should(tmp_path):
    """The wheel the solver alone with its scenes; the source distribution the checkout."""
    copied = tmp_path / "checkout"
    subprocess.run(["git", "checkout-index", "--all", f"--prefix={copied}/"], cwd=ROOT, check=True)
    listed = [str(path.relative_to(copied)) for path in copied.rglob("*")]
    subprocess.run([sys.executable, "-m", "build", "--no-isolation", "--outdir", tmp_path / "dist", copied],
                   capture_output=True, check=True)
    (wheel,), (source,) = ((tmp_path / "dist").glob(kind) for kind in ("*.whl", "*.tar.gz"))
    inside = zipfile.ZipFile(wheel).namelist()
    data = {f"repro/scene/packaged/{path.name}" for path in (ROOT / "repro" / "scene" / "packaged").glob("*.toml")}
    data.add("repro/results/network.csv")
    assert {name.partition("/")[0] for name in inside} == {"repro", f"dupin2001_repro-{PROJECT['version']}.dist-info"}
    assert data <= set(inside) and len(data) >= 5
    with tarfile.open(source) as archive:
        packed = {name.partition("/")[2] for name in archive.getnames()}
    wanted = {name for name in listed if name.endswith((".py", ".md", ".toml", ".json", ".lock", ".yml", ".cff"))}
    assert wanted - packed == set()


# What the README and the tutorial show.
PAGE, TUTORIAL = ROOT / "README.md", ROOT / "docs" / "tutorial.md"
BLOCKS = blocks(PAGE)


def test_every_block_is_of_a_kind_that_is_executed():
    """Of the README; the other pages show none. Two commands, a picture and a pore of one's own come first."""
    assert {block.language for block in BLOCKS} <= {"", "console", "sh", "python", "toml"}
    assert all(is_repro(words) or is_target(words) for block in BLOCKS for words in block.commands)
    others = [page for page in (ROOT / "docs").glob("*.md") if page != TUTORIAL]
    assert len(others) >= 3 and [page.name for page in others if "```" in page.read_text(encoding="utf-8")] == []
    shown = PAGE.read_text(encoding="utf-8")
    assert len(shown.encode()) < 12_000 and shown.index("overview.png") < shown.index("make env") < 2_500


def test_the_page_works(tmp_path, capsys, monkeypatch):
    """Its commands in their order in one folder, its scene, which is base, and its Python."""
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


def test_the_tutorial_works_from_its_first_line_to_its_last(tmp_path, capsys, monkeypatch):
    """Its commands, its scene and its Python, one after the other in one folder."""
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
            assert [err.strip()] == told(block) if status else told(block) == [], err
    plt.close("all")
    assert statuses == [0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0]
    assert load_scene("mine.toml").pore == load_scene("base").pore
    assert (tmp_path / "runs" / "narrow" / "timeseries.csv").exists()
    assert (tmp_path / "oxygen.png").stat().st_size > 1000
    assert "WARNING" not in printed[3] and "WARNING growth.end" in printed[4]


# Texts speak of what there is: files, modules, statements, errata, no other places.
FOLDERS = ("repro", "reference", "verification", "docs", "paper_figures", "tests")
PAGES = ("README.md", "CONTRIBUTING.md", "Makefile", "codecheck.author.yml", "CITATION.cff", "MANIFEST.in")
#: What commands make, and words that stand for any name of their kind.
MADE = {"claims.md", "codecheck.yml", "paper_figures/out/manifest.json"}
PLACEHOLDER = re.compile(r"(?<![A-Za-z])(NAME|STAGE|N|ID)(?![A-Za-z])")
ENDINGS = r"(?:py|md|toml|json|yml|yaml|cff|lock|css|js|svg)"
#: A file by its place in the repository, or any page of text by its name.
FILE = re.compile(rf"(?<![\w./-])((?:{'|'.join(FOLDERS)})/[\w./-]+\.{ENDINGS}|(?:\w[\w./-]*/)?[\w-]+\.md)\b")
MODULE = re.compile(rf"(?<![\w./])(?:repro|verification|paper_figures|tests)(?:\.(?!{ENDINGS}\b)[A-Za-z]\w*)+")
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


def is_file(name):
    """Is a file there, by its place or by the end of it?"""
    name = name.removeprefix("../")
    return name in held() or any(path.endswith(f"/{name}") for path in held())


@cache
def is_module(name):
    """Is a module there, or what is asked of it?"""
    try:
        resolve_name(name)
    except (ImportError, AttributeError):
        return False
    return True


def unheld(text):
    """What a text speaks of that is not there."""
    files = {name for name in FILE.findall(text) if name not in MADE and not PLACEHOLDER.search(name)}
    found = {name for name in files if not is_file(name)}
    found |= {name for name in MODULE.findall(text) if not is_module(name)}
    found |= set(STATEMENT.findall(text)) - set(EXPECTED) | set(ERRATUM.findall(text)) - set(ERRATA)
    return sorted(found | set(ELSEWHERE.findall(text)))


def test_nothing_is_spoken_of_that_is_not_there():
    """In what people read, but for tests, whose examples are made up."""
    read = [path for path in held() if path.endswith((".py", ".md", ".toml")) and path.startswith(FOLDERS[:-1])]
    assert len(read) > 200
    assert {path: found for path in (*read, *PAGES) if (found := unheld(text(path)))} == {}


@pytest.mark.parametrize("said", ["(trap 3)", "see `docs/nowhere.md`", "`repro/curved/flow.py` is",
                                  "repro.fem.mesh.NoMesh", "by claim C97", "as said in [E99]", "in /home/notes"])
def test_the_check_sees_one(said):
    assert len(unheld(said)) == 1
