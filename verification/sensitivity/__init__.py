"""Effects of the rounding of Table 1: `make sensitivity`, or `python -m verification.sensitivity`.

Table 1 prints rounded numbers: an input may be anywhere within half a unit of its last digit. The record
`sensitivity.json` has the elasticities of every number that the paper prints of base, and of contact and conductivity
of wide, with respect to each input, by central differences of the converged solution. It also has the set of inputs
within the rounding that comes nearest to all printed numbers of base at once. The claims read the record here.

Runs are computed in this process and not by `repro sweep`. Some numbers need a state that no row has (grown and not yet
expanded [E12]) or a second run from contact on. Elasticities and the set choose each run by the results of the last
one. A run writes its numbers alone, 0.4 kB in `out/runs.jsonl`; the study writes 2 MB. A run is not repeated while its
numbers are stored under the same scene and source.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import product
from pathlib import Path

from verification.evidence.writing import load

RECORD = Path(__file__).parent / "sensitivity.json"


@dataclass(frozen=True)
class Dependence:
    """Whether a claim holds with several values of an input that the paper does not print.

    on: the input, with its unit; holds: {value: does it hold?}.
    """

    on: str
    holds: dict[str, bool]

    @property
    def splits(self) -> bool:
        """Whether it holds with some values and not with others."""
        return len(set(self.holds.values())) > 1

    @property
    def text(self) -> str:
        """The values with which it holds, and the others."""
        sides = (", ".join(value for value, held in self.holds.items() if held == side) or "none"
                 for side in (True, False))
        return "{}: holds with {}; does not with {}".format(self.on, *sides)


@cache
def record() -> dict:
    """The committed record; empty if there is none."""
    return load(RECORD, {})


def interval(quantity: str, value: float) -> tuple[float, float] | None:
    """Range of a value, to first order, as all inputs vary within their rounding; None if the record lacks it."""
    part = reach(quantity)
    return None if part is None else (value - abs(value) * part, value + abs(value) * part)


def reach(quantity: str) -> float | None:
    """Half of the range of a number as the inputs vary within their rounding, over the number."""
    by_input = record().get("elasticities", {}).get(quantity)
    if by_input is None:
        return None
    return sum(abs(by_input[name]["elasticity"]) * half for name, half in record()["rounding"].items())


def in_closed_form(form: Callable[..., float], *inputs: tuple[float, float]) -> tuple[float, float]:
    """Least and largest value of a form that is monotone in each input, while the inputs vary within their rounding.
    The extremes are at corners. inputs: (value, half a unit of its last digit) of each."""
    ends = [(value - half, value + half) for value, half in inputs]
    values = [form(*corner) for corner in product(*ends)]
    return min(values), max(values)


def on_supplies(id: str) -> Dependence:
    """Whether a claim holds with other supplies of Figure 6, for which the paper prints none."""
    return Dependence("the supply of Figure 6 (K_s)", {
        supply: all(result["claims"][id].values()) for supply, result in record()["supplies"].items()})


def jointly() -> list[str]:
    """The supplies of Figure 6 with which all claims hold that depend on it."""
    supplies = record()["supplies"]
    split = [id for id in next(iter(supplies.values()))["claims"] if on_supplies(id).splits]
    return [supply for supply in supplies if all(on_supplies(id).holds[supply] for id in split)]


def verified_set() -> str:
    """The set of inputs that gives all printed numbers of base at once, in words; empty if there is none."""
    return _described_set() if record().get("one_set", {}).get("reached") else ""


def nearest_set() -> str:
    """The set of inputs that comes nearest to all printed numbers of base, in words; empty if one reaches them."""
    one_set = record().get("one_set", {"reached": True})
    if one_set["reached"]:
        return ""
    share = one_set["share_of_the_rounding"]
    return (f"no set of inputs within the rounding of Table 1 reaches all printed numbers of base: {impossible()}. By "
            f"the elasticities it would take {share:.1f} times the rounding; the nearest set within it: "
            f"{_described_set()}")


#: The printed effluents (K_s) and F, and half a unit of their last digits; the supply (K_s).
EFFLUENTS, RATIO, HALF_DIGIT, SUPPLY = (4.19, 6.13), 1.52, 0.005, 10.0


def impossible() -> str:
    """Why no inputs give the printed effluents, in closed form: F and decay against the ratio of what is consumed."""
    _, most = in_closed_form(lambda acceptor, donor: (SUPPLY - acceptor) / (SUPPLY - donor),
                             *((value, HALF_DIGIT) for value in EFFLUENTS))
    return (f"at least F, and so {RATIO - HALF_DIGIT:.3f}, times as much acceptor as donor is consumed, and at most "
            f"{most:.3f} times by the printed effluents")


def _described_set() -> str:
    one_set = record()["one_set"]
    inputs = ", ".join(f"{name} {value:.4g}" for name, value in one_set["inputs"].items())
    numbers = ", ".join(f"{name.replace('_', ' ')} {value:.4f} ± {one_set['bars'][name]:.1g}"
                        for name, value in one_set["numbers"].items())
    return f"with {inputs} a run gives {numbers}"
