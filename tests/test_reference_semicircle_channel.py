"""Exact solutions fitted to semicircles on the walls of a channel (reference/semicircle_channel.py)."""
import numpy as np
import pytest

from reference import semicircle_channel


@pytest.mark.parametrize("radius, facing", [(0.1, False), (0.5, False), (0.9, False), (0.25, True)])
def test_the_velocity_vanishes_on_the_walls_and_more_terms_change_nothing(radius, facing, monkeypatch):
    loss, residual = semicircle_channel.excess_loss(radius, facing)
    for name in ("WAVES", "POWERS"):
        monkeypatch.setattr(semicircle_channel, name, 40)
    assert residual < 1e-5 and semicircle_channel.excess_loss(radius, facing)[0] == pytest.approx(loss, rel=1e-6)


def test_the_loss_of_a_semicircle_does_not_depend_on_the_period():
    near, far = (semicircle_channel.excess_loss(0.4, clear=clear)[0] for clear in (3.0, 4.0))
    assert near == pytest.approx(far, rel=1e-5)


def test_the_loss_of_a_slight_semicircle_is_proportional_to_its_area():
    """Near a wall the flow is a shear, and the semicircle adds dissipation in an area of the order of its own."""
    losses = [semicircle_channel.excess_loss(radius)[0] for radius in (0.02, 0.04)]
    assert np.log2(losses[1] / losses[0]) == pytest.approx(2, abs=0.1)


def test_a_narrow_gap_has_the_loss_of_extended_lubrication_theory():
    """The remainder is of the order 5/2 of the gap, the water beside the film; without the second term it is one."""
    gaps = np.array([0.1, 0.08, 0.06])
    loss = np.array([semicircle_channel.excess_loss(1 - gap)[0] for gap in gaps])
    remainders = [np.abs(loss / [semicircle_channel.film(1 - gap, gap, terms) for gap in gaps] - 1) for terms in (2, 1)]
    orders = [np.diff(np.log(values)) / np.diff(np.log(gaps)) for values in remainders]
    assert orders[0] == pytest.approx([2.45, 2.45], abs=0.1) and (orders[1] < 1.1).all()
