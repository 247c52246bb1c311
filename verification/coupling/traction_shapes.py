"""The aggregate under the fluid's traction: closed forms, and that shape and flow agree."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from repro.fem import geometry
from repro.model import growth, mesh_motion, pore, remeshing, shape, traction
from repro.model.flow import Flow
from verification import meshes
from verification.case import Outcome, at_least, at_most, between, case
from verification.convergence import study
from verification.coupling import runs
from verification.coupling.traction import loaded_scene, nodal
from verification.growth import loaded


@case("coupling-traction-stretch", kind="exact", norm="relative error of positions; of P over mu_L",
      claim="A block on a wall that is pulled at both sides stretches as a neo-Hookean body does, a - a^-3 = T / mu_L, "
            "and keeps its area, on any mesh",
      mutants=("forces-pushed", "forces-halved"))
def stretch() -> Outcome:
    points, triangles = meshes.rectangle((-20.0, 20.0), 15.0, 4.0, seed=2)
    held = np.zeros((len(points), 2), bool)
    held[points[:, 1] == 0, 1] = True
    held[np.argmin(np.hypot(*points.T)), 0] = True
    points[held[:, 0], 0] = 0.0
    body, checks = growth.Body(points, triangles, held), []
    for factor in (0.8, 1.01, 1.5):
        pull = factor - factor**-3
        right, left = points[:, 0] == 20.0, points[:, 0] == -20.0
        forces = pull * (_ends(points, right) - _ends(points, left))
        found = growth.equilibrium(body, np.ones(len(triangles)), points, np.zeros(len(points)), points, forces)
        apart = np.abs(found.position - points * [factor, 1 / factor]).max() / 20.0
        pressure = (factor**2 + factor**-2 + 1) / 3 - factor**-2
        checks += [at_most(f"places, a = {factor:g}", apart, 1e-9, "linear displacement: Newton's tolerance"),
                   at_most(f"P, a = {factor:g}", np.abs(found.pressure - pressure).max(), 1e-9, "even: as before")]
    return Outcome(tuple(checks))


def _ends(points: np.ndarray, side: np.ndarray) -> np.ndarray:
    """(n, 2): lengths of the side's edges shared between their nodes, along x."""
    nodes = np.flatnonzero(side)
    nodes = nodes[np.argsort(points[nodes, 1])]
    share = np.zeros_like(points)
    length = np.diff(points[nodes, 1]) / 2
    share[nodes[:-1], 0] += length
    share[nodes[1:], 0] += length
    return share


@case("coupling-traction-even", kind="exact",
      norm="largest move of a node, over R; P over mu_L less what it was and the pressure; forces at free nodes less "
           "those of an even pressure, over the largest",
      claim="An even pressure of the fluid, five times mu_L and more, moves nothing: the aggregate is incompressible, "
            "and its P takes the pressure up",
      mutants=("traction-pressure-left-out", "forces-pushed"))
def even_pressure() -> Outcome:
    scene = loaded_scene()
    now = pore.seeded(scene)
    theta = now.theta * (1.1 + 0.002 * now.mesh.points[now.mesh.triangles[now.mesh.biomass], 0].mean(axis=1))
    plain, _, _ = shape._at_rest(scene, now, theta, None)
    still = Flow(0.0, 0 * now.mesh.points, np.full(len(now.mesh.points), 5.0), 0 * now.mesh.edges[:, 0], 0.0, 0.0, 0.0)
    loop, checks = plain.mesh.loop, []
    grid = now.mesh.moved(mesh_motion.move(now.mesh, plain.mesh.points[now.mesh.body], 1.0, 100.0))
    on = traction.nodal(grid, still, 1.0, "laplacian")
    by_hand = -5.0 * _normals(plain.outline)
    free = plain.wall == geometry.FREE
    checks.append(at_most("forces", np.abs(on[loop[free]] - by_hand[free]).max() / np.abs(by_hand).max(), 1e-12,
                          "the divergence theorem: round-off"))
    for sign in (1.0, -1.0):
        pushed, _, _ = shape._at_rest(scene, now, theta, sign * on[now.mesh.body])
        apart = np.abs(pushed.mesh.points - plain.mesh.points).max() / 25.0
        change = (pushed.pressure - plain.pressure)[now.mesh.body] + sign * 5.0
        checks += [at_most(f"move, {sign:+g}", apart, 1e-9, "J = theta: Newton's tolerance"),
                   at_most(f"P, {sign:+g}", np.abs(change).max(), 1e-8, "Newton's tolerance")]
    return Outcome(tuple(checks))


def _normals(outline: geometry.Outline) -> np.ndarray:
    """(M, 2) outward normals times length of the interface edges, shared between their nodes."""
    edge = np.roll(outline.points, -1, axis=0) - outline.points
    out = np.column_stack([edge[:, 1], -edge[:, 0]]) * outline.interface_edges()[:, None]
    return 0.5 * (out + np.roll(out, 1, axis=0))


FACTORS = (800.0, 400.0, 200.0, 100.0)


@cache
def _moved(factor: float) -> tuple[pore.Pore, pore.Pore, np.ndarray]:
    """A half-disc of 25 um, what a step of uneven growth makes of it in water ``factor`` times as dense at the same
    velocities (0: without fluid forces), and its theta."""
    scene = loaded_scene()
    said = replace(scene, flow=replace(scene.flow, density=factor * scene.flow.density))
    if factor == 0:
        said = replace(scene, growth=replace(scene.growth, fluid_forces="neglected"))
    now = pore.seeded(said)
    theta = now.theta * (1.1 - 0.002 * now.mesh.points[now.mesh.triangles[now.mesh.biomass], 0].mean(axis=1))
    return now, shape.expand(said, now, theta)[0], theta


@case("coupling-traction-fixed-point", kind="property",
      norm="nodes' move by the fluid, over the force's factor and R, against that of the factor below; defect of the "
           "equilibrium under the forces of the flow around its own shape, and around the shape before",
      claim="The move is proportional to the force as the force falls, and shape and flow agree in the end",
      mutants=("forces-of-the-first-round", "forces-pushed", "density-squared"))
def fixed_point() -> Outcome:
    plain = _moved(0.0)[1].mesh.points
    moves = [(_moved(factor)[1].mesh.points - plain) / factor for factor in (*FACTORS, 1.0)]
    size = np.abs(moves[-1]).max()
    apart = [np.abs(move - moves[-1]).max() / size for move in moves[:-1]]
    own, before = _defects(FACTORS[-1])
    return Outcome((at_most("defect with its own flow", own, 1e-8, "nodes at rest to 1e-8 of R"),
                    at_least("defect with the flow before", before, 1e-5, "else no round is needed"),
                    between("downstream tip's move at factor 1, over the upstream one's", _tips(moves[-1]), 0.2, 5.0,
                            "both are pushed downstream"),
                    at_most("largest move at factor 1, over R", size / 25.0, 1e-4, "0.1 Pa on 10 kPa")),
                   (study("move over force", FACTORS, apart, 1, "quadratic remainder of a smooth map: first "
                          "order", ceiling=1e-3),))


def _tips(move: np.ndarray) -> float:
    """Move along x of the downstream contact line over that of the upstream one."""
    now = _moved(0.0)[0]
    x = now.mesh.points[now.mesh.loop, 0]
    ends = now.mesh.loop[[np.argmax(x), np.argmin(x)]]
    return float(move[ends[0], 0] / move[ends[1], 0])


def _defects(factor: float) -> tuple[float, float]:
    """Residual of the equilibrium over the size of its terms under the forces around its own shape, and the last's."""
    scene = loaded_scene()
    said = replace(scene, flow=replace(scene.flow, density=factor * scene.flow.density))
    now, found, theta = _moved(factor)
    nodes, triangles = now.mesh.body, now.mesh.body_triangles
    held = shape.held_at(len(nodes), now.mesh.body_loop, now.wall, now.fixed)
    body = growth.Body(now.origin[nodes], triangles, held)
    stabilising = growth.stabilisation(now.mesh.points[nodes], triangles, np.ones(len(triangles)))
    defects = []
    for around in (found, now):
        forces = traction.forces(said, traction.surroundings(said, now, around), around)
        system = loaded.Loaded(body, stabilising, forces)
        residual, size = system.residual(found.mesh.points[nodes], found.pressure[nodes], theta)
        defects.append(growth._relative(residual[system.free], size[system.free]))
    return tuple(defects)


@case("coupling-traction-remeshed", kind="property",
      norm="sum along x and moment of the forces on an outline's nodes against those on the nodes of a new mesh around "
           "it, and the sum against that on the mesh that followed; relative",
      claim="Where a new mesh must be made for the flow, its forces go to the aggregate's nodes, sum and moment kept",
      mutants=("forces-shared-evenly",))
def remeshed() -> Outcome:
    now, found, _ = _moved(0.0)
    fine, coarse = loaded_scene("numerics.refinement=3"), loaded_scene()
    grid, _ = remeshing.anew(fine, found.outline)
    on = nodal(fine, replace(found, mesh=grid))[0]
    scale = traction.MPA_PER_UM * fine.flow.density * fine.flow.gravity / fine.growth.shear_modulus
    new = _sums(grid.points[grid.loop], scale * on[grid.loop])
    places = found.mesh.points[now.mesh.body]
    both = [traction.forces(scene, traction.surroundings(scene, now, found), found) for scene in (fine, coarse)]
    ours, followed = (_sums(places, forces) for forces in both)
    return Outcome((at_most("new mesh, nodes of the outline", np.abs(ours / new - 1).max(), 1e-9, runs.ROUND_OFF),
                    at_most("new mesh, mesh that followed, x", abs(ours[0] / followed[0] - 1), 0.02,
                            "the drag's own error at this refinement: 0.012"),
                    at_least("nodes, new over old", len(grid.loop) / len(now.mesh.loop), 1.5, "else none was split")))


def _sums(places: np.ndarray, on: np.ndarray) -> np.ndarray:
    """Sum along x, and moment of the forces."""
    return np.array([on[:, 0].sum(), np.sum(places[:, 0] * on[:, 1] - places[:, 1] * on[:, 0])])
