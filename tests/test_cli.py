"""The command line: its output and its refusals."""

import inspect
import os
import re
from pathlib import Path

import numpy as np
import pytest

import repro
from repro import results
from repro.cli import COMMANDS, _parser, main
from repro.cli.docs import PAGES
from repro.runs.execution import Watch
from repro.sweeps.driver import run_plan
from tests.shell import refusal, start


def options_of(command):
    """The options of a command."""
    parser = next(action for action in _parser()._actions if action.dest == "command").choices[command]
    return [action for action in parser._actions if action.dest != "help"]


#: Functions of Python with the parameters that a command has as options.
FUNCTIONS = {"sweep": [repro.sweep, run_plan], "run": [Watch, repro.run, repro.resume], "plot": [repro.Results.plot],
             "check": [repro.check, repro.error], "compare": [repro.compare]}
#: Parameters that are options of another name.
NAMES = {"interval": "checkpoint"}


@pytest.mark.parametrize("command", FUNCTIONS)
def test_a_default_is_the_same_in_the_help_the_command_and_python(command):
    """The help states each default that is a number. An empty list of options is an empty tuple in Python."""
    options = {action.dest: action for action in options_of(command)}
    for name, option in options.items():
        number = re.search(r"\(default: ([\d.]+|%\(default\)g)\)", option.help)
        assert bool(number) == isinstance(option.default, int | float) or option.default is False, name
        assert not number or number[1] in ("%(default)g", f"{option.default:g}"), name
    for function in FUNCTIONS[command]:
        for name, parameter in inspect.signature(function).parameters.items():
            option = options.get(NAMES.get(name, name))
            if option and parameter.default is not inspect.Parameter.empty:
                assert parameter.default == option.default or not (parameter.default or option.default), name


def test_unset_and_set_combine(tmp_path, capsys):
    """This holds for the commands that show or check a scene."""
    changes = ["--unset", "flow.head", "--unset", "growth", "--set", "flow.mean_velocity=1 m/day"]
    assert main(["scene", "base", *changes]) == 0
    text = capsys.readouterr().out
    assert '\n#head = "1e-3 cm"\n' in text and '\nmean_velocity = "1 m/day"\n' in text and "\n#[growth]\n" in text
    shut = ["--set", "substrates.boundary=shut"]
    assert "substrates.boundary" in refusal(tmp_path, capsys, "check", "base", *changes, *shut)
    assert main(["check", "initial_mesh", "--unset", "aggregate"]) == 0
    assert "no aggregate: a clean channel" in capsys.readouterr().out
    message = refusal(tmp_path, capsys, "check", "initial_mesh", "--unset", "flow")
    assert message == 'repro: initial_mesh: --unset "flow": the scene does not set it\n'


def write_to(out, *arguments):
    """Return exit status and stderr of `repro ARGUMENTS`, whose standard output is a file."""
    with start(*arguments, stdout=out) as process:
        stderr = process.communicate(timeout=60)[1]
    return process.returncode, stderr


def test_a_closed_output_is_no_failure():
    """The output is closed as by `| head -0`. All commands print with one function; `test_progress.py` has runs."""
    end, pipe = os.pipe()
    os.close(end)
    assert write_to(pipe, "scene", "base") == (0, "")
    os.close(pipe)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device that takes nothing is needed")
@pytest.mark.parametrize("arguments, message", [
    (["scene", "base"], "standard output: No space left on device"),
    (["run", "nowhere", "--out", "x", "--json"], "nowhere: neither a file nor a packaged scene")])
def test_a_failed_write_is_reported_in_one_line(arguments, message):
    """A full disk is a failure."""
    with open("/dev/full", "w") as full:
        status, stderr = write_to(full, *arguments)
    assert status == 2 and stderr.count("\n") == 1 and stderr.startswith(f"repro: {message}")


def test_a_table_has_plain_numbers(tmp_path):
    """Every field is a Python number or empty, also in runs: the case hard-family reads their tables."""
    results.write_table(tmp_path / "t.csv", ["a"], [[np.float64(0.1)], [0.1], [np.int64(3)], [None]])
    assert (tmp_path / "t.csv").read_text() == "a\n0.1\n0.1\n3\n\"\"\n"


def test_a_bare_command_prints_its_help(capsys):
    assert main([]) == 0
    printed, errors = capsys.readouterr()
    assert printed.startswith("usage: repro ") and not errors
    assert all(module.__name__.rpartition(".")[2] in printed for module in COMMANDS)


@pytest.mark.parametrize("page", PAGES)
def test_printed_pages_have_no_links_to_files(page, capsys):
    """A terminal cannot follow them. Each names a file of the repository that exists. Formulas have no signs of TeX."""
    assert main(["docs", page]) == 0
    text = capsys.readouterr().out
    assert not re.search(r"[$\\]", text) and (page != "scope" or "the modulus mu_L theta^{-2/3}" in text)
    assert not re.search(r"\]\((?!https?:)", text)
    files = re.findall(r"\(docs/([^)#]+)\S* in the repository\)", text)
    assert all((Path("docs") / name).exists() for name in files) and (files or page != "scope")
