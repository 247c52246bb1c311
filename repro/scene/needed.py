"""Sections that the physics at hand cannot be without, though a scene may leave them out."""

from __future__ import annotations

from typing import TypeVar

Part = TypeVar("Part")


class MissingError(AssertionError):
    """Physics was asked for that the scene does not have: a mistake of the code that asks."""


def needed(part: Part | None, what: str) -> Part:
    """The part, which the caller knows to be there. Raises MissingError where it is not.

    what: its name, such as "[growth]".
    """
    if part is None:
        raise MissingError(f"{what} is needed here, and there is none")
    return part
