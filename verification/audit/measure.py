"""One run of a scene: its processor time and what it comes to; and how two of them differ."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from statistics import median
from time import process_time

import numpy as np
from scipy.interpolate import CubicSpline

from repro.errors import StageError
from repro.fem.outline import Outline
from repro.march import updates
from repro.march.simulation import simulate
from repro.model import contact, mesh_motion, pore
from repro.model.pore import Pore, Solved
from repro.scene import Scene, load_scene

#: The time of the geometry that the paper plots [E12], and the step: twice the paper's, which both runs share.
END, STEP = 19.2, 0.4
#: Runs in turn of which the processor times are the medians.
REPEATS = 3
RELATIVE = ("velocity", "conductivity", "area", "thickness", "upstream", "downstream")
EFFLUENTS = ("acceptor leaving", "donor leaving")


@dataclass(frozen=True)
class Run:
    """seconds: of processor time; pore, solved: at the end."""

    seconds: float
    pore: Pore
    solved: Solved


def scene(*changes: str, end: float = END, step: float = STEP) -> Scene:
    """Base in the paper's preset, reported at its end alone."""
    return load_scene("base", ['numerics.preset="paper"', f'growth.end="{end} h"', f'output.times=["{end} h"]',
                               f'growth.time_step="{step} h"', *changes])


def run(said: Scene) -> Run:
    """Simulate a scene."""
    start = process_time()
    *_, last = simulate(said)
    return Run(process_time() - start, last.pore, last.solved)


def in_turn(both: tuple[Callable[[], Run], Callable[[], Run]], repeats: int = REPEATS) -> tuple[Run, Run, float]:
    """The default's run and the alternative's, and the ratio of their median times."""
    rows = [[make() for make in both] for _ in range(repeats)]
    default, other = (median(row[k].seconds for row in rows) for k in (0, 1))
    return *rows[0], other / default


def quantities(now: Pore, solved: Solved) -> dict[str, float]:
    """What a state comes to: um/h, um2, um, mg/L."""
    outline = now.outline
    return {**_flow_quantities(solved), "area": outline.area, "thickness": outline.thickness,
            "upstream": outline.upstream, "downstream": outline.downstream}


def _flow_quantities(solved: Solved) -> dict[str, float]:
    return {"velocity": solved.flow.mean_velocity, "conductivity": solved.flow.conductivity,
            **{name: flux.effluent for name, flux in zip(EFFLUENTS, solved.fluxes)}}


def effect(said: Scene, default: dict[str, float], other: dict[str, float]) -> dict[str, float]:
    """The other over the default, less 1; effluents: their difference over the supply."""
    supply = dict(zip(EFFLUENTS, (said.substrates.acceptor.supply, said.substrates.donor.supply)))
    return {name: float((other[name] - value) / supply.get(name, value)) for name, value in default.items()}


def whole_run(changed: Scene, default: Run, other: Run) -> dict[str, float]:
    """The effect of two whole runs, flow and substrates of the other's shape solved on the default's mesh, so that it
    does not tell how two meshes differ."""
    there = reshaped(default.pore, other.pore.outline)
    found = {**quantities(other.pore, other.solved), **_flow_quantities(pore.solve(changed, there))}
    return effect(changed, quantities(default.pore, default.solved), found)


def two_meshes(changed: Scene, default: Run, other: Run) -> dict[str, float]:
    """The effect of two whole runs as they are, each on its own mesh."""
    return effect(changed, *(quantities(each.pore, each.solved) for each in (default, other)))


def reshaped(now: Pore, outline: Outline) -> Pore:
    """The pore with its aggregate brought to another outline ray by ray, the fluid's nodes following (both star-shaped
    about the origin, on the lower wall alone)."""
    places = now.mesh.points[now.mesh.body]
    angle = np.arctan2(places[:, 1], places[:, 0])
    factor = _radius(outline)(angle) / _radius(now.outline)(angle)
    return now.moved(mesh_motion.move(now.mesh, places * factor[:, None], 1.0, 100.0))


def _radius(outline: Outline) -> CubicSpline:
    """Distance of the interface from the origin over the angle from downstream, smooth between its nodes."""
    edges = outline.interface_edges()
    x, y = outline.points[edges | np.roll(edges, 1)].T
    angle = np.arctan2(y, x)
    order = np.argsort(angle)
    return CubicSpline(angle[order], np.hypot(x, y)[order])


def one_state(said: Scene, changed: Scene, found: Run) -> dict[str, float]:
    """The effect in one state: flow and substrates solved in it, and the shape of the next step, by either scene."""
    rows = []
    for each in (said, changed):
        solved = pore.solve(each, found.pore)
        rows.append({**_flow_quantities(solved), **_next_shape(each, found.pore, solved)})
    return effect(said, *rows)


def _next_shape(said: Scene, now: Pore, solved: Solved) -> dict[str, float]:
    grown, _, _ = updates.make_biomass(said, now, solved, STEP)
    outline = contact.expand(said, grown, updates.enlarged(said, now, grown))[0].outline
    return {"area": outline.area, "thickness": outline.thickness, "upstream": outline.upstream,
            "downstream": outline.downstream}


def largest(effects: dict[str, float]) -> str:
    """The quantity that changes most; an empty word where there is none."""
    return max(effects, key=lambda name: abs(effects[name]), default="")


def advance(said: Scene, now: Pore, step: Callable, end: float = END) -> tuple[Run, dict[str, np.ndarray]]:
    """March from a pore by ``step(said, now, solved, hours)`` -> pore; the run, and of each step the velocity (um/h),
    the drift, largest |(X_A + X_I) / X_m - 1|, and the lean, middle between the tips over half their distance."""
    start, solved, rows = process_time(), pore.solve(said, now), []
    try:
        for _ in range(round(end / STEP)):
            now = step(said, _with(now, solved), solved, STEP)
            solved = pore.solve(said, now)
            least, most = now.composition(said.kinetics.maximum_density)[1:]
            tips = now.outline.upstream, now.outline.downstream
            rows.append((solved.flow.mean_velocity, max(1 - least, most - 1), sum(tips) / (tips[1] - tips[0])))
    except StageError as error:
        raise RuntimeError(f"the audit's run fails after {len(rows)} steps") from error
    return Run(process_time() - start, now, solved), dict(zip(("velocity", "drift", "lean"), np.array(rows).T))


def _with(now: Pore, solved: Solved) -> Pore:
    return replace(now, concentrations=solved.concentrations)
