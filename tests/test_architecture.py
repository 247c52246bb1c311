"""The rules of the house, read from the source: who may import whom, what is declared, what is locked."""
import ast
import pathlib
import re
import sys
import tomllib
from graphlib import CycleError, TopologicalSorter
from importlib.metadata import packages_distributions

import pytest

ROOT = pathlib.Path(__file__).parents[1]
FOLDERS = ("repro", "reference", "verification", "paper_figures", "tests")
#: Names of folders that commands make: what is in them may be a copy of all this, or of an earlier state.
MADE = {"__pycache__", "out", "cache", "live", "pictures", "build", "dist", ".venv", ".git", ".hypothesis"}
FORBIDDEN = {"repro": {"reference", "verification", "paper_figures", "tests", "pickle"},
             "reference": {"repro", "pickle"}, **dict.fromkeys(FOLDERS[2:], {"pickle"})}
#: The rooms of `repro`, in the one order in which they may import each other: each those before it.
ROOMS = ("errors", "timing", "scene", "fem", "model", "march", "results", "preflight", "report", "runs",
         "sweeps", "cli", "__main__")
#: Of the rooms before it, those that a room may not import: finite elements know sizes and solvers, not scenes.
CLOSED = {"fem": {"scene"}}
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
RUNTIME = PROJECT["project"]["dependencies"]
EXTRAS = PROJECT["project"]["optional-dependencies"]
LOCKS = [(ROOT / name).read_text(encoding="utf-8")
         for name in ("requirements.lock", "verification/mutants/machine/requirements.lock", ".ci/crate.lock")]
PIN = re.compile(r"^([a-z0-9-]+)==(\d+(?:\.\d+)*)", re.M)
ADDRESS = re.compile(r"//|file:|index|--find-links|(^|\s)/\w", re.M)


def own(folder, pattern="*.py"):
    """Files of a folder of the repository, in order, but for what commands have made there."""
    found = sorted((ROOT / folder).rglob(pattern))
    return [path for path in found if path.is_file() and not MADE.intersection(path.relative_to(ROOT).parts)]


def modules():
    """{dotted name: source} of all Python files, "repro.fem.__init__" among them."""
    files = [path for folder in FOLDERS for path in own(folder)]
    return {".".join(path.relative_to(ROOT).with_suffix("").parts): path.read_text(encoding="utf-8") for path in files}


def asked_for(node, name):
    """Dotted names that one node of a source asks for, by statement or by name, in the module ``name``; ``from a import
    b`` asks for a.b."""
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


def asked(source, name="here.module"):
    """Dotted names that a source asks for, wherever in its text."""
    return {found for node in ast.walk(ast.parse(source)) for found in asked_for(node, name)}


def imported(source):
    """Top-level names of what a source imports; relative imports are its own."""
    return {name.split(".")[0] for name in asked(source)} - {"here"}


def may_import(module, other):
    """Do the rules let a module import another one?"""
    (folder, room, *_), (top, name, *_) = [*module.split("."), ""], [*other.split("."), ""]
    if folder != "repro" or top != "repro" or room == "__init__":
        return top not in FORBIDDEN[folder]
    before = ROOMS[:ROOMS.index(room) + 1] if room in ROOMS else ()
    return name in before and name not in CLOSED.get(room, ())


def trespasses(sources):
    """(module, other) of imports that break the rules."""
    return [(module, other) for module, source in sources.items() for other in asked(source, module)
            if not may_import(module, other)]


def at_run_time(source):
    """A source without what is imported for the checker of types alone."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            node.body = [ast.Pass()]
    return ast.unparse(tree)


def circle(sources):
    """Modules of `repro` of which each imports the one before it, the first the last, if there are such; what is for
    the checker of types alone counts not."""
    links = {name: inside(asked(at_run_time(source), name), sources) - {name} for name, source in sources.items()}
    try:
        TopologicalSorter({name: found for name, found in links.items() if name != "repro.__init__"}).prepare()
    except CycleError as found:
        return found.args[1]
    return []


def inside(names, sources):
    """Modules of `repro` among what is asked for: a.b where that is a module, else a."""
    found = set()
    for name in (name for name in names if name.startswith("repro.")):
        places = (name, f"{name}.__init__", name.rpartition(".")[0])
        found.add(next((place for place in places if place in sources), "repro.__init__"))
    return found


def normal(name):
    return re.sub(r"[-_.]+", "-", re.match(r"[A-Za-z0-9._-]+", name)[0]).lower()


def version(text):
    return tuple(map(int, text.split(".")))


def test_nobody_imports_what_the_rules_forbid():
    """Of other folders, and of the rooms of `repro` any that is not before one's own."""
    assert trespasses(modules()) == []


def test_no_module_imports_itself_by_way_of_others():
    sources = {name: source for name, source in modules().items() if name.startswith("repro.")}
    assert circle(sources) == []
    again = sources["repro.fem.elements"] + "\ndef f():\n    from repro.fem.transfer import located"
    assert "repro.fem.elements" in circle(sources | {"repro.fem.elements": again})


@pytest.mark.parametrize("module, source", [
    ("reference.slab", "def f():\n    from repro import flow"),
    ("repro.cli.main", "import importlib\nimportlib.import_module('reference.poiseuille')"),
    ("verification.audit", "import numpy, pickle"),
    ("repro.fem.mesh", "from repro.scene import Scene"),
    ("repro.fem.mesh", "from ..scene import keys"),
    ("repro.scene.keys", "def f():\n    from repro.fem.mesh import Mesh"),
    ("repro.results.__init__", "from ..check import numbers"),
    ("repro.runs.folder", "from repro import solve"),
    ("repro.utils", "from repro import errors"),
])
def test_the_rules_see_a_trespass(module, source):
    assert [name for name, _ in trespasses({module: source})] == [module]


@pytest.mark.parametrize("folder", FOLDERS)
def test_every_import_is_declared(folder):
    """`repro` needs the runtime dependencies alone and `paper_figures` one extra; the others may use all extras."""
    extras = {"repro": [], "paper_figures": EXTRAS["figures"]}.get(folder, [r for rs in EXTRAS.values() for r in rs])
    provided = packages_distributions()
    names = set().union(*(imported(path.read_text(encoding="utf-8")) for path in own(folder)))
    outside = names - {*sys.stdlib_module_names, *FOLDERS}
    used = {normal(distribution) for name in outside for distribution in provided.get(name, [name])}
    assert names and used <= {*map(normal, RUNTIME + extras)}


@pytest.mark.parametrize("lock", LOCKS, ids=["all", "mutants", "crate"])
def test_the_lock_holds_hashes_and_no_address(lock):
    """That every line is a pin with its hashes is for pip to see, which is told so."""
    assert 0 < len(PIN.findall(lock)) <= lock.count("--hash=sha256:") and not ADDRESS.search(lock)


@pytest.mark.parametrize("lock, wanted", [
    (LOCKS[0], RUNTIME + PROJECT["build-system"]["requires"]
     + [r for name in {*EXTRAS} - {"fast", "mutation"} for r in EXTRAS[name]]),
    (LOCKS[1], EXTRAS["mutation"])], ids=["all", "mutants"])
def test_the_lock_pins_every_direct_dependency_within_its_bounds(lock, wanted):
    """Of mutants made by machine apart; what is optional for speed is in none."""
    for requirement in wanted:
        pins = [version(pinned) for name, pinned in PIN.findall(lock) if name == normal(requirement)]
        assert pins and min(pins) >= version(re.search(r">=([\d.]+)$", requirement)[1]), requirement
