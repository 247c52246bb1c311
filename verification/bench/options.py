"""Which choices of method a scene offers: those that it does not know are not measured."""

from __future__ import annotations

from dataclasses import fields

from repro.scene import Numerics

PAPER = "linear elements (paper)"


def known(key: str) -> bool:
    """Does a scene have ``numerics.KEY``?"""
    return key in {entry.name for entry in fields(Numerics)}


def flow_elements() -> list[tuple[str, dict]]:
    """(name, [numerics] keys) of the flow elements on straight triangles."""
    found = [(PAPER, {"preset": "paper"})]
    if known("flow_element"):
        found.append(("linear with a bubble", {"preset": "paper", "flow_element": "bubble"}))
    return found
