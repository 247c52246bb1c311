"""Optional sections of a scene that a stage requires."""

from __future__ import annotations

from typing import TypeVar

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
