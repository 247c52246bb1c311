"""Flow (2.1, 3.2): steady Stokes flow with a viscosity jump between fluid and biomass.

(1) ``(nu/g) lap u - grad phi = 0`` and (2) ``div u = 0``, with nu = nu_water in the fluid, lambda nu_water in the biomass;
(3) parabolic profile at the inlet; (4) ``du/dx = 0`` and mean head zero at the outlet; (5) u = 0 on the walls. In the
weak form, with the velocity scaled to mean 1 um/h and p = phi g / nu_water,

    a(u, v) - (p, div v) = 0                      a(u, v) = (nu_r grad u, grad v)          "laplacian" [E2]
    (q, div u) + sum_tau (tau grad p, grad q) = 0         or (nu_r (grad u + grad u^T), grad v)   "traction"

with nu_r = 1 or lambda, and tau = h_tau^2 / (c nu_r) for linear triangles (none for higher orders, which are stable).
The paper prints no constant c [E13]; ``reference/ERRATA.md`` reports what it does. The second line says that
``w = u - tau grad p`` is divergence-free for every linear q: w is what carries the substrates.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from skfem import Basis, BilinearForm, ElementTriP1, ElementTriP2

from repro import linear
from repro.mesh import PoreMesh
from repro.timing import timed

#: Elements of velocity and pressure for each order.
ELEMENTS = {1: (ElementTriP1, ElementTriP1), 2: (ElementTriP2, ElementTriP1)}


@dataclass(frozen=True, eq=False)
class Flow:
    """Flow with the given mean velocity.

    mean_velocity: um/h; velocity: (N, 2) um/h at the nodes of the velocity space (the mesh's own first);
    head: (N,) um at the mesh's nodes; correction: (T, 2) um/h, tau grad p, so that w = u - correction;
    meshed_loss, head_loss: um, over the meshed part and the whole pore; conductivity: um/h.
    """

    mean_velocity: float
    velocity: np.ndarray
    head: np.ndarray
    correction: np.ndarray
    meshed_loss: float
    head_loss: float
    conductivity: float


@dataclass(frozen=True, eq=False)
class UnitFlow:
    """Flow of mean velocity one: velocity (n, 2) and correction (T, 2) without unit, pressure (N,) in 1/um, and its
    loss over the meshed part, 1/um (times nu_water / g and the mean velocity: the head loss (6))."""

    velocity: np.ndarray
    pressure: np.ndarray
    correction: np.ndarray
    loss: float


@BilinearForm
def stiffness(u, v, w):
    """(k u_,i, v_,j), with i and j given by the axes."""
    return w["k"] * u.grad[w["i"]] * v.grad[w["j"]]


@BilinearForm
def gradient_product(u, v, w):
    """(k grad u, grad v)."""
    return w["k"] * (u.grad[0] * v.grad[0] + u.grad[1] * v.grad[1])


@BilinearForm
def divergence(u, q, w):
    """(q, u_,i)."""
    return u.grad[w["i"]] * q


def poiseuille_loss(length: float, width: float) -> float:
    """Loss (1/um) of plane Poiseuille flow of mean velocity one over a length (um): 12 L / W^2."""
    return 12 * length / width**2


@timed("flow")
def unit_flow(mesh: PoreMesh, viscosity_ratio: float, *, interface: str = "laplacian", stabilisation: float = 100.0,
              order: int = 1) -> UnitFlow:
    """Stokes flow of mean velocity one through the meshed part, (1)-(5).

    interface: "laplacian" or "traction" [E2]; stabilisation: c of tau = h^2 / (c nu_r) (order 1 only).
    Raises linear.LinearError where the system cannot be solved.
    """
    velocity_element, pressure_element = (element() for element in ELEMENTS[order])
    basis = Basis(mesh.fem, velocity_element, intorder=2 * order)
    basis_p = basis.with_element(pressure_element)
    viscosity = np.where(mesh.biomass, viscosity_ratio, 1.0)
    tau = mesh.circumdiameter**2 / (stabilisation * viscosity) if order == 1 else np.zeros(len(viscosity))
    k = np.broadcast_to(viscosity[:, None], basis.dx.shape)
    blocks = _viscous_blocks(basis, k, interface)
    b_x, b_y = (divergence.assemble(basis, basis_p, i=i) for i in (0, 1))
    c = gradient_product.assemble(basis_p, k=np.broadcast_to(tau[:, None], basis.dx.shape))
    system = sp.bmat([[blocks[0][0], blocks[0][1], -b_x.T], [blocks[1][0], blocks[1][1], -b_y.T], [-b_x, -b_y, -c]])
    solution = _solve_with_boundaries(system.tocsr(), mesh, basis, interface)
    n = basis.N
    velocity, pressure = solution[: 2 * n].reshape(2, n).T, solution[2 * n:]
    slope = np.einsum("tai,ta->ti", mesh.gradients, pressure[mesh.triangles])
    return UnitFlow(velocity, pressure, tau[:, None] * slope, _loss(mesh, pressure))


def _viscous_blocks(basis, k, interface: str):
    """2 x 2 blocks of a(u, v): [component of v][component of u]."""
    laplace = gradient_product.assemble(basis, k=k)
    if interface == "laplacian":
        return [[laplace, None], [None, laplace]]
    mixed = [[stiffness.assemble(basis, k=k, i=row, j=column) for column in (0, 1)] for row in (0, 1)]
    return [[laplace + mixed[0][0], mixed[0][1]], [mixed[1][0], laplace + mixed[1][1]]]


def _solve_with_boundaries(system, mesh: PoreMesh, basis, interface: str) -> np.ndarray:
    """Solve with u = 0 on the walls, the parabola at the inlet, and u_y = 0 at the outlet in the traction form [E10]."""
    where = basis.doflocs
    wall = (where[1] == 0) | (where[1] == mesh.width)
    inlet, outlet = where[0] == mesh.ends[0], where[0] == mesh.ends[1]
    vertical = wall | inlet | (outlet if interface == "traction" else False)
    held = np.concatenate([wall | inlet, vertical, np.zeros(len(mesh.points), bool)])
    value = np.zeros(system.shape[0])
    value[: basis.N][inlet] = inlet_profile(mesh, where[1][inlet])
    free = np.flatnonzero(~held)
    order = _elimination_order(mesh, basis, free, system.shape[0])
    value[free] = linear.solve(system[free][:, free], -(system[free] @ value), order)
    return value


def _elimination_order(mesh: PoreMesh, basis, free: np.ndarray, count: int) -> np.ndarray:
    """Free unknowns sorted by the place of their node in the mesh's elimination order."""
    place = np.empty(basis.N, int)
    place[linear.node_order(basis.N, basis.element_dofs.T)] = np.arange(basis.N)
    rank = np.concatenate([place, place, place[: len(mesh.points)] + 0.5])
    return np.argsort(rank[free], kind="stable")


def inlet_profile(mesh: PoreMesh, heights: np.ndarray) -> np.ndarray:
    """u_x at velocity nodes of the inlet (3): the parabola, scaled so that the discrete flux is exactly u_ave W.

    Between the nodes of linear triangles the parabola is cut by its chords, which lose 1 / n^2 of the flux; a quadratic
    element holds it exactly.
    """
    profile = 6 * (heights / mesh.width) * (1 - heights / mesh.width)
    at = np.argsort(heights)
    if len(heights) > len(mesh.inlet):
        return profile
    return profile * mesh.width / np.trapezoid(profile[at], heights[at])


def _loss(mesh: PoreMesh, pressure: np.ndarray) -> float:
    """Mean pressure at the inlet less the mean at the outlet (6)."""
    ends = [np.trapezoid(pressure[nodes], mesh.points[nodes, 1]) / mesh.width for nodes in (mesh.inlet, mesh.outlet)]
    return float(ends[0] - ends[1])


def scaled(unit: UnitFlow, mesh: PoreMesh, length: float, viscosity: float, *, head: float | None,
           mean_velocity: float | None) -> Flow:
    """The flow driven by a head (um) over the whole pore, or of a mean velocity (um/h): the problem is linear (2.1).

    length: of the pore (um); viscosity: nu_water / g (um h).
    """
    whole = unit.loss + poiseuille_loss(length - (mesh.ends[1] - mesh.ends[0]), mesh.width)
    speed = head / (viscosity * whole) if mean_velocity is None else mean_velocity
    scale = viscosity * speed
    head_field = scale * (unit.pressure - np.trapezoid(unit.pressure[mesh.outlet], mesh.points[mesh.outlet, 1]) / mesh.width)
    return Flow(speed, speed * unit.velocity, head_field, speed * unit.correction, scale * unit.loss, scale * whole,
                length / (viscosity * whole))
