"""Refuse arguments of a wrong type by their names, before a function does anything."""

import inspect
from collections.abc import Callable, Sequence
from functools import cache, wraps
from numbers import Integral, Real
from types import NoneType, UnionType
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

from repro.errors import shortened
from repro.scene.reading import assignments
from repro.scene.units import plain

Function = TypeVar("Function", bound=Callable[..., Any])
#: Changes of a scene: texts KEY=VALUE, or a dict of values by dotted keys.
Overrides = Sequence[str] | dict[str, Any]


def typed(function: Function) -> Function:
    """Check the types of arguments by the annotations of their parameters.

    An array of NumPy is accepted as a list, and a dict of overrides becomes a list of texts. The
    decorated function raises TypeError, in one line, for the first argument of a wrong type.
    """
    parameters = tuple(inspect.signature(function).parameters)
    hints = cache(lambda: get_type_hints(function))

    def checked(name: str, value: object) -> object:
        if hints().get(name) == Overrides and isinstance(value, dict):
            try:
                return assignments(value)
            except TypeError as error:
                raise TypeError(f"{function.__name__}: {name}: {error}") from None
        if name not in hints() or _accepts(hints()[name], value):
            return value
        converted = plain(value)
        if converted is value or not _accepts(hints()[name], converted):
            kinds = _words(hints()[name])
            raise TypeError(f"{function.__name__}: {name}: {kinds} is needed, not {_short(value)}")
        return converted

    @wraps(function)
    def call(*arguments, **keywords):
        named = [checked(name, value) for name, value in zip(parameters, arguments)]
        return function(*named, *arguments[len(named):],
                        **{name: checked(name, value) for name, value in keywords.items()})

    return call  # type: ignore[return-value]  # it has the parameters of the function


def _accepts(hint: Any, value: object) -> bool:
    """Does a value have the type of an annotation? Only texts are checked within sequences."""
    if _is_union(hint):
        return any(_accepts(option, value) for option in get_args(hint))
    if hint is Any:
        return True
    kind = get_origin(hint) or hint
    if kind is Sequence:
        if not isinstance(value, Sequence) or isinstance(value, (str, bytes)):
            return False
        return str not in get_args(hint) or all(isinstance(option, str) for option in value)
    if kind in (float, int):  # numbers of NumPy, too
        number = Real if kind is float else Integral
        return isinstance(value, number) and not isinstance(value, bool)
    return isinstance(value, kind)


def _is_union(hint: Any) -> bool:
    return get_origin(hint) in (Union, UnionType)


def _words(hint: Any) -> str:
    """The accepted types of an annotation, such as "str or Path"."""
    if _is_union(hint):
        return " or ".join(_words(option) for option in get_args(hint) if option is not NoneType)
    if get_origin(hint) is Sequence:
        return f"a list of {_words(get_args(hint)[0])}"
    return getattr(hint, "__name__", str(hint))


def _short(value: object) -> str:
    """A value on one line, without its address."""
    text = repr(value)
    if " at 0x" in text:
        text = f"a {type(value).__name__}"
    return shortened(" ".join(text.split()))
