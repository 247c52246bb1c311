"""Motions of the aggregate for which the displacement of the fluid is known."""

from __future__ import annotations

import numpy as np

from reference import sliding_waves
from repro.fem.mesh import Mesh, curved
from repro.fem.space import Space
from verification import meshes, norms
from verification.case import Outcome, Profile, at_most, case
from verification.convergence import refine, study
from verification.mesh_motion.moves import GAMMAS, GEOMETRIES, moved, sample

WIDTH, ENDS, HALF = 30.0, (-60.0, 60.0), 20.0
LINEAR = "the field is linear: round-off"


@case("mesh_motion-plug", kind="exact",
      norm="largest difference of displacement over the aggregate's largest, for gamma = 0.1, 1, 10",
      claim="A plug that slides and stretches along the pore, and a layer that thickens under a wall, stretch the "
            "fluid beside them linearly; a plug that rests moves nothing; on straight triangles and on curved ones",
      mutants=("walls-held", "outlet-moves", "interface-slips", "middles-left-behind"))
def plug() -> Outcome:
    checks = []
    for geometry, kind in GEOMETRIES.items():
        grid = _nodes(meshes.channel(ENDS, WIDTH, 3.0, lambda x, y: np.abs(x) < HALF, across=(-HALF, HALF), seed=1),
                      geometry)
        layer = _nodes(meshes.channel(ENDS, WIDTH, 3.0, lambda x, y: y < 12.0, along=(12.0,), seed=2), geometry)
        x, y = grid.points[:, 0], layer.points[:, 1]
        slid = np.interp(x, [ENDS[0], -HALF, HALF, ENDS[1]], [0.0, 2.0, 5.0, 0.0])
        thicker = np.interp(y, [0.0, 12.0, WIDTH], [0.0, 3.0, 0.0])
        for name, mesh, exact in (("plug", grid, np.column_stack([slid, 0 * x])),
                                  ("layer", layer, np.column_stack([0 * y, thicker]))):
            checks += [at_most(f"{name}, gamma = {gamma:g}, {kind}", _error(mesh, exact, gamma), 1e-11, LINEAR)
                       for gamma in GAMMAS]
        rest = np.abs(moved(grid, grid.points) - grid.points).max()
        checks.append(at_most(f"at rest, {kind}", rest, 0.0, "nothing moves"))
    return Outcome(tuple(checks))


def _nodes(straight: Mesh, geometry: int) -> Mesh:
    """With nodes in the middles of edges where triangles are to be curved."""
    return straight if geometry == 1 else curved(straight, None)


def _error(grid: Mesh, displacement: np.ndarray, gamma: float, nodes=slice(None)) -> float:
    """Largest difference from a displacement (N, 2) over its largest value."""
    found = moved(grid, grid.points + displacement, gamma) - grid.points
    return np.abs(found - displacement)[nodes].max() / np.abs(displacement).max()


MOTIONS = {"slides": ([[0.0, 0.0], [0.0, 0.0]], (3.0, 1.0)),
           "turns by 30 degrees": ([[np.cos(np.pi / 6) - 1, -0.5], [0.5, np.cos(np.pi / 6) - 1]], (0.0, 0.0)),
           "is sheared": ([[0.0, 0.4], [0.0, 0.0]], (0.0, 0.0)),
           "doubles": ([[1.0, 0.0], [0.0, 1.0]], (0.0, 0.0)),
           "is stretched": ([[0.5, 0.1], [-0.2, -0.3]], (1.0, -2.0))}


@case("mesh_motion-pocket", kind="exact",
      norm="largest difference of displacement over the aggregate's largest, for gamma = 0.1, 1, 10",
      claim="Fluid that an aggregate encloses follows every rigid and every linear motion of it, on straight triangles "
            "and on curved ones",
      mutants=("interface-slips", "stale-fluid"))
def pocket() -> Outcome:
    lines = {"across": (-HALF, -9.0, 9.0, HALF), "along": (8.0, 21.0)}
    straight, checks = meshes.channel(ENDS, WIDTH, 2.5, _around_a_pocket, **lines, seed=3), []
    for geometry, kind in GEOMETRIES.items():
        grid = _nodes(straight, geometry)
        x, y = grid.points.T
        inside = np.flatnonzero((np.abs(x) <= 9.0) & (y >= 8.0) & (y <= 21.0))
        for name, (matrix, shift) in MOTIONS.items():
            displacement = grid.points @ np.transpose(matrix) + shift
            error = max(_error(grid, displacement, gamma, inside) for gamma in GAMMAS)
            checks.append(at_most(f"the aggregate {name}, {kind}", error, 1e-11, LINEAR))
    return Outcome(tuple(checks))


def _around_a_pocket(x, y):
    return (np.abs(x) < HALF) & ~((np.abs(x) < 9.0) & (y > 8.0) & (y < 21.0))


SIZES, SEEDS = (5.0, 2.5, 1.25, 0.625), range(3)
#: Half length of the strip, of the plug in it, and the width (um).
END, FACE, NARROW = 30.0, 10.0, 20.0
#: Every gamma of the waves, nearly incompressible the first, with the most that the last error may be.
CEILINGS = {0.01: 3e-3, 0.1: 3e-3, 1.0: 2e-3, 10.0: 1.2e-3}


@case("mesh_motion-waves", kind="exact",
      norm="L2 of the fluid's displacement, relative, mean of three random meshes a size",
      claim="Between a plug whose faces are bent by a wave and the ends of the mesh the fluid is displaced as the "
            "closed form says, for every gamma, sliding along walls and ends, on straight triangles and on curved ones",
      mutants=("gamma-sign", "gamma-inverted", "twice-the-divergence", "walls-held"))
def waves() -> Outcome:
    studies = []
    for geometry, kind in GEOMETRIES.items():
        for gamma, ceiling in CEILINGS.items():
            errors = refine(_wave_error, SIZES, gamma, geometry)["displacement"]
            studies.append(study(f"gamma = {gamma:g}, {kind}", SIZES, errors, 2, "linear elements: second order",
                                 ceiling=ceiling))
    return Outcome(studies=tuple(studies), profiles=(_along_the_wall(),))


def _bent(size: float, seed: int, geometry: int = 1) -> Mesh:
    return _nodes(meshes.channel((-END, END), NARROW, size, lambda x, y: np.abs(x) < FACE, across=(-FACE, FACE),
                                 seed=seed), geometry)


def _wave(x, y, gamma: float) -> np.ndarray:
    """(..., 2) closed form on both sides, a mirror image of each other; within the plug that of its faces."""
    far = np.minimum(END - np.abs(x), END - FACE)
    along, across = sliding_waves.displacement(far, y, NARROW, gamma, END - FACE)
    return np.stack([-np.sign(x) * along, across], axis=-1)


def _wave_error(size: float, gamma: float, geometry: int) -> dict[str, float]:
    errors = []
    for seed in SEEDS:
        grid = _bent(size, 10 * seed + round(size), geometry)
        errors.append(norms.field_error(Space(grid, geometry), _waved(grid, gamma), lambda x, y: _wave(x, y, gamma),
                                        ~grid.biomass))
    return {"displacement": float(np.mean(errors))}


def _waved(grid: Mesh, gamma: float) -> np.ndarray:
    """(N, 2) displacement of the nodes."""
    return moved(grid, grid.points + _wave(*grid.points.T, gamma), gamma) - grid.points


def _along_the_wall() -> Profile:
    """d_x along the lower wall, left of the plug, for every gamma."""
    grid, x, curves = _bent(2.5, 1), np.linspace(-END, -FACE, 102)[1:-1], []
    line, dots = np.column_stack([x, 0 * x + 1e-6]), x[::6]
    for gamma in GAMMAS:
        found = _waved(grid, gamma)
        scale = np.abs(_wave(x, 0 * x, gamma)).max()
        curves += [(f"gamma = {gamma:g}", "ours", x, sample(grid, found, line)[:, 0] / scale),
                   ("closed form", "exact", dots, _wave(dots, 0 * dots, gamma)[:, 0] / scale)]
    return Profile("displacement along the wall", "x (um)", "d_x over its largest", tuple(curves))
