"""One line for what holds arrays, in place of all their numbers."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, TypeVar

import numpy as np

Class = TypeVar("Class", bound=type)
LONGEST = 40  # characters of a value


def brief(kind: Class) -> Class:
    """A dataclass whose ``repr`` tells plain values, shapes of arrays, and types of other parts."""
    setattr(kind, "__repr__", _told)  # noqa: B010  a type may not be told that it has another
    return kind


def _told(one: Any) -> str:
    parts = [f"{entry.name}={_short(getattr(one, entry.name))}" for entry in fields(one)
             if not entry.name.startswith("_")]
    return f"{type(one).__name__}({', '.join(parts)})"


def _short(value: object) -> str:
    if isinstance(value, np.ndarray):
        return f"{value.dtype}{list(value.shape)}"
    told = type(value).__name__ if hasattr(value, "__dataclass_fields__") else repr(value)
    return told if len(told) <= LONGEST else f"{type(value).__name__} of {len(told)} characters"
