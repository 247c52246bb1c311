"""What every motion of the mesh must keep: triangles upright, nodes on their lines, a way back; and when to remesh."""

from __future__ import annotations

import numpy as np

from repro.fem import geometry, mesh
from verification import meshes
from verification.case import Outcome, Profile, at_least, at_most, case
from verification.convergence import study
from verification.mesh_motion.moves import moved

WIDTH, ENDS = 50.0, (-75.0, 75.0)
#: Radius of the half-disc (um), by which factor it grows, and how far it slides over its radius.
JOURNEYS = ((5.0, 2.0, 1.0), (20.0, 2.0, 1.0), (35.0, 1.3, 0.5))
STEPS = 18


@case("mesh_motion-growth", kind="property",
      norm="least area of a triangle over its own at first; area of fluid and biomass, relative; distance from a line",
      claim="A half-disc that doubles its area, or slides by its radius, in 18 steps (under a narrow film: grows by "
            "30 %, slides by half of it) turns no triangle over, leaves no gap, and keeps the nodes of walls, inlet "
            "and outlet on their lines",
      mutants=("stale-fluid", "outlet-moves"))
def growth() -> Outcome:
    checks, curves = [], []
    for radius, factor, way in JOURNEYS:
        for name, stretch, shift in (("grown", factor ** (0.5 / STEPS), 0.0), ("slid", 1.0, way * radius / STEPS)):
            path = _journey(_half_disc(radius), stretch, shift)
            checks += _kept(f"R = {radius:g} um, {name}", path[0], path[-1])
            curves.append((f"R = {radius:g} um, {name}", "ours", np.arange(STEPS + 1),
                           np.array([(grid.areas / path[0].areas).min() for grid in path])))
    return Outcome(tuple(checks), (), (Profile("least area of a triangle over its own at first", "step", "ratio",
                                               tuple(curves)),))


def _half_disc(radius: float) -> mesh.PoreMesh:
    return mesh.generate(geometry.seed(radius), ENDS, geometry.Sizing(WIDTH, 1.0, 2.0))[0]


def _journey(grid: mesh.PoreMesh, stretch: float, shift: float) -> list[mesh.PoreMesh]:
    """The mesh before and after each step, in which the aggregate is stretched and shifted."""
    path = [grid]
    for _ in range(STEPS):
        path.append(path[-1].moved(moved(path[-1], stretch * path[-1].points + [shift, 0.0])))
    return path


def _kept(name: str, first: mesh.PoreMesh, last: mesh.PoreMesh) -> list:
    """Checks of one journey."""
    apart = last.points - first.points
    ends = np.concatenate([first.inlet, first.outlet])
    corners = np.concatenate([first.inlet[[0, -1]], first.outlet[[0, -1]]])
    off = max(np.abs(apart[first.walls, 1]).max(), np.abs(apart[ends, 0]).max(), np.abs(apart[corners]).max())
    return [at_least(f"least area over its own at first: {name}", (last.areas / first.areas).min(), 0.25,
                     "upright, and not near turning over"),
            at_most(f"area of fluid and biomass: {name}", abs(last.areas.sum() / first.areas.sum() - 1), 1e-12,
                    "no gap, no overlap"),
            at_most(f"off its line (um): {name}", off, 0.0, "nodes slide; the four corners rest")]


STRIDES = (0.08, 0.04, 0.02, 0.01)


@case("mesh_motion-round-trip", kind="property",
      norm="root mean square of the nodes' distances from where they started, over the radius, or the largest",
      claim="There and back, the nodes return to second order in the length of the way, since the way back starts from "
            "the moved mesh; beside a plug, where the motion is linear, to round-off",
      mutants=("stale-forms", "stale-fluid"))
def round_trip() -> Outcome:
    grid = _half_disc(20.0)
    ways = {"grows": [_there_and_back(grid, 1 + stride, 0.0) for stride in STRIDES],
            "slides": [_there_and_back(grid, 1.0, 20 * stride) for stride in STRIDES]}
    studies = tuple(study(f"a half-disc {name}", STRIDES, np.sqrt(np.mean(np.square(back), axis=(1, 2))) / 20.0, 2,
                          "(35) is linear in the motion on a given mesh: second order", ceiling=ceiling, band=0.1)
                    for (name, back), ceiling in zip(ways.items(), (4e-5, 4e-6)))
    plug = meshes.channel((-60.0, 60.0), 30.0, 3.0, lambda x, y: np.abs(x) < 20, across=(-20.0, 20.0), seed=4)
    missed = np.abs(_there_and_back(plug, 1.2, 10.0)).max()
    return Outcome((at_most("a plug that stretches and slides (um)", missed, 1e-11, "linear on each side: round-off"),),
                   studies)


def _there_and_back(grid: mesh.PoreMesh, stretch: float, shift: float) -> np.ndarray:
    """(N, 2) um by which nodes miss their first place; in x alone is the aggregate stretched where it is a plug."""
    by = np.array([stretch, 1.0 if len(grid.loop) == 0 else stretch])
    there = grid.moved(moved(grid, by * grid.points + [shift, 0.0]))
    return moved(there, (there.points - [shift, 0.0]) / by) - grid.points


@case("mesh_motion-criterion", kind="exact",
      norm="largest difference of the quality; verdicts on meshes with so many triangles stretched",
      claim="An equilateral triangle stretched by s has the quality 2 s / (1 + s^2), however it lies; a mesh is remade "
            "if seven triangles are stretched by more than 3, or one is turned over, and not if six are",
      mutants=("more-poor-triangles", "turned-over-accepted", "quality-halved", "remeshed-too-late"))
def criterion() -> Outcome:
    stretch = np.random.default_rng(5).uniform(0.1, 8.0, 50)
    off = np.abs(_triangles(stretch).quality - 2 * stretch / (1 + stretch**2)).max()
    verdicts = {"six by 3.001": (6, 3.001, True), "seven by 2.999": (7, 2.999, True),
                "seven by 3.001": (7, 3.001, False), "one turned over": (1, -1.0, False)}
    return Outcome((at_most("quality", off, 1e-12, "closed form: round-off"),
                    *(at_most(f"wrong verdicts: {name}", float(_stretched(count, by).acceptable() != fine), 0.0, "3.5")
                      for name, (count, by, fine) in verdicts.items())))


def _stretched(count: int, by: float) -> mesh.PoreMesh:
    """Thirty triangles, so many of them stretched."""
    return _triangles(np.where(np.arange(30) < count, by, 1.0))


def _triangles(stretch: np.ndarray) -> mesh.PoreMesh:
    """Equilateral triangles, each stretched along a line of its own, each apart from the others; negative: mirrored."""
    turn = np.linspace(0.0, 3.0, len(stretch))
    corner = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(0.75)]])
    shapes = corner * np.stack([stretch, np.ones(len(stretch))], axis=1)[:, None]
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    points = np.einsum("ijt,taj->tai", rotation, shapes).reshape(-1, 2)
    triangles = np.arange(len(points)).reshape(-1, 3)
    return mesh.PoreMesh(points, triangles, np.zeros(len(triangles), bool), np.empty(0, int), WIDTH, ENDS)
