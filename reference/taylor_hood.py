"""Stokes flow with a viscosity jump by scikit-fem: Taylor-Hood elements on independent meshes of curved triangles.

    (nu grad u, grad v) - (p, div v) = 0,   (q, div u) = 0         "laplacian" [E2]
    (2 nu e(u), e(v)) - (p, div v) = 0,     e = sym grad           "traction", with u_y = 0 at the outlet [E10]

nu is 1 in the fluid and lambda in the biomass. u is the parabola of mean one at the inlet and 0 on the walls. Quadratic
velocity and linear pressure need no stabilisation. The pressure may jump at the interface, as the exact one does. A
continuous pressure gives the head loss an error of first order (6e-4 for a half-disc, lambda = 10, 600 triangles).
Meshes are rings around a half-disc with curved edges on its arc. They are refined towards the two corners where fluid,
biomass and wall meet, and once more in the film between a thick half-disc and the upper wall.
"""
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.spatial import Delaunay
from skfem import (
    Basis,
    BilinearForm,
    ElementTriP1,
    ElementTriP2,
    ElementVector,
    FacetBasis,
    Functional,
    MeshTri,
    MeshTri2,
    asm,
    bmat,
    condense,
    solve,
)
from skfem.helpers import ddot, div, grad, sym_grad

from reference.arcs import curved, inside, refined, rounded

#: Largest thickness over the width for which the rings fit; the mesh of a thicker aggregate is stretched.
THICKEST = 0.8


@dataclass(frozen=True, eq=False)
class Channel:
    """A curved mesh of ends x [0, width]; biomass (T,) is True in the aggregate."""

    mesh: MeshTri2
    biomass: np.ndarray
    width: float
    ends: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Stokes:
    """Solution for a mean velocity of one: loss of p over the mesh."""

    loss: float


def half_disc(width, ends, radius, refinements, corner=6):
    """A half-disc of ``radius`` on the lower wall, around x = 0; its coarsest mesh refined ``refinements`` times, and
    ``corner`` times more near (+-radius, 0)."""
    sketched = min(radius, THICKEST * width)
    points = np.unique(np.round(np.vstack([_rings(width, sketched), _box(width, ends, sketched)]), 9), axis=0)
    mesh = MeshTri(points.T.copy(), Delaunay(points).simplices.T.copy())
    if radius > sketched:
        mesh = MeshTri(_stretched(points, width, ends, sketched, radius).T.copy(), mesh.t)
        mesh = rounded(mesh.refined(_film(mesh, radius)), radius)
    for _ in range(refinements):
        mesh = rounded(mesh.refined(), radius)
    mesh = refined(mesh, radius, [(-radius, 0.0), (radius, 0.0)], corner)
    return Channel(curved(mesh, radius), inside(mesh, radius), width, ends)


def _rings(width, radius):
    """Rings around the origin; rings larger than the aggregate stay off the upper wall."""
    radii = radius * np.array([0.4, 0.7, 1.0, 1.35, 1.8, 2.5, 3.5, 5.0, 7.0])
    angle = np.linspace(0.0, np.pi, 11)
    rings = [r * np.column_stack([np.cos(angle), np.sin(angle)]) for r in radii if r < 0.8 * width or r == radius]
    points = np.vstack([[[0.0, 0.0]], *rings])
    return points[points[:, 1] < width - 0.15 * radius]


def _box(width, ends, radius):
    """Nodes of the channel outside the rings, and on its walls."""
    reach = radius * max(r for r in (1.0, 1.35, 1.8, 2.5, 3.5, 5.0, 7.0) if r == 1 or r * radius < 0.8 * width)
    step = width / 6
    x, y = np.meshgrid(np.linspace(*ends, round((ends[1] - ends[0]) / step) + 1), np.linspace(0.0, width, 7))
    points = np.column_stack([x.ravel(), y.ravel()])
    return points[(np.hypot(*points.T) > reach + 0.5 * step) | (points[:, 1] == width)]


def _stretched(points, width, ends, first, radius):
    """Move points along rays from the origin: the arc from radius ``first`` to ``radius``; the rim stays in place."""
    (x, y), tiny = points.T, 1e-9 * width
    r = np.maximum(np.hypot(x, y), tiny)
    side = np.where(x > 0, ends[1], -ends[0])
    rim = r * np.minimum(width / np.maximum(y, tiny), side / np.maximum(np.abs(x), tiny))
    beyond = radius + (r - first) * (rim - radius) / (rim - first)
    return points * (np.where(r > first, beyond, r * radius / first) / r)[:, None]


def _film(mesh, radius):
    """Triangles between the upper part of the half-disc and the wall, and a layer within the half-disc."""
    x, y = mesh.p[:, mesh.t].mean(axis=1)
    return np.flatnonzero((np.abs(x) < 0.75 * radius) & (np.hypot(x, y) > 0.8 * radius))


def stokes(channel, ratio, interface="laplacian"):
    """Solve for the flow, :class:`Stokes`. Each region has its own pressure, which jumps at the interface."""
    basis = Basis(channel.mesh, ElementVector(ElementTriP2()), intorder=5)
    regions = [_region(channel, triangles) for triangles in (channel.biomass, ~channel.biomass) if triangles.any()]
    viscosity = np.where(channel.biomass, float(ratio), 1.0)[:, None] * np.ones(basis.dx.shape[1])
    A = asm(viscous(interface), basis, nu=viscosity)
    B = sp.vstack([asm(divergence, velocity, lower)[used] for velocity, lower, used in regions])
    value, constrained = _boundary(basis, channel, interface)
    x = np.concatenate([value, np.zeros(B.shape[0])])
    solution = solve(*condense(bmat([[A, -B.T], [-B, None]], "csr"), np.zeros(len(x)), x=x, D=constrained))
    parts = np.split(solution[basis.N:], np.cumsum([len(used) for *_, used in regions])[:-1])
    return Stokes(sum(_loss(channel, lower, used, part) for (_, lower, used), part in zip(regions, parts)))


def _loss(channel, lower, used, values):
    """Contribution of a region to the mean pressure at the inlet minus that at the outlet."""
    pressure = np.zeros(lower.N)
    pressure[used] = values
    return _end_mean(channel, pressure, lower, 0) - _end_mean(channel, pressure, lower, 1)


def _region(channel, triangles):
    """Velocity and pressure bases over some triangles, and the unknowns of the pressure."""
    velocity = Basis(channel.mesh, ElementVector(ElementTriP2()), elements=np.flatnonzero(triangles), intorder=5)
    lower = velocity.with_element(ElementTriP1())
    return velocity, lower, np.unique(lower.element_dofs)


def _component(basis):
    """0 for x, 1 for y, of each unknown of a vector field."""
    component = np.zeros(basis.N, int)
    component[np.concatenate([basis.nodal_dofs[1], basis.facet_dofs[1]])] = 1
    return component


def viscous(interface):
    """The bilinear form a(u, v) above, of a viscosity ``nu``."""
    if interface == "laplacian":
        return BilinearForm(lambda u, v, w: w["nu"] * ddot(grad(u), grad(v)))
    return BilinearForm(lambda u, v, w: 2 * w["nu"] * ddot(sym_grad(u), sym_grad(v)))


@BilinearForm
def divergence(u, q, w):
    """(q, div u)."""
    return div(u) * q


def _boundary(basis, channel, interface):
    """Prescribed values, and the numbers of the prescribed unknowns."""
    (x, y), component = basis.doflocs, _component(basis)
    near = 1e-9 * channel.width
    wall = (y < near) | (y > channel.width - near)
    inlet, outlet = x < channel.ends[0] + near, x > channel.ends[1] - near
    value = np.where(inlet & (component == 0), 6 * y / channel.width * (1 - y / channel.width), 0.0)
    constrained = wall | inlet | (outlet & (component == 1) if interface == "traction" else False)
    return value, np.flatnonzero(constrained)


def _end_mean(channel, pressure, lower, end):
    """Mean of a region's pressure over the inlet (0) or the outlet (1); zero if the region does not touch it."""
    at_end = np.abs(channel.mesh.p[0] - channel.ends[end]) < 1e-9 * channel.width
    facets = channel.mesh.boundary_facets()
    facets = facets[at_end[channel.mesh.facets[:, facets]].all(axis=0)]
    facets = facets[np.isin(channel.mesh.f2t[0, facets], lower.tind)]
    if len(facets) == 0:
        return 0.0
    side = FacetBasis(channel.mesh, ElementTriP1(), facets=facets, intorder=3)
    return float(asm(Functional(lambda w: w["p"]), side, p=side.interpolate(pressure))) / channel.width
