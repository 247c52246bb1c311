"""Substrates on a new mesh that reaches further than the old one: (26) upstream, constant downstream."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from repro.model import remeshing
from repro.model.transport import Concentrations
from verification.case import Outcome, Profile, at_least, at_most, case
from verification.reprojection import bodies, grids

#: um/h, of the order of the base scene's; ends of the old mesh, um.
SPEED, ENDS = 1.2e5, (-40.0, 30.0)


@case("reprojection-beyond-the-ends", kind="exact", norm="largest difference over the supply",
      claim="On a mesh that reaches further both substrates follow (26) upstream of the old one, each with its own "
            "diffusivity, stay constant downstream and are interpolated between; without flow they are the supply "
            "beyond both ends",
      mutants=("upstream-reversed", "diffusivity-of-the-acceptor"))
def beyond_the_ends() -> Outcome:
    checks, profiles = [], []
    for order in bodies.ORDERS:
        now = bodies.placed(bodies.half_disc(10.0, order=order), 1.0, ends=ENDS, order=order)
        old = _exact(np.clip(now.space.points[:, 0], *ENDS))
        flowing, still = (_carried(now, old, speed) for speed in (SPEED, 0.0))
        x = flowing.space.points[:, 0]
        for column, name in enumerate(("acceptor", "donor")):
            checks += _judged(f"{name}, {bodies.ORDERS[order]}", now, old[column], flowing, still, column)
        checks.append(at_least(f"reach beyond both ends (um), {bodies.ORDERS[order]}",
                               min(ENDS[0] - x.min(), x.max() - ENDS[1]), 20.0, "else nothing is tested"))
        profiles.append(_along(flowing, bodies.ORDERS[order]))
    return Outcome(tuple(checks), (), tuple(profiles))


def _substrates():
    return bodies.scene().substrates.acceptor, bodies.scene().substrates.donor


def _exact(x: np.ndarray) -> list[np.ndarray]:
    """Both concentrations for places x, each constant beyond the old outlet: S (1 - 0.3 exp(u (x - x_out) / D))."""
    return [s.supply * (1 - 0.3 * np.exp(SPEED / s.diffusivity * (np.minimum(x, ENDS[1]) - ENDS[1])))
            for s in _substrates()]


def _carried(now, old, speed: float):
    """The pore on its new mesh; the whole of what the flow says there is its mean velocity."""
    filled = replace(now, concentrations=Concentrations(*old))
    return remeshing.remesh(bodies.scene(order=now.space.order), filled, filled, speed)[0]


def _judged(name: str, now, old: np.ndarray, flowing, still, column: int) -> list:
    """Checks of one substrate."""
    supply, x = _substrates()[column].supply, flowing.space.points[:, 0]
    found, resting = (_fields(new)[column] for new in (flowing, still))
    outside, inside = (x < ENDS[0]) | (x > ENDS[1]), (x >= ENDS[0]) & (x <= ENDS[1])
    between = grids.sample(now.space, old, flowing.space.points[inside])
    gaps = {"beyond the ends": (found - _exact(x)[column])[outside], "between": found[inside] - between,
            "beyond the ends, no flow": resting[outside] - supply, "between, no flow": resting[inside] - between}
    return [at_most(f"{name} {where}", np.abs(gap).max() / supply, 1e-12, "closed form: round-off")
            for where, gap in gaps.items()]


def _fields(new):
    return new.concentrations.acceptor, new.concentrations.donor


def _along(new, name: str) -> Profile:
    """Both concentrations along the lower wall of the new mesh."""
    places = new.space.points
    wall = np.flatnonzero(places[:, 1] == 0)
    wall = wall[np.argsort(places[wall, 0])]
    x, curves = places[wall, 0], []
    for substrate, found, exact in zip(("acceptor", "donor"), _fields(new), _exact(x)):
        curves += [(substrate, "ours", x, found[wall]), (f"{substrate}, closed form", "exact", x, exact)]
    return Profile(f"carried to a longer mesh (old: -40 to 30 um), {name}", "x (um)", "C (mg/L)", tuple(curves))
