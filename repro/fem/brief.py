"""Short ``repr`` of dataclasses with arrays: shapes in place of numbers."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, TypeVar

import numpy as np

from repro.errors import shortened

Class = TypeVar("Class", bound=type)


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
    is_part = hasattr(value, "__dataclass_fields__")
    return shortened(type(value).__name__ if is_part else repr(value), 40)
