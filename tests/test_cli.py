"""The command line: what it writes, and what it refuses."""

import csv
import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest

from repro import results
from repro.cli import main
from repro.model import growth


def run(tmp_path, scene, *sets, status=0, options=()):
    out = tmp_path / "run"
    arguments = ["run", scene, "--out", str(out), *options]
    for entry in sets:
        arguments += ["--set", entry]
    assert main(arguments) == status
    return out


def rows(out):
    with (out / "timeseries.csv").open() as file:
        return list(csv.DictReader(file))


def test_flow_only_is_one_row_without_substrates(tmp_path):
    out = run(tmp_path, "flow_only")
    (row,) = rows(out)
    assert list(row) == results.COLUMNS
    assert float(row["time_h"]) == 0 and math.isclose(float(row["mean_velocity_m_per_d"]), 2.9, rel_tol=1e-12)
    assert all(row[name] == "" for name in results.COLUMNS if "acceptor" in name or "donor" in name)
    assert row["biomass_balance"] == row["inert_fraction"] == ""


def test_conductivity_velocity_and_head_are_consistent(tmp_path):
    """K = u L / head loss (2.1)."""
    (row,) = rows(run(tmp_path, "flow_only"))
    speed, loss = float(row["mean_velocity_m_per_d"]), float(row["head_loss_cm"]) / 100
    assert math.isclose(float(row["conductivity_m_per_d"]), speed * 600e-6 / loss, rel_tol=1e-12)


def test_rows_and_fields_at_output_times(tmp_path):
    out = run(tmp_path, "base", 'growth.end="0.5 h"', 'output.times=["0.3 h", "0.5 h"]')
    assert [float(row["time_h"]) for row in rows(out)] == [0, 0.3, 0.5]
    sets = ElementTree.parse(out / "fields.pvd").getroot().iter("DataSet")
    entries = {float(s.get("timestep")): s.get("file") for s in sets}
    assert list(entries) == [0, 0.3, 0.5]
    found = meshio.read(out / entries[0.5])
    assert math.isclose(float(rows(out)[-1]["acceptor_min_mg_per_L"]), found.point_data["acceptor_mg_per_L"].min())
    assert found.points[:, 1].max() == 50
    inside = found.cell_data["region"][0] == 1
    assert np.isnan(found.cell_data["theta"][0][~inside]).all() and found.cell_data["theta"][0][inside].min() > 1.1
    for name in ("velocity_m_per_d", "head_cm", "donor_mg_per_L", "active_biomass", "inert_biomass"):
        assert np.isfinite(found.point_data[name]).all()
    body = np.isin(np.arange(len(found.points)), found.cells[0].data[inside])
    for name in ("displacement_um", "position_t0_um", "pressure_MPa"):
        assert (np.isfinite(found.point_data[name]).reshape(len(body), -1).T == body).all()
    for name in ("J", "stress_xx_MPa", "stress_yy_MPa", "stress_xy_MPa", "largest_principal_stress_MPa"):
        assert (np.isfinite(found.cell_data[name][0]) == inside).all()


def test_ledger_closes_and_adds_up(tmp_path):
    """Each step's biomass follows the last one's, and in = out + consumed."""
    out = run(tmp_path, "base", 'growth.end="1 h"', 'output.times=["1 h"]')
    with (out / "ledger.csv").open() as file:
        ledger = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    assert len(ledger) == 5
    for row in ledger:
        for name in ("acceptor", "donor"):
            parts = [row[f"{name}_{part}_pg_per_m"] for part in ("supplied", "out", "consumed", "stored")]
            assert abs(parts[0] - sum(parts[1:])) < 1e-8 * parts[0]
        before, made, after = (row[f"biomass_{part}_pg_per_m"] for part in ("before", "made", "after"))
        assert math.isclose(before + made, after, rel_tol=1e-10)
    for first, second in zip(ledger, ledger[1:]):
        assert first["biomass_after_pg_per_m"] == second["biomass_before_pg_per_m"]
        assert first["end_h"] == second["start_h"]


def test_provenance(tmp_path):
    told = json.loads((run(tmp_path, "flow_only", "flow.viscosity_ratio=500") / "run.json").read_text())
    assert told["status"] == "completed" and told["tables"]["flow"]["viscosity_ratio"] == 500
    assert told["origin"].get("set") == ["flow.viscosity_ratio=500"]
    assert told["versions"]["scikit-fem"] and told["wall_time_by_stage_s"]["flow"] > 0 and told["remeshes"] == 0


@pytest.mark.parametrize("entry", ['pore.width="50 s"', "aggregate.radius=80 um", "pore.widht=5 um", "growth.end=soon",
                                   'flow.mean_velocity="1 m/day"', "numerics.preset=best"])
def test_wrong_input_is_refused_before_anything_is_written(tmp_path, capsys, entry):
    out = run(tmp_path, "base", entry, status=2)
    message = capsys.readouterr().err
    assert entry.split("=")[0].split(".")[1] in message and message.count("\n") == 1 and not out.exists()


def test_a_folder_with_other_files_is_left_alone(tmp_path, capsys):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "thesis.tex").write_text("years of work")
    run(tmp_path, "flow_only", status=2)
    assert "thesis.tex" in capsys.readouterr().err
    assert [path.name for path in (tmp_path / "run").iterdir()] == ["thesis.tex"]


def test_only_a_runs_own_fields_are_replaced(tmp_path, capsys):
    out = run(tmp_path, "flow_only")
    (out / "fields" / "mine.vtu").write_text("precious")
    run(tmp_path, "flow_only", status=2)
    assert "mine.vtu" in capsys.readouterr().err and (out / "fields" / "mine.vtu").read_text() == "precious"


def test_tables_of_somebody_elses_are_left_alone(tmp_path):
    """A timeseries.csv without a run.json is not a run's."""
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "timeseries.csv").write_text("mine")
    run(tmp_path, "flow_only", status=2)
    assert (tmp_path / "run" / "timeseries.csv").read_text() == "mine"


def test_the_pores_end_ends_a_run_well(tmp_path, capsys):
    """In one long step the aggregate outgrows a short pore: that is an end, not a failure, and nothing is lost."""
    out = run(tmp_path, "wide", 'aggregate.radius="40 um"', 'pore.length="90 um"', 'growth.time_step="2 h"',
              'growth.end="4 h"', 'output.times=["4 h"]')
    assert "reaches the pore's" in capsys.readouterr().out
    assert "reaches the pore's" in json.loads((out / "run.json").read_text())["status"] and len(rows(out)) == 1


def test_interrupting_a_run_keeps_what_was_computed(tmp_path):
    """Ctrl-C in the midst of a run, after meshing: status 130, rows and run.json written."""
    out = tmp_path / "run"
    code = ("import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "
            "from repro.cli import main; sys.exit(main(sys.argv[1:]))")
    process = subprocess.Popen([sys.executable, "-c", code, "run", "base", "--out", str(out)], stderr=subprocess.PIPE)
    deadline = time.monotonic() + 60
    while not (out / "fields" / "fields_0002.vtu").exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    message = process.communicate(timeout=60)[1].decode()
    assert process.returncode == 130 and "interrupted" in message and "Traceback" not in message
    assert len(rows(out)) >= 3 and json.loads((out / "run.json").read_text())["status"] == "interrupted"


def test_a_forced_run_replaces_the_first(tmp_path):
    run(tmp_path, "base", 'growth.end="0.4 h"')
    out = run(tmp_path, "flow_only", options=["--force"])
    assert len(list((out / "fields").iterdir())) == 1 and not (out / "ledger.csv").exists()


def test_a_failure_says_when_and_where_and_keeps_what_was_done(tmp_path, capsys, monkeypatch):
    """One iteration is not enough for Newton's method."""
    monkeypatch.setattr(growth, "MOST_ITERATIONS", 1)
    out = run(tmp_path, "base", 'growth.end="1 h"', status=1)
    message = capsys.readouterr().err
    assert "t = 0 h, in growth" in message and "try" in message and message.count("\n") == 1
    assert len(rows(out)) == 1 and json.loads((out / "run.json").read_text())["status"].startswith("failed")


def test_unset_beside_set(capsys):
    """In the commands that look at a scene."""
    changes = ["--unset", "flow.head", "--unset", "growth", "--set", "flow.mean_velocity=1 m/day"]
    assert main(["scene", "base", *changes]) == 0
    text = capsys.readouterr().out
    assert '\n#head = "1e-3 cm"\n' in text and '\nmean_velocity = "1 m/day"\n' in text and "\n#[growth]\n" in text
    assert main(["check", "base", *changes, "--set", "substrates.boundary=shut"]) == 2
    assert "substrates.boundary" in capsys.readouterr().err
    assert main(["check", "initial_mesh", "--unset", "aggregate"]) == 0
    assert "no aggregate: a clean channel" in capsys.readouterr().out
    assert main(["check", "initial_mesh", "--unset", "flow"]) == 2
    assert capsys.readouterr().err == 'repro: initial_mesh: --unset "flow": the scene does not set it\n'


#: What writes text of its own to standard output: long, in lines, for machines.
WRITERS = [["scene", "base"], ["scene"], ["check", "base"], ["check", "base", "--json"]]


def process_of(arguments, out):
    """`repro ARGUMENTS` in a process of its own, with a file as its standard output."""
    code = "import sys; from repro.cli import main; sys.exit(main(sys.argv[1:]))"
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.run(command, stdout=out, stderr=subprocess.PIPE, text=True, timeout=60)


@pytest.mark.parametrize("arguments", WRITERS)
def test_nobody_reads_what_is_written(arguments):
    """As under `| head -1`."""
    end, pipe = os.pipe()
    os.close(end)
    process = process_of(arguments, pipe)
    os.close(pipe)
    assert (process.returncode, process.stderr) == (0, "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device that takes nothing is needed")
@pytest.mark.parametrize("arguments, message", [
    *((arguments, "standard output: No space left on device") for arguments in WRITERS),
    (["run", "nowhere", "--out", "x", "--json"], "nowhere: neither a file nor a packaged scene"),
])
def test_what_cannot_be_written_is_told_in_a_line(arguments, message):
    """A full disk is a failure."""
    with open("/dev/full", "w") as full:
        process = process_of(arguments, full)
    assert process.returncode == 2 and process.stderr.count("\n") == 1
    assert process.stderr.startswith(f"repro: {message}")


def test_closed_ends_with_gears_method_are_a_table_of_numbers(tmp_path):
    """What is there is stored or consumed, and every field is a number of Python's or empty."""
    scene = tmp_path / "closed.toml"
    scene.write_text('[pore]\nwidth = "50 um"\nlength = "600 um"\n[aggregate]\nradius = "5 um"\n[substrates]\n'
                     'boundary = "closed"\n[substrates.acceptor]\nsupply = "10 mg/L"\n[substrates.donor]\n'
                     'supply = "7 mg/L"\n[growth]\nend = "0.4 h"\n'
                     '[numerics]\npreset = "paper"\ntransport = "gear"\nrefinement = 0.5\n')
    out = run(tmp_path, str(scene))
    table = [float(value) for row in rows(out) for value in row.values() if value]
    ledger = list(csv.DictReader((out / "ledger.csv").read_text().splitlines()))
    assert len(table) > 50 and json.loads((out / "run.json").read_text())["status"] == "completed"
    for step in ledger:
        one = {name: float(value) for name, value in step.items()}
        assert one["donor_supplied_pg_per_m"] == one["donor_out_pg_per_m"] == 0 < one["donor_consumed_pg_per_m"]
        assert math.isclose(one["donor_stored_pg_per_m"], -one["donor_consumed_pg_per_m"], rel_tol=1e-6)
    results.write_table(tmp_path / "t.csv", ["a"], [[np.float64(0.1)], [0.1], [np.int64(3)], [None]])
    assert (tmp_path / "t.csv").read_text() == "a\n0.1\n0.1\n3\n\"\"\n"
