"""Rules of the package, checked in its source: imports, declared and locked dependencies, an end for hanging tests."""
import ast
import re
import subprocess
import sys
import tomllib
from functools import cache
from graphlib import CycleError, TopologicalSorter
from importlib.metadata import packages_distributions

import pytest

from tests.blocks import ROOT

FOLDERS = ("repro", "reference", "verification", "paper_figures", "tests")
#: Names of folders that commands make. They may hold copies of the package, or earlier versions of it.
GENERATED = {"__pycache__", "out", "cache", "live", "pictures", "build", "dist", ".venv", ".git", ".hypothesis"}
FORBIDDEN = {"repro": {"reference", "verification", "paper_figures", "tests", "pickle"},
             "reference": {"repro", "pickle"}, **dict.fromkeys(FOLDERS[2:], {"pickle"})}
#: The rooms of `repro` in order. Each may import the rooms before it.
ROOMS = ("errors", "timing", "polling", "schemes", "scene", "fem", "model", "march", "results", "preflight",
         "report", "runs", "network", "sweeps", "cli", "__main__")
#: Earlier rooms that a room may not import: finite elements know sizes and solvers, but no scenes.
CLOSED = {"fem": {"scene"}}
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
RUNTIME = PROJECT["project"]["dependencies"]
EXTRAS = PROJECT["project"]["optional-dependencies"]
LOCKS = [(ROOT / name).read_text(encoding="utf-8")
         for name in ("requirements.lock", "verification/mutants/machine/requirements.lock", ".ci/crate.lock",
                      ".ci/oldest.lock", ".ci/network.lock", ".ci/gold.lock", "verification/requirements.lock")]
#: Extras that `make env` installs, and those that `make test` and `make verify` add.
SMALL, ADDED = ("figures", "test", "netcdf", "env"), ("verification", "dask", "lint")
#: {module: distribution} of packages that only a lock of their own installs.
ELSEWHERE = {"netgen": ["netgen-mesher"]}
PIN = re.compile(r"^([a-z0-9-]+)==(\d+(?:\.\d+)*)", re.M)
ADDRESS = re.compile(r"//|file:|index|--find-links|(^|\s)/\w", re.M)


def source_files(folder, pattern="*.py"):
    """Return the files of a folder of the repository in order, without generated files."""
    paths = sorted((ROOT / folder).rglob(pattern))
    return [path for path in paths if path.is_file() and not GENERATED.intersection(path.relative_to(ROOT).parts)]


@cache
def modules():
    """{dotted name: source} of all Python files, including "repro.fem.__init__"."""
    files = [path for folder in FOLDERS for path in source_files(folder)]
    return {".".join(path.relative_to(ROOT).with_suffix("").parts): path.read_text(encoding="utf-8") for path in files}


def node_imports(node, name):
    """Return the dotted names that one node of the module ``name`` imports, by statement or by name. ``from a import
    b`` imports a.b."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    if isinstance(node, ast.ImportFrom):
        above = name.split(".")[:-node.level] if node.level else []
        base = ".".join([*above, *([node.module] if node.module else [])])
        return [f"{base}.{alias.name}" for alias in node.names]
    if isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant):
        called = getattr(node.func, "attr", getattr(node.func, "id", ""))
        return [str(node.args[0].value)] if called in ("import_module", "__import__") else []
    return []


@cache
def imported_names(source, name="here.module"):
    """Return the dotted names that a source imports anywhere in its text."""
    return {imported_name for node in ast.walk(ast.parse(source)) for imported_name in node_imports(node, name)}


def top_level_imports(source):
    """Return the top-level names that a source imports, without relative imports."""
    return {name.split(".")[0] for name in imported_names(source)} - {"here"}


def may_import(module, other):
    """Return whether the rules let a module import another one."""
    (folder, room, *_), (top, name, *_) = [*module.split("."), ""], [*other.split("."), ""]
    if folder != "repro" or top != "repro" or room == "__init__":
        return top not in FORBIDDEN[folder]
    before = ROOMS[:ROOMS.index(room) + 1] if room in ROOMS else ()
    return name in before and name not in CLOSED.get(room, ())


def trespasses(sources):
    """Return (module, other) for imports that break the rules."""
    return [(module, other) for module, source in sources.items() for other in imported_names(source, module)
            if not may_import(module, other)]


@cache
def at_run_time(source):
    """Return a source without the imports that only the type checker needs."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            node.body = [ast.Pass()]
    return ast.unparse(tree)


def circle(sources):
    """Return the modules of a circle of imports in `repro`, if there is one. Imports that only the type checker needs
    do not count."""
    links = {}
    for name, source in sources.items():
        links[name] = inside(imported_names(at_run_time(source), name), sources) - {name}
    try:
        TopologicalSorter({name: members for name, members in links.items() if name != "repro.__init__"}).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def inside(names, sources):
    """Return the modules of `repro` among imported names: a.b if that is a module, otherwise a."""
    members = set()
    for name in (name for name in names if name.startswith("repro.")):
        places = (name, f"{name}.__init__", name.rpartition(".")[0])
        members.add(next((place for place in places if place in sources), "repro.__init__"))
    return members


def normal(name):
    return re.sub(r"[-_.]+", "-", re.match(r"[A-Za-z0-9._-]+", name)[0]).lower()


def version(text):
    return tuple(map(int, text.split(".")))


def test_no_module_breaks_the_rules_of_imports():
    """No module imports a forbidden folder or, in `repro`, a later room."""
    assert trespasses(modules()) == []


def test_no_imports_form_a_circle():
    sources = {name: source for name, source in modules().items() if name.startswith("repro.")}
    assert circle(sources) == []
    again = sources["repro.fem.elements"] + "\ndef f():\n    from repro.fem.transfer import located"
    assert "repro.fem.elements" in circle(sources | {"repro.fem.elements": again})


distributions = cache(packages_distributions)


@pytest.mark.parametrize("folder", FOLDERS)
def test_every_import_is_declared(folder):
    """`repro` needs only the runtime dependencies and `paper_figures` one extra; the others may use all extras."""
    extras = {"repro": [], "paper_figures": EXTRAS["figures"]}.get(folder, [r for rs in EXTRAS.values() for r in rs])
    provided = distributions()
    names = set().union(*(top_level_imports(path.read_text(encoding="utf-8")) for path in source_files(folder)))
    outside = names - {*sys.stdlib_module_names, *FOLDERS}
    used = {normal(distribution) for name in outside
            for distribution in provided.get(name, ELSEWHERE.get(name, [name]))}
    assert names and used <= {*map(normal, RUNTIME + extras)}


@pytest.mark.parametrize("lock", LOCKS, ids=["env", "mutants", "crate", "oldest", "network", "gold", "added"])
def test_the_lock_holds_hashes_and_no_address(lock):
    """Pip itself checks that every line is a pin with its hashes."""
    assert 0 < len(PIN.findall(lock)) <= lock.count("--hash=sha256:") and not ADDRESS.search(lock)


@pytest.mark.parametrize("lock, requirements", [
    (LOCKS[0], RUNTIME + PROJECT["build-system"]["requires"] + [r for name in SMALL for r in EXTRAS[name]]),
    (LOCKS[1], EXTRAS["mutation"]), (LOCKS[5], EXTRAS["gold"]),
    (LOCKS[6], [r for name in ADDED for r in EXTRAS[name]])],
    ids=["env", "mutants", "gold", "added"])
def test_the_lock_pins_every_direct_dependency_within_its_bounds(lock, requirements):
    """The machine-made mutants and NGSolve have locks of their own; no lock has the optional packages for speed."""
    for requirement in requirements:
        pins = [version(pinned) for name, pinned in PIN.findall(lock) if name == normal(requirement)]
        assert pins and min(pins) >= version(re.search(r">=([\d.]+)$", requirement)[1]), requirement


def test_make_env_leaves_out_what_only_verification_needs():
    """No package is in both locks, every extra but three is in one of them, and the largest packages are added."""
    small, added = ({name for name, _ in PIN.findall(lock)} for lock in (LOCKS[0], LOCKS[6]))
    assert not small & added and {*EXTRAS} == {*SMALL, *ADDED, "fast", "mutation", "gold"}
    assert {"vtk", "llvmlite", "sympy", "mypy", "sphinx"} <= added and {"matplotlib", "pytest", "xarray"} <= small


def test_the_lower_bounds_are_the_oldest_versions_tested():
    """The lock of `make oldest` pins each dependency at its bound."""
    pinned = dict(PIN.findall(LOCKS[3]))
    bounds = {normal(each): re.search(r">=([\d.]+)$", each)[1] for each in RUNTIME + EXTRAS["figures"]}
    assert bounds.items() <= pinned.items()


@pytest.mark.parametrize("processes", ["-n0", pytest.param("-n1", marks=pytest.mark.thorough)])
def test_a_test_that_hangs_fails(tmp_path, processes):
    """With the settings of pyproject.toml, whose limit is shorter here. The output names the place."""
    (tmp_path / "test_endless.py").write_text("def test_endless():\n    while True:\n        pass\n")
    command = [sys.executable, "-m", "pytest", "-c", ROOT / "pyproject.toml", "--rootdir", tmp_path, processes,
               "-o", "faulthandler_timeout=0.5", "-p", "no:cacheprovider", tmp_path]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert ended.returncode == 1 and "test_endless.py" in ended.stderr and "passed" not in ended.stdout
