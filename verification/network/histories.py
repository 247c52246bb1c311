"""Histories of the throats in the example of a network, `docs/howto/openpnm_network.py`: heads and supplies over 48 h.

`python -m verification.network histories` runs the example, in the environment of `make network`, and writes them.
"""

import runpy
from pathlib import Path
from typing import NamedTuple

import numpy as np

from repro.results import read_table, write_table
from verification.network.shapes import select

EXAMPLE = Path(__file__).parents[2] / "docs" / "howto" / "openpnm_network.py"
#: A row for each throat and time, with the state of the example in steps of STEPS[0].
TABLE = Path(__file__).with_name("histories.csv")
COLUMNS = ["throat", "time_h", "width_um", "area_um2", "head_loss_um", "acceptor_mg_per_L", "donor_mg_per_L"]
#: The flow through the network in steps of the example, and in steps of half the length.
FLOWS, FLOW_COLUMNS = Path(__file__).with_name("flows.csv"), ["step_h", "time_h", "flow_um_m_per_d"]
STEPS = (2.0, 1.0)
#: Digits of the tables.
DIGITS = 7


class History(NamedTuple):
    """The history of a throat.

    number: in the network; width: um; time: (m,) h; area: (m,) um2, by the example; head_loss: (m,) um, negative if the
    flow is from the throat's second pore to the first; supplies: (2, m) mg/L.
    """

    number: int
    width: float
    time: np.ndarray
    area: np.ndarray
    head_loss: np.ndarray
    supplies: np.ndarray

    @property
    def flows(self) -> bool:
        """Whether water flows. It does not between two inlets or two outlets."""
        return bool((np.abs(self.head_loss) > NO_HEAD).any())

    @property
    def share(self) -> float:
        """A / W^2 at the end."""
        return float(self.area[-1] / self.width**2)


#: Head losses (um) that are zero, except for round-off.
NO_HEAD = 1e-9


def export() -> None:
    """Run the example with both steps, and write the tables."""
    example = runpy.run_path(str(EXAMPLE))
    write_table(TABLE, COLUMNS, rows(example))
    write_table(FLOWS, FLOW_COLUMNS, flows(example))


def rows(example: dict) -> list[list]:
    """Rows of TABLE, from the variables of the example."""
    lines = []
    for number, width in enumerate(example["width"]):
        for k, state in enumerate(example["states"]):
            values = (width, state.area[number], state.head_loss[number], *state.supplies[:, number])
            lines.append([number, STEPS[0] * k, *map(rounded, values)])
    return lines


def flows(example: dict) -> list[list]:
    """Rows of FLOWS."""
    totals = {STEPS[0]: example["total"],
              STEPS[1]: [state.total for state in example["advance"](example["area"], STEPS[1])]}
    return [[step, step * k, rounded(total)] for step, of_step in totals.items() for k, total in enumerate(of_step)]


def rounded(value: float, digits: int = DIGITS) -> float:
    """A value with so many significant digits."""
    return float(f"{value:.{digits}g}")


def read() -> list[History]:
    """The histories of all throats, by their numbers."""
    columns = read_table(TABLE)
    numbers = columns["throat"].astype(int)
    return [_history(number, select(columns, numbers == number)) for number in np.unique(numbers).tolist()]


def _history(number: int, columns: dict[str, np.ndarray]) -> History:
    supplies = np.stack([columns["acceptor_mg_per_L"], columns["donor_mg_per_L"]])
    return History(number, float(columns["width_um"][0]), columns["time_h"], columns["area_um2"],
                   columns["head_loss_um"], supplies)


def flow_ratios() -> dict[float, float]:
    """{step: flow through the network at the end over that at the start}."""
    columns = read_table(FLOWS)
    of_steps = {step: columns["flow_um_m_per_d"][columns["step_h"] == step] for step in STEPS}
    return {step: float(flow[-1] / flow[0]) for step, flow in of_steps.items()}
