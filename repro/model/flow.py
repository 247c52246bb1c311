"""Flow (2.1, 3.2): steady Stokes flow with a viscosity jump between fluid and biomass.

(1) ``(nu/g) lap u - grad phi = 0`` and (2) ``div u = 0``, with nu = nu_water in the fluid, lambda nu_water in biomass;
(3) parabolic profile at the inlet; (4) ``du/dx = 0`` and mean head zero at the outlet; (5) u = 0 on the walls. In the
weak form, with the velocity scaled to mean 1 um/h and p = phi g / nu_water,

    a(u, v) - (p, div v) = 0                      a(u, v) = (nu_r grad u, grad v)          "laplacian" [E2]
    (q, div u) + sum_tau (tau grad p, grad q) = 0         or (nu_r (grad u + grad u^T), grad v)   "traction"

with nu_r = 1 or lambda, and tau = h_tau^2 / (c nu_r) for linear triangles (none for higher orders, which are stable).
The paper prints no constant c [E13]; ``reference/ERRATA.md`` reports what it does. The second line says that
``w = u - tau grad p`` is divergence-free for every linear q: w is what carries the substrates.

Linear velocities with a bubble b = 27 L1 L2 L3 in each triangle (MINI: Arnold, Brezzi and Fortin 1984) need no
stabilisation. A linear function has a constant gradient, and the integral of grad b is zero: the bubbles' coefficients
beta do not meet the linear part in a(u, v), and the test with b alone is A beta = -(integral of b) grad p, with A the
bubble's 2 x 2 block of a. Put into the second line, this is the same system with tau = (integral of b)^2 / |tau| A^-1,
and w = u - tau grad p is the mean velocity in the triangle, bubble included. With g_i = grad L_i and G = sum g_i g_i^T,
the integral of b is 9/20 |tau|, that of grad b grad b^T is 81/20 |tau| G, and so

    tau = 1 / (20 nu_r) (tr G)^-1                "laplacian"            or  1 / (20 nu_r) (tr G + G)^-1   "traction"
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from skfem import Basis, BilinearForm, ElementTriP1, ElementTriP2

from repro.fem.assembly import each, local, saddle_blocks, saddle_system
from repro.fem.mesh import PoreMesh
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
    """(grad u, grad v)."""
    return u.grad[0] * v.grad[0] + u.grad[1] * v.grad[1]


@BilinearForm
def divergence(u, q, w):
    """(q, u_,i)."""
    return u.grad[w["i"]] * q


@dataclass(frozen=True, eq=False)
class Forms:
    """Element matrices of one geometry, coefficients of the triangles left out: laplace (T, a, a) (grad u, grad v),
    divergence (T, b, 2a) (q, div u), pressure_laplace (T, b, b)."""

    mesh: PoreMesh
    order: int
    laplace: np.ndarray
    divergence: np.ndarray
    pressure_laplace: np.ndarray

    @cached_property
    def basis(self) -> Basis:
        """Of the velocity's components."""
        return _bases(self.mesh, self.order)[0]

    @property
    def places(self) -> np.ndarray:
        """(2, n) um: nodes of the velocity, the mesh's own first."""
        return self.mesh.points.T if self.order == 1 else self.basis.doflocs

    @property
    def cells(self) -> np.ndarray:
        """(T, a) nodes of the velocity on each triangle; those of the pressure are the triangles'."""
        return self.mesh.triangles if self.order == 1 else self.basis.element_dofs.T


def forms(mesh: PoreMesh, order: int = 1) -> Forms:
    """The forms of a mesh, worked out once for the present places of its nodes."""
    return mesh.here(("forms", order), lambda: linear_forms(mesh) if order == 1 else general_forms(mesh, order))


def _bases(mesh: PoreMesh, order: int) -> tuple[Basis, Basis]:
    velocity, pressure = (element() for element in ELEMENTS[order])
    basis = Basis(mesh.fem, velocity, intorder=2 * order - 1)
    return basis, basis.with_element(pressure)


def general_forms(mesh: PoreMesh, order: int) -> Forms:
    """The forms by scikit-fem: their definition."""
    basis, basis_p = _bases(mesh, order)
    b = np.concatenate([local(divergence, basis, basis_p, i=i) for i in (0, 1)], axis=2)
    return Forms(mesh, order, local(gradient_product, basis), b, local(gradient_product, basis_p))


def linear_forms(mesh: PoreMesh) -> Forms:
    """Those of linear triangles in closed form, ten times faster: gradients are constant, means of N_i a third."""
    slopes = mesh.gradients
    laplace = each(mesh.areas, slopes @ np.swapaxes(slopes, 1, 2))
    b = each(mesh.areas / 3, np.swapaxes(slopes, 1, 2).reshape(-1, 1, 6))
    return Forms(mesh, 1, laplace, np.repeat(b, 3, axis=1), laplace)


def poiseuille_loss(length: float, width: float) -> float:
    """Loss (1/um) of plane Poiseuille flow of mean velocity one over a length (um): 12 L / W^2."""
    return 12 * length / width**2


@timed("flow")
def unit_flow(mesh: PoreMesh, viscosity_ratio: float, *, interface: str = "laplacian", stabilisation: float = 100.0,
              order: int = 1, element: str = "stabilised") -> UnitFlow:
    """Stokes flow of mean velocity one through the meshed part, (1)-(5).

    interface: "laplacian" or "traction" [E2]; element: "stabilised" or "bubble", and stabilisation: c of
    tau = h^2 / (c nu_r) (both for order 1 only). Raises linear.LinearError where the system cannot be solved.
    """
    found = forms(mesh, order)
    viscosity = np.where(mesh.biomass, viscosity_ratio, 1.0)
    tau = mesh.circumdiameter**2 / (stabilisation * viscosity) if order == 1 else np.zeros(len(viscosity))
    lower = each(tau, found.pressure_laplace)
    if element == "bubble":
        mobility = bubble_mobility(mesh, viscosity, interface)
        lower = each(mesh.areas, mesh.gradients @ mobility @ np.swapaxes(mesh.gradients, 1, 2))
    elements = saddle_blocks(_viscous(found, viscosity, interface), found.divergence, lower)
    solution = _solve_with_boundaries(elements, mesh, found, interface)
    n = found.places.shape[1]
    velocity, pressure = solution[: 2 * n].reshape(2, n).T, solution[2 * n:]
    slope = np.einsum("tai,ta->ti", mesh.gradients, pressure[mesh.triangles])
    if element == "bubble":
        return UnitFlow(velocity, pressure, np.einsum("tij,tj->ti", mobility, slope), _loss(mesh, pressure))
    return UnitFlow(velocity, pressure, tau[:, None] * slope, _loss(mesh, pressure))


def bubble_mobility(mesh: PoreMesh, viscosity: np.ndarray, interface: str) -> np.ndarray:
    """(T, 2, 2) um2: tau of the condensed bubble, by which grad p drives the mean of the bubble's velocity."""
    G = np.einsum("tai,taj->tij", mesh.gradients, mesh.gradients)
    block = each(np.trace(G, axis1=1, axis2=2), np.eye(2)[None])
    if interface == "traction":
        block = block + G
    return np.linalg.inv(each(20 * viscosity, block))


def _viscous(found: Forms, viscosity: np.ndarray, interface: str) -> np.ndarray:
    """(T, 2a, 2a) element matrices of a(u, v): test functions of x, then y, by trial functions alike; (T, a, a) of each
    component where they are not coupled."""
    laplace = each(viscosity, found.laplace)
    if interface == "laplacian":
        return laplace
    k = np.broadcast_to(viscosity[:, None], found.basis.dx.shape)
    # nu u_j,i v_i,j: row i is the component of v, column j that of u
    xx, xy, yx, yy = (local(stiffness, found.basis, k=k, i=i, j=j) for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)))
    return np.block([[laplace + xx, xy], [yx, laplace + yy]])


def _solve_with_boundaries(elements, mesh: PoreMesh, found: Forms, interface: str) -> np.ndarray:
    """Solve with u = 0 on the walls, the parabola at the inlet, u_y = 0 at the outlet in the traction form [E10]."""
    where = found.places

    def make():
        wall = _on(mesh, where[1], 0.0) | _on(mesh, where[1], mesh.width)
        inlet, outlet = (_on(mesh, where[0], end) for end in mesh.ends)
        held = np.column_stack([wall | inlet, wall | inlet | (outlet if interface == "traction" else False)])
        return saddle_system(found.cells, mesh.triangles, held)

    system = mesh.once(("flow", interface, found.order), make)
    value = np.zeros(len(system.held))
    inlet = np.flatnonzero(_on(mesh, where[0], mesh.ends[0]))
    value[inlet] = inlet_profile(mesh, where[1][inlet])
    return system.solve(elements, np.zeros(len(value)), value)


def _on(mesh: PoreMesh, places: np.ndarray, level: float) -> np.ndarray:
    """Are coordinates on a wall or an end? scikit-fem's places of the unknowns are the mesh's up to round-off."""
    return np.abs(places - level) < 1e-9 * mesh.width


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
    return mean_over(mesh, mesh.inlet, pressure) - mean_over(mesh, mesh.outlet, pressure)


def mean_over(mesh: PoreMesh, nodes: np.ndarray, field: np.ndarray) -> float:
    """Mean of a nodal field over the inlet or the outlet."""
    return float(np.trapezoid(field[nodes], mesh.points[nodes, 1]) / mesh.width)


def scaled(unit: UnitFlow, mesh: PoreMesh, length: float, viscosity: float, *, head: float | None,
           mean_velocity: float | None) -> Flow:
    """The flow driven by a head (um) over the whole pore, or of a mean velocity (um/h): the problem is linear (2.1).

    length: of the pore (um); viscosity: nu_water / g (um h).
    """
    whole = unit.loss + poiseuille_loss(length - (mesh.ends[1] - mesh.ends[0]), mesh.width)
    speed = head / (viscosity * whole) if mean_velocity is None else mean_velocity
    scale = viscosity * speed
    head_field = scale * (unit.pressure - mean_over(mesh, mesh.outlet, unit.pressure))
    return Flow(speed, speed * unit.velocity, head_field, speed * unit.correction, scale * unit.loss, scale * whole,
                length / (viscosity * whole))
