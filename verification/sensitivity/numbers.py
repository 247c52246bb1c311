"""The numbers that a run of base or wide comes to, each run computed once and kept on the disk."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from math import log
from pathlib import Path

import numpy as np

from repro.march import simulation, updates
from repro.model import kinetics, pore
from repro.results import M_PER_D, write_json
from repro.run.machine import source_hash
from repro.scene import Scene, load_scene, scene_hash
from verification.claims.base_run import DISTANCES, END, upstream_means
from verification.claims.levels import converged
from verification.sensitivity.inputs import changed

KEPT = Path(__file__).parent / "out" / "runs.json"
#: Conductivity is asked for so long after contact, h.
AFTER = 4.0

Numbers = dict[str, float]


def scene(name: str, factors: dict[str, float], *changes: str) -> Scene:
    """Base or wide in the converged solution's preset, or with other numerics, with inputs times factors."""
    return changed(load_scene(name, changes or converged(1.0)), factors)


def of_base(said: Scene) -> Numbers:
    """What section 4 prints, concentrations in K_s; "before the aggregate expands" is the shape a time step before
    19.4 h with what grows in it [E12]."""
    plotted = END - said.growth.time_step
    said = replace(said, growth=replace(said.growth, end=END), output=replace(said.output, times=(plotted, END)))
    first, shaped, last = simulation.simulate(said)
    grown, _, _ = updates.make_biomass(said, shaped.pore, shaped.solved, said.growth.time_step)
    found = pore.solve(said, grown)
    halves = [each.half_saturation for each in found.problem.both]
    acceptor, donor = (flux.effluent / half for flux, half in zip(found.fluxes, halves))
    supply = [each.supply for each in found.problem.both]
    rate = float(kinetics.growth_rate(*supply, said.substrates, said.kinetics))
    return {"velocity_0": M_PER_D * first.solved.flow.mean_velocity,
            "velocity": M_PER_D * shaped.solved.flow.mean_velocity,
            "effluent_acceptor": acceptor, "effluent_donor": donor,
            "consumed": 100 * (1 - acceptor * halves[0] / supply[0]),
            **{f"acceptor_at_{d:g}": upstream_means(grown, found, d)[0] / halves[0] for d in DISTANCES},
            "inert": 100 * last.pore.composition(said.kinetics.maximum_density)[0],
            "area": shaped.pore.boundary.area,
            "doubling": plotted * log(2) / log(shaped.pore.boundary.area / first.pore.boundary.area),
            "doubling_at_supply": log(2) / rate}


def of_wide(said: Scene) -> Numbers:
    """Contact with the opposite wall (h), and the conductivity (m/d) some hours after it."""
    said = replace(said, output=replace(said.output, times=(said.growth.end,)))
    touching = next(state for state, _ in simulation.steps(said) if state.pore.contact)
    end = touching.pore.time + AFTER
    later = replace(said, growth=replace(said.growth, end=end), output=replace(said.output, times=(end,)))
    *_, (_, last) = simulation.steps(later, touching)
    return {"contact_time": touching.pore.time, "conductivity_after": M_PER_D * last.solved.flow.conductivity}


OF: dict[str, Callable[[Scene], Numbers]] = {"base": of_base, "wide": of_wide}


class Runs:
    """Runs that have been computed with this source; each new one is kept at once, so that a break loses one run."""

    def __init__(self, path: Path = KEPT) -> None:
        self.path = path
        self.known: dict[str, Numbers] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}

    def numbers(self, said: Scene) -> Numbers:
        """What a scene's run comes to."""
        key = f"{said.name}-{scene_hash(said)}-{source_hash()}"
        if key not in self.known:
            with np.errstate(all="raise", under="ignore"):
                self.known[key] = {name: float(value) for name, value in OF[said.name](said).items()}
            self.path.parent.mkdir(exist_ok=True)
            write_json(self.path, self.known)
        return self.known[key]
