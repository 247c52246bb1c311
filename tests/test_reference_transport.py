"""The references of the substrates: closed forms obey their equations, and the other codes do what is said of them."""
import numpy as np
import pytest

from reference import channel_bvp, channel_fipy, diffusion_reaction_pypde, manufactured_transport, robin_channel, slab
from reference.monod import sink, slopes, uptake

RATES = {"k": 0.4, "F": 1.5, "decay": 0.006, "K_A": 1.0, "K_D": 2.0}
GIVEN = (1e5, (10.0, 8.0), (1e7, 4e6), (8e6, 3e6), 3e4, RATES, 40.0)
WATER, BIOMASS = 9e6, 7e6
HALF, SUPPLY = 40.0, 10.0


def second_derivative(function, x, step=1e-3):
    return (function(x + step) - 2 * function(x) + function(x - step)) / step**2


def derivative(function, x, step=1e-4):
    return (function(x + step) - function(x - step)) / (2 * step)


def test_uptake_is_dual_monod_and_its_slopes_are_its_derivative():
    """(7)-(8) written out."""
    q_a, q_d = uptake(3.0, 6.0, RATES)
    assert q_a == pytest.approx(0.75 * (0.4 * 1.5 * 0.75 + 0.006)) and q_d == pytest.approx(0.4 * 0.75 * 0.75)
    fields, load = np.array([3.0, 0.5, 6.0, 0.1]), np.array([2.0, 5.0])
    change = 1e-5 * np.array([1.0, -2.0, 3.0, 1.0])
    rise = sink(fields + change, load, RATES) - sink(fields - change, load, RATES)
    assert slopes(fields, load, RATES) @ (2 * change) == pytest.approx(rise, rel=1e-6)


def test_the_robin_channel_obeys_its_equation_and_its_conditions():
    """Strip, (26) upstream, flux u C_s at any inlet, flat downstream."""
    def c(x):
        return robin_channel.strip(x, 1e5, SUPPLY, WATER, BIOMASS, 2e4, HALF)
    inside, upstream = np.linspace(1.0, 39.0, 20), np.array([-300.0, -30.0, -1.0])
    assert BIOMASS * second_derivative(c, inside) == pytest.approx(
        1e5 * derivative(c, inside) + 2e4 * c(inside), rel=1e-4)
    assert 1e5 * c(upstream) - WATER * derivative(c, upstream) == pytest.approx(np.full(3, 1e5 * SUPPLY), rel=1e-6)
    assert BIOMASS * derivative(c, HALF - 1e-3) == pytest.approx(0.0, abs=1e5) and c(60.0) == c(HALF)
    assert WATER * derivative(c, -1e-3) == pytest.approx(BIOMASS * derivative(c, 1e-3), rel=1e-3)


@pytest.mark.parametrize("film", [0.0, 20.0])
@pytest.mark.parametrize("half_saturation", [0.1, 0.01])
def test_the_monod_slab_obeys_its_equation(half_saturation, film):
    sink_ = 6e5
    found, depth = slab.monod(0.0, SUPPLY, sink_, half_saturation, HALF, BIOMASS, film, WATER)
    def c(x):
        return slab.monod(x, SUPPLY, sink_, half_saturation, HALF, BIOMASS, film, WATER)[0]
    inside = np.linspace(HALF - 0.9 * depth, HALF - 0.1, 12)
    assert BIOMASS * second_derivative(c, inside, 1e-2) == pytest.approx(
        sink_ * c(inside) / (c(inside) + half_saturation), rel=1e-2)
    assert BIOMASS * derivative(c, HALF - 1e-3, 5e-4) == pytest.approx(sink_ * depth, rel=1e-3)
    assert c(HALF + film) == pytest.approx(SUPPLY) and found < 1e-5


def test_the_monod_slab_has_both_limits():
    """K / C_s to zero: zero order, less K / (2 C) ln(1 + C / K); to infinity: first order."""
    zero = slab.penetration(SUPPLY, 3e5, BIOMASS)
    for half_saturation in (1e-2, 1e-4):
        lacking = 1 - slab.monod(0.0, SUPPLY, 3e5, half_saturation, HALF, BIOMASS)[1] / zero
        expected = half_saturation / (2 * SUPPLY) * np.log1p(SUPPLY / half_saturation)
        assert lacking == pytest.approx(expected, rel=1e-2)
    kappa = BIOMASS * (10.0 / HALF) ** 2
    found = slab.monod(30.0, SUPPLY, 1e7 * kappa, 1e7, HALF, BIOMASS)[0]
    assert found == pytest.approx(slab.first_order(30.0, SUPPLY, kappa, HALF, BIOMASS)[0], rel=1e-4)


def test_fipy_and_collocation_differ_by_second_order():
    errors = []
    for cells in (24, 48, 96):
        channel = channel_fipy.Channel(cells, (-40.0, 80.0), *GIVEN)
        errors.append(np.abs(channel.steady() - channel_bvp.strip(channel.x, *GIVEN)).max())
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx([2, 2], abs=0.1)


def test_fipys_transients_end_at_rest_and_backward_euler_is_of_first_order():
    channel = channel_fipy.Channel(24, (-40.0, 80.0), *GIVEN)
    assert channel.transient([0.1])[-1] == pytest.approx(channel.steady(), rel=1e-6)
    times = (1e-4, 3e-4)
    exact = channel.transient(times)
    errors = [np.abs(channel.backward_euler(times, steps) - exact).max(axis=(1, 2)) for steps in (20, 40, 80)]
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(np.ones((2, 2)), abs=0.1)


def test_pypde_matrix_is_its_laplacian_and_its_solution_the_slab():
    """A slab from wall to wall that follows the cells: one-dimensional, first order, of second order in the cell."""
    rates, errors = {"k": 0.0, "F": 1.0, "decay": 1.0, "K_A": 1e9, "K_D": 1.0}, []
    kappa = 4e6 * (2.0 / 8.0) ** 2
    for cells in (8, 16, 32):
        box = diffusion_reaction_pypde.Box(cells, 16.0, 16.0, diffusion_reaction_pypde.block(8.0, 20.0))
        found = box.steady((4e6, 4e6), (SUPPLY, SUPPLY), kappa * 1e9, rates)
        exact = slab.first_order(box.points[:, 0], SUPPLY, kappa, 8.0, 4e6, 8.0, 4e6)[0]
        errors.append(np.abs(found[0] - exact).max())
        assert found[1] == pytest.approx(np.full(len(exact), SUPPLY))
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx([2, 2], abs=0.15)


@pytest.fixture(scope="module")
def chosen():
    return manufactured_transport.fields(50.0, 20.0, 1e5, (1e7, 4e6), (8e6, 3e6), 3e5, RATES)


@pytest.mark.parametrize("side, sample", [("fluid", (30.0, 25.0)), ("biomass", (-6.0, 9.0))])
def test_the_forcing_is_the_strong_form(chosen, side, sample):
    """By differences, with the uptake of reference.monod."""
    u, v = (float(manufactured_transport.function(part)(*sample))
            for part in manufactured_transport.velocity(50.0, 1e5))
    active = 3e5 * (1 + sample[0] / 60) if side == "biomass" else 0.0
    x, y = sample
    sinks = uptake(*(float(chosen[side][k].value(x, y)) for k in (0, 1)), RATES)
    spreads = (8e6, 3e6) if side == "biomass" else (1e7, 4e6)
    for k in (0, 1):
        c = chosen[side][k].value
        bend = second_derivative(lambda a, c=c: c(a, y), x, 1e-2) + second_derivative(lambda b, c=c: c(x, b), y, 1e-2)
        carried = u * derivative(lambda a, c=c: c(a, y), x) + v * derivative(lambda b, c=c: c(x, b), y)
        expected = -spreads[k] * bend + carried + active * sinks[k]
        assert chosen[side][k].forcing(x, y) == pytest.approx(expected, rel=1e-4)
        assert chosen[side][k].flux(x, y)[0] == pytest.approx(
            spreads[k] * derivative(lambda a, c=c: c(a, y), x), rel=1e-6)
