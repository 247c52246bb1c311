"""The inputs of base and wide, rounded in Table 1 or taken as exact, and the numbers of each run, which are computed
once and stored on the disk.

The effects of the rounding of Table 1 on base and wide: elasticities, one set of inputs for all printed numbers of
base, and Sobol indices.

**Elasticities** d ln(number) / d ln(input), by central differences. Two runs on either side at two distances give two
estimates. The nearer one counts, and their difference is its bar: it contains the additional error of the larger
distance and the difference of two runs on unrelated meshes. An elasticity is resolved if its bar is at most a tenth of
it.

**One set** within the rounding: a linear program, then real runs. With relative changes x_i of the inputs, r_i their
rounding and e_ni the elasticities, the program is

    minimise t    such that    |x_i| <= t r_i    and    low_n <= f_n (1 + sum_i e_ni x_i) <= high_n

so that t <= 1 is a set within the rounding. A run with the set gives the nonlinear part of f_n, and the program is
solved again from there. If t > 1, the misfit at t = 1 is minimised instead. The runs use SET_SIZES; low_n and high_n
are the ends of the printed interval, moved inwards by the numerical bar of f_n from all sizes, so that a set is reached
if f_n lies in the interval with its full bar.

**Sobol indices** of base: the share of an input's rounding in the variance of each printed number. Inputs are
independent and uniform within their rounding; inputs whose elasticity is at most 0.005 for all printed numbers are
fixed. `scipy.stats.sobol_indices` (Saltelli 2010) with N (d + 2) runs in the preset "fast",
and its bootstrap's intervals.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from math import log
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import linprog
from scipy.stats import sobol_indices, uniform

from repro.march import simulation
from repro.march.state import RestartState
from repro.model import solving
from repro.model.kinetics import rate_law
from repro.model.stages import Stages
from repro.results import M_PER_D
from repro.scene import Scene, load_scene, needed
from verification.claims import interval
from verification.claims.base_run import DISTANCES, END, upstream_means
from verification.claims.evaluate import MESH_ORDERS
from verification.claims.levels import converged
from verification.claims.runs import ending
from verification.store import Numbers
from verification.uncertainty import estimate


@dataclass(frozen=True)
class Input:
    """name: in the paper; paths: keys of the scene in proportion to it; value: as printed; half: half a unit of its
    last digit, zero for an exact input; only: the scene it belongs to, empty for both."""

    name: str
    paths: tuple[str, ...]
    value: float = 0.0
    half: float = 0.0
    only: str = ""

    @property
    def rounding(self) -> float:
        """The half unit over the value."""
        return self.half / self.value


def _of(substrate: str, *keys: str) -> tuple[str, ...]:
    return tuple(f"substrates.{substrate}.{key}" for key in keys)


ROUNDED = (
    Input("k", ("kinetics.maximum_utilization_rate",), 9.3, 0.05),
    Input("Y", ("kinetics.yield_coefficient",), 0.61, 0.005),
    Input("b", ("kinetics.decay_coefficient",), 0.12, 0.005),
    Input("f_d", ("kinetics.degradable_fraction",), 0.8, 0.05),
    Input("d_c", ("kinetics.decay_oxygen_demand",), 1.42, 0.005),
    Input("F", ("kinetics.acceptor_to_donor_ratio",), 1.52, 0.005),
    Input("D_a", _of("acceptor", "diffusivity"), 2.32, 0.005),
    Input("D_fa", _of("acceptor", "diffusivity_in_aggregate"), 1.85, 0.005),
    Input("D_d", _of("donor", "diffusivity"), 1.01, 0.005),
    Input("D_fd", _of("donor", "diffusivity_in_aggregate"), 0.81, 0.005),
)
#: Section 2.2 sets both K_s to 1 mg/L. They are a choice, not a rounded measurement, so no set of inputs changes them.
#: The supply is printed as 10 K_s, and goes with K_s.
EXACT = (
    Input("K_sA", _of("acceptor", "half_saturation", "supply")),
    Input("K_sD", _of("donor", "half_saturation", "supply")),
    Input("X_m", ("kinetics.maximum_density",)),
    Input("R_0", ("aggregate.radius",)),
    Input("W_pore", ("pore.width",)),
    Input("L_pore", ("pore.length",)),
    Input("head", ("flow.head",), only="base"),
    Input("u_ave", ("flow.mean_velocity",), only="wide"),
    Input("supply of acceptor", _of("acceptor", "supply")),
    Input("supply of donor", _of("donor", "supply")),
    Input("lambda", ("flow.viscosity_ratio",)),
    Input("mu_L", ("growth.shear_modulus",)),
    Input("film", ("growth.minimum_film",)),
    Input("contact angle", ("growth.minimum_contact_angle",)),
    Input("time step", ("growth.time_step",)),
)
INPUTS = ROUNDED + EXACT
BY_NAME = {each.name: each for each in INPUTS}


def changed(scene: Scene, factors: dict[str, float]) -> Scene:
    """A scene with some inputs, by name, times factors."""
    for name, factor in factors.items():
        for path in BY_NAME[name].paths:
            scene = _scaled(scene, path.split("."), factor)
    return scene


def _scaled(node, keys: list[str], factor: float):
    first, *rest = keys
    part = needed(getattr(node, first), ".".join(keys))
    return replace(node, **{first: _scaled(part, rest, factor) if rest else factor * part})


RUNS_FILE = Path(__file__).parent / "out" / "runs.jsonl"
#: Time (h) from contact to the conductivity that is studied.
AFTER = 4.0

Row = dict[str, float]


def load_varied(name: str, factors: dict[str, float], *changes: str) -> Scene:
    """Base or wide in the converged solution's preset, or with other numerics, with inputs times factors."""
    return changed(load_scene(name, changes or converged(1.0)), factors)


def of_base(scene: Scene) -> Row:
    """The numbers that section 4 prints, concentrations in K_s. "Before the aggregate expands" means the shape one time
    step before 19.4 h, with the biomass that has grown in it since [E12]."""
    plotted = END - scene.growth.time_step
    first, shaped, last = simulation.simulate(ending(scene, plotted, END))
    grown, _, _ = Stages.of(scene).transport.make_biomass(shaped.pore, shaped.solved,
                                                            scene.growth.time_step)
    solved = solving.solve(scene, grown)
    halves = [substrate.half_saturation for substrate in solved.problem.kinds]
    acceptor, donor = (flux.effluent / half for flux, half in zip(solved.fluxes, halves))
    supply = [substrate.supply for substrate in solved.problem.kinds]
    rate = float(rate_law(scene.substrates, scene.kinetics).growth_rate(*supply))
    return {"velocity_0": M_PER_D * first.solved.flow.mean_velocity,
            "velocity": M_PER_D * shaped.solved.flow.mean_velocity,
            "effluent_acceptor": acceptor, "effluent_donor": donor,
            "consumed": 100 * (1 - acceptor * halves[0] / supply[0]),
            **{f"acceptor_at_{d:g}": upstream_means(grown, solved, d)[0] / halves[0] for d in DISTANCES},
            "inert": 100 * last.pore.composition(scene.kinetics.maximum_density)[0],
            "area": shaped.pore.boundary.area,
            "doubling": plotted * log(2) / log(shaped.pore.boundary.area / first.pore.boundary.area),
            "doubling_at_supply": log(2) / rate}


def of_wide(scene: Scene) -> Row:
    """Contact with the opposite wall (h), and the conductivity (m/d) some hours after it."""
    state = touching(ending(scene, scene.growth.end))
    time = state.pore.time
    *_, (_, last) = simulation.steps(ending(scene, time + AFTER), state)
    return {"contact_time": time, "conductivity_after": M_PER_D * last.solved.flow.conductivity}


def touching(scene: Scene) -> RestartState:
    """The first state of a run in which the aggregate touches the opposite wall."""
    return next(state for state, _ in simulation.steps(scene) if state.pore.contact)


OF: dict[str, Callable[[Scene], Row]] = {"base": of_base, "wide": of_wide}


class Runs(Numbers):
    """The numbers of runs, one line of the file per run."""

    def __init__(self, file: Path = RUNS_FILE) -> None:
        super().__init__(computed, file)


def computed(scene: Scene) -> dict[str, float]:
    """The numbers of a run; floating-point errors raise."""
    with np.errstate(all="raise", under="ignore"):
        return {name: float(value) for name, value in OF[scene.name](scene).items()}


#: Relative distances of an input from its printed value; the larger distance for an input that is taken as exact.
NEAR, FAR = 0.01, 0.02
LARGE = 0.1
RESOLVED = 0.1


def elasticities(runs: Runs, name: str) -> dict[str, dict[str, dict]]:
    """{number: {input: elasticity, bar, resolved, and the changes (%) caused by +-10 % of an exact input}}."""
    inputs = [parameter for parameter in INPUTS if parameter.only in ("", name)]
    runs.get_all(scene for parameter in inputs for scene in _scenes_around(name, parameter))
    plain = runs.get(load_varied(name, {}))
    by_number: dict[str, dict[str, dict]] = {number: {} for number in plain}
    for parameter in inputs:
        rows = [*map(runs.get, _scenes_around(name, parameter))]
        for number, value in plain.items():
            by_number[number][parameter.name] = _elasticity(value, column(rows, number))
    return by_number


def _scenes_around(name: str, parameter: Input) -> list[Scene]:
    """Scenes with an input above and below its value, at all distances of the central differences."""
    distances = (NEAR, FAR) if parameter.half else (NEAR, FAR, LARGE)
    return [load_varied(name, {parameter.name: 1 + sign * distance}) for distance in distances for sign in (1, -1)]


def _elasticity(value: float, moved: list[float]) -> dict:
    """Elasticity of one number by one input: central differences of ln f over ln x."""
    near = (moved[0] - moved[1]) / (2 * NEAR * value)
    far = (moved[2] - moved[3]) / (2 * FAR * value)
    bar = abs(far - near)
    elasticity = {"elasticity": near, "bar": bar, "resolved": bar <= RESOLVED * abs(near)}
    if moved[4:]:
        elasticity["by_10_percent"] = [100 * (moved_value / value - 1) for moved_value in moved[4:]]
    return elasticity


#: What section 4 prints: C01-C04.
PRINTED = {"velocity_0": "2.9", "velocity": "1.5", "effluent_acceptor": "4.19", "effluent_donor": "6.13",
           "consumed": "~60"}
#: The intervals of the printed numbers, their middles and half widths.
INTERVALS = np.array([interval(text) for text in PRINTED.values()])
MIDDLE, HALF = INTERVALS.mean(axis=1), np.ptp(INTERVALS, axis=1) / 2
#: Sizes of elements and steps of the runs that make the set, the one that counts first: on 0.5, 2**-0.5 and 1 the bar
#: of the acceptor effluent, 0.005, is as wide as half a unit of its last digit.
SET_SIZES = (2**-1.5, 0.5, 2**-0.5)
#: Distance of a number from the ends of its interval, in bars.
BARS_INSIDE = 1.5
#: The program aims at this part of the half interval; the rest is a margin for nonlinearity. A misfit up to
#: MISFIT_GOAL ends the search.
AIMED, MISFIT_GOAL = 0.4, 0.5
ROUNDS = 6


def printed_of(numbers: Numbers) -> np.ndarray:
    """The numbers that the paper prints."""
    return np.array([numbers[name] for name in PRINTED])


def misfit(numbers: Row, bars: ArrayLike = 0.0) -> float:
    """Largest distance of a printed number, or of an end of its bar, from the middle of its interval, in half
    intervals."""
    return float(((np.abs(printed_of(numbers) - MIDDLE) + bars) / HALF).max())


def one_set(runs: Runs, elasticities: dict[str, dict[str, dict]]) -> dict:
    """The set, the numbers of its runs with their bars, the share t of the rounding that it uses, and whether it is
    reached."""
    rows = _on_sizes(runs, {})
    start, bars = rows[0], _bars(rows)
    slopes = start[:, None] * _table(elasticities)
    for _ in range(ROUNDS):
        x, t = program(start, slopes, bars)
        factors = {parameter.name: 1 + value for parameter, value in zip(ROUNDED, x)}
        numbers = runs.get(load_varied("base", factors, *converged(SET_SIZES[0])))
        if misfit(numbers) <= MISFIT_GOAL and misfit(numbers, bars) <= 1:
            break
        start = printed_of(numbers) - slopes @ x
    rows = _on_sizes(runs, factors)
    final_misfit = misfit(numbers, _bars(rows))
    return {"reached": bool(t <= 1 + 1e-9 and final_misfit <= 1), "share_of_the_rounding": t,
            "misfit_in_half_intervals": final_misfit,
            "inputs": {name: BY_NAME[name].value * factor for name, factor in factors.items()},
            "numbers": {name: numbers[name] for name in PRINTED}, "bars": dict(zip(PRINTED, _bars(rows).tolist())),
            "sizes": list(SET_SIZES), "on_sizes": dict(zip(PRINTED, rows.T.tolist()))}


def _table(elasticities: dict[str, dict[str, dict]]) -> np.ndarray:
    """(printed numbers, rounded inputs) elasticities."""
    listed = [elasticities[name][parameter.name]["elasticity"] for name, parameter in product(PRINTED, ROUNDED)]
    return np.reshape(listed, (len(PRINTED), -1))


def column(rows: list[Row], name: str) -> list[float]:
    """One number of each run."""
    return [row[name] for row in rows]


def _on_sizes(runs: Runs, factors: dict[str, float]) -> np.ndarray:
    """(sizes, printed numbers) of base on SET_SIZES."""
    rows = runs.get_all(load_varied("base", factors, *converged(size)) for size in SET_SIZES)
    return np.array([*map(printed_of, rows)])


def _bars(rows: np.ndarray) -> np.ndarray:
    """(printed numbers,) bars."""
    return np.array([estimate(SET_SIZES, values, MESH_ORDERS).bar for values in rows.T])


def program(start: np.ndarray, slopes: np.ndarray, bars: np.ndarray) -> tuple[np.ndarray, float]:
    """Relative changes of the inputs and the share of the rounding that they use. If the intervals, less the bars, are
    out of reach, the changes within the rounding that have the least misfit."""
    rounding = np.array([parameter.rounding for parameter in ROUNDED])
    aimed = np.minimum(HALF - BARS_INSIDE * bars, AIMED * HALF)
    system = slopes * rounding, MIDDLE - start
    zero_widths = 0 * HALF
    ones = np.ones(len(rounding))
    best = _solved(*system, aimed, zero_widths, 0 * ones, ones)
    share = best[-1] if best is not None else np.inf
    if share > 1:
        best = _solved(*system, zero_widths, HALF, ones, 0 * ones)
    return best[:-1] * rounding, float(share)


def _solved(A: np.ndarray, b: np.ndarray, *within: np.ndarray) -> np.ndarray | None:
    """The y and, last, the least t with |A y - b| <= c + t d and |y| <= e + t f; None if there is none. within: c,
    d, e and f."""
    c, d, e, f = within
    unit = np.eye(len(f))
    rows = np.vstack([A, -A, unit, -unit])
    answer = linprog([*0 * f, 1.0], np.column_stack([rows, -np.concatenate([d, d, f, f])]),
                     np.concatenate([c + b, c - b, e, e]), bounds=[(None, None)] * len(f) + [(0, None)])
    return answer.x if answer.success else None


LEAST, CONFIDENCE = 0.005, 0.95
#: Samples.
SAMPLES = 512
SEED = 2001
FAST = ('numerics.preset="fast"',)


def sobol(runs: Runs, elasticities: dict[str, dict[str, dict]], samples: int = SAMPLES) -> dict:
    """First-order and total indices of each printed number, with their intervals."""
    moves = np.abs(_table(elasticities)) > LEAST
    chosen = [parameter for parameter, is_moving in zip(ROUNDED, moves.any(axis=0)) if is_moving]
    inputs = [parameter.name for parameter in chosen]
    names = [name for name, is_moved in zip(PRINTED, moves.any(axis=1)) if is_moved and name != "consumed"]

    def numbers(x: np.ndarray) -> list[list[float]]:
        rows = runs.get_all(load_varied("base", dict(zip(inputs, factors)), *FAST) for factors in x.T)
        return [column(rows, name) for name in names]
    spread = [uniform(1 - parameter.rounding, 2 * parameter.rounding) for parameter in chosen]
    indices = sobol_indices(func=numbers, n=samples, dists=spread, rng=np.random.default_rng(SEED))
    bootstrap = indices.bootstrap(confidence_level=CONFIDENCE, n_resamples=999)
    orders = zip(names, _listed(indices.first_order, bootstrap.first_order),
                 _listed(indices.total_order, bootstrap.total_order))
    return {"samples": samples, "inputs": inputs, "confidence": CONFIDENCE,
            "numbers": {name: {"first_order": first, "total_order": total} for name, first, total in orders}}


def _listed(values: np.ndarray, bootstrap) -> list[list[list[float]]]:
    """[index, low, high] of each number and input."""
    interval = bootstrap.confidence_interval
    return np.stack([values, interval.low, interval.high], axis=-1).tolist()
