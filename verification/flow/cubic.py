"""Taylor-Hood flow of order 2 and 3 on curved triangles: the manufactured flow, whose viscosity alone jumps.

Its interface is straight; the edges elsewhere are bent by the map (s, t) -> (s, t + BEND s^2), which leaves it so.
The exact velocity is prescribed all around, as in :mod:`verification.flow.boxes`.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from reference import manufactured_flow, poiseuille
from repro.curved import fields, flow
from repro.curved.mesh import curved
from repro.fem.assembly import saddle_system
from verification.case import Outcome, at_most, case
from verification.convergence import Study, refine, study
from verification.flow import grids
from verification.flow.curved import LENGTH, ROUND_OFF, WIDTH, drive, plug

BEND, RATIO = 0.2, 10.0
SIZES, DRAWS = (0.28, 0.14, 0.07, 0.035), (10, 6, 3, 1)
#: Orders of the velocity's and the pressure's error, and their last errors at most.
EXPECTED = {2: (3, 2, 3e-5, 1e-3), 3: (4, 3, 1e-6, 1e-4)}


@case("flow-curved-manufactured", kind="manufactured", slow=True,
      norm="root mean square over random meshes of a size, relative L2 of u and p",
      claim="On bent triangles quadratic velocities are of third order and cubic ones of fourth, their pressures of "
            "second and third, where the viscosity jumps tenfold at a straight interface",
      mutants=("cubic-edge-crossed", "cubic-slope", "cubic-lower-degree", "curved-straight-divergence"))
def manufactured() -> Outcome:
    studies = []
    for order, (u, p, least_u, least_p) in EXPECTED.items():
        errors = refine(_mean, range(len(SIZES)), order)
        studies += [study(f"velocity, order {order}", SIZES, errors["velocity"], u, "one more than the elements",
                          ceiling=least_u),
                    Study(f"pressure, order {order}", np.array(SIZES), errors["pressure"], p - 0.3, p + 1.3,
                          "that of the velocity's gradient; one more while the velocity's error rules", least_p)]
    return Outcome(studies=tuple(studies))


def _mean(level: int, order: int) -> dict[str, float]:
    return grids.root_mean_square(lambda draw: _errors(level, draw, order), DRAWS[level])


def _turned(points: np.ndarray) -> np.ndarray:
    """From (s, t) of the box to (x, y): bent, and turned by ANGLE."""
    s, t = points[:, 0], points[:, 1] - 0.5 + BEND * points[:, 0] ** 2
    c, d = np.cos(manufactured_flow.ANGLE), np.sin(manufactured_flow.ANGLE)
    return np.column_stack([s * c - t * d, s * d + t * c])


@cache
def _box(level: int, draw: int):
    """The box as a straight mesh in (s, t), with the nodes in the middles of edges."""
    size = SIZES[level]
    return curved(grids.channel((-0.6, 0.5), 1.0, size, lambda x, y: x > 0, across=(0.0,),
                                seed=int(1e4 * size) + draw), None)


@cache
def _exact():
    return manufactured_flow.evaluated(RATIO, "laplacian")


def _errors(level: int, draw: int, order: int) -> dict[str, float]:
    box = _box(level, draw)
    straight, here = fields.space(box, order), fields.space(box.moved(_turned(box.points)), order)
    velocity, pressure, force = _exact()
    rim = np.isclose(straight.points[:, None], [[-0.6, 0.0], [0.5, 1.0]], rtol=0, atol=1e-12).any(axis=(1, 2))
    grid, n = here.mesh, here.count
    where = np.swapaxes(here.of.shape @ grid.points[grid.cells], 0, 1)
    x, y = np.moveaxis(where, -1, 0)
    blocks = flow.stokes(here, np.where(grid.biomass, RATIO, 1.0))
    system = saddle_system(here.cells, here.head_cells, np.column_stack([rim, rim]), here.order)
    held = system.held.copy()
    held[2 * n] = True
    right, value = np.zeros(len(held)), np.zeros(len(held))
    value[: 2 * n] = _without_flux(here, blocks, rim, velocity(*here.points.T)).T.ravel()
    loads = np.einsum("tq,qti,qa->tia", here.at.dx, force(x, y), here.of.values)
    for k in range(2):
        np.add.at(right, k * n + here.cells, loads[:, k])
    found = system.holding(held).solve(blocks, right, value)
    u = here.of.values @ found[: 2 * n].reshape(2, n).T[here.cells]
    p = found[2 * n:][here.head_cells] @ here.of.head.T
    weight, truth, level_p = here.at.dx, np.swapaxes(velocity(x, y), 0, 1), pressure(x, y).T

    def norm(values):
        return np.sqrt(np.sum(weight * values**2))

    def centred(values):
        return values - np.sum(weight * values) / weight.sum()

    return {"velocity": norm(np.hypot(*np.moveaxis(u - truth, -1, 0))) / norm(np.hypot(*np.moveaxis(truth, -1, 0))),
            "pressure": norm(centred(p - level_p)) / norm(centred(level_p))}


def _without_flux(here, blocks, rim, velocity) -> np.ndarray:
    """The rim's velocity (n, 2) less the part c (x, y) of what the interpolated values would pump in."""
    k = here.cells.shape[1]

    def flux(field):
        return np.einsum("tbi,ti->", blocks[:, 2 * k:, : 2 * k],
                         np.concatenate([field[here.cells, 0], field[here.cells, 1]], axis=1))

    values, outwards = (np.where(rim[:, None], part, 0.0) for part in (velocity, here.points))
    outwards[here.cells[here.mesh.biomass]] = 0.0
    return values - flux(values) / flux(outwards) * outwards


@case("flow-cubic-poiseuille", kind="exact",
      norm="largest difference over the largest velocity; relative difference of losses",
      claim="Cubic velocities too have the parabola at every node, and the loss (6) as the work of the inlet, through "
            "a plug of 2000 times the viscosity",
      mutants=("cubic-edge-crossed", "curved-loss-per-width", "curved-inlet-parabola"))
def channel() -> Outcome:
    grid, given = plug(), drive(2000.0)
    here, found = fields.space(grid, 3), flow.solve(grid, given, LENGTH, 3)
    u = poiseuille.velocity(here.points[:, 1], WIDTH, given.mean_velocity)
    nu = given.kinematic_viscosity / given.gravity
    lost = sum(poiseuille.head_loss(a, WIDTH, given.mean_velocity, nu) for a in (LENGTH - 40, 40 * 2000.0))
    apart = np.abs(found.velocity - np.column_stack([u, 0 * u])).max() / u.max()
    return Outcome((at_most("velocity", apart, 1e-10, ROUND_OFF),
                    at_most("loss of the whole pore", abs(found.head_loss / lost - 1), 1e-10, ROUND_OFF)))
