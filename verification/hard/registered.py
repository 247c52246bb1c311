"""Every hard case as a verification case, with all presets."""

from __future__ import annotations

from collections.abc import Iterable

from verification.case import case
from verification.hard.common import HardCase
from verification.hard.judge import Verdicts, run_case


def register(cases: Iterable[HardCase]) -> None:
    """Make them known to ``python -m verification``."""
    for one in cases:
        _register(one)


def _register(one: HardCase) -> None:
    @case(one.full_id, kind="property", claim=f"{one.title}: {_sentence(one.right_is)}", norm=NORM, mutants=one.mutants,
          slow=one.slow)
    def run() -> Verdicts:
        return run_case(one)


NORM = ("numbers of each part with the presets paper, fast and accurate, and with fast on cubic elements; refused "
        "parts are left out")


def _sentence(text: str) -> str:
    return text[0].lower() + text[1:]
