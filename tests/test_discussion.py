"""What the paper discusses and does not compute: the claims C38-C46 and their figures, piece by piece. What the claims
come to is compared with `claims.json` by `make claims`."""
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad

from paper_figures import states
from repro import load_scene, run
from repro.fem.mesh import triangle_areas
from repro.fem.outline import polygon_area
from repro.march.simulation import steps
from verification.claims import discussed, fluid_and_aggregate, levels, rheology
from verification.claims.levels import CONVERGED, Level, at_level
from verification.claims.runs import LATE, NEAR, bodies, history, scene, until

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


def test_nothing_left_at_the_surface_is_the_limit_of_ever_faster_uptake():
    """The uptake of Table 1 times a hundred is a good way from it."""
    with at_level(Level(CONVERGED, 2.0)):
        rates = [discussed.sherwood(discussed.in_one_shape(supply=1.0, faster=more))[0] for more in (1.0, 100.0, 1e3)]
        limit = discussed.sherwood(discussed.at_the_surface(discussed.in_one_shape(supply=1.0)))[0]
    assert rates[0] > rates[1] > 1.01 * limit and abs(rates[2] / limit - 1) < 0.5 * (rates[1] / limit - 1)


def test_an_outline_that_has_slid_is_moved_back(monkeypatch):
    """By 8 um downstream: what is judged is what is left, the area that only one covers."""
    here = bodies(HOUR)[-1].outline
    slid, larger = replace(here, points=here.points + [8.0, 0.0]), replace(here, points=1.01 * here.points)
    for there, (moved, left) in ((here, (0, 0)), (slid, (8, 0)), (larger, (0, 2.01))):
        outlines = {rheology.WHOLE: here, HOUR: there}
        monkeypatch.setattr(rheology, "body", lambda run, time, all=outlines: SimpleNamespace(outline=all[run]))
        found = rheology.slid(HOUR)
        assert (found[0], found[2]) == pytest.approx((moved, left), abs=0.01)


def test_film_and_angle_do_nothing_until_the_opposite_wall_is_near():
    """A run with them goes on from one without them, bit for bit as one of its own."""
    plain = ("wide", *until(33))
    assert 0.7 < history(*plain).far.pore.boundary.thickness / 100 <= NEAR
    late = [name for name, change in rheology.VARIANTS.items() if change.startswith(LATE)]
    assert late == ["film halved", "film doubled", "angle halved", "angle doubled"]
    changed = (*plain, rheology.VARIANTS["film doubled"])
    *_, (own, _) = steps(scene(*changed))
    (end,) = history(*changed).instants
    assert np.array_equal(end.pore.mesh.points, own.pore.mesh.points) and end.pore.mass == own.pore.mass


def test_every_variant_changes_one_key_of_the_scene():
    base = scene(*rheology.WHOLE)
    for change in rheology.VARIANTS.values():
        said = scene(*rheology.WHOLE, change)
        changed = [key for part in ("growth", "numerics") for key in vars(getattr(said, part))
                   if getattr(getattr(said, part), key) != getattr(getattr(base, part), key)]
        assert len(changed) == 1, change


def test_forces_put_on_at_the_end_are_those_of_a_run_with_them():
    """An elastic body forgets the way; what is left is what the forces changed of its growth."""
    found = bodies(HOUR)[-1]
    along = bodies((*HOUR, 'growth.fluid_forces="included"'))[-1]
    later = fluid_and_aggregate.pressed(found)
    free, forced, run_ = (fluid_and_aggregate.tension(each)[0] for each in (found, later, along))
    assert abs(forced / free - 1) > 0.02 and forced == pytest.approx(run_, rel=2e-3)


def test_curved_triangles_are_drawn_in_four_straight_ones(tmp_path):
    """All counterclockwise, the aggregate's area to the bulge of its arcs, its rim through their middles: 16
    chords of a half-circle leave 0.64 % out, the 8 between corners 2.6 %."""
    run(load_scene("wide", ['numerics.preset="fast"', 'growth.end="1 h"', 'output.times=["1 h"]']), tmp_path / "wide")
    state, row = states.last(tmp_path / "wide"), states.row(tmp_path / "wide", 1.0)
    assert triangle_areas(state.points, state.triangles).min() > 0
    assert polygon_area(state.rim) == pytest.approx(row["aggregate_area_um2"], rel=1e-2)
    assert set(np.unique(state.triangles)) == set(range(len(state.points)))
    assert len(state.cells["theta"]) == len(state.triangles) == len(state.biomass)
