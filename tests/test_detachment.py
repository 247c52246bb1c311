"""Stresses that walls and biomass bear: means of tractions; scenes without strengths.

`test_ends.py` tests the ends of runs by a strength, `test_derived.py` the charts of these stresses, and
`test_longer.py` a run with a bonded wall that is made longer.
"""

import numpy as np
import pytest

import repro
from repro import results
from repro.model import adhesion
from repro.scene import load_scene


@pytest.mark.parametrize("count", (2, 3))
def test_means_of_a_traction_are_those_of_its_integral(count):
    """A linear traction on edges of unequal lengths, from its consistent nodal forces; the means over 5 of 18 um."""
    x = np.sort(np.random.default_rng(count).uniform(0.0, 18.0, 7))
    x[[0, -1]] = 0.0, 18.0
    nodes = np.array([range(k, k + count) for k in range(0, 7 - count + 1, count - 1)])
    if count == 3:
        x[1::2] = (x[:-1:2] + x[2::2]) / 2
    surface = adhesion._Surface(x, nodes)
    points, weights = np.polynomial.legendre.leggauss(6)
    forces = np.zeros(7)
    for edge in nodes:
        length = x[edge[-1]] - x[edge[0]]
        s = (points + 1) / 2
        hats = [np.prod([(s - b) / (a - b) for b in np.linspace(0, 1, count) if b != a], axis=0)
                for a in np.linspace(0, 1, count)]
        forces[edge] += [length / 2 * weights @ (hat * (3 - 0.2 * (x[edge[0]] + s * length))) for hat in hats]
    middles = surface.middles(100.0)
    # A mean ends within a part of an edge, where its integral is taken as linear.
    error = 2 / 5 * (x[nodes[:, -1]] - x[nodes[:, 0]]).max() ** 2 / adhesion.PARTS**2 * 0.2 / 8
    assert surface.means(surface.density(forces), 100.0) == pytest.approx(3 - 0.2 * middles, abs=error)
    assert middles.min() == pytest.approx(2.5) and middles.max() == pytest.approx(15.5)
    assert surface.means(surface.density(forces), 1e4) == pytest.approx([1.2, 1.2, 1.2])


def test_a_scene_without_these_keys_computes_none_of_it(monkeypatch):
    for name in ("wall_peak", "tensile_peak", "fluid_load"):
        monkeypatch.setattr(adhesion, name, None)
    scene = load_scene("base", ['growth.end="0.4 h"'])
    *_, last = repro.simulate(scene)
    row = results.row(scene, last)
    assert row["wall_traction_max_MPa"] is None and row["fluid_force_x_uN_per_m"] is None
