"""The choices that a scene cannot name: steps in time, what (28) restarts from, the symmetry of the seed."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from repro import coupling, geometry, mesh, pore
from repro.pore import Pore
from repro.scene import Scene
from verification.audit import measure
from verification.errata.coupling import step_restarting_as_j

#: Element sizes of runs that differ from the default in nothing else: the seed's nodes stay as many.
FINENESS = (0.975, 0.98, 0.985, 0.99, 0.995)
#: The seed's radius is R (1 + BULGE cos phi) or R (1 - BULGE cos phi): area as before to second order.
BULGE = 0.01
TIMES = (0.4, 4.8, 9.6, 14.4, 19.2)


def meshes() -> dict:
    """What runs differ by on meshes of the same fineness to 2.5 %: the largest of each quantity."""
    said = measure.scene()
    default = measure.run(said)
    others = [measure.run(measure.scene(f"numerics.refinement={value}")) for value in FINENESS]
    effects = [_effect(said, default, other) for other in others]
    worst = {name: max((each[name] for each in effects), key=abs) for name in effects[0]}
    return _row("mesh", "refinement 1", "refinement 0.975 to 0.995", others[-1].seconds / default.seconds, worst,
                "no choice: what two meshes of the same fineness differ by; a smaller effect is not resolved")


def midpoint() -> dict:
    """The paper's updates of 12 min against the midpoint rule, which chooses its steps."""
    said, other = measure.scene(step=0.2), measure.scene('numerics.time="midpoint"', step=0.2)
    default, alternative, ratio = measure.in_turn((lambda: measure.run(said), lambda: measure.run(other)))
    return _row("steps in time", "updates of 12 min", "midpoint, tolerance 0.01", ratio,
                _effect(said, default, alternative), "first order in the step against second")


def drift() -> dict:
    """theta restarting at a remesh as J X / X_m against J: the drift of (28) [E7]."""
    said = measure.scene()
    plain, _, off = _plain()
    found, _, other = measure.advance(said, pore.seeded(said), step_restarting_as_j)
    drifts = {"default": float(off.max()), "alternative": float(other.max())}
    row = _row("theta after a remesh (28)", "J X / X_m", "J", found.seconds / plain.seconds,
               _effect(said, plain, found), "drift, max |X / X_m - 1| over the run: "
               f"{drifts['default']:.2g} against {drifts['alternative']:.2g} [E7]")
    return {**row, "drift": drifts}


def symmetry() -> list[dict]:
    """A half-disc against one that bulges by 1 % upstream, or downstream."""
    said = measure.scene()
    plain, speed, _ = _plain()
    rows = []
    for word, sign in (("upstream", -1.0), ("downstream", 1.0)):
        found, other, _ = measure.advance(said, bulging(said, sign * BULGE), _step)
        steps = [round(time / measure.STEP) - 1 for time in TIMES]
        apart = {f"{time:g} h": float(other[k] / speed[k] - 1) for time, k in zip(TIMES, steps)}
        row = _row("symmetry of the seed", "half-disc", f"bulging 1 % {word}", found.seconds / plain.seconds,
                   _effect(said, plain, found), "R (1 + 0.01 cos phi), area as before; velocity apart: "
                   + ", ".join(f"{value:.1g} at {time}" for time, value in apart.items()))
        rows.append({**row, "velocity_over_time": apart})
    return rows


def bulging(said: Scene, bulge: float) -> Pore:
    """The pore at t = 0 with a seed of radius R (1 + bulge cos phi), phi from downstream."""
    now, numerics = pore.seeded(said), said.numerics
    seed = geometry.seed(said.aggregate.radius, numerics.refinement)
    distance = np.hypot(*seed.points.T)
    points = seed.points * (1 + bulge * seed.points[:, 0] / np.where(distance > 0, distance, 1.0))[:, None]
    outline = geometry.Outline(points, seed.wall, seed.fixed, points.copy())
    ends = geometry.meshed_extent(outline, said.pore.width, said.pore.length, numerics.extent == "full")
    grid, outline = mesh.generate(outline, ends, said.pore.width, numerics.refinement, pore.film(said))
    count = len(grid.points)
    active = np.zeros(count)
    active[grid.body] = said.kinetics.maximum_density
    return replace(now, mesh=grid, wall=outline.wall, fixed=outline.fixed, active=active, inert=np.zeros(count),
                   origin=grid.points.copy(), theta=np.ones(np.count_nonzero(grid.biomass)), pressure=np.zeros(count))


@cache
def _plain():
    """The default, marched."""
    said = measure.scene()
    return measure.advance(said, pore.seeded(said), _step)


def _step(said: Scene, now: Pore, solved, hours: float) -> Pore:
    return coupling.step(said, now, solved, hours).pore


def _effect(said: Scene, default: measure.Run, other: measure.Run) -> dict[str, float]:
    return measure.effect(said, *(measure.quantities(each.pore, each.solved) for each in (default, other)))


def _row(choice: str, default: str, alternative: str, ratio: float, effects: dict[str, float], note: str) -> dict:
    return {"choice": choice, "default": default, "alternative": alternative, "cost_ratio": ratio, "effect": effects,
            "one_state": {}, "largest": measure.largest(effects), "note": note}
