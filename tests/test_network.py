"""The law for networks: what it says, what it refuses, that velocity, head and width drop out, its bounds, and fifty
shapes that its fit has not seen."""
import csv
from itertools import islice

import numpy as np
import pytest

import repro
from repro.results import read_table
from repro.results.network import TABLE, known
from verification.network import __main__ as command
from verification.network import law, shapes
from verification.network.shapes import RATIOS

LAMBDA = 2000.0


def added(scene) -> float:
    """r of a scene, from its columns: (K_clean / K - 1) L / W, and K_clean of the same pore without aggregate."""
    found, pore = repro.solve(scene), scene.pore
    clean = 24e-6 * scene.flow.gravity * pore.width**2 / (12 * scene.flow.kinematic_viscosity)
    return float(clean / found["conductivity_m_per_d"][0] - 1) * pore.length / pore.width


def scene(width, position=0.0, drive=("mean_velocity", "1 m/d")):
    return repro.load_scene({
        "pore": {"width": f"{width} um", "length": f"{12 * width} um"},
        "aggregate": {"radius": f"{0.6 * width} um", "position": f"{position * width} um"},
        "flow": dict([drive])}, ["numerics.preset=fast"])


def test_velocity_head_width_and_place_drop_out():
    """To rounding but for the place, where the mesh is another."""
    one = added(scene(100.0))
    assert one == pytest.approx(12.2, rel=0.01)
    for other in (scene(100.0, drive=("mean_velocity", "30 m/d")), scene(100.0, drive=("head", "1e-3 cm")),
                  scene(50.0)):
        assert added(other) == pytest.approx(one, rel=1e-9)
    assert added(scene(100.0, position=1.7)) == pytest.approx(one, rel=law.NUMERICS)
    now = shapes.half_disc(0.6, elements=shapes.QUICK)
    assert shapes.added_length(now.space, LAMBDA) == pytest.approx(one, rel=1e-9)


@pytest.mark.parametrize("thickness", [0.05, 0.8])
def test_the_table_has_half_discs_of_the_present_code(thickness):
    """As in `network.csv`. Meshes of another machine may differ in rounding, by which Mmg makes other triangles: within
    what the elements err by."""
    now, table = shapes.half_disc(thickness), read_table(TABLE)
    share = now.boundary.area / now.mesh.width**2
    for ratio in (RATIOS[0], LAMBDA, RATIOS[-1]):
        apart = np.abs(table["area_over_width2"] - share)
        row = np.where((table["spanned"] == 0) & (table["viscosity_ratio"] == ratio), apart, np.inf).argmin()
        assert apart[row] <= 1e-4 * share
        found = table["added_length_over_width"][row]
        assert found == pytest.approx(shapes.added_length(now.space, ratio), rel=law.NUMERICS / 4)


def test_the_recorded_shapes_that_the_fit_has_not_seen_are_those_of_the_present_code():
    """The first of each kind that no run makes; the page tells that all fifty lie within the bounds."""
    drawn = [0, law.HALF_DISCS, law.HALF_DISCS + law.DRAWN_BODIES]
    present = list(islice(law.new_shapes(), drawn[-1] + 1))
    columns = law.read(unseen=True)
    for row in drawn:
        recorded = [columns[name][row] for name in law.COLUMNS]
        assert law.shape_row(present[row], 1) == pytest.approx(recorded, rel=law.NUMERICS)


@pytest.mark.thorough
def test_fifty_shapes_that_the_fit_has_not_seen_are_within_the_bounds():
    """Half-discs, drawn bodies and plugs, and what three runs make, each at a lambda of its own."""
    found = list(law.new_shapes())
    rows = [law.shape_row(one, 1) for one in found]
    columns = {name: np.array(values, float) for name, values in zip(law.COLUMNS, zip(*rows))}
    judged = law.judged(columns)
    outside = [(one, float(beyond)) for one, beyond in zip(found, judged.beyond) if beyond > 1]
    assert judged.count == 50 and outside == []
    assert 20 <= columns["grown"].sum() and 8 <= columns["spanned"].sum() <= 30
    assert {one.run for one in found}.isdisjoint(law.RUNS)
    assert np.median(np.abs(judged.apart)) < 0.02


@pytest.mark.parametrize("spanned", [False, True])
def test_in_the_table_it_is_the_table(spanned):
    """At every row of `network.csv`, its bounds over it too, to round-off."""
    with TABLE.open(encoding="utf-8", newline="") as lines:
        rows = [[*map(float, row.values())] for row in csv.DictReader(lines) if row["spanned"] == str(int(spanned))]
    assert len(rows) > 50
    for chosen in RATIOS:
        share, length, least, most = np.array([numbers for _, ratio, *numbers in rows if ratio == chosen]).T
        found = np.array(repro.added_resistance(share, 1.0, spanned, chosen))
        assert found == pytest.approx(np.array([length, least * length, most * length]), rel=1e-12)


@pytest.mark.parametrize("thickness", [0.825, 0.84, 0.91])
def test_between_the_rows_of_the_table_it_is_what_half_discs_add(thickness):
    """In thickness and in lambda: within what elements err by. Straight lines between the rows are off by 2 %."""
    now = shapes.half_disc(thickness)
    for ratio in (330.0, 1400.0, 3300.0):
        found = repro.added_resistance(now.boundary.area, now.mesh.width, False, ratio).length
        assert found == pytest.approx(shapes.added_length(now.space, ratio), rel=law.NUMERICS)


def test_it_grows_with_area_and_lambda_and_lies_within_its_bounds():
    """Also between the rows of the table."""
    for spanned in (False, True):
        share = np.geomspace(*known(spanned), 200)
        laws = [repro.added_resistance(share, 1.0, spanned, ratio) for ratio in np.geomspace(100, 10000, 12)]
        for each in laws:
            assert (np.diff(each.length) > 0).all()
            assert (each.least < each.length).all() and (each.length < each.most).all()
        assert all((after.length > before.length).all() for before, after in zip(laws, laws[1:]))


def test_a_plug_resists_as_one_with_straight_ends_less_what_its_ends_let_pass():
    """(lambda - 1) A / W^2 exactly with straight ends; ends of W or so let pass what 0.3 to 0.65 W would resist."""
    points = np.array([[-0.5, 0.0], [-0.5, 1.0], [0.5, 1.0], [0.5, 0.0]])
    assert shapes.added_length(shapes.drawn(points).space, LAMBDA) == pytest.approx(LAMBDA - 1, rel=1e-6)
    share = np.linspace(1.6, 4.5, 40)
    passed = share - repro.added_resistance(share, 1.0, True, LAMBDA).length / (LAMBDA - 1)
    assert 0.3 < passed.min() and passed.max() < 0.65


def test_arrays_of_pores_and_numbers():
    """Each pore its own, whatever its unit of length."""
    width, spanned = np.array([[50.0], [100.0]]), np.array([[0], [1]])
    area = np.array([[500.0, 2000.0, 3500.0], [17000.0, 25000.0, 44000.0]])
    found = repro.added_resistance(area, width, spanned)
    for index, share in np.ndenumerate(area / width**2):
        one = repro.added_resistance(1e-8 * share * 9, 3e-4, bool(spanned[index[0], 0]), LAMBDA)
        assert np.shape(one.length) == () and [values[index] for values in found] == pytest.approx(one, rel=1e-12)


def test_a_pore_twice_as_wide_takes_four_times_the_area():
    """For the same resistance."""
    assert repro.added_resistance(1.2, 2.0, False) == pytest.approx(repro.added_resistance(0.3, 1.0, False), rel=1e-12)


@pytest.mark.parametrize("area, spanned, ratio, told", [
    (0.0, False, LAMBDA, "area / width^2 = 0 is not known for a half-disc before contact (spanned=False); 0.003927 "),
    (1.6, False, LAMBDA, "area / width^2 = 1.6 is not known for a half-disc"),
    (1.4, True, LAMBDA, "area / width^2 = 1.4 is not known for a plug (spanned=True); 1.6 to 4.5 is accepted"),
    (5.0, True, LAMBDA, "area / width^2 = 5 "), (float("nan"), True, LAMBDA, "area / width^2 = nan "),
    (1.0, False, 99.0, "viscosity_ratio = 99 is not known for an aggregate; 100 to 1e+04 is accepted"),
    (1.0, False, 1.1e4, "viscosity_ratio = 11000 "), (1.0, False, float("nan"), "viscosity_ratio = nan ")])
def test_what_it_does_not_know_is_refused(area, spanned, ratio, told):
    """In one line."""
    with pytest.raises(ValueError) as error:
        repro.added_resistance([area, 1.0 + spanned], 1.0, spanned, ratio)
    assert str(error.value).startswith(f"added_resistance: {told}") and "\n" not in str(error.value)


@pytest.mark.parametrize("width", [0.0, -50.0, float("nan")])
def test_a_pore_without_width_is_refused(width):
    with pytest.raises(ValueError, match="^added_resistance: width is not known; more than zero is accepted$"):
        repro.added_resistance(2500.0, [100.0, width], False)


def test_the_page_tells_the_present_table():
    found = law.judged(law.read(unseen=True))
    assert command.PAGE.read_text(encoding="utf-8") == law.page(law.read(unseen=False), found)
    assert (found.count, found.inside) == (50, 50)
