"""A network of 100 throats with OpenPNM, in which aggregates grow by the laws for networks.

Each step solves for the heads of the pores (OpenPNM's StokesFlow), follows the water through the throats, and advances
the areas with the midpoint rule of their logarithms. Water mixes completely in pores, which hold no biomass.
`python -m verification.network lattice` advances it by 48 h in an environment that also has OpenPNM.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import repro
from repro.results.network import UM_PER_HOUR

#: Pores along the flow and across it, and throats that are removed from their lattice.
PORES, REMOVED = (5, 15), 2
LENGTH = 600.0  # um, of a throat
#: Uniformly drawn: widths and radii of the seeds (um).
WIDTHS, RADII = (45.0, 75.0), (4.0, 8.0)
#: Head over the network (um), and supplies of acceptor and donor (mg/L).
HEAD, SUPPLIES = 40.0, (8.0, 5.0)
HOURS, STEP = 48, 1.0  # h
SEED = 2001
#: Conductance of a throat is g W^3 / (12 nu L) per metre of depth; g / (12 nu) in 1/(um h).
CONDUCTANCE = 9.81e6 / (12 * 1.003e6) * 3600
#: Sweeps along the flow until the concentrations rest, to this part of the supply.
SWEEPS, RESTS = 40, 1e-4


@dataclass(frozen=True, eq=False)
class State:
    """time: h; area: (T,) um2; head: (T,) um, the difference over each throat; velocity: (T,) m/d; supplies: (2, T)
    mg/L, of acceptor and donor, in the water that enters a throat; flow: um2/h through the network."""

    time: float
    area: np.ndarray
    head: np.ndarray
    velocity: np.ndarray
    supplies: np.ndarray
    flow: float


class Lattice:
    """The throats (T, 2), their widths (um) and the areas of their seeds (um2)."""

    def __init__(self):
        import openpnm as op

        random = np.random.default_rng(SEED)
        self.network = op.network.Cubic(shape=[*PORES, 1], spacing=LENGTH * 1e-6)
        ends = self.network["pore.xmin"].astype(int) + 2 * self.network["pore.xmax"]
        start, end = ends[self.network["throat.conns"].T]
        op.topotools.trim(network=self.network, throats=np.flatnonzero((start > 0) & (start == end)))
        removed = random.choice(self.network.Nt, REMOVED, replace=False)
        op.topotools.trim(network=self.network, throats=removed)
        self.throats = self.network["throat.conns"]
        self.width = random.uniform(*WIDTHS, len(self.throats))
        self.seeds = 0.5 * np.pi * random.uniform(*RADII, len(self.throats))**2
        self.phase = op.phase.Phase(network=self.network)
        self._solver: Callable = op.algorithms.StokesFlow
        self._concentrations = np.tile(np.array(SUPPLIES)[:, None], self.network.Np)

    def state(self, time: float, area: np.ndarray) -> tuple[State, np.ndarray]:
        """The flow and the supplies at some areas, and the growth of the areas (um2/h)."""
        added = repro.added_resistance(area, self.width).length
        conductance = CONDUCTANCE * self.width**3 / (LENGTH + added * self.width)
        self.phase["throat.hydraulic_conductance"] = conductance
        solver = self._solver(network=self.network, phase=self.phase)
        first, last = self.network.pores("xmin"), self.network.pores("xmax")
        solver.set_value_BC(pores=first, values=HEAD)
        solver.set_value_BC(pores=last, values=0.0)
        solver.run(verbose=False)
        heads = solver["pore.pressure"]
        start, end = self.throats[np.arange(len(area)), :].T
        head = heads[start] - heads[end]
        flow = conductance * np.abs(head)
        velocity = flow / self.width / UM_PER_HOUR
        supplies, growth = self._follow(area, velocity, flow, np.where(head > 0, start, end),
                                        np.where(head > 0, end, start), first)
        through = flow[np.isin(start, first) != np.isin(end, first)].sum()
        return State(time, area, head, velocity, supplies, float(through)), growth

    def _follow(self, area, velocity, flow, source, target, first) -> tuple[np.ndarray, np.ndarray]:
        """(2, T) supplies and (T,) growth: complete mixing in each pore of what its throats bring."""
        count = self.network.Np
        entering = np.bincount(target, flow, count)
        for _ in range(SWEEPS):
            supplies = self._concentrations[:, source]
            taken = repro.uptake(area, self.width, velocity, *supplies)
            mixed = np.empty_like(self._concentrations)
            for k, uptake in enumerate((taken.acceptor, taken.donor)):
                brought = np.bincount(target, np.maximum(flow * supplies[k] - uptake, 0.0), count)
                mixed[k] = np.where(entering > 0, brought / np.maximum(entering, 1e-30), SUPPLIES[k])
                mixed[k, first] = SUPPLIES[k]
            rests = np.abs(mixed - self._concentrations).max() < RESTS * max(SUPPLIES)
            self._concentrations = mixed
            if rests:
                return supplies, taken.growth
        raise RuntimeError(f"the concentrations of the network do not rest after {SWEEPS} sweeps")


def advance(lattice: Lattice, count: int = HOURS) -> list[State]:
    """States at the starts of some steps and at the end of the last."""
    area, states = lattice.seeds, []
    for number in range(count):
        state, growth = lattice.state(number * STEP, area)
        states.append(state)
        half = area * np.exp(0.5 * STEP * growth / area)
        _, middle = lattice.state((number + 0.5) * STEP, half)
        area = area * np.exp(STEP * middle / half)
    return [*states, lattice.state(count * STEP, area)[0]]
