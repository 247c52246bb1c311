"""Calls from Python: order and types of arguments, results of runs, errors in its words, bars of progress, help."""

import inspect
import io
from contextlib import redirect_stderr

import numpy as np
import pint
import pytest

import repro
from repro.cli import main
from repro.errors import OutputError
from repro.scene import SceneError
from tests import faults
from tests.strategies import same_arrays

SHORT = ["numerics.preset=fast", "growth.end=0.2 h", "output.every=0.2 h"]
#: Positional arguments of each function that reads a scene or runs one; all others are given by name.
ORDER = {**dict.fromkeys(("solve", "check", "simulate", "load_scene"), ["scene", "overrides"]),
         "run": ["scene", "folder", "overrides"], "resume": ["folder", "overrides"],
         "sweep": ["scene", "vary", "folder", "overrides"], "compare": ["folders", "file"], "load_run": ["folder"]}


@pytest.mark.parametrize("name", ORDER)
def test_arguments_have_one_order(name):
    parameters = inspect.signature(getattr(repro, name)).parameters.values()
    assert [each.name for each in parameters if each.kind is each.POSITIONAL_OR_KEYWORD] == ORDER[name]
    assert all(each.default == () for each in parameters if each.name in ("overrides", "unset"))


def test_a_run_takes_overrides_and_a_list_extends_it(tmp_path):
    """Both return results with status and folder, equal to those of a single run to the later end."""
    first = repro.run("base", tmp_path / "run", SHORT)
    assert (first.status, first.folder, first.time[-1]) == ("completed", tmp_path / "run", 0.2)
    longer = repro.resume(str(tmp_path / "run"), ["growth.end=0.4 h"])
    assert (longer.status, longer.folder, longer.time[-1]) == ("completed", tmp_path / "run", 0.4)
    assert same_arrays(longer, repro.solve("base", [*SHORT, "growth.end=0.4 h"]))
    assert repro.run("base", tmp_path / "run", [*SHORT, "growth.end=0.4 h"]).time[-1] == 0.4
    assert repro.solve("flow_only").folder is None


WRONG = [
    (repro.run, ("base", "out", "growth.end=1 h"), {},
     "run: overrides: a list of str or dict is needed, not 'growth.end=1 h'"),
    (repro.run, ("base", "out", lambda time: None), {},
     "run: overrides: a list of str or dict is needed, not a function"),
    (repro.run, ("base", "out", [1]), {},
     r"run: overrides: a list of str or dict is needed, not \[1\]"),
    (repro.run, (3, "out"), {}, "run: scene: Scene or str or Path or dict is needed, not 3"),
    (repro.run, ("base", "out"), {"progress": print}, "run: progress: bool is needed, not <built-in function print>"),
    (repro.resume, (None,), {}, "resume: folder: str or Path is needed, not None"),
    (repro.solve, ("base",), {"unset": "flow"}, "solve: unset: a list of str is needed, not 'flow'"),
    (repro.sweep, ("base", "pore.width=50 um", "out"), {}, "sweep: vary: a list of str is needed"),
    (repro.sweep, ("base", ["pore.width=50 um"], "out"), {"samples": 2.5}, "sweep: samples: int is needed, not 2.5"),
    (repro.compare, ("out", "both.html"), {}, "compare: folders: a list of str or Path is needed, not 'out'"),
    (repro.simulate, ("base", ((-5, 0), (0, 5), (5, 0))), {}, "simulate: overrides: a list of str or dict is needed"),
]


@pytest.mark.parametrize("function, arguments, keywords, message", WRONG)
def test_a_wrong_type_is_refused_by_the_name_of_its_argument(function, arguments, keywords, message, tmp_path,
                                                             monkeypatch):
    """The message is one line without an address, and nothing is written."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(TypeError, match=f"^{message}") as caught:
        function(*arguments, **keywords)
    assert str(caught.value).isprintable() and " at 0x" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


class Stand:
    """A quantity of another package than pint."""

    magnitude = np.float32(0.25)
    units = "centimeter ** 2 / day"


def test_overrides_are_a_dict_with_values_of_numpy_and_pint(tmp_path):
    """The same scene as from texts, also in a recorded run."""
    changes = {"pore.width": pint.Quantity(0.06, "mm"), "kinetics.maximum_utilization_rate": "4.3 1/day",
               "kinetics.yield_coefficient": np.float64(0.5), "flow.viscosity_ratio": pint.Quantity(500, ""),
               "aggregate.outline": pint.Quantity(np.array([[-5, 0], [0, 5], [5.0, 0]]), "um"),
               "substrates.acceptor.diffusivity": Stand(), "aggregate.smooth": np.bool_(True),
               "substrates.donor.supply": {"table": [["0 h", "5 mg/L"], ["1 h", "6 mg/L"]], "between": "linear"}}
    texts = ["pore.width=60 um", "kinetics.maximum_utilization_rate=4.3 1/day", "kinetics.yield_coefficient=0.5",
             "flow.viscosity_ratio=500", 'aggregate.outline=[["-5 um", "0 um"], ["0 um", "5 um"], ["5 um", "0 um"]]',
             "substrates.acceptor.diffusivity=0.25 cm^2/day", "aggregate.smooth=true",
             'substrates.donor.supply={table=[["0 h", "5 mg/L"], ["1 h", "6 mg/L"]], between="linear"}']
    expected = repro.load_scene("base", texts, unset=["aggregate.radius"])
    assert repro.load_scene("base", changes, unset=["aggregate.radius"]) == expected
    first = repro.run("base", tmp_path / "run", dict(each.split("=") for each in SHORT))
    longer = repro.resume(tmp_path / "run", {"growth.end": pint.Quantity(24, "min")})
    assert (first.time[-1], longer.time[-1]) == (0.2, 0.4)


@pytest.mark.parametrize("changes, message", [
    ({"pore.width": None}, "overrides: pore.width: a text with a unit, a number, true or false, a list, or a value "
                           "of NumPy or pint is needed, not NoneType"),
    ({5: "um"}, "overrides: the key 5: a text such as pore.width is needed")])
def test_a_dict_of_overrides_without_meaning_is_refused(changes, message):
    with pytest.raises(TypeError, match=f"^load_scene: {message}$"):
        repro.load_scene("base", changes)


def test_errors_name_arguments_in_python_and_options_on_the_command_line(tmp_path, capsys):
    """The same refusals, in the words of each interface."""
    out = tmp_path / "run"
    repro.run("flow_only", out)
    (tmp_path / "foreign").mkdir()
    (tmp_path / "foreign" / "file").touch()
    width = ["pore.width=40 um"]
    for call, words, command, options in (
            (lambda: repro.run("flow_only", out, width), [f"folder {out}", "or force=True"],
             ["run", "flow_only", "--out", str(out), "--set", *width], [f"--out {out}", "or --force"]),
            (lambda: repro.run("flow_only", tmp_path / "foreign"), ["folder "],
             ["run", "flow_only", "--out", str(tmp_path / "foreign")], ["--out "]),
            (lambda: repro.solve("base", ["pore"]), ['overrides "pore"'],
             ["check", "base", "--set", "pore"], ['--set "pore"']),
            (lambda: repro.solve("base", unset=["pore.with"]), ['unset "pore.with"'],
             ["check", "base", "--unset", "pore.with"], ['--unset "pore.with"']),
            (lambda: repro.sweep("base", ["pore.width=1:2 um:log"], out), ["vary pore.width", "or samples N"],
             ["sweep", "base", "--vary", "pore.width=1:2 um:log", "--out", str(out)], ["--vary ", "or --samples N"])):
        with pytest.raises((OutputError, SceneError)) as caught:
            call()
        assert all(word in str(caught.value) for word in words) and "--" not in str(caught.value)
        assert main(command) == 2 and all(option in capsys.readouterr().err for option in options[:1])
        assert all(option in caught.value.args[0] for option in options)


@pytest.mark.exact_lengths
@pytest.mark.parametrize("call, reached", [
    (lambda folder, **keywords: repro.run("base", folder / "run", SHORT, **keywords), "0.2 of 0.2 h"),
    (lambda folder, **keywords: repro.solve("flow_only", **keywords), "100%"),
    (lambda folder, **keywords: repro.sweep("flow_only", ["pore.width=40 um, 50 um"], folder / "sweep", workers=1,
                                            **keywords), "2 of 2 runs")])
def test_a_bar_is_shown_if_it_is_asked_for(call, reached, tmp_path, monkeypatch):
    """Without it, nothing is printed and tqdm.auto is not imported."""
    with redirect_stderr(io.StringIO()) as shown:
        call(tmp_path, progress=True)
    assert reached in shown.getvalue()
    faults.remove_package(monkeypatch, "tqdm.auto")
    with redirect_stderr(io.StringIO()) as shown:
        call(tmp_path)
    assert shown.getvalue() == ""
