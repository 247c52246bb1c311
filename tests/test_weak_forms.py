"""Every assembled system against scikit-fem's own assembly of the same weak form: for each order of the elements, on
straight and on curved triangles, to 1e-12 of the largest entry."""
from functools import cached_property

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree
from skfem import (
    Basis,
    BilinearForm,
    ElementTriP1,
    ElementTriP2,
    ElementTriP3,
    ElementVector,
    FacetBasis,
    LinearForm,
    MeshTri,
    MeshTri2,
)
from skfem.helpers import ddot, div, dot, grad, transpose

from repro.fem import elements
from repro.fem.assembly import ElementSystem
from repro.fem.mesh import Mesh
from repro.fem.space import Space
from repro.model import flow, growth, pore, transport
from repro.model.kinetics import Sink
from repro.scene import load_scene
from tests import oracles
from tests.strategies import ORDERS, bent_inside, constants, meshed, meshes, seed
from verification.problems import aggregates

TOLERANCE = 1e-12
THEIRS = {1: ElementTriP1(), 2: ElementTriP2(), 3: ElementTriP3()}
INTERFACES = ("laplacian", "traction")
#: Viscosity of the biomass over that of water.
RATIO = 7.0
SCENE = load_scene("base")
orders = pytest.mark.parametrize("order", ORDERS)
shapes = pytest.mark.parametrize("shape", ["straight", "curved"])
interfaces = pytest.mark.parametrize("interface", INTERFACES)
#: Number among the middles of the one between two corners.
BETWEEN = np.array([[0, 0, 2], [0, 0, 1], [2, 1, 0]])


def same(ours, theirs):
    """To TOLERANCE of the largest entry."""
    ours, theirs = (part.toarray() if sp.issparse(part) else np.asarray(part) for part in (ours, theirs))
    assert ours.shape == theirs.shape
    return np.abs(ours - theirs).max() <= TOLERANCE * np.abs(theirs).max()


class Counterpart:
    """scikit-fem's mesh of the same triangles, each with its corners in ascending order, as cubic elements need them;
    functions of an order on it, and our nodes among its."""

    def __init__(self, mesh: Mesh):
        ascending = np.argsort(mesh.triangles, axis=1)
        t = np.take_along_axis(mesh.triangles, ascending, axis=1).T.copy()
        self.ours = mesh
        self.mesh = MeshTri(mesh.points[: mesh.corners].T.copy(), t, sort_t=False)
        if mesh.geometry == 2:
            middles = 3 + BETWEEN[ascending, np.roll(ascending, -1, axis=1)]
            nodes = np.column_stack([t.T, np.take_along_axis(mesh.cells, middles, axis=1)])
            plain = Basis(self.mesh, ElementTriP2())
            doflocs = np.empty((2, plain.N))
            doflocs[:, plain.element_dofs] = mesh.points[nodes.T].T.swapaxes(1, 2)
            self.mesh = MeshTri2(doflocs, t, sort_t=False)

    def basis(self, order, degree, **more):
        """Functions of an order, integrated by a rule of a degree."""
        return Basis(self.mesh, THEIRS[order], intorder=degree, **more)

    def nodes(self, space):
        """(n,) number in scikit-fem's basis of each node of a space: the one in the same place."""
        basis = self.basis(space.order, 1)
        apart, found = cKDTree(basis.doflocs.T).query(space.points)
        assert basis.N == space.count and apart.max() < 1e-9 and len(np.unique(found)) == space.count
        return found

    def components(self, order, nodes):
        """(2n,) numbers of x, then y, of ours among those of a vector in scikit-fem."""
        scalar = self.basis(order, 1)
        vector = scalar.with_element(ElementVector(THEIRS[order]))
        found = np.empty((2, scalar.N), int)
        for axis in (0, 1):
            found[axis, scalar.element_dofs] = vector.element_dofs[axis::2]
        return found[:, nodes].ravel()

    def field(self, values, nodes):
        """A field (n,) of ours in scikit-fem's numbering."""
        found = np.empty_like(values)
        found[nodes] = values
        return found

    @cached_property
    def diameters(self):
        """(T,) of the circumscribed circles."""
        return np.array([oracles.diameter(self.ours.points[t]) for t in self.ours.triangles])


@pytest.fixture(scope="module")
def counterparts():
    """Around a half-disc, with triangles of three nodes, and of six with every inner edge bent."""
    curved = meshed(seed(20.0, 0.4, 2), refinement=0.4)[0]
    return {"straight": Counterpart(meshed(seed(20.0, 0.4), refinement=0.4)[0]),
            "curved": Counterpart(bent_inside(curved))}


@pytest.fixture
def of(counterparts, shape):
    """That of a shape."""
    return counterparts[shape]


@pytest.fixture
def space(of, order):
    """Our functions of an order on it."""
    return Space(of.ours, order)


def assembled(unknowns, matrices, count):
    """(count, count) sum of element matrices, as every system of `repro` sums them."""
    return ElementSystem(unknowns, np.arange(count), np.zeros(count, bool)).matrix(matrices)


def places(space, table):
    """(T, q) x and y of the points of a table."""
    where = np.einsum("qa,tai->tqi", table.shape, space.mesh.points[space.mesh.cells])
    return where[..., 0], where[..., 1]


@BilinearForm
def stiffness(u, v, w):
    return dot(grad(u), grad(v))


@BilinearForm
def weighted_mass(u, v, w):
    return w.x[0] * u * v


@LinearForm
def weighted_load(v, w):
    return w.x[0] * v


@orders
@shapes
def test_mass_stiffness_and_load(of, space, order):
    """With a coefficient that varies."""
    nodes, degree = of.nodes(space), degree_of(space)
    basis = of.basis(order, degree)
    x, _ = places(space, space.table)
    ours = assembled(space.cells, space.mass(x * space.at.dx), space.count)
    assert same(ours, weighted_mass.assemble(basis)[nodes][:, nodes])
    assert same(space.summed(space.cells, space.load(x * space.at.dx)), weighted_load.assemble(basis)[nodes])
    assert same(space.at.dx.sum(axis=1), basis.dx.sum(axis=1))
    theirs = stiffness.assemble(of.basis(order, max(2, space.gradient_degree)))
    assert same(assembled(space.cells, space.stiffness, space.count), theirs[nodes][:, nodes])


def degree_of(space):
    """Of the rule for products of functions: that of the order, or of the map where that needs more."""
    return max(elements.DEGREES[space.order], elements.DEGREES[2] if space.mesh.geometry == 2 else 1)


def viscous(interface):
    """(nu grad u, grad v) or (nu (grad u + grad u^T), grad v)."""
    @BilinearForm
    def form(u, v, w):
        strain = grad(u) if interface == "laplacian" else grad(u) + transpose(grad(u))
        return w.nu * ddot(strain, grad(v))
    return form


@BilinearForm
def drag(u, v, w):
    """What a permeable body exerts, (u, v) over its permeability."""
    return w.drag * dot(u, v)


@BilinearForm
def continuity(u, q, w):
    return div(u) * q


@BilinearForm
def pressure_laplacian(p, q, w):
    return w.tau * dot(grad(p), grad(q))


def constant(basis, values):
    """One value (T,) a triangle, in all points of a basis."""
    return np.broadcast_to(values[:, None], basis.dx.shape)


def stokes(of, space, interface, tau=None, permeability=np.inf):
    """The system of scikit-fem's forms, in our numbering: x, y, then pressure."""
    degree = max(2, space.gradient_degree)
    velocity = of.basis(space.order, degree).with_element(ElementVector(THEIRS[space.order]))
    head = flow.pressure_space(space)
    pressure = of.basis(head.order, degree)
    nu = constant(velocity, np.where(of.ours.biomass, RATIO, 1.0))
    numbers, own = of.components(space.order, of.nodes(space)), of.nodes(head)
    A = viscous(interface).assemble(velocity, nu=nu)
    if np.isfinite(permeability):
        finer = of.basis(space.order, degree_of(space)).with_element(ElementVector(THEIRS[space.order]))
        A = A + drag.assemble(finer, drag=constant(finer, of.ours.biomass / permeability))
    A = A[numbers][:, numbers]
    B = continuity.assemble(velocity, pressure)[own][:, numbers]
    C = None
    if tau is not None:
        C = -pressure_laplacian.assemble(pressure, tau=constant(pressure, tau))[own][:, own]
    return sp.block_array([[A, -B.T], [-B, C]], format="csc")


def our_stokes(space, interface, mobility):
    """The same of ours, and the system that is solved."""
    viscosity = np.where(space.mesh.biomass, RATIO, 1.0)
    blocks, n = flow.stokes(space, viscosity, interface, mobility), space.count
    head = flow.pressure_space(space)
    unknowns = np.concatenate([space.cells, n + space.cells, 2 * n + head.cells], axis=1)
    return blocks, assembled(unknowns, blocks, 2 * n + head.count)


@orders
@shapes
@interfaces
def test_stokes(of, space, order, interface):
    """Velocity and pressure of the order less one (linear both, not stabilised, for order 1): all of the matrix, and
    what is left of it in elimination order where the boundary's velocities are prescribed."""
    theirs = stokes(of, space, interface)
    blocks, ours = our_stokes(space, interface, None)
    assert same(ours, theirs)
    system = flow._system(space, interface)
    assert same(system.matrix(blocks), theirs[system.order][:, system.order])
    assert sorted(np.flatnonzero(system.held)) == prescribed_by_place(space, interface)


def prescribed_by_place(space, interface):
    """Unknowns that are prescribed, found by where their nodes are: velocities on the walls and at the inlet, and, in
    the traction form, the velocity across the outlet."""
    x, y = space.points.T
    (left, right), W = space.mesh.ends, space.mesh.width
    fixed = (np.abs(y) < 1e-9) | (np.abs(y - W) < 1e-9) | (np.abs(x - left) < 1e-9)
    across = fixed | (np.abs(x - right) < 1e-9) if interface == "traction" else fixed
    return [*np.flatnonzero(fixed), *(space.count + np.flatnonzero(across))]


@interfaces
def test_stabilised_stokes(counterparts, interface):
    """With tau = h^2 / (c nu), h the diameter of the circumscribed circle."""
    of = counterparts["straight"]
    space, viscosity = Space(of.ours, 1), np.where(of.ours.biomass, RATIO, 1.0)
    mobility = flow.Stabilised(80.0).mobility(of.ours, viscosity, interface)
    theirs = stokes(of, space, interface, of.diameters**2 / (80.0 * viscosity))
    assert same(our_stokes(space, interface, mobility)[1], theirs)


@pytest.mark.parametrize("shape, order, permeability", [
    ("straight", 1, None), *((shape, order, k) for shape in ("straight", "curved") for order in (2, 3)
                             for k in (None, 3.0))])
@interfaces
def test_the_flow_solves_scikit_fems_system(of, space, order, permeability, interface):
    """What `unit_flow` finds, put into it, with a permeable body too; the stabilisation of linear functions is of
    straight triangles."""
    viscosity = np.where(of.ours.biomass, RATIO, 1.0)
    found = flow.unit_flow(space, RATIO, interface=interface, permeability=permeability)
    tau = of.diameters**2 / (100.0 * viscosity) if order == 1 else None
    theirs = stokes(of, space, interface, tau, permeability or np.inf)
    x = np.concatenate([found.velocity[:, 0], found.velocity[:, 1], found.pressure])
    free = np.setdiff1d(np.arange(len(x)), prescribed_by_place(space, interface))
    size = abs(theirs) @ np.abs(x)
    assert (np.abs(theirs @ x)[free] <= 1e-9 * size[free].max()).all()


@BilinearForm
def conserving(C, v, w):
    """-(C u, grad v)."""
    return -C * (w.u_x * grad(v)[0] + w.u_y * grad(v)[1])


@BilinearForm
def through(C, v, w):
    """u_x C v over an end."""
    return w.u_x * C * v


@LinearForm
def entering(v, w):
    """u_x v over an end."""
    return w.u_x * v


@BilinearForm
def carried(C, v, w):
    """(w . grad C, v)."""
    return (w.u_x * grad(C)[0] + w.u_y * grad(C)[1]) * v


def on_end(of, order, x):
    """scikit-fem's functions on an end of the channel."""
    facets = of.mesh.facets_satisfying(lambda where: np.abs(where[0] - x) < 1e-9, boundaries_only=True)
    return FacetBasis(of.mesh, THEIRS[order], facets=facets, intorder=elements.EDGE_DEGREES[order])


def carrying(velocity, correction=None):
    """A flow of any velocity (n, 2), of linear elements less a correction (T, 2)."""
    return flow.Flow(7e5, velocity, np.zeros(len(velocity)), correction, 0.0, 0.0, 1.0)


@given(meshes(), st.integers(0, 1000))
def test_linear_advection_by_the_divergence_free_velocity(grid, seed):
    """With w = u - tau grad p, u linear and tau grad p constant on each triangle; u_x C v over the inlet is lumped."""
    of, random = Counterpart(grid), np.random.default_rng(seed)
    space = Space(grid, 1)
    velocity, correction = (random.standard_normal((len(part), 2)) for part in (grid.points, grid.triangles))
    given = carrying(velocity, correction)
    nodes, basis = of.nodes(space), of.basis(1, 2)
    inlet = on_end(of, 1, grid.ends[0])
    u_x, u_y = (of.field(velocity[:, i], nodes) for i in (0, 1))
    w = [np.asarray(basis.interpolate(u)) - correction[:, i][:, None] for i, u in enumerate((u_x, u_y))]
    lumped = entering.assemble(inlet, u_x=inlet.interpolate(u_x))
    theirs = carried.assemble(basis, u_x=w[0], u_y=w[1]) + sp.diags_array(lumped)
    ours = assembled(space.cells, transport.advection(space, given, velocity[:, 0]), space.count)
    assert same(ours, theirs[nodes][:, nodes])


def test_scikit_fem_keeps_the_order_of_the_nodes():
    """What lets both be mixed."""
    grid = meshed(None)[0]
    assert (grid.fem.t.T == grid.triangles).all()


def law(acceptor, donor, duration):
    """Uptake (2, ...) of acceptor and donor per active biomass at the start, in time ``duration`` of growth at these
    very rates; of complex numbers too."""
    F1, F2, F3, _ = oracles.rates(acceptor, donor, **constants(SCENE))
    mean = np.expm1(F3 * duration) / (F3 * duration) if duration else 1.0
    return np.array([-F1 * mean, -F2 * mean])


def density(x, y):
    """Active biomass, mg/L."""
    return 1000 + 20 * x + 30 * y


def reaction_basis(of, order, degree):
    """Functions on the biomass: integrated with a rule, or, linear, at the corners."""
    biomass = np.flatnonzero(of.ours.biomass)
    if order > 1:
        return of.basis(order, degree, elements=biomass)
    corners = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), np.full(3, 1 / 6)
    return Basis(of.mesh, THEIRS[1], elements=biomass, quadrature=corners)


@orders
@shapes
@pytest.mark.parametrize("duration", [0.0, 0.3])
def test_uptake_and_its_derivative(of, space, order, duration):
    """(q(C) X_A, v) of the biomass as it is, and of its mean over a time in which it grows; linear functions lumped at
    the nodes. The law is the paper's, its derivative that of complex numbers."""
    random = np.random.default_rng(order)
    both, nodes = random.uniform(4.0, 7.0, (2, space.count)), of.nodes(space)
    pieces = space.reaction
    active = density(*aggregates.places(space)) * pieces.dx
    basis = reaction_basis(of, order, degree_of(space))
    A, D = (basis.interpolate(of.field(field, nodes)) for field in both)
    X = density(*basis.global_coordinates())
    theirs = [LinearForm(lambda v, w, i=i: w.X * law(w.A, w.D, duration)[i] * v).assemble(basis, A=A, D=D, X=X)
              for i in (0, 1)]
    problem = transport.problem(space, None, SCENE.substrates, SCENE.kinetics)
    balance, state = transport.Balance(problem, Sink(active, duration)), both.ravel()
    ours = balance._taken(balance.uptake(state))
    assert same(ours.reshape(2, -1), np.array(theirs)[:, nodes])
    assert np.array_equal(balance.residual(state), transport.Balance(problem, None).residual(state) + ours)
    check_tangent(of, space, balance.tangent(state)[2], basis, (A, D, X), duration, nodes)


def check_tangent(of, space, ours, basis, fields, duration, nodes):
    """The coupled part of Newton's matrix: all four blocks."""
    A, D, X = fields
    pieces, n = space.reaction.cells, space.count
    tiny = 1e-30
    matrix = assembled(np.concatenate([pieces, n + pieces], axis=1), ours, 2 * n)
    for i, j in np.ndindex(2, 2):
        def form(u, v, w, i=i, j=j):
            step = np.array([1, 0] if j == 0 else [0, 1]) * tiny * 1j
            slope = law(np.asarray(w.A) + step[0], np.asarray(w.D) + step[1], duration)[i].imag / tiny
            return w.X * slope * u * v
        theirs = BilinearForm(form).assemble(basis, A=A, D=D, X=X)[nodes][:, nodes]
        assert same(matrix[i * n: i * n + n, j * n: j * n + n], theirs), (i, j)


@orders
@shapes
@pytest.mark.parametrize("inlet", ["local", "mean"])
def test_the_operator_of_both_substrates(of, space, order, inlet):
    """Diffusion, slower in the aggregate, and what any velocity carries in the form that conserves, with the supply and
    what flows in and out, with either speed at the inlet (11)."""
    random = np.random.default_rng(order)
    nodes, n = of.nodes(space), space.count
    given = carrying(1e6 * random.standard_normal((n, 2)))
    problem = transport.problem(space, given, SCENE.substrates, SCENE.kinetics, inlet)
    u_x, u_y = (of.field(part, nodes) for part in given.velocity.T)
    first, last = (on_end(of, order, x) for x in of.ours.ends)
    inflow, outflow = (end.interpolate(u_x) for end in (first, last))
    speed = inflow if inlet == "local" else 0 * inflow + given.mean_velocity
    basis, coarser = of.basis(order, degree_of(space)), of.basis(order, max(2, space.gradient_degree))
    inside = conserving.assemble(basis, u_x=basis.interpolate(u_x), u_y=basis.interpolate(u_y))
    carried = inside + through.assemble(last, u_x=outflow) + through.assemble(first, u_x=speed - inflow)
    assert same(problem.inflow, entering.assemble(first, u_x=inflow)[nodes])
    assert same(problem.outflow, entering.assemble(last, u_x=outflow)[nodes])
    for k, kind in enumerate((SCENE.substrates.acceptor, SCENE.substrates.donor)):
        D = np.where(of.ours.biomass, kind.diffusivity_in_aggregate, kind.diffusivity)
        spread = BilinearForm(lambda u, v, w: w.D * dot(grad(u), grad(v))).assemble(coarser, D=constant(coarser, D))
        part = slice(k * n, k * n + n)
        assert same(problem.operator[part, part], (spread + carried)[nodes][:, nodes])
        assert same(problem.source[part], kind.supply * entering.assemble(first, u_x=speed)[nodes])
    assert problem.operator[:n, n:].nnz == 0 and problem.operator[n:, :n].nnz == 0


def stress(F, P, theta, gamma):
    """Of the growing body by F (2, 2, ...), with its stabilisation gamma theta^(-5/3) (J - theta)^2 / 2 in the energy;
    of complex numbers too. That it is the derivative of the energy is the case growth-differences."""
    J = F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
    H = np.array([[F[1, 1], -F[1, 0]], [-F[0, 1], F[0, 0]]]) / J
    trace = (F**2).sum(axis=(0, 1)) + 1
    pressed = P + gamma * theta ** (-5 / 3) * (J - theta)
    return J ** (-2 / 3) * (F - trace / 3 * H) + pressed * J * H


def own_mesh(grid, points):
    """The aggregate's triangles alone, as a mesh, at places (n, 2)."""
    cells = grid.topology.body_cells
    return Mesh.of(points, cells, np.ones(len(cells), bool), np.empty(0, int), 1.0, (0.0, 1.0))


@pytest.mark.parametrize("shape, order", [("straight", 1), ("curved", 2), ("curved", 3)])
def test_growth(counterparts, shape, order):
    """Residual and tangent in an uneven expansion, far from equilibrium: linear displacements with the stabilisation of
    the paper on the last shape [E6], quadratic ones with that of J - theta."""
    grid = counterparts[shape].ours
    now, random = Space(grid, order), np.random.default_rng(9)
    reference = grid.points[grid.body]
    body = pore.material(now, reference)
    mesh = own_mesh(grid, reference)
    of, space = Counterpart(mesh), Space(mesh, grid.geometry)
    linear, n = Space(mesh, 1), len(reference)
    position = reference * [1.15, 1.1] + 0.05 * random.standard_normal(reference.shape)
    pressure = random.standard_normal(mesh.corners)
    x, _ = places(space, body.shape.table)
    theta = 1.3 + 0.01 * x
    last, gamma = mesh.moved(1.08 * reference), 1.0
    stabilising = None
    if order == 1:
        theta, gamma = theta[:, :1], 0.0
        grown = body.strained(last.points).J[:, 0]
        stabilising = growth.gradient_stabilisation(last.points, mesh.triangles, grown)
    system = growth.System(body, np.zeros((n, 2), bool), stabilising=stabilising)
    system.under(theta, position, position, pressure)
    ours = system.residual(position, pressure), assembled(system.unknowns, system.tangent(position, pressure),
                                                          2 * n + mesh.corners)

    basis = of.basis(space.order, max(2, body.shape.degree))
    vector, scalar = basis.with_element(ElementVector(THEIRS[space.order])), basis.with_element(THEIRS[1])
    nodes, corners = of.nodes(space), of.nodes(linear)
    numbers = of.components(space.order, nodes)
    places_now = np.empty(2 * n)
    places_now[numbers] = position.T.ravel()
    given = {"at": vector.interpolate(places_now), "P": scalar.interpolate(of.field(pressure, corners)),
             "theta": constant(basis, theta[:, 0]) if order == 1 else 1.3 + 0.01 * basis.global_coordinates()[0]}
    C = sp.csr_array((mesh.corners, mesh.corners))
    if order == 1:
        C = last_shape_stabilisation(last, grown)[np.ix_(corners, corners)]
    theirs = growth_forms(vector, scalar, given, gamma)
    K, B = theirs[2][numbers][:, numbers], theirs[3][corners][:, numbers]
    assert same(ours[0][: 2 * n], theirs[0][numbers])
    assert same(ours[0][2 * n:], theirs[1][corners] - C @ pressure)
    assert same(ours[1], sp.block_array([[K, B.T], [B, -C]]))


def growth_forms(vector, scalar, given, gamma):
    """Force and gap of the weak form, and the derivative of both by the places."""
    def at(w):
        return np.asarray(grad(w.at)), np.asarray(w.P), np.asarray(w.theta)

    def tangent(u, v, w):
        F, P, theta = at(w)
        step = 1e-30j * np.asarray(grad(u))
        return ddot(stress(F + step, P, theta, gamma).imag / 1e-30, grad(v))

    def excess(F):
        return F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]

    force = LinearForm(lambda v, w: ddot(stress(*at(w), gamma), grad(v))).assemble(vector, **given)
    gap = LinearForm(lambda q, w: (excess(at(w)[0]) - at(w)[2]) * q).assemble(scalar, **given)
    K = BilinearForm(tangent).assemble(vector, **given)
    B = BilinearForm(lambda u, q, w: excess(at(w)[0] + 1e-30j * np.asarray(grad(u))).imag / 1e-30 * q)
    return force, gap, K, B.assemble(vector, scalar, **given)


def last_shape_stabilisation(last, grown):
    """sum h^2 / (12 J^(-2/3)) (grad P, grad q) on the last shape, by scikit-fem."""
    of = Counterpart(last)
    basis = of.basis(1, 2)
    tau = of.diameters**2 / 12 * grown ** (2 / 3)
    return pressure_laplacian.assemble(basis, tau=constant(basis, tau)).tocsr().toarray()
