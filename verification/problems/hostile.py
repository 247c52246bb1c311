"""Physically plausible scenes that are difficult for the solver, drawn by seed.

They have tables that jump, odd outlines, permeable bodies, transient substrates, soft bodies under the flow, closed
pores, starved seeds, dense rows, still water or contact. From :data:`FIRST_LATER` on they have one substrate alone,
another law of uptake, unlimited decay or a bonded wall. From :data:`FIRST_BODIES` on they have several aggregates.
These may meet, leave the pore or erode. ``scene(seed)`` gives the tables of a scene as in TOML, each value a text with
its unit. Seeds take the kinds of :data:`KINDS`, then those of :data:`LATER`, and then those of :data:`BODIES`, in turn.
"""

from collections.abc import Callable

import numpy as np

Random = np.random.Generator


def scene(seed: int) -> dict:
    """The tables of a member of the family."""
    random = np.random.default_rng(seed)
    tables = _plain(random)
    _kinds(seed)[kind(seed)](random, tables)
    tables["output"] = tables.get("output") or {"times": _rows(random, _hours(tables["growth"]["end"]))}
    return tables


def kind(seed: int) -> str:
    """The kind of a member: the feature that makes it hostile."""
    kinds = _kinds(seed)
    return tuple(kinds)[seed % len(kinds)]


def _kinds(seed: int) -> dict[str, Callable[[Random, dict], None]]:
    return KINDS if seed < FIRST_LATER else LATER if seed < FIRST_BODIES else BODIES


def with_other_rows(tables: dict, seed: int) -> dict:
    """The scene with half of its rows and two new ones."""
    random = np.random.default_rng((seed, 1))
    end = _hours(tables["growth"]["end"])
    retained = tables["output"]["times"][::-2]
    times = {*map(_hours, retained), *_inner(random, end, 2)}
    return {**tables, "output": {"times": [f"{time!r} h" for time in sorted(times)]}}


def _spread(random: Random, low: float, high: float) -> float:
    """A number whose logarithm is uniform."""
    return float(low * (high / low) ** random.uniform())


def _hours(text: str) -> float:
    return float(text.split()[0])


def _um(value: float) -> str:
    return f"{value:.6g} um"


def _inner(random: Random, end: float, count: int) -> list[float]:
    """Times within a run, h."""
    return [float(time) for time in np.round(random.uniform(0.02, 0.98, count) * end, 6)]


def _rows(random: Random, end: float) -> list[str]:
    """Three rows within the run, the start, and often the end."""
    times = {0.0, *_inner(random, end, 3), *([end] if random.uniform() < 0.7 else [])}
    return [f"{time!r} h" for time in sorted(times)]


def _plain(random: Random) -> dict:
    """A seed in a pore with flow. Its numbers lie in the ranges of pores in soils and filters."""
    width = _spread(random, 15.0, 120.0)
    end = round(_spread(random, 0.4, 6.0), 3)
    return {
        "pore": {"width": _um(width), "length": _um(width * random.uniform(6.0, 12.0))},
        "aggregate": {"radius": _um(width * _spread(random, 0.05, 0.6))},
        "flow": {"mean_velocity": f"{_spread(random, 0.03, 50.0):.4g} m/day"},
        "substrates": {"acceptor": _substrate(random), "donor": _substrate(random)},
        "kinetics": {"maximum_utilization_rate": f"{_spread(random, 0.5, 12.0):.4g} 1/day",
                     "decay_coefficient": f"{_spread(random, 0.02, 0.5):.4g} 1/day",
                     "maximum_density": f"{_spread(random, 5e3, 1e5):.4g} mg/L"},
        "growth": {"end": f"{end!r} h"},
        "numerics": {"preset": "fast"},
    }


def _substrate(random: Random) -> dict:
    return {"supply": f"{_spread(random, 0.3, 30.0):.4g} mg/L",
            "half_saturation": f"{_spread(random, 0.1, 5.0):.4g} mg/L"}


def _updates(tables: dict, transport: str) -> None:
    """Set three steps of the paper's scheme."""
    step = _hours(tables["growth"]["end"]) / 3
    tables["growth"]["time_step"] = f"{step!r} h"
    tables["numerics"] |= {"preset": "paper", "transport": transport}


def _width(tables: dict) -> float:
    return float(tables["pore"]["width"].split()[0])


def _table(random: Random, end: float, value: str, low: float, high: float) -> list[list[str]]:
    """A table of two to four jumps from a value. Each multiplies it by a random factor."""
    size, unit = value.split(" ", 1)
    times = [0.0, *sorted(_inner(random, end, int(random.integers(2, 5))))]
    factors = [1.0, *(_spread(random, low, high) for _ in times[1:])]
    return [[f"{time!r} h", f"{float(size) * factor:.4g} {unit}"] for time, factor in zip(times, factors)]


def jumps(random: Random, tables: dict) -> None:
    """Tables of the drive and of a supply, with a row at a jump and the end after the last row."""
    end = _hours(tables["growth"]["end"])
    drive = tables["flow"]
    if random.uniform() < 0.5:
        drive["head"] = f"{_spread(random, 1.0, 30.0):.4g} um"
        del drive["mean_velocity"]
    key = next(iter(drive))
    drive[key] = _table(random, end, drive[key], 0.03, 30.0)
    name = ("acceptor", "donor")[int(random.integers(2))]
    fed = tables["substrates"][name]
    fed["supply"] = _table(random, end, fed["supply"], 0.02, 20.0)
    if random.uniform() < 0.3:
        fed["supply"][-1][1] = "0 mg/L"
    if random.uniform() < 0.5:
        fed["supply"] = {"table": fed["supply"], "between": "linear"}
    rows = sorted({0.0, *_inner(random, 0.8 * end, 2), _hours(drive[key][-1][0])})
    tables["output"] = {"times": [f"{time!r} h" for time in rows]}


def outlines(random: Random, tables: dict) -> None:
    """A ragged body, polygonal or smooth, that leans over its foot. Some touch the other wall."""
    width = _width(tables)
    angles = np.linspace(np.pi, 0.0, int(random.integers(4, 9)))
    radii = random.uniform(0.4, 1.3, len(angles))
    height = width * (1.0 if random.uniform() < 0.2 else _spread(random, 0.05, 0.98))
    y = radii * np.sin(angles)
    y *= height / y.max()
    x = width * _spread(random, 0.05, 0.6) * radii * np.cos(angles) + random.uniform(-1.5, 1.5) * y
    y[[0, -1]] = 0.0
    points = [(a, b) for a, b in zip(x, y)]
    if height == width:
        top = int(y.argmax())
        points.insert(top + 1, (x[top] + random.uniform(0.05, 0.4) * width, width))
    tables["aggregate"] = {"outline": [[_um(a), _um(b)] for a, b in points], "smooth": bool(random.integers(2))}


def brinkman(random: Random, tables: dict) -> None:
    """A permeable body, with permeabilities from gravel to clay, which fills up to most of the width."""
    tables["aggregate"]["radius"] = _um(_width(tables) * random.uniform(0.1, 0.9))
    tables["flow"]["permeability"] = f"{_spread(random, 1e-17, 1e-10):.3g} m^2"


def gear(random: Random, tables: dict) -> None:
    """Transient substrates, with a supply that jumps in every other scene."""
    _updates(tables, "gear")
    donor = tables["substrates"]["donor"]
    if random.uniform() < 0.5:
        donor["supply"] = _table(random, _hours(tables["growth"]["end"]), donor["supply"], 0.2, 5.0)


def forces(random: Random, tables: dict) -> None:
    """A soft body under the water's forces."""
    tables["growth"] |= {"fluid_forces": "included", "shear_modulus": f"{_spread(random, 1e-7, 1e-2):.3g} MPa"}
    tables["aggregate"]["radius"] = _um(_width(tables) * random.uniform(0.1, 0.9))
    tables["flow"]["viscosity_ratio"] = round(_spread(random, 10.0, 1e5), 3)


def closed(random: Random, tables: dict) -> None:
    """A closed pore, in which the substrates run out."""
    del tables["flow"]
    tables["substrates"]["boundary"] = "closed"
    tables["growth"]["end"] = f"{round(random.uniform(0.1, 1.0), 3)!r} h"
    _updates(tables, "gear")


def starved(random: Random, tables: dict) -> None:
    """A starved body: it has sharp fronts, or hardly any supply."""
    tables["aggregate"]["radius"] = _um(_width(tables) * random.uniform(0.3, 0.85))
    for part in tables["substrates"].values():
        supply = _spread(random, 0.01, 3.0)
        part |= {"supply": f"{supply:.4g} mg/L", "half_saturation": f"{supply * _spread(random, 1e-4, 3.0):.4g} mg/L"}


def dense(random: Random, tables: dict) -> None:
    """Rows close to each other, to the start and to the end."""
    end = _hours(tables["growth"]["end"])
    near = random.uniform() * end
    times = {0.0, 1e-6, *np.linspace(0.1 * end, 0.2 * end, 5), *(near + 1e-5 * np.arange(1, 4)), end - 1e-6, end}
    rounded = sorted({round(float(time), 9) for time in times if time <= end})
    tables["output"] = {"times": [f"{time!r} h" for time in rounded]}


def still(random: Random, tables: dict) -> None:
    """Diffusion alone. In every other scene one supply is zero, so that biomass only decays."""
    del tables["flow"]
    if random.uniform() < 0.5:
        name = ("acceptor", "donor")[int(random.integers(2))]
        tables["substrates"][name]["supply"] = "0 mg/L"


def narrow(random: Random, tables: dict) -> None:
    """A thin film above the body, or a body close to an end of the pore."""
    width = _width(tables)
    length = float(tables["pore"]["length"].split()[0])
    radius = width * random.uniform(0.6, 0.97)
    tables["aggregate"]["radius"] = _um(radius)
    if random.uniform() < 0.5:
        side = (-1.0, 1.0)[int(random.integers(2))]
        gap = width * random.uniform(0.02, 0.5)
        tables["aggregate"]["position"] = _um(side * (length / 2 - radius - gap))


def one_substrate(random: Random, tables: dict) -> None:
    """One substrate alone. In some scenes it has another law of uptake, or decay is unlimited."""
    del tables["substrates"][("acceptor", "donor")[int(random.integers(2))]]
    if random.uniform() < 0.4:
        law(random, tables)
    if random.uniform() < 0.4:
        unlimited(random, tables)


def law(random: Random, tables: dict) -> None:
    """Another law of uptake. Haldane's donor may inhibit so much that several states are steady."""
    substrates = tables["substrates"]
    laws = ("Haldane", "first order", "zero order")[0 if "donor" in substrates else 1:]
    tables["kinetics"]["law"] = laws[int(random.integers(len(laws)))]
    if tables["kinetics"]["law"] == "Haldane":
        substrates["donor"]["inhibition_constant"] = f"{_spread(random, 0.02, 30.0):.4g} mg/L"
    if tables["kinetics"]["law"] == "zero order":
        for part in substrates.values():
            part["half_saturation"] = f"{float(part['supply'].split()[0]) * random.uniform(0.1, 0.9):.4g} mg/L"


def unlimited(random: Random, tables: dict) -> None:
    """Unlimited decay in a large body. In every other scene there is little acceptor, so that its demand is unmet."""
    tables["aggregate"]["radius"] = _um(_width(tables) * random.uniform(0.2, 0.7))
    tables["kinetics"]["decay"] = "unlimited"
    acceptor = tables["substrates"].get("acceptor")
    if acceptor and random.uniform() < 0.5:
        acceptor["supply"] = f"{_spread(random, 0.01, 0.5):.4g} mg/L"


def bonded(random: Random, tables: dict) -> None:
    """A body bonded to the lower wall. In every other scene the water's forces act on it."""
    tables["aggregate"]["radius"] = _um(_width(tables) * random.uniform(0.1, 0.6))
    if random.uniform() < 0.5:
        forces(random, tables)
    tables["growth"]["wall"] = "bonded"


def bodies(random: Random, tables: dict) -> None:
    """Two to six seeds on both walls. Some are bonded."""
    width, length = _width(tables), float(tables["pore"]["length"].split()[0])
    seeds: list[dict] = []
    places: list[tuple[float, float, str]] = []
    for _ in range(int(random.integers(2, 7))):
        radius = width * random.uniform(0.08, 0.45)
        x = (length / 2 - radius - 0.3 * width) * random.uniform(-1, 1)
        wall = ("lower", "upper")[int(random.integers(2))]
        if all(np.hypot(x - place, 0 if wall == beside else width) > radius + other + 0.15 * width
               for place, other, beside in places):
            places.append((x, radius, wall))
            seeds.append({"radius": _um(radius), "position": _um(x), "wall": wall})
    tables["aggregate"] = seeds
    if random.uniform() < 0.3:
        tables["growth"]["wall"] = "bonded"


def leaving(random: Random, tables: dict) -> None:
    """Several aggregates on walls that give way, under a flow that jumps. Those that detach leave the pore."""
    jumps(random, tables)
    bodies(random, tables)
    tables["growth"] |= {"bonding_strength": f"{_spread(random, 2e-5, 1e-2):.3g} MPa",
                         "after_detachment": "continue", "fluid_forces": "included"}


def eroding(random: Random, tables: dict) -> None:
    """Several aggregates that the water erodes, by one of the three laws. Those that are worn down may leave."""
    bodies(random, tables)
    growth = tables["growth"]
    growth["new_biomass"] = "stress_free"
    if random.uniform() < 0.5:
        growth["after_detachment"] = "continue"
    width = _width(tables)
    speed = width * _spread(random, 1e-3, 0.1)
    law = ("constant", "thickness squared", "shear")[int(random.integers(3))]
    growth["erosion"] = {"law": law} | {
        "constant": {"speed": f"{speed:.4g} um/h"},
        "thickness squared": {"thickness_coefficient": f"{speed / (0.3 * width) ** 2:.4g} 1/um/h"},
        "shear": {"shear_coefficient": f"{speed / _spread(random, 1e-3, 0.3):.4g} um/h/Pa"}}[law]


KINDS: dict[str, Callable[[Random, dict], None]] = {
    "jumps": jumps, "outline": outlines, "brinkman": brinkman, "gear": gear, "forces": forces, "closed": closed,
    "starved": starved, "dense rows": dense, "still": still, "narrow": narrow}
#: Kinds of seeds from FIRST_LATER on, so that the members before keep their scenes.
LATER: dict[str, Callable[[Random, dict], None]] = {
    "one substrate": one_substrate, "law": law, "unlimited decay": unlimited, "bonded": bonded}
FIRST_LATER = 150
BODIES: dict[str, Callable[[Random, dict], None]] = {"bodies": bodies, "leaving": leaving, "eroding": eroding}
FIRST_BODIES = 190
#: Kinds with transient substrates, which take many steps of their own.
TRANSIENT = ("gear", "closed")
