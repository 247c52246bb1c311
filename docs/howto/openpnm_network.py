"""A network of 100 throats in OpenPNM, with the laws of throats: flow, uptake and growth over 48 h (make network).

An argument is a scene whose kinetics replace those of Table 1, such as mine.toml.
"""

import sys
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import openpnm

import repro

LENGTH = 600.0                # um, of each throat
HEAD_DROP = 12.0              # um, over the network
PER_HEAD = 9.81 / 12e-6 * 86400 * 1e-12  # g / (12 nu), m/d per um2 at a slope of 1
SUPPLY = 8.0, 5.0             # mg/L of acceptor and donor, at most those of the scene
SCENE = repro.load_scene(sys.argv[1]) if __name__ == "__main__" and sys.argv[1:] else None
STEP, END = 2.0, 48.0         # h
FLOW = 1e6 / 24               # um2/h in 1 m/d um

random = np.random.default_rng(2001)
network = openpnm.network.Cubic(shape=[6, 4, 2], spacing=LENGTH * 1e-6)
throats = network["throat.conns"]
width = random.uniform(45, 90, len(throats))             # um
area = random.uniform(0.02, 0.08, len(throats)) * width**2  # um2
along = network["pore.coords"][:, 0]
inlets, outlets = along == along.min(), along == along.max()
water = openpnm.phase.Phase(network=network)


def heads(area: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Heads of the pores (um), and flow in the throats from their first to their second pore (m/d um)."""
    length = LENGTH + repro.added_resistance(area, width, scene=SCENE).length * width
    conductance = PER_HEAD * width**3 / length
    water["throat.hydraulic_conductance"] = conductance
    flow = openpnm.algorithms.StokesFlow(network=network, phase=water)
    flow.set_value_BC(pores=np.flatnonzero(inlets), values=HEAD_DROP)
    flow.set_value_BC(pores=np.flatnonzero(outlets), values=0.0)
    flow.run()
    head = flow["pore.pressure"]
    return head, conductance * (head[throats[:, 0]] - head[throats[:, 1]])


def supplies(area: np.ndarray, head: np.ndarray, flow: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Concentrations of the pores (mg/L), uptake (pg/m/h) and growth (um2/h) of the throats.

    Water mixes in each pore. The pores are visited from the highest head to the lowest.
    """
    upstream = np.where(flow > 0, throats[:, 0], throats[:, 1])
    downstream = throats.sum(axis=1) - upstream
    inflow, brought = np.zeros(len(head)), np.zeros((2, len(head)))
    concentration = np.where(inlets, np.array(SUPPLY)[:, None], 0.0)
    taken, growth = np.zeros((2, len(throats))), np.zeros(len(throats))
    for pore in np.argsort(-head, kind="stable"):
        if not inlets[pore]:
            concentration[:, pore] = brought[:, pore] / inflow[pore]
        leaving = np.flatnonzero((upstream == pore) & (np.abs(flow) > 1e-12))
        volume = np.abs(flow[leaving])
        uptake = repro.uptake(area[leaving], width[leaving], volume / width[leaving],
                              *concentration[:, pore], scene=SCENE)
        taken[:, leaving], growth[leaving] = (uptake.acceptor, uptake.donor), uptake.growth
        np.add.at(inflow, downstream[leaving], volume)
        for substrate in range(2):
            np.add.at(brought[substrate], downstream[leaving],
                      volume * concentration[substrate, pore] - taken[substrate, leaving] / FLOW)
    return concentration, taken, growth


class State(NamedTuple):
    """The network at a time. area: um2, head_loss: um, flow: m/d um, supplies: (2, n) mg/L, of the n throats; total:
    flow through the network, m/d um."""

    area: np.ndarray
    head_loss: np.ndarray
    flow: np.ndarray
    supplies: np.ndarray
    total: float


def advance(area: np.ndarray, step: float) -> Iterator[State]:
    """Yield the state every `step` hours. Heads, supplies and growth keep their values over a step."""
    for _ in range(round(END / step) + 1):
        head, flow = heads(area)
        concentration, taken, growth = supplies(area, head, flow)
        total = balanced(flow, concentration, taken)
        upstream = np.where(flow > 0, throats[:, 0], throats[:, 1])
        yield State(area, head[throats[:, 0]] - head[throats[:, 1]], flow, concentration[:, upstream], total)
        area = np.maximum(area + step * growth, 0.0)


def balanced(flow: np.ndarray, concentration: np.ndarray, taken: np.ndarray) -> float:
    """The flow through the network (m/d um), after a check of the balances of water and both substrates."""
    across = np.where(inlets[throats[:, 0]] != inlets[throats[:, 1]], np.abs(flow), 0.0)
    leaving = np.where(outlets[throats[:, 0]] != outlets[throats[:, 1]], np.abs(flow), 0.0)
    effluent = (leaving * concentration[:, np.where(flow > 0, throats[:, 0], throats[:, 1])]).sum(axis=1) * FLOW
    last = outlets[throats].any(axis=1)
    brought = np.array(SUPPLY) * across.sum() * FLOW
    assert np.isclose(leaving.sum(), across.sum(), rtol=1e-8)
    assert np.allclose(taken[:, ~last].sum(axis=1), brought - effluent, rtol=1e-6, atol=1e-8 * brought.max())
    return across.sum()


states = list(advance(area, STEP))
total = [state.total for state in states]
print(f"flow after {END:g} h over that at 0 h: {total[-1] / total[0]:.4g}")
print(f"touching both walls: {(states[-1].area > 1.51 * width**2).sum()} of {len(throats)} throats")
