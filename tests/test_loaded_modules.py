"""A scene loads the modules of its sections alone: "the sections present are the physics that runs"."""
import pytest

from tests.shell import run_python

#: Modules by the part of a scene that switches them on.
PARTS = {
    "growth": {*(f"repro.model.{name}" for name in (
        "adhesion", "biomass", "closing_by_lines", "closing_by_nodes", "contact", "contact_lines", "contact_newton",
        "growing", "growth", "mechanics", "mesh_motion", "remeshing", "stages", "support", "surface", "traction")),
        "repro.fem.division", "repro.fem.transfer",
        *(f"repro.march.{name}" for name in ("balance", "ends", "folding", "loop"))},
    "erosion": {"repro.model.erosion", "repro.fem.recession"},
    "weld": {"repro.model.welding"},
    "eroding": {"repro.march.eroding"},
    "midpoint": {"repro.march.midpoint", "repro.march.stepping"},
    "updates": {"repro.march.updates"},
    "substrates": {f"repro.model.{name}" for name in ("kinetics", "substrates", "transport", "uptake_law")},
    "gear": {"repro.model.gear"}}
#: Modules that every run with files loads: balances and limits of the surface are in the words of columns, the page
#: interpolates fields, and `repro.preflight` takes its numbers from the laws of uptake.
LOADED_TODAY = {"repro.march.balance", "repro.model.surface", "repro.fem.transfer", "repro.model.kinetics",
                "repro.model.uptake_law"}
AT_REST = "unset=['growth'], overrides=['numerics.preset=paper'"


def loaded(code):
    """Return the modules that a new process has loaded after some code."""
    return {*run_python(f"import sys, repro\n{code}\nprint(*sys.modules)").stdout.split()}


def modules_of(names):
    return set().union(*(PARTS[name] for name in names.split()))


@pytest.mark.parametrize("arguments, parts", [
    ("'flow_only'", ""),
    (f"'base', {AT_REST}]", "substrates"),
    (f"'base', {AT_REST}, 'numerics.transport=gear']", "substrates gear"),
    ("'base', ['numerics.preset=fast']", "substrates growth midpoint"),
    ("'base', ['numerics.preset=fast', 'growth.new_biomass=stress_free', 'growth.erosion.speed=\"0.1 um/h\"']",
     "substrates growth midpoint erosion")],
    ids=["flow", "substrates", "transient", "growth", "erosion"])
def test_a_simulation_loads_the_modules_of_its_sections_alone(arguments, parts):
    """The row at t = 0 is the only one of a scene without growth."""
    modules = loaded(f"next(repro.simulate({arguments}))")
    assert modules & modules_of(" ".join(PARTS)) == modules_of(parts)


def test_a_run_loads_the_modules_of_its_sections_alone(tmp_path):
    modules = loaded(f"import os; os.chdir({str(tmp_path)!r}); repro.run('base', 'run', {AT_REST}])")
    assert modules & modules_of(" ".join(PARTS)) == modules_of("substrates") | LOADED_TODAY
