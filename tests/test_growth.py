"""Growth mechanics (14)-(27): equilibria and refusals.

Straight triangles have the stabilisation of (27), curved ones quadratic coordinates and the grad-div term. The cases of
the stage growth cover exact solutions, derivatives, objectivity and the area.
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
    """(t, q) expansion from one value or one value per triangle (t,)."""
    return np.broadcast_to(np.reshape(theta, (-1, 1)), body.at.dx.shape).astype(float)


def at_rest(body, constrained, theta, prescribed=None):
    """Return the equilibrium from the reference under theta (t, q)."""
    target = body.reference if prescribed is None else prescribed
    return growth.equilibrium(body, theta, body.reference, np.zeros(body.shape.corners), constrained, target)


@GEOMETRIES
def test_one_step_of_growth_takes_few_iterations(geometry):
    """Newton's method converges quadratically: at most 5 iterations for 4 % growth (measured 4)."""
    body, constrained, _, _ = half_disc(20.0, 1 / geometry, geometry=geometry)
    x = body.reference[body.shape.triangles].mean(axis=1)[:, 0]
    assert at_rest(body, constrained, constant(body, 1.04 + 0.001 * x)).iterations <= 5


@GEOMETRIES
def test_a_start_that_is_turned_over_is_refused(geometry):
    """det F <= 0 is detected before any division by it, and so is theta <= 0."""
    body, constrained, rim, _ = half_disc(5.0, geometry=geometry)
    folded, push = body.reference.copy(), np.zeros(body.shape.corners)
    folded[np.setdiff1d(np.arange(body.shape.corners), rim)[0]] += 100.0
    for start in (folded, body.reference * [-1, 1], body.reference * [1, 0]):
        assert body.strained(start).J.min() <= 0
        with pytest.raises(GrowthError, match="turned over"):
            growth.equilibrium(body, constant(body, 1.0), start, push, constrained, start)
    for theta in (-1.0, 0.0):
        with pytest.raises(GrowthError, match="turned over or from theta <= 0"):
            at_rest(body, constrained, constant(body, theta))


def test_an_unused_system_is_freed():
    """It stores fields at every quadrature point."""
    gc.disable()
    try:
        body, constrained, _, _ = half_disc(5.0, 0.5, geometry=2)
        system = growth.System(body, constrained)
        system.under(constant(body, 1.1), body.reference, body.reference, np.zeros(body.shape.corners))
        alive = weakref.ref(system)
        del system
        assert alive() is None
    finally:
        gc.enable()
