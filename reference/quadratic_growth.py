"""Growth of a half-disc by scikit-fem: quadratic places, linear pressure, on curved triangles of its own.

From the energy (21) with modulus mu, per volume of t = 0 in plane strain (F33 = 1, tr C = F : F + 1), and a term that
is zero where J = theta,

    Psi = mu/2 (J^(-2/3) tr C - 3) + P (J - theta) + kappa/2 (J - theta)^2.

With the cofactor c(F) = dJ/dF, which is linear in a plane F, and p = P + kappa (J - theta), the weak equations for the
place x and the pressure P are

    (s(F) + p c(F), grad v) = 0,   s(F) = mu J^(-2/3) (F - tr C / (3 J) c(F)),   (J - theta, q) = 0,

and Newton's method takes their derivatives along G = grad dx, with j = c(F) : G, by the product rule. The pair needs no
stabilisation. But J = theta holds in the mean only, and where the hoop is compressed, short waves of the rim that break
it in between would lower the energy (Auricchio et al., Comput. Methods Appl. Mech. Engrg. 194, 2005, show such false
instabilities): a kappa of a few moduli, 3 mu theta^(-5/3), takes them away.

The half-disc slides on its flat side with its middle fixed in x; a part of its arc may be held at a wall above, on
which it slides too. At the ends of that part the stress is singular: triangles are refined towards them.
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

#: Newton stops at a step this small against the size of the body, and is given up after that many,
SMALL, MOST = 1e-10, 30
#: or after that many halvings of one.
HALVINGS = 10
#: kappa over mu theta^(-5/3); theta is raised by this factor at a time.
STIFFENING, FACTOR = 3.0, 1.6
#: Newton's steps for a point's local coordinates; a bent edge is nearly straight, so that they converge at once.
INVERSIONS = 6


@dataclass(frozen=True)
class Contact:
    """The arc between the angles ``first`` and ``last`` (rad) is held at y = ``height``."""

    first: float
    last: float
    height: float


@dataclass(frozen=True, eq=False)
class Grown:
    """An equilibrium: the curved mesh of t = 0; place (2, K) of its quadratic nodes; pressure (M,) at its corners."""

    mesh: MeshTri2
    place: np.ndarray
    pressure: np.ndarray

    def at(self, x, y):
        """Place (..., 2) and pressure (...) of the material that was at x, y (...) in the half-disc at t = 0."""
        where = np.array([np.ravel(x), np.ravel(y)])
        cell = self._cells(where)
        local = _local(self.mesh.mapping(), where, cell)
        quadratic, linear = Basis(self.mesh, ElementTriP2()), Basis(self.mesh, ElementTriP1())
        place = np.stack([_value(quadratic, part, local, cell) for part in self.place], axis=-1)
        return place.reshape(*np.shape(x), 2), _value(linear, self.pressure, local, cell).reshape(np.shape(x))

    def _cells(self, where):
        """(n,) triangles that hold points (2, n): those of the straight mesh or, beyond a chord, the one on it."""
        corners, rim = self.mesh.p[:, : self.mesh.t.max() + 1], arc(self.mesh)
        start = np.arctan2(*corners[::-1, self.mesh.facets[:, rim]]).min(axis=0)
        ranked = np.argsort(start)
        chord = np.searchsorted(start[ranked[1:]], np.arctan2(where[1], where[0]))
        inside = Triangulation(*corners, self.mesh.t.T).get_trifinder()(*where)
        return np.where(inside < 0, self.mesh.f2t[0, rim[ranked[chord]]], inside)


def _local(mapping, where, cell):
    """(2, n) local coordinates of points (2, n) in curved triangles, by Newton's method; a point on the arc may lie
    beyond its triangle by what a parabola and a circle differ."""
    local = np.full((2, len(cell), 1), 1 / 3)
    for _ in range(INVERSIONS):
        gap = where[:, :, None] - mapping.F(local, cell)
        local = local + np.einsum("ijkl,jkl->ikl", mapping.invDF(local, cell), gap)
    return local[:, :, 0]


def _value(basis, nodal, local, cell):
    """(n,) a scalar field at local coordinates (2, n) of triangles (n,)."""
    return sum(basis.elem.lbasis(local, k)[0] * nodal[basis.element_dofs[k, cell]] for k in range(basis.Nbfun))


def half_disc(radius, rings, towards=(), times=0):
    """MeshTri2 of ``rings`` rings, 4k edges on the k-th: every multiple of 45 degrees has a node on the arc. Refined
    ``times`` times more at the angles ``towards`` of the arc."""
    tips = radius * np.column_stack([np.cos(towards), np.sin(towards)])
    return curved(refined(_rings(radius, rings), radius, tips, times), radius)


def _rings(radius, rings):
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
    """Equilibrium under the expansion theta(x, y), at most ``top``, since t = 0; returns :class:`Grown`.

    From ``start``, the solution on another mesh, or else from t = 0 with theta raised by FACTOR at most at a time.
    Raises RuntimeError where Newton's method finds no equilibrium.
    """
    basis = Basis(mesh, ElementVector(ElementTriP2()), intorder=5)
    lower, final = basis.with_element(ElementTriP1()), theta(*basis.global_coordinates())
    steps = 1 if start else max(1, int(np.ceil(np.log(top) / np.log(FACTOR))))
    initial = np.zeros(basis.N)
    initial[_numbers(basis)] = mesh.doflocs
    held, target = _held(basis, contact, initial)
    place, pressure = _carried(basis, lower, start) if start else (initial, np.zeros(lower.N))
    for part in np.arange(1, steps + 1) / steps:
        value = initial + part * (target - initial)
        place, pressure = _newton(basis, lower, final**part, mu, held, value, place, pressure)
    return Grown(mesh, place[_numbers(basis)], pressure)


def _numbers(basis):
    """(2, K) numbers of the unknowns x and y of the quadratic nodes, in the order of the mesh's own."""
    return np.hstack([basis.nodal_dofs, basis.facet_dofs])


def _carried(basis, lower, start):
    """A solution on another mesh, at the nodes of this one."""
    place = np.zeros(basis.N)
    place[_numbers(basis)] = start.at(*basis.mesh.doflocs)[0].T
    return place, start.at(*lower.doflocs)[1]


def _held(basis, contact, initial):
    """Numbers of the prescribed unknowns, and the values (n,) that they have in the end."""
    numbers, target = _numbers(basis), initial.copy()
    x, y = initial[numbers]
    held = [numbers[0, (x == 0) & (y == 0)], numbers[1, y == 0]]
    if contact:
        angle, rim = np.arctan2(y, x), np.isclose(np.hypot(x, y), np.hypot(x, y).max(), rtol=1e-9)
        held.append(numbers[1, rim & (angle > contact.first - 1e-9) & (angle < contact.last + 1e-9)])
        target[held[-1]] = contact.height
    return np.concatenate(held), target


def _newton(basis, lower, theta, mu, held, value, place, pressure):
    """(place, pressure) of the equilibrium with what is held at ``value``."""
    for _ in range(MOST):
        lag = np.zeros(basis.N + lower.N)
        lag[held] = (value - place)[held]
        step = newton_step(basis, lower, theta, mu, place, pressure, x=lag, D=held)
        step = step * _length(basis, place, step[: basis.N])
        place, pressure = place + step[: basis.N], pressure + step[basis.N:]
        if np.abs(step[: basis.N]).max() < SMALL * np.ptp(place):
            return place, pressure
    raise RuntimeError(f"Newton's method still steps by {np.abs(step[: basis.N]).max():.2g} after {MOST} iterations")


def newton_step(basis, lower, theta, mu, place, pressure, **held):
    """(N + M,) Newton's step of places and pressures; held: what :func:`skfem.condense` takes out."""
    state = _state(basis, lower, theta, mu, place, pressure)
    K, B = asm(_stiffness, basis, **state), asm(_coupling, basis, lower, **state)
    right = -np.concatenate([asm(_force, basis, **state), asm(_gap, lower, **state)])
    return solve(*condense(bmat([[K, B.T], [B, None]], "csc"), right, **held))


def _length(basis, place, move):
    """The longest of 1, 1/2, ... of a move that keeps J > 0."""
    for length in 0.5 ** np.arange(HALVINGS):
        if det(grad(basis.interpolate(place + length * move))).min() > 0:
            return length
    raise RuntimeError(f"no step of Newton's method keeps J > 0 (shortest tried {length:.2g})")


def _state(basis, lower, theta, mu, place, pressure):
    """What the forms below need at the points of quadrature, by the names of the equations."""
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
