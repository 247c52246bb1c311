"""What the paper does and what else may be done: the choices that a scene can name, and those that it cannot (steps in
time, what (28) restarts from, the symmetry of the seed)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from repro.fem.outline import half_disc
from repro.fem.sizing import ACROSS_AGGREGATE
from repro.fem.space import Space
from repro.march import updates
from repro.model import pore
from repro.model.pore import Pore
from repro.scene import Scene
from verification.audit import measure
from verification.errata.coupling import step_restarting_as_j

#: Element sizes of runs that differ from the default in nothing else: the seed's nodes stay as many.
FINENESS = (0.975, 0.98, 0.985, 0.99, 0.995)
#: The seed's radius is R (1 + BULGE cos 3 phi) or R (1 - BULGE cos 3 phi): area as before to second order. With cos phi
#: it would be a half-disc again, moved.
BULGE = 0.01
TIMES = (0.4, 4.8, 9.6, 14.4, 19.2)


@dataclass(frozen=True)
class Choice:
    """choice: what is chosen; default, alternative: in words; changes: KEY=VALUE of the alternative; state: can both
    be compared in one state; meshes: are the default's meshes good for both; note: what the reader must know."""

    choice: str
    default: str
    alternative: str
    changes: tuple[str, ...]
    state: bool = True
    note: str = ""
    meshes: bool = True


F_EXACT = "COD - Y d_c = 2.38 - 0.61 x 1.42; Table 1 prints 1.52 [E1]"
CHOICES = (
    Choice("transport in time", "quasi-steady", "transient (Gear)", ('numerics.transport="gear"',), True, "3.3"),
    Choice("extent", "central part (3.1)", "full pore", ('numerics.extent="full"',), False,
           "the inlet and the outlet 1.5 W away or less, against the pore's ends; on two meshes", False),
    Choice("interface", "Laplacian form", "traction form", ('numerics.interface="traction"',), True, "[E2]"),
    Choice("fluid forces", "neglected", "included", ('growth.fluid_forces="included"',), True, "(20), (22), C26"),
    Choice("inlet condition (11)", "u_x(y)", "u_ave", ('numerics.inlet="mean"',), True, "[E4]"),
    Choice("acceptor to donor ratio F", "1.52", "1.5138", ("kinetics.acceptor_to_donor_ratio=1.5138",), True, F_EXACT),
    Choice("transfer at a remesh", "conserving", "linear", ('numerics.transfer="linear"',), False, "[E8]"),
    Choice("transfer at a remesh", "conserving", "bounded", ('numerics.transfer="bounded"',), False,
           "the projection limited by flux-corrected transport"),
    Choice("new biomass", "stressed", "stress-free", ('growth.new_biomass="stress_free"',), True, "section 5"),
    Choice("flow element", "stabilised (c = 100)", "bubble (MINI)", ('numerics.flow_element="bubble"',), True,
           "the same unknowns; tau is the same to 7 % where triangles are equilateral"),
    Choice("fixed point", "kept", "rechosen", ('numerics.fixed_point="rechosen"',), True,
           "2.3.3; the same node throughout base, whose contact surface stays even about it"),
)


def meshes() -> dict:
    """What runs differ by on meshes of the same fineness to 2.5 %: the largest of each quantity."""
    said = measure.scene()
    default = measure.run(said)
    others = [measure.run(measure.scene(f"numerics.refinement={value}")) for value in FINENESS]
    one, two = (_worst([each(said, default, other) for other in others])
                for each in (measure.whole_run, measure.two_meshes))
    told = row("mesh", "refinement 1", "refinement 0.975 to 0.995", others[-1].seconds / default.seconds, one,
               "no choice: what runs on meshes of the same fineness differ by; less than twice that is not resolved")
    return {**told, "two_meshes": two}


def _worst(effects: list[dict[str, float]]) -> dict[str, float]:
    return {name: max((each[name] for each in effects), key=abs) for name in effects[0]}


def midpoint() -> dict:
    """The paper's updates of 12 min against the midpoint rule, which chooses its steps."""
    said, other = measure.scene(step=0.2), measure.scene('numerics.time="midpoint"', step=0.2)
    default, alternative, ratio = measure.in_turn((lambda: measure.run(said), lambda: measure.run(other)))
    return row("steps in time", "updates of 12 min", "midpoint, tolerance 0.01", ratio,
                measure.whole_run(other, default, alternative), "first order in the step against second")


def drift() -> dict:
    """theta restarting at a remesh as J X / X_m against J: the drift of (28) [E7]."""
    said = measure.scene()
    plain, ours = _plain()
    found, other = measure.advance(said, pore.seeded(said), step_restarting_as_j)
    drifts = {"default": float(ours["drift"].max()), "alternative": float(other["drift"].max())}
    told = row("theta after a remesh (28)", "J X / X_m", "J", found.seconds / plain.seconds,
               measure.whole_run(said, plain, found), "drift, max |X / X_m - 1| over the run: "
               f"{drifts['default']:.2g} against {drifts['alternative']:.2g} [E7]")
    return {**told, "drift": drifts}


def symmetry() -> list[dict]:
    """A half-disc against one whose downstream tip, or upstream tip, reaches out by 1 %, the other tip less by that."""
    said = measure.scene()
    plain, ours = _plain()
    rows = []
    for word, sign in (("upstream", -1.0), ("downstream", 1.0)):
        found, other = measure.advance(said, uneven(said, sign * BULGE), _step)
        steps = [round(time / measure.STEP) - 1 for time in TIMES]
        lean = {f"{time:g} h": float(other["lean"][k] - ours["lean"][k]) for time, k in zip(TIMES, steps)}
        apart = {f"{time:g} h": float(other["velocity"][k] / ours["velocity"][k] - 1) for time, k in zip(TIMES, steps)}
        told = row("symmetry of the seed", "half-disc", f"1 % longer {word}", found.seconds / plain.seconds,
                   measure.whole_run(said, plain, found), "R (1 + 0.01 cos 3 phi), area as before; the middle between "
                   "the tips is off by " + ", ".join(f"{100 * value:+.2f} % at {time}" for time, value in lean.items()))
        rows.append({**told, "lean_over_time": lean, "velocity_over_time": apart})
    return rows


def uneven(said: Scene, bulge: float) -> Pore:
    """The pore at t = 0 with a seed of radius R (1 + bulge cos 3 phi), phi from downstream."""
    numerics = said.numerics
    seed = half_disc(said.aggregate.radius, ACROSS_AGGREGATE * numerics.refinement, numerics.geometry)
    points = seed.points * (1 + bulge * np.cos(3 * np.arctan2(*seed.points.T[::-1])))[:, None]
    grid, outline = pore.generate(said, replace(seed, points=points, origin=points.copy()))
    space = Space(grid, numerics.order)
    body = pore.material(space, grid.points[grid.body])
    active = said.kinetics.maximum_density * space.reaction.dx
    return replace(pore.seeded(said), space=space, wall=outline.wall, fixed=outline.fixed, active=active,
                   inert=np.zeros_like(active), body=body, theta=np.ones_like(body.at.dx),
                   pressure=np.zeros(grid.corners))


@cache
def _plain():
    """The default, marched."""
    said = measure.scene()
    return measure.advance(said, pore.seeded(said), _step)


def _step(said: Scene, now: Pore, solved, hours: float) -> Pore:
    return updates.step(said, now, solved, hours).pore


def row(choice: str, default: str, alternative: str, ratio: float, effects: dict[str, float], note: str) -> dict:
    """A row of the record."""
    return {"choice": choice, "default": default, "alternative": alternative, "cost_ratio": ratio, "effect": effects,
            "one_state": {}, "largest": measure.largest(effects), "note": note}
