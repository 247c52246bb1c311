"""Closed-form element matrices of linear triangles against scikit-fem's forms, which define them."""
import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from skfem import Basis, BilinearForm, ElementTriP1

from repro.fem.assembly import local
from repro.model import flow, transport
from tests.strategies import meshed, meshes

ROUND_OFF = 1e-13


def relative(ours, theirs):
    """Largest difference over the largest entry."""
    return np.abs(ours - theirs).max() / np.abs(theirs).max()


@given(meshes())
def test_flow_forms_are_those_of_scikit_fem(grid):
    """Mutants: areas left out, a mean of one half, x and y exchanged."""
    ours, theirs = flow.linear_forms(grid), flow.general_forms(grid, 1)
    for name in ("laplace", "divergence", "pressure_laplace"):
        assert relative(getattr(ours, name), getattr(theirs, name)) < ROUND_OFF, name


@BilinearForm
def carried(u, v, w):
    """(w . grad u, v)."""
    return (w["x"] * u.grad[0] + w["y"] * u.grad[1]) * v


@given(meshes(), st.integers(0, 1000))
def test_advection_is_that_of_scikit_fem(grid, seed):
    """With w = u - tau grad p, u linear and tau grad p constant on each triangle. Mutants: u alone, a lumped mass, the
    transpose."""
    random = np.random.default_rng(seed)
    velocity, correction = (random.standard_normal((len(part), 2)) for part in (grid.points, grid.triangles))
    given = flow.Flow(1.0, velocity, np.zeros(len(grid.points)), correction, 0.0, 0.0, 1.0)
    basis = Basis(grid.fem, ElementTriP1(), intorder=2)
    x, y = (basis.interpolate(velocity[:, i]) - correction[:, i][:, None] for i in (0, 1))
    assert relative(transport.advection(grid, given), local(carried, basis, x=x, y=y)) < ROUND_OFF


def test_scikit_fem_keeps_the_order_of_the_nodes():
    """What lets both be mixed. Mutant: a mesh that sorts them."""
    grid = meshed(None)[0]
    assert (grid.fem.t.T == grid.triangles).all()
