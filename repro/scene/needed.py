"""What is optional: sections of a scene, which a stage requires, and packages."""

from importlib import import_module
from typing import Any, TypeVar

Part = TypeVar("Part")


class MissingError(AssertionError):
    """Code used a section that the scene does not have: an error of that code."""


def needed(part: Part | None, name: str) -> Part:
    """The optional ``part``, which the caller knows to be present.

    name: for example "[growth]". Raises MissingError if the part is None.
    """
    if part is None:
        raise MissingError(f"{name} is needed here, and there is none")
    return part


def package(module: str, install: str = "") -> Any:
    """Import a module of an optional package.

    install: the packages to install, by default that of the module. Raises ImportError, in one
    line, if it is not installed.
    """
    try:
        return import_module(module)
    except ImportError:
        names = install or module
        raise ImportError(f"the package {names.split()[0]} is not installed; "
                          f"pip install {names}") from None
