"""Growth into the opposite wall against scikit-fem (reference/contact_growth.py), with prescribed growth.

A half-disc grows ten times as much at the front as at the rear, and more above than on the wall, until its contact
surface is a third of its length. The package follows the growth in steps from the first contact on. Only the midpoint
on the lower wall is fixed; it is fixed in the reference, too. Each step starts from the mesh of t = 0, so no remesh
takes part.

The displacement is singular like the root of the distance at a contact line, where a sliding wall meets a free surface.
Elements without grading towards the line thus have the order 1/2 in the energy and 1 in the place of a contact line,
whatever their degree.
"""
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.optimize import brentq

from reference import contact_growth
from repro.fem.walls import TOP
from repro.model import contact
from repro.model.contact_lines import FirstContact
from repro.model.mechanics import Expansion, Mechanics
from repro.model.meshing import seeded
from repro.model.pore import Pore
from repro.scene import load_scene
from verification.evidence.cases import parametrize
from verification.evidence.checks import around, at_most, between, refine
from verification.problems import bodies, meshes

#: theta on the wall at the front, X = -R_0, and its ratio to that at the rear.
FRONT, CONTRAST = 36.0, 10.0
#: Height of the opposite wall (um), the largest theta, and steps from the first contact to the end.
HEIGHT, LARGEST, STEPS = 75.0, 1.5 * FRONT, 16
WALLS = contact_growth.Walls(HEIGHT, 2.0, np.tan(np.radians(16.7)))
#: Rings of the reference, with the number of refinements towards its contact lines.
LEVELS = ((6, 3), (11, 5), (16, 6))
#: First guess of the angles of the contact lines.
GUESS = np.radians([100.0, 130.0])


def _uneven(x, y):
    """theta: 36 at the front, a tenth of it at the rear, and above half as much again as on the wall."""
    along = CONTRAST ** (-0.5 * (x / bodies.RADIUS + 1))
    return FRONT * along * (1 + 0.5 * (y / bodies.RADIUS) ** 2)


@cache
def reference_solution(level: int) -> contact_growth.Touching:
    """The reference on one level. It starts from the level before."""
    rings, times = LEVELS[level]
    before = reference_solution(level - 1) if level else None
    mesh = contact_growth.half_disc(bodies.RADIUS, rings, times)
    return contact_growth.grow(mesh, bodies.RADIUS, _uneven, LARGEST, WALLS, before.angles if before else GUESS,
                               before and before.equilibrium)


def grown(elements: str, refinement: float) -> Expansion:
    """The package's aggregate in contact."""
    scene = load_scene("wide", [f"numerics.preset={'paper' if elements == 'linear' else 'accurate'}",
                                f"numerics.refinement={refinement}",
                                f'pore.width="{HEIGHT} um"', f'aggregate.radius="{bodies.RADIUS} um"'])
    mechanics, seed = Mechanics.of(scene), seeded(scene)
    where, _ = meshes.quadrature_points(seed.body.reference[seed.body.solid.shape.cells], seed.body.solid.shape.table)
    theta = _uneven(*np.moveaxis(where, 2, 0))
    first, expansion = _first_contact(mechanics, seed, theta)
    for part in first + (1 - first) * np.arange(1, STEPS + 1) / STEPS:
        before = _touching(seed, expansion)
        shape = replace(before.moved(expansion.position), pressure=expansion.pore.pressure[: seed.mesh.corners])
        expansion = contact.expand(mechanics, before, [theta**part], shape)
    return expansion


def _first_contact(mechanics, seed, theta) -> tuple[float, Expansion]:
    """The part of the growth, as a power of theta, that leaves half of the least film, and the shape in contact."""
    shapes = [seed]

    def gap(part: float) -> float:
        try:
            shape = contact.expand(mechanics, seed, [theta**part], shapes[-1])
        except FirstContact as contact_made:
            return contact_made.gaps[1] - WALLS.film / 2
        if not shape.pore.contact:
            shapes.append(shape.pore)
        return shape.gaps[1] - WALLS.film / 2

    part = next(part for part in np.arange(0.05, 1.0, 0.05) if gap(part) < WALLS.film / 2)
    part = brentq(gap, part - 0.05, part, xtol=1e-3)
    return part, contact.expand(mechanics, seed, [theta**part], shapes[-1])


def _touching(seed: Pore, expansion: Expansion) -> Pore:
    """The seed with the opposite wall at the corners, and at the arcs between them, that are in contact under an
    expansion."""
    height = expansion.position[seed.mesh.loop][:, 1]
    in_contact = np.isclose(height, HEIGHT, rtol=1e-9)
    if seed.mesh.geometry == 2:
        in_contact[1::2] = in_contact[::2] & np.roll(in_contact[::2], -1)
    return seed.with_body(wall=np.where(in_contact, TOP, seed.body.wall))


def differences(refinement: float, elements: str) -> dict[str, float]:
    """Element size along the arc (um), and differences to the reference: of contact lines and contact length over that
    length, of tips over the length of the aggregate, and of the outline's material points (root mean square)."""
    reference, rim = reference_solution(len(LEVELS) - 1), grown(elements, refinement).pore.boundary
    in_contact = np.flatnonzero(rim.wall == TOP)  # counterclockwise, so from downstream to upstream
    ends, edges = rim.points[in_contact[[0, -1]], 0], rim.edge_lengths()[[in_contact[0], in_contact[-1] - 1]]
    length, tips = np.ptp(reference.lines), np.array([rim.downstream, rim.upstream])
    angle, place = contact_growth.outline(reference.equilibrium)
    above = rim.origin[:, 1] > 0
    angles = np.arctan2(*rim.origin[above].T[::-1])
    distances = rim.points[above].T - [np.interp(angles, angle, coordinate) for coordinate in place]
    return {"size": np.pi * bodies.RADIUS / (above.sum() + 1) * rim.geometry,
            "contact lines": np.abs(ends - reference.lines).max() / length,
            "length of contact": abs(np.ptp(ends) / length - 1),
            "edges": max(abs(end - line) / beside for end, line, beside in zip(ends, reference.lines, edges)),
            "tips": np.abs(tips - reference.tips).max() / np.ptp(reference.tips),
            "outline": np.sqrt(np.mean(np.sum(distances**2, axis=0))) / np.ptp(reference.tips)}


#: Refinements of the package, by elements; those of quadratic ones are the preset fast's 0.2 and accurate's 0.45, and
#: twice and four times the latter.
REFINEMENTS = {"linear": (1.4, 2.8), "quadratic": (0.2, 0.45, 0.9, 1.8)}
SINGULAR = ("displacements like r^(1/2) at a contact line: first order for elements of any degree. The line divides "
            "its arc anywhere, which scatters the error by a factor of about two: half an order over all sizes")
ONE_BY_ONE = "nodes join the wall until the rule holds: one edge at most, and one more if two join at once"


@pytest.mark.slow
@pytest.mark.case(
    "growth-contact-lines", kind="cross-code", mutants=("half-angle",),
    references=("contact_growth", "quadratic_growth"), runs_with="fast accurate",
    omitted="3: the same triangles and quadratic displacements; all differences agreed to three digits")
@parametrize("elements", {name: (name,) for name in REFINEMENTS})
def test_contact_lines(elements, record):
    """A half-disc that grows unevenly into the opposite wall has the contact surface of an independent solution, in
    which the contact lines are unknown angles of a mesh that slides with them.

    Norm: places of both contact lines and length of contact over that length, tips over the aggregate's length, and
    material points of the outline over the same length, root mean square.
    """
    errors = refine(differences, REFINEMENTS[elements], elements)
    before, last = (reference_solution(level).lines for level in (len(LEVELS) - 2, len(LEVELS) - 1))
    record(at_most("last change of the reference's contact lines over the length of contact",
                   np.abs(before - last).max() / np.ptp(last), 1e-3, "a tenth of the error allowed to the package"))
    if elements == "linear":
        record(at_most("contact lines, over the edge beside them", errors["edges"].max(), 2.0, ONE_BY_ONE))
    else:
        decrease = {name: np.log(values[0] / values[-1]) for name, values in errors.items()}
        for name in ("contact lines", "length of contact", "outline"):
            record(between(f"order of the {name}", decrease[name] / decrease["size"], *around(1, 0.5), SINGULAR))
        for name in ("contact lines", "length of contact"):
            record(at_most(name, errors[name][-1], 1e-2, "the error of the preset fast after contact"))
    for name in ("tips", "outline"):
        record(at_most(name, errors[name][-1], 1e-3, "a tenth of the error of the preset fast"))
