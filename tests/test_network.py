"""The law for networks: its values and bounds, its refusals, its independence of velocity, head and width, and fifty
shapes outside of its fit."""
import csv

import numpy as np
import pytest

import repro
from repro.network.resistance import CONTACT, TABLE, share_range
from repro.network.uptakes import TRANSPORTS, UPTAKE_BOUND
from verification.network import __main__ as command
from verification.network import law, page, shapes, uptakes
from verification.network.shapes import RATIOS

LAMBDA = 2000.0


def resistance(scene) -> float:
    """r of a scene, from its columns: (K_clean / K - 1) L / W, and K_clean of the same pore without aggregate."""
    results, pore = repro.solve(scene), scene.pore
    clean = 24e-6 * scene.flow.gravity * pore.width**2 / (12 * scene.flow.kinematic_viscosity)
    return float(clean / results["conductivity_m_per_d"][0] - 1) * pore.length / pore.width


def scene(width, position=0.0, drive=("mean_velocity", "1 m/d")):
    return repro.load_scene({
        "pore": {"width": f"{width} um", "length": f"{12 * width} um"},
        "aggregate": {"radius": f"{0.6 * width} um", "position": f"{position * width} um"},
        "flow": dict([drive])}, ["numerics.preset=fast"])


def test_velocity_head_width_and_position_drop_out():
    """Agreement is to rounding, except for another position, which has another mesh."""
    reference = resistance(scene(100.0))
    assert reference == pytest.approx(12.2, rel=0.01)
    for other in (scene(100.0, drive=("mean_velocity", "30 m/d")), scene(100.0, drive=("head", "1e-3 cm")),
                  scene(50.0)):
        assert resistance(other) == pytest.approx(reference, rel=1e-9)
    assert resistance(scene(100.0, position=1.7)) == pytest.approx(reference, rel=law.NUMERICS)
    body = shapes.half_disc(0.6, elements=shapes.QUICK)
    assert shapes.added_length(body.space, LAMBDA) == pytest.approx(reference, rel=1e-9)


@pytest.mark.parametrize("spanned", [False, True])
def test_the_law_equals_the_table_at_its_rows(spanned):
    """At every row of `resistance.csv` the law and its bounds agree to round-off."""
    with TABLE.open(encoding="utf-8", newline="") as lines:
        rows = [[*map(float, row.values())] for row in csv.DictReader(lines) if row["spanned"] == str(int(spanned))]
    assert len(rows) > 50
    for selected in RATIOS:
        share, length, least, most = np.array([numbers for _, ratio, *numbers in rows if ratio == selected]).T
        computed = np.array(repro.added_resistance(share, 1.0, spanned, selected))
        assert computed == pytest.approx(np.array([length, least * length, most * length]), rel=1e-12)


@pytest.mark.parametrize("thickness", [0.825, 0.84, 0.91])
def test_the_law_between_the_rows_agrees_with_half_discs(thickness):
    """In thickness and lambda, within the error of the elements. Linear interpolation between rows errs by 2 %."""
    body = shapes.half_disc(thickness)
    for ratio in (330.0, 1400.0, 3300.0):
        length = repro.added_resistance(body.boundary.area, body.mesh.width, False, ratio).length
        assert length == pytest.approx(shapes.added_length(body.space, ratio), rel=law.NUMERICS)


def test_the_law_grows_with_area_and_lambda_and_lies_within_its_bounds():
    """This also holds between the rows of the table."""
    for spanned in (False, True):
        share = np.geomspace(*share_range(spanned), 200)
        laws = [repro.added_resistance(share, 1.0, spanned, ratio) for ratio in np.geomspace(100, 10000, 12)]
        for one_law in laws:
            assert (np.diff(one_law.length) > 0).all()
            assert (one_law.least < one_law.length).all() and (one_law.length < one_law.most).all()
        assert all((after.length > before.length).all() for before, after in zip(laws, laws[1:]))


def test_a_plug_resists_less_than_one_with_straight_ends():
    """Straight ends add exactly (lambda - 1) A / W^2. Rounded ends reduce this as if the plug were 0.3 to 0.65 W
    shorter."""
    points = np.array([[-0.5, 0.0], [-0.5, 1.0], [0.5, 1.0], [0.5, 0.0]])
    assert shapes.added_length(shapes.drawn(points).space, LAMBDA) == pytest.approx(LAMBDA - 1, rel=1e-6)
    share = np.linspace(1.6, 4.5, 40)
    passed = share - repro.added_resistance(share, 1.0, True, LAMBDA).length / (LAMBDA - 1)
    assert 0.3 < passed.min() and passed.max() < 0.65


def test_arrays_of_pores_and_numbers():
    """Each pore has its own result, whatever the unit of length."""
    width, spanned = np.array([[50.0], [100.0]]), np.array([[0], [1]])
    area = np.array([[500.0, 2000.0, 3500.0], [17000.0, 25000.0, 44000.0]])
    computed = repro.added_resistance(area, width, spanned, outside="nan")
    for index, share in np.ndenumerate(area / width**2):
        expected = repro.added_resistance(1e-8 * share * 9, 3e-4, bool(spanned[index[0], 0]), LAMBDA)
        assert np.shape(expected.length) == ()
        assert [values[index] for values in computed] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("area, spanned, ratio, message", [
    (1.6, False, LAMBDA, "throat 1: area / width^2 before contact (spanned=False) = 1.6 is not known; 0 to 1.509 is "),
    (1.4, True, LAMBDA, "throat 1: area / width^2 of a plug (spanned=True) = 1.4 is not known; 1.41 to 4.5 is "),
    (5.0, True, LAMBDA, "throat 1: area / width^2 of a plug (spanned=True) = 5 "),
    (float("nan"), True, LAMBDA, "throat 1: area / width^2 of a plug (spanned=True) = nan "),
    (-1.0, None, LAMBDA, "throat 1: area / width^2 = -1 is not known; 0 to 4.5 is accepted"),
    (5.0, None, LAMBDA, "throat 1: area / width^2 = 5 "),
    (1.0, False, 99.0, "viscosity_ratio = 99 is not known; 100 to 1e+04 is accepted"),
    (1.0, False, 1.1e4, "viscosity_ratio = 11000 "), (1.0, False, float("nan"), "viscosity_ratio = nan ")])
def test_arguments_outside_of_the_table_are_refused(area, spanned, ratio, message):
    """The message is one line and has the index of the throat. With outside="nan" that throat alone has no result."""
    areas = [1.0 + bool(spanned), area]
    with pytest.raises(ValueError) as error:
        repro.added_resistance(areas, 1.0, spanned, ratio)
    assert str(error.value).startswith(f"added_resistance: {message}") and "\n" not in str(error.value)
    if ratio == LAMBDA:
        without = np.isnan(repro.added_resistance(areas, 1.0, spanned, ratio, outside="nan"))
        assert without.tolist() == [[False, True]] * 3


@pytest.mark.parametrize("width", [0.0, -50.0, float("nan")])
def test_a_pore_without_width_is_refused(width):
    areas, widths = np.full((2, 2), 2500.0), [[100.0, 100.0], [width, 100.0]]
    with pytest.raises(ValueError, match=r"^added_resistance: throat 1, 0: width = .* is not known; more than zero is"):
        repro.added_resistance(areas, widths, False)
    without = np.isnan(repro.added_resistance(areas, widths, outside="nan").length)
    assert without.tolist() == [[False, False], [True, False]]
    with pytest.raises(ValueError, match="^added_resistance: outside = 'skip' is not known; 'raise' or 'nan' is acc"):
        repro.added_resistance(areas, 100.0, outside="skip")


def test_an_empty_pore_adds_nothing_and_thin_bodies_follow_half_discs():
    """Below the table's first thickness, 0.05 W, the law is within 0.4 % of half-discs and continuous."""
    assert (np.array(repro.added_resistance(0.0, 50.0)) == 0).all()
    for thickness in (0.01, 0.025, 0.04):
        one = shapes.sample(shapes.half_disc(thickness), (100.0, LAMBDA))
        for ratio, length in zip(one.ratios, one.lengths):
            assert repro.added_resistance(one.share, 1.0, False, ratio).length == pytest.approx(length, rel=4e-3)
    first = share_range(False)[0]
    below, above = (np.array(repro.added_resistance(first * (1 + side), 1.0)) for side in (-1e-9, 1e-9))
    assert below == pytest.approx(above, rel=1e-7)


@pytest.mark.parametrize("contact_is_given", [False, True])
def test_shapes_near_contact_are_within_the_bounds(contact_is_given):
    """These are shapes of the fit and shapes that it does not include, with contact and without it."""
    outside, kinds = [], []
    for unseen in (False, True):
        columns = law.read(unseen)
        near = (columns["area_over_width2"] >= CONTACT[0]) & (columns["area_over_width2"] <= CONTACT[1])
        for _, _, spanned, ratio, share, length in zip(*(columns[name][near] for name in law.COLUMNS)):
            one = repro.added_resistance(share, 1.0, bool(spanned) if contact_is_given else None, ratio)
            kinds.append(spanned)
            if not one.least <= length <= one.most:
                outside.append((share, ratio, length / one.length))
    assert outside == []
    assert kinds.count(1) >= 10 and kinds.count(0) >= 10


@pytest.mark.thorough
def test_the_constants_of_the_uptake_are_those_of_the_fit():
    """Their squares are those of a fit to the committed states from another start; the bound follows from their
    largest error."""
    states = uptakes.read(uptakes.FIT)
    assert uptakes.is_fit(states, TRANSPORTS)
    assert uptakes.bound(states, TRANSPORTS) == UPTAKE_BOUND


def test_uptakes_outside_of_the_fit_are_within_the_bound():
    """Fifty half-discs and grown shapes of another seed, before contact and after it."""
    states = uptakes.read(uptakes.NEW)
    apart, bound = uptakes.judged()
    assert len(apart) == 50 and (apart <= bound).all()
    assert (states["grown"].sum(), states["spanned"].sum()) == (25, 4)
    assert np.median(apart) < 0.01 and np.median(bound) < 0.1


def test_growth_follows_from_the_uptake():
    """(7)-(10): biomass made = Y donor - (acceptor - F donor) / d_c; without donor the aggregate decays."""
    kinetics = repro.load_scene("base").kinetics
    taken = repro.uptake([100.0, 3000.0, 9000.0], 60.0, 0.5, 8.0, [1e-4, 5.0, 5.0])
    decayed = (taken.acceptor - 1.52 * taken.donor) / kinetics.decay_oxygen_demand
    made = kinetics.yield_coefficient * taken.donor - decayed
    assert taken.growth == pytest.approx(made / kinetics.maximum_density, rel=1e-12)
    assert taken.growth[0] < 0 < taken.growth[1]


@pytest.mark.parametrize("area", [500.0, 4000.0])
@pytest.mark.parametrize("zeros", [(0,), (1,), (2,), (3,), (2, 3), (0, 3), (1, 3)])
def test_the_uptake_at_a_zero_is_the_limit(zeros, area):
    """Area, velocity, acceptor and donor, alone and in pairs, before contact and after it. Decay takes up acceptor
    without donor."""
    arguments = np.array([area, 1.0, 8.0, 5.0])
    at_zero, near = np.array([0.0, 1e-9]) * arguments[list(zeros)][:, None], []
    for column in at_zero.T:
        arguments[list(zeros)] = column
        near.append(repro.uptake(arguments[0], 50.0, *arguments[1:]))
    largest = 1e-6 * np.array(repro.uptake(area, 50.0, 1.0, 8.0, 5.0))[:3]
    assert np.array(near[0]) == pytest.approx(np.array(near[1]), rel=2.0**-12, abs=largest.max())
    assert near[0].bound == pytest.approx(near[1].bound, rel=1e-6) and near[0].bound >= UPTAKE_BOUND
    assert (near[0].acceptor > 0) == (zeros == (3,))


@pytest.mark.parametrize("values, message", [
    ((100.0, 30.0, 1.0, 8.0, 5.0), "width = 30 is not known; 40 to 150 is accepted"),
    ((1e5, 60.0, 1.0, 8.0, 5.0), "area / width^2 = 27.7778 "), ((100.0, 60.0, -1.0, 8.0, 5.0), "velocity = -1 "),
    ((100.0, 60.0, 1.0, 8.0, float("nan")), "donor = nan is not known; 0 to 20 is accepted")])
def test_uptakes_outside_of_the_range_are_refused(values, message):
    columns = [[good, bad] for good, bad in zip((100.0, 60.0, 1.0, 8.0, 5.0), values)]
    with pytest.raises(ValueError) as error:
        repro.uptake(*columns)
    assert str(error.value).startswith(f"uptake: throat 1: {message}")
    assert np.isnan(repro.uptake(*columns, outside="nan")).tolist() == [[False, True]] * 4


def test_the_page_shows_the_present_table():
    verdict = law.judged(law.read(unseen=True))
    assert command.PAGE.read_text(encoding="utf-8") == page.text()
    assert (verdict.count, verdict.inside) == (50, 50)
