"""Growth on curved triangles: closed forms at small cost, tangent, what the grad-div term is for, what is refused."""
import gc
import weakref

import numpy as np
import pytest

from repro.curved import elements, growth
from repro.errors import GrowthError
from repro.model import growth as linear_growth
from verification.growth import curved as cases


def test_the_tangent_is_the_derivative():
    """Of the residual with theta that varies, in a half-disc that is bent, to the order of Taylor's theorem. Mutants: a
    tangent without the grad-div term, or with theta^(-2/3), -B for B."""
    body, _ = cases._half_disc(0.3)
    system, random = growth.System(body), np.random.default_rng(1)
    theta = random.uniform(1.2, 1.6, body.places.dx.shape)
    x = body.origin @ np.array([[1.2, 0.1], [0.2, 1.1]])
    P, dx, dP = (random.standard_normal(n) for n in (body.corners, x.shape, body.corners))
    direction = np.concatenate([dx[:, 0], dx[:, 1], dP])
    linear = system.sparse.product(system.tangent(x, P, theta), direction)
    start = system.residual(x, P, theta)[0]
    left = [np.abs(system.residual(x + s * dx, P + s * dP, theta)[0] - start - s * linear).max()
            for s in (0.02, 0.01, 0.005)]
    assert all(3.6 < a / b < 4.4 for a, b in zip(left, left[1:]))


def test_a_body_without_forces_turns_and_shifts_freely():
    """Forces of a turned and shifted body are turned, J is as it was (objectivity). Mutants: S transposed, places that
    enter by themselves."""
    body, _ = cases._half_disc(0.3)
    system, random = growth.System(body), np.random.default_rng(2)
    theta = np.full(body.places.dx.shape, 1.3)
    x = body.origin @ np.array([[1.2, 0.1], [0.2, 1.1]])
    P, n = random.standard_normal(body.corners), 2 * len(x)
    Q = np.array([[0.28, -0.96], [0.96, 0.28]])
    here, there = (system.residual(place, P, theta)[0] for place in (x, x @ Q.T + [3.0, -7.0]))
    assert np.allclose(there[:n].reshape(2, -1), Q @ here[:n].reshape(2, -1), atol=1e-12 * np.abs(here).max())
    assert np.allclose(there[n:], here[n:], atol=1e-9)


@pytest.mark.parametrize("top", [36.0, 2000.0])
def test_a_growing_half_cylinder(top):
    """Places to 3e-4, pressure to 2 %, as its closed form says, on 76 triangles. Mutants: GAMMA = 0 (no equilibrium is
    found), theta of the corners only, the expansion forgotten."""
    found = cases._cylinder_errors(0.6, top)
    assert found["outline"] < 3e-4 and found["position"] < 4e-4 and found["pressure"] < 2e-2


def test_without_the_grad_div_term_there_is_no_equilibrium(monkeypatch):
    """What the linear pressure leaves free of J grows from nothing: Newton's method does not converge. Mutant: a term
    that does nothing, such as GAMMA = 0."""
    monkeypatch.setattr(growth, "GAMMA", 0.0)
    monkeypatch.setattr(linear_growth, "CONTINUATION", (1,))
    with pytest.raises(GrowthError, match="try a shorter growth.time_step or a larger numerics.refinement"):
        cases._cylinder.__wrapped__(0.6, 36.0)


def test_the_grad_div_term_does_no_work_where_j_is_theta():
    """Twice as much of it gives the same homogeneous growth. Mutant: J + theta for J - theta."""
    grid, left, _, bottom = cases._rectangle()
    body = cases._body(grid.points, grid.points, np.column_stack([left, bottom]))
    found = growth.equilibrium(body, np.full(len(grid.points), 3.0), grid.points, np.zeros(body.corners), grid.points)
    reached = growth.System(body).deformed(found.position)
    assert np.allclose(reached.F, np.sqrt(3.0) * np.eye(2), atol=1e-10)
    assert np.allclose(elements.determinant(reached.F), 3.0, atol=1e-9)


def test_the_answer_does_not_depend_on_the_start():
    """From t = 0 or from a shape half way. Mutant: parts of theta counted from one."""
    body, _, found = cases._cylinder(0.3, 36.0)
    inner, more = cases._coefficients(36.0)
    theta = inner + more * np.sum(body.origin**2, axis=1) / cases.RADIUS**2
    start = growth.equilibrium(body, np.sqrt(theta), body.origin, np.zeros(body.corners), body.origin)
    again = growth.equilibrium(body, theta, start.position, start.pressure, body.origin)
    assert np.allclose(again.position, found.position, atol=1e-7)


def test_what_is_turned_over_is_refused():
    """A start with det F < 0, or theta <= 0. Mutant: no guard (a logarithm of what is negative)."""
    grid = cases._rectangle()[0]
    body = cases._body(grid.points, grid.points, np.zeros((len(grid.points), 2), bool))
    one, push = np.ones(len(grid.points)), np.zeros(body.corners)
    for theta, start in ((one, grid.points * [-1, 1]), (0 * one, grid.points)):
        with pytest.raises(GrowthError, match="turned over or from theta <= 0"):
            growth.equilibrium(body, theta, start, push, start)
    assert not growth.System(body).admissible(grid.points * [-1, 1])


def _plate():
    grid, left, _, bottom = cases._rectangle()
    return grid, cases._body(grid.points, grid.points, np.column_stack([left, bottom]))


def test_a_body_that_is_pressed_flat_is_not_admissible():
    """J = 0 is told before anything is divided by it. Mutant: J taken from what also works out F^-T."""
    grid, body = _plate()
    with np.errstate(all="raise"):
        assert not growth.System(body).admissible(grid.points * [1.0, 0.0])
        assert growth.System(body).admissible(grid.points)


def test_a_system_is_freed_when_nobody_has_it():
    """It holds fields at every point of the quadrature. Mutant: what it keeps its last results with refers to it."""
    gc.disable()
    try:
        grid, body = _plate()
        system = growth.System(body)
        system.residual(grid.points, np.zeros(body.corners), np.ones(system.at.dx.shape))
        alive = weakref.ref(system)
        del system
        assert alive() is None
    finally:
        gc.enable()
