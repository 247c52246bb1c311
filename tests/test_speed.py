"""What is told of speed, hard cases and assumptions follows from what was measured, in all places that tell it: the
benchmark's arithmetic on made-up data, its small versions, and the pages. No time is ever asserted."""
import json
import re
from math import inf, nan

import numpy as np
import pytest

from verification import speed, throughput
from verification.bench import __main__ as bench
from verification.bench import record, runs, told
from verification.bench.record import reading
from verification.kernel import writing


def point(seconds, error, **more):
    return {"label": f"{error}", "seconds": seconds, "cpu": 0.9 * seconds, "error": error, "repeats": 1, **more}


def law(errors, constant=0.1, power=-0.5):
    """Points on seconds = constant * error^power."""
    return [point(constant * error**power, error) for error in errors]


def test_nothing_is_read_from_too_little_and_an_error_above_all_takes_the_fastest_point():
    assert reading([], 0.1) is None and reading(law([0.1]), 0.01) is None
    assert reading(law([0.1, 0.01]), 0.5).how == "measured"


def test_methods_take_turns_the_first_run_only_warms_up_and_what_fails_is_listed_and_not_run_again():
    """Time apart is taken off."""
    order = []

    def job(label, made):
        return lambda: order.append(label) or made()

    jobs = {("a", "1"): lambda: 1 / 0, ("a", "2"): lambda: {"error": nan}, ("a", "3"): lambda: {"error": 0.5},
            ("b", "4"): lambda: {"error": 0.2, "apart_seconds": 100.0, "apart_cpu": 200.0}}
    a, b = record.measured({key: job(key[1], made) for key, made in jobs.items()}, 2)
    assert order == ["1", "2", "3", "4"] + ["3", "4"] * 2
    assert [failed["label"] for failed in a["failed"]] == ["1", "2"] and "ZeroDivisionError" in a["failed"][0]["reason"]
    assert [(p["label"], p["error"], p["repeats"]) for p in a["points"] + b["points"]] == [("3", 0.5, 2), ("4", 0.2, 2)]
    assert -100 <= b["points"][0]["seconds"] < 0 and -200 <= b["points"][0]["cpu"] < -100


def base(fast=(0.5, 0.008), accurate=(1.5, 0.0009), wide=9.0):
    """Paper: 0.02 / error s, that is 2 s at 1 % and 20 s at 0.1 %; a worse point is left aside."""
    slow = [*law([0.04, 0.02, 0.005], 0.02, -1.0), point(50.0, 0.009)]
    lines = [{"method": runs.PRESET_PAPER, "points": slow, "failed": []},
             {"method": runs.FAST, "points": [point(*fast)], "failed": []},
             {"method": runs.ACCURATE, "points": [point(*accurate)], "failed": []}]
    run = {"preset": "fast", "seconds": wide, "cpu": wide, "steps": 100, "end": 45.0, "nodes": 700}
    return {"base": {"title": "t", "error": "e", "lines": lines, "wide": [run]}}


def box(times):
    """Another code that takes so many times as long at one error, 50 times at another: the least ratio counts."""
    theirs = [point(times * 0.1 * 0.01**-0.5, 0.01), point(50 * 0.1 * 0.05**-0.5, 0.05)]
    return {"box": {"lines": [{"method": "order 2 (fast, accurate)", "points": law([0.1, 0.001]), "failed": []},
                              {"method": "fipy", "points": theirs, "failed": []}]}}


def size(ratio, small):
    """Steps over their floor."""
    points = [{"nodes": 600, "ratio": small}, {"nodes": 2500, "ratio": ratio}, {"nodes": 9000, "ratio": 1.1}]
    return {"size": {"lines": [{"method": "preset paper", "points": points, "failed": []}]}}


def scenes(seconds, unneeded=()):
    """The whole takes 1.0, of which transport 0.6: flow alone may take 0.4 and a tenth."""
    rows = [("whole", 1.0, {"flow": 0.3, "transport": 0.6}, ()), ("flow only", seconds, {"flow": 0.3}, unneeded)]
    return {"scenes": {"rows": [{"scene": name, "method": "preset fast", "seconds": took, "cpu": took, "took": took,
                                 "stages": stages, "unneeded": list(more)} for name, took, stages, more in rows]}}


def memory(slope):
    return {"memory": {"rows": [{"method": "preset paper", "steps": 50, "slope": slope, "bound": 400.0}]}}


OWN = "the paper's scheme at its own best speed for "
FASTER = f"base: preset fast is faster than {OWN}"


@pytest.mark.parametrize("parts, claim, holds, measured", [
    (base(fast=(0.39, 0.008)), f"{FASTER}1 %", True, "5.1 times (processor time 5.1): 2.00 s, between points"),
    (base(fast=(0.41, 0.008)), f"{FASTER}1 %", False, "4.9 times"),
    (base(fast=(0.1, 0.011)), f"{FASTER}1 %", False, "20.0 times"),
    (base(fast=(0.9, 0.004)), f"{FASTER}the error that the preset has", True, "5.6 times"),
    (base(accurate=(0.9, 0.0009)), f"{OWN}0.1 %", True, "extrapolated with slope -1.00"),
    (base(accurate=(1.1, 0.0009)), f"{OWN}0.1 %", False, "extrapolated with slope -1.00"),
    (base(accurate=(0.9, 0.0011)), f"{OWN}0.1 %", False, "extrapolated with slope -1.00"),
    (base(fast=(0.5, 0.011)), "the error of preset fast", False, "1.1 %"),
    (base(), "the error of preset fast", True, "0.8 %"),
    (base(wide=13.0), "wide", False, "13.00 s"), (base(wide=11.0), "wide", True, "11.00 s"),
    (box(9.5), "box: faster than fipy", False, "9.5 times"), (box(10.5), "box: faster than fipy", True, "10.5 times"),
    (size(1.4, 2.1), "preset paper, from 2500 nodes on", True, "1.40 at 2500, 1.10 at 9000"),
    (size(1.6, 1.9), "preset paper, from 2500 nodes on", False, "1.60 at 2500"),
    (size(1.6, 1.9), "preset paper, at 600 nodes", True, "1.90 at 600"),
    (size(1.4, 2.1), "preset paper, at 600 nodes", False, "2.10 at 600"),
    (scenes(0.45), "flow only", True, "5 % at most"), (scenes(0.55), "flow only", False, "15 % at most"),
    (scenes(0.4, ["growth"]), "flow only", False, "other stages: growth"),
    (memory(300.0), "preset paper: live", True, "300 bytes"), (memory(500.0), "preset paper: live", False, "500 bytes"),
    ({}, "preset paper: live", None, told.NOT_MEASURED), ({}, "the error of preset fast", None, told.NOT_MEASURED),
])
def test_each_verdict_follows_from_what_was_measured(parts, claim, holds, measured):
    (found,) = [one for one in told.judged({"parts": parts}) if claim in one["claim"]]
    assert found["holds"] is holds and measured in found["measured"]


def test_memory_that_grows_is_seen():
    assert runs.slope([100 + 7 * k for k in range(50)]) == pytest.approx(7)
    assert runs.slope([100 + (4000 if k == 30 else 0) for k in range(50)]) == 0


def test_the_record_is_read_back_and_keeps_what_was_not_measured_again(tmp_path):
    file = tmp_path / "deep" / "bench.json"
    first = record.merged(record.empty(), base(), {"base": 3})
    writing.save(first, file)
    assert record.load(file) == first and record.load(tmp_path / "none.json") == record.empty()
    again = record.merged(first, {"flow": {"title": "t"}}, {"flow": 5})
    assert set(again["parts"]) == {"base", "flow"} and again["machine"]["repeats"] == {"base": 3, "flow": 5}
    for value in (nan, inf):
        with pytest.raises(ValueError):
            writing.save({"parts": {"a": value}}, file)
    assert record.load(file) == first


def test_errors_are_relative_but_effluents_over_the_supply():
    truth = np.array([[2.0, 80.0, 1000.0, 30.0, -30.0, 30.0, 4.0, 6.0]])
    found = np.array([[2.02, 80.0, 1000.0, 30.0, -30.6, 30.0, 4.5, 6.0]])
    assert runs.apart(found, truth)[0] == pytest.approx([0.01, 0, 0, 0, 0.02, 0, 0.05, 0])


@pytest.mark.parametrize("name", bench.PARTS)
def test_a_small_version_of_every_part_runs(name, tmp_path, capsys, monkeypatch):
    """It measures something, of every method, is told, drawn and can be recorded; what is on record is not touched."""
    monkeypatch.setattr(record, "SHORT", 0.0)  # no run warms up
    before = record.FILE.read_bytes()
    found = bench.main(["--quick", name])
    part = found["parts"][name]
    assert set(found["parts"]) == {name} and part["title"] in capsys.readouterr().out
    lines = part.get("lines", ())
    assert all(line["points"] or line["failed"] for line in lines) and (lines or part["rows"])
    points = [p for line in lines for p in line["points"]]
    assert all(p["seconds"] > 0 and p["cpu"] > 0 and 0 <= p.get("error", 0) < 0.5 for p in points)
    failed = [failed for line in lines for failed in line["failed"]]
    assert len(failed) <= 2, failed
    json.dumps(found, allow_nan=False)
    assert all(path.stat().st_size > 1000 for path in told.draw(found["parts"], tmp_path))
    assert told.verdicts(found["verdicts"]) and before == record.FILE.read_bytes()


# The pages.
POINT = {"label": "as it is", "seconds": 0.5, "cpu": 0.5, "error": 0.005, "errors": [0.005] * 8}
PAPER = {**POINT, "label": speed.PAPER_AS_IT_IS, "seconds": 5.0}
BENCH = {"machine": {"cores": 2, "processor": "a <processor>", "python": "3.11"},
         "parts": {"base": {"title": "base", "error": "largest", "reference": "another code", "lines": [
             {"method": speed.runs.PRESET_PAPER, "points": [PAPER], "failed": []},
             {"method": speed.runs.FAST, "points": [POINT], "failed": []},
             {"method": speed.runs.ACCURATE, "points": [{**POINT, "seconds": 2.0}], "failed": []}]}},
         "verdicts": [{"claim": "fast", "wanted": "5 times", "measured": "2 times", "holds": False}]}
HARD = {"cases": [{"number": 4, "title": "Fast", "right_is": "the balance", "cells": {
    name: {"verdict": verdict, "message": "too | fast" if verdict != "right" else "", "checks": []}
    for name, verdict in (("paper", "right"), ("fast", "wrong"), ("accurate", "refused"))}}]}
AUDIT = {"method": "one changed at a time", "rows": [{
    "choice": "inlet", "default": "u_x", "alternative": "u_ave", "cost_ratio": 1.0, "note": "[E4]",
    "effect": {"velocity": -1e-4, "area": 2e-5, "acceptor leaving": 3e-4}, "one_state": {}}]}


@pytest.mark.parametrize("file", [speed.README, speed.PERFORMANCE], ids=lambda file: file.name)
def test_the_pages_tell_what_was_measured(file):
    text = file.read_text(encoding="utf-8")
    section = speed.pages_of(speed.records())[file]
    assert speed.within(text, section) == text and "| accurate |" in section
    pictures = re.findall(r"!\[[^]]*\]\(([^)]+)\)", section)
    assert pictures and all((file.parent / name).exists() for name in pictures)


def test_the_record_has_every_hard_case():
    rows = [case["number"] for case in speed.records()["hard_cases"]["cases"]]
    assert rows == list(range(1, 23))


def test_made_up_records_are_told_with_ratios_errors_signs_and_what_does_not_hold():
    """Text is escaped; without records nothing is told."""
    blocks = list(speed.blocks({"bench": BENCH, "hard_cases": HARD, "audit": AUDIT}))
    text, page = speed.markdown(blocks), speed.page(blocks)
    for row in ("| fast | 0.50 | 10.0 times | 0.5 % |", "| accurate | 2.00 | 2.5 times |",
                "| fast | 5 times | 2 times | does not hold |",
                "| -0.01 % | +0.002 % | +0.03 % | +0.03 % (acceptor leaving) |"):
        assert row in text
    assert page.count("class='no'") == 2 and "a &lt;processor&gt;" in page and "too | fast" in page
    assert "| x \\| y |" in speed.markdown([speed.Block("table", rows=(("a",), ("x | y",)))])
    assert list(speed.blocks({"bench": {}, "hard_cases": {}, "audit": {}})) == []


def test_the_section_replaces_the_one_before():
    """Text around the marks stays."""
    text = f"before\n{speed.BEGIN}\nold\n{speed.END}\nafter\n"
    once = speed.within(text, "new")
    assert "old" not in once and once.startswith("before\n") and once.endswith(f"{speed.END}\nafter\n")
    assert speed.within(once, "new") == once


# What `python -m verification.throughput` judges; that it holds is for an idle machine to tell.
@pytest.mark.parametrize("ratios, status", [((0.99, 0.2, 0.96), 0), ((0.94, 0.99, 0.85), 1)])
def test_the_median_is_judged(monkeypatch, capsys, ratios, status):
    found = {throughput.JUDGED: iter(ratios), throughput.TOLD: iter([0.9 if status else 0.1] * 3)}
    monkeypatch.setattr(throughput, "measure", lambda preset, count: next(found[preset]))
    monkeypatch.setattr(throughput, "commands", lambda: {})
    assert throughput.main(["--repeats", "3"]) == status
    assert ("does not hold" in capsys.readouterr().out) == bool(status)


@pytest.mark.parametrize("slow, status", [(1.0, 0), (1.35, 1)])
def test_a_command_that_costs_too_much_is_told(monkeypatch, capsys, slow, status):
    """By its time over that of the imports and of a warm run."""
    monkeypatch.setattr(throughput, "measure", lambda preset, count: 0.99)
    monkeypatch.setattr(throughput, "warm", lambda preset, folder: 0.3)
    taken = {"--help": 0.1, "run": 0.6 * slow, "import numpy": 0.08}

    def fresh(kind, asked, *rest):
        return taken[rest[0]] if kind == "-m" else taken.get(asked, 0.3)

    monkeypatch.setattr(throughput, "fresh", fresh)
    assert throughput.main(["--repeats", "1"]) == status
    out = capsys.readouterr().out
    assert f"repro run base in fast: {slow:.2f} times" in out and ("does not hold" in out) == bool(status)
    assert "repro --help: 1.25 times" in out


def test_a_sweep_that_fails_has_no_rate(monkeypatch, tmp_path):
    monkeypatch.setattr(throughput, "repro", lambda arguments: 3)
    with pytest.raises(RuntimeError, match="status 3"):
        throughput.swept("fast", 4, tmp_path)
