"""The levels at which every claim is computed: sizes of elements and steps between shape updates, over the default's.

The default is refinement 1 and 12 min. Three more sizes and three more steps are taken, one of both at a time:

    sizes   2^(1/2), 2^(-1/2), 1/2    elements twice as large (7 across half a pore) are not asymptotic: with them the
                                      velocity of base at 19.2 h shows an order of 2.9 to 3.1, without them 2.0
    steps   2, 3, 4                   19.2 h is a whole number of each; the next one ends at 19.4 h, where base does

Claims about wide do without the last size, with which it would run longer than all the rest. Instants are those of the
default at every level: "plotted at 19.4 h" is the shape of 19.2 h, and "before the expansion" is that shape with what
grows in the 12 min after. The lag of 12 min is the paper's, a part of what is asked, and no error of the step.

A level is a context: a scene that a claim asks for within `at_level` gets that level's elements and steps, and what is
kept by `cached` is kept for that level.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import wraps


@dataclass(frozen=True)
class Level:
    """Sizes of elements and of steps over those that a scene says."""

    size: float = 1.0
    step: float = 1.0


DEFAULT = Level()
#: The default first: the bar is its own.
SIZES = (1.0, 2**0.5, 2**-0.5, 0.5)
WIDE_SIZES = SIZES[:3]
STEPS = (1.0, 2.0, 3.0, 4.0)
#: What is not varied.
ALONE = (1.0,)

_current: ContextVar[Level] = ContextVar("level", default=DEFAULT)
_kept: dict[Level, dict] = {}


def current() -> Level:
    """The level at which numbers are computed now."""
    return _current.get()


@contextmanager
def at_level(level: Level) -> Iterator[None]:
    """Compute at a level; what was kept there is forgotten afterwards, but for the default's."""
    token = _current.set(level)
    try:
        yield
    finally:
        _current.reset(token)
        if level != DEFAULT:
            _kept.pop(level, None)


def cached(function: Callable) -> Callable:
    """Keep what a function returns, by its arguments and by the level."""
    @wraps(function)
    def keeping(*given):
        kept = _kept.setdefault(current(), {})
        if (function, given) not in kept:
            kept[function, given] = function(*given)
        return kept[function, given]
    return keeping
