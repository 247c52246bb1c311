"""The averaged pore, a reference of the coupled run, against what is known without it."""
import numpy as np
import pytest

from reference import averaged_pore, channel_bvp, poiseuille
from reference.averaged_pore import Averaged, Pore, Section, half_ellipse

RATES = {"k": 0.4, "F": 1.5, "decay": 0.006, "K_A": 1.0, "K_D": 1.0, "Y": 0.6, "b": 0.005, "remains": 0.001}
SPEED = 1e5


def pore(density=3e4, diffusivity=(1e7, 4e6), in_biomass=(8e6, 3e6), speed=lambda loss, reach: SPEED):
    return Pore(50.0, 600.0, 2000.0, (10.0, 8.0), diffusivity, in_biomass, density, RATES, speed)


def grown(time):
    """(X_A + X_I) over that at the start, at the supply throughout."""
    m_a, m_d = 10 / 11, 8 / 9
    rise, left = m_a * (0.4 * 0.6 * m_d - 0.005), m_a * 0.001
    return np.exp(rise * time) + left / rise * np.expm1(rise * time)


@pytest.mark.parametrize("cells", [2, 7, 40])
def test_the_cells_have_the_area_of_the_half_ellipse(cells):
    lengths, heights = half_ellipse(30.0, 10.0, cells)
    assert lengths @ heights == pytest.approx(np.pi / 2 * 300, rel=1e-14)
    assert lengths.sum() == pytest.approx(60.0) and heights.max() < 10.0
    assert heights == pytest.approx(heights[::-1])


def test_without_biomass_the_supply_is_everywhere():
    found = Averaged(pore(density=0.0), *half_ellipse(20.0, 20.0, 20), 40, keeps_shape=True).seed()
    assert np.abs(found.fields - [[10.0], [8.0]]).max() < 1e-11


def test_a_section_without_aggregate_has_poiseuilles_loss():
    seen = []
    Section(pore(speed=lambda loss, reach: seen.append(loss) or SPEED), -1.0, np.full(4, 0.5), np.zeros(4), 30)
    assert seen == [pytest.approx(poiseuille.head_loss(600.0, 50.0, 1.0, 1.0), rel=1e-13)]


def test_what_is_taken_up_does_not_leave():
    section = Section(pore(), -20.0, *half_ellipse(20.0, 20.0, 20), 40)
    fields = section.steady(np.full(20, 3e4))
    volume = (section.lengths * section.heights)[section.inside]
    taken = [volume @ (3e4 * q) for q in channel_bvp.uptake(*fields[:, section.inside], RATES)]
    assert SPEED * 50 * (np.array([10.0, 8.0]) - fields[:, -1]) == pytest.approx(taken, rel=1e-9)


def test_a_slab_from_wall_to_wall_is_the_strip_in_plug_flow_to_second_order():
    errors = []
    for cells in (10, 20, 40, 80):
        section = Section(pore(), 0.0, np.full(cells, 40.0 / cells), np.full(cells, 50.0), 7 * cells)
        exact = channel_bvp.strip(section.x, SPEED, (10.0, 8.0), (1e7, 4e6), (8e6, 3e6), 3e4, RATES, 40.0)
        errors.append(np.abs(section.steady(np.full(cells, 3e4)) - exact).max())
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(2.0, abs=0.3)
    assert errors[-1] < 2e-3


@pytest.mark.parametrize("keeps_shape", [True, False])
def test_where_nothing_is_scarce_growth_is_the_closed_form(keeps_shape):
    """Both kinds of growth stretch alike."""
    quick = pore(density=1e-3)
    found = Averaged(quick, *half_ellipse(20.0, 5.0, 10), 20, keeps_shape).run((1.0, 3.0), accuracy=1e-5)
    for moment in found:
        right = 20 * np.sqrt(grown(moment.time))
        assert moment.area == pytest.approx(np.pi / 2 * 100 * grown(moment.time), rel=1e-5)
        assert moment.ends == pytest.approx((-right, right), rel=1e-5)
    assert [moment.time for moment in found] == [1.0, 3.0]


def test_a_starved_strip_grows_towards_its_food_and_a_half_disc_does_not_lean():
    strip, disc = (Averaged(pore(density=1e5), *half_ellipse(60.0, 10.0, 20), 20, keeps).run((3.0,), 1e-3)[0]
                   for keeps in (False, True))
    assert -strip.ends[0] > 1.01 * strip.ends[1] and strip.area != disc.area
    assert -disc.ends[0] == pytest.approx(disc.ends[1], rel=1e-12)


def test_the_speed_is_what_head_and_loss_make_it():
    """Under a head the velocity falls as the aggregate grows."""
    seed = Averaged(pore(speed=lambda loss, reach: 3e5 / loss), *half_ellipse(20.0, 20.0, 20), 20, keeps_shape=True)
    first, last = seed.seed(), seed.run((2.0,), accuracy=1e-3)[0]
    assert last.velocity < 0.95 * first.velocity < 0.95 * SPEED


def test_the_constriction_is_that_of_greens_function_in_closed_form():
    """The sum over n is -ln((1 - 2 e^-c cos(a + b) + e^-2c)(1 - 2 e^-c cos(a - b) + e^-2c)) / (4 pi): by random pairs.
    """
    random = np.random.default_rng(1)
    radius, width = 20.0, 50.0
    away, angle = radius * np.sqrt(random.uniform(size=(2, 400_000))), np.pi * random.uniform(size=(2, 400_000))
    (x, far), (a, b) = away * np.cos(angle), np.pi / width * away * np.sin(angle)
    fall = np.exp(-np.pi * np.abs(x - far) / width)
    kernel = sum(np.log(1 - 2 * fall * np.cos(s) + fall**2) for s in (a + b, a - b)) / (-4 * np.pi)
    expected = kernel.mean() * np.pi / 2 * radius**2
    assert averaged_pore.constriction(radius, width) == pytest.approx(expected, rel=5e-3)


def test_the_constriction_scales_as_an_area_and_the_excess_as_one_over_the_diffusivity():
    assert averaged_pore.constriction(8.0, 20.0) == pytest.approx(averaged_pore.constriction(2.0, 5.0) * 16, rel=1e-12)
    one = averaged_pore.excess(pore(), 20.0, SPEED)
    assert (one > 0).all()
    assert averaged_pore.excess(pore(diffusivity=(4e7, 16e6)), 20.0, SPEED) == pytest.approx(one / 4, rel=1e-9)


def test_an_iteration_that_does_not_rest_is_an_error(monkeypatch):
    monkeypatch.setattr(averaged_pore, "MOST", 1)
    with pytest.raises(RuntimeError, match="do not come to rest"):
        Averaged(pore(), *half_ellipse(20.0, 20.0, 20), 40, keeps_shape=True).seed()
