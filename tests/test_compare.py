"""Comparisons of runs: their charts, the reported differences, and refusals."""

import html
import os
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

import repro
from repro import results
from repro.cli import main
from repro.report import comparison, quantities
from repro.report.reading import Run, read
from repro.results import columns
from repro.results.names import with_unit
from tests.faults import limit_memory
from tests.shell import flip, read_record, refusal, rewrite


@pytest.fixture
def page(fast, paper, tmp_path):
    target = tmp_path / "both.html"
    assert main(["compare", str(fast), str(paper), "--out", str(target)]) == 0
    return target.read_text(encoding="utf-8")


def test_differences_of_scenes_are_listed_key_by_key(fast, paper, flow_only):
    differences = dict((key, values) for key, *values in comparison.differences([read(fast), read(paper)]))
    assert differences == {"growth.end": ["3 h", "1 h"], "numerics.preset": ["fast", "paper"],
                     "numerics.refinement": ["0.2", "1"], "numerics.tolerance": ["0.0075", "0.01"],
                     "numerics.contact_elements": ["3", "0"], "output.every": ["0.5 h", "-"]}
    differences = dict((key, values) for key, *values in comparison.differences([read(paper), read(flow_only)]))
    assert {"growth.end": ["1 h", "-"], "flow.mean_velocity": ["-", "2.9 m/day"]}.items() <= differences.items()
    assert comparison.differences([read(fast), read(fast)]) == []


def test_a_comparison_states_values_at_the_common_last_time(fast, paper, flow_only, page):
    """Values are linear between rows and relative to the first run."""
    runs = [read(fast), read(paper)]
    assert comparison.common_time(runs) == 1.0
    values = comparison.values(runs, 1.0)["aggregate_area_um2"]
    series = results.read_table(fast / "timeseries.csv")
    after = np.flatnonzero(series["time_h"] >= 1)[0]
    (t0, t1), (a0, a1) = series["time_h"][after - 1: after + 1], series["aggregate_area_um2"][after - 1: after + 1]
    assert values[0] == pytest.approx(a0 + (a1 - a0) * (1 - t0) / (t1 - t0), rel=1e-12)
    assert values[1] == results.read_table(paper / "timeseries.csv")["aggregate_area_um2"][-1]
    mine, other = (float(value or 0) for value in values)
    assert f"{100 * (other - mine) / mine:+.3g} %" in page and "At t = 1 h, the last time" in page
    assert comparison.values([read(paper), read(flow_only)], 0.0)["donor_min_mg_per_L"][1] is None


def test_runs_of_the_same_folder_name_are_named_by_their_paths(fast, paper):
    assert comparison.short([fast, paper]) == [str(fast), str(paper)]
    assert comparison.short([fast, fast.parent]) == ["run", fast.parent.name]


def test_runs_that_cannot_be_compared_are_refused(fast, tmp_path, capsys):
    """One line names the folder and the reason, and nothing is written."""
    out, none = tmp_path / "out.html", tmp_path / "none"
    for folders, target, excerpt in (((fast, tmp_path), out, f"{tmp_path}: it holds no run: run.json is missing"),
                                  ((fast, none), out, "run.json is missing"), ((fast,), out, "two runs or more"),
                                  ((fast, fast), tmp_path / "out.csv", "ends in .html"),
                                  ((fast, fast), fast / "other.html", "is the folder of a run"),
                                  ((fast, fast), none / "out.html", "No such file")):
        assert excerpt in refusal(target.parent, capsys, "compare", *folders, "--out", target)


@pytest.mark.parametrize("name", ["run.json", "timeseries.csv", "ledger.csv"])
@pytest.mark.parametrize("spoil, why", [
    (flip, "it is not as it was written|its checksum is wrong|Expecting"), (lambda path: path.unlink(), "is missing"),
    (lambda path: path.write_bytes(b"\xff"), "it is not as it was written|invalid start byte"),
    (lambda path: (path.unlink(), os.mkfifo(path)), "it is not a regular file"),
    (lambda path: os.truncate(path, 3 * 2**30), r"it is longer than \d+ bytes")],
    ids=["bit", "gone", "bytes", "pipe", "long"])
def test_a_damaged_run_is_refused_without_being_read(fast, tmp_path, capsys, name, spoil, why):
    """A changed bit, a missing file, bytes that are no text, a pipe or 3 GB is refused in one line, without reading the
    file into memory."""
    copy = shutil.copytree(fast, tmp_path / "run")
    spoil(copy / name)
    with limit_memory(2**28):
        line = refusal(tmp_path / "out.html", capsys, "compare", fast, copy, "--out", tmp_path / "out.html")
    assert str(copy) in line and name in line and re.search(why, line)
    with pytest.raises(repro.OutputError, match=f"{name} .*({why})|{name} is missing"):
        repro.load_run(copy)


def at_work(run, tmp_path):
    """Copy a run and mark it as running."""
    copy = shutil.copytree(run, tmp_path / "run")
    rewrite(copy, status="running", sha256={})
    return copy


def with_field(value):
    """Return a function that replaces the second field of the third line of a table."""
    return lambda text: re.sub(r"((?:.*\n){2}[^,]*),[^,]*", rf"\1,{value}", text, count=1)


@pytest.mark.parametrize("change, excerpt", [
    (lambda text: "", "it is empty"), (lambda text: text[:-2], "its last line is cut short"),
    (lambda text: text + "1,2\n", ""), (with_field("soon"), "could not convert string to float: 'soon'")])
def test_a_broken_table_is_refused_also_of_a_run_at_work(fast, tmp_path, capsys, change, excerpt):
    """The tables of such a run have no SHA-256 yet."""
    copy = at_work(fast, tmp_path)
    (copy / "timeseries.csv").write_text(change((copy / "timeseries.csv").read_text()))
    line = refusal(tmp_path, capsys, "compare", copy, fast, "--out", tmp_path / "out.html")
    assert f"{copy}: timeseries.csv cannot be read: " in line and excerpt in line


def test_a_run_at_work_may_have_more_rows_than_its_record(fast, tmp_path):
    """The record is written after the table."""
    copy = at_work(fast, tmp_path)
    rewrite(copy, rows=read_record(copy)["rows"] - 1)
    assert len(read(copy).times) == read_record(fast)["rows"]


def test_runs_are_compared_under_their_own_names_with_signs():
    """The first run is not the first by name. A tip further upstream, at a smaller x, is a decrease, in
    um."""
    runs = []
    for name, scale in (("zeta", 1.0), ("alpha", 1.5), ("mu", 0.5)):
        series = {column: scale * (1.0 + k + np.array([0.1, 0.4])) for k, column in enumerate(results.COLUMNS)}
        low = scale * np.array([-5.0, -8.0])
        series |= {"time_h": np.array([0.0, 3.0]), "upstream_um": low, "acceptor_min_mg_per_L": low}
        record = {"scene": name, "status": "completed", "tables": {"factor": 1.0 + (scale < 1)}}
        runs.append(Run(Path("runs") / name, record, series, {}))
    labels = comparison.short([run.folder for run in runs])
    for chart in quantities.overlaid(runs, labels):
        assert [line.label for line in chart.lines] == labels, chart.title
        assert [line.values[-1] / chart.lines[0].values[-1] for line in chart.lines] == pytest.approx([1, 1.5, 0.5])
    assert comparison.differences(runs) == [("factor", "1", "1", "2")]
    page_text = comparison.build(runs)
    assert page_text.count("completed to t = 3 h") == 3
    values = page_text[page_text.index("Values at the common last time"):]
    heads = re.findall('<th scope="col" class="value">([^<]*)', values)
    assert heads == ["zeta", "alpha", "difference", "mu", "difference"]
    for name, expected in (("upstream end of the aggregate", ["-8", "-12", "-4 um", "-4", "+4 um"]),
                           ("least acceptor concentration", ["-8", "-12", "-50 %", "-4", "+50 %"])):
        (row,) = re.findall(f"<tr><td>{name}.*?</tr>", page_text)
        assert re.findall('class="value">([^<]*)<', row) == expected


def compared_as(quantity):
    """How a column is compared whose value rises from 4 to 5; empty if it is not."""
    decides = quantity.formula.startswith("1 if")
    if decides or quantity.name in ("time_h", "nodes") or quantity.words.startswith("relative defect"):
        return ""
    return "+1 um" if re.match("place of|(up|down)stream end", quantity.words) else "+25 %"


def test_every_column_is_compared_as_what_it_is():
    """The words of a column tell whether it is a coordinate, a defect or neither."""
    runs = [Run(Path(name), {"scene": name, "status": "completed", "tables": {}},
                {column: np.array([0.0, value]) for column in results.COLUMNS} | {"time_h": np.array([0.0, 3.0])}, {})
            for name, value in (("one", 4.0), ("other", 5.0))]
    text = html.unescape(comparison.build(runs))
    for quantity in columns.SERIES:
        rows = re.findall(f"<tr><td>{re.escape(with_unit(quantity.name))}</td>(.*?)</tr>", text)
        differences = [re.findall('class="value">([^<]*)<', row)[-1] for row in rows]
        assert differences == [compared_as(quantity)] * bool(compared_as(quantity)), quantity.name


@pytest.mark.parametrize("first, value, is_coordinate, text", [
    (-5.0, -8.0, True, "-3 um"), (-5.0, -8.0, False, "-60 %"), (10.0, 224.0, False, "22.4 times"),
    (-2.0, 20.0, False, "-10 times"), (2.0, 19.98, False, "+899 %"), (-2.0, 1.0, False, "+150 %"),
    (10.0, 11.0, False, "+10 %"), (0.0, 1.0, False, "-"), (10.0, None, True, "-"), (2.0, 2.0, True, "0")])
def test_a_difference_has_no_percentage_of_a_coordinate_and_no_large_one(first, value, is_coordinate, text):
    """A coordinate has no natural zero, so its difference is in um; a value many times the first is a multiple."""
    assert comparison._text_difference(first, value, is_coordinate) == text
