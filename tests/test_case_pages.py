"""The pages of the verification cases on the site."""

import re
import subprocess
import sys

import pytest

from tests.blocks import ROOT
from verification import validation
from verification.evidence import case_pages, pages
from verification.evidence.cases import KINDS, STAGES, cases

RECORDS = pages.recorded()


def test_a_page_has_claim_norm_numbers_mutants_and_the_command(tmp_path):
    """Each picture has its place if its file exists. A case that falls short says so."""
    case = cases()["flow-plug"]
    (tmp_path / "flow-plug.svg").touch()
    text = "\n".join(case_pages.article(case, RECORDS["flow-plug"], tmp_path))
    assert case.claim in text and case.norm in text and "kind | exact" in text and "(1)-(6)" in text
    assert all(all(cell in text for cell in row) for row in RECORDS["flow-plug"]["table"])
    assert re.search(r"tau-of-water \| The stabilisation .+ \| repro/model/flow.py \| flow-plug", text)
    assert "(./flow-plug.svg)" in text and "flow-plug.png" not in text
    assert "pytest verification/cases/flow.py::test_plug\n" in text and "refine(_plug_errors, PLUG_SIZES)" in text
    short = {"verdict": "FALLS SHORT", "numbers": 1, "errors": ["v = 2: ValueError"], "table": [["q", "1", "o", "NO"]]}
    text = "\n".join(case_pages.article(case, short, tmp_path))
    assert all(part in text for part in ("**FALLS SHORT**", "by an error: v = 2: ValueError", "| q | 1 | o | NO |"))


def test_the_index_has_a_line_a_case_with_stage_kind_elements_and_equations(monkeypatch):
    """Lines of the sections of the validation follow; together they have every kind."""
    monkeypatch.setattr(pages, "mutant_state", str)
    lines = [line.split(" | ") for line in case_pages.index(RECORDS)[-1].splitlines()[2:]]
    rows, others = lines[:len(cases())], lines[len(cases()):]
    assert [row[0] for row in rows] == [f"| [{id}]({id}.md)" for id in cases()]
    assert len(others) == len(validation.SECTIONS) and {row[2] for row in others} == {"validation"}
    assert "(../../docs/validation.md#the-lubrication-limit-of-a-narrow-gap)" in others[-1][0]
    assert {row[2] for row in lines} == {*KINDS}
    assert {row[1] for row in rows} == {*STAGES} and {row[2] for row in rows} <= {*KINDS}
    assert all(row[3] and row[4] for row in rows)


def test_every_command_chooses_the_case_among_those_of_its_function():
    """A function that has several cases needs an expression. It excludes ids that contain the id."""
    commands = {id: case_pages.command(case) for id, case in cases().items()}
    assert commands["hard-pores"].endswith('hard_pores.py::test_pore -k "hard-pores and not hard-pores-rest"')
    assert commands["hard-pores-rest"].endswith('hard_pores.py::test_pore -k "hard-pores-rest"')
    assert len({*commands.values()}) == len(commands)


@pytest.mark.thorough
def test_a_case_is_drawn_by_its_first_mesh_or_not_at_all(tmp_path):
    """One case makes a mesh; the other has formulas alone. Both stop without a verdict."""
    ids = "flow-plug", "reprojection-supermesh"
    subprocess.run([sys.executable, "-m", "verification.evidence.first_mesh", tmp_path, *ids], check=True, cwd=ROOT,
                   stdout=subprocess.DEVNULL)
    assert [path.name for path in tmp_path.iterdir()] == ["flow-plug.png"]
