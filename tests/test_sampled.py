"""Mutants made by machine: which tests they meet, when a row stands, and what is told of them."""
import json
import subprocess
import sys
from dataclasses import replace

import pytest

from verification.sampled import drawing, hunting
from verification.sampled.drawing import Mutant
from verification.sampled.hunting import Row
from verification.sampled.reach import Measured, Reach

CODE = '''
LIMIT = 3

def small(value, least=0):
    return least < value < LIMIT

class Box:
    def twice(self):
        return [2 * k for k in range(LIMIT)]
'''
TESTS = '''import subprocess, sys
from repro import m

def test_small():
    assert m.small(2)

def test_box():
    subprocess.run([sys.executable, "-c", "from repro import m; m.Box().twice()"], check=True, cwd="/")

def test_waits():
    while m.small(3):
        pass
'''
#: A project of its own, tried as it is and with two mutants: what is caught, what is not, what does not end.
TRIED = '''
import json, pathlib, sys
from verification.kernel import trying
from verification.sampled import hunting, reach
there = pathlib.Path(sys.argv[1]).resolve()
module = there / "repro" / "m.py"
code = module.read_text()
import repro  # of the checkout, where there is no m
def run(tests, old="", new="", limit=30.0):
    hunting.put(module, code.replace(old, new))
    found = trying.run(there, ["tests/test_m.py::" + name for name in tests], limit)
    ended = found.status in trying.ENDED
    return [[test for test, _ in found.failures], found.last["starts"] if ended else ""]
small, waits = ["test_small"], ["test_waits"]
told = {"others": run(["test_waits", "test_box"], "< LIMIT", "> LIMIT"), "caught": run(small, "< LIMIT", "> LIMIT"),
        "survivor": run(small, "least < value", "least <= value"), "endless": run(waits, "< LIMIT", "<= LIMIT", 2.0),
        "left": run(["test_gone[3]"] + small, "< LIMIT", "> LIMIT")}
hunting.put(module, code)
told["reach"] = {id: calls for id, (_, calls) in reach.measure(there, "test_m.py").items()}
print(json.dumps(told))
'''


def test_mutants_are_caught_survive_or_do_not_end_and_calls_are_seen(tmp_path):
    """In processes of their own, and in those which tests start, by the tests asked for. One that is gone, as one may
    be that is named after a value which a mutant changes, catches nothing, and the others do."""
    project = tmp_path / "project"
    for name, text in {"repro/__init__.py": "", "repro/m.py": CODE, "tests/__init__.py": "", "tests/test_m.py": TESTS,
                       "pytest.ini": "[pytest]\n"}.items():
        (project / name).parent.mkdir(parents=True, exist_ok=True)
        (project / name).write_text(text)
    done = subprocess.run([sys.executable, "-c", TRIED, str(project)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    calls = found.pop("reach")
    assert found == {"others": [[], ""], "caught": [["tests/test_m.py::test_small"], ""], "survivor": [[], ""],
                     "endless": [[], "tests/test_m.py::test_waits"],
                     "left": [["tests/test_m.py::test_small"], ""]}
    names = {}
    for id, made in calls.items():
        names[id.rpartition("::")[2]] = {call.partition("\t")[2] for call in made}
    assert names.keys() == {"test_small", "test_box", "test_waits"}
    assert "small" in names["test_small"] and "Box.twice" not in names["test_small"]
    assert {"Box.twice", "Box.twice.<locals>.<listcomp>"} <= names["test_box"] and "small" not in names["test_box"]


TIMED = Measured("q", 1.0, frozenset({"timing.py\ttimed"}))
ROW = Row("n", "timing.py", 1, "o", "x = 1", "x = 2", drawing.digest(drawing.sources()["timing.py"]), "caught",
          TIMED.id)


@pytest.mark.parametrize("changes, stands", [
    ({}, True), ({"module": "another"}, False), ({"test": "tests/test_sampled.py::test_gone"}, False),
    ({"verdict": "survivor", "tests": "others"}, False)])
def test_a_row_stands_as_long_as_what_it_rests_on(changes, stands):
    mutant = Mutant("timing.py", 33, 0, "o", 0, "x = 1", "x = 2")
    known = {mutant.name: replace(ROW, name=mutant.name, **changes)}
    assert hunting.due([mutant], known, Reach((TIMED,)), False) == [mutant] * (not stands)


@pytest.mark.parametrize("caught, survivor, timeout, equal, is_enough", [
    (95, 5, 0, 0, True), (94, 6, 0, 0, False), (94, 5, 1, 0, False), (0, 0, 0, 0, False), (90, 10, 0, 10, True),
    (89, 11, 0, 11, False)])
def test_the_share_is_that_of_the_caught_without_few_equivalent_ones(monkeypatch, caught, survivor, timeout, equal,
                                                                      is_enough):
    counts = {"caught": caught, "timeout": timeout, "survivor": survivor}
    rows = [replace(ROW, verdict=verdict, old=verdict) for verdict, count in counts.items() for _ in range(count)]
    if equal:
        monkeypatch.setitem(hunting.EQUIVALENT, hunting.key(rows[-1]), "it is the same")
    found = hunting.judged(rows)
    assert len(found["equivalent"]) == equal and hunting.holds(found) is is_enough


def test_reasons_are_given_for_lines_that_are_there():
    texts = drawing.sources()
    for file, old, new in {**hunting.EQUIVALENT, **hunting.LEFT}:
        assert old != new and all(line in " ".join(texts[file].split()) for line in old.splitlines()), (file, old)
