"""Aggregates that are long against the pore's width, where averaging over sections is exact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from reference import averaged_pore, layered_channel, poiseuille
from repro.fem import mesher
from repro.fem.outline import BOTTOM, FREE, Outline
from repro.fem.sizing import Sizing
from repro.fem.space import Space
from repro.model import flow, pore
from repro.scene import Scene
from verification.case import Check, Outcome, at_most, between, case
from verification.convergence import Study, study
from verification.coupling import averaged, runs

WIDTH, THICKNESS = 20.0, 5.0
ASPECTS = (0.5, 0.25, 0.125, 0.0625)
#: X_m (mg/L) over the square of the aspect ratio.
DENSITY = 3e6
SQUARE = "regular perturbation: the square of the aspect ratio"


@case("coupling-averaged-strip", kind="cross-code", slow=True,
      norm="largest difference at 0.5 and 1 h: area relative, effluents and section means of C over the supply; seeds "
           "of 5 um, thickness over half length 1/2 to 1/16, u as that ratio, X_m as its square, so that the averaged "
           "pore starts alike",
      claim="Thin aggregates grow as the averaged pore (FiPy, solve_ivp) with the stress-free strip says, starved "
            "downstream, up to the square of the aspect ratio",
      mutants=("growth-spread-evenly",))
def strip() -> Outcome:
    checks, studies, profiles = [], [], []
    for elements in ("linear", "quadratic"):
        found = [_strip(elements, aspect) for aspect in ASPECTS]
        studies += [study(f"{name}, {elements}", ASPECTS, [rows[name] for rows, *_ in found], 2, SQUARE, ceiling=4e-4)
                    for name in ("area", "effluents", "C along the pore")]
        tips, lean, pictures = found[-1][1:]
        checks += [at_most(f"ends of the thinnest, relative, {elements}", tips, 1.5e-4,
                           "stretches: as the square of the aspect ratio"),
                   between(f"how far it leans upstream, over the averaged pore's 0.27 %, {elements}", lean, 0.97, 1.03,
                           "the same: 0.4 %, and as much for the step in time")]
        profiles += pictures
    return Outcome(tuple(checks), tuple(studies), tuple(profiles))


def scene(elements: str, aspect: float) -> Scene:
    """Base for 1 h in a narrow pore, from a seed whose half length is its thickness over ``aspect``."""
    changes = (runs.of(elements), runs.coarser(elements, 0.5), f'aggregate.radius="{THICKNESS} um"',
               f'pore.width="{WIDTH} um"', 'growth.time_step="6 min"', 'growth.minimum_contact_angle="0.01 deg"')
    found = runs.at_velocity(runs.base("1 h", *changes, times='"0.5 h", "1 h"'), 5 * aspect * runs.SPEED)
    return replace(found, kinetics=replace(found.kinetics, maximum_density=DENSITY * aspect**2))


def _strip(elements: str, aspect: float):
    """Largest differences; of the ends, relative; (upstream over downstream length - 1) over the averaged one's;
    profiles."""
    given = scene(elements, aspect)
    with runs.shaped(lambda radius, geometry: half_ellipse(radius / aspect, radius, geometry)):
        area, instants = pore.seeded(given).outline.area, averaged.ours(given)
    moments = strip_of(given, area, 2 * averaged.CELLS).run(given.output.times)
    rows = [averaged.apart(given, *pair) for pair in zip(instants, moments)]
    ends = np.array([(instants[-1].pore.outline.upstream, instants[-1].pore.outline.downstream), moments[-1].ends])
    ours, theirs = -ends[:, 0] / ends[:, 1] - 1
    return (averaged.worst(rows), np.abs(ends[0] / ends[1] - 1).max(), ours / theirs,
            averaged.profiles(instants, moments))


def strip_of(given: Scene, area: float, cells: int) -> averaged_pore.Averaged:
    """The averaged run of a strip that has the area of the meshed seed."""
    lengths, heights = averaged_pore.half_ellipse(2 * area / (np.pi * THICKNESS), THICKNESS, cells)
    return averaged_pore.Averaged(averaged.pore_of(given), lengths, heights, 4 * cells, keeps_shape=False)


def half_ellipse(half_length: float, thickness: float, geometry: int = 1) -> Outline:
    """A seed, its interface nodes at equal eccentric angles, its fixed point in the middle."""
    def shape(s):
        return thickness * np.sqrt(np.maximum(1 - s**2, 0.0))

    edges = round(32 / geometry * np.sqrt(half_length / thickness))
    return bump(half_length, shape, edges, round(10 / geometry * half_length / thickness), geometry)


def bump(half_length: float, shape, edges: int, half: int, geometry: int = 1) -> Outline:
    """An outline of height shape(x / half_length): edges, or arcs (geometry 2), on the interface, twice ``half`` on the
    wall."""
    edges, half = geometry * edges, geometry * half
    angle = np.linspace(0.0, np.pi, edges + 1)[1:-1]
    base = half_length * np.arange(-half, half + 1) / half
    arc = np.column_stack([half_length * np.cos(angle), shape(np.cos(angle))])
    points = np.vstack([np.column_stack([base, 0.0 * base]), arc])
    wall = np.where(np.arange(len(points)) < len(base), BOTTOM, FREE)
    return Outline(points, wall, np.arange(len(points)) == half, points.copy(), geometry)


LOW, LONG, RATIO, LENGTH = 8.0, 40.0, 2000.0, 600.0
SLENDER = (0.25, 0.177, 0.125, 0.0884)


@case("coupling-averaged-flow", kind="cross-code",
      norm="head loss of the whole pore less that of lubrication, over what the latter has more than a clean channel; "
           "refinement 2.5 over the order of the elements; a bump 8 (1 - s^2)^2 um high in 20 um",
      claim="The head loss of a long aggregate is that of developed flow in each section, and the next term is that of "
            "extended lubrication theory, coefficient included",
      mutants=("extent-not-subtracted",))
def lubrication() -> Outcome:
    found = [_lubricated(order) for order in (2, 3)]
    return Outcome(tuple(check for check, _ in found), tuple(orders for _, orders in found))


def _lubricated(order: int) -> tuple[Check, Study]:
    """The coefficient, and the order, with elements of an order on straight triangles: the bump's ends lie flat on the
    wall, which arcs would cross."""
    name = f"order {order}"
    ours, thin, more = np.array([_losses(order, aspect) for aspect in SLENDER]).T
    clean = poiseuille.head_loss(LENGTH, WIDTH, 1.0, 1.0)
    return (between(f"gap over that of extended lubrication, the most slender, {name}", (ours - thin)[-1] / more[-1],
                    0.94, 1.02, "mesh, 2 %; the next term, 1 %; lambda = 2000 for a rigid wall, 0.4 %"),
            study(f"loss, {name}", SLENDER, (ours - thin) / (thin - clean), 2, SQUARE, ceiling=1.5e-2))


def _losses(order: int, aspect: float) -> tuple[float, float, float]:
    """Loss per mean velocity: ours; lubrication's; what extended lubrication theory adds.

    In a channel with one wall y = h(x) the stream function in powers of the slope, to the second, gives the loss
    12 W integral of (1 + 4/5 h'^2) / (W - h)^3 dx.
    """
    half, reach = LOW / aspect, LOW / aspect + LONG
    outline = bump(half, lambda s: LOW * (1 - s**2) ** 2, round(48 / np.sqrt(aspect)), round(15 / aspect))
    grid, _ = mesher.generate(outline, (-reach, reach), Sizing(WIDTH, 2.5 / order, 2.0))
    drive = replace(scene("linear", 0.5).flow, viscosity_ratio=RATIO, mean_velocity=1.0, kinematic_viscosity=1.0,
                    gravity=1.0)
    whole = flow.solve(Space(grid, order), drive, LENGTH)
    s, weight = np.polynomial.legendre.leggauss(200)
    height, slope = LOW * (1 - s**2) ** 2, -4 * aspect * s * (1 - s**2)
    thin = half * weight @ layered_channel.gradient(WIDTH, height, RATIO)
    more = half * weight @ (12 * WIDTH * 4 / 5 * slope**2 / (WIDTH - height) ** 3)
    return whole.head_loss, float(thin) + poiseuille.head_loss(LENGTH - 2 * half, WIDTH, 1.0, 1.0), float(more)
