"""The fluid around an aggregate on a wall, against quadratic elements without a pressure on meshes of their own."""

from __future__ import annotations

from functools import cache
from itertools import product

import numpy as np

from reference import quadratic_mesh_motion
from repro.fem import mesher, outline
from repro.fem.mesh import Mesh
from repro.fem.sizing import ACROSS_AGGREGATE, Sizing
from verification import norms
from verification.case import Outcome, Profile, case
from verification.convergence import study
from verification.mesh_motion.moves import GAMMAS, GEOMETRIES, moved, sample

RADIUS, WIDTH, END, FILM = 25.0, 50.0, 50.0, 2.0
#: Refinements of our meshes with the parts a side of theirs: both codes are refined.
LEVELS = ((0.7, 6), (1.1, 8), (1.9, 12), (3.3, 16))
CORNER_LEVELS = ((0.7, 8), (1.3, 12), (2.4, 16), (4.4, 24))
#: Contact angle of the second aggregate: the fluid's, 120 degrees, is what makes a corner singular.
CONTACT = np.radians(60)
BOTH = "0.1 % between codes"


def _grows(x, y):
    return np.array([x, y])


def _slides(x, y):
    return np.array([RADIUS + 0 * x, 0 * y])


MOTIONS = {"grows": _grows, "slides": _slides}


@case("mesh_motion-half-disc", kind="cross-code",
      norm="L2 of the difference of the whole displacement over that of the displacement",
      claim="Around a half-disc that grows, or slides along the wall, the fluid is displaced as an independent code "
            "displaces it, for three gamma, on straight triangles and on curved ones; both codes refined",
      mutants=("gamma-sign", "twice-the-divergence", "gamma-inverted"))
def half_disc() -> Outcome:
    why, studies = f"linear elements: second order, no singular corner (mirror images); {BOTH}", []
    for geometry, kind in GEOMETRIES.items():
        grids = [_segment(np.pi / 2, refinement, geometry) for refinement, _ in LEVELS]
        sizes = [norms.mean_size(grid) for grid in grids]
        for name, gamma in product(MOTIONS, GAMMAS):
            errors = [_apart(grid, np.pi / 2, parts, gamma, name) for grid, (_, parts) in zip(grids, LEVELS)]
            studies.append(study(f"{name}, gamma = {gamma:g}, {kind}", sizes, errors, 2, why, ceiling=1e-3))
    shown = _segment(np.pi / 2, LEVELS[1][0], 1)
    return Outcome(studies=tuple(studies), profiles=tuple(_beside(shown, name) for name in MOTIONS))


@case("mesh_motion-corner", kind="cross-code", slow=True,
      norm="L2 of the difference of the whole displacement over that of the displacement",
      claim="Around an aggregate whose contact angle is 60 degrees the order falls to twice the exponent of the "
            "fluid's corner of 120 degrees, for three gamma, on straight triangles and on curved ones; both codes "
            "refined",
      mutants=("gamma-inverted",))
def corner() -> Outcome:
    studies = []
    for geometry, kind in GEOMETRIES.items():
        grids = [_segment(CONTACT, refinement, geometry) for refinement, _ in CORNER_LEVELS]
        sizes = [norms.mean_size(grid) for grid in grids]
        for gamma in GAMMAS:
            order = 2 * quadratic_mesh_motion.exponent(np.pi - CONTACT, gamma)
            errors = [_apart(grid, CONTACT, parts, gamma, "grows") for grid, (_, parts) in zip(grids, CORNER_LEVELS)]
            studies.append(study(f"gamma = {gamma:g}, {kind}", sizes, errors, order,
                                 f"2 z, displacement like r^z at the corner; {BOTH}", ceiling=1e-3))
    return Outcome(studies=tuple(studies))


@cache
def _segment(contact: float, refinement: float, geometry: int) -> Mesh:
    """A mesh around a segment of a disc that meets the wall at an angle; pi/2: the half-disc."""
    height = RADIUS * (1 - np.cos(contact))
    half = int(np.ceil(contact * RADIUS / height * ACROSS_AGGREGATE * refinement))
    turn = np.linspace(np.pi / 2 - contact, np.pi / 2 + contact, 2 * geometry * half + 1)
    arc = RADIUS * np.column_stack([np.cos(turn), np.sin(turn) - np.cos(contact)])
    base = arc[0, 0] * np.linspace(-1, 1, 4 * geometry + 1)
    points = np.vstack([np.column_stack([base, 0 * base]), arc[1:-1]])
    wall = np.where(np.arange(len(points)) < len(base), outline.BOTTOM, outline.FREE)
    fixed = np.arange(len(points)) == 2 * geometry
    segment = outline.Outline(points, wall, fixed, points, geometry)
    return mesher.generate(segment, (-END, END), Sizing(WIDTH, refinement, FILM), geometry)[0]


def _displacement(grid, gamma: float, name: str) -> np.ndarray:
    """(N, 2) of our mesh, which is linear in the motion: it may be as large as the aggregate."""
    return moved(grid, grid.points + MOTIONS[name](*grid.points.T).T, gamma) - grid.points


@cache
def _followed(contact: float, parts: int, gamma: float, name: str) -> quadratic_mesh_motion.Motion:
    return quadratic_mesh_motion.follow(RADIUS, contact, WIDTH, END, parts, gamma, MOTIONS[name])


def _apart(grid, contact: float, parts: int, gamma: float, name: str) -> float:
    """Relative difference of both codes."""
    theirs = _followed(contact, parts, gamma, name)
    gap = sample(grid, _displacement(grid, gamma, name), theirs.points) - theirs.displacement
    return float(np.sqrt(np.sum(theirs.weights @ gap**2) / np.sum(theirs.weights @ theirs.displacement**2)))


def _beside(grid, name: str) -> Profile:
    """d_x from the aggregate to the upper right corner of the mesh, for three gamma."""
    curves = []
    for gamma in GAMMAS:
        theirs = _followed(np.pi / 2, 12, gamma, name)
        x, ours = theirs.line[:, 0], sample(grid, _displacement(grid, gamma, name), theirs.line)
        curves += [(f"gamma = {gamma:g}", "ours", x, ours[:, 0] / RADIUS),
                   ("quadratic", "reference", x, theirs.on_line[:, 0] / RADIUS)]
    return Profile(f"beside a half-disc that {name}", "x (um)", "d_x / R", tuple(curves))
