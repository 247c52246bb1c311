"""Parts of the claims C38-C46, which the paper discusses without computing them. `make claims` compares the verdicts
with `claims.json`."""

import numpy as np
import pytest
from scipy.integrate import quad

from verification.claims import discussed, fluid_and_aggregate, levels
from verification.claims.levels import CONVERGED, Level, at_level
from verification.claims.runs import bodies, load_packaged

COARSE = Level(CONVERGED, 4.0)
HOUR = ("base", 'growth.end="1 h"', 'output.times=["1 h"]')


@pytest.fixture(scope="module", autouse=True)
def coarse():
    """A cheap level, whose cached values are dropped."""
    with at_level(COARSE):
        yield
    levels.forget(COARSE)


@pytest.mark.parametrize("ratio, part, share", [(2000.0, 1e-9, 1.0), (2000.0, 1.0, 1 / 2000), (1.0, 0.3, 1.0),
                                                (1e12, 0.4, 0.6**3)])
def test_layers_conduct_as_parallel_flow(ratio, part, share):
    """The cases are no layers, the whole pore, layers as viscous as water, and layers that hardly conduct."""
    assert discussed.layered_share(ratio, part, 2) == pytest.approx(share, rel=1e-6)


def test_leveque_is_the_similarity_solution():
    """For shear y G over a wall, theta'' + 3 eta^2 theta' = 0, and the mean flux is 3/2 of that at the end."""
    slope = 1 / quad(lambda eta: np.exp(-eta**3), 0.0, np.inf)[0]
    assert discussed.leveque(9.0, 1.0, 1.0) == pytest.approx(1.5 * slope, rel=1e-9)
    assert discussed.leveque(8.0, 3.0, 0.7) == pytest.approx(2 * discussed.leveque(1.0, 3.0, 0.7), rel=1e-12)


def test_layers_in_the_model_take_up_as_much_as_the_reference():
    """They differ by the drop of concentration across the pore. Half the distance on either wall has a quarter."""
    part = 0.066
    wide = load_packaged("wide")
    defects = [1 - discussed.in_the_model(part, walls) / discussed.layers_share(wide, part) for walls in (1, 2)]
    assert 0 < 3 * defects[1] < defects[0] < 0.03


def test_forces_applied_at_the_end_agree_with_a_run_under_them():
    """An elastic body forgets its path; the remaining difference comes from growth under the forces."""
    unloaded = bodies(HOUR)[-1]
    along = bodies((*HOUR, 'growth.fluid_forces="included"'))[-1]
    later = fluid_and_aggregate.pressed(unloaded)
    free, forced, always_forced = (fluid_and_aggregate.tension(body)[0] for body in (unloaded, later, along))
    assert abs(forced / free - 1) > 0.02 and forced == pytest.approx(always_forced, rel=2e-3)
