"""Mutants made by machine: which are drawn, which tests they meet, and what is told of them."""
import json
import subprocess
import sys
from dataclasses import replace

import pytest

from verification.sampled import drawing, hunting, trying
from verification.sampled.drawing import Mutant
from verification.sampled.hunting import Row
from verification.sampled.trying import Measured, Reach

CODE = '''"""A module."""
from os import path

LIMIT = 3
SQUARES = {k * k for k in range(LIMIT)}


def small(value: int | float, *, least=0) -> bool | None:
    """Is it 1 or 2?"""
    given = {"a": 1, **{"b": value}}
    return least < given["b"] < LIMIT and given["a"] == 1


class Box:
    size = LIMIT + 1

    def twice(self):
        return [2 * k for k in range(self.size)]
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
from verification.sampled import hunting, trying
there = pathlib.Path(sys.argv[1]).resolve()
module = there / "repro" / "m.py"
code = module.read_text()
import repro  # of the checkout, where there is no m
def run(tests, old="", new="", limit=30.0):
    hunting.put(module, code.replace(old, new))
    found = trying.run(there, ["tests/test_m.py::" + name for name in tests], limit)
    return [found.failed, found.stopped]
small, waits = ["test_small"], ["test_waits"]
gone = ["test_gone[3]"]
told = {"sound": run(["test_waits", "test_box", "test_small"]), "caught": run(small, "< LIMIT", "> LIMIT"),
        "survivor": run(small, "least < given", "least <= given"), "endless": run(waits, "< LIMIT", "<= LIMIT", 2.0),
        "gone": run(gone), "left": run(gone + small, "< LIMIT", "> LIMIT")}
hunting.put(module, code)
told["reach"] = {id: calls for id, (_, calls) in trying._measure(there, "test_m.py").items()}
print(json.dumps(told))
'''


def drawn(texts, count=12, **how):
    pytest.importorskip("cosmic_ray", reason="make mutants-sampled installs it")
    return drawing.sample(texts, count, **how)


def test_a_sample_follows_from_its_seed_and_from_the_lines_around_alone():
    texts = {"a.py": CODE, "b.py": CODE.replace("LIMIT", "MOST")}
    first = drawn(texts)
    assert first == drawn(texts) and len(first) == 12 and {mutant.file for mutant in first} == set(texts)
    assert first != drawn(texts, seed=drawing.SEED + 1)
    longer = drawn({**texts, "a.py": CODE.replace("from os import path", "from os import path\n\nimport sys")})
    assert [mutant.name for mutant in longer] == [mutant.name for mutant in first]


def test_what_is_drawn_is_python_and_no_annotation():
    """All that there is is drawn."""
    found = drawn({"a.py": CODE}, 1000)
    changed = {mutant: drawing.mutated(CODE, mutant) for mutant in found}
    for mutant, text in changed.items():
        compile(text, mutant.file, "exec")
        assert text != CODE and "int | float" in text and "bool | None" in text and '"""Is it 1 or 2?"""' in text
    places = {(mutant.line, mutant.column) for mutant in found}
    assert len(places) == len(found) == len(set(changed.values()))
    assert {mutant.line for mutant in found} == {4, 5, 8, 10, 11, 15, 18}


def test_tests_are_those_that_call_the_function_the_cheapest_first(monkeypatch):
    """A name's are those that call a function that names it; of what has no name, all."""
    monkeypatch.setitem(trying._MENTIONED, "m.py", {"small": {"LIMIT"}, "Box.twice": {"size"}})
    quick, slow = (Measured(name, cost, frozenset({("m.py", "small")})) for name, cost in (("q", 0.1), ("s", 9.0)))
    box = Measured("b", 1.0, frozenset({("m.py", "Box.twice")}))
    known = Reach((quick, box, slow))
    for line, tests in ((11, [quick, slow]), (4, [quick, slow]), (15, [box]), (18, [box]), (2, [quick, box, slow])):
        assert known.of("m.py", CODE, line) == tests
    assert known.of("m.py", CODE, 4, True) == [quick, box, slow]
    assert hunting.within([quick, box, slow], 5.0) == [quick, box] and hunting.within([slow], 5.0) == [slow]


def test_mutants_are_caught_survive_or_do_not_end_and_calls_are_seen(tmp_path):
    """In processes of their own, and in those which tests start. A test that is gone, as one may be that is named after
    a value which a mutant changes, catches nothing, and the others do."""
    project = tmp_path / "project"
    for name, text in {"repro/__init__.py": "", "repro/m.py": CODE, "tests/__init__.py": "", "tests/test_m.py": TESTS,
                       "pytest.ini": "[pytest]\n"}.items():
        (project / name).parent.mkdir(parents=True, exist_ok=True)
        (project / name).write_text(text)
    done = subprocess.run([sys.executable, "-c", TRIED, str(project)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    calls = found.pop("reach")
    assert found == {"sound": ["", ""], "caught": ["tests/test_m.py::test_small", ""], "survivor": ["", ""],
                     "endless": ["", "tests/test_m.py::test_waits"],
                     "gone": ["", ""], "left": ["tests/test_m.py::test_small", ""]}
    names = {}
    for id, made in calls.items():
        names[id.rpartition("::")[2]] = {name for _, name in made}
    assert names.keys() == {"test_small", "test_box", "test_waits"}
    assert "small" in names["test_small"] and "Box.twice" not in names["test_small"]
    assert {"Box.twice", "Box.twice.<locals>.<listcomp>"} <= names["test_box"] and "small" not in names["test_box"]


TIMED = Measured("q", 1.0, frozenset({("timing.py", "timed")}))
ROW = Row("n", "timing.py", 1, "o", "x = 1", "x = 2", drawing.digest(drawing.sources()["timing.py"]), "caught",
          "tests/test_sampled.py::test", tests=hunting._names([TIMED]))


@pytest.mark.parametrize("changes, stands", [
    ({}, True),
    ({"module": "another"}, False),
    ({"test": "tests/test_gone.py::test"}, False),
    ({"verdict": "survivor"}, True),
    ({"verdict": "survivor", "tests": "others"}, False),
    ({"verdict": "timeout", "tests": "others"}, False),
])
def test_a_row_stands_as_long_as_what_it_rests_on(changes, stands):
    """A survivor that tests were left for is due for the second round."""
    mutant = Mutant("timing.py", 33, 0, "o", 0, "x = 1", "x = 2")
    row = replace(ROW, name=mutant.name, **changes)
    for known, whole, due in (({mutant.name: row}, False, not stands), ({}, False, True),
                              ({mutant.name: replace(row, verdict="survivor", tried=1, reached=2)}, True, True)):
        assert hunting.due([mutant], known, Reach((TIMED,)), whole) == [mutant] * due


def rows(**counts):
    return [replace(ROW, name=f"{verdict}{k}", verdict=verdict, old=verdict) for verdict, count in counts.items()
            for k in range(count)]


@pytest.mark.parametrize("counts, equal, holds", [
    ({"caught": 95, "survivor": 5}, 0, True), ({"caught": 94, "survivor": 6}, 0, False),
    ({"caught": 94, "survivor": 5, "timeout": 1}, 0, False), ({}, 0, False),
    ({"caught": 90, "survivor": 10}, 10, True), ({"caught": 89, "survivor": 11}, 11, False),
])
def test_the_share_is_that_of_the_caught_without_few_equivalent_ones(monkeypatch, counts, equal, holds):
    given = rows(**counts)
    if equal:
        monkeypatch.setitem(hunting.EQUIVALENT, hunting.key(given[-1]), "it is the same")
    found = hunting.judged(given)
    assert len(found["equivalent"]) == equal and hunting.holds(found) is holds


def test_the_page_tells_every_mutant_and_the_numbers(monkeypatch):
    given = rows(caught=19, survivor=1)
    monkeypatch.setitem(hunting.LEFT, hunting.key(given[-1]), ("nothing moves", "it is seldom"))
    text = hunting.text(given, 20)
    assert "20 of 20 mutants tried" in text and "95.0 %" in text and text.count("timing.py:1 |") == 1
    assert "| timing.py | 20 | 19 |" in text
    assert "| nothing moves | it is seldom |" in text


def test_reasons_are_given_for_lines_that_are_there():
    texts = drawing.sources()
    for file, old, new in {**hunting.EQUIVALENT, **hunting.LEFT}:
        assert old != new and all(line in " ".join(texts[file].split()) for line in old.splitlines()), (file, old)
