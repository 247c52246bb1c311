"""The benchmark's own arithmetic on made-up data, and that its small versions run; no time is ever asserted."""
import json
from math import inf, nan

import pytest

from verification.bench import __main__ as bench
from verification.bench import record, runs, told
from verification.bench.record import envelope, exponent, reading, slope
from verification.kernel import writing


def point(seconds, error, **more):
    return {"label": f"{error}", "seconds": seconds, "cpu": 0.9 * seconds, "error": error, "repeats": 1, **more}


def law(errors, constant=0.1, power=-0.5):
    """Points on seconds = constant * error^power."""
    return [point(constant * error**power, error) for error in errors]


def test_envelope_keeps_what_nothing_beats():
    points = [point(1, 0.1), point(2, 0.2), point(3, 0.01), point(2.5, 0.05), point(4, 0.01)]
    assert [(p["seconds"], p["error"]) for p in envelope(points)] == [(1, 0.1), (2.5, 0.05), (3, 0.01)]


def test_exponent_of_a_power_law():
    sizes = [600, 2500, 10_000]
    assert exponent(sizes, [3 * s**1.4 for s in sizes]) == pytest.approx(1.4)
    assert exponent(sizes, [0.0, 3.0, 0.0]) != exponent(sizes, [0.0, 3.0, 0.0])  # not-a-number
    assert slope(law([0.1, 0.01, 0.001])) == pytest.approx(-0.5)


@pytest.mark.parametrize("error, how", [(0.03, "between points"), (0.001, "extrapolated"), (0.0004, "extrapolated"),
                                        (0.01, "between points")])
def test_a_power_law_is_read_exactly(error, how):
    """Between points and beyond them, worse points left aside."""
    found = reading([*law([0.1, 0.02, 0.005]), point(50.0, 0.09)], error)
    assert found.how == how
    assert found.seconds == pytest.approx(0.1 * error**-0.5)
    assert found.cpu == pytest.approx(0.09 * error**-0.5)
    assert found.slope == pytest.approx(-0.5)


def test_an_error_above_all_takes_the_fastest_point():
    assert reading(law([0.1, 0.01]), 0.5).how == "measured"
    assert reading(law([0.1, 0.01]), 0.5).seconds == pytest.approx(0.1 * 0.1**-0.5)


def test_nothing_is_read_from_too_little():
    assert reading([], 0.1) is None
    assert reading(law([0.1]), 0.01) is None


def jobs_told(jobs, repeats):
    """Lines, and the order in which the jobs ran."""
    order = []

    def noted(key, job):
        def run():
            order.append(key[1])
            return job()
        return run
    return record.measured({key: noted(key, job) for key, job in jobs.items()}, repeats), order


def test_methods_take_turns_and_the_first_run_only_warms_up():
    lines, order = jobs_told({("a", "1"): lambda: {"error": 0.1}, ("b", "2"): lambda: lambda: {"error": 0.2}}, 3)
    assert order == ["1", "2"] * 4
    assert [(line["method"], line["points"][0]["error"], line["points"][0]["repeats"]) for line in lines] == [
        ("a", 0.1, 3), ("b", 0.2, 3)]


@pytest.mark.parametrize("long, runs", [(0.0, 2), (1e9, 6)])
def test_long_jobs_run_a_third_as_often_and_their_first_run_counts(monkeypatch, long, runs):
    monkeypatch.setattr(record, "SHORT", 0.0)
    monkeypatch.setattr(record, "LONG", long)
    lines, order = jobs_told({("a", "1"): lambda: {"error": 0.1}}, 6)
    assert len(order) == lines[0]["points"][0]["repeats"] == runs


def test_what_fails_is_listed_and_not_run_again():
    lines, order = jobs_told({("a", "1"): lambda: 1 / 0, ("a", "2"): lambda: {"error": nan},
                              ("a", "3"): lambda: {"error": 0.5}}, 2)
    assert order == ["1", "2", "3", "3", "3"]
    assert [failed["label"] for failed in lines[0]["failed"]] == ["1", "2"]
    assert "ZeroDivisionError" in lines[0]["failed"][0]["reason"]
    assert [p["label"] for p in lines[0]["points"]] == ["3"]


def test_time_apart_is_taken_off():
    lines = record.measured({("a", "1"): lambda: {"error": 0.1, "apart_seconds": 100.0, "apart_cpu": 200.0}}, 1)
    found = lines[0]["points"][0]
    assert -100 <= found["seconds"] < 0 and -200 <= found["cpu"] < -100


def base_part(fast=(0.5, 0.008), accurate=(1.5, 0.0009), wide=9.0):
    """Paper: 0.02 / error s, that is 2 s at 1 % and 20 s at 0.1 %."""
    lines = [{"method": runs.PRESET_PAPER, "points": law([0.04, 0.02, 0.005], 0.02, -1.0), "failed": []},
             {"method": runs.FAST, "points": [point(*fast)], "failed": []},
             {"method": runs.ACCURATE, "points": [point(*accurate)], "failed": []}]
    run = {"preset": "fast", "seconds": wide, "cpu": wide, "steps": 100, "end": 45.0, "nodes": 700}
    return {"title": "t", "error": "e", "lines": lines, "wide": [run]}


def verdict_of(parts, words):
    found = [one for one in told.judged({"parts": parts}) if words in one["claim"]]
    assert len(found) == 1
    return found[0]


@pytest.mark.parametrize("fast, holds", [((0.39, 0.008), True), ((0.41, 0.008), False), ((0.1, 0.011), False)])
def test_faster_at_one_percent(fast, holds):
    """2 s over the preset's: five times, and only if it delivers the error."""
    parts = {"base": base_part(fast=fast)}
    found = verdict_of(parts, "fast is faster than the paper's scheme at its own best speed for 1 %")
    assert found["holds"] is holds and f"{2 / fast[0]:.1f} times" in found["measured"]


@pytest.mark.parametrize("accurate, holds", [((0.9, 0.0009), True), ((1.1, 0.0009), False), ((0.9, 0.0011), False)])
def test_faster_at_a_tenth_of_a_percent_says_that_it_extrapolates(accurate, holds):
    found = verdict_of({"base": base_part(accurate=accurate)}, "own best speed for 0.1 %")
    assert found["holds"] is holds and "extrapolated with slope -1.00" in found["measured"]


def test_faster_at_the_error_that_a_preset_has():
    """0.02 / 0.004 s over 0.9 s."""
    found = [one for one in told.judged({"parts": {"base": base_part(fast=(0.9, 0.004))}})
             if "fast is faster" in one["claim"] and one["claim"].endswith("the error that the preset has")]
    assert [one["holds"] for one in found] == [True] and "5.6 times" in found[0]["measured"]


def test_presets_and_wide():
    assert verdict_of({"base": base_part(fast=(0.5, 0.011))}, "the error of preset fast")["holds"] is False
    assert verdict_of({"base": base_part()}, "the error of preset fast")["holds"] is True
    assert verdict_of({"base": base_part(wide=13.0)}, "wide")["holds"] is False
    assert verdict_of({"base": base_part()}, "wide")["holds"] is True
    failed = {**base_part(), "wide": [{"preset": "fast", "failed": "GrowthError: no"}]}
    assert verdict_of({"base": failed}, "wide")["holds"] is False


@pytest.mark.parametrize("times, holds", [(9.5, False), (10.5, True)])
def test_other_codes_at_equal_error(times, holds):
    """The least ratio over their points counts."""
    ours = {"method": "order 2 (fast, accurate)", "points": law([0.1, 0.001]), "failed": []}
    theirs = [point(times * 0.1 * 0.01**-0.5, 0.01), point(50 * 0.1 * 0.05**-0.5, 0.05)]
    part = {"lines": [ours, {"method": "fipy", "points": theirs, "failed": []}]}
    found = verdict_of({"box": part}, "box: faster than fipy")
    assert found["holds"] is holds and f"{times} times" in found["measured"]


@pytest.mark.parametrize("ratio, small, holds", [(1.4, 1.9, (True, True)), (1.6, 1.9, (False, True)),
                                                 (1.4, 2.1, (True, False))])
def test_steps_against_their_floor(ratio, small, holds):
    points = [{"nodes": 600, "ratio": small}, {"nodes": 2500, "ratio": ratio}, {"nodes": 9000, "ratio": 1.1}]
    part = {"lines": [{"method": "preset paper", "points": points, "failed": []}]}
    found = [one["holds"] for one in told.judged({"parts": {"size": part}}) if "preset paper, " in one["claim"]]
    assert found == list(holds)


def scene_row(name, seconds, stages, unneeded=()):
    return {"scene": name, "method": "preset fast", "seconds": seconds, "cpu": seconds, "stages": stages,
            "took": seconds, "unneeded": list(unneeded)}


@pytest.mark.parametrize("seconds, unneeded, holds", [(0.45, (), True), (0.55, (), False), (0.4, ("growth",), False)])
def test_scenes_cost_their_own_stages(seconds, unneeded, holds):
    """The whole takes 1.0, of which transport 0.6: flow alone may take 0.4 and a tenth."""
    rows = [scene_row("whole", 1.0, {"flow": 0.3, "transport": 0.6}),
            scene_row("flow only", seconds, {"flow": 0.3}, unneeded)]
    assert verdict_of({"scenes": {"rows": rows}}, "flow only")["holds"] is holds


def test_memory_that_grows_is_seen():
    assert runs.slope([100 + 7 * k for k in range(50)]) == pytest.approx(7)
    assert runs.slope([100 + (4000 if k == 30 else 0) for k in range(50)]) == 0
    row = {"method": "preset paper", "steps": 50, "slope": 500.0, "bound": 400.0}
    assert verdict_of({"memory": {"rows": [row]}}, "preset paper: live")["holds"] is False
    assert verdict_of({"memory": {"rows": [{**row, "slope": 300.0}]}}, "preset paper: live")["holds"] is True


def test_what_was_not_measured_is_said():
    found = told.judged(record.empty())
    assert found and all(one["holds"] is None and one["measured"] == told.NOT_MEASURED for one in found)


def test_the_record_is_read_back(tmp_path):
    part = base_part()
    merged = record.merged(record.empty(), {"base": part}, {"base": 3}, {"fipy": 0.5})
    merged["verdicts"] = told.judged(merged)
    file = tmp_path / "deep" / "bench.json"
    writing.save(merged, file)
    assert record.load(file) == merged
    assert record.load(tmp_path / "none.json") == record.empty()
    assert {"platform", "processor", "python", "versions", "repeats", "import_seconds"} <= set(merged["machine"])
    again = record.merged(merged, {"flow": {"title": "t"}}, {"flow": 5})
    assert set(again["parts"]) == {"base", "flow"} and again["machine"]["repeats"] == {"base": 3, "flow": 5}
    assert again["machine"]["import_seconds"] == {"fipy": 0.5}


@pytest.mark.parametrize("value", [nan, inf])
def test_not_a_number_is_never_recorded(tmp_path, value):
    with pytest.raises(ValueError):
        writing.save({"parts": {"a": value}}, tmp_path / "bench.json")


def test_the_processor_has_its_own_name(tmp_path):
    file = tmp_path / "cpuinfo"
    file.write_text("processor : 0\nmodel name\t: Some CPU @ 3 GHz\nmodel name\t: Some CPU @ 3 GHz\n")
    assert record.processor(file) == "Some CPU @ 3 GHz"


def test_errors_are_relative_but_effluents_over_the_supply():
    truth = [[2.0, 80.0, 1000.0, 30.0, -30.0, 30.0, 4.0, 6.0]]
    found = [[2.02, 80.0, 1000.0, 30.0, -30.6, 30.0, 4.5, 6.0]]
    assert runs.apart(*map(runs.np.array, (found, truth)))[0] == pytest.approx([0.01, 0, 0, 0, 0.02, 0, 0.05, 0])


def test_exponents_by_stage():
    points = [{"nodes": n, "seconds": n**1.5, "memory_MB": n, "stages": {"flow": n**1.2, runs.FLOOR: n**1.4}}
              for n in (600, 2500)]
    found = runs.exponents(points)
    assert (found["step"], found["memory"], found["flow"], found[runs.FLOOR]) == pytest.approx((1.5, 1.0, 1.2, 1.4))
    assert found["growth"] is None


@pytest.mark.parametrize("name", bench.PARTS)
def test_a_small_version_of_every_part_runs(name, tmp_path, capsys, monkeypatch):
    """It measures something, of every method, is told, drawn and can be recorded; what is on record is not touched."""
    monkeypatch.setattr(record, "SHORT", 0.0)  # no run warms up
    before = record.FILE.read_bytes() if record.FILE.exists() else None
    found = bench.main(["--quick", name])
    part = found["parts"][name]
    assert set(found["parts"]) == {name} and part["title"] in capsys.readouterr().out
    for line in part.get("lines", ()):
        assert line["points"] or line["failed"]
        assert all(p["seconds"] > 0 and p["cpu"] > 0 and 0 <= p.get("error", 0) < 0.5 for p in line["points"])
    assert "lines" in part or part["rows"]
    failed = [failed for line in part.get("lines", ()) for failed in line["failed"]]
    assert len(failed) <= 2, failed
    json.dumps(found, allow_nan=False)
    assert all(path.stat().st_size > 1000 for path in told.draw(found["parts"], tmp_path))
    assert told.verdicts(found["verdicts"])
    assert before == (record.FILE.read_bytes() if record.FILE.exists() else None)


def test_an_unknown_part_is_refused():
    with pytest.raises(SystemExit):
        bench.main(["--quick", "speed"])
