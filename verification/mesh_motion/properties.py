"""What every motion of the mesh must keep: triangles upright, nodes on their lines, a way back; and when to remesh."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from repro.fem.mesh import Mesh, curved
from repro.fem.space import Space
from verification.kernel.case import Outcome, Profile, at_least, at_most, case, study
from verification.mesh_motion.closed_forms import EITHER, moved
from verification.problems import meshes

WIDTH, ENDS = 50.0, (-75.0, 75.0)
#: Radius of the half-disc (um), by which factor it grows, and how far it slides over its radius.
JOURNEYS = ((5.0, 2.0, 1.0), (20.0, 2.0, 1.0), (35.0, 1.3, 0.5))
STEPS = 18


@case("mesh_motion-growth", kind="property",
      norm="least area of a triangle over its own at first; area of fluid and biomass, relative; distance from a line",
      claim="A half-disc that doubles its area, or slides by its radius, in 18 steps (under a narrow film: grows by "
            "30 %, slides by half of it) turns no triangle over, leaves no gap, and keeps the nodes of walls, inlet "
            "and outlet on their lines, whether triangles are straight or curved",
      mutants=("stale-fluid", "outlet-moves"), over=EITHER, ways="3")
def growth(geometry: int):
    curves = []
    for radius, factor, way in JOURNEYS:
        for name, stretch, shift in (("grown", factor ** (0.5 / STEPS), 0.0), ("slid", 1.0, way * radius / STEPS)):
            path, title = _journey(_half_disc(radius, geometry), stretch, shift), f"R = {radius:g} um, {name}"
            yield _kept(title, path[0], path[-1])
            curves.append((title, "ours", np.arange(STEPS + 1),
                           np.array([(grid.areas / path[0].areas).min() for grid in path])))
    yield Profile("least area of a triangle over its own at first", "step", "ratio", tuple(curves))


@cache
def _half_disc(radius: float, geometry: int) -> Mesh:
    return meshes.half_disc(radius, 1.0, ENDS, WIDTH, geometry=geometry)


def _journey(grid: Mesh, stretch: float, shift: float) -> list[Mesh]:
    """The mesh before and after each step, in which the aggregate is stretched and shifted."""
    path = [grid]
    for _ in range(STEPS):
        path.append(path[-1].moved(moved(path[-1], stretch * path[-1].points + [shift, 0.0])))
    return path


def _kept(name: str, first: Mesh, last: Mesh) -> list:
    """Checks of one journey."""
    apart, space = last.points - first.points, Space(first, first.geometry)
    ends = np.concatenate([space.end_nodes(edges) for edges in (space.dofs.inlet, space.dofs.outlet)])
    inlet, outlet = first.topology.inlet, first.topology.outlet
    corners = np.concatenate([inlet[[0, -1]], outlet[[0, -1]]])
    off = max(np.abs(apart[space.dofs.walls, 1]).max(), np.abs(apart[ends, 0]).max(), np.abs(apart[corners]).max())
    return [at_least(f"least area over its own at first: {name}", (last.areas / first.areas).min(), 0.25,
                     "upright, and not near turning over"),
            at_most(f"triangles turned over: {name}", last.turned_over().sum(), 0.0, "at no node or quadrature point"),
            at_most(f"area of fluid and biomass: {name}", abs(_area(last) / _area(first) - 1), 1e-12,
                    "no gap, no overlap"),
            at_most(f"off its line (um): {name}", off, 0.0, "nodes slide; the four corners rest")]


def _area(grid: Mesh) -> float:
    """Of all triangles, bent edges included, um2."""
    return float(meshes.fine(Space(grid, grid.geometry))[1].sum())


STRIDES = (0.08, 0.04, 0.02, 0.01)


@case("mesh_motion-round-trip", kind="property",
      norm="root mean square of the nodes' distances from where they started, over the radius, or the largest",
      claim="There and back, the nodes return to second order in the length of the way, since the way back starts from "
            "the moved mesh; beside a plug, where the motion is linear, to round-off",
      mutants=("stale-forms", "stale-fluid"), over=EITHER, ways="3")
def round_trip(geometry: int):
    grid = _half_disc(20.0, geometry)
    ways = {"grows": [_there_and_back(grid, 1 + stride, 0.0) for stride in STRIDES],
            "slides": [_there_and_back(grid, 1.0, 20 * stride) for stride in STRIDES]}
    for (name, back), ceiling in zip(ways.items(), (4e-5, 4e-6)):
        yield study(f"a half-disc {name}", STRIDES, np.sqrt(np.mean(np.square(back), axis=(1, 2))) / 20.0, 2,
                    "(35) is linear in the motion on a given mesh: second order", ceiling=ceiling, band=0.1)
    plug = meshes.space_on(meshes.plug((-60.0, 60.0), 30.0, 20.0, 3.0, seed=4), geometry).mesh
    missed = np.abs(_there_and_back(plug, 1.2, 10.0)).max()
    yield at_most("a plug that stretches and slides (um)", missed, 1e-11, "linear on each side: round-off")


def _there_and_back(grid: Mesh, stretch: float, shift: float) -> np.ndarray:
    """(N, 2) um by which nodes miss their first place; in x alone is the aggregate stretched where it is a plug."""
    by = np.array([stretch, 1.0 if len(grid.loop) == 0 else stretch])
    there = grid.moved(moved(grid, by * grid.points + [shift, 0.0]))
    return moved(there, (there.points - [shift, 0.0]) / by) - grid.points


@case("mesh_motion-criterion", kind="exact",
      norm="largest difference of the quality; verdicts on meshes with so many triangles stretched",
      claim="An equilateral triangle stretched by s has the quality 2 s / (1 + s^2), however it lies; a mesh is remade "
            "if seven triangles are stretched by more than 3, or one is turned over, and not if six are; a curved "
            "triangle of the aggregate may be bent, but not so far that it turns over at a node",
      mutants=("more-poor-triangles", "turned-over-accepted", "quality-halved", "remeshed-too-late",
               "bent-over-accepted"), ways="1 2 3")
def criterion() -> Outcome:
    stretch = np.random.default_rng(5).uniform(0.1, 8.0, 50)
    off = np.abs(_triangles(stretch).quality - 2 * stretch / (1 + stretch**2)).max()
    verdicts = {"six by 3.001": (6, 3.001, True), "seven by 2.999": (7, 2.999, True),
                "seven by 3.001": (7, 3.001, False), "one turned over": (1, -1.0, False)}
    bows = {"one edge bent by 0.49": (0.49, True), "one edge bent by 0.51": (0.51, False)}
    return Outcome((at_most("quality", off, 1e-12, "closed form: round-off"),
                    *(at_most(f"wrong verdicts: {name}", float(_stretched(count, by).acceptable() != fine), 0.0, "3.5")
                      for name, (count, by, fine) in verdicts.items()),
                    *(at_most(f"wrong verdicts: {name}", float(_bent(bow).acceptable() != fine), 0.0,
                              "the map is one to one while it is bent by less than half the height")
                      for name, (bow, fine) in bows.items())))


def _stretched(count: int, by: float) -> Mesh:
    """Thirty triangles, so many of them stretched."""
    return _triangles(np.where(np.arange(30) < count, by, 1.0))


def _bent(bow: float) -> Mesh:
    """Thirty equilateral triangles of an aggregate, the middle of one edge moved inwards by a part of the height.

    Along that edge the map's determinant is (1 - 2 bow) times that of the straight triangle.
    """
    flat = _triangles(np.ones(30))
    topology = replace(flat.topology, biomass=np.ones(30, bool))
    grid = curved(replace(flat, topology=topology), None)
    points = grid.points.copy()
    a, b, c = grid.triangles[0]
    points[grid.cells[0, 3]] += bow * (points[c] - 0.5 * (points[a] + points[b]))
    return grid.moved(points)


def _triangles(stretch: np.ndarray) -> Mesh:
    """Equilateral triangles, each stretched along a line of its own, each apart from the others; negative: mirrored."""
    turn = np.linspace(0.0, 3.0, len(stretch))
    corner = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(0.75)]])
    shapes = corner * np.stack([stretch, np.ones(len(stretch))], axis=1)[:, None]
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    points = np.einsum("ijt,taj->tai", rotation, shapes).reshape(-1, 2)
    triangles = np.arange(len(points)).reshape(-1, 3)
    return Mesh.of(points, triangles, np.zeros(len(triangles), bool), np.empty(0, int), WIDTH, ENDS)
