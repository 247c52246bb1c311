"""The bounded transfer: conserving, within local bounds, and no other than the projection where that is bounded."""
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from repro.fem import reprojection
from repro.fem.mesh import triangle_areas
from repro.march.simulation import simulate
from repro.scene import SceneError, load_scene
from verification.reprojection import grids

OLD, NEW = grids.grid(6.0, 1), grids.grid(5.0, 2)


def mass(mesh, field) -> float:
    points, triangles = mesh
    return float(triangle_areas(points, triangles) @ field[triangles].mean(axis=1))


#: Numbers below it have fewer digits.
TINY = np.finfo(float).tiny


def random_field(seed: int, share: float) -> np.ndarray:
    """Zeros and ones, of which a share is one."""
    return 1.0 * (np.random.default_rng(seed).uniform(size=len(OLD[0])) < share)


@given(st.integers(0, 10**6), st.floats(0.02, 0.98), st.floats(1e-6, 1e6), st.floats(-1.0, 1.0))
def test_mass_is_kept_and_bounds_hold(seed, share, scale, level):
    """For rough fields of any size and level. Mutant: fluxes limited on one side, or not at all."""
    before = scale * (random_field(seed, share) + level)
    after = reprojection.project_bounded(*OLD, before[:, None], *NEW)[:, 0]
    assert after.min() >= before.min() and after.max() <= before.max()
    assert abs(mass(NEW, after) - mass(OLD, before)) <= (1e-12 * np.abs(before).max() + TINY) * grids.AREA


def test_what_is_far_away_plays_no_part():
    """A spike is carried to nodes near it alone, where the projection rings in the whole domain."""
    before = np.zeros(len(OLD[0]))
    peak = np.argmin(np.hypot(*(OLD[0] - [20.0, 12.0]).T))
    before[peak] = 1.0
    free, bounded = (carry(*OLD, before[:, None], *NEW)[:, 0]
                     for carry in (reprojection.project, reprojection.project_bounded))
    far = np.hypot(*(NEW[0] - OLD[0][peak]).T) > 14.0
    assert np.abs(free[far]).max() > 1e-4 and (bounded[far] == 0).all() and bounded.min() == 0


def test_a_bounded_projection_is_left_alone():
    """Column by column: the smooth one is the projection's to the last bit, the rough one is not."""
    smooth = 2 + np.sin(0.05 * OLD[0][:, 0])
    fields = np.column_stack([3 + 0.1 * OLD[0][:, 0], random_field(3, 0.3), smooth])
    free, bounded = (carry(*OLD, fields, *NEW) for carry in (reprojection.project, reprojection.project_bounded))
    assert np.abs(free - bounded)[:, 0].max() < 1e-13 * 7 and np.abs(free - bounded)[:, 1].max() > 1e-2


def test_a_run_that_remeshes_with_it_keeps_its_biomass():
    """The scene's word reaches the remesh: never negative, mass to round-off, and not the other transfers' numbers."""
    found = {}
    for transfer in ("conserving", "linear", "bounded"):
        said = load_scene("base", ['numerics.preset="paper"', 'growth.end="4 h"', 'growth.time_step="24 min"',
                                   'numerics.refinement=0.6', f"numerics.transfer={transfer}", 'output.times=["4 h"]'])
        *_, last = simulate(said)
        assert last.remeshes > 0
        rows = last.ledgers
        found[transfer] = last.pore, max(abs(r.biomass_after - r.biomass_before - r.biomass_made) / r.biomass_after
                                         for r in rows)
    assert found["bounded"][1] < 1e-12 and found["conserving"][1] < 1e-12 and found["linear"][1] > 1e-12
    assert found["bounded"][0].inert.min() >= 0
    assert found["bounded"][0].outline.area != found["conserving"][0].outline.area


def test_quadratic_elements_have_their_own_transfer():
    with pytest.raises(SceneError, match='numerics.transfer = "bounded": "conserving" is needed with'):
        load_scene("base", ['numerics.preset="fast"', "numerics.transfer=bounded"])
