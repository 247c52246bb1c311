"""K / K0 against biomass: definitions, fits with their errors, the table, the command, and what is refused."""
import numpy as np
import pytest

import repro
from reference import layered_channel
from repro.cli import main
from repro.results import COLUMNS
from repro.results.permeability import LAWS, fitted, of_runs
from repro.scene import load_scene, scene_tables
from repro.sweeps import driver
from tests.shell import rows
from tests.strategies import in_um
from tests.test_loaded_modules import loaded
from tests.test_sweep import in_this_process

BIOMASS = np.linspace(0.0, 0.6, 30)
#: Water of Table 1: g / (12 nu) of a channel of one um, in m/d per um^2.
CLEAN = 9.81 / (12 * 1.003e-6) * 1e-12 * 86400


def results(share, relative, changes=(), width=50.0):
    """Rows of a pore of 600 um with these values; width: of the pore with its mirror image."""
    tables = scene_tables(load_scene("base", changes))
    names = ("time_h", "aggregate_area_um2", "conductivity_m_per_d")
    values = zip(np.arange(len(share)), 50 * 600 * np.asarray(share), CLEAN * width**2 * np.asarray(relative))
    listed = [dict.fromkeys(COLUMNS) | dict(zip(names, map(float, row))) for row in values]
    return repro.Results("base", listed, [], "completed", tables=tables)


@pytest.mark.parametrize("name, constants", [
    ("power", [0.8]), ("power", [3.0]), ("power", [12.0]), ("kozeny_carman", [0.05]), ("kozeny_carman", [0.37]),
    ("kozeny_carman", [0.95]), ("vandevivere", [0.03, 1e-2]), ("vandevivere", [0.12, 2.5e-4]),
    ("vandevivere", [0.2, 0.05])])
def test_a_fit_recovers_the_constants_of_its_law(name, constants):
    fit = fitted(LAWS[name], BIOMASS, LAWS[name].relative(BIOMASS, *constants))
    assert [value for value, _ in fit.constants.values()] == pytest.approx(constants, rel=1e-5)
    assert fit.rms < 1e-5 and fit.worst == pytest.approx(1, abs=1e-4)


@pytest.mark.parametrize("name, value", [
    ("power", 0.8**5), ("kozeny_carman", 0.8**3 * (0.5 / 0.6) ** 2), ("clement", 0.8 ** (19 / 6)),
    ("okubo_matsumoto", 0.64),
    ("vandevivere", 0.64 * np.exp(-2) + (1 - np.exp(-2)) * 0.01 / (0.01 + 0.2 * 0.99))])
def test_the_laws_have_their_printed_values(name, value):
    """At B = 0.2, with b = 5, n0 = 0.5, Bc = 0.1, k = 0.01; and one for the clean pore."""
    constants = {"power": [5.0], "kozeny_carman": [0.5], "vandevivere": [0.1, 0.01]}.get(name, [])
    assert LAWS[name].relative(np.array([0.0, 0.2]), *constants) == pytest.approx([1.0, value], rel=1e-12)


def test_errors_are_those_of_linear_regression():
    """ln K = b ln x has its closed form: b, its standard error, the root of the mean square, and the largest factor."""
    biomass = BIOMASS[1:]
    logs = 4 * np.log(1 - biomass) + 0.1 * np.cos(np.arange(len(biomass)))
    fit = fitted(LAWS["power"], biomass, np.exp(logs))
    slopes = np.log(1 - biomass)
    power = (slopes @ logs) / (slopes @ slopes)
    apart = power * slopes - logs
    error = np.sqrt(apart @ apart / (len(apart) - 1) / (slopes @ slopes))
    assert fit.constants["b"] == pytest.approx((power, error), rel=1e-5)
    assert fit.rms == pytest.approx(np.sqrt(np.mean(apart**2)), rel=1e-5)
    assert fit.worst == pytest.approx(np.exp(np.abs(apart).max()), rel=1e-5)
    assert fit.relative(0.3) == pytest.approx(0.7**power, rel=1e-5)


@pytest.mark.parametrize("changes, width", [((), 50.0), (("pore.upper_wall=symmetry",), 100.0)])
def test_a_rigid_layer_leaves_the_cube_of_the_open_part(changes, width):
    """In closed form with lambda = 1e12: K0 and B have their definitions, also up to a plane of symmetry."""
    thickness = np.linspace(0.0, 0.8, 9)
    relative = [12 / layered_channel.gradient(1.0, part, 1e12) for part in thickness]
    permeability = of_runs([results(thickness, relative, changes, width)])
    assert permeability.columns["relative_permeability"] == pytest.approx((1 - thickness) ** 3, rel=1e-6)
    assert permeability.columns["relative_porosity"] == pytest.approx(1 - thickness)
    assert permeability.fits["power"].constants["b"][0] == pytest.approx(3, rel=1e-6)
    assert permeability.columns["power"] == pytest.approx((1 - thickness) ** 3, rel=1e-5)
    assert permeability.fits["clement"].worst == pytest.approx(0.2 ** (3 - 19 / 6), rel=1e-5)


def test_a_layer_of_the_solver_has_its_closed_form():
    """Two lengths of a layer of 20 um: the loss of 100 um of it over that of as much empty pore. The ends cancel. The
    bound is a percent, the accuracy of `fast`."""
    losses = []
    for half in (100, 150):
        outline = in_um([(-half - 20, 0), (-half, 20), (half, 20), (half + 20, 0)])
        scene = {"pore": {"width": "50 um"}, "aggregate": {"outline": outline}, "flow": {"mean_velocity": "1 m/day"}}
        run = repro.solve(scene, {"numerics.preset": "fast"})
        rows_ = of_runs([run, results([0, 0.1, 0.2], [1, 0.7, 0.4])]).columns
        assert rows_["biomass_per_pore_volume"][0] == pytest.approx((2 * half + 20) * 20 / 3e4)
        losses.append(1 / rows_["relative_permeability"][0])
    expected = (layered_channel.gradient(1.0, 0.4, 2000.0) / 12 - 1) * 100 / 600
    assert losses[1] - losses[0] == pytest.approx(expected, rel=1e-2)


def test_rows_that_leave_a_constant_open_have_a_huge_error():
    """A pore that is nearly clean has no biomass that could form plugs. k is between 0 and 1."""
    for biomass in (1e-9, 1e-4):
        fit = fitted(LAWS["vandevivere"], biomass * np.arange(3.0), np.array([1.0, 1.01, 0.99]))
        assert fit.constants["k"][1] > 1e3


@pytest.mark.parametrize("share, message", [([0.1, 0.2], "three amounts of biomass or more are needed, here are 2"),
                                            ([0.1] * 5, "here are 1"), ([], "here are 0")])
def test_too_few_rows_are_refused(share, message):
    with pytest.raises(ValueError, match=message):
        results(share, np.ones(len(share))).permeability()


def test_the_command_reads_runs_and_sweeps(tmp_path, capsys, monkeypatch):
    """Its table has the rows of all runs; a folder without a run, one without an aggregate, and a file that cannot be
    written are refused in one line."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(driver, "ready", in_this_process)
    changes = ['numerics.preset="fast"', 'growth.end="1 h"', 'output.every="0.5 h"']
    swept = repro.sweep("base", ["pore.width=50 um, 40 um"], "sweep", changes)
    assert main(["permeability", "sweep", "--out", "table.csv"]) == 0
    out = capsys.readouterr().out
    expected = swept.permeability()
    assert out == f"{expected}\ntable: table.csv\n" and "clement: x^(19/6); error of ln K" in out
    table = rows(tmp_path / "table.csv")
    assert [row["run"] for row in table] == ["1"] * 3 + ["2"] * 3
    assert list(table[0]) == ["run", "time_h", "biomass_per_pore_volume", "relative_porosity", "relative_permeability",
                              *LAWS]
    for name, values in expected.columns.items():
        assert [float(row[name]) for row in table] == pytest.approx(values, rel=1e-15)
    alone = repro.load_run(swept.paths[1]).permeability()
    assert alone.columns["relative_permeability"] == pytest.approx(expected.columns["relative_permeability"][3:])
    assert main(["permeability", str(swept.paths[1])]) == 0
    assert capsys.readouterr().out == f"{alone}\n"
    repro.run("flow_only", "clean", unset=["aggregate"])
    for words, message in ((["sweep/runs"], "sweep/runs"), (["clean"], "clean: aggregate_area_um2: this scene has no"),
                           (["sweep", "--out", "no/table.csv"], "no/table.csv: ")):
        assert main(["permeability", *words]) == 2
        err = capsys.readouterr().err
        assert message in err and err.count("\n") == 1, err


def test_a_run_does_not_load_the_laws():
    modules = loaded("repro.solve('flow_only')")
    assert not modules & {"repro.results.permeability", "scipy.optimize"}
