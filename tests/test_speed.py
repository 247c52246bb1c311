"""What is told of speed follows from what was measured: the benchmark's arithmetic on made-up data, its small versions,
and the pages. No time is ever asserted."""
import json
import re
from math import nan

import numpy as np
import pytest

from verification import speed, throughput
from verification.bench import __main__ as bench
from verification.bench import record, runs, told
from verification.problems import runs as problems


def point(seconds, error, **more):
    return {"label": speed.PAPER_AS_IT_IS, "seconds": seconds, "cpu": 0.9 * seconds, "error": error,
            "errors": [error] * 8, "repeats": 1, **more}


def law(errors, constant=0.1, power=-0.5):
    """Points on seconds = constant * error^power."""
    return [point(constant * error**power, error) for error in errors]


def lines(points):
    """A part of methods {name: points}."""
    return {"title": "t", "error": "largest", "reference": "another code", "lines": [
        {"method": method, "points": of, "failed": []} for method, of in points.items()]}


def test_methods_take_turns_the_first_run_only_warms_up_and_what_fails_is_listed_and_not_run_again():
    """Time apart is taken off."""
    order = []

    def job(label, made):
        return lambda: order.append(label) or made()

    jobs = {("a", "1"): lambda: 1 / 0, ("a", "2"): lambda: {"error": nan}, ("a", "3"): lambda: {"error": 0.5},
            ("b", "4"): lambda: {"error": 0.2, "apart_seconds": 100.0, "apart_cpu": 200.0}}
    a, b = record.measured({key: job(key[1], made) for key, made in jobs.items()}, 2)
    assert order == ["1", "2", "3", "4"] + ["3", "4"] * 2
    assert [failed["label"] for failed in a["failed"]] == ["1", "2"] and a["points"][0]["repeats"] == 2
    assert -100 <= b["points"][0]["seconds"] < 0 and -200 <= b["points"][0]["cpu"] < -100


def base(fast=(0.5, 0.008), accurate=(1.5, 0.0009)):
    """Paper: 0.02 / error s, that is 2 s at 1 % and 20 s at 0.1 %; a worse point is left aside."""
    slow = [*law([0.04, 0.02, 0.005], 0.02, -1.0), point(50.0, 0.009)]
    return {"base": lines({runs.PRESET_PAPER: slow, runs.FAST: [point(*fast)], runs.ACCURATE: [point(*accurate)]})}


def box(times):
    """Another code that takes so many times as long at one error, 50 times at another: the least ratio counts."""
    theirs = [point(times * 0.1 * 0.01**-0.5, 0.01), point(50 * 0.1 * 0.05**-0.5, 0.05)]
    return {"box": lines({"order 2 (fast, accurate)": law([0.1, 0.001]), "fipy": theirs})}


def scenes(seconds, *unneeded):
    """The whole takes 1.0, of which transport 0.6: flow alone may take 0.4 and a tenth."""
    rows = [("whole", 1.0, {"flow": 0.3, "transport": 0.6}, ()), ("flow only", seconds, {"flow": 0.3}, unneeded)]
    return {"scenes": {"rows": [{"scene": name, "method": "preset fast", "cpu": took, "took": took, "stages": stages,
                                 "unneeded": list(more)} for name, took, stages, more in rows]}}


def sized(ratio, nodes):
    """A growth step of one method, over its floor."""
    return {"size": lines({next(iter(runs.METHODS)): [point(1.0, 0.0, ratio=ratio, nodes=nodes)]})}


def taking(slope):
    """Live bytes a step, of which 100 are allowed."""
    return {"memory": {"rows": [{"method": "preset paper", "slope": slope, "bound": 100.0, "steps": 9}]}}


def wide(seconds):
    """The last run of base's part."""
    run = {"seconds": seconds, "cpu": 1.0, "end": 45.0, "steps": 7}
    return {"base": {**base()["base"], "wide": [run]}}


OWN = "the paper's scheme at its own best speed for "
FASTER = f"base: preset fast is faster than {OWN}"
STEP = f"a growth step over its factorise-and-solve time, {next(iter(runs.METHODS))}, "


@pytest.mark.parametrize("parts, claim, holds, measured", [
    (base(fast=(0.39, 0.008)), f"{FASTER}1 %", True, "5.1 times (processor time 5.1): 2.00 s, between points"),
    (base(fast=(0.41, 0.008)), f"{FASTER}1 %", False, "4.9 times"),
    (base(fast=(0.1, 0.011)), f"{FASTER}1 %", False, "20.0 times"),
    (base(fast=(0.9, 0.004)), f"{FASTER}the error that the preset has", True, "5.6 times"),
    (base(accurate=(0.9, 0.0009)), f"{OWN}0.1 %", True, "extrapolated with slope -1.00"),
    (base(accurate=(1.1, 0.0009)), f"{OWN}0.1 %", False, "extrapolated with slope -1.00"),
    (base(fast=(0.5, 0.011)), "the error of preset fast", False, "1.1 %"),
    (box(9.5), "box: faster than fipy", False, "9.5 times"), (box(10.5), "box: faster than fipy", True, "10.5 times"),
    (scenes(0.45), "flow only", True, "5 % at most"), (scenes(0.55), "flow only", False, "15 % at most"),
    (scenes(0.4, "growth"), "flow only", False, "other stages: growth"),
    (sized(1.4, 2600), f"{STEP}from 2500 nodes on", True, "1.40 at 2600"),
    (sized(1.6, 2600), f"{STEP}from 2500 nodes on", False, "1.60 at 2600"),
    (sized(1.9, 600), f"{STEP}at 600 nodes", True, "1.90 at 600"),
    (sized(2.1, 600), f"{STEP}at 600 nodes", False, "2.10 at 600"),
    (taking(99.0), "preset paper: live memory", True, "99 bytes a step over 9 steps; 100 allowed"),
    (taking(101.0), "preset paper: live memory", False, "101 bytes"),
    (wide(11.9), "wide in preset fast", True, "11.90 s"), (wide(12.1), "wide in preset fast", False, "12.10 s"),
    ({}, "the error of preset fast", None, told.NOT_MEASURED)])
def test_each_verdict_follows_from_what_was_measured(parts, claim, holds, measured):
    (found,) = [one for one in told.judged({"parts": parts}) if claim in one["claim"]]
    assert found["holds"] is holds and measured in found["measured"]


def test_errors_are_relative_but_effluents_over_the_supply():
    truth = np.array([[2.0, 80.0, 1000.0, 30.0, -30.0, 30.0, 4.0, 6.0]])
    found = truth + np.array([[0.02, 0, 0, 0, -0.6, 0, 0.5, 0]])
    assert problems.errors(found, truth)[0] == pytest.approx([0.01, 0, 0, 0, 0.02, 0, 0.05, 0])


@pytest.mark.parametrize("name", bench.PARTS)
def test_a_small_version_of_every_part_runs(name, tmp_path, monkeypatch):
    """It measures something, of every method, is drawn and can be recorded; what is on record is not touched."""
    monkeypatch.setattr(record, "SHORT", 0.0)  # no run warms up
    before = record.FILE.read_bytes()
    found = bench.main(["--quick", name])
    part = found["parts"][name]
    measured = part.get("lines", ())
    assert all(line["points"] or line["failed"] for line in measured) and (measured or part["rows"])
    points = [p for line in measured for p in line["points"]]
    assert all(p["seconds"] > 0 and p["cpu"] > 0 and 0 <= p.get("error", 0) < 0.5 for p in points)
    assert sum(len(line["failed"]) for line in measured) <= 2
    json.dumps(found, allow_nan=False)
    assert all(path.stat().st_size > 1000 for path in told.draw(found["parts"], tmp_path))
    assert before == record.FILE.read_bytes()


@pytest.mark.parametrize("file", [speed.README, speed.PERFORMANCE], ids=lambda file: file.name)
def test_the_pages_tell_what_was_measured(file):
    text = file.read_text(encoding="utf-8")
    section = speed.pages_of(speed.records())[file]
    assert speed.within(text, section) == text and "| accurate |" in section
    pictures = re.findall(r"!\[[^]]*\]\(([^)]+)\)", section)
    assert pictures and all((file.parent / name).exists() for name in pictures)


def test_a_made_up_record_is_told_with_ratios_and_what_does_not_hold():
    found = {"bench": {"machine": {"cores": 2, "processor": "a processor", "python": "3.11"}, "parts": base(),
                       "verdicts": [{"claim": "fast", "wanted": "5 times", "measured": "2", "holds": False}]},
             "audit": {}, "hard_cases": {}}
    text = speed.markdown(speed.blocks(found))
    for row in ("| paper | 0.50 | 1.0 times | 4 % |", "| accurate | 1.50 | 0.3 times | 0.09 % |",
                "| fast | 5 times | 2 | does not hold |"):
        assert row in text


# What `python -m verification.throughput` judges; that it holds is for an idle machine to tell.
@pytest.mark.parametrize("ratios, slow, status", [
    ((0.99, 0.2, 0.96), 1.0, 0), ((0.94, 0.99, 0.85), 1.0, 1), ((0.99, 0.2, 0.96), 1.35, 1)])
def test_the_median_of_sweeps_is_judged_and_a_command_that_costs_too_much(monkeypatch, capsys, ratios, slow, status):
    """By its time over that of the imports and of a warm run."""
    rates = iter(ratios)
    taken = {"--help": 0.1, "run": 0.6 * slow, "import numpy": 0.08}
    monkeypatch.setattr(throughput, "measure", lambda: next(rates))
    monkeypatch.setattr(throughput, "warm", lambda preset, folder: 0.3)
    monkeypatch.setattr(throughput, "fresh", lambda kind, asked, *rest: (
        taken[rest[0]] if kind == "-m" else taken.get(asked, 0.3)))
    assert throughput.main(["--repeats", "3"]) == status
    assert ("does not hold" in capsys.readouterr().out) == bool(status)
