"""What the paper discusses and does not compute: the claims C38-C46 and their figures, piece by piece."""
from dataclasses import replace
from importlib import import_module
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad

from paper_figures import runs, states
from repro import load_scene, run
from repro.fem.mesh import triangle_areas
from repro.fem.outline import polygon_area
from repro.march.simulation import steps
from repro.model.growth import largest_principal
from verification.claims import discussed, fluid_and_aggregate, growth_pattern, levels, permeability, rheology
from verification.claims.levels import CONVERGED, Level, at_level
from verification.claims.runs import LATE, NEAR, bodies, history, scene, until
from verification.claims.runs import stress as restored_stress
from verification.sensitivity import wide

COARSE = Level(CONVERGED, 4.0)
HOUR = ("base", 'growth.end="1 h"', 'output.times=["1 h"]')


@pytest.fixture(scope="module", autouse=True)
def coarse():
    """A level that costs little; what is kept of it is dropped."""
    with at_level(COARSE):
        yield
    levels.forget(COARSE)


@pytest.mark.parametrize("ratio, part, share", [(2000.0, 1e-9, 1.0), (2000.0, 1.0, 1 / 2000), (1.0, 0.3, 1.0)])
@pytest.mark.parametrize("walls", [1, 2])
def test_layers_conduct_as_parallel_flow(walls, ratio, part, share):
    """None; all of the pore; as viscous as water; and so viscous that the open middle alone conducts."""
    assert discussed.layered_share(ratio, part, walls) == pytest.approx(share, rel=1e-6)
    assert discussed.layered_share(1e12, 0.4, 2) == pytest.approx(0.6**3, rel=1e-6)


def test_leveque_is_the_similarity_solution():
    """Of shear y G over a wall, theta'' + 3 eta^2 theta' = 0: the mean flux is 3/2 of that at the end."""
    slope = 1 / quad(lambda eta: np.exp(-eta**3), 0.0, np.inf)[0]
    assert discussed.leveque(9.0, 1.0, 1.0) == pytest.approx(1.5 * slope, rel=1e-9)
    assert discussed.leveque(8.0, 3.0, 0.7) == pytest.approx(2 * discussed.leveque(1.0, 3.0, 0.7), rel=1e-12)


def test_little_biomass_takes_up_as_much_as_the_supply_lets_it():
    """X f q(C_s) L / (u C_s), as far as C falls."""
    said, part = scene("wide"), 1e-4
    law, flow = said.kinetics, 2.9e6 / 24
    m = 10 / 11
    rate = m * (law.maximum_utilization_rate * law.acceptor_to_donor_ratio * m
                + law.decay_oxygen_demand * law.degradable_fraction * law.decay_coefficient)
    expected = part * law.maximum_density * rate * said.pore.length / (flow * 10.0)
    assert discussed.layers_share(said, part) == pytest.approx(expected, rel=2 * expected)
    assert discussed.layers_share(said, 0.2) > 0.9 > discussed.layers_share(said, 0.2, 10 * flow)


def test_layers_in_the_model_have_the_biomass_and_the_walls():
    said, part = scene("wide"), 0.15
    for walls in (1, 2):
        grid = discussed.layered(said, part, walls)
        areas = triangle_areas(grid.points, grid.triangles)
        assert areas.min() > 0 and areas.sum() == pytest.approx(100 * 600, rel=1e-12)
        assert areas[grid.biomass].sum() == pytest.approx(part * 100 * 600, rel=1e-12)
        covered = grid.points[grid.cells[grid.biomass, :3], 1]
        assert (covered.min(), covered.max() == 100) == (0, walls == 2)


def test_layers_in_the_model_take_up_what_the_reference_says():
    """But for what they see of the drop across the pore: half the distance on either wall is a quarter of it."""
    part = 0.066
    left = [1 - discussed.in_the_model(part, walls) / discussed.layers_share(scene("wide"), part) for walls in (1, 2)]
    assert 0 < 3 * left[1] < left[0] < 0.03


def test_nothing_left_at_the_surface_is_the_limit_of_ever_faster_uptake():
    """Whatever the supply is; the uptake of Table 1 times a hundred is a good way from it."""
    with at_level(Level(CONVERGED, 2.0)):
        rates = [discussed.sherwood(discussed.in_one_shape(supply=1.0, faster=more))[0] for more in (1.0, 100.0, 1e3)]
        poor, rich = (discussed.at_the_surface(discussed.in_one_shape(supply=supply)) for supply in (1.0, 100.0))
    assert discussed.sherwood(poor) == pytest.approx(discussed.sherwood(rich), rel=1e-9)
    limit, surface = discussed.sherwood(poor)[0], poor.grid.loop[poor.outline.interface_edges()]
    assert rates[0] > rates[1] > 1.01 * limit and abs(rates[2] / limit - 1) < 0.5 * (rates[1] / limit - 1)
    assert np.abs(poor.node("acceptor_mg_per_L")[surface]).max() == 0


def test_what_could_be_is_judged_by_the_state_in_which_it_is_the_most(monkeypatch):
    """Of C42 and C46 alike: one of three is enough."""
    monkeypatch.setattr(fluid_and_aggregate, "body", lambda run, hour: hour)
    monkeypatch.setattr(fluid_and_aggregate, "pressed", lambda found: found)
    for changes, link, hangs in (((1.0, 2.0, -40.0), True, True), ((1.0, 2.0, -3.0), False, True),
                                 ((-8.0, 9.0, -40.0), True, False)):
        by_hour = dict(zip((hour for _, hour in fluid_and_aggregate.STATES), changes))
        monkeypatch.setattr(fluid_and_aggregate, "changed", lambda pair, given=by_hour: given[pair[0]])
        assert [check.holds for check in fluid_and_aggregate.torn_by_the_fluid().checks] == [link]
        usual = {"aggregate": 1.0, "film": 1.0, "plug": 1.0, "contact": 1.0}
        other = {name: 1 + change / 100 for name, change in zip(usual, changes)} | {"contact": 1.0}
        both = iter((usual, other))
        monkeypatch.setattr(rheology, "conductivities", lambda *pair, both=both: next(both))
        assert [check.holds for check in rheology.drag_or_viscosity().checks] == [link, hangs]


def test_the_place_of_the_largest_stress_on_the_size_of_its_figure_is_told(monkeypatch):
    """Beside that of the present level."""
    places = {COARSE: 9.0, Level(CONVERGED, levels.PAIRED[1]): -8.0}
    monkeypatch.setattr(fluid_and_aggregate, "body", lambda run, hour: levels.current())
    monkeypatch.setattr(fluid_and_aggregate, "peak", lambda found: fluid_and_aggregate.Peak(1.0, places[found], 0.0))
    told = fluid_and_aggregate._on_another_size({("wide",): 45.0})
    assert "at x = 9 and -8 um in wide" in told and "2.25 times" in told


def test_the_pressure_of_forces_is_that_of_the_aggregate_alone():
    """There is none in the water."""
    found = bodies(HOUR)[-1]
    pressure = found.node("pressure_MPa")
    assert np.isnan(pressure).any()
    assert fluid_and_aggregate.forces(found).pressure == 1e6 * np.abs(pressure[found.grid.body]).max() > 0


def test_decay_over_synthesis_at_rest():
    """b / (k Y m_D), with m_D between those of the aggregate's extremes."""
    found = bodies(HOUR)[0]
    law, donor = found.scene.kinetics, found.node("donor_mg_per_L")[found.grid.body]
    most, least = (law.decay_coefficient / (law.maximum_utilization_rate * law.yield_coefficient * d / (d + 1.0))
                   for d in (donor.min(), donor.max()))
    assert least * (1 - 1e-9) <= permeability.decay_share(found) <= most * (1 + 1e-9)


def test_the_fall_up_to_contact_and_the_fastest_decline(monkeypatch):
    """Of a velocity exp(-t / 10) that drops to a third at contact."""
    time = np.linspace(0.0, 60.0, 61)
    velocity = np.exp(-time / 10) * np.where(time > 50, 1 / 3, 1.0)
    rows = {"time_h": time, "mean_velocity_m_per_d": velocity, "conductivity_m_per_d": velocity}
    monkeypatch.setattr(permeability, "series", lambda *run: rows)
    monkeypatch.setattr(permeability, "contact", lambda: (np.exp(-5.0), np.exp(-5.0) / 3, 50.01))
    assert permeability.fall() == pytest.approx(3 * np.exp(0.499), rel=1e-6)
    rate, when = permeability.fastest(rows)
    assert rate == pytest.approx(0.1 + np.log(3)) and when == 50.5


def test_growth_and_uptake_of_rows():
    rows = {"time_h": np.array([0.0, 2.0, 4.0]), "aggregate_area_um2": np.exp([0.0, 0.4, 0.6]),
            "mean_velocity_m_per_d": np.array([2.0, 1.0, 0.5]),
            "effluent_acceptor_mg_per_L": np.array([9.0, 6.0, 2.0])}
    assert permeability.specific_growth(rows) == pytest.approx([0.2, 0.1])
    assert permeability.consumed(rows) == pytest.approx([2.0, 4.0, 4.0])


def test_a_permeable_run_has_the_drag_and_nothing_of_the_viscosity():
    flow = scene(*rheology.permeable(rheology.AGGREGATE, 0.25)).flow
    assert (flow.biomass, flow.viscosity_ratio, flow.permeability) == ("brinkman", None, pytest.approx(0.25, rel=1e-6))
    assert 'numerics.elements = "quadratic"' in rheology.refused()
    assert rheology.equivalent(rheology.AGGREGATE) == pytest.approx(50.0**2 / 12 / 2000)
    assert runs.PERMEABILITIES[1] == pytest.approx(1e-12 * rheology.equivalent(rheology.PLUG))


def test_what_a_variant_changes_is_measured_against_the_paper(monkeypatch):
    """Nothing for the paper's own run; the area that only one covers for another one."""
    ours, bigger = HOUR, ("base", 'aggregate.radius="6 um"', *HOUR[1:])
    monkeypatch.setattr(rheology, "WHOLE", ours)
    monkeypatch.setattr(rheology, "END", 1.0)
    assert rheology.slid(ours) == (0, 0, 0) and rheology.conductivity_change(ours, (1.0,)) == 0
    areas = [polygon_area(bodies(chosen)[-1].outline.points) for chosen in (ours, bigger)]
    assert rheology.slid(bigger)[1] == pytest.approx(100 * (areas[1] / areas[0] - 1), rel=0.02)
    assert rheology.conductivity_change(bigger, (1.0,)) < 0
    times = {ours: 10.0, bigger: 9.0}
    monkeypatch.setattr(rheology, "contact", lambda run: times[run])
    monkeypatch.setattr(rheology, "conductivity_change", lambda run: -6.0)
    checks = rheology._changes("x", bigger)
    assert [check.value for check in checks[1:]] == pytest.approx([10.0, 6.0])
    assert not any(check.holds for check in checks) and all(check.converges for check in checks)


def test_an_outline_that_has_slid_is_moved_back(monkeypatch):
    """By 8 um downstream: what is judged is what is left."""
    here = bodies(HOUR)[-1].outline
    there = replace(here, points=here.points + [8.0, 0.0])
    outlines = {rheology.WHOLE: here, HOUR: there}
    monkeypatch.setattr(rheology, "body", lambda run, time: SimpleNamespace(outline=outlines[run]))
    moved, where, left = rheology.slid(HOUR)
    assert (moved, left) == pytest.approx((8.0, 0.0), abs=1e-6) and where > 10
    monkeypatch.setattr(rheology, "contact", lambda run: 1.0)
    monkeypatch.setattr(rheology, "conductivity_change", lambda run: 1.0)
    assert rheology._changes("x", HOUR)[0].value == left


def test_the_conductivity_after_contact_is_a_geometric_mean(monkeypatch):
    """2 and 18 are 6, three times 1 and 4; hours are those of the sensitivities, to the end of wide."""
    found = {(rheology.WHOLE, 35.0): 1.0, (rheology.WHOLE, 45.0): 4.0, (HOUR, 35.0): 2.0, (HOUR, 45.0): 18.0}
    monkeypatch.setattr(rheology, "at", lambda run, hour: {"conductivity_m_per_d": found[run, hour]})
    assert rheology.conductivity_change(HOUR, (35.0, 45.0)) == pytest.approx(200.0)
    said = scene(*rheology.WHOLE)
    assert {5, 10, 15, 20, 25, 30, 31, 32, 33, 34, *rheology.AFTER, rheology.END} == set(said.output.times)
    assert (rheology.AFTER[0], rheology.AFTER[-1]) == (wide.HOURS[0], wide.HOURS[-1]) == (35.0, said.growth.end)


def test_film_and_angle_do_nothing_until_the_opposite_wall_is_near():
    """A run with them goes on from one without them, bit for bit as one of its own; another change begins at t = 0."""
    plain = ("wide", *until(33))
    begun = history(*plain).far
    assert 0.7 < begun.pore.boundary.thickness / 100 <= NEAR
    for name in ("film doubled", "angle doubled"):
        changed = (*plain, rheology.VARIANTS[name])
        *_, (own, _) = steps(scene(*changed))
        (end,) = history(*changed).instants
        assert np.array_equal(end.pore.mesh.points, own.pore.mesh.points) and end.pore.time == 33
        assert end.pore.mass == own.pore.mass
    late = [name for name, change in rheology.VARIANTS.items() if change.startswith(LATE)]
    assert late == ["film halved", "film doubled", "angle halved", "angle doubled"]
    assert history(*HOUR, 'numerics.fixed_point="rechosen"').instants[0].pore.time == 0


def test_the_least_of_a_field_is_sought_between_its_nodes():
    """Of the distance from a place in the middle of a triangle; a node is 0.2 of the thickness from it, or more."""
    found = bodies(HOUR)[-1]
    corners = found.grid.points[found.triangles[:, :3]]
    place = corners[np.ptp(corners[..., 1], axis=1).argmax()].mean(axis=0)
    apart = ((found.pore.space.points - place) ** 2).sum(axis=1)
    assert abs(growth_pattern.least_of(found, apart)) < 0.02 * apart[found.grid.body].min()


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
    assert later.pore.time == found.pore.time


def test_the_largest_tension_is_told_with_its_place():
    found = bodies(HOUR)[-1]
    values = found.cell("largest_principal_stress_MPa")
    size, *place, hours = fluid_and_aggregate.tension(found)
    assert (size, hours) == (values.max(), 1.0)
    corners = found.grid.points[found.triangles[int(np.argmax(values))]]
    assert (corners.min(axis=0) < place).all() and (place < corners.max(axis=0)).all()


def test_the_mean_of_a_stress_is_over_area_and_distance():
    """Of a field linear in x: its value at a place about which the points lie alike, whatever weighs there; the mean by
    area where all is near."""
    points = np.array([[-1.0, 0.0], [1.0, 0.0], [9.0, 0.0]])
    field = fluid_and_aggregate.Stress(points, np.array([2.0, 2.0, 1.0]), np.repeat(points[:, :1], 4, axis=1))
    assert field.within(2.0, np.array([[0.0, 0.0], [8.5, 0.0]]))[:, 0] == pytest.approx([0.0, 9.0], abs=1e-12)
    assert field.within(20.0, np.zeros((1, 2)))[0] == pytest.approx(9.0 / 5.0)


def test_a_stress_is_that_of_the_fields_and_stands_for_all_of_the_aggregate():
    """The mean over all of it is that of the triangles' means, which are over the areas of t = 0."""
    found = bodies(HOUR)[-1]
    stress, areas = fluid_and_aggregate.stress_of(found), found.areas[found.grid.biomass]
    cells = restored_stress(found, found.scene.growth.shear_modulus)
    assert stress.areas.sum() == pytest.approx(areas.sum(), rel=1e-9)
    whole = stress.within(100.0, np.zeros((1, 2)))[0]
    assert whole == pytest.approx(areas @ cells / areas.sum(), abs=0.01 * np.abs(cells).max())
    assert np.ptp(cells[:, 3]) < 1.5 * np.ptp(stress.values[:, 3])


def test_the_peak_is_taken_at_places_of_its_own_in_the_aggregate():
    """Of a lattice through the origin, on the wall too; the mean over more is less than a triangle's largest."""
    found = bodies(HOUR)[-1]
    places = fluid_and_aggregate.lattice(found, 0.5)
    assert np.allclose(places, 0.5 * np.round(places / 0.5)) and places[:, 1].min() == 0
    assert len(places) == pytest.approx(polygon_area(found.outline.points) / 0.25, rel=0.2)
    most, wide = fluid_and_aggregate.peak(found).value, fluid_and_aggregate.peak(found, 2.0).value
    assert 1.2 * wide < most <= fluid_and_aggregate.tension(found)[0] / found.scene.growth.shear_modulus
    mean = fluid_and_aggregate.stress_of(found).within(100.0, np.zeros((1, 2)))[0]
    assert wide == pytest.approx(float(largest_principal(mean)), rel=1e-9)


def test_the_exponent_is_that_of_the_stress_that_is_added(monkeypatch):
    """1 / r about a place, on top of any other stress."""
    free, forced = bodies(HOUR)[0], bodies(HOUR)[-1]
    plane, place = np.random.default_rng(1).uniform(-50, 50, (200_000, 2)), np.array([3.0, 0.0])
    other = np.full((len(plane), 4), 5.0)
    added = other + np.outer(1 / np.hypot(*(plane - place).T), [0, 0, 0, 1])
    monkeypatch.setattr(fluid_and_aggregate, "stress_of", lambda body: fluid_and_aggregate.Stress(
        plane, np.ones(len(plane)), other if body is free else added))
    assert fluid_and_aggregate.exponent(free, forced, place) == pytest.approx(-1.0, abs=0.02)


def test_sherwood_numbers_follow_the_flow_and_hardly_the_supply():
    """From ten K_s to one, nearly of first order, by less than the few percent of C39."""
    usual, faster, poorer = (np.array(discussed.sherwood(discussed.in_one_shape(**given)))
                             for given in ({}, {"head": 1e-2}, {"supply": 1.0}))
    assert (faster > 2 * usual).all() and poorer == pytest.approx(usual, rel=0.05)


# The figures.
@pytest.fixture(scope="module")
def curved(tmp_path_factory):
    """A short run of wide with curved triangles."""
    folder = tmp_path_factory.mktemp("runs") / "wide"
    run(load_scene("wide", ['numerics.preset="fast"', 'growth.end="1 h"', 'output.times=["1 h"]']), folder)
    return folder


def test_curved_triangles_are_drawn_in_four_straight_ones(curved):
    """All counterclockwise, the aggregate's area to the bulge of its arcs, its rim through their middles: 16
    chords of a half-circle leave 0.64 % out, the 8 between corners 2.6 %."""
    state, row = states.last(curved), states.row(curved, 1.0)
    assert triangle_areas(state.points, state.triangles).min() > 0
    assert polygon_area(state.rim) == pytest.approx(row["aggregate_area_um2"], rel=1e-2)
    assert set(np.unique(state.triangles)) == set(range(len(state.points)))
    assert len(state.cells["theta"]) == len(state.triangles) == len(state.biomass)


def test_contact_is_read_from_the_rows(curved, monkeypatch):
    module = import_module("paper_figures.discussion_rheology")
    assert module.contact(curved) == np.inf
    rows = {"time_h": np.array([0.0, 1.0, 2.0]), "contact": np.array([0.0, 1.0, 1.0])}
    monkeypatch.setattr(states, "series", lambda folder: rows)
    assert module.contact(curved) == 1.0
