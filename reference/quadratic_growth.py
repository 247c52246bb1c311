"""Growth of a half-disc by scikit-fem: quadratic positions and linear pressure on independent curved triangles.

The energy per volume at t = 0 is (21) with modulus mu in plane strain (F33 = 1, tr C = F : F + 1), plus a term that
is zero where J = theta,

    Psi = mu/2 (J^(-2/3) tr C - 3) + P (J - theta) + kappa/2 (J - theta)^2.

With the cofactor c(F) = dJ/dF, which is linear in a plane F, and p = P + kappa (J - theta), the weak equations for the
position x and the pressure P are

    (s(F) + p c(F), grad v) = 0,   s(F) = mu J^(-2/3) (F - tr C / (3 J) c(F)),   (J - theta, q) = 0,

and Newton's method uses their derivatives along G = grad dx, with j = c(F) : G, by the product rule. The pair needs no
stabilisation. However, J = theta holds in the mean only. Where the hoop is compressed, short waves of the rim violate
it between the nodes and would lower the energy (Auricchio et al., Comput. Methods Appl. Mech. Engrg. 194, 2005, show
these spurious instabilities). A kappa of a few moduli, 3 mu theta^(-5/3), removes them.

The half-disc slides on its flat side, and its midpoint is fixed in x. A part of its arc may slide on a wall above. The
stress is singular at the ends of that part; triangles are refined towards them.
"""
from dataclasses import dataclass

import numpy as np
from matplotlib.tri import Triangulation
from scipy.spatial import Delaunay
from skfem import (
    Basis,
    BilinearForm,
    ElementTriP1,
    ElementTriP2,
    ElementVector,
    LinearForm,
    MeshTri,
    MeshTri2,
    asm,
    bmat,
    condense,
    solve,
)
from skfem.helpers import ddot, det, grad

from reference.arcs import arc, curved, refined

#: Newton's method converges when its step relative to the body is this small. It fails after this number of steps.
TOLERANCE, MAX_ITERATIONS = 1e-10, 30
#: It also fails after this number of halvings of one step.
HALVINGS = 10
#: kappa over mu theta^(-5/3), and the factor of theta in one increment.
STIFFENING, FACTOR = 3.0, 1.6
#: Newton steps for a point's local coordinates. Curved edges are nearly straight, so that they converge at once.
INVERSIONS = 6


@dataclass(frozen=True)
class Contact:
    """The arc between the angles ``first`` and ``last`` (rad) lies at y = ``height``."""

    first: float
    last: float
    height: float


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """An equilibrium: the curved mesh at t = 0, the place (2, K) of its quadratic nodes, and the pressure (M,) at its
    corners."""

    mesh: MeshTri2
    place: np.ndarray
    pressure: np.ndarray

    def at(self, x, y):
        """Position (..., 2) and pressure (...) of the material at x, y (...) in the half-disc at t = 0."""
        points = np.array([np.ravel(x), np.ravel(y)])
        cell = self._containing_cells(points)
        local = _local_coordinates(self.mesh.mapping(), points, cell)
        quadratic, linear = Basis(self.mesh, ElementTriP2()), Basis(self.mesh, ElementTriP1())
        place = np.stack([_value(quadratic, part, local, cell) for part in self.place], axis=-1)
        return place.reshape(*np.shape(x), 2), _value(linear, self.pressure, local, cell).reshape(np.shape(x))

    def _containing_cells(self, points):
        """(n,) triangles that contain points (2, n): those of the straight mesh or, beyond a chord, its triangle."""
        corners, rim = self.mesh.p[:, : self.mesh.t.max() + 1], arc(self.mesh)
        start = np.arctan2(*corners[::-1, self.mesh.facets[:, rim]]).min(axis=0)
        ranked = np.argsort(start)
        chord = np.searchsorted(start[ranked[1:]], np.arctan2(points[1], points[0]))
        inside = Triangulation(*corners, self.mesh.t.T).get_trifinder()(*points)
        return np.where(inside < 0, self.mesh.f2t[0, rim[ranked[chord]]], inside)


def _local_coordinates(mapping, points, cell):
    """Local coordinates (2, n) of points (2, n) in curved triangles, by Newton's method. A point on the arc may lie
    outside its triangle by the distance between the parabola and the circle."""
    local = np.full((2, len(cell), 1), 1 / 3)
    for _ in range(INVERSIONS):
        gap = points[:, :, None] - mapping.F(local, cell)
        local = local + np.einsum("ijkl,jkl->ikl", mapping.invDF(local, cell), gap)
    return local[:, :, 0]


def _value(basis, nodal, local, cell):
    """(n,) a scalar field at local coordinates (2, n) of triangles (n,)."""
    return sum(basis.elem.lbasis(local, k)[0] * nodal[basis.element_dofs[k, cell]] for k in range(basis.Nbfun))


def half_disc(radius, rings, towards=(), times=0):
    """MeshTri2 of ``rings`` rings with 4k edges on the k-th; the arc has a node at every multiple of 45 degrees. The
    mesh is refined ``times`` times at the angles ``towards`` of the arc."""
    tips = radius * np.column_stack([np.cos(towards), np.sin(towards)])
    return curved(refined(in_rings(radius, rings), radius, tips, times), radius)


def in_rings(radius, rings):
    """Straight triangles between the rings."""
    parts = [(k / rings, i / (4 * k)) for k in range(1, rings + 1) for i in range(4 * k + 1)]
    r, turn = np.array([(0.0, 0.0), *parts]).T
    height = np.where(turn % 1 == 0, 0.0, np.sin(np.pi * turn))
    points = radius * r * np.array([np.cos(np.pi * turn), height])
    triangles = Delaunay(points.T).simplices.T
    a, b, c = points[:, triangles].swapaxes(0, 1)
    area = np.abs((b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0])
    return MeshTri(points, triangles[:, area > 1e-9 * (radius / rings) ** 2].copy())


def grow(mesh, theta, top, mu=1.0, contact=None, start=None):
    """Compute the :class:`Equilibrium` under the expansion theta(x, y), at most ``top``, since t = 0.

    Newton's method starts from ``start``, the solution on another mesh. Without it, it starts from t = 0 and raises
    theta by a factor of at most FACTOR at a time. Raises RuntimeError if it does not converge.
    """
    basis = Basis(mesh, ElementVector(ElementTriP2()), intorder=5)
    lower, final = basis.with_element(ElementTriP1()), theta(*basis.global_coordinates())
    steps = 1 if start else max(1, int(np.ceil(np.log(top) / np.log(FACTOR))))
    initial = np.zeros(basis.N)
    initial[_unknowns(basis)] = mesh.doflocs
    constrained, target = _constraints(basis, contact, initial)
    place, pressure = _interpolate(basis, lower, start) if start else (initial, np.zeros(lower.N))
    for part in np.arange(1, steps + 1) / steps:
        value = initial + part * (target - initial)
        place, pressure = _newton(basis, lower, final**part, mu, constrained, value, place, pressure)
    return Equilibrium(mesh, place[_unknowns(basis)], pressure)


def _unknowns(basis):
    """Numbers (2, K) of the unknowns x and y of the quadratic nodes, in the order of the mesh."""
    return np.hstack([basis.nodal_dofs, basis.facet_dofs])


def _interpolate(basis, lower, start):
    """Interpolate a solution on another mesh to the nodes of this one. If both meshes differ only in the positions of
    their nodes, copy the nodal values."""
    place = np.zeros(basis.N)
    if np.array_equal(basis.mesh.t, start.mesh.t):
        place[_unknowns(basis)] = start.place
        return place, start.pressure
    place[_unknowns(basis)] = start.at(*basis.mesh.doflocs)[0].T
    return place, start.at(*lower.doflocs)[1]


def _constraints(basis, contact, initial):
    """Numbers of the prescribed unknowns, and their final values (n,)."""
    numbers, target = _unknowns(basis), initial.copy()
    x, y = initial[numbers]
    constrained = [numbers[0, (x == 0) & (y == 0)], numbers[1, y == 0]]
    if contact:
        angle, rim = np.arctan2(y, x), np.isclose(np.hypot(x, y), np.hypot(x, y).max(), rtol=1e-9)
        constrained.append(numbers[1, rim & (angle > contact.first - 1e-9) & (angle < contact.last + 1e-9)])
        target[constrained[-1]] = contact.height
    return np.concatenate(constrained), target


def _newton(basis, lower, theta, mu, constrained, target, place, pressure):
    """(place, pressure) of the equilibrium in which the constrained unknowns have the values ``value``."""
    for _ in range(MAX_ITERATIONS):
        prescribed = np.zeros(basis.N + lower.N)
        prescribed[constrained] = (target - place)[constrained]
        step = newton_step(basis, lower, theta, mu, place, pressure, x=prescribed, D=constrained)
        step = step * _step_length(basis, place, step[: basis.N])
        place, pressure = place + step[: basis.N], pressure + step[basis.N:]
        if np.abs(step[: basis.N]).max() < TOLERANCE * np.ptp(place):
            return place, pressure
    change = np.abs(step[: basis.N]).max()
    raise RuntimeError(f"Newton's method has not converged after {MAX_ITERATIONS} iterations: last step {change:.2g}")


def newton_step(basis, lower, theta, mu, place, pressure, **condensed):
    """Newton step (N + M,) of positions and pressures; condensed: arguments of :func:`skfem.condense`."""
    state = _state(basis, lower, theta, mu, place, pressure)
    K, B = asm(_stiffness, basis, **state), asm(_coupling, basis, lower, **state)
    right = -np.concatenate([asm(_force, basis, **state), asm(_gap, lower, **state)])
    return solve(*condense(bmat([[K, B.T], [B, None]], "csc"), right, **condensed))


def _step_length(basis, place, move):
    """The largest fraction 1, 1/2, ... of a step for which J stays positive."""
    for length in 0.5 ** np.arange(HALVINGS):
        if det(grad(basis.interpolate(place + length * move))).min() > 0:
            return length
    raise RuntimeError(f"no step of Newton's method keeps J > 0 (shortest tried {length:.2g})")


def _state(basis, lower, theta, mu, place, pressure):
    """Fields of the forms below at the quadrature points, named as in the equations."""
    F = grad(basis.interpolate(place))
    J, kappa = det(F), STIFFENING * mu * theta ** (-5 / 3)
    return {"F": F, "c": _cofactor(F), "J": J, "trace": ddot(F, F) + 1, "A": mu * J ** (-2 / 3), "kappa": kappa,
            "p": lower.interpolate(pressure) + kappa * (J - theta), "gap": J - theta}


def _cofactor(F):
    """dJ/dF of plane F."""
    return np.array([[F[1, 1], -F[1, 0]], [-F[0, 1], F[0, 0]]])


@LinearForm
def _force(v, w):
    return ddot(w["A"] * (w["F"] - w["trace"] / (3 * w["J"]) * w["c"]) + w["p"] * w["c"], grad(v))


@BilinearForm
def _stiffness(u, v, w):
    G = grad(u)
    J = w["J"]
    third = w["trace"] / (3 * J)
    j, turned = ddot(w["c"], G), _cofactor(G)
    ds = G - 2 / 3 * j / J * w["F"] + (5 / 3 * j / J * third - 2 / 3 * ddot(w["F"], G) / J) * w["c"] - third * turned
    return ddot(w["A"] * ds + w["p"] * turned + w["kappa"] * j * w["c"], grad(v))


@BilinearForm
def _coupling(u, q, w):
    return ddot(w["c"], grad(u)) * q


@LinearForm
def _gap(q, w):
    return w["gap"] * q
