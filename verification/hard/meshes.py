"""Hard cases of meshes: fifty remeshes, nearly cocircular points, a poor mesh to start from, 1e5 nodes in one step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from repro.fem import sizing, transfer
from repro.fem.mesh import POOR, POOR_ALLOWED, Mesh
from repro.fem.outline import FREE, Outline, half_disc
from repro.fem.space import Space
from repro.model import biomass, flow, pore, remeshing
from repro.model.pore import Pore
from repro.scene import Scene
from verification.case import Check, at_least, at_most
from verification.hard import common
from verification.hard.common import TOLERANCE, HardCase

FIFTY = 50


def remeshes(preset: str) -> list:
    """Fifty new meshes, of sizes that change by a third, around the aggregate of base at 4 h; then a step."""
    made = common.scene("base", preset, 'aggregate.radius="20 um"', 'growth.end="4 h"', 'output.times=["4 h"]')
    found = common.ran(made)
    first, speed = found.instants[-1].pore, found.instants[-1].solved.flow.mean_velocity
    now = first
    for which in range(FIFTY):
        finer = replace(made.numerics, refinement=made.numerics.refinement * (0.85, 1.0, 1.15)[which % 3])
        now, _ = remeshing.remesh(replace(made, numerics=finer), now, now, speed)
    return [found, *_kept(first, now), *_step_after(preset, made, first, now)]


def _kept(first: Pore, now: Pore) -> list[Check]:
    share = [_shares(one) for one in (first, now)]
    beyond = max(share[0].min() - share[1].min(), share[1].max() - share[0].max(), 0.0) / np.ptp(share[0])
    return [at_most("area, relative change", abs(now.outline.area / first.outline.area - 1), 1e-10,
                    "outlines are split on themselves"),
            at_most("biomass, relative change", abs(now.mass / first.mass - 1), 1e-8, "the transfer conserves it"),
            at_most("X_I, relative change", abs(now.inert.sum() / first.inert.sum() - 1), 1e-8, "as above"),
            at_most("share of X_I beyond where it was, over its range", beyond, 0.05,
                    "projection overshoots by a part of a jump that there is not")]


def _shares(now: Pore) -> np.ndarray:
    """X_I over X_A + X_I at the aggregate's nodes."""
    return biomass.at_nodes(now.space, now.inert / (now.active + now.inert))[now.mesh.body]


def _step_after(preset: str, made: Scene, first: Pore, now: Pore) -> list[Check]:
    """A step of 12 min from before and from after the remeshes."""
    shapes = [_numbers(made, _step(made, start).pore) for start in (first, now)]
    apart = np.abs(np.array(shapes[1]) / shapes[0] - 1)
    return [at_most(f"{name} after a step more, with and without them", value, TOLERANCE[preset],
                    common.PROMISED[preset]) for name, value in zip(NAMES, apart)]


def _step(made: Scene, now: Pore):
    """A step of 12 min."""
    return common.midpoint_step(made, *common.solved_in(made, now), 0.2)


NAMES = ("area", "thickness", "upstream tip", "conductivity")


def _numbers(made: Scene, now: Pore) -> list[float]:
    """What NAMES say."""
    shape = now.outline
    return [shape.area, shape.thickness, shape.upstream, pore.solve_flow(made, now.space).conductivity]


REMESHES = HardCase(
    13, "remeshes", "Fifty forced remeshes",
    "Area and biomass as before, X_I and the next step as without them",
    "Mass that drifts by percents (30 % in 40 remeshes by linear interpolation), or places at t = 0 that fold",
    {"base at 4 h": remeshes},
    mutants=("hard-inert-degraded-at-a-remesh", "theta-anew-at-a-remesh"))


def cocircular(preset: str) -> list:
    """Outlines whose nodes are on a circle up to 1e-15, 1e-12, 1e-9, 1e-6 of its radius."""
    made = common.scene("base", preset)
    checks, plain = [], _meshed(made, 0.0)
    for size in (1e-15, 1e-12, 1e-9, 1e-6):
        grid, loss = _meshed(made, size)
        corners = grid.straight
        covered = corners.areas.sum() / (corners.width * (corners.ends[1] - corners.ends[0]))
        checks += [at_most(f"area covered, noise {size:g}", abs(covered - 1), 1e-12, "round-off"),
                   at_least(f"least quality, noise {size:g}", corners.quality.min(), 0.2, "a third of what is poor"),
                   at_most(f"head loss against no noise, noise {size:g}", abs(loss / plain[1] - 1), TOLERANCE[preset],
                           common.PROMISED[preset])]
    return checks


def _meshed(made: Scene, noise: float) -> tuple[Mesh, float]:
    """(mesh, head loss) around a half-disc of 20 um with noise on its nodes."""
    numerics = made.numerics
    plain = half_disc(20.0, sizing.ACROSS_AGGREGATE * numerics.refinement, numerics.geometry)
    grid, _ = pore.generate(made, _noisy(plain, noise, np.random.default_rng(7)))
    return grid, flow.unit_flow(Space(grid, numerics.order), 2000.0).loss


def _noisy(shape: Outline, noise: float, random) -> Outline:
    """The same outline with noise on its free nodes."""
    points = shape.points.copy()
    free = shape.wall == FREE
    points[free] += 20.0 * noise * random.uniform(-1, 1, (free.sum(), 2))
    return replace(shape, points=points)


#: How fields at the nodes go from mesh to mesh.
TRANSFER = {1: transfer.project, 2: transfer.interpolated}


def nearly_same(preset: str) -> list:
    """The transfer between meshes whose nodes agree up to 1e-15 and 1e-12: pieces without area, nodes on edges."""
    made = common.scene("base", preset, 'aggregate.radius="20 um"')
    grid = pore.seeded(made).mesh
    places, cells = grid.points[grid.body], grid.topology.body_cells
    field = np.sin(places / 7.0)
    inner = ~np.isin(np.arange(len(places)), grid.topology.body_loop)
    checks, random = [], np.random.default_rng(8)
    for noise in (0.0, 1e-14, 1e-11, 1e-8):
        other = places.copy()
        other[inner] += noise * random.uniform(-1, 1, (inner.sum(), 2))
        found = TRANSFER[grid.geometry](places, cells, field, other, cells)
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
    good, _ = common.seeded(made)
    bad, count = _spoilt(good)
    ends, fresh = [], []
    for start in (good, bad):
        now, remeshed = start, []
        for _ in range(2):
            step = _step(made, now)
            now = step.pore
            remeshed.append(step.remeshed)
        ends.append(_numbers(made, now))
        fresh.append(any(remeshed))
    apart = np.abs(np.array(ends[1]) / ends[0] - 1)
    return [at_least("poor triangles at the start", count, POOR_ALLOWED + 1, "else less is tested"),
            at_least("remeshed on the way", fresh[1], 1, "3.5"),
            *(at_most(f"{name} after two steps", value, TOLERANCE[preset], common.PROMISED[preset])
              for name, value in zip(NAMES, apart))]


def _spoilt(now: Pore) -> tuple[Pore, int]:
    """The pore with the fluid's inner nodes moved about as far as no triangle turns over, and its poor triangles."""
    random, topology, straight = np.random.default_rng(9), now.mesh.topology, now.mesh.straight
    keep = np.concatenate([straight.body, topology.walls, topology.inlet, topology.outlet])
    inner = np.setdiff1d(np.arange(now.mesh.corners), keep)
    push = random.uniform(-1, 1, (len(inner), 2)) * np.sqrt(Space(straight, 1).lumped()[inner])[:, None]
    for part in 0.9 ** np.arange(60):
        corners = straight.points.copy()
        corners[inner] += part * push
        moved = now.moved(_with_corners(now.mesh, corners))
        if moved.mesh.areas.min() > 0.02 * straight.areas.min() and not moved.mesh.turned_over().any():
            return moved, int(np.count_nonzero(moved.mesh.quality < POOR))
    raise RuntimeError("no such mesh")


def _with_corners(grid: Mesh, corners: np.ndarray) -> np.ndarray:
    """(N, 2) um, nodes with the corners elsewhere, the fluid's edges straight."""
    points = grid.with_middles(corners)
    points[grid.body] = grid.points[grid.body]
    return points


POOR_MESH = HardCase(
    19, "poor-mesh", "Poor initial mesh",
    "A new mesh within two steps, and the shape and flow of a good start",
    "Triangles turned over that no one notices",
    {"nodes moved at random": poor}, refusable=("nodes moved at random",),
    mutants=("hard-poor-mesh-kept",))

CASES = (REMESHES, COCIRCULAR, POOR_MESH)
