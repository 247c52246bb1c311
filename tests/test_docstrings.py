"""Docstrings of functions that users and contributors call: complete sections, shapes, units, examples that run.

numpydoc validates form and sections. It knows neither units, shapes nor errors: these are checked here.
"""
import ast
import doctest
import inspect
import re
import textwrap
from pkgutil import resolve_name

import pytest
from numpydoc import validate

import repro
from tests.blocks import ROOT
from tests.test_architecture import modules

USERS = [f"repro.{name}" for name in dir(repro)]
METHODS = [f"repro.Results.{name}" for name in (
    "animate", "drawable", "fields", "outline", "plot", "probe", "profile", "to_netcdf", "to_pandas", "to_xarray")]
#: Functions and classes that CONTRIBUTING.md names, and the classes of the entries of the lists that it names.
CONTRIBUTORS = [
    "repro.timing.timed", "repro.errors.StageError", "repro.errors.failing_as", "repro.fem.space.Space",
    "repro.results.quantities.Quantity", "repro.results.quantities.Unit", "repro.results.arrays.Array",
    "repro.report.quantities.Kind",
    "repro.model.uptake_law.UptakeLaw",
    *(f"repro.model.uptake_law.UptakeLaw.{name}"
      for name in ("constants", "fraction", "slope", "largest", "saturates")),
    "repro.scene.units.choice", "verification.evidence.plugin.record",
    "verification.evidence.cases.parametrize", "verification.evidence.cases.Case",
    *(f"verification.evidence.checks.{name}"
      for name in ("at_most", "at_least", "between", "study", "studies", "Check", "Study")),
    "verification.mutants.Mutant", "verification.mutants.changes", "paper_figures.runs.Request"]
PUBLIC = USERS + METHODS + CONTRIBUTORS
#: Examples with runs of a second or more.
LONG = {"repro.Meeting", "repro.resume"}
#: Names in CONTRIBUTING.md that a contributor writes or reads, and does not call. The keys of Substrate, Acceptor and
#: Donor state unit, default, range and source in their entries.
NOT_CALLED = {"caption", "draw", "derived_row", "case", "Substrate", "Acceptor", "Donor", "Stages", "Energy", "Wall"}
#: Checks of numpydoc that do not apply: one sentence can be enough (ES01), and texts link what they name (SA01).
OMITTED = {"ES01", "SA01"}
UNIT = re.compile(r"\bunits?\b|\b(um|um2|h|s|mg/L|L/mg|MPa|m/d|hours)\b", re.I)
SHAPE = re.compile(r"\(\w+,|\bshape\b|\bbroadcast")


def target(name):
    """Return the public object of a name; for a fixture of pytest, its function."""
    return inspect.unwrap(resolve_name(name))


def raises_itself(value):
    """Return whether the body of a function, or of the constructor of a class, has a raise statement."""
    (top,) = ast.parse(textwrap.dedent(inspect.getsource(value))).body
    members = [node for node in top.body if getattr(node, "name", "") in ("__init__", "__post_init__")]
    parts = members if inspect.isclass(value) else [top]
    return any(isinstance(node, ast.Raise) for part in parts for node in ast.walk(part))


def shortcomings(value, must_raise):
    """Return what the docstring of a function or class lacks."""
    document = validate.get_doc_object(value)
    lacking = [f"{code}: {text}" for code, text in validate.validate(document)["errors"] if code not in OMITTED]
    if must_raise and not document["Raises"]:
        lacking.append("no Raises section")
    for entry in (*document["Parameters"], *document["Returns"]):
        text = " ".join([entry.type, *entry.desc])
        is_array = re.search(r"\barray", entry.type)
        if (is_array or "float" in entry.type) and "bool" not in entry.type and not UNIT.search(text):
            lacking.append(f"{entry.name or 'the result'} ({entry.type}) states no unit")
        if is_array and not SHAPE.search(text):
            lacking.append(f"{entry.name or 'the result'} ({entry.type}) states no shape")
    return lacking


@pytest.mark.parametrize("name", PUBLIC)
def test_a_docstring_is_complete(name):
    """All public functions of users read scenes or files, or check numbers: they state their errors."""
    value = target(name)
    must_raise = name in USERS and inspect.isfunction(value) or raises_itself(value)
    assert shortcomings(value, must_raise) == []


@pytest.mark.exact_lengths
@pytest.mark.parametrize("name", [
    pytest.param(name, marks=pytest.mark.thorough if name in LONG else ()) for name in PUBLIC])
def test_the_examples_of_a_docstring_run(name, capsys):
    (document,) = doctest.DocTestFinder(recurse=False).find(target(name), name, globs={})
    result = doctest.DocTestRunner(verbose=False).run(document)
    assert result.attempted > 0
    assert result.failed == 0, capsys.readouterr().out


def test_every_function_that_contributing_names_is_checked():
    """A word in backticks names a function or class if a module defines it at its top."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    source = "".join(modules().values())
    defined = {*re.findall(r"^(?:def|class) (\w+)", source, re.M)}
    named = {*re.findall(r"`@?(\w+)(?:\([^`]*\))?`", text)} & defined
    assert named == NOT_CALLED | named & {name.rpartition(".")[2] for name in PUBLIC}
