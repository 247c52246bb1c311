"""What a scene gives as a table over time: supplies, and the head or mean velocity.

A table's times ascend from 0 h. Between them its last value holds ("steps", the new one from its
time on), or values change evenly ("linear"); after the last time its value stays. Steps of a run
end at every one of its times, so that no step goes over a jump or a bend.
"""
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import TypeVar

Part = TypeVar("Part")


@dataclass(frozen=True)
class Course:
    """Values at times (h), ascending from 0; linear: do they change evenly in between?"""

    times: tuple[float, ...]
    values: tuple[float, ...]
    linear: bool = False

    def at(self, time: float) -> float:
        """The value at a time (h), after the jump that may be there."""
        last = bisect_right(self.times, time) - 1
        if not self.linear or last + 1 == len(self.times):
            return self.values[last]
        start = self.times[last]
        part = (time - start) / (self.times[last + 1] - start)
        return (1 - part) * self.values[last] + part * self.values[last + 1]

    @property
    def largest(self) -> float:
        """Of all values."""
        return max(self.values)


def constant(part: Part, value: Callable[[Course], float]) -> Part:
    """A scene, or a section, with a value in place of every table; itself where there is none."""
    changed: dict[str, object] = {}
    for entry in fields(part):  # type: ignore[arg-type]  # a dataclass
        old = getattr(part, entry.name)
        if isinstance(old, Course):
            changed[entry.name] = value(old)
        elif is_dataclass(old) and (new := constant(old, value)) is not old:
            changed[entry.name] = new
    return replace(part, **changed) if changed else part  # type: ignore[type-var]  # a dataclass


def courses(part: object) -> list[Course]:
    """All tables of a scene or a section."""
    found = []
    for entry in fields(part):  # type: ignore[arg-type]  # a dataclass
        value = getattr(part, entry.name)
        if isinstance(value, Course):
            found.append(value)
        elif is_dataclass(value):
            found += courses(value)
    return found
