"""The registry: every verification case, read from the marks of the test functions in ``verification/cases``.

A case is a test function with ``@pytest.mark.case``. Each of its parameter sets is a variant. The fields of the mark
are those of :class:`Case` up to ``omitted``. The docstring begins with the claim, and its second paragraph is the norm,
"Norm: ...". A mark that has these fields itself takes precedence.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from inspect import getdoc
from itertools import product
from pathlib import Path
from pkgutil import iter_modules

import pytest

from verification.evidence.writing import ROOT

FOLDER = ROOT / "verification" / "cases"
#: What each kind of case compares with.
KINDS = {"exact": "a closed form", "manufactured": "a solution that was chosen", "cross-code": "another code",
         "property": "a conserved quantity, a symmetry or a limit", "benchmark": "a published problem",
         "validation": "a measurement"}
#: Modules of a stage begin with its name: flow.py, flow_codes.py.
STAGES = ("flow", "transport", "growth", "reprojection", "mesh_motion", "coupling", "hard")
#: Numerics that a case may run with: elements of order 1 and 2, and the presets of whole scenes.
NUMERICS = ("1", "2", "paper", "fast", "accurate", "exact")
#: Labels of variants with the elements of ``fast``. They are slow if the table contains ``fast``.
LIKE_FAST = ("quadratic", "accurate", "exact")
#: The numerics that other words in labels stand for.
OF_WORDS = {"linear": "1", "quadratic": "2", "order 1": "1", "order 2": "2", "straight": "1", "curved": "2"}


@dataclass(frozen=True)
class Case:
    """A verification case.

    Parameters
    ----------
    id : str
        The stage and the name, "flow-poiseuille".
    kind : str
        One of KINDS.
    claim : str
        What holds, in one sentence.
    norm : str
        What is measured and how.
    mutants : tuple of str
        Ids of wrong changes of the code. The case must fail with each of them.
    references : tuple of str
        Modules of ``reference`` that it uses.
    runs_with : str
        Names of NUMERICS that it runs with and that no label of its variants contains, separated by spaces.
    omitted : str
        The reason why it does not run with the other numerics.
    file : Path
        The module that it is defined in.
    variants : dict
        {label: test id of pytest}.
    slow_variants : list of str
        Labels of the variants that ``make verify-fast`` leaves out.

    Raises
    ------
    ValueError
        If the kind is unknown, or the claim, the norm or the mutants are missing.

    Examples
    --------
    The mark of a test function gives the fields up to ``omitted``:

    >>> from verification.evidence.cases import Case
    >>> Case("flow-plug", "exact", "a plug slows the flow", "relative error", ("tau-of-water",), runs_with="1").numerics
    ('1',)
    """

    id: str
    kind: str
    claim: str
    norm: str
    mutants: tuple[str, ...]
    references: tuple[str, ...] = ()
    runs_with: str = ""
    omitted: str = ""
    file: Path = FOLDER
    variants: dict[str, str] = field(default_factory=dict)
    slow_variants: list[str] = field(default_factory=list)

    def __post_init__(self):
        if self.kind not in KINDS or not all((self.claim, self.norm, self.mutants)):
            raise ValueError(f"{self.id}: unknown kind, or no claim, norm or mutants")

    @property
    def stage(self) -> str:
        """The stage of its module."""
        return next(stage for stage in STAGES if self.file.stem.startswith(stage))

    @property
    def numerics(self) -> tuple[str, ...]:
        """The names of NUMERICS that it runs with. Raises ValueError if ``runs_with`` has another word."""
        return self._numerics(self.variants)

    @property
    def quick_numerics(self) -> tuple[str, ...]:
        """The names of NUMERICS that ``make verify-fast`` runs it with."""
        quick = [label for label in self.variants if label not in self.slow_variants]
        return self._numerics(quick) if quick else ()

    def _numerics(self, labels: Iterable[str]) -> tuple[str, ...]:
        words = {OF_WORDS.get(word, word) for label in labels for word in label.split(", ")}
        added = {*self.runs_with.split()}
        if not added <= {*NUMERICS}:
            raise ValueError(f"{self.id}: {', '.join(sorted(added - {*NUMERICS}))} are none of {', '.join(NUMERICS)}")
        return tuple(name for name in NUMERICS if name in words | added)


def parametrize(names: str, variants: Mapping[str, tuple], slow: Iterable[str] = ()) -> pytest.MarkDecorator:
    """Parametrize a case over a table, whose labels become the ids of the variants.

    ``make verify-fast`` leaves out slow variants: those with a word of ``slow`` in their labels, and those with the
    elements of ``fast`` in a table that has ``fast``.

    Parameters
    ----------
    names : str
        Names of the arguments, separated by ", ". A last name with a star, as in "bound, *changes", takes the tuple of
        the remaining values.
    variants : dict
        The table, {label: values}: a tuple of one value per name. Commas separate the words of a label.
    slow : iterable of str
        Words of the labels of further slow variants.

    Returns
    -------
    pytest.MarkDecorator
        The mark ``pytest.mark.parametrize`` for the test function.

    Examples
    --------
    >>> from verification.evidence.cases import parametrize
    >>> @parametrize("order, bound", {"linear": (1, 1e-2), "quadratic": (2, 1e-4)})
    ... def test_norm(order, bound, record):
    ...     ...
    >>> [variant.id for variant in test_norm.pytestmark[0].args[1]]
    ['linear', 'quadratic']
    """
    *first, last = names.split(", ")
    rows = {label: (*row[:len(first)], row[len(first):]) if last[0] == "*" else row for label, row in variants.items()}
    words = {word for label in rows for word in label.split(", ")}
    slow_words = {*slow, *(LIKE_FAST if "fast" in words else ())}
    sets = [pytest.param(*row, id=label, marks=pytest.mark.slow if slow_words & {*label.split(", ")} else ())
            for label, row in rows.items()]
    return pytest.mark.parametrize([*first, last.lstrip("*")], sets)


def combined(*axes: Mapping[str, object]) -> dict[str, tuple]:
    """Return {label: values} of every combination of some axes {label: value}."""
    rows = [zip(*chosen) for chosen in product(*map(dict.items, axes))]
    return {", ".join(labels): values for labels, values in rows}


def label_of(id: str, parameters: str) -> str:
    """Return the label of a variant, given the id that pytest makes of its parameters.

    A table of cases begins the label with the id of the case.
    """
    return parameters.removeprefix(f"{id}, ")


@cache
def cases() -> dict[str, Case]:
    """All cases by id, in the order of the stages. Raises ValueError if two have the same id."""
    modules = [import_module(f"verification.cases.{module.name}") for module in iter_modules([FOLDER])]
    known: dict[str, Case] = {}
    for case in (case for module in modules for function in vars(module).values() for case in _cases_of(function)):
        if case.id in known:
            raise ValueError(f"{case.id}: two cases have this id")
        known[case.id] = case
    return dict(sorted(known.items(), key=lambda item: (STAGES.index(item[1].stage), item[0])))


def _cases_of(function) -> Iterator[Case]:
    """Yield the cases of a test function: its own case, or those in the marks of its parameter sets."""
    marks = getattr(function, "pytestmark", ())
    groups: dict[str, Case] = {}
    for parameters, set_marks in _parameter_sets(marks):
        names = {mark.name: mark for mark in (*marks, *set_marks)}
        if "case" in names:
            id = names["case"].args[0]
            file = Path(function.__code__.co_filename)
            fields = {**_documented(function), **names["case"].kwargs}
            case = Case(id, **fields, file=file)
            case = groups.setdefault(id, case)
            label = label_of(id, parameters)
            test = f"{file.relative_to(ROOT)}::{function.__name__}" + (f"[{parameters}]" if parameters else "")
            case.variants[label] = test
            if "slow" in names:
                case.slow_variants.append(label)
    yield from groups.values()


def _documented(function) -> dict[str, str]:
    """Read the claim and the norm from the docstring of a test function."""
    paragraphs = (getdoc(function) or "").split("\n\n")
    claim, norm = (" ".join(text.split()).removesuffix(".") for text in (*paragraphs, "")[:2])
    return {"claim": claim, "norm": norm.removeprefix("Norm: ")}


def _parameter_sets(marks: Iterable) -> Iterator[tuple[str, list]]:
    """Yield the id that pytest makes of each set of parameters of a function, and the marks of this set."""
    axes = [mark.args[1] for mark in marks if mark.name == "parametrize"]
    for chosen in product(*axes):
        ids = [str(getattr(value, "id", value)) for value in chosen]
        yield "-".join(ids), [mark for value in chosen for mark in getattr(value, "marks", ())]
