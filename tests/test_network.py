"""The law for networks: its values and bounds, its refusals, its independence of velocity, head and width, and fifty
shapes outside of its fit."""
import csv

import numpy as np
import pytest

import repro
from repro.results.network import TABLE, known
from verification.network import __main__ as command
from verification.network import law, shapes
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
    """At every row of `network.csv` the law and its bounds agree to round-off."""
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
        share = np.geomspace(*known(spanned), 200)
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
    computed = repro.added_resistance(area, width, spanned)
    for index, share in np.ndenumerate(area / width**2):
        expected = repro.added_resistance(1e-8 * share * 9, 3e-4, bool(spanned[index[0], 0]), LAMBDA)
        assert np.shape(expected.length) == ()
        assert [values[index] for values in computed] == pytest.approx(expected, rel=1e-12)


def test_a_pore_twice_as_wide_takes_four_times_the_area():
    """Both add the same resistance."""
    assert repro.added_resistance(1.2, 2.0, False) == pytest.approx(repro.added_resistance(0.3, 1.0, False), rel=1e-12)


@pytest.mark.parametrize("area, spanned, ratio, message", [
    (0.0, False, LAMBDA, "area / width^2 = 0 is not known for a half-disc before contact (spanned=False); 0.003927 "),
    (1.6, False, LAMBDA, "area / width^2 = 1.6 is not known for a half-disc"),
    (1.4, True, LAMBDA, "area / width^2 = 1.4 is not known for a plug (spanned=True); 1.6 to 4.5 is accepted"),
    (5.0, True, LAMBDA, "area / width^2 = 5 "), (float("nan"), True, LAMBDA, "area / width^2 = nan "),
    (1.0, False, 99.0, "viscosity_ratio = 99 is not known for an aggregate; 100 to 1e+04 is accepted"),
    (1.0, False, 1.1e4, "viscosity_ratio = 11000 "), (1.0, False, float("nan"), "viscosity_ratio = nan ")])
def test_arguments_outside_of_the_table_are_refused(area, spanned, ratio, message):
    """The message is one line."""
    with pytest.raises(ValueError) as error:
        repro.added_resistance([area, 1.0 + spanned], 1.0, spanned, ratio)
    assert str(error.value).startswith(f"added_resistance: {message}") and "\n" not in str(error.value)


@pytest.mark.parametrize("width", [0.0, -50.0, float("nan")])
def test_a_pore_without_width_is_refused(width):
    with pytest.raises(ValueError, match="^added_resistance: width is not known; more than zero is accepted$"):
        repro.added_resistance(2500.0, [100.0, width], False)


def test_the_page_shows_the_present_table():
    verdict = law.judged(law.read(unseen=True))
    assert command.PAGE.read_text(encoding="utf-8") == law.page(law.read(unseen=False), verdict)
    assert (verdict.count, verdict.inside) == (50, 50)
