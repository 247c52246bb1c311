"""Mutants made by machine: how their outcomes are judged, and the page."""

import pytest

from verification.evidence.writing import ROOT
from verification.mutants.machine import record
from verification.mutants.machine.survivors import EQUIVALENT, LEFT


@pytest.mark.parametrize("caught, survivor, timeout, equal, is_enough", [
    (95, 5, 0, 0, True), (94, 6, 0, 0, False), (94, 5, 1, 0, False), (0, 0, 0, 0, False), (90, 10, 0, 10, True),
    (89, 11, 0, 11, False)])
def test_the_caught_share_leaves_out_few_equivalent_mutants(monkeypatch, caught, survivor, timeout, equal,
                                                                      is_enough):
    counts = {"caught": caught, "timeout": timeout, "survivor": survivor}
    rows = [{"file": "m.py", "old": verdict, "new": "", "verdict": verdict}
            for verdict, count in counts.items() for _ in range(count)]
    if equal:
        monkeypatch.setitem(EQUIVALENT, record.key(rows[-1]), "it is the same")
    verdicts = record.judged(rows)
    assert len(verdicts["equivalent"]) == equal and record.holds(verdicts) is is_enough


def test_the_page_is_that_of_the_record_and_its_reasons_quote_present_lines():
    assert record.PAGE.read_text(encoding="utf-8") == record.text()
    texts = {path.relative_to(ROOT / "repro").as_posix(): path.read_text(encoding="utf-8")
             for path in (ROOT / "repro").rglob("*.py")}
    for file, old, new in {**EQUIVALENT, **LEFT}:
        assert old != new and all(line in " ".join(texts[file].split()) for line in old.splitlines()), (file, old)
