"""Tables over time in a scene: supplies, and the head or mean velocity.

The times of a table ascend from 0 h. Between two times the table keeps its last value ("steps") or
is interpolated linearly ("linear"). After the last time it keeps the last value. The steps of a run
end at all of these times, so that no step contains a jump or a kink.
"""
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass, replace
from itertools import pairwise
from math import inf
from typing import TypeVar

Part = TypeVar("Part")


@dataclass(frozen=True)
class TimeTable:
    """Values at times (h), ascending from 0; linear: are they interpolated linearly?"""

    times: tuple[float, ...]
    values: tuple[float, ...]
    linear: bool = False

    def at(self, time: float) -> float:
        """Value at a time (h), after a jump at that time."""
        last = bisect_right(self.times, time) - 1
        if not self.linear or last + 1 == len(self.times):
            return self.values[last]
        start = self.times[last]
        part = (time - start) / (self.times[last + 1] - start)
        return (1 - part) * self.values[last] + part * self.values[last + 1]

    def jumps(self, time: float) -> bool:
        """Does the value jump at a time (h)?"""
        if self.linear or time not in self.times:
            return False
        after = self.times.index(time)
        return after > 0 and self.values[after - 1] != self.values[after]

    @property
    def largest(self) -> float:
        """The largest value."""
        return max(self.values)


@dataclass(frozen=True)
class TimeTables:
    """All tables of a scene."""

    tables: tuple[TimeTable, ...]

    def corner(self, time: float) -> float:
        """Next time (h) of a table after ``time``; infinite if there is none."""
        later = [corner for table in self.tables for corner in table.times if corner > time]
        return min(later, default=inf)

    def jumps(self, time: float) -> bool:
        """Does a value jump at a time (h)?"""
        return any(table.jumps(time) for table in self.tables)

    def same(self, time: float, other: float) -> bool:
        """Are all values at two times (h) the same?"""
        return all(table.at(time) == table.at(other) for table in self.tables)


def at_time(part: Part, time: float) -> Part:
    """A scene or a section with the values of its tables at a time (h), after a jump there."""
    return constant(part, lambda table: table.at(time))


def at_largest(part: Part) -> Part:
    """A scene or a section with the largest value of each table."""
    return constant(part, lambda table: table.largest)


def constant(part: Part, value: Callable[[TimeTable], float]) -> Part:
    """Replace every table of a scene or a section by a value; the same object without tables."""
    changed: dict[str, object] = {}
    for entry in fields(part):  # type: ignore[arg-type]  # a dataclass
        old = getattr(part, entry.name)
        if isinstance(old, TimeTable):
            changed[entry.name] = value(old)
        elif is_dataclass(old) and (new := constant(old, value)) is not old:
            changed[entry.name] = new
    return replace(part, **changed) if changed else part  # type: ignore[type-var]  # a dataclass


def time_tables(part: object) -> tuple[TimeTable, ...]:
    """All tables of a scene or a section."""
    tables: tuple[TimeTable, ...] = ()
    for entry in fields(part):  # type: ignore[arg-type]  # a dataclass
        value = getattr(part, entry.name)
        if isinstance(value, TimeTable):
            tables += (value,)
        elif is_dataclass(value):
            tables += time_tables(value)
    return tables


def jump_times(section: dict) -> list[float]:
    """The times (h) of jumps in the text of a section; a table in steps is a list."""
    lists = [value for value in section.values() if isinstance(value, list)]
    return sorted({float(later[0].split()[0]) for entries in lists
                   for earlier, later in pairwise(entries) if earlier[1] != later[1]})
