"""Every sentence of the paper that states something about the model, its solution or its scheme is covered.

`verification/claims/sentences.csv` lists the sentences in the order of the paper, each by a few of its words, with the
claims, errata, cases and figures that cover it, or with the reason why nothing does. The paper is not part of the
repository. If the variable PAPER names a file with its text, the words are searched in it.
"""
import csv
import json
import os
import re
from pathlib import Path

import pytest

import paper_figures
from tests.test_published import ERRATA, ROOT
from verification.claims import EXPECTED

TABLE = ROOT / "verification" / "claims" / "sentences.csv"
CASES = json.loads((ROOT / "verification" / "report" / "evidence.json").read_text(encoding="utf-8"))
SECTIONS = ["Abstract", "1", "2", "2.1", "2.2", "2.3.1", "2.3.2", "2.3.3", "3", "3.1", "3.2", "3.3.1", "3.3.2", "3.4",
            "3.5", "4", "5"]
#: Words of a quotation at most.
FEW = 9


def sentences():
    """Return the rows of the table."""
    with TABLE.open(encoding="utf-8", newline="") as lines:
        return list(csv.DictReader(lines))


def plain(text):
    """Return the words of a text in one line, without other signs and hyphens at the end of a line."""
    lines = re.sub(r"\s+", " ", text).replace("- ", "-")
    return re.sub(r"[^a-z0-9%.()-]+", " ", lines.lower()).strip()


def out_of_order(rows, text):
    """Return the quotations that do not occur in a text after the one before."""
    end, missing = 0, []
    for row in rows:
        place = plain(text).find(plain(row["words"]), end)
        if place < 0:
            missing.append(row["words"])
        else:
            end = place + 1
    return missing


def test_every_sentence_is_covered_or_has_a_reason():
    """Each row names existing claims, errata, cases or figures, or says why there are none, not both."""
    known = {*EXPECTED, *ERRATA, *CASES, *paper_figures.FIGURES}
    for row in sentences():
        names = row["covered"].split()
        assert set(names) <= known, row
        assert bool(names) != bool(row["why"]) and len(row["why"].split()) != 1, row
        assert 1 <= len(row["words"].split()) <= FEW, row


def test_the_table_follows_the_paper_and_has_every_claim():
    """The sections are in their order, no quotation occurs twice, and each claim has a sentence."""
    rows = sentences()
    sections = [section for section in dict.fromkeys(row["section"] for row in rows) if section != "Table 1"]
    assert sections == SECTIONS and len({row["words"] for row in rows}) == len(rows) >= 200
    assert set(EXPECTED) - {id for row in rows for id in row["covered"].split()} == set()


@pytest.mark.skipif("PAPER" not in os.environ, reason="PAPER names no file with the text of the paper")
def test_the_quoted_words_occur_in_the_paper_in_order():
    assert out_of_order(sentences(), Path(os.environ["PAPER"]).read_text(encoding="utf-8")) == []
