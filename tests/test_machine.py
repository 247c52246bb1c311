"""What a run needs of the machine that it is on: packages, memory; and what a command imports, told by the names of
modules and never by the clock."""

import ast
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import repro
from repro.cli import main
from repro.march.simulation import simulate
from repro.preflight import memory
from repro.preflight.checked import check
from repro.runs import machine, running
from repro.runs.running import resume
from repro.scene import SceneError, load_scene
from tests import faults
from tests.pages import run
from tests.shell import SHORT, files, refused, shell, stopped, told

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="for Linux alone")
CHOICES = [("numerics.solver=pardiso", "pypardiso"), ("numerics.ordering=metis", "pymetis")]


@pytest.mark.parametrize("entry, package", CHOICES)
@pytest.mark.parametrize("command", [["run", "base"], ["sweep", "base", "--vary", "pore.width=50 um, 60 um"]])
def test_a_package_that_is_not_there_is_told_before_anything_is_written(tmp_path, capsys, monkeypatch, command, entry,
                                                                        package):
    """One line, status 2, no folder."""
    faults.absent_package(monkeypatch, package)
    key, _, choice = entry.partition("=")
    said = f'base: {key} = "{choice}": the package {package} is not installed; pip install {package}'
    assert said in refused(tmp_path, capsys, *command, "--set", entry, "--out", tmp_path / "out")


def test_a_package_that_went_is_told_at_a_resume(tmp_path, monkeypatch):
    scene = load_scene("base", ("numerics.preset=fast", "numerics.ordering=metis"))
    with monkeypatch.context() as there:
        there.setattr(machine, "find_spec", lambda name: name)
        faults.stand_in_package(there, "pymetis")
        stopped(scene, tmp_path, after=1)
    faults.absent_package(monkeypatch, "pymetis")
    with pytest.raises(SceneError, match="pymetis is not installed"):
        resume(tmp_path)


@pytest.mark.parametrize("name, sets", [
    ("base", ["preset=paper"]), ("base", ["preset=paper", "refinement=2"]), ("base", ["preset=fast"]),
    ("base", ["preset=fast", "refinement=1"]), ("base", ["preset=accurate", "elements=cubic"]),
    ("base", ["preset=paper", "gradation=0", "refinement=0.4"]), ("base", ["preset=paper", "extent=full"]),
    ("flow_only", ["preset=paper", "refinement=2"]), ("wide", ["preset=accurate"])])
def test_the_nodes_that_are_expected_are_those_of_the_mesh(name, sets):
    """At t = 0, within a half."""
    end = [] if name == "flow_only" else ["growth.end=0 h"]
    scene = load_scene(name, [*(f"numerics.{entry}" for entry in sets), *end])
    found = len(next(simulate(scene)).pore.mesh.points)
    assert found / 1.5 < memory.expected_nodes(scene) < 1.5 * found


@LINUX
@pytest.mark.thorough
def test_the_memory_that_is_told_is_what_a_run_takes():
    """Over that of a run on a coarse mesh, within a half: the peak of a process of its own (kB)."""
    code = ("import sys; from pathlib import Path; from repro import load_scene, simulate; "
            "list(simulate(load_scene('base', sys.argv[1:]))); "
            "print(Path('/proc/self/status').read_text().partition('VmHWM:')[2].split()[0])")
    told, taken = [], []
    for refinement in (1, 4):
        changes = [f"numerics.refinement={refinement}", "growth.end=12 min"]
        told.append(check(load_scene("base", changes)).cost.memory)
        taken.append(int(subprocess.run([sys.executable, "-c", code, *changes], capture_output=True, text=True,
                                        check=True).stdout) * 1024 / 1e6)
    more = told[1] - told[0]
    assert (taken[1] - taken[0]) / 1.5 < more < 1.5 * (taken[1] - taken[0])


def test_a_run_that_may_take_more_than_half_of_the_memory_is_warned_of(tmp_path, capsys, monkeypatch):
    """Under --quiet and --json too, and runs."""
    needed = memory.expected_bytes(load_scene("flow_only"))
    for factor, warned in ((2.1, False), (1.9, True)):
        monkeypatch.setattr(memory, "free_bytes", lambda factor=factor: factor * needed)
        run(tmp_path / str(factor), "flow_only", options=["--json"])
        out, err = capsys.readouterr()
        events = [json.loads(line) for line in out.splitlines()]
        assert (err.startswith("repro: warning: flow_only: about ")) == warned == (events[0]["event"] == "warning")
        assert [one.key for one in check("flow_only").warnings] == ["numerics.refinement"] * warned


@pytest.mark.parametrize("command", ["check", "run"])
def test_what_takes_more_memory_than_there_is_is_refused_by_check_as_by_run(tmp_path, capsys, monkeypatch, command):
    monkeypatch.setattr(memory, "free_bytes", lambda: 0.9 * memory.expected_bytes(load_scene("flow_only")))
    out = ["--out", tmp_path / "run"] if command == "run" else []
    assert " MB are free; a smaller numerics.refinement is needed" in refused(
        tmp_path, capsys, command, "flow_only", *out)


def group(root, path, **content):
    (root / path).mkdir(parents=True, exist_ok=True)
    for name, text in content.items():
        (root / path / name.replace("_", ".", 1)).write_text(f"{text}\n")


def test_what_is_free_is_the_least_that_anything_leaves(tmp_path):
    """Of the system, of the process's control group and of those above it, in both versions, with files in memory that
    give way."""
    (tmp_path / "proc/self").mkdir(parents=True)
    assert memory.free_bytes(tmp_path) > 1e15
    (tmp_path / "proc/meminfo").write_text("MemTotal: 9 kB\nMemAvailable:   2000000 kB\n")
    assert memory.free_bytes(tmp_path) == 2000000 * 1024
    (tmp_path / "proc/self/cgroup").write_text("4:memory:/jobs/one\n3:cpu:/\n0::/user/two\n")
    group(tmp_path, "sys/fs/cgroup/user/two", memory_max="max", memory_current=10)
    assert memory.free_bytes(tmp_path) == 2000000 * 1024
    group(tmp_path, "sys/fs/cgroup/user", memory_max=1_000_000_000, memory_current=300_000_000,
          memory_stat="anon 1\ninactive_file 100000000")
    assert memory.free_bytes(tmp_path) == 800_000_000
    group(tmp_path, "sys/fs/cgroup/memory/jobs/one", memory_limit_in_bytes=500_000_000,
          memory_usage_in_bytes=100_000_000, memory_stat="total_inactive_file 50000000")
    assert memory.free_bytes(tmp_path) == 450_000_000
    group(tmp_path, "sys/fs/cgroup/memory", memory_limit_in_bytes=50, memory_usage_in_bytes=100)
    assert memory.free_bytes(tmp_path) == 0


@LINUX
def test_a_limit_of_address_space_leaves_what_is_not_taken_of_it(tmp_path, monkeypatch):
    """Of the whole address space, the first number, and not of what is resident."""
    resource = pytest.importorskip("resource")
    (tmp_path / "proc/self").mkdir(parents=True)
    (tmp_path / "proc/self/statm").write_text("5000 300 200 1 0 700 0\n")
    most = 10_000 * resource.getpagesize()
    monkeypatch.setattr(resource, "getrlimit", lambda kind: (most, resource.RLIM_INFINITY))
    assert memory.free_bytes(tmp_path) == most / 2


def hashes_of(folder, monkeypatch, texts):
    """The hash of a source of these modules' texts, by name, one after the other."""
    monkeypatch.setattr(machine, "__file__", str(folder / "run" / "machine.py"))
    for name, text in texts:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
        yield machine.source_hash.__wrapped__()


def test_the_source_is_every_statement_of_the_rooms_that_compute_numbers(tmp_path, monkeypatch):
    """What runs of other code are told apart by; a module of another name is another."""
    names = ("scene/keys.py", "fem/mesh.py", "model/flow.py", "model/more/deep.py", "results/columns.py")
    texts = [(name, text) for name in names for text in ("a = 1", "a = 2", "a = '# 2'", 'a = """\n# 2"""')]
    assert len({*hashes_of(tmp_path, monkeypatch, texts)}) == len(texts)
    (tmp_path / "model/flow.py").rename(tmp_path / "model/glow.py")
    assert len({*hashes_of(tmp_path, monkeypatch, [*texts[-1:], *texts[8:9]])}) == 2


def test_remarks_and_rooms_without_numbers_leave_the_hash(tmp_path, monkeypatch):
    """Docstrings, comments and empty lines; pages, the command line, and how runs are kept."""
    bare = 'def f():\n    """Return a."""\n    return "#a"\n'
    other = '# of f\ndef f():  # here\n    """Return "a", the letter.\n\n    Of a text.\n    """\n\n    return "#a"\n'
    texts = [("fem/mesh.py", bare), ("fem/mesh.py", other)]
    texts += [(name, "a = 1") for name in ("report/charts.py", "cli/run.py", "run/folder.py", "sweep/pool.py")]
    assert len({*hashes_of(tmp_path, monkeypatch, texts)}) == 1


def without_docstrings(source):
    """The syntax tree of a source, with ... for each docstring."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)) and ast.get_docstring(node) is not None:
            node.body[0] = ast.Expr(ast.Constant(...))
    return ast.dump(tree)


def test_the_statements_of_the_source_are_all_of_it():
    """In every module that counts: as Python reads it."""
    package = Path(repro.__file__).parent
    paths = [path for room in machine.ROOMS for path in (package / room).rglob("*.py")]
    for path in paths:
        source = path.read_text(encoding="utf-8")
        assert without_docstrings(source) == without_docstrings(machine.statements(source)), path
    assert len(paths) > 40


def limited(kind, most, *arguments):
    """Exit status and standard error of `repro run ARGUMENTS` where the system allows so much."""
    resource = pytest.importorskip("resource", reason="a system with limits is needed")
    limit = lambda: resource.setrlimit(getattr(resource, kind), (most, most))  # noqa: E731
    status, _, message = shell(*arguments, preexec_fn=limit)
    return status, message


@LINUX
def test_a_limit_of_address_space_ends_a_run_in_one_line(tmp_path):
    """As if there were no more memory: before anything is written, with both numbers."""
    status, message = limited("RLIMIT_AS", 1000 << 20, "base", "--set", "numerics.refinement=10", "--out",
                              tmp_path / "run")
    assert status == 2 and message.count("\n") == 1 and list(tmp_path.iterdir()) == []
    assert re.search(r"about \d+ MB of memory are needed.* \d+ MB are free", message), message


MORE = [pytest.param(size, "", marks=pytest.mark.thorough) for size in (0, 8_000, 40_000)]


@LINUX
@pytest.mark.parametrize("most, which", [(500, ""), (20_000, "fields_0000.vtu: "),
                                         (100_000, "report.html: "), *MORE])
def test_a_limit_of_file_sizes_ends_a_run_in_one_line(tmp_path, most, which):
    """Whichever file it is that may not grow, the first to be longer than 20 kB fields, the last the page of a run that
    is over; with more room the run goes on, which is asked for in either way, until all is there that it lists."""
    asked = [*SHORT, "--set", 'growth.end="0.4 h"', "--out", str(tmp_path / "run"), "--quiet"]
    status, message = limited("RLIMIT_FSIZE", most, *asked)
    assert status == 2 and f"{which}File too large" in message and message.count("\n") == 1, message
    assert message.endswith("and go on with --resume\n" if (tmp_path / "run" / "run.json").exists() else
                            "and give the same command again\n")
    left = files(tmp_path / "run")
    assert not [name for name in left if "writing" in name or "part" in name or "fields" in which and "vtu" in name]
    assert main(["run", *(["--resume", str(tmp_path / "run"), "--quiet"] if which else asked)]) == 0
    assert all((tmp_path / "run" / name).is_file() for name in told(tmp_path / "run")["files"])


def test_want_of_memory_outside_of_the_steps_is_told_in_one_line(tmp_path, capsys, monkeypatch):
    def none_left(*_):
        raise MemoryError("Unable to allocate 1 GiB")

    monkeypatch.setattr(running, "run", lambda *_, **__: none_left())
    run(tmp_path, "flow_only", status=1)
    assert capsys.readouterr().err == ("repro: out of memory (Unable to allocate 1 GiB); try a smaller "
                                       "numerics.refinement\n")


#: What no command and no run needs, whatever is installed; each takes from a twentieth to half a second.
NEVER = {"matplotlib", "pandas", "xarray", "h5py", "scipy.interpolate", "scipy.optimize", "scipy.special",
         "scipy.spatial", "scipy.integrate", "scipy.stats", "pint", "skfem.visuals", "sympy", "distributed"}
#: What a run needs, and a command that runs nothing does not.
SOLVER = {"numpy", "scipy", "skfem", "mmgpy", "shapely"}
#: What a run needs from its first file of fields on; meshio imports rich.
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
    (["run", *SHORT, "--set", 'growth.end="3 h"'], SOLVER | FILES)])
def test_a_command_imports_what_it_needs_alone(tmp_path, arguments, needed):
    """A command that runs nothing needs no solver, and one that writes no fields no meshio; a run has remeshes, fields
    and a page."""
    out = ["--out", str(tmp_path / "run")] if arguments[0] == "run" else []
    done = subprocess.run([sys.executable, "-c", COMMAND, *arguments, *out], capture_output=True, text=True, check=True)
    assert {*done.stderr.split()} & (NEVER | SOLVER | FILES) == needed
    assert (tmp_path / "run" / "report.html").exists() is (FILES <= needed)
