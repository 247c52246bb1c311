"""What a run needs of its machine: packages and memory; and the modules that a command imports, by name and not by
time."""

import ast
import json
import re
import sys
from pathlib import Path

import pytest

import repro
from repro.cli import main
from repro.fem import linear
from repro.march.simulation import simulate
from repro.model.meshing import seeded
from repro.preflight import memory
from repro.preflight.checked import check
from repro.runs import execution, machine
from repro.scene import load_scene
from tests import faults
from tests.pages import run
from tests.shell import SHORT, files, read_record, refusal, run_and_wait, run_python

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="for Linux alone")


@pytest.mark.parametrize("command", [["run", "base"], ["sweep", "base", "--vary", "pore.width=50 um, 60 um"]])
def test_an_absent_package_is_reported_before_anything_is_written(tmp_path, capsys, monkeypatch, command):
    """The command prints one line, exits with status 2 and makes no folder."""
    faults.remove_package(monkeypatch, "pypardiso")
    message = 'base: numerics.solver = "pardiso": the package pypardiso is not installed; pip install pypardiso'
    out = tmp_path / "out"
    assert message in refusal(tmp_path, capsys, *command, "--set", "numerics.solver=pardiso", "--out", out)


@pytest.mark.parametrize("name, sets", [
    ("base", ["preset=paper"]), ("base", ["preset=paper", "refinement=2"]), ("base", ["preset=fast"]),
    ("base", ["preset=fast", "refinement=1"]), ("base", ["preset=accurate"]),
    ("base", ["preset=paper", "gradation=0", "refinement=0.4"]), ("base", ["preset=paper", "extent=full"]),
    ("flow_only", ["preset=paper", "refinement=2"]), ("wide", ["preset=accurate"])])
def test_the_estimated_nodes_are_those_of_the_mesh(name, sets):
    """At t = 0, within a factor of 1.5."""
    end = [] if name == "flow_only" else ["growth.end=0 h"]
    scene = load_scene(name, [*(f"numerics.{entry}" for entry in sets), *end])
    nodes = len(seeded(scene).mesh.points)
    assert nodes / 1.5 < memory.expected_nodes(scene) < 1.5 * nodes


@LINUX
@pytest.mark.thorough
def test_the_estimated_memory_is_what_a_run_uses():
    """The increase from a coarse to a fine mesh agrees within a factor of 1.5 with that of a process's peak (kB)."""
    code = ("import sys; from pathlib import Path; from repro import load_scene, simulate; "
            "list(simulate(load_scene('base', sys.argv[1:]))); "
            "print(Path('/proc/self/status').read_text().partition('VmHWM:')[2].split()[0])")
    estimated, measured = [], []
    for refinement in (1, 4):
        changes = [f"numerics.refinement={refinement}", "growth.end=12 min"]
        estimated.append(check(load_scene("base", changes)).cost.memory)
        measured.append(int(run_python(code, *changes).stdout) * 1024 / 1e6)
    difference = estimated[1] - estimated[0]
    assert (measured[1] - measured[0]) / 1.5 < difference < 1.5 * (measured[1] - measured[0])


def test_a_run_that_may_use_over_half_of_the_memory_gives_a_warning(tmp_path, capsys, monkeypatch):
    """--quiet and --json show the warning as well, and the run goes on."""
    needed = memory.expected_bytes(load_scene("flow_only"))
    for factor, warned in ((2.1, False), (1.9, True)):
        monkeypatch.setattr(memory, "free_bytes", lambda factor=factor: factor * needed)
        run(tmp_path / str(factor), "flow_only", options=["--json"])
        out, err = capsys.readouterr()
        events = [json.loads(line) for line in out.splitlines()]
        assert (err.startswith("repro: warning: flow_only: about ")) == warned == (events[0]["event"] == "warning")
        assert [warning.key for warning in check("flow_only").warnings] == ["numerics.refinement"] * warned


@pytest.mark.parametrize("command", ["check", "run"])
def test_check_and_run_refuse_a_scene_that_needs_too_much_memory(tmp_path, capsys, monkeypatch, command):
    monkeypatch.setattr(memory, "free_bytes", lambda: 0.9 * memory.expected_bytes(load_scene("flow_only")))
    out = ["--out", tmp_path / "run"] if command == "run" else []
    message = refusal(tmp_path, capsys, command, "flow_only", *out)
    assert re.search(r" MB are free; (numerics\.refinement = [\d.]+ needs at most half|no num)", message)


def write_group(root, path, **content):
    (root / path).mkdir(parents=True, exist_ok=True)
    for name, text in content.items():
        (root / path / name.replace("_", ".", 1)).write_text(f"{text}\n")


def test_free_memory_is_the_least_that_any_limit_leaves(tmp_path):
    """The limits of the system, of the process's control group and of its parents count, in both versions of control
    groups. Memory of cached files counts as free."""
    (tmp_path / "proc/self").mkdir(parents=True)
    assert memory.free_bytes(tmp_path) > 1e15
    (tmp_path / "proc/meminfo").write_text("MemTotal: 9 kB\nMemAvailable:   2000000 kB\n")
    assert memory.free_bytes(tmp_path) == 2000000 * 1024
    (tmp_path / "proc/self/cgroup").write_text("4:memory:/jobs/one\n3:cpu:/\n0::/user/two\n")
    write_group(tmp_path, "sys/fs/cgroup/user/two", memory_max="max", memory_current=10)
    assert memory.free_bytes(tmp_path) == 2000000 * 1024
    write_group(tmp_path, "sys/fs/cgroup/user", memory_max=1_000_000_000, memory_current=300_000_000,
          memory_stat="anon 1\ninactive_file 100000000")
    assert memory.free_bytes(tmp_path) == 800_000_000
    write_group(tmp_path, "sys/fs/cgroup/memory/jobs/one", memory_limit_in_bytes=500_000_000,
          memory_usage_in_bytes=100_000_000, memory_stat="total_inactive_file 50000000")
    assert memory.free_bytes(tmp_path) == 450_000_000
    write_group(tmp_path, "sys/fs/cgroup/memory", memory_limit_in_bytes=50, memory_usage_in_bytes=100)
    assert memory.free_bytes(tmp_path) == 0


@LINUX
def test_a_limit_of_address_space_leaves_its_unused_part(tmp_path, monkeypatch):
    """The first number of statm, the size of the address space, counts; the resident size does not."""
    resource = pytest.importorskip("resource")
    (tmp_path / "proc/self").mkdir(parents=True)
    (tmp_path / "proc/self/statm").write_text("5000 300 200 1 0 700 0\n")
    most = 10_000 * resource.getpagesize()
    monkeypatch.setattr(resource, "getrlimit", lambda kind: (most, resource.RLIM_INFINITY))
    assert memory.free_bytes(tmp_path) == most / 2


def hashes_of(folder, monkeypatch, texts):
    """Yield the hash of the source after each of these modules is written."""
    monkeypatch.setattr(machine, "__file__", str(folder / "run" / "machine.py"))
    for name, text in texts:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
        yield machine.source_hash.__wrapped__()


def test_the_hash_covers_every_statement_that_computes_numbers(tmp_path, monkeypatch):
    """Each text of a module has its own hash, and so has a module of another name."""
    names = ("scene/keys.py", "fem/mesh.py", "model/flow.py", "model/more/deep.py", "schemes/paper.py", "march/loop.py",
             "results/columns.py")
    texts = [(name, text) for name in names for text in ("a = 1", "a = 2", "a = '# 2'", 'a = """\n# 2"""')]
    assert len({*hashes_of(tmp_path, monkeypatch, texts)}) == len(texts)
    (tmp_path / "model/flow.py").rename(tmp_path / "model/glow.py")
    assert len({*hashes_of(tmp_path, monkeypatch, [*texts[-1:], *texts[8:9]])}) == 2


def test_comments_and_rooms_without_numbers_do_not_change_the_hash(tmp_path, monkeypatch):
    """Docstrings, comments and empty lines; pages, the command line, and the files of runs."""
    plain = 'def f():\n    """Return a."""\n    return "#a"\n'
    revised = '# of f\ndef f():  # here\n    """Return "a", the letter.\n\n    Of a text.\n    """\n\n    return "#a"\n'
    texts = [("fem/mesh.py", plain), ("fem/mesh.py", revised)]
    texts += [(name, "a = 1") for name in ("report/charts.py", "cli/run.py", "run/folder.py", "sweep/pool.py")]
    assert len({*hashes_of(tmp_path, monkeypatch, texts)}) == 1


def without_docstrings(source):
    """The syntax tree of a source, with ... for each docstring."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)) and ast.get_docstring(node) is not None:
            node.body[0] = ast.Expr(ast.Constant(...))
    return ast.dump(tree)


def test_no_statement_of_the_source_is_lost():
    """The syntax tree is the same in every module that is hashed."""
    package = Path(repro.__file__).parent
    paths = [path for room in machine.ROOMS for path in (package / room).rglob("*.py")]
    for path in paths:
        source = path.read_text(encoding="utf-8")
        assert without_docstrings(source) == without_docstrings(machine.statements(source)), path
    assert len(paths) > 40


def limited(kind, most, *arguments):
    """Exit status and standard error of `repro run ARGUMENTS` under a resource limit."""
    resource = pytest.importorskip("resource", reason="a system with limits is needed")
    limit = lambda: resource.setrlimit(getattr(resource, kind), (most, most))  # noqa: E731
    status, _, message = run_and_wait(*arguments, preexec_fn=limit)
    return status, message


@LINUX
def test_a_limit_of_address_space_ends_a_run_in_one_line(tmp_path):
    """The run is refused with both numbers before it writes a file."""
    status, message = limited("RLIMIT_AS", 1000 << 20, "base", "--set", "numerics.refinement=10", "--out",
                              tmp_path / "run")
    assert status == 2 and message.count("\n") == 1 and list(tmp_path.iterdir()) == []
    assert re.search(r"about \d+ MB of memory are needed.* \d+ MB are free", message), message


@pytest.mark.thorough
@LINUX
@pytest.mark.parametrize("most, which", [(0, ""), (500, ""), (8_000, ""), (20_000, "fields_0000.vtu: "), (40_000, ""),
                                         (100_000, "report.html: ")])
def test_a_limit_of_file_sizes_ends_a_run_in_one_line(tmp_path, most, which):
    """Any file may be the one that cannot grow: fields are the first above 20 kB, the page of a finished run the last.
    Without the limit the run goes on to its end, by either command, and has all files that it lists."""
    arguments = [*SHORT, "--set", 'growth.end="0.4 h"', "--out", str(tmp_path / "run"), "--quiet"]
    status, message = limited("RLIMIT_FSIZE", most, *arguments)
    assert status == 2 and f"{which}File too large" in message and message.count("\n") == 1, message
    assert message.endswith("and use --resume\n" if (tmp_path / "run" / "run.json").exists() else
                            "and repeat the command\n")
    unfinished = ("writing", "part", "vtu") if "fields" in which else ("writing", "part")
    assert not [name for name in files(tmp_path / "run") if any(word in name for word in unfinished)]
    assert main(["run", *(["--resume", str(tmp_path / "run"), "--quiet"] if which else arguments)]) == 0
    assert all((tmp_path / "run" / name).is_file() for name in read_record(tmp_path / "run")["files"])


def test_lack_of_memory_outside_of_the_steps_is_reported_in_one_line(tmp_path, capsys, monkeypatch):
    def raise_memory_error(*_):
        raise MemoryError("Unable to allocate 1 GiB")

    monkeypatch.setattr(execution, "run", lambda *_, **__: raise_memory_error())
    run(tmp_path, "flow_only", status=1)
    assert capsys.readouterr().err == ("repro: out of memory (Unable to allocate 1 GiB); try a smaller "
                                       "numerics.refinement\n")


#: Modules that no command and no run imports, although they are installed; each takes 0.05 to 0.5 s.
NEVER = {"matplotlib", "pandas", "xarray", "h5py", "scipy.interpolate", "scipy.optimize", "scipy.special",
         "scipy.spatial", "scipy.integrate", "scipy.stats", "pint", "skfem.visuals", "sympy", "distributed"}
#: Modules that only runs and checks import.
SOLVER = {"numpy", "scipy", "skfem", "mmgpy", "shapely"}
#: Modules that a run imports for its first file of fields; meshio imports rich.
FILES = {"meshio", "rich"}
COMMAND = """
import sys
from repro.cli import main
try:
    main(sys.argv[1:])
except SystemExit:
    pass
print(*sys.modules, file=sys.stderr)
"""


@pytest.mark.parametrize("arguments, needed", [
    (["--help"], set()), (["sweep", "--help"], set()), (["scene", "base"], set()),
    (["run", "base", "--set", "pore.width=3"], set()), (["check", *SHORT], SOLVER),
    pytest.param(["run", *SHORT, "--set", 'growth.end="3 h"'], SOLVER | FILES, marks=pytest.mark.thorough)])
def test_a_command_imports_only_the_modules_that_it_needs(tmp_path, arguments, needed):
    """A command without a run imports no solver, and one without fields no meshio. The run has remeshes, fields and a
    page."""
    out = ["--out", str(tmp_path / "run")] if arguments[0] == "run" else []
    modules = run_python(COMMAND, *arguments, *out).stderr.split()
    assert {*modules} & (NEVER | SOLVER | FILES) == needed
    assert (tmp_path / "run" / "report.html").exists() is (FILES <= needed)


@pytest.mark.parametrize("preset", ["fast", "paper"])
def test_the_chosen_solver_reaches_every_system(preset, monkeypatch):
    """Flow, transport, growth and mesh motion of a run factorise by no other method."""
    faults.replace_package(monkeypatch, "pypardiso")
    methods = []
    factorise = linear.Solver._first

    def record_method(solver, method):
        methods.append(method)
        return factorise(solver, method)

    monkeypatch.setattr(linear.Solver, "_first", record_method)
    for _ in simulate(load_scene("base", [f"numerics.preset={preset}", "numerics.solver=pardiso",
                                          'growth.end="0.5 h"', 'output.times=["0.5 h"]'])):
        pass
    assert len(methods) > 10 and set(methods) == {linear.Method("pardiso")}
