"""What a publication needs is there, agrees with itself, and the replication note says what was computed."""
import copy
import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

import paper_figures
from paper_figures import overview, replication
from verification.claims import EXPECTED

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def text(name):
    return (ROOT / name).read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def told():
    return replication.told()


def test_the_note_tells_what_was_computed(told):
    template = replication.TEMPLATE.read_text(encoding="utf-8")
    assert replication.filled(template, told) == replication.NOTE.read_text(encoding="utf-8")


def test_a_number_of_the_record_is_a_number_of_the_note(told):
    changed = copy.deepcopy(told)
    check = next(c for claim in changed["claims"] for c in claim["checks"] if c["paper"] == "2.9")
    check["value"] = 2.9 * 1.0987
    assert replication.filled("{{C01 | mean velocity at t = 0 (m/d) | .4f}}", changed) == "3.1862"
    assert replication.filled("{{C01 | mean velocity at t = 0 (m/d) | off}}", changed) == "9.9 %"
    assert "| 3.186 |" in replication.filled("{{table.values}}", changed)


def test_the_template_has_no_number_that_a_run_computes():
    """Decimals outside of references, of the paper's own scenes and of identifiers."""
    body = replication.TEMPLATE.read_text(encoding="utf-8").partition("## References")[0]
    plain = re.sub(r"\{\{.*?\}\}|`[^`]*`|\(https?://\S+\)|\[doi:.*?\]", "", body, flags=re.S)
    assert set(re.findall(r"\d+\.\d+", plain)) == {"2.9", "19.2", "19.4"}


@pytest.mark.parametrize("field", ["{{C99 | contradicted}}", "{{C01 | contradicted}}", "{{C01 | no such | .2f}}",
                                   "{{no.such}}"])
def test_what_there_is_not_is_refused(told, field):
    with pytest.raises(LookupError):
        replication.filled(field, told)


def test_every_claim_has_its_verdict_in_the_note(told):
    """Each once, in the list of its verdict; a contradiction, or what is undecided, with its reason."""
    kinds = ("reproduced", "rounding", "changed", "contradicted", "undecided")
    lists = [f"{{{{list.{kind}}}}}" for kind in kinds]
    named = [re.findall(r"^- \*\*(C\d\d)\*\*", replication.filled(one, told), re.M) for one in lists]
    assert sorted(sum(named, [])) == list(EXPECTED)
    assert all(claim["reason"] for claim in told["claims"] if claim["id"] in named[3] + named[4])
    counts = replication.filled(" ".join(f"{{{{claims.{kind}}}}}" for kind in kinds), told)
    assert counts.split() == [str(len(found)) for found in named]


def test_the_picture_of_the_note_has_verdicts_in_its_caption(told):
    caption = replication.filled("{{overview.claims}}", told)
    verdicts = {each["id"]: each["verdict"] for each in told["claims"]}
    assert caption.replace("\n", " ") == "; ".join(f"{id} {verdicts[id]}" for id in sorted(overview.CLAIMS))
    assert caption.splitlines()[-1] in text("paper_figures/replication.md")


def test_what_needs_no_solution_is_not_counted_as_a_value_reproduced(told):
    printed, predicted = replication._printed(told["claims"]), replication._predicted(told["claims"])
    assert len(predicted) < len(printed)
    assert {check["rests_on"] for _, check in predicted} == {"a solution"}
    total = sum(int(replication.filled(f"{{{{paper.{name}}}}}", told)) for name in ("within", "outside", "open"))
    assert replication.filled("{{paper.total}}", told) == str(len(predicted)) == str(total)


def test_readme_and_documents_count_no_claims_otherwise(told):
    """A count of verdicts anywhere is the record's."""
    for name in ("README.md", "paper_figures/replication.md", "docs/scope.md", "codecheck.author.yml"):
        counts = re.findall(r"\b(\d+) (?:claims )?(?:are )?(reproduced|contradicted|undecided)\b", text(name))
        for count, kind in counts:
            assert count == replication.filled(f"{{{{claims.{kind}}}}}", told), (name, count, kind)


def test_every_erratum_is_in_the_note(told):
    ids = re.findall(r"^## (E\d+)\.", text("reference/ERRATA.md"), re.M)
    listed = re.findall(r"^- \*\*(E\d+)\*\*", replication.filled("{{list.errata}}", told), re.M)
    assert listed == ids and len(ids) >= 20


def test_version_licence_and_name_agree():
    citation, licence = text("CITATION.cff"), text("LICENSE")
    assert f"version: {PROJECT['version']}\n" in citation and f"license: {PROJECT['license']}\n" in citation
    assert licence.startswith("BSD 3-Clause License") and PROJECT["license"] == "BSD-3-Clause"
    assert f"title: \"{PROJECT['name']}" in citation and "doi: 10.1029/2001WR000306" in citation


def test_the_codecheck_lists_what_make_figures_makes():
    content = text("codecheck.author.yml")
    listed = re.findall(r"^  - file: (\S+)$", content, re.M)
    made = [f"paper_figures/out/{name}.pdf" for name in paper_figures.FIGURES] + ["paper_figures/out/manifest.json"]
    assert listed == made and len(re.findall(r"^    comment: \".+\"$", content, re.M)) == len(listed)
    title = replication.NOTE.read_text(encoding="utf-8").partition("\n")[0].removeprefix("# ")
    assert f'title: "{title}"' in content and "\n---\nversion: https://codecheck.org.uk/spec/config/" in content


def test_what_contributing_names_is_there():
    content = text("CONTRIBUTING.md")
    targets = set(re.findall(r"(?:`|^    )make ([a-z-]+)", content, re.M))
    assert {"lint", "test", "verify", "mutants", "check-manifest"} <= targets
    assert all(re.search(rf"^{target}:", text("Makefile"), re.M) for target in targets)
    folders = r"(?:repro|verification|paper_figures|tests)/[\w/.]+"
    files = set(re.findall(rf"`({folders}|[A-Z]+\.md|[a-z.]+\.(?:yml|toml))`", content))
    there = {name for name in files if not re.search("STAGE|NAME|_N|/out/|/live/", name)}
    assert len(there) > 10 and [name for name in there if not (ROOT / name).exists()] == []


def test_the_pythons_that_are_named_are_those_that_are_allowed():
    named = [label.rpartition(" ")[2] for label in PROJECT["classifiers"] if re.search(r":: 3\.\d+$", label)]
    assert named == ["3.11", "3.12", "3.13"] and PROJECT["requires-python"] == ">=3.11"


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
