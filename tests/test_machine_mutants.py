"""Mutants made by machine: how their outcomes are judged, and the page."""


from verification.evidence.writing import ROOT
from verification.mutants.machine import record
from verification.mutants.machine.survivors import EQUIVALENT, LEFT


def test_the_page_is_that_of_the_record_and_its_reasons_quote_present_lines():
    assert record.PAGE.read_text(encoding="utf-8") == record.text()
    texts = {path.relative_to(ROOT / "repro").as_posix(): path.read_text(encoding="utf-8")
             for path in (ROOT / "repro").rglob("*.py")}
    for file, old, new in {**EQUIVALENT, **LEFT}:
        assert old != new and all(line in " ".join(texts[file].split()) for line in old.splitlines()), (file, old)
