"""The inputs of base and wide, those that Table 1 prints with so many digits and those that are taken as exact; and the
numbers that a run comes to, each run computed once and kept on the disk.

What the rounding of Table 1 allows in base and wide: elasticities, one set of inputs for all printed numbers of
base, and Sobol indices.

**Elasticities** d ln(number) / d ln(input), by central differences. Two runs on either side at two distances give two
estimates; the nearer one counts, and their difference is its bar: it holds what the larger distance adds to the error
of the difference, and what two runs on unrelated meshes differ by. An elasticity is resolved where its bar is at most a
tenth of it.

**One set** within the rounding: a linear program, then real runs. With relative changes x_i of the inputs, r_i their
rounding and e_ni the elasticities, the program is

    minimise t    such that    |x_i| <= t r_i    and    low_n <= f_n (1 + sum_i e_ni x_i) <= high_n

so that t <= 1 is a set within the rounding. A run with it moves f_n by what is not linear, and the program is solved
again from there. Where t > 1 the misfit that is left at t = 1 is minimised instead. The runs are made on SET_SIZES, and
low_n and high_n are the ends of the printed interval moved inwards by the numerical bar of f_n from all of them, so
that a set is reached where f_n lies in the interval with the whole of its bar.

**Sobol indices** of base: how much of the variance of each printed number an input's rounding accounts for. Inputs are
independent and uniform within their rounding; those whose elasticity moves no printed number by half a percent a
percent are left where they are. `scipy.stats.sobol_indices` (Saltelli 2010) with N (d + 2) runs in the preset "fast",
and its bootstrap's intervals.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from functools import cache
from hashlib import sha256
from math import log
from operator import itemgetter
from pathlib import Path

import numpy as np
from scipy.optimize import linprog
from scipy.stats import sobol_indices, uniform

from repro.march import simulation, updates
from repro.model import kinetics, pore
from repro.results import M_PER_D
from repro.scene import Scene, load_scene, needed, scene_hash
from verification.claims import interval
from verification.claims.base_run import DISTANCES, END, upstream_means
from verification.claims.evaluate import MESH_ORDERS
from verification.claims.levels import converged
from verification.claims.runs import ending
from verification.kernel.writing import append, lines
from verification.uncertainty import estimate


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


KEPT = Path(__file__).parent / "out" / "runs.jsonl"
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
    first, shaped, last = simulation.simulate(ending(said, plotted, END))
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
    said = ending(said, said.growth.end)
    touching = next(state for state, _ in simulation.steps(said) if state.pore.contact)
    *_, (_, last) = simulation.steps(ending(said, touching.pore.time + AFTER), touching)
    return {"contact_time": touching.pore.time, "conductivity_after": M_PER_D * last.solved.flow.conductivity}


OF: dict[str, Callable[[Scene], Numbers]] = {"base": of_base, "wide": of_wide}


#: Rooms of `repro` whose source makes these numbers: that of a scene is in its hash.
ROOMS = ("fem", "model", "march", "results")


@cache
def source() -> str:
    """8 hexadecimal digits that stand for the source of ROOMS."""
    digest = sha256()
    package = Path(simulation.__file__).parents[1]
    for path in sorted(path for room in ROOMS for path in (package / room).rglob("*.py")):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:8]


class Runs:
    """Runs that have been computed with this source; each new one is a line of the file at once, so that a break loses
    no more than those under way."""

    def __init__(self, path: Path = KEPT) -> None:
        self.path = path
        self.known: dict[str, Numbers] = {row["run"]: row["numbers"] for row in lines(path)
                                          if row["run"].endswith(source())}

    def numbers(self, said: Scene) -> Numbers:
        """What a scene's run comes to."""
        key = _key(said)
        if key not in self.known:
            self._keep(key, computed(OF[said.name], said))
        return self.known[key]

    def ahead(self, scenes: Iterable[Scene]) -> None:
        """Runs of scenes that are not known yet, on all cores."""
        asked = {_key(said): said for said in scenes}
        missing = {key: said for key, said in asked.items() if key not in self.known}
        if not missing:
            return
        print(f"{len(missing)} runs", flush=True)
        with ProcessPoolExecutor(max_workers=os.cpu_count()) as pool:
            waiting = {pool.submit(computed, OF[said.name], said): key for key, said in missing.items()}
            for done in as_completed(waiting):
                self._keep(waiting[done], done.result())

    def _keep(self, key: str, numbers: Numbers) -> None:
        self.known[key] = numbers
        append({"run": key, "numbers": numbers}, self.path)


def computed(function: Callable[[Scene], Numbers], said: Scene) -> Numbers:
    """What a run comes to, with no operation that fails silently."""
    with np.errstate(all="raise", under="ignore"):
        return {name: float(value) for name, value in function(said).items()}


def _key(said: Scene) -> str:
    return f"{said.name}-{scene_hash(said)}-{source()}"


#: Relative distances of an input from its printed value; the larger one of an input that is taken as exact.
NEAR, FAR = 0.01, 0.02
LARGE = 0.1
RESOLVED = 0.1


def elasticities(runs: Runs, name: str) -> dict[str, dict[str, dict]]:
    """{number: {input: elasticity, bar, resolved, and the changes (%) that +-10 % of an exact input make}}."""
    inputs = [each for each in INPUTS if each.only in ("", name)]
    runs.ahead(scene(name, {each.name: factor}) for each in inputs for factor in _factors(each))
    plain, found = runs.numbers(scene(name, {})), {}
    for each in inputs:
        for number, value in _of_input(runs, name, each, plain).items():
            found.setdefault(number, {})[each.name] = value
    return found


def _distances(each: Input) -> tuple[float, ...]:
    """At which its differences are taken."""
    return (NEAR, FAR) if each.half else (NEAR, FAR, LARGE)


def _factors(each: Input) -> list[float]:
    """On an input, above and below its value, of all of its runs."""
    return [1 + sign * distance for distance in _distances(each) for sign in (1, -1)]


def _of_input(runs: Runs, name: str, each: Input, plain: Numbers) -> dict[str, dict]:
    pairs = {distance: _pair(runs, name, each, distance) for distance in _distances(each)}
    return {number: _told(number, value, pairs) for number, value in plain.items()}


def _pair(runs: Runs, name: str, each: Input, distance: float) -> list[Numbers]:
    """Numbers with an input above its value and below it."""
    return [runs.numbers(scene(name, {each.name: factor})) for factor in (1 + distance, 1 - distance)]


def _told(number: str, value: float, pairs: dict[float, list[Numbers]]) -> dict:
    near, far = (difference(pairs[d][0][number], pairs[d][1][number], value, d) for d in (NEAR, FAR))
    bar = abs(far - near)
    told = {"elasticity": near, "bar": bar, "resolved": bar <= RESOLVED * abs(near)}
    if LARGE in pairs:
        told["by_10_percent"] = [100 * (found[number] / value - 1) for found in pairs[LARGE]]
    return told


def difference(above: float, below: float, value: float, distance: float) -> float:
    """The central difference of ln f over ln x."""
    return (above - below) / (2 * distance * value)


#: What section 4 prints: C01-C04.
PRINTED = {"velocity_0": "2.9", "velocity": "1.5", "effluent_acceptor": "4.19", "effluent_donor": "6.13",
           "consumed": "~60"}
#: Sizes of elements and steps of the runs that make the set, the one that counts first: on 0.5, 2**-0.5 and 1 the bar
#: of the acceptor effluent, 0.005, is as wide as what its digits leave to either side.
SET_SIZES = (2**-1.5, 0.5, 2**-0.5)
#: How many bars a number is kept inside its interval.
KEPT_INSIDE = 1.5
#: The part of the interval around its middle that is aimed at; the rest is for what is not linear, of which AIMED to
#: ENOUGH is let be.
AIMED, ENOUGH = 0.4, 0.5
ROUNDS = 6


def targets() -> tuple[np.ndarray, np.ndarray]:
    """Middles and half widths of the intervals of the printed numbers."""
    low, high = np.array([interval(text) for text in PRINTED.values()]).T
    return 0.5 * (low + high), 0.5 * (high - low)


def printed_of(numbers: Numbers) -> np.ndarray:
    """Those that the paper prints."""
    return np.array([numbers[name] for name in PRINTED])


def misfit(numbers: Numbers, bars: Numbers | None = None) -> float:
    """Largest distance of a printed number, or of an end of its bar, from the middle of its interval, in half
    intervals."""
    middle, half = targets()
    apart = np.abs(printed_of(numbers) - middle) + (printed_of(bars) if bars else 0.0)
    return float((apart / half).max())


def one_set(runs: Runs, elasticities: dict[str, dict[str, dict]]) -> dict:
    """The set, what runs with it give and how well that is known, the share t of the rounding that it takes, and
    whether it is reached."""
    rows = _on_sizes(runs, {})
    start, bars = printed_of(rows[0]), _bars(rows)
    slopes = start[:, None] * _table(elasticities)
    kept = printed_of(bars)
    for _ in range(ROUNDS):
        x, t = program(start, slopes, kept)
        factors = {each.name: 1 + value for each, value in zip(ROUNDED, x)}
        numbers = runs.numbers(scene("base", factors, *converged(SET_SIZES[0])))
        if misfit(numbers) <= ENOUGH and misfit(numbers, bars) <= 1:
            break
        start = printed_of(numbers) - slopes @ x
    rows = _on_sizes(runs, factors)
    bars = _bars(rows)
    left = misfit(numbers, bars)
    return {"reached": bool(t <= 1 + 1e-9 and left <= 1), "share_of_the_rounding": t, "misfit_in_half_intervals": left,
            "inputs": {name: BY_NAME[name].value * factor for name, factor in factors.items()},
            "numbers": {name: numbers[name] for name in PRINTED}, "bars": bars, "sizes": list(SET_SIZES),
            "on_sizes": {name: column(rows, name) for name in PRINTED}}


def _table(elasticities: dict[str, dict[str, dict]]) -> np.ndarray:
    """(printed numbers, rounded inputs) their elasticities."""
    return np.array([_in_order(elasticities[name]) for name in PRINTED])


def _in_order(known: dict[str, dict]) -> list[float]:
    """Elasticities of one number."""
    return [known[each.name]["elasticity"] for each in ROUNDED]


def column(rows: list[Numbers], name: str) -> list[float]:
    """A number of some runs."""
    return [row[name] for row in rows]


def _on_sizes(runs: Runs, factors: dict[str, float]) -> list[Numbers]:
    """Numbers of base on SET_SIZES."""
    return [runs.numbers(scene("base", factors, *converged(size))) for size in SET_SIZES]


def _bars(rows: list[Numbers]) -> Numbers:
    """Of each printed number."""
    return {name: estimate(SET_SIZES, column(rows, name), MESH_ORDERS).bar for name in PRINTED}


def program(start: np.ndarray, slopes: np.ndarray, bars: np.ndarray) -> tuple[np.ndarray, float]:
    """Relative changes and the share of the rounding that they take; within it, with the least misfit, where the
    intervals, less the bars, are out of reach."""
    middle, half = targets()
    rounding = np.array([each.rounding for each in ROUNDED])
    A, unit = slopes * rounding, np.eye(len(rounding))
    both, aimed = np.vstack([A, -A]), np.minimum(half - KEPT_INSIDE * bars, AIMED * half)
    none, ones = np.zeros((len(both), 1)), np.ones((len(rounding), 1))
    tight = np.block([[both, none], [unit, -ones], [-unit, -ones]])
    inside = np.concatenate([middle + aimed - start, start - middle + aimed, np.zeros(2 * len(rounding))])
    best = _solved(tight, inside, None)
    if best is not None and best[-1] <= 1:
        return best[:-1] * rounding, float(best[-1])
    loose = np.column_stack([both, -np.tile(half, 2)])
    least = _solved(loose, np.concatenate([middle - start, start - middle]), 1.0)
    return least[:-1] * rounding, float(best[-1]) if best is not None else float("inf")


def _solved(A: np.ndarray, b: np.ndarray, box: float | None) -> np.ndarray | None:
    """Minimise the last unknown; the others within +-box."""
    bounds = [(None if box is None else -box, box)] * (A.shape[1] - 1) + [(0, None)]
    answer = linprog(np.append(np.zeros(A.shape[1] - 1), 1.0), A, b, bounds=bounds)
    return answer.x if answer.success else None


LEAST, CONFIDENCE = 0.005, 0.95
#: Samples.
SAMPLES = 512
SEED = 2001
FAST = ('numerics.preset="fast"',)


def moving(elasticities: dict[str, dict[str, dict]]) -> list[Input]:
    """Rounded inputs with an elasticity above LEAST of any printed number."""
    most = np.abs(_table(elasticities)).max(axis=0)
    return [each for each, largest in zip(ROUNDED, most) if largest > LEAST]


def sobol(runs: Runs, elasticities: dict[str, dict[str, dict]], samples: int = SAMPLES) -> dict:
    """First-order and total indices of each printed number, with their intervals."""
    chosen = moving(elasticities)
    inputs = [each.name for each in chosen]
    moved = np.abs(_table(elasticities)).max(axis=1) > LEAST
    names = [name for name, moves in zip(PRINTED, moved) if moves and name != "consumed"]

    def numbers(x: np.ndarray) -> np.ndarray:
        scenes = [scene("base", dict(zip(inputs, column)), *FAST) for column in x.T]
        runs.ahead(scenes)
        rows = [runs.numbers(said) for said in scenes]
        return np.array([itemgetter(*names)(row) for row in rows]).T
    spread = [uniform(1 - each.rounding, 2 * each.rounding) for each in chosen]
    found = sobol_indices(func=numbers, n=samples, dists=spread, rng=np.random.default_rng(SEED))
    sure = found.bootstrap(confidence_level=CONFIDENCE, n_resamples=999)
    return {"samples": samples, "inputs": inputs, "confidence": CONFIDENCE,
            "numbers": {name: {"first_order": _listed(found.first_order, sure.first_order, row),
                               "total_order": _listed(found.total_order, sure.total_order, row)}
                        for row, name in enumerate(names)}}


def _listed(values: np.ndarray, sure, row: int) -> list[list[float]]:
    """[index, low, high] of each input."""
    interval = sure.confidence_interval
    return np.column_stack([values[row], interval.low[row], interval.high[row]]).tolist()
