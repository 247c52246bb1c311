"""The rules of the house, read from the source: who may import whom, what is declared, what is locked."""
import ast
import pathlib
import re
import sys
import tomllib
from functools import cache
from graphlib import CycleError, TopologicalSorter
from importlib.metadata import packages_distributions

import pytest

ROOT = pathlib.Path(__file__).parents[1]
FOLDERS = ("repro", "reference", "verification", "paper_figures", "tests")
#: Names of folders that commands make: what is in them may be a copy of all this, or of an earlier state.
MADE = {"__pycache__", "out", "cache", "live", "pictures", "runs", "build", "dist", ".venv", ".git", ".hypothesis"}
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
LOCKS = [(ROOT / folder / "requirements.lock").read_text(encoding="utf-8") for folder in (".", "verification/sampled")]
PIN = re.compile(r"^([a-z0-9-]+)==(\d+(?:\.\d+)*)(?: ; [\w .<>=!'()]+)? \\$", re.M)
ADDRESS = re.compile(r"//|file:|index|--find-links|(^|\s)/\w")
HASH = re.compile(r"^    --hash=sha256:[0-9a-f]{64}(?: \\)?$")
#: The rooms of `repro`, in the one order in which they may import each other: each those before it.
ROOMS = ("errors", "timing", "scene", "fem", "model", "march", "results", "check", "report", "run", "sweep", "cli")
#: Of the rooms before it, those that a room may not import: finite elements know sizes and solvers, not scenes.
CLOSED = {"fem": {"scene"}}


def imported(source):
    """Top-level names of the modules that a source imports, by statement or by name; relative imports are its own."""
    nodes = ast.walk(ast.parse(source))
    return {asked.split(".")[0] for node in nodes for asked in asked_for(node, "here.is.a.module", ())} - {"here"}


def own(folder, pattern="*.py", root=ROOT):
    """Files of a folder of the repository, in order, but for what commands have made there."""
    found = sorted((root / folder).rglob(pattern))
    return [path for path in found if path.is_file() and not MADE.intersection(path.relative_to(root).parts)]


def imports(folder, root=ROOT):
    """{path: imported names} of every Python file of a folder."""
    return {path: imported(path.read_text(encoding="utf-8")) for path in own(folder, root=root)}


def module_of(path):
    """Dotted name of a file of the repository."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def modules():
    """{dotted name: source} of every module of `repro`."""
    return {module_of(path): path.read_text(encoding="utf-8") for path in own("repro")}


def asked_for(node, name, known):
    """Dotted names that one node of a source asks for; name: of the module it stands in. ``from a import b`` asks for
    a.b where that is a module."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    if isinstance(node, ast.ImportFrom):
        package = name if any(other.startswith(f"{name}.") for other in known) else name.rpartition(".")[0]
        base = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
        base = ".".join([*base, *([node.module] if node.module else [])])
        return [inner if (inner := f"{base}.{alias.name}") in known else base for alias in node.names]
    if isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant):
        called = getattr(node.func, "attr", getattr(node.func, "id", ""))
        return [str(node.args[0].value)] if called in ("import_module", "__import__") else []
    return []


def for_types(tree):
    """Nodes of a source that are for whoever checks its types: nothing is imported there when it runs."""
    blocks = [node for node in ast.walk(tree) if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"]
    return {inner for block in blocks for part in block.body for inner in ast.walk(part)}


def links(sources, types=True):
    """{module: modules of `repro` that it imports}, wherever in its text, for types too or not; the package `repro`
    itself imports names when they are asked for."""
    known, found = set(sources), {}
    for name, source in sources.items():
        tree = ast.parse(source)
        left_out = set() if types else for_types(tree)
        nodes = [node for node in ast.walk(tree) if node not in left_out]
        every = [asked for node in nodes for asked in asked_for(node, name, known)]
        found[name] = {asked for asked in every if asked.split(".")[0] == "repro"} - {name}
    return {name: found[name] for name in found if name != "repro"}


def room_of(module):
    """The room that a module is in; empty for `repro` itself."""
    return (module.split(".") + [""])[1]


def out_of_order(sources):
    """Imports (module, imported) of a room that does not come before, or that is closed to the module's."""
    found = []
    for module, wanted in links(sources).items():
        here = room_of(module)
        place = ROOMS.index(here) if here in ROOMS else len(ROOMS) * (here == "__main__")
        before = {here, *ROOMS[:place]} - CLOSED.get(here, set())
        found += [(module, other) for other in sorted(wanted) if room_of(other) not in before]
    return found


def circle(sources):
    """Modules of which each imports the one before it, the first the last, if there are such."""
    try:
        TopologicalSorter(links(sources, types=False)).prepare()
    except CycleError as found:
        return found.args[1]
    return []


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
    assert {str(path): names for path, names in found.items() if names & FORBIDDEN[folder]} == {}


@pytest.mark.parametrize("folder, source", [
    ("reference", "import repro.model.flow"),
    ("reference", "def f():\n    from repro import flow"),
    ("repro", "from verification.claims import judge"),
    ("repro", "import numpy, tests"),
    ("repro", "import importlib\nimportlib.import_module('reference.poiseuille')"),
    ("verification", "import pickle"),
])
def test_the_rules_see_a_trespass(folder, source):
    assert len(imported(source) & FORBIDDEN[folder]) == 1


@pytest.mark.parametrize("made", [
    "paper_figures/out/crate/tests", "verification/report/live", "repro/__pycache__"])
def test_what_commands_make_is_not_judged(made, tmp_path):
    """A file beside it is."""
    folder = made.partition("/")[0]
    for place in (made, folder):
        (tmp_path / place).mkdir(parents=True, exist_ok=True)
        (tmp_path / place / "one.py").write_text("import pickle, hypothesis")
    assert [*imports(folder, tmp_path)] == [tmp_path / folder / "one.py"]


def test_repro_has_the_rooms_that_it_is_to_have():
    """Each of them is there, nothing else is but what starts the package."""
    top = {path.stem for path in (ROOT / "repro").iterdir() if path.suffix == ".py" or (path / "__init__.py").exists()}
    assert top == {*ROOMS, "__init__", "__main__"}


def test_rooms_import_those_before_them_alone():
    assert out_of_order(modules()) == []


def test_no_module_imports_itself_by_way_of_others():
    assert circle(modules()) == []


@pytest.mark.parametrize("module, source", [
    ("repro.fem.mesh", "from repro.scene import Scene"),
    ("repro.fem.mesh", "from ..scene import keys"),
    ("repro.scene.keys", "def f():\n    from repro.fem.mesh import Mesh"),
    ("repro.results", "from .check import numbers\nfrom ..check import numbers"),
    ("repro.model.flow", "from importlib import import_module\nimport_module('repro.cli')"),
    ("repro.run.folder", "from repro import solve"),
    ("repro.utils", "from repro import errors"),
])
def test_the_order_of_rooms_sees_a_trespass(module, source):
    sources = modules()
    changed = sources | {module: sources.get(module, "") + "\n" + source}
    assert [name for name, _ in out_of_order(changed)] == [module]


@pytest.mark.parametrize("module, source", [
    ("repro.fem.elements", "def f():\n    from repro.fem.transfer import located"),
    ("repro.model.growth", "from . import contact"),
])
def test_the_search_for_circles_sees_one(module, source):
    sources = modules()
    assert module in circle(sources | {module: sources[module] + "\n" + source})


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


@pytest.mark.parametrize("lock", LOCKS, ids=["all", "mutants"])
def test_the_lock_holds_pins_and_hashes_and_no_address(lock):
    assert faults(lock) == []
    blocks = re.split(r"^(?=[a-z0-9-]+==)", lock, flags=re.M)[1:]
    assert len(blocks) > 1 and all("--hash=sha256:" in block for block in blocks)


@pytest.mark.parametrize("line", [
    "--index-url https:" + "//example.org/simple",
    "# --find-links /some/folder",
    "numpy @ file:" + "///some/folder/numpy.whl",
    "numpy>=2.4 \\",
])
def test_the_lock_check_sees_a_fault(line):
    assert line in faults(LOCKS[0] + line + "\n")


@pytest.mark.parametrize("lock, extras", [(LOCKS[0], {*EXTRAS} - {"fast", "mutation"}), (LOCKS[1], {"mutation"})],
                         ids=["all", "mutants"])
def test_the_lock_pins_every_direct_dependency_within_its_bounds(lock, extras):
    """Of mutants made by machine apart; what is optional for speed is in none."""
    pins = {}
    for name, pinned in PIN.findall(lock):
        pins.setdefault(name, []).append(version(pinned))
    everywhere = [] if extras == {"mutation"} else RUNTIME + PROJECT["build-system"]["requires"]
    for requirement in everywhere + [requirement for name in extras for requirement in EXTRAS[name]]:
        lowest = version(re.search(r">=([\d.]+)$", requirement)[1])
        assert min(pins.get(name_of(requirement), [()])) >= lowest, requirement


def test_lines_of_the_package_are_short():
    """At most 100 columns."""
    long = [f"{path.name}:{number}" for path in own("repro")
            for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1) if len(line) > 100]
    assert long == []
