"""Dual Monod kinetics (7)-(10): values against the paper's formulas, derivatives, bounds, and what is below zero."""
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from repro.model import kinetics
from tests import oracles
from tests.strategies import between, concentrations, constants, scene, scenes

SCENE = scene(head="1e-3 cm")
DAY = 24.0
SATURATIONS = (1.0, 0.3, 20.0)
LAWS = scenes(drives=("none",))  # any constants


def uptake(acceptor, donor, made=SCENE, extended=False):
    """(q_A, q_D)."""
    at = np.asarray(acceptor, float), np.asarray(donor, float)
    return kinetics.uptake(*at, made.substrates, made.kinetics, extended)


def uptake_slopes(acceptor, donor, made=SCENE, extended=False):
    at = np.asarray(acceptor, float), np.asarray(donor, float)
    return kinetics.uptake_slopes(*at, made.substrates, made.kinetics, extended)


def growth_rate(acceptor, donor, made):
    return kinetics.growth_rate(acceptor, donor, made.substrates, made.kinetics)


def inert_rate(acceptor, made):
    return kinetics.inert_rate(acceptor, made.substrates, made.kinetics)


def saturations(made):
    return np.array([made.substrates.acceptor.half_saturation, made.substrates.donor.half_saturation])


@given(LAWS, concentrations, concentrations)
def test_the_rates_are_those_of_the_paper(made, acceptor, donor):
    F1, F2, F3, F4 = oracles.rates(acceptor, donor, **constants(made))
    q_a, q_d = uptake(acceptor, donor, made)
    assert (-q_a, -q_d) == pytest.approx((F1, F2), rel=1e-13, abs=1e-300)
    assert growth_rate(acceptor, donor, made) == pytest.approx(F3, rel=1e-12, abs=1e-17)
    assert inert_rate(acceptor, made) == pytest.approx(F4, rel=1e-13, abs=1e-17)


@given(LAWS, concentrations, concentrations)
def test_the_oxygen_demand_of_the_donor_is_spent_or_kept(made, acceptor, donor):
    """|F1| + d_c (F3 + F4) = (F + Y d_c) |F2| at all concentrations: what decay takes is what the biomass loses."""
    k = made.kinetics
    q_a, q_d = uptake(acceptor, donor, made)
    kept = k.decay_oxygen_demand * (growth_rate(acceptor, donor, made) + inert_rate(acceptor, made))
    demand = k.acceptor_to_donor_ratio + k.yield_coefficient * k.decay_oxygen_demand
    terms = demand * q_d + k.decay_oxygen_demand * k.decay_coefficient * acceptor / (acceptor + saturations(made)[0])
    assert q_a + kept == pytest.approx(demand * q_d, rel=1e-14, abs=1e-14 * terms + sys.float_info.min)


def test_the_numbers_of_section_4():
    """At 10 K_s of both the biomass doubles in 3.6 h; decay alone, under plenty of acceptor, halves X_A in 5.8 d (C09).
    """
    doubling = np.log(2) / kinetics.growth_rate(10.0, 10.0, SCENE.substrates, SCENE.kinetics)
    assert doubling == pytest.approx(24 * np.log(2) / (10 / 11 * (9.3 * 0.61 * 10 / 11 - 0.12)), rel=1e-13)
    halving = -np.log(2) / kinetics.growth_rate(1e9, 0.0, SCENE.substrates, SCENE.kinetics) / DAY
    assert halving == pytest.approx(5.8, rel=5e-3)


@given(st.sampled_from(SATURATIONS), st.floats(0.01, 100.0))
def test_monod_is_bounded_and_half_at_its_constant(half, concentration):
    m, slope = kinetics.monod(np.array([0.0, half, concentration]), half)
    assert m[0] == 0 and m[1] == pytest.approx(0.5, rel=1e-15) and 0 < m[2] < 1
    assert slope == pytest.approx((1 - m) ** 2 / half, rel=1e-12)


@pytest.mark.parametrize("extended", [False, True])
@given(LAWS, between(0.01, 100.0), between(0.01, 100.0))
def test_the_jacobian_is_the_derivative(extended, made, acceptor, donor):
    """Of F1, F2 and, with Y, F3, by central differences of order 4 in C / (C + K), good to about 1e-12 of the rates."""
    half = saturations(made)
    place = half * [acceptor, donor]
    scale = half + place
    slopes = np.array(uptake_slopes(*place, made, extended)) * scale
    found = oracles.derivative(lambda c: np.array(uptake(*(c * scale), made, extended)), place / scale, 1e-3)
    assert slopes == pytest.approx(found, abs=1e-10 * np.abs(slopes).max())
    k, m_slope = made.kinetics, half * [1.0, 0.0] / scale
    growth = k.yield_coefficient * slopes[1] - k.decay_coefficient * m_slope
    found = oracles.derivative(lambda c: growth_rate(*(c * scale), made), place / scale, 1e-3)
    assert growth == pytest.approx(found, abs=1e-10 * np.abs(slopes).max())


@pytest.mark.parametrize("extended", [False, True])
@given(LAWS, between(0.01, 100.0), between(0.01, 100.0), st.sampled_from([(-1, 1), (1, -1), (-1, -1)]))
def test_below_zero_the_slopes_are_the_derivatives_too(extended, made, acceptor, donor, signs):
    """Of what is taken up there, which is nothing, and of its extension, by central differences."""
    scale, place = saturations(made), np.array([acceptor, donor]) * signs
    slopes = np.array(uptake_slopes(*(place * scale), made, extended)) * scale
    step = 1e-3 * np.abs(place).min()
    found = oracles.derivative(lambda c: np.array(uptake(*(c * scale), made, extended)), place, step)
    most = made.kinetics.maximum_utilization_rate * max(1.0, np.abs(place).max())
    assert slopes == pytest.approx(found, abs=1e-9 * most / min(1.0, np.abs(place).min()))


@given(st.floats(-100.0, 100.0), st.floats(-100.0, 100.0), st.floats(0.001, 50.0))
def test_each_sink_rises_with_its_own_substrate_below_zero_too(acceptor, donor, more):
    """As the transient scheme linearises it: the uptake of nothing is zero and below zero it is a source."""
    q_a, q_d = uptake(acceptor, donor, extended=True)
    slopes = uptake_slopes(acceptor, donor, extended=True)
    more_a, more_d = uptake(acceptor + more, donor, extended=True), uptake(acceptor, donor + more, extended=True)
    assert more_a[0] >= q_a and more_d[1] >= q_d
    assert q_a * acceptor >= 0 and q_d * donor >= 0
    assert slopes[0][0] > 0 and slopes[1][1] >= 0 and slopes[0][1] * acceptor >= 0 and slopes[1][0] * donor >= 0


@given(LAWS, st.floats(-100.0, 100.0), st.floats(-100.0, 100.0))
def test_what_is_below_zero_is_nothing_to_uptake_and_growth(made, acceptor, donor):
    """Both are functions of max(C, 0), so that what decays, grows and is taken up stay in proportion."""
    above = max(acceptor, 0.0), max(donor, 0.0)
    assert uptake(acceptor, donor, made) == uptake(*above, made)
    assert growth_rate(acceptor, donor, made) == growth_rate(*above, made)
    assert inert_rate(acceptor, made) == inert_rate(above[0], made)


@given(LAWS, concentrations, concentrations, between(1e-3, 50.0))
def test_more_of_either_substrate_takes_up_more(made, acceptor, donor, more):
    """|F1| and |F2| rise with both substrates, strictly while there is the other one, and never past k F + d_c f_d b
    and k; F3 rises with the donor, from -b at the least to k Y at the most."""
    k = made.kinetics
    q_a, q_d = uptake(acceptor, donor, made)
    by_a, by_d = uptake(acceptor + more, donor, made), uptake(acceptor, donor + more, made)
    assert by_a[0] > q_a or max(donor, k.degradable_fraction) < 1e-3
    assert by_d[0] > q_a and by_d[1] > q_d or acceptor < 1e-3
    assert by_a[1] > q_d or donor < 1e-3
    assert by_a[0] >= q_a and by_a[1] >= q_d and by_d[0] >= q_a and by_d[1] >= q_d
    most = k.maximum_utilization_rate
    decay = k.decay_oxygen_demand * k.degradable_fraction * k.decay_coefficient
    assert 0 <= q_d <= most and 0 <= q_a <= most * k.acceptor_to_donor_ratio + decay
    growth = growth_rate(acceptor, donor, made)
    assert growth_rate(acceptor, donor + more, made) > growth or acceptor < 1e-3
    assert -k.decay_coefficient <= growth <= most * k.yield_coefficient


@pytest.mark.parametrize("growth, remains", [(0.19, 0.001), (-0.005, 0.001), (0.0, 0.001), (1e-14, 0.001), (-3.0, 0.2)])
def test_growth_over_a_step_is_the_exact_solution_at_constant_rates(growth, remains):
    """Against an adaptive Runge-Kutta method of order 8."""
    def right(_, y):
        return [growth * y[0], remains * y[0]]

    exact = solve_ivp(right, (0.0, 2.0), [3.0, 0.5], method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    found = kinetics.grow(np.array([3.0]), np.array([0.5]), np.array([growth]), np.array([remains]), 2.0)
    assert np.ravel(found) == pytest.approx(exact, rel=1e-11)


def test_decay_alone_leaves_the_inert_share():
    """Without donor X_A + X_I falls to 1 - f_d = 0.2 of what was lost."""
    growth = kinetics.growth_rate(1e6, 0.0, SCENE.substrates, SCENE.kinetics)
    remains = kinetics.inert_rate(1e6, SCENE.substrates, SCENE.kinetics)
    active, inert = kinetics.grow(1.0, 0.0, growth, remains, 1e5)
    assert active < 1e-200 and inert == pytest.approx(0.2, rel=1e-13)


@given(st.floats(-3.0, 3.0), st.floats(0.0, 1.0), between(1e-3, 2.0), between(1e-3, 2.0))
def test_two_steps_at_the_same_rates_are_one(growth, remains, first, second):
    """And X_A stays positive, X_I never falls."""
    after = kinetics.grow(1.0, 0.5, growth, remains, first)
    both = kinetics.grow(*after, growth, remains, second)
    assert both == pytest.approx(kinetics.grow(1.0, 0.5, growth, remains, first + second), rel=1e-12)
    assert both[0] > 0 and both[1] >= after[1] >= 0.5


@given(st.floats(-3.0, 3.0) | st.floats(-1e-3, 1e-3) | st.just(0.0))
def test_the_mean_of_what_grows_over_a_step_and_its_slope(z):
    """(e^z - 1) / z is the mean of e^(z s), s from 0 to 1, and the slope that of s e^(z s), by Gauss's rule of 20
    points."""
    s, weight = np.polynomial.legendre.leggauss(20)
    grown = np.exp(z * (s + 1) / 2)
    mean = kinetics.mean_growth(np.array(z))
    slope = kinetics.mean_growth_slope(np.array(z), mean)
    assert mean == pytest.approx(weight @ grown / 2, rel=1e-13)
    assert slope == pytest.approx(weight @ (grown * (s + 1) / 2) / 2, rel=1e-8)


DURATIONS = st.just(0.0) | between(1e-3, 5.0)


def fractions_of(acceptor, donor, made):
    """(2, 1, 1) m_A and m_D."""
    return np.array(kinetics.fractions(acceptor, donor, made.substrates)).reshape(2, 1, 1)


@given(LAWS, concentrations, concentrations, DURATIONS)
def test_what_a_sink_takes_up_over_a_step_is_what_the_step_makes(made, acceptor, donor, duration):
    """Y q_D - (q_A - F q_D) / d_c, times the step, is the growth of X_A and X_I at the same concentrations: in every
    point and to round-off."""
    k, sink = made.kinetics, kinetics.Sink(np.array([[3.0]]), duration)
    q_a, q_d = duration * sink.uptake(fractions_of(acceptor, donor, made), k)[0, :, 0]
    active, inert = kinetics.grow(3.0, 0.5, growth_rate(acceptor, donor, made), inert_rate(acceptor, made), duration)
    made_of = k.yield_coefficient * q_d - (q_a - k.acceptor_to_donor_ratio * q_d) / k.decay_oxygen_demand
    size = k.yield_coefficient * q_d + q_a / k.decay_oxygen_demand + active
    assert active + inert - 3.5 == pytest.approx(made_of, abs=1e-13 * size)


@given(LAWS, concentrations, concentrations)
def test_a_sink_that_does_not_grow_takes_up_at_the_rates_of_the_law(made, acceptor, donor):
    found = kinetics.Sink(np.array([[3.0]])).uptake(fractions_of(acceptor, donor, made), made.kinetics)[0, :, 0]
    assert found == pytest.approx(3 * np.array(uptake(acceptor, donor, made)), rel=1e-15)


@given(LAWS, st.floats(0.01, 0.99), st.floats(0.01, 0.99), DURATIONS)
def test_the_slopes_of_a_sink_are_the_derivatives(made, m_a, m_d, duration):
    """By m_A and m_D, by central differences of order 4, its mean included."""
    sink, place = kinetics.Sink(np.array([[2.0]]), duration), np.array([m_a, m_d])

    def taken(m):
        return sink.uptake(m.reshape(2, 1, 1), made.kinetics)[0, :, 0]

    slopes = sink.slopes(place.reshape(2, 1, 1), made.kinetics)[:, :, 0, 0]
    found = oracles.derivative(taken, place, 3e-4)
    assert slopes == pytest.approx(found, abs=1e-8 * np.abs(slopes).max())
