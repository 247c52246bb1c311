"""The points of a sweep: the factors of ``--vary``, combined in a grid or a Latin hypercube.

Two forms: a range ``flow.mean_velocity=0.3:30 m/day:log:8`` (both ends in the unit that follows;
``linear`` or ``log``; number of values), and a list ``pore.width=50 um, 60 um`` or
``numerics.preset=fast, paper``. A Latin hypercube takes its ranges without the number of values.
"""

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from repro.scene import (
    KEYS,
    Scene,
    SceneError,
    Source,
    bodies,
    load_tables,
    parse_scene,
    scene_hash,
)
from repro.scene import label as label_of
from repro.scene.files import key_of, override
from repro.scene.reading import quote
from repro.scene.units import DIGITS

MOST_POINTS = 10_000
#: A scene has one of these keys: varying it replaces the others.
DRIVES = ("flow.head", "flow.mean_velocity", "flow.rate")
EXPECTED_FORM = ('KEY=a:b UNIT:linear|log:N or KEY=VALUE, VALUE, ... is needed, such as '
                 '"flow.mean_velocity=0.3:30 m/day:log:8" or "pore.width=50 um, 60 um"')


@dataclass(frozen=True)
class Factor:
    """A varied key: its values are numbers in `unit` ("" without one), or words.

    The values of a range are its two ends.
    """

    key: str
    unit: str
    values: tuple[Any, ...]  # all floats, or all str
    spacing: str = "list"  # or "linear", "log"
    count: int | None = None  # of a range in a grid

    @property
    def is_range(self) -> bool:
        """Are the values the ends of a range?"""
        return self.spacing != "list"

    @property
    def is_log(self) -> bool:
        """Is it a logarithmic range?"""
        return self.spacing == "log"

    @property
    def numeric(self) -> bool:
        """Are the values numbers?"""
        return not isinstance(self.values[0], str)

    @property
    def column(self) -> str:
        """Name of its column, such as ``flow.mean_velocity_m_per_d``.

        Units are spelled as in the columns of results.
        """
        unit = re.sub(r"\s*/\s*", "_per_", re.sub(r"\bday\b", "d", self.unit))
        unit = re.sub(r"[\s*^]+", "", unit).strip("_")
        return f"{self.key}_{unit}" if unit else self.key

    def text(self, value: float | str) -> str:
        """A value as in a scene."""
        return f"{value} {self.unit}".strip()

    def short(self, value: float | str) -> str:
        """A value with four digits."""
        return self.text(value if isinstance(value, str) else f"{value:.4g}")


@dataclass(frozen=True)
class Point:
    """One run of a sweep: its number from 1, a value of each factor, and its scene."""

    index: int
    values: tuple[float | str, ...]
    scene: Scene

    @cached_property
    def hash(self) -> str:
        """Hash of its scene."""
        return scene_hash(self.scene)

    @property
    def name(self) -> str:
        """The name of its folder."""
        return f"{self.index:04d}-{self.hash}"


def parse(text: str) -> Factor:
    """Parse an entry of ``--vary``. Raises SceneError if the entry is not a range or a list."""
    key, equals, rest = (part.strip() for part in text.partition("="))
    if not (key and equals and rest):
        raise _refused(text, EXPECTED_FORM)
    return (_range if ":" in rest else _list)(text, key, rest)


def _refused(text: str, accepted: str) -> SceneError:
    return SceneError(f"--vary {quote(text, 100)}: {accepted}")


def _range(text: str, key: str, rest: str) -> Factor:
    low, high, spacing, count = (*(part.strip() for part in rest.split(":", 3)), "", "", "")[:4]
    (start, first_unit), (end, unit) = number(low), number(high)
    if (not (start and end) or first_unit or spacing not in ("linear", "log")
            or not re.fullmatch("[0-9]{0,9}", count)):
        raise _refused(text, EXPECTED_FORM)
    first, last = float(start), float(end)
    if not first < last < math.inf:
        raise _refused(text, "the lower end first, then a higher one, is needed")
    if spacing == "log" and first <= 0:
        raise _refused(text, "ends greater than zero are needed with log")
    if count and int(count) < 2:
        raise _refused(text, "two values or more are needed; one value is a list")
    return Factor(key, unit, (first, last), spacing, int(count) if count else None)


def _list(text: str, key: str, rest: str) -> Factor:
    items = [bare(item.strip()) for item in rest.split(",")]
    (numeric, unit), *others = {(bool(digits), unit) for digits, unit in map(number, items)}
    if "" in items or others:
        raise _refused(text, "values in one and the same unit, or words, are needed")
    if not numeric:
        return Factor(key, "", tuple(items))
    values = tuple(float(number(item)[0]) for item in items)
    if not all(map(math.isfinite, values)):
        raise _refused(text, "finite numbers are needed")
    return Factor(key, unit, values)


def bare(item: str) -> str:
    """An item of a list without the quotes around it."""
    return item[1:-1] if len(item) > 1 and item[0] == item[-1] == '"' else item


def number(text: str) -> tuple[str, str]:
    """The digits and the unit of a text, both empty if it is not a number."""
    match = re.fullmatch(rf"({DIGITS})\s*(.*)", text, re.S)
    return (match[1], match[2]) if match else ("", "")


def levels(factor: Factor) -> list[float | str]:
    """The values of a factor in a grid. Values between the ends of a range have 12 digits."""
    if not factor.is_range:
        return list(factor.values)
    low, high = factor.values
    spaced = np.geomspace if factor.is_log else np.linspace
    spaced_values = spaced(low, high, factor.count or 2).tolist()
    return [low, *(float(f"{value:.12g}") for value in spaced_values[1:-1]), high]


def grid(factors: list[Factor]) -> list[tuple]:
    """All combinations of values; the last factor varies fastest.

    Raises SceneError for a range without a number of values.
    """
    for factor in factors:
        if factor.is_range and factor.count is None:
            raise SceneError(f"--vary {factor.key}: how many values is needed after "
                             f"{factor.spacing}, such as :8, or --samples N for a Latin hypercube")
    if math.prod(factor.count or len(factor.values) for factor in factors) > MOST_POINTS:
        raise SceneError(f"--vary: at most {MOST_POINTS} runs are accepted")
    return list(product(*map(levels, factors)))


def latin(factors: list[Factor], samples: int, seed: int) -> list[tuple]:
    """A Latin hypercube: one value from each of `samples` strata of each range.

    The values of a list are drawn evenly.
    """
    from scipy.stats import qmc

    for factor in factors:
        if factor.count is not None:
            raise SceneError(f"--vary {factor.key}: leave :{factor.count} out, --samples says how "
                             "many runs there are")
    if not 1 <= samples <= MOST_POINTS:
        raise SceneError(f"--samples {samples}: from 1 to {MOST_POINTS} are accepted")
    drawn = qmc.LatinHypercube(len(factors), rng=np.random.default_rng(seed)).random(samples)
    return [tuple(map(at, factors, row.tolist())) for row in drawn]


def at(factor: Factor, fraction: float) -> float | str:
    """The value of a factor at a fraction (0 to 1) of its range or list."""
    if not factor.is_range:
        return factor.values[min(int(fraction * len(factor.values)), len(factor.values) - 1)]
    low, high = factor.values
    if factor.is_log:
        return low * (high / low) ** fraction
    return low + fraction * (high - low)


def points(source: Source, sets: list[str], factors: list[Factor], combinations: list[tuple],
           *, unset: Sequence[str] = (), origin: str = "run") -> list[Point]:
    """Make and check the runs of a sweep; sets, unset: the entries of --set and --unset; origin:
    of the points, which precedes their numbers in messages.

    Raises SceneError, with the number of the run, if a scene is not accepted or equals another one,
    or if a key is both varied and set.
    """
    named = partial(bodies.canonical, load_tables(source, unset=unset))
    _check_keys([named(key_of(entry)) for entry in sets], [named(each.key) for each in factors])
    runs: list[Point] = []
    first: dict[str, int] = {}
    for index, values in enumerate(combinations, 1):
        run_label = f"{origin} {index} ({label(factors, values)})"
        scene = _scene(label_of(source), load_tables(source, sets, unset), factors, values,
                       run_label)
        point = Point(index, values, scene)
        twin = first.setdefault(point.hash, index)
        if twin != index:
            raise SceneError(f"{run_label}: the same scene as run {twin}; each run once is "
                             "accepted")
        runs.append(point)
    return runs


def _check_keys(sets: list[str], varied: list[str]) -> None:
    """Raise SceneError if keys that are set and varied exclude each other."""
    for key, count in Counter(varied).items():
        partners = _others(key)
        if count > 1:
            raise SceneError(f"--vary {key}: one --vary of it is accepted, with all its values")
        for partner in set(partners) & set(varied):
            raise SceneError(f"--vary {key}: it and {partner} exclude each other; one of them is "
                             "accepted")
        if {key, *partners} & set(sets):
            named = " or ".join((key, *partners))
            raise SceneError(f"--set of {named}: it is not accepted beside --vary {key}, which "
                             "replaces it")


def _others(key: str) -> tuple[str, ...]:
    """The keys that a varied one replaces."""
    return tuple(other for other in DRIVES if other != key) if key in DRIVES else ()


def _scene(source: str, tables: dict, factors: list[Factor], values: tuple,
           run_label: str) -> Scene:
    for factor, value in zip(factors, values):
        for other in _others(factor.key):
            section, _, key = other.partition(".")
            if isinstance(tables.get(section), dict):
                tables[section].pop(key, None)
        override(tables, f"{factor.key}={factor.text(value)}", source, KEYS)
    try:
        return parse_scene(tables, Path(source).stem, source)
    except SceneError as error:
        raise SceneError(f"{run_label}: {error.args[0]}") from None


def label(factors: list[Factor], values: tuple) -> str:
    """The value of each factor of a run, as text."""
    return ", ".join(f"{factor.key} = {factor.short(value)}"
                     for factor, value in zip(factors, values))
