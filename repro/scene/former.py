"""Choices of earlier versions, and what to write instead.

A scene that names one of them is refused. The runs of earlier versions keep them in ``run.json``.
"""
#: What to write instead of a choice, by its dotted key and the choice.
CHOICES: dict[tuple[str, str], str] = {
    ("numerics.elements", "cubic"): '"quadratic" is needed',
}


def instead_of_choice(key: str, value: object) -> str:
    """Requirement where a scene has a former choice; empty for other values."""
    named = (key, value) if isinstance(value, str) else None
    return f"this choice was removed; {CHOICES[named]}" if named in CHOICES else ""
