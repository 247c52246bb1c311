"""A short piece of a run through contact with the opposite wall, and a wedge that closes (2.3.3)."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from repro.fem.outline import BOTTOM, FREE, TOP, Outline
from repro.march.simulation import simulate
from repro.scene import Scene
from verification.case import Outcome, Profile, at_least, at_most, between, case
from verification.coupling import runs
from verification.coupling.conservation import biomass, substrates

AREA = "J = theta to the stabilisation"


@case("coupling-contact", kind="property",
      norm="three steps from an aggregate 0.1 um short of closing the pore, 20 um wide",
      claim="Through contact the ledgers close, the area stays the biomass over X_m, no film under 2 um is left, and "
            "the fluid is cut in two",
      mutants=("films-stay-open", "reprojection-left-out"))
def contact() -> Outcome:
    found = [_closing(elements, runs.of(elements), runs.coarser(elements, 0.4)) for elements in runs.ELEMENTS]
    found += [_closing(preset, runs.by(preset)) for preset in ("fast", "accurate")]
    return Outcome(tuple(check for checks, _ in found for check in checks), (), tuple(picture for _, picture in found))


def _closing(name: str, *changes: str) -> tuple[list, Profile]:
    """Checks and a picture of a run with one kind of elements, or one preset."""
    scene = runs.base("0.6 h", 'pore.width="20 um"', 'aggregate.radius="17.9 um"', *changes,
                      times='"0.2 h", "0.4 h", "0.6 h"')
    instants = list(simulate(runs.at_velocity(scene, runs.SPEED)))
    rows = [row for instant in instants for row in instant.ledgers]
    last = instants[-1].pore
    total = scene.kinetics.maximum_density * last.outline.area
    checks = [at_most(f"substrates, {name}", substrates(rows), 1e-10, "Newton's tolerance"),
              at_most(f"biomass, worst step, {name}", biomass(rows), 1e-10, runs.ROUND_OFF),
              at_most(f"X_m times the area, {name}", abs(total / rows[-1].biomass_after - 1), 3e-6, AREA),
              at_least(f"narrowest gap over the least allowed, {name}", _narrowest(scene, last, TOP), 1 - 1e-9,
                       "2 um, or 16.7 degrees beside contact"),
              between(f"parts of the fluid, {name}", _parts(last.mesh), 1.9, 2.1, "a plug")]
    return checks, _outlines(instants, name)


@case("coupling-wedge", kind="property",
      norm="one step from a disc of 20 um that stands on a chord, the fluid under it at 8 degrees",
      claim="Wedges of fluid beside a contact surface close until they have the least contact angle",
      mutants=("no-wedge-closes", "films-stay-open"))
def wedge() -> Outcome:
    found = [_wedge(elements) for elements in runs.ELEMENTS]
    return Outcome(tuple(check for checks, _ in found for check in checks), (), tuple(picture for _, picture in found))


def _wedge(elements: str) -> tuple[list, Profile]:
    """Checks and a picture of a step with one kind of elements."""
    scene = runs.base("0.2 h", runs.of(elements), runs.coarser(elements, 0.6))
    with runs.shaped(lambda radius, geometry: _disc(20.0, 19.8, geometry)):
        instants = list(simulate(scene))
    gaps = [_narrowest(scene, instant.pore, BOTTOM) for instant in instants]
    total = scene.kinetics.maximum_density * instants[-1].pore.outline.area
    checks = [at_most(f"narrowest gap over the least allowed, seed, {elements}", gaps[0], 0.9,
                      "8 degrees are under 16.7"),
              at_least(f"the same after a step, {elements}", gaps[1], 1 - 1e-9, "2 um, or 16.7 degrees beside contact"),
              at_most(f"X_m times the area, {elements}", abs(total / instants[-1].ledgers[-1].biomass_after - 1), 3e-6,
                      AREA)]
    return checks, _outlines(instants, elements)


def _disc(radius: float, height: float, geometry: int) -> Outline:
    """A disc around (0, height), cut by the lower wall."""
    start = np.arcsin(height / radius)
    angle = np.linspace(-start, np.pi + start, 60 * geometry + 1)
    arc = np.column_stack([radius * np.cos(angle), height + radius * np.sin(angle)])
    base = np.linspace(arc[-1, 0], arc[0, 0], 10 * geometry + 1)
    points = np.vstack([np.column_stack([base, 0 * base]), arc[1:-1]])
    wall = np.where(np.arange(len(points)) < len(base), BOTTOM, FREE)
    return Outline(points, wall, np.arange(len(points)) == len(base) // 2, points.copy(), geometry)


def _narrowest(scene: Scene, now, wall: int) -> float:
    """Least gap between a wall and the interface beyond the contact surface, over the smaller of the least film and
    tan(least angle) times the distance from contact; zero without contact."""
    outline, growth = now.outline, scene.growth
    free, on = outline.points[outline.wall == FREE], outline.points[outline.wall == wall, 0]
    if len(on) == 0:
        return 0.0
    along = np.maximum(on.min() - free[:, 0], free[:, 0] - on.max())
    gap = free[:, 1] if wall == BOTTOM else scene.pore.width - free[:, 1]
    allowed = np.minimum(growth.minimum_film, np.tan(growth.minimum_contact_angle) * along)
    return float((gap[along > 0] / allowed[along > 0]).min())


def _parts(mesh) -> int:
    """Connected parts of the fluid."""
    corners = mesh.triangles[~mesh.biomass]
    links = (np.ones(corners.size), (corners.ravel(), np.roll(corners, 1, axis=1).ravel()))
    labels = connected_components(coo_array(links, shape=2 * (len(mesh.points),)), directed=False)[1]
    return len(np.unique(labels[mesh.topology.fluid]))


def _outlines(instants, name: str) -> Profile:
    """The outlines, closed."""
    loops = [(instant.pore.time, instant.pore.outline.points) for instant in instants]
    return Profile(f"outlines, {name}", "x (um)", "y (um)", tuple(
        (f"{time:g} h", "ours", *np.vstack([loop, loop[:1]]).T) for time, loop in loops))
