"""The rules of the house, read from the source: who may import whom, what is declared, what is locked."""
import ast
import pathlib
import re
import sys
import tomllib
from functools import cache
from importlib.metadata import packages_distributions

import pytest

ROOT = pathlib.Path(__file__).parents[1]
FOLDERS = ("repro", "reference", "verification", "paper_figures", "tests")
PROVIDED = cache(packages_distributions)
FORBIDDEN = {
    "repro": {"reference", "verification", "paper_figures", "tests", "pickle"},
    "reference": {"repro", "pickle"},
    "verification": {"pickle"},
    "paper_figures": {"pickle"},
    "tests": {"pickle"},
}
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
RUNTIME = PROJECT["project"]["dependencies"]
EXTRAS = PROJECT["project"]["optional-dependencies"]
LOCK = (ROOT / "requirements.lock").read_text(encoding="utf-8")
PIN = re.compile(r"^([a-z0-9-]+)==(\d+(?:\.\d+)*)(?: ; [\w .<>=!'()]+)? \\$", re.M)
ADDRESS = re.compile(r"//|file:|index|--find-links|(^|\s)/\w")
HASH = re.compile(r"^    --hash=sha256:[0-9a-f]{64}(?: \\)?$")


def imported(source):
    """Top-level names of the modules that a source imports, by statement or by name; relative imports are its own."""
    names = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            names.add(node.module)
        elif isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant):
            called = getattr(node.func, "attr", getattr(node.func, "id", ""))
            names |= {str(node.args[0].value)} if called in ("import_module", "__import__") else set()
    return {name.split(".")[0] for name in names}


def imports(folder):
    """{path: imported names} of every Python file of a folder."""
    return {path: imported(path.read_text(encoding="utf-8")) for path in sorted((ROOT / folder).rglob("*.py"))}


def trespasses(folder, names):
    return names & FORBIDDEN[folder]


def normal(name):
    return re.sub(r"[-_.]+", "-", name).lower()


def name_of(requirement):
    return normal(re.match(r"[A-Za-z0-9._-]+", requirement)[0])


def distributions(names):
    """Distributions that provide third-party import names; an unknown one stands for itself."""
    outside = names - set(sys.stdlib_module_names) - set(FOLDERS)
    provided = PROVIDED()
    return {normal(d) for name in outside for d in provided.get(name, [name])}


def version(text):
    return tuple(map(int, text.split(".")))


def faults(lock):
    """Lines of a lock that are neither a comment, nor an exact pin, nor a hash; and all that looks like an address."""
    lines = [line for line in lock.splitlines() if line and not line.startswith("#")]
    strange = [line for line in lines if not PIN.match(line) and not HASH.match(line)]
    return strange + [line for line in lock.splitlines() if ADDRESS.search(line)]


@pytest.mark.parametrize("folder", FOLDERS)
def test_nobody_imports_what_the_rules_forbid(folder):
    found = imports(folder)
    assert found, f"no Python file in {folder}/"
    assert {str(p): t for p, names in found.items() if (t := trespasses(folder, names))} == {}


@pytest.mark.parametrize("folder, source", [
    ("reference", "import repro.model.flow"),
    ("reference", "def f():\n    from repro import flow"),
    ("repro", "from verification.claims import judge"),
    ("repro", "import numpy, tests"),
    ("repro", "import importlib\nimportlib.import_module('reference.poiseuille')"),
    ("verification", "import pickle"),
])
def test_the_rules_see_a_trespass(folder, source):
    assert len(trespasses(folder, imported(source))) == 1


def test_relative_imports_are_ones_own():
    assert imported("from . import reference\nfrom .tests import x\nimport numpy.linalg") == {"numpy"}


def test_every_runtime_dependency_is_imported():
    used = distributions(set().union(*(names for folder in FOLDERS for names in imports(folder).values())))
    assert {name_of(r) for r in RUNTIME} - used == set()


@pytest.mark.parametrize("folder", FOLDERS)
def test_every_import_is_declared(folder):
    """`repro` and `paper_figures` live on the runtime dependencies alone; the others may use the extras too."""
    extras = [] if folder in ("repro", "paper_figures") else [r for rs in EXTRAS.values() for r in rs]
    declared = {name_of(r) for r in RUNTIME + extras}
    used = {str(path): distributions(names) - declared for path, names in imports(folder).items()}
    assert {path: names for path, names in used.items() if names} == {}


def test_the_lock_holds_pins_and_hashes_and_no_address():
    assert faults(LOCK) == []
    for block in re.split(r"^(?=[a-z0-9-]+==)", LOCK, flags=re.M)[1:]:
        assert "--hash=sha256:" in block, block


@pytest.mark.parametrize("line", [
    "--index-url https:" + "//example.org/simple",
    "# --find-links /some/folder",
    "numpy @ file:" + "///some/folder/numpy.whl",
    "numpy>=2.4 \\",
])
def test_the_lock_check_sees_a_fault(line):
    assert line in faults(LOCK + line + "\n")


def test_the_lock_pins_every_direct_dependency_within_its_bounds():
    pins = {}
    for name, pinned in PIN.findall(LOCK):
        pins.setdefault(name, []).append(version(pinned))
    optional = {name: needed for name, needed in EXTRAS.items() if name != "fast"}  # which `make env` leaves out
    for requirement in RUNTIME + [r for rs in optional.values() for r in rs] + PROJECT["build-system"]["requires"]:
        lowest = version(re.search(r">=([\d.]+)$", requirement)[1])
        assert min(pins.get(name_of(requirement), [()])) >= lowest, requirement
