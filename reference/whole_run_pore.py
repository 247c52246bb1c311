"""Flow and substrates around the aggregate of a whole run: Taylor-Hood elements and quadratic concentrations.

Flow (1)-(5) of mean velocity one, in the Laplacian form [E2], nu = 1 in the fluid and lambda in the aggregate,

    (nu grad u, grad v) - (p, div v) = 0,    (q, div u) = 0

with quadratic velocity, and a linear pressure on each side of the interface, where p jumps. Substrates (7)-(13) are
quasi-steady, with quadratic concentrations; u_x in (11) is the local velocity [E4]:

    (D grad C, grad v) + (u . grad C, v) + <u_x (C - C_supply), v>_inlet + (X_A q, v)_aggregate = 0

div u = 0 holds in the mean only. The difference of supplied and out + consumed is therefore not zero, and measures the
error. q is that of :mod:`reference.monod`. Lengths are in um, times in h, concentrations in mg/L.
"""
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu
from skfem import (
    Basis,
    BilinearForm,
    ElementTriP1,
    ElementTriP2,
    FacetBasis,
    Functional,
    LinearForm,
    asm,
    bmat,
    condense,
    solve,
)
from skfem.helpers import dot, grad

from reference.monod import derivatives, uptake

#: Newton's method converges when the change of C over the supply is this small, and fails after this number of steps.
TOLERANCE, MAX_ITERATIONS = 1e-10, 30
#: Orders of quadrature on triangles and on the ends.
ORDER, END_ORDER = 6, 6


@dataclass(frozen=True, eq=False)
class Flow:
    """Flow of mean velocity one: velocity (2, K) at the quadratic nodes; loss of p over the mesh, 1/um (6)."""

    velocity: np.ndarray
    loss: float


class Section:
    """One geometry: the :class:`~reference.whole_run_grid.Grid` with nodes at ``places`` (2, K) in a channel."""

    def __init__(self, grid, places, width, ends):
        mesh, self.width = grid.mesh(places), width
        self.basis = Basis(mesh, ElementTriP2(), intorder=ORDER)
        self.body, self.fluid = (Basis(mesh, ElementTriP2(), elements=np.flatnonzero(where), intorder=ORDER)
                                 for where in (grid.body, ~grid.body))
        self.spread = [asm(stiffness, basis) for basis in (self.fluid, self.body)]
        (x, y), near = self.basis.doflocs, 1e-9 * width
        facets = mesh.boundary_facets()
        self.ends = [FacetBasis(mesh, ElementTriP2(), intorder=END_ORDER,
                                facets=facets[(np.abs(x[mesh.facets[:, facets]] - end) < near).all(axis=0)])
                     for end in ends]
        self.parabola = 6 * y / width * (1 - y / width)
        self.inlet = x < ends[0] + near
        self.constrained = self.inlet | (y < near) | (y > width - near)

    def flow(self, ratio):
        """:class:`Flow` at a viscosity ratio."""
        viscous, n = self.spread[0] + ratio * self.spread[1], self.basis.N
        blocks = [_divergence(basis) for basis in (self.fluid, self.body)]
        B = sp.vstack([block for block, _ in blocks])
        x = np.concatenate([np.where(self.inlet, self.parabola, 0.0), np.zeros(n + B.shape[0])])
        matrix = bmat([[sp.block_diag([viscous, viscous]), -B.T], [-B, None]], "csc")
        solution = solve(*condense(matrix, np.zeros(len(x)), x=x, D=np.flatnonzero(np.tile(self.constrained, 2))))
        pressure, used = np.zeros(n), blocks[0][1]
        pressure[used] = solution[2 * n: 2 * n + len(used)]
        return Flow(solution[: 2 * n].reshape(2, n), self._loss(pressure))

    def _loss(self, pressure):
        """Mean of p over the inlet minus that over the outlet, both in the fluid (6)."""
        sides = [end.with_element(ElementTriP1()) for end in self.ends]
        inlet, outlet = (asm(_integral, side, value=side.interpolate(pressure[: side.N])) for side in sides)
        return float(inlet - outlet) / self.width

    def operators(self, pore, speed, flow):
        """[(matrix, source)] of the two substrates without uptake, at the mean velocity ``speed`` (um/h)."""
        ux, uy = (self.basis.interpolate(speed * u) for u in flow.velocity)
        inlet = self.ends[0]
        entering = asm(_mass, inlet, value=inlet.interpolate(speed * self.parabola))
        carried, source = asm(_advection, self.basis, ux=ux, uy=uy) + entering, entering @ np.ones(self.basis.N)
        return [(carried + water * self.spread[0] + biomass * self.spread[1], supply * source)
                for water, biomass, supply in zip(pore.diffusivity, pore.in_biomass, pore.supply)]

    def steady(self, operators, active, rates, fields):
        """:func:`steady` in the aggregate, where X_A is ``active`` (t, Q)."""
        return steady(self.body, operators, active, rates, fields)

    def inside(self, fields):
        """(2, t, Q) fields (2, K) at the aggregate's points of quadrature."""
        return _inside(self.body, fields)

    def effluents(self, flow, fields):
        """(2,) flow-weighted means over the outlet, mg/L."""
        end = self.ends[1]
        speed = end.interpolate(flow.velocity[0])
        return np.array([asm(_integral, end, value=speed * end.interpolate(field)) for field in fields]) / self.width


def steady(body, operators, active, rates, fields, free=slice(None)):
    """Steady C_A and C_D (2, K); Newton's method starts from ``fields``.

    operators: [(matrix, source)] of all terms except the uptake; active: X_A (t, Q), or one number, at the quadrature
    points of ``body``; free: the nodes that may change.

    Raises RuntimeError if Newton's method does not converge or a concentration is negative.
    """
    for _ in range(MAX_ITERATIONS):
        step = np.zeros_like(fields)
        step[:, free] = _step(body, operators, active, rates, fields, free)
        fields = fields + step
        if np.abs(step).max() < TOLERANCE * np.abs(fields).max():
            break
    else:
        change = np.abs(step).max()
        raise RuntimeError(f"the substrates still change by {change:.2g} mg/L after {MAX_ITERATIONS} iterations")
    if fields.min() < 0:
        raise RuntimeError(f"a concentration is negative: {fields.min():.2g} mg/L")
    return fields


def _inside(body, fields):
    """(2, t, Q) fields (2, K) at the points of quadrature."""
    return np.array([body.interpolate(field) for field in fields])


def _step(body, operators, active, rates, fields, free):
    """Newton's step (2, free) of both substrates; derivatives of the uptake by central differences."""
    concentrations = _inside(body, fields)
    residual = [(matrix @ field - source + asm(_load, body, value=active * rate))[free]
                for (matrix, source), field, rate in zip(operators, fields, uptake(*concentrations, rates))]
    derivative = active * derivatives(concentrations, rates)

    def block(k, s):
        added = asm(_mass, body, value=derivative[k, s])
        block_matrix = operators[k][0] + added if k == s else added
        return block_matrix.tocsr()[free][:, free]

    matrix = sp.block_array([[block(k, 0), block(k, 1)] for k in (0, 1)], format="csc")
    return -splu(matrix).solve(np.concatenate(residual)).reshape(2, -1)


def _divergence(basis):
    """Matrix of (q, div u) for the linear q in the triangles of a basis, and the numbers of these q."""
    lower = basis.with_element(ElementTriP1())
    used = np.unique(lower.element_dofs)
    return sp.hstack([asm(_slope, basis, lower, axis=axis)[used] for axis in (0, 1)]), used


@BilinearForm
def stiffness(u, v, w):
    """(grad u, grad v)."""
    return dot(grad(u), grad(v))


@BilinearForm
def _slope(u, q, w):
    return grad(u)[w["axis"]] * q


@BilinearForm
def _advection(u, v, w):
    return (w["ux"] * grad(u)[0] + w["uy"] * grad(u)[1]) * v


@BilinearForm
def _mass(u, v, w):
    return w["value"] * u * v


@LinearForm
def _load(v, w):
    return w["value"] * v


@Functional
def _integral(w):
    return w["value"]
