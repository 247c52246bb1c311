"""Linear triangles are assembled in closed form: here against scikit-fem's assembly of the same weak forms on the same
nodes, to 1e-12 of the largest entry. Higher orders are tabulated from scikit-fem's elements."""
import numpy as np
import pytest
import scipy.sparse as sp
from skfem import Basis, BilinearForm, ElementTriP1, ElementVector, FacetBasis, LinearForm
from skfem.helpers import ddot, div, dot, grad, transpose

from repro.fem.assembly import ElementSystem
from repro.fem.space import Space
from repro.model import flow, transport
from repro.scene import load_scene
from tests import oracles
from tests.strategies import meshed, seed

GRID = meshed(seed(20.0, 0.4), refinement=0.4)[0]
SPACE, COUNT = Space(GRID, 1), len(GRID.points)
BASIS = Basis(GRID.fem, ElementTriP1(), intorder=2)


def same(ours, theirs):
    return np.abs(ours - theirs).max() <= 1e-12 * np.abs(theirs).max()


def each(values):
    """One value (T,) a triangle, in all points."""
    return np.broadcast_to(values[:, None], BASIS.dx.shape)


@BilinearForm
def viscous(u, v, w):
    strain = grad(u) + transpose(grad(u)) if w.coupled else grad(u)
    return w.nu * ddot(strain, grad(v))


@pytest.mark.parametrize("interface", ["laplacian", "traction"])
def test_stabilised_stokes(interface):
    """With tau = h^2 / (c nu), h the diameter of the circumscribed circle."""
    viscosity = np.where(GRID.biomass, 7.0, 1.0)
    mobility = flow.Stabilised(80.0).mobility(GRID, viscosity, interface)
    unknowns = np.concatenate([SPACE.cells + part * COUNT for part in range(3)], axis=1)
    system = ElementSystem(unknowns, np.arange(3 * COUNT), np.zeros(3 * COUNT, bool))
    vector = BASIS.with_element(ElementVector(ElementTriP1()))
    x_then_y = np.arange(2 * COUNT).reshape(-1, 2).T.ravel()
    A = viscous.assemble(vector, nu=each(viscosity), coupled=interface == "traction")[x_then_y][:, x_then_y]
    B = BilinearForm(lambda u, q, w: div(u) * q).assemble(vector, BASIS)[:, x_then_y]
    diameters = np.array([oracles.diameter(GRID.points[t]) for t in GRID.triangles])
    C = BilinearForm(lambda p, q, w: w.tau * dot(grad(p), grad(q))).assemble(
        BASIS, tau=each(diameters**2 / (80.0 * viscosity)))
    ours = system.matrix(flow.stokes(SPACE, viscosity, interface, mobility))
    assert same(ours, sp.block_array([[A, -B.T], [-B, -C]], format="csc"))


@pytest.mark.parametrize("inlet", ["local", "mean"])
def test_what_is_carried_and_spreads(inlet):
    """By w = u - tau grad p, u linear and tau grad p constant on each triangle, with either speed at the inlet (11),
    lumped."""
    made, random = load_scene("base"), np.random.default_rng(1)
    velocity, correction = (1e6 * random.standard_normal((len(part), 2)) for part in (GRID.points, GRID.triangles))
    given = flow.Flow(7e5, velocity, np.zeros(COUNT), correction, 0.0, 0.0, 1.0)
    problem = transport.problem(SPACE, given, made.substrates, made.kinetics, inlet)
    w_x, w_y = (np.asarray(BASIS.interpolate(velocity[:, axis])) - each(correction[:, axis]) for axis in (0, 1))
    end = FacetBasis(GRID.fem, ElementTriP1(), facets=GRID.fem.facets_satisfying(
        lambda x: np.abs(x[0] - GRID.ends[0]) < 1e-9, boundaries_only=True))
    speed = velocity[:, 0] if inlet == "local" else np.full(COUNT, given.mean_velocity)
    enters = LinearForm(lambda v, w: w.speed * v).assemble(end, speed=end.interpolate(speed))
    carried = BilinearForm(lambda C, v, w: (w.x_ward * grad(C)[0] + w.y_ward * grad(C)[1]) * v).assemble(
        BASIS, x_ward=w_x, y_ward=w_y)
    for k, kind in enumerate(problem.both):
        D = np.where(GRID.biomass, kind.diffusivity_in_aggregate, kind.diffusivity)
        spread = BilinearForm(lambda C, v, w: w.D * dot(grad(C), grad(v))).assemble(BASIS, D=each(D))
        own = slice(k * COUNT, k * COUNT + COUNT)
        assert same(problem.operator[own, own], spread + carried + sp.diags_array(enters))
        assert same(problem.source[own], kind.supply * enters)
