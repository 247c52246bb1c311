"""The paper's ambiguities and misprints, our reading, and their consequences: `python -m verification.errata`.

Each erratum is a function that computes the numbers of its text. The text is in the decorator, with a {name} for each
number. The program computes all numbers and rewrites ``reference/ERRATA.md``, so that text and numbers agree. The runs
are those of the claims. Variants without a key in a scene (a wrong sign, an explicit increment) are assembled from the
stages of `repro`. ``tests/test_errata.py`` recomputes the quick errata.
"""

import textwrap
from collections.abc import Callable
from dataclasses import dataclass
from inspect import cleandoc

from verification.claims.runs import BASE, at
from verification.switches import PLOTTED

SUPPLY = 10.0
#: {name: number of an entry as text}.
Numbers = dict[str, str]


@dataclass(frozen=True)
class Erratum:
    """An entry: its text, the function that computes the numbers in ``consequence``, and whether it takes less than
    about two seconds and no run. An empty part is left out.

    spread: bound of the relative difference of its numbers between meshes that differ by round-off.
    """

    id: str
    title: str
    function: Callable[[], Numbers]
    consequence: str
    printed: str = ""
    reading: str = ""
    quick: bool = False
    spread: float = 0.05

    def markdown(self) -> str:
        """Compute the numbers and return the entry."""
        parts = {"Printed": self.printed, "Our reading": self.reading,
                 "Consequence": cleandoc(self.consequence).format(**self.function())}
        paragraphs = [f"**{name}.** {cleandoc(text)}" for name, text in parts.items() if text]
        return filled("\n\n".join([f"## {self.id}. {self.title}", *paragraphs]))


ERRATA: dict[str, Erratum] = {}


def erratum(id: str, title: str, **parts):
    """Register the decorated function () -> {name: number as text} as the measurement of an erratum; parts: further
    fields of `Erratum`."""
    def register(function: Callable[[], Numbers]) -> Callable[[], Numbers]:
        ERRATA[id] = Erratum(id, title, function, **parts)
        return function
    return register


def filled(text: str) -> str:
    """Markdown with its paragraphs, but not its tables, broken into lines of 120."""
    lines = textwrap.TextWrapper(120, break_on_hyphens=False, break_long_words=False)
    blocks = text.split("\n\n")
    return "\n\n".join(block if block.startswith("|") else lines.fill(block) for block in blocks) + "\n"


def percent(ratio: float, digits: int = 2) -> str:
    """The deviation of a ratio from one, in percent with a sign."""
    deviation = round(100 * (ratio - 1), digits)
    return f"{deviation:+.{digits}f} %" if deviation else f"{0:.{digits}f} %"


def small(value: float) -> str:
    """A defect with one digit, or "round-off" for a defect whose digits differ between machines."""
    return f"{value:.0e}" if abs(value) > 1e-12 else "round-off"


STATE_HEAD = ["", "mean velocity, m/d", "acceptor effluent", "donor effluent"]


def state(run: tuple[str, ...], time: float = PLOTTED) -> tuple[float, float, float]:
    """Mean velocity (m/d), acceptor and donor effluents (K_s) of a run at a time (h)."""
    row = at(run, time)
    return tuple(row[key] for key in ("mean_velocity_m_per_d", "effluent_acceptor_mg_per_L", "effluent_donor_mg_per_L"))


def state_row(name: str, run: tuple[str, ...]) -> list[str]:
    """A row of a table: velocity and effluents of a run at 19.2 h, with their deviations from base."""
    if run == BASE:
        return [name, *(f"{value:.3f}" for value in state(run))]
    return [name, *(f"{value:.3f} ({percent(value / default)})" for value, default in zip(state(run), state(BASE)))]


def consumed_ratio(acceptor: float, donor: float) -> float:
    """Acceptor over donor consumed, from effluents (K_s)."""
    return (SUPPLY - acceptor) / (SUPPLY - donor)
