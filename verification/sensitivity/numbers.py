"""The inputs of base and wide, those that Table 1 prints with so many digits and those that are taken as exact; and the
numbers that a run comes to, each run computed once and kept on the disk."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import log
from pathlib import Path

import numpy as np

from repro.march import simulation, updates
from repro.model import kinetics, pore
from repro.results import M_PER_D, write_json
from repro.run.machine import source_hash
from repro.scene import Scene, load_scene, needed, scene_hash
from verification.claims.base_run import DISTANCES, END, upstream_means
from verification.claims.levels import converged


@dataclass(frozen=True)
class Input:
    """name: as the paper has it; paths: keys of the scene that go with it, in proportion; value: as printed; half: half
    a unit of its last digit, zero where it is taken as exact; only: the scene it belongs to, where not to both."""

    name: str
    paths: tuple[str, ...]
    value: float
    half: float = 0.0
    only: str = ""

    @property
    def rounding(self) -> float:
        """The half unit over the value."""
        return self.half / self.value


def _of(substrate: str, *keys: str) -> tuple[str, ...]:
    return tuple(f"substrates.{substrate}.{key}" for key in keys)


#: The supply is printed as 10 K_s, and goes with K_s.
ROUNDED = (
    Input("k", ("kinetics.maximum_utilization_rate",), 9.3, 0.05),
    Input("Y", ("kinetics.yield_coefficient",), 0.61, 0.005),
    Input("b", ("kinetics.decay_coefficient",), 0.12, 0.005),
    Input("f_d", ("kinetics.degradable_fraction",), 0.8, 0.05),
    Input("d_c", ("kinetics.decay_oxygen_demand",), 1.42, 0.005),
    Input("F", ("kinetics.acceptor_to_donor_ratio",), 1.52, 0.005),
    Input("K_sA", _of("acceptor", "half_saturation", "supply"), 1.0, 0.05),
    Input("K_sD", _of("donor", "half_saturation", "supply"), 1.0, 0.05),
    Input("D_a", _of("acceptor", "diffusivity"), 2.32, 0.005),
    Input("D_fa", _of("acceptor", "diffusivity_in_aggregate"), 1.85, 0.005),
    Input("D_d", _of("donor", "diffusivity"), 1.01, 0.005),
    Input("D_fd", _of("donor", "diffusivity_in_aggregate"), 0.81, 0.005),
)
EXACT = (
    Input("X_m", ("kinetics.maximum_density",), 30000.0),
    Input("R_0", ("aggregate.radius",), 5.0),
    Input("W_pore", ("pore.width",), 50.0),
    Input("L_pore", ("pore.length",), 600.0),
    Input("head", ("flow.head",), 1e-3, only="base"),
    Input("u_ave", ("flow.mean_velocity",), 2.9, only="wide"),
    Input("supply of acceptor", _of("acceptor", "supply"), 10.0),
    Input("supply of donor", _of("donor", "supply"), 10.0),
    Input("lambda", ("flow.viscosity_ratio",), 2000.0),
    Input("mu_L", ("growth.shear_modulus",), 0.01),
    Input("film", ("growth.minimum_film",), 2.0),
    Input("contact angle", ("growth.minimum_contact_angle",), 16.7),
    Input("time step", ("growth.time_step",), 12.0),
)
INPUTS = ROUNDED + EXACT
BY_NAME = {each.name: each for each in INPUTS}


def changed(said: Scene, factors: dict[str, float]) -> Scene:
    """A scene with some inputs, by name, times factors."""
    for name, factor in factors.items():
        for path in BY_NAME[name].paths:
            said = _scaled(said, path.split("."), factor)
    return said


def _scaled(node, keys: list[str], factor: float):
    first, *rest = keys
    part = needed(getattr(node, first), ".".join(keys))
    return replace(node, **{first: _scaled(part, rest, factor) if rest else factor * part})


def factors_of(values: dict[str, float]) -> dict[str, float]:
    """Values of inputs, in the paper's units, over those printed."""
    return {name: value / BY_NAME[name].value for name, value in values.items()}


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
