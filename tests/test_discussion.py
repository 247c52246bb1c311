"""What the paper discusses and does not compute: the claims C38-C46 and their figures, piece by piece. What the claims
come to is compared with `claims.json` by `make claims`."""

import numpy as np
import pytest
from scipy.integrate import quad

from verification.claims import discussed, fluid_and_aggregate, levels
from verification.claims.levels import CONVERGED, Level, at_level
from verification.claims.runs import bodies, scene

COARSE = Level(CONVERGED, 4.0)
HOUR = ("base", 'growth.end="1 h"', 'output.times=["1 h"]')


@pytest.fixture(scope="module", autouse=True)
def coarse():
    """A level that costs little; what is kept of it is dropped."""
    with at_level(COARSE):
        yield
    levels.forget(COARSE)


@pytest.mark.parametrize("ratio, part, share", [(2000.0, 1e-9, 1.0), (2000.0, 1.0, 1 / 2000), (1.0, 0.3, 1.0),
                                                (1e12, 0.4, 0.6**3)])
def test_layers_conduct_as_parallel_flow(ratio, part, share):
    """None; all of the pore; as viscous as water; and so viscous that the open middle alone conducts."""
    assert discussed.layered_share(ratio, part, 2) == pytest.approx(share, rel=1e-6)


def test_leveque_is_the_similarity_solution():
    """Of shear y G over a wall, theta'' + 3 eta^2 theta' = 0: the mean flux is 3/2 of that at the end."""
    slope = 1 / quad(lambda eta: np.exp(-eta**3), 0.0, np.inf)[0]
    assert discussed.leveque(9.0, 1.0, 1.0) == pytest.approx(1.5 * slope, rel=1e-9)
    assert discussed.leveque(8.0, 3.0, 0.7) == pytest.approx(2 * discussed.leveque(1.0, 3.0, 0.7), rel=1e-12)


def test_layers_in_the_model_take_up_what_the_reference_says():
    """But for what they see of the drop across the pore: half the distance on either wall is a quarter of it."""
    part = 0.066
    left = [1 - discussed.in_the_model(part, walls) / discussed.layers_share(scene("wide"), part) for walls in (1, 2)]
    assert 0 < 3 * left[1] < left[0] < 0.03


def test_forces_put_on_at_the_end_are_those_of_a_run_with_them():
    """An elastic body forgets the way; what is left is what the forces changed of its growth."""
    found = bodies(HOUR)[-1]
    along = bodies((*HOUR, 'growth.fluid_forces="included"'))[-1]
    later = fluid_and_aggregate.pressed(found)
    free, forced, run_ = (fluid_and_aggregate.tension(each)[0] for each in (found, later, along))
    assert abs(forced / free - 1) > 0.02 and forced == pytest.approx(run_, rel=2e-3)
