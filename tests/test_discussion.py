"""Parts of the claims C38-C46, which the paper discusses without computing them. `make claims` compares the verdicts
with `claims.json`."""

import numpy as np
import pytest
from scipy.integrate import quad

from verification.claims import discussed


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
