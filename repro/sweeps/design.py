"""The points of a sweep: what ``--vary`` asks for, crossed in a grid or drawn as a Latin hypercube.

Two forms: a range ``flow.mean_velocity=0.3:30 m/day:log:8`` (both ends in the unit that follows;
``linear`` or ``log``; how many values), and a list ``pore.width=50 um, 60 um`` or
``numerics.preset=fast, paper``. A Latin hypercube takes its ranges without the number of values.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from repro.scene import (
    KEYS,
    Scene,
    SceneError,
    Source,
    load_tables,
    parse_scene,
    scene_hash,
)
from repro.scene import label as label_of
from repro.scene.files import override
from repro.scene.reading import shown

MOST_POINTS = 10_000
#: Of each pair one is given: varying it replaces the other.
PAIRS = {"flow.head": "flow.mean_velocity", "flow.mean_velocity": "flow.head"}
WANTED = ('KEY=a:b UNIT:linear|log:N or KEY=VALUE, VALUE, ... is needed, such as '
          '"flow.mean_velocity=0.3:30 m/day:log:8" or "pore.width=50 um, 60 um"')
_NUMBER = re.compile(r"([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)\s*(.*)", re.S)


@dataclass(frozen=True)
class Factor:
    """A key that is varied: numbers in `unit` ("" for plain ones), or words.

    A range has two, its ends.
    """

    key: str
    unit: str
    values: tuple[Any, ...]  # all floats, or all str
    spacing: str = "list"  # or "linear", "log"
    count: int | None = None  # of a range in a grid

    @property
    def numeric(self) -> bool:
        """Are the values numbers?"""
        return not isinstance(self.values[0], str)

    @property
    def column(self) -> str:
        """Its name in a table, such as ``flow.mean_velocity_m_per_day``."""
        unit = re.sub(r"[\s*^]+", "", re.sub(r"\s*/\s*", "_per_", self.unit)).strip("_")
        return f"{self.key}_{unit}" if unit else self.key

    def text(self, value: float | str) -> str:
        """A value as a scene writes it."""
        number = value if isinstance(value, str) else repr(value)
        return f"{number} {self.unit}".strip()

    def short(self, value: float | str) -> str:
        """A value for people to read."""
        number = value if isinstance(value, str) else f"{value:.4g}"
        return f"{number} {self.unit}".strip()


@dataclass(frozen=True)
class Point:
    """One run of a sweep: its number from 1, a value of each factor, and its scene."""

    index: int
    values: tuple[float | str, ...]
    scene: Scene

    @cached_property
    def hash(self) -> str:
        """What names its scene."""
        return scene_hash(self.scene)

    @property
    def name(self) -> str:
        """The name of its folder."""
        return f"{self.index:04d}-{self.hash}"


def parse(text: str) -> Factor:
    """The factor that one ``--vary`` names.

    Raises SceneError where it is neither a range nor a list.
    """
    key, equals, rest = (part.strip() for part in text.partition("="))
    if not (key and equals and rest):
        raise _refused(text, WANTED)
    return (_range if ":" in rest else _list)(text, key, rest)


def _refused(text: str, wanted: str) -> SceneError:
    return SceneError(f"--vary {shown(text, 100)}: {wanted}")


def _range(text: str, key: str, rest: str) -> Factor:
    low, high, spacing, count = (*(part.strip() for part in rest.split(":", 3)), "", "", "")[:4]
    (start, other), (end, unit) = _number(low), _number(high)
    if not (start and end) or other:
        raise _refused(text, WANTED)
    if spacing not in ("linear", "log") or not re.fullmatch("[0-9]{0,9}", count):
        raise _refused(text, WANTED)
    first, last = float(start), float(end)
    if not first < last < math.inf:
        raise _refused(text, "the lower end first, then a higher one, is needed")
    if spacing == "log" and first <= 0:
        raise _refused(text, "ends greater than zero are needed with log")
    if count and int(count) < 2:
        raise _refused(text, "two values or more are needed; one value is a list")
    return Factor(key, unit, (first, last), spacing, int(count) if count else None)


def _list(text: str, key: str, rest: str) -> Factor:
    items = [_bare(item.strip()) for item in rest.split(",")]
    numbers = [_number(item) for item in items]
    if "" in items or len({(bool(digits), unit) for digits, unit in numbers}) > 1:
        raise _refused(text, "values in one and the same unit, or words, are needed")
    if not numbers[0][0]:
        return Factor(key, "", tuple(items))
    values = tuple(float(digits) for digits, _ in numbers)
    if not all(map(math.isfinite, values)):
        raise _refused(text, "finite numbers are needed")
    return Factor(key, numbers[0][1], values)


def _bare(item: str) -> str:
    """An item of a list without the quotes around it."""
    return item[1:-1] if len(item) > 1 and item[0] == item[-1] == '"' else item


def _number(text: str) -> tuple[str, str]:
    """The digits and the unit of a text, both empty where it is no number."""
    match = _NUMBER.fullmatch(text)
    return (match[1], match[2]) if match else ("", "")


def levels(factor: Factor) -> list[float | str]:
    """The values that a grid takes of a factor; those between the ends of a range have 12 digits.
    """
    if factor.spacing == "list":
        return list(factor.values)
    low, high = factor.values
    spaced = np.geomspace if factor.spacing == "log" else np.linspace
    found = spaced(low, high, factor.count or 2).tolist()
    return [low, *(float(f"{value:.12g}") for value in found[1:-1]), high]


def grid(factors: list[Factor]) -> list[tuple]:
    """Every combination, the last factor changing first.

    Raises SceneError for a range without a number of values.
    """
    for factor in factors:
        if factor.spacing != "list" and factor.count is None:
            raise SceneError(f"--vary {factor.key}: how many values is needed after "
                             f"{factor.spacing}, such as :8, or --samples N for a Latin hypercube")
    if math.prod(factor.count or len(factor.values) for factor in factors) > MOST_POINTS:
        raise SceneError(f"--vary: at most {MOST_POINTS} runs are accepted")
    return list(product(*map(levels, factors)))


def latin(factors: list[Factor], samples: int, seed: int) -> list[tuple]:
    """A Latin hypercube: each of `samples` strata of each range has one value.

    A list's values are drawn evenly.
    """
    from scipy.stats import qmc

    for factor in factors:
        if factor.count is not None:
            raise SceneError(f"--vary {factor.key}: leave :{factor.count} out, --samples says how "
                             "many runs there are")
    if not 1 <= samples <= MOST_POINTS:
        raise SceneError(f"--samples {samples}: from 1 to {MOST_POINTS} are accepted")
    drawn = qmc.LatinHypercube(len(factors), rng=np.random.default_rng(seed)).random(samples)
    return [tuple(map(_at, factors, row.tolist())) for row in drawn]


def _at(factor: Factor, part: float) -> float | str:
    """The value at a part of the way, from 0 to 1, through a factor."""
    if factor.spacing == "list":
        return factor.values[int(part * len(factor.values))]
    low, high = factor.values
    return low * (high / low) ** part if factor.spacing == "log" else low + part * (high - low)


def points(source: Source, sets: list[str], factors: list[Factor], combinations: list[tuple],
           unset: Sequence[str] = ()) -> list[Point]:
    """The runs of a sweep, each checked; sets, unset: the entries of --set and --unset.

    Raises SceneError, naming the run, where one is not accepted or is another's twin, and where a
    key is given twice.
    """
    _check_keys(sets, [factor.key for factor in factors])
    found: list[Point] = []
    first: dict[str, int] = {}
    for index, values in enumerate(combinations, 1):
        said = label(factors, values)
        tables = load_tables(source, sets, unset)
        scene = _scene(label_of(source), tables, factors, values, f"run {index} ({said})")
        point = Point(index, values, scene)
        twin = first.setdefault(scene_hash(point.scene), index)
        if twin != index:
            raise SceneError(f"run {index} ({said}): the same scene as run {twin}; each run once "
                             "is accepted")
        found.append(point)
    return found


def _check_keys(sets: list[str], varied: list[str]) -> None:
    for key, count in Counter(varied).items():
        other = PAIRS.get(key)
        if count > 1:
            raise SceneError(f"--vary {key}: one --vary of it is accepted, with all its values")
        if other in varied:
            raise SceneError(f"--vary {key}: it and {other} exclude each other; one of them is "
                             "accepted")
        if any(entry.partition("=")[0].strip() in (key, other) for entry in sets):
            both = f"{key} or {other}" if other else key
            raise SceneError(f"--set of {both}: it is not accepted beside --vary {key}, which "
                             "replaces it")


def _scene(source: str, tables: dict, factors: list[Factor], values: tuple, said: str) -> Scene:
    for factor, value in zip(factors, values):
        section, _, key = PAIRS.get(factor.key, "").partition(".")
        if isinstance(tables.get(section), dict):
            tables[section].pop(key, None)
        override(tables, f"{factor.key}={factor.text(value)}", source, KEYS)
    try:
        return parse_scene(tables, Path(source).stem, source)
    except SceneError as error:
        raise SceneError(f"{said}: {error}") from None


def label(factors: list[Factor], values: tuple) -> str:
    """What a run has of each factor, for people to read."""
    return ", ".join(f"{factor.key} = {factor.short(value)}"
                     for factor, value in zip(factors, values))
