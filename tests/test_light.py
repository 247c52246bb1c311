"""What a command imports: what it needs, and nothing that takes long. By the names of modules, never by the clock."""

import subprocess
import sys

import pytest

from tests.shell import SHORT

#: What no command and no run needs, whatever is installed; each takes from a twentieth to half a second.
NEVER = {"matplotlib", "pandas", "xarray", "h5py", "scipy.interpolate", "scipy.optimize", "scipy.special",
         "scipy.spatial", "scipy.integrate", "scipy.stats", "pint", "meshio", "rich", "skfem.visuals", "sympy",
         "distributed"}
#: What those that run nothing do not need either.
SOLVER = {"numpy", "scipy", "skfem", "meshio", "mmgpy", "shapely", "tqdm", "concurrent.futures"}
CODE = """
import sys
{code}
print(*sys.modules, file=sys.stderr)
"""
COMMAND = "from repro.cli import main\ntry:\n    main({!r})\nexcept SystemExit:\n    pass"


def loaded(code: str) -> set[str]:
    """Modules that are loaded when a program has run."""
    done = subprocess.run([sys.executable, "-c", CODE.format(code=code)], capture_output=True, text=True, check=True)
    return set(done.stderr.split())


@pytest.mark.parametrize("arguments", [["--help"], ["--version"], ["run", "--help"], ["sweep", "--help"], ["scene"],
                                       ["scene", "base"], ["run", "base", "--out", "x", "--set", "pore.width=3"],
                                       ["run", "nowhere", "--out", "x"]])
def test_a_command_that_runs_nothing_imports_no_solver(arguments):
    assert loaded(COMMAND.format(arguments)) & (NEVER | SOLVER) == set()


def test_importing_the_package_imports_none_of_its_modules():
    """Nor does telling its public names."""
    assert {name for name in loaded("import repro\ndir(repro)") if name.startswith("repro.")} == set()


def test_a_run_imports_what_it_needs_alone(tmp_path):
    """With remeshes, fields and its page."""
    found = loaded(COMMAND.format(["run", *SHORT, "--set", 'growth.end="3 h"', "--out", str(tmp_path / "run")]))
    assert (tmp_path / "run" / "report.html").exists() and found >= {"numpy", "skfem", "mmgpy", "shapely"}
    assert found & NEVER == set()
