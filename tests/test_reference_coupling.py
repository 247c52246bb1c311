"""The averaged pore, a reference of the coupled run, against what is known without it."""
import numpy as np
import pytest

from reference import averaged_pore, channel_bvp
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


def test_an_iteration_that_does_not_rest_is_an_error(monkeypatch):
    monkeypatch.setattr(averaged_pore, "MOST", 1)
    with pytest.raises(RuntimeError, match="do not come to rest"):
        Averaged(pore(), *half_ellipse(20.0, 20.0, 20), 40, keeps_shape=True).seed()
