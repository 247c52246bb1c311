"""Hard cases of meshes: fifty remeshes, nearly cocircular points, a poor mesh to start from, 1e5 nodes in one step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from repro.curved import flow as curved_flow
from repro.curved import outline as curved_outline
from repro.curved import pore as curved_pore
from repro.curved import transfer
from repro.fem import geometry, mesh, reprojection
from repro.model import flow
from verification.case import Check, at_least, at_most
from verification.hard import common
from verification.hard.common import TOLERANCE, HardCase

FIFTY = 50


def remeshes(preset: str) -> list:
    """Fifty new meshes, of sizes that change by a third, around the aggregate of base at 4 h; then a step."""
    made = common.scene("base", preset, 'aggregate.radius="20 um"', 'growth.end="4 h"', 'output.times=["4 h"]')
    found = common.ran(made)
    first, solved = found.instants[-1].pore, found.instants[-1].solved
    now = first
    for which in range(FIFTY):
        finer = replace(made.numerics, refinement=made.numerics.refinement * (0.85, 1.0, 1.15)[which % 3])
        now = common.remeshed(preset, replace(made, numerics=finer), now,
                              replace(solved, concentrations=now.concentrations))
    return [found, *_kept(made, first, now), *_step_after(preset, made, first, now)]


def _kept(made, first, now) -> list[Check]:
    inert = [float(_integral(pore, pore.inert)) for pore in (first, now)]
    total = [common.mass(pore) / (1.0 if isinstance(pore, curved_pore.Pore) else made.kinetics.maximum_density)
             for pore in (first, now)]
    share = [_shares(pore) for pore in (first, now)]
    beyond = max(share[0].min() - share[1].min(), share[1].max() - share[0].max(), 0.0) / np.ptp(share[0])
    area = [pore.outline.area for pore in (first, now)]
    return [at_most("area, relative change", abs(area[1] / area[0] - 1), 1e-10, "outlines are split on themselves"),
            at_most("biomass, relative change", abs(total[1] / total[0] - 1), 1e-8, "the transfer conserves it"),
            at_most("X_I, relative change", abs(inert[1] / inert[0] - 1), 1e-8, "as above"),
            at_most("share of X_I beyond where it was, over its range", beyond, 0.05,
                    "projection overshoots by a part of a jump that there is not")]


def _integral(pore, field) -> float:
    if isinstance(pore, curved_pore.Pore):
        return pore.weights() @ field
    return pore.mesh.lumped(pore.mesh.biomass) @ field


def _shares(pore) -> np.ndarray:
    """X_I over X_A + X_I at the aggregate's nodes."""
    body = pore.mesh.body
    return pore.inert[body] / (pore.active + pore.inert)[body]


def _step_after(preset: str, made, first, now) -> list[Check]:
    """A step of 12 min from before and from after the remeshes."""
    shapes = [_numbers(preset, made, _step(preset, made, start).pore) for start in (first, now)]
    apart = np.abs(np.array(shapes[1]) / shapes[0] - 1)
    return [at_most(f"{name} after a step more, with and without them", value, TOLERANCE[preset],
                    common.PROMISED[preset]) for name, value in zip(NAMES, apart)]


def _step(preset: str, made, now):
    """A step of 12 min."""
    solved = common.scheme_of(preset).solve(made, now)
    return common.scheme_of(preset).attempt(made, replace(now, concentrations=solved.concentrations), solved, 0.2).step


NAMES = ("area", "thickness", "upstream tip", "conductivity")


def _numbers(preset: str, made, now) -> list[float]:
    """What NAMES say."""
    shape = now.outline
    return [shape.area, shape.thickness, shape.upstream, common.scheme_of(preset).solve(made, now).flow.conductivity]


REMESHES = HardCase(
    13, "remeshes", "Fifty forced remeshes",
    "Area and biomass as before, X_I and the next step as without them",
    "Mass that drifts by percents (30 % in 40 remeshes by linear interpolation), or places at t = 0 that fold",
    {"base at 4 h": remeshes},
    mutants=("hard-inert-degraded-at-a-remesh", "theta-anew-at-a-remesh"))


def cocircular(preset: str) -> list:
    """Outlines whose nodes are on a circle up to 1e-15, 1e-12, 1e-9, 1e-6 of its radius."""
    made = common.scene("base", preset)
    checks, plain = [], _meshed(preset, made, 0.0)
    for size in (1e-15, 1e-12, 1e-9, 1e-6):
        grid, loss = _meshed(preset, made, size)
        corners = grid if preset == "paper" else grid.straight
        covered = corners.areas.sum() / (corners.width * (corners.ends[1] - corners.ends[0]))
        checks += [at_most(f"area covered, noise {size:g}", abs(covered - 1), 1e-12, "round-off"),
                   at_least(f"least quality, noise {size:g}", corners.quality.min(), 0.2, "a third of what is poor"),
                   at_most(f"head loss against no noise, noise {size:g}", abs(loss / plain[1] - 1), TOLERANCE[preset],
                           common.PROMISED[preset])]
    return checks


def _meshed(preset: str, made, noise: float):
    """(mesh, head loss) around a half-disc of 20 um with noise on its nodes."""
    random = np.random.default_rng(7)
    if preset == "paper":
        shape = _noisy(geometry.seed(20.0, made.numerics.refinement), noise, random)
        ends = geometry.meshed_extent(shape, 50.0, made.pore.length)
        grid, _ = mesh.generate(shape, ends, geometry.Sizing(50.0, made.numerics.refinement, 2.0))
        return grid, flow.unit_flow(grid, 2000.0).loss
    shape = _noisy(curved_outline.seed(20.0, made.numerics.refinement), noise, random)
    grid, _ = curved_pore.generate(made, shape)
    return grid, curved_flow.unit_flow(grid, 2000.0)[2]


def _noisy(shape, noise: float, random):
    """The same outline with noise on its free nodes."""
    points = shape.points.copy()
    free = shape.wall == geometry.FREE
    points[free] += 20.0 * noise * random.uniform(-1, 1, (free.sum(), 2))
    return type(shape)(points, shape.wall, shape.fixed, shape.origin)


def nearly_same(preset: str) -> list:
    """The transfer between meshes whose nodes agree up to 1e-15 and 1e-12: pieces without area, nodes on edges."""
    made = common.scene("base", preset, 'aggregate.radius="20 um"')
    grid = common.scheme_of(preset).seeded(made).mesh
    places = grid.points[grid.body]
    field = np.sin(places / 7.0)
    inner = ~np.isin(np.arange(len(places)), grid.body_loop)
    checks, random = [], np.random.default_rng(8)
    for noise in (0.0, 1e-14, 1e-11, 1e-8):
        other = places.copy()
        other[inner] += noise * random.uniform(-1, 1, (inner.sum(), 2))
        if preset == "paper":
            found = reprojection.project(places, grid.body_triangles, field, other, grid.body_triangles)
        else:
            found = transfer.interpolate(places, grid.body_cells, field, other)
        checks.append(at_most(f"largest change of a field of size one, noise {noise:g} um", np.abs(found - field).max(),
                              1e-9 + noise, "the identity, and what the field changes"))
    return checks


COCIRCULAR = HardCase(
    18, "cocircular", "Nearly cocircular points",
    "A mesh that covers the pore, the flow of the exact circle, and the identity between nearly equal meshes",
    "A Delaunay triangulation with slivers or holes, a supermesh that loses pieces",
    {"outline": cocircular, "transfer": nearly_same},
    mutants=("hard-shallowest-taken",))


def poor(preset: str) -> list:
    """Base from 20 um whose fluid starts with poor triangles: two steps of 12 min against those from a good mesh."""
    made = common.scene("base", preset, 'aggregate.radius="20 um"')
    good, _ = common.seeded(preset, made)
    bad, count = _spoilt(preset, good)
    ends, fresh = [], []
    for start in (good, bad):
        now, remeshed = start, []
        for _ in range(2):
            step = _step(preset, made, now)
            now = step.pore
            remeshed.append(step.remeshed)
        ends.append(_numbers(preset, made, now))
        fresh.append(any(remeshed))
    apart = np.abs(np.array(ends[1]) / ends[0] - 1)
    return [at_least("poor triangles at the start", count, mesh.POOR_ALLOWED + 1, "else less is tested"),
            at_least("remeshed on the way", fresh[1], 1, "3.5"),
            *(at_most(f"{name} after two steps", value, TOLERANCE[preset], common.PROMISED[preset])
              for name, value in zip(NAMES, apart))]


def _spoilt(preset: str, now):
    """The pore with the fluid's inner nodes moved about as far as no triangle turns over, and its poor triangles."""
    grid, random = now.mesh, np.random.default_rng(9)
    straight = grid if preset == "paper" else grid.straight
    keep = np.concatenate([straight.body, straight.walls, straight.inlet, straight.outlet])
    inner = np.setdiff1d(np.arange(len(straight.points)), keep)
    push = random.uniform(-1, 1, (len(inner), 2)) * np.sqrt(straight.lumped()[inner])[:, None]
    for part in 0.9 ** np.arange(60):
        points = straight.points.copy()
        points[inner] += part * push
        moved = _moved(preset, grid, points)
        corners = moved if preset == "paper" else moved.straight
        if corners.areas.min() > 0.02 * straight.areas.min() and (preset == "paper" or not moved.turned_over().any()):
            return replace(now, mesh=moved), int(np.count_nonzero(corners.quality < mesh.POOR))
    raise RuntimeError("no such mesh")


def _moved(preset: str, grid, corners):
    """The mesh with its corners elsewhere, the fluid's edges straight."""
    if preset == "paper":
        return grid.moved(corners)
    points = grid.with_middles(corners)
    points[grid.body] = grid.points[grid.body]
    return grid.moved(points)


POOR = HardCase(
    19, "poor-mesh", "Poor initial mesh",
    "A new mesh within two steps, and the shape and flow of a good start",
    "Triangles turned over that no one notices",
    {"nodes moved at random": poor}, refusable=("nodes moved at random",),
    mutants=("hard-poor-mesh-kept",))

CASES = (REMESHES, COCIRCULAR, POOR)
