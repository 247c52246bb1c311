"""Linear velocities with a condensed bubble (MINI): the same as without condensing, and what it is worth.

With c = 100 the stabilised element's tau = h^2 / (100 nu) is within 7 % of the bubble's, h^2 / (106.7 nu), for
equilateral triangles: on good meshes both err alike. The bubble has no constant to choose, and on stretched triangles,
where the circumscribed circle says little, it errs far less.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.sparse import bmat
from scipy.sparse.linalg import spsolve
from skfem import Basis, BilinearForm, ElementTriMini, ElementTriP1, ElementVector
from skfem.helpers import ddot, div, grad, transpose

from reference import layered_channel
from repro.fem.mesh import Mesh
from repro.fem.space import Space
from repro.model import flow
from verification import norms
from verification.case import Outcome, at_least, at_most, between, case
from verification.convergence import refine, study
from verification.flow import grids, layers, properties

RATIO = 2000.0
DRAWS = (8, 6, 3, 1)
STABILISED, BUBBLE = flow.Stabilised(), flow.Bubble()


@BilinearForm
def laplacian(u, v, w):
    """(k grad u, grad v)."""
    return w["k"] * ddot(grad(u), grad(v))


@BilinearForm
def symmetric(u, v, w):
    """(k (grad u + grad u^T), grad v)."""
    return w["k"] * ddot(grad(u) + transpose(grad(u)), grad(v))


@BilinearForm
def continuity(u, q, w):
    """(q, div u)."""
    return q * div(u)


def uncondensed(grid: Mesh, ratio: float, form, interface: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Velocity (N, 2) at the nodes, mean velocity (T, 2), bubble included, and pressure (N,) of scikit-fem's MINI
    element, bubbles kept as unknowns, under the conditions (3)-(5)."""
    basis = Basis(grid.fem, ElementVector(ElementTriMini()), intorder=4)
    basis_p = basis.with_element(ElementTriP1())
    k = np.where(grid.biomass, ratio, 1.0)[:, None] * np.ones(basis.dx.shape)
    B = -continuity.assemble(basis, basis_p)
    system = bmat([[form.assemble(basis, k=k), B.T], [B, None]]).tocsc()
    value, held = np.zeros(system.shape[0]), np.zeros(system.shape[0], bool)
    x, y = grid.points.T
    nodes = basis.nodal_dofs
    rim = (y == 0) | (y == grid.width) | (x == grid.ends[0])
    held[nodes[:, rim].ravel()] = True
    held[nodes[1, (x == grid.ends[1]) & (interface == "traction")]] = True
    inlet = grid.topology.inlet
    profile = y[inlet] * (grid.width - y[inlet])
    value[nodes[0, inlet]] = profile * grid.width / np.trapezoid(profile, y[inlet])
    value[~held] = spsolve(system[~held][:, ~held], -(system[~held][:, held] @ value[held]))
    velocity, bubbles = value[nodes].T, value[basis.interior_dofs].T
    mean = velocity[grid.triangles].mean(axis=1) + 9 / 20 * bubbles
    return velocity, mean, value[basis.N:]


@case("flow-bubble", kind="cross-code",
      norm="largest difference over the largest value; largest relative error of the flux through 25 sections",
      claim="The condensed bubble is scikit-fem's MINI element with its bubbles as unknowns, in both forms, and the "
            "mean velocity of each triangle, bubble included, carries the same flux through every section",
      mutants=("bubble-of-water", "bubble-mean-unweighted", "bubble-block-isotropic"))
def condensed() -> Outcome:
    grid = grids.channel(properties.ENDS, 50.0, 6.0, lambda x, y: (np.abs(x) < 20) & (y < 25), across=(-20.0, 20.0),
                         along=(25.0,), seed=5)
    checks = []
    for interface, form in (("laplacian", laplacian), ("traction", symmetric)):
        velocity, mean, pressure = uncondensed(grid, RATIO, form, interface)
        ours = flow.unit_flow(Space(grid, 1), RATIO, interface=interface, element=flow.Bubble())
        carried = ours.velocity[grid.triangles].mean(axis=1) - ours.correction
        why = "the same equations: round-off of a system whose viscosities differ by 2000"
        pairs = {"velocity": (ours.velocity, velocity), "pressure": (ours.pressure, pressure),
                 "mean velocity": (carried, mean)}
        checks += [at_most(f"{name}, {interface}", np.abs(found - other).max() / np.abs(other).max(), 1e-9, why)
                   for name, (found, other) in pairs.items()]
        checks.append(at_most(f"flux of the mean velocity, {interface}", properties.flux_error(grid, carried), 1e-9,
                              "(2) tested with linear ramps, round-off"))
    return Outcome(tuple(checks))


@case("flow-bubble-layers", kind="exact",
      norm="middle of a long layer, lambda = 2000, root mean square over random meshes of a size: L2 of u, of grad u, "
           "and relative error of the pressure gradient; errors of the stabilised element over the bubble's",
      claim="The bubble is of second order in velocity and loss and of first in the gradient; it errs as the "
            "stabilised element with c = 100 does on good triangles, many times less on triangles stretched eightfold",
      mutants=("bubble-of-water", "bubble-tenfold"))
def along_a_layer() -> Outcome:
    errors = refine(_errors, range(len(layers.SIZES)), BUBBLE)
    stabilised = refine(_errors, range(len(layers.SIZES)), STABILISED)
    studies = (study("velocity", layers.SIZES, errors["velocity"], 2, layers.SECOND, ceiling=1e-3),
               study("pressure gradient", layers.SIZES, errors["gradient"], 2, layers.SECOND, ceiling=1.2e-3),
               study("velocity's gradient", layers.SIZES, errors["slope"], 1, "linear elements: first order in H1",
                     ceiling=0.1))
    ratio = stabilised["velocity"] / errors["velocity"]
    stretched = [_stretched(1, draw, element)["velocity"] for element in (STABILISED, BUBBLE) for draw in range(3)]
    why = "tau is the same to 7 % where triangles are equilateral"
    return Outcome((between("stabilised over bubble, least", ratio.min(), 0.9, 1.1, why),
                    between("stabilised over bubble, largest", ratio.max(), 0.9, 1.1, why),
                    at_least("stabilised over bubble, stretched", np.mean(stretched[:3]) / np.mean(stretched[3:]), 10.0,
                             "tau goes as the square of the longest side, the bubble's as that of the shortest: up to "
                             "the square of the stretch, 64")), studies)


def _errors(level: int, element: flow.Stabilised | flow.Bubble) -> dict[str, float]:
    return grids.root_mean_square(lambda draw: _layered(layers._grid(level, draw), element, layers.MIDDLE),
                                  DRAWS[level])


def _layered(grid: Mesh, element: flow.Stabilised | flow.Bubble, half: float) -> dict[str, float]:
    """Relative errors for |x| < half (um)."""
    found = flow.unit_flow(Space(grid, 1), RATIO, element=element)
    middle = np.abs(grid.points[grid.triangles, 0].mean(axis=1)) < half
    gradient = layered_channel.gradient(layers.WIDTH, layers.LAYER, RATIO)
    return {"velocity": norms.l2_error(grid.points, grid.triangles[middle], found.velocity, _exact),
            "gradient": abs(layers.slope(Space(grid, 1), found.pressure, middle) / gradient - 1),
            "slope": _slope_error(grid, found.velocity[:, 0], half)}


def _exact(x, y):
    return np.stack([layered_channel.velocity(y, layers.WIDTH, layers.LAYER, RATIO), 0 * y], axis=-1)


def _slope_error(grid: Mesh, speed: np.ndarray, half: float) -> float:
    """Relative L2 error of grad u_x for |x| < half, exact slopes by differences of the exact velocity."""
    chosen = np.abs(grid.points[grid.triangles, 0].mean(axis=1)) < half
    where, weight, _ = norms.quadrature(grid.points, grid.triangles[chosen])
    ours = np.einsum("tai,ta->ti", grid.gradients[chosen], speed[grid.triangles[chosen]])
    y, step = where[..., 1], 1e-4
    exact = (_exact(0 * y, y + step) - _exact(0 * y, y - step))[..., 0] / (2 * step)
    apart = ours[:, None, 0] ** 2 + (ours[:, None, 1] - exact) ** 2
    return float(np.sqrt(np.sum(weight * apart) / np.sum(weight * exact**2)))


STRETCH = 8.0


@cache
def _long_triangles(level: int, draw: int) -> Mesh:
    """A mesh of a layer whose triangles are STRETCH times longer than high."""
    end = layers.LAYER_END / STRETCH
    rim = end + layers.SIZES[level]
    short = grids.channel((-rim, rim), layers.WIDTH, layers.SIZES[level], lambda x, y: (y < layers.LAYER)
                          & (np.abs(x) < end), across=(-end, end), along=(layers.LAYER,), seed=7 * level + draw)
    return Mesh.of(short.points * [STRETCH, 1.0], short.cells, short.biomass, short.loop, short.width,
                   (-STRETCH * rim, STRETCH * rim))


def _stretched(level: int, draw: int, element: flow.Stabilised | flow.Bubble) -> dict[str, float]:
    return _layered(_long_triangles(level, draw), element, 60.0)
