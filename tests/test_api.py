"""From Python: what `repro` exports, results as arrays with names and units, and how little importing it takes."""

import importlib.resources
import re
import subprocess
import sys

import meshio
import numpy as np
import pytest

import repro
from repro import results
from repro.results.tables import SHOWN, Results, solve, unit
from repro.run.running import run
from repro.scene import load_scene

SHORT = ["numerics.preset=fast", 'growth.end="0.6 h"']


@pytest.fixture(scope="module")
def found() -> Results:
    return solve(load_scene("base", SHORT))


def test_columns_are_those_of_the_table_of_a_run(found, tmp_path):
    """To the last bit. Mutants: a column under another's name; rows of every step where times are asked for."""
    run(load_scene("base", SHORT), tmp_path)
    table = results.read_table(tmp_path / "timeseries.csv")
    assert list(found) == list(table) == results.COLUMNS
    for name, column in table.items():
        assert np.array_equal(found[name], column, equal_nan=True), name
    assert np.array_equal(found.time, found["time_h"]) and found.time[-1] == 0.6 and found.status == "completed"


def test_fields_are_those_of_the_files_of_a_run(tmp_path):
    """On straight triangles and on curved ones. Mutants: fields of the row before; corners alone."""
    for elements, corners in (("linear", 3), ("quadratic", 6), ("cubic", 6)):
        scene = load_scene("base", ["numerics.preset=fast", f"numerics.elements={elements}", 'growth.end="0.2 h"'])
        run(scene, tmp_path / elements)
        fields, written = solve(scene).fields(0.2), meshio.read(tmp_path / elements / "fields/fields_0001.vtu")
        assert np.array_equal(fields["places_um"], written.points[:, :2])
        assert np.array_equal(fields["triangles"], written.cells[0].data) and fields["triangles"].shape[1] == corners
        named = {**written.point_data, **{name: values for name, (values,) in written.cell_data.items()}}
        assert set(fields) == {"places_um", "triangles", *named}
        for name, values in named.items():
            assert np.array_equal(fields[name], values, equal_nan=True), name


def test_units_are_what_the_names_end_with(found):
    """Mutants: um2 read as um; the unit of a velocity as that of a length."""
    assert found.units["conductivity_m_per_d"] == "m/d" and found.units["aggregate_area_um2"] == "um2"
    told = {name: unit(name) for name in results.COLUMNS}
    plain = {name for name, one in told.items() if one == "1"}
    assert plain == {"inert_fraction", "biomass_density_min", "biomass_density_max", "acceptor_balance",
                     "donor_balance", "biomass_balance", "oxygen_demand_balance", "nodes", "remeshed", "contact"}
    assert {one for name, one in told.items() if name.endswith("mg_per_L")} == {"mg/L"}
    assert (unit("head_loss_cm"), unit("time_h"), unit("upstream_um"), unit("stress_xx_MPa"), unit("theta")) == (
        "cm", "h", "um", "MPa", "1")
    assert set(found.units) == {*found, *found.fields(0.0)} and found.units["head_cm"] == "cm"


def test_what_is_not_modelled_is_not_there():
    """Mutant: columns of not-a-number."""
    (flow,) = [solve(load_scene("flow_only"))]
    assert flow["mean_velocity_m_per_d"] == pytest.approx(2.9) and "donor_balance" not in flow
    assert len(flow.time) == 1 and not any("donor" in name for name in flow.fields(0.0))
    with pytest.raises(KeyError, match="did you mean conductivity_m_per_d"):
        flow["conductivity"]


def test_another_time_is_refused_by_the_nearest(found):
    """Mutant: the fields of the nearest time without a word."""
    with pytest.raises(KeyError, match=r"0.55 h: not a reported time; the nearest is 0.6"):
        found.fields(0.55)


def test_a_run_to_the_pores_end_says_so():
    scene = load_scene("wide", ["aggregate.radius=40 um", "pore.length=90 um", "growth.time_step=2 h", "growth.end=4 h",
                                "numerics.refinement=0.5"])
    assert "reaches the pore's" in solve(scene).status


def test_the_table_of_a_notebook_escapes_and_is_short(found):
    """Mutants: a scene's name as it stands; every row of a long run."""
    rows = [dict.fromkeys(results.COLUMNS) | {"time_h": float(k)} for k in range(40)]
    html = Results("<script>alert(1)</script>&", rows, [{}] * 40, "<b>")._repr_html_()
    assert "<script" not in html and "&lt;script&gt;" in html and "<b>" not in html
    assert html.count("<td>") == 2 * SHOWN and "<td>39</td>" in html and "<td>20</td>" not in html
    assert found._repr_html_().count("<td>") == len(found) * len(found.time)
    assert "<th>conductivity_m_per_d (m/d)</th>" in found._repr_html_()
    assert repr(found) == f"<Results of base: {len(found.time)} rows, 25 columns, completed>"


def test_public_names():
    """Mutant: a name of __all__ that is nowhere."""
    for name in repro.__all__:
        assert getattr(repro, name).__module__.startswith("repro."), name
        assert name in dir(repro)
    assert not hasattr(repro, "nothing")


def test_importing_takes_next_to_nothing():
    """And writing a scene out no more than its units do (pint, which takes others along). Mutant: the
    solver imported with the package."""
    for code, heavy in (("import repro, repro.scene", "numpy pint scipy skfem"),
                        ("from repro.scene.text import scene_text; scene_text('flow_only')", "skfem meshio mmgpy")):
        loaded = f"{code}; import sys; sys.exit(' '.join(name for name in '{heavy}'.split() if name in sys.modules))"
        done = subprocess.run([sys.executable, "-c", loaded], capture_output=True, text=True, check=False)
        assert done.stderr.strip() == ""


def test_the_map_names_every_module_of_the_package():
    """Mutant: a module that the docstring of the package does not know."""
    folder = importlib.resources.files("repro")
    modules = {path.name.removesuffix(".py") for path in folder.iterdir() if path.name.endswith(".py")}
    named = set(re.findall(r"repro\.(\w+)", repro.__doc__))
    assert modules - {"__init__", "__main__"} - named - OTHERS == set()


#: Modules that hold nothing but a few words, and need no place on the map.
OTHERS = {"errors", "files"}


def test_what_the_package_ships():
    """Mutant: data left out of the wheel."""
    project = (importlib.resources.files("repro") / ".." / "pyproject.toml").read_text(encoding="utf-8")
    for name in ("py.typed", "tutorial.md"):
        assert (importlib.resources.files("repro") / name).is_file() and f'"{name}"' in project


PROGRAM = """
from repro import Scene, load_scene, simulate, solve

scene: Scene = load_scene("base", ['growth.end="1 h"'])
found = solve(scene)
reveal_type(found)
reveal_type(found["conductivity_m_per_d"])
reveal_type(found.units)
reveal_type(found.fields(1.0))
for instant in simulate(scene):
    reveal_type(instant.remeshes)
load_scene(3)
found.nothing
from repro import nothing
"""


@pytest.mark.thorough
def test_users_of_mypy_see_types(tmp_path):
    """Mutants: no py.typed; names that are Any."""
    pytest.importorskip("mypy")
    (tmp_path / "user.py").write_text(PROGRAM)
    arguments = ["--strict", "--follow-imports=silent", "--no-incremental", "--ignore-missing-imports", "user.py"]
    where = str(importlib.resources.files("repro") / "..")
    done = subprocess.run([sys.executable, "-m", "mypy", *arguments], cwd=tmp_path, capture_output=True, text=True,
                          check=False, env={"MYPYPATH": where, "PATH": ""})
    revealed = re.findall(r'Revealed type is "(.*)"', done.stdout)
    assert [re.sub(r"builtins\.|_typeshed\.", "", one).split("[")[0] for one in revealed] == [
        "repro.results.tables.Results", "numpy.ndarray", "dict", "dict", "int"], done.stdout
    errors = re.findall(r"error: .*\[([a-z-]+)\]$", done.stdout, re.M)
    assert sorted(errors) == ["arg-type", "attr-defined", "attr-defined"], done.stdout
