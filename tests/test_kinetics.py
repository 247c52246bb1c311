"""Dual Monod kinetics (7)-(10): values against the paper's formulas, derivatives, bounds, and what is below zero."""
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from repro import kinetics
from tests.strategies import concentrations, scene

SCENE = scene(head="1e-3 cm")
DAY = 24.0
SATURATIONS = (1.0, 0.3, 20.0)


def rates(acceptor, donor):
    """(F1, F2, F3, F4) / X_A of Table 1 in 1/d, as (7)-(10) print them, with d_c f_d b [E3] and F = 1.52 [E1]."""
    m_a, m_d = acceptor / (acceptor + 1.0), donor / (donor + 1.0)
    k, Y, b, f_d, d_c, F = 9.3, 0.61, 0.12, 0.8, 1.42, 1.52
    return (-m_a * (k * F * m_d + d_c * f_d * b), -k * m_a * m_d, m_a * (k * Y * m_d - b), m_a * b * (1 - f_d))


def uptake(acceptor, donor):
    return kinetics.uptake(np.asarray(acceptor, float), np.asarray(donor, float), SCENE.substrates, SCENE.kinetics)


@given(concentrations, concentrations)
def test_the_rates_are_those_of_the_paper(acceptor, donor):
    """Mutant: d_f d_b for d_c f_d b, b without m_A, f_d for 1 - f_d, the yield in F2."""
    F1, F2, F3, F4 = (rate / DAY for rate in rates(acceptor, donor))
    q_a, q_d, _ = uptake(acceptor, donor)
    assert (-q_a, -q_d) == pytest.approx((F1, F2), rel=1e-13, abs=1e-300)
    growth = kinetics.growth_rate(acceptor, donor, SCENE.substrates, SCENE.kinetics)
    assert growth == pytest.approx(F3, rel=1e-12, abs=1e-17)
    assert kinetics.inert_rate(acceptor, SCENE.substrates, SCENE.kinetics) == pytest.approx(F4, rel=1e-13, abs=1e-300)


def test_the_numbers_of_section_4():
    """At 10 K_s of both the biomass doubles in 3.6 h; decay alone, under plenty of acceptor, halves X_A in 5.8 d (C09).

    Mutant: rates per day taken as per hour.
    """
    doubling = np.log(2) / kinetics.growth_rate(10.0, 10.0, SCENE.substrates, SCENE.kinetics)
    assert doubling == pytest.approx(24 * np.log(2) / (10 / 11 * (9.3 * 0.61 * 10 / 11 - 0.12)), rel=1e-13)
    halving = -np.log(2) / kinetics.growth_rate(1e9, 0.0, SCENE.substrates, SCENE.kinetics) / DAY
    assert halving == pytest.approx(5.8, rel=5e-3)


@given(st.sampled_from(SATURATIONS), st.floats(0.01, 100.0))
def test_monod_is_bounded_and_half_at_its_constant(half, concentration):
    """Mutant: C / (1 + K), a constant of the other substrate."""
    m, slope = kinetics.monod(np.array([0.0, half, concentration]), half)
    assert m[0] == 0 and m[1] == pytest.approx(0.5, rel=1e-15) and 0 < m[2] < 1
    assert slope == pytest.approx((1 - m) ** 2 / half, rel=1e-12)


def test_the_jacobian_is_the_derivative():
    """Central differences, step 1e-5: error under 1e-8 of the rates. Mutant: rows and columns swapped, K for K^2."""
    rng = np.random.default_rng(1)
    c_a, c_d = rng.uniform(0.01, 20.0, (2, 200))
    h, slopes = 1e-5, uptake(c_a, c_d)[2]
    for substrate, (up, down) in enumerate(((uptake(c_a + h, c_d), uptake(c_a - h, c_d)),
                                            (uptake(c_a, c_d + h), uptake(c_a, c_d - h)))):
        for sink in (0, 1):
            assert slopes[sink][substrate] == pytest.approx((up[sink] - down[sink]) / (2 * h), abs=1e-8)


@given(st.floats(-100.0, 100.0), st.floats(-100.0, 100.0), st.floats(0.001, 50.0))
def test_each_sink_rises_with_its_own_substrate_below_zero_too(acceptor, donor, more):
    """So the uptake of nothing is zero and below zero it is a source. Mutant: C / (C + K) there, which is positive
    again below -K and has a root for Newton's method to fall into."""
    q_a, q_d, slopes = uptake(acceptor, donor)
    assert uptake(acceptor + more, donor)[0] >= q_a and uptake(acceptor, donor + more)[1] >= q_d
    assert q_a * acceptor >= 0 and q_d * donor >= 0
    assert slopes[0][0] > 0 and slopes[1][1] >= 0 and slopes[0][1] * acceptor >= 0 and slopes[1][0] * donor >= 0


@given(concentrations, concentrations, st.floats(0.001, 50.0))
def test_more_of_either_substrate_takes_up_more(acceptor, donor, more):
    """And never faster than k and k F + d_c f_d b allow. Mutant: m_A left out of F2."""
    q_a, q_d, _ = uptake(acceptor, donor)
    richer_a, richer_d = uptake(acceptor + more, donor), uptake(acceptor, donor + more)
    assert richer_a[0] > q_a and richer_d[0] >= q_a and richer_a[1] >= q_d and richer_d[1] >= q_d
    assert 0 <= q_d <= 9.3 / DAY and 0 <= q_a <= (9.3 * 1.52 + 1.42 * 0.8 * 0.12) / DAY


@pytest.mark.parametrize("growth, remains", [(0.19, 0.001), (-0.005, 0.001), (0.0, 0.001), (1e-14, 0.001), (-3.0, 0.2)])
def test_growth_over_a_step_is_the_exact_solution_at_constant_rates(growth, remains):
    """Against an adaptive Runge-Kutta method of order 8. Mutant: 1 + growth step for its exponential; X_I from the
    first X_A."""
    def right(_, y):
        return [growth * y[0], remains * y[0]]

    exact = solve_ivp(right, (0.0, 2.0), [3.0, 0.5], method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    found = kinetics.grow(np.array([3.0]), np.array([0.5]), np.array([growth]), np.array([remains]), 2.0)
    assert np.ravel(found) == pytest.approx(exact, rel=1e-11)


def test_decay_alone_leaves_the_inert_share():
    """Without donor X_A + X_I falls to 1 - f_d = 0.2 of what was lost. Mutant: inert remains b f_d."""
    growth = kinetics.growth_rate(1e6, 0.0, SCENE.substrates, SCENE.kinetics)
    remains = kinetics.inert_rate(1e6, SCENE.substrates, SCENE.kinetics)
    active, inert = kinetics.grow(1.0, 0.0, growth, remains, 1e5)
    assert active < 1e-200 and inert == pytest.approx(0.2, rel=1e-13)
