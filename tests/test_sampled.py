"""Mutants made by machine: which are drawn, which tests they meet, and what is told of them."""
import json
import subprocess
import sys
import time
from contextlib import nullcontext
from dataclasses import replace

import pytest

from verification.sampled import drawing, hunting, trying
from verification.sampled.drawing import Mutant
from verification.sampled.hunting import Row
from verification.sampled.trying import Measured, Ran, Reach

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
told = {"sound": run(["test_waits", "test_box", "test_small"]), "caught": run(small, "< LIMIT", "> LIMIT"),
        "survivor": run(small, "least < given", "least <= given"), "endless": run(waits, "< LIMIT", "<= LIMIT", 2.0)}
hunting.put(module, code)
told["reach"] = {id: calls for id, (_, calls) in trying._measure(there, "test_m.py").items()}
print(json.dumps(told))
'''


def drawn(texts, count=12, **how):
    pytest.importorskip("cosmic_ray", reason="make mutants-sampled installs it")
    return drawing.sample(texts, count, **how)


def test_a_module_gives_as_many_as_its_size_and_one_at_least():
    found = drawing.shared({"a": 100, "b": 50, "c": 1}, {"a": 99, "b": 99, "c": 9}, 31)
    assert found == {"a": 20, "b": 10, "c": 1}
    assert drawing.shared({"a": 100, "b": 1}, {"a": 3, "b": 9}, 8) == {"a": 3, "b": 5}


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


def test_a_line_is_in_functions_or_defines_names():
    numbers = {line: number for number, line in enumerate(CODE.splitlines(), 1)}
    loop = numbers["        return [2 * k for k in range(self.size)]"]
    assert set(trying.functions(CODE, loop)) == {"Box.twice", "Box.twice.<locals>.<listcomp>"}
    assert set(trying.functions(CODE, numbers["LIMIT = 3"])) == set()
    assert set(trying.functions(CODE, numbers["SQUARES = {k * k for k in range(LIMIT)}"])) == set()
    assert set(trying.functions(CODE, numbers["    size = LIMIT + 1"])) == set()
    assert trying.defined(CODE, numbers["LIMIT = 3"]) == {"LIMIT"}
    assert trying.defined(CODE, numbers["    size = LIMIT + 1"]) == {"Box"}


def test_tests_are_those_that_call_the_function_the_cheapest_first(monkeypatch):
    monkeypatch.setitem(trying._MENTIONED, "m.py", {"small": {"LIMIT"}, "Box.twice": {"size"}})
    quick, slow = (Measured(name, cost, frozenset({("m.py", "small")})) for name, cost in (("q", 0.1), ("s", 9.0)))
    box = Measured("b", 1.0, frozenset({("m.py", "Box.twice")}))
    known = Reach((quick, box, slow))
    assert known.of("m.py", CODE, 11) == [quick, slow] == known.of("m.py", CODE, 4)
    assert known.of("m.py", CODE, 15) == [box] == known.of("m.py", CODE, 18)
    assert known.of("m.py", CODE, 11, True) == [quick, slow] and known.of("m.py", CODE, 4, True) == [quick, box, slow]
    assert known.of("m.py", CODE, 2) == [quick, box, slow]
    assert hunting.alike("tests/test_sweep_design.py::test_x", "sweep/design.py") == 2
    assert hunting.within([quick, box, slow], 5.0) == [quick, box] and hunting.within([slow], 5.0) == [slow]


def test_mutants_are_caught_survive_or_do_not_end_and_calls_are_seen(tmp_path):
    """In processes of their own, and in those which tests start."""
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
                     "endless": ["", "tests/test_m.py::test_waits"]}
    names = {id.rpartition("::")[2]: {name for _, name in made} for id, made in calls.items()}
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
    known = Reach((TIMED,))
    mutant = Mutant("timing.py", 33, 0, "o", 0, "x = 1", "x = 2")
    row = replace(ROW, name=mutant.name, **changes)
    assert hunting.due([mutant], {mutant.name: row}, known, False) == ([] if stands else [mutant])
    assert hunting.due([mutant], {}, known, False) == [mutant]


@pytest.mark.parametrize("verdict, last, catches, runs", [
    ("caught", "slow", "slow", [["slow"]]),
    ("caught", "slow", "quick", [["slow"], ["quick", "slow"]]),
    ("caught", "gone", "quick", [["quick", "slow"]]),
    ("timeout", "slow", "quick", [["quick", "slow"]]),
])
def test_the_test_that_caught_a_mutant_before_is_the_first(tmp_path, monkeypatch, verdict, last, catches, runs):
    """Alone; the others follow if it lets the mutant pass, or is no more."""
    called = frozenset({("timing.py", "timed")})
    known = Reach((Measured("quick", 0.1, called), Measured("slow", 70.0, called)))
    mutant = Mutant("timing.py", 33, 0, "o", 0, "x = 1", "x = 2")
    (tmp_path / "repro").mkdir()

    def run(there, tests, limit):
        with (there / "runs").open("a") as file:
            file.write(json.dumps(tests) + "\n")
        return Ran(catches if catches in tests else "", seconds=1.0)

    for name, value in {"kept": lambda: {mutant.name: replace(ROW, verdict=verdict, test=last)}, "run": run,
                        "mutated": lambda text, mutant: text, "LIVE": tmp_path, "KEPT": tmp_path / "kept",
                        "copied": lambda: nullcontext(tmp_path), "LIMIT": 100.0}.items():
        monkeypatch.setattr(hunting, name, value)
    monkeypatch.setattr(hunting.trying, "prepare", lambda: None)
    hunting.hunt([mutant], known, 1, False, time.time() + 60)
    row = json.loads((tmp_path / "kept").read_text())
    assert (row["verdict"], row["test"], row["tried"]) == ("caught", catches, 2)
    assert [json.loads(line) for line in (tmp_path / "runs").read_text().splitlines()] == runs
    assert (tmp_path / "repro" / "timing.py").read_text() == drawing.sources()["timing.py"]


def test_survivors_that_tests_were_left_for_are_due_for_the_second_round():
    known = Reach((TIMED,))
    mutant = Mutant("timing.py", 33, 0, "o", 0)
    rows = {mutant.name: replace(ROW, name=mutant.name, verdict="survivor", tried=1, reached=2)}
    assert hunting.due([mutant], rows, known, True) == [mutant] and hunting.due([mutant], rows, known, False) == []


def rows(**counts):
    return [replace(ROW, name=f"{verdict}{k}", verdict=verdict, old=verdict) for verdict, count in counts.items()
            for k in range(count)]


@pytest.mark.parametrize("counts, holds", [
    ({"caught": 95, "survivor": 5}, True),
    ({"caught": 94, "survivor": 6}, False),
    ({"caught": 94, "survivor": 5, "timeout": 1}, False),
    ({}, False),
])
def test_the_share_is_that_of_the_caught(counts, holds):
    assert hunting.holds(hunting.judged(rows(**counts))) is holds


@pytest.mark.parametrize("equal, holds", [(10, True), (11, False)])
def test_equivalent_mutants_are_not_counted_but_few(monkeypatch, equal, holds):
    given = rows(caught=100 - equal, survivor=equal)
    assert not hunting.holds(hunting.judged(given))
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
