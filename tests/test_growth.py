"""Growth mechanics (14)-(27): the material law, equilibria of any body, and what must be refused.

On straight triangles with the stabilisation of (27), and on curved ones with quadratic places and the grad-div term.
Exact solutions, derivatives, objectivity and the area are cases of the stage growth.
"""
import gc
import weakref

import numpy as np
import pytest

from repro.errors import GrowthError
from repro.model import growth
from tests.strategies import half_disc

GEOMETRIES = pytest.mark.parametrize("geometry", [1, 2])


def constant(body, theta):
    """(t, q) of one expansion, or of one for each triangle (t,)."""
    return np.broadcast_to(np.reshape(theta, (-1, 1)), body.at.dx.shape).astype(float)


def at_rest(body, held, theta, prescribed=None):
    """Equilibrium from the reference under theta (t, q)."""
    target = body.reference if prescribed is None else prescribed
    return growth.equilibrium(body, theta, body.reference, np.zeros(body.shape.corners), held, target)


def area(body, position):
    """Of the body with its nodes at these places."""
    return (body.at.dx * body.strained(position).J).sum()


@GEOMETRIES
def test_one_step_of_growth_takes_few_iterations(geometry):
    """Newton's method converges quadratically with its tangent: 4 % growth in at most 5 (measured 4)."""
    body, held, _, _ = half_disc(20.0, 1 / geometry, geometry=geometry)
    x = body.reference[body.shape.triangles].mean(axis=1)[:, 0]
    assert at_rest(body, held, constant(body, 1.04 + 0.001 * x)).iterations <= 5


@GEOMETRIES
def test_a_start_that_is_turned_over_is_refused(geometry):
    """det F < 0, or 0, which is told before anything is divided by it; or theta <= 0."""
    body, held, rim, _ = half_disc(5.0, geometry=geometry)
    folded, push = body.reference.copy(), np.zeros(body.shape.corners)
    folded[np.setdiff1d(np.arange(body.shape.corners), rim)[0]] += 100.0
    for start in (folded, body.reference * [-1, 1], body.reference * [1, 0]):
        assert body.strained(start).J.min() <= 0
        with pytest.raises(GrowthError, match="turned over"):
            growth.equilibrium(body, constant(body, 1.0), start, push, held, start)
    for theta in (-1.0, 0.0):
        with pytest.raises(GrowthError, match="turned over or from theta <= 0"):
            at_rest(body, held, constant(body, theta))


def test_a_system_is_freed_when_nobody_has_it():
    """It holds fields at every point of the quadrature."""
    gc.disable()
    try:
        body, held, _, _ = half_disc(5.0, 0.5, geometry=2)
        system = growth.System(body, held)
        system.under(constant(body, 1.1), body.reference, body.reference, np.zeros(body.shape.corners))
        alive = weakref.ref(system)
        del system
        assert alive() is None
    finally:
        gc.enable()
