"""Own points of a sweep: a CSV file, a table with named columns, or points of the unit cube.

The name of a column is a key with its unit in parentheses, such as ``pore.width (um)``. Values may
have their unit themselves, such as ``50 um``, or be words. Rows count from 1, without the head.
"""

import csv
import math
import re
from collections.abc import Iterable, Mapping
from itertools import zip_longest
from os import PathLike
from typing import Any

import numpy as np

from repro.scene import SceneError
from repro.scene.reading import quote
from repro.scene.units import plain
from repro.sweeps.design import MOST_POINTS, Factor, at, bare, number


def origin(points: Any) -> str:
    """Name points in messages: the path of a file, or the argument."""
    return str(points) if isinstance(points, (str, PathLike)) else "points"


def read(points: Any, factors: list[Factor],
         samples: int | None) -> tuple[list[Factor], list[tuple]]:
    """Return the factors and the values of each point, from points of any kind.

    factors: the ranges of an array or an engine without names. Raises SceneError, in one line with
    row and column, for points that are not accepted.
    """
    columns = _columns(points)
    if columns is None:
        values = _scaled(points, factors, samples)
    elif factors or samples is not None:
        raise SceneError("--vary and --samples: neither is accepted beside points with names")
    else:
        factors = _tabulated(origin(points), columns)
        values = list(zip(*(factor.values for factor in factors)))
    if not 1 <= len(values) <= MOST_POINTS:
        raise SceneError(f"{origin(points)}: {len(values)} points: from 1 to {MOST_POINTS} are "
                         "accepted")
    return factors, values


def _columns(points: Any) -> Iterable[tuple] | None:
    """Return the columns, each with its name first; None for points without names.

    Missing fields are empty.
    """
    if isinstance(points, (str, PathLike)):
        try:
            with open(points, encoding="utf-8-sig", newline="") as lines:
                return zip_longest(*filter(None, csv.reader(lines)), fillvalue="")
        except (OSError, ValueError, csv.Error) as error:
            raise SceneError(f"{points}: it cannot be read as a CSV file ({error})") from None
    if isinstance(points, Mapping):
        return zip(points, *zip_longest(*points.values(), fillvalue=""))
    names = getattr(points, "columns", getattr(getattr(points, "dtype", None), "names", None))
    return None if names is None else zip(names, *np.asarray(points, object).tolist())


def _tabulated(file: str, columns: Iterable[tuple]) -> list[Factor]:
    """Return the factors of named columns: numbers in one unit, or words."""
    factors: list[Factor] = []
    for name, *cells in columns:
        match = re.fullmatch(r"\s*([^\s()]+)\s*(?:\(([^()]*)\))?\s*", str(name))
        place = f"column {quote(str(name))}"
        if not match or match[1] in [factor.key for factor in factors]:
            raise SceneError(f"{file}: row 0, {place}: a key that no other column has, with its "
                             'unit, is needed, such as "pore.width (um)"')
        texts = [bare(str(plain(cell)).strip()) for cell in cells]
        parts = [number(f"{text} {match[2] or ''}".strip()) for text in texts]
        kinds = [(bool(digits), unit) for digits, unit in parts]
        for row, (text, (digits, _)) in enumerate(zip(texts, parts), 1):
            infinite = digits and math.isinf(float(digits))
            missing = text.lower() in ("", "nan", "none", "nat", "<na>", "inf", "-inf")
            if missing or infinite or kinds[row - 1] != kinds[0]:
                raise SceneError(f"{file}: row {row}, {place}: {quote(text)}: a finite number in "
                                 "the unit of row 1, or a word as there, is needed")
        numeric, unit = kinds[0] if kinds else (False, "")
        values = [float(digits) for digits, _ in parts] if numeric else texts
        factors.append(Factor(match[1], unit if numeric else "", tuple(values)))
    return factors


def _scaled(points: Any, factors: list[Factor], samples: int | None) -> list[tuple]:
    """Scale points of the unit cube to the ranges of the factors; points: an array, or an engine of
    ``scipy.stats.qmc`` with the number of samples."""
    if not factors or any(factor.count is not None for factor in factors):
        raise SceneError("--vary: a range without a number of values is needed for each column of "
                         "points without names")
    if hasattr(points, "random") != (samples is not None):
        raise SceneError("--samples: an engine needs the number of points, an array has one")
    values = np.asarray(points if samples is None else points.random(samples), float)
    if values.ndim != 2 or values.shape[1] != len(factors):
        raise SceneError(f"points: an array of shape (points, {len(factors)}) is needed, a column "
                         f"for each --vary, not {values.shape}")
    for row, column in np.argwhere(~((values >= 0) & (values <= 1)))[:1]:
        raise SceneError(f"points: row {row + 1}, column {factors[column].key}: "
                         f"{values[row, column]:g}: a number from 0 to 1 is needed; columns of "
                         "values have names")
    return [tuple(map(at, factors, row)) for row in values.tolist()]
