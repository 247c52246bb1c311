"""Short ``repr`` of dataclasses with arrays: shapes in place of numbers."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, TypeVar

import numpy as np

Class = TypeVar("Class", bound=type)
LONGEST = 40  # characters of a value


def brief(kind: Class) -> Class:
    """Decorator: a ``repr`` with plain values, shapes of arrays, and types of other fields."""
    setattr(kind, "__repr__", _short_repr)  # noqa: B010  mypy refuses the assignment
    return kind


def _short_repr(instance: Any) -> str:
    parts = [f"{entry.name}={_short(getattr(instance, entry.name))}" for entry in fields(instance)
             if not entry.name.startswith("_")]
    return f"{type(instance).__name__}({', '.join(parts)})"


def _short(value: object) -> str:
    if isinstance(value, np.ndarray):
        return f"{value.dtype}{list(value.shape)}"
    text = type(value).__name__ if hasattr(value, "__dataclass_fields__") else repr(value)
    return text if len(text) <= LONGEST else f"{type(value).__name__} of {len(text)} characters"
