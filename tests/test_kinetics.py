"""Dual Monod kinetics (7)-(10): values against the paper's formulas, derivatives, bounds, and what is below zero."""
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from repro.model import kinetics
from tests import oracles
from tests.strategies import between, concentrations, constants, scenes

LAWS = scenes(drives=("none",))  # any constants
amounts = concentrations | st.floats(-100.0, 0.0)


def uptake(acceptor, donor, made, extended=False):
    """(q_A, q_D)."""
    at = np.asarray(acceptor, float), np.asarray(donor, float)
    return kinetics.uptake(*at, made.substrates, made.kinetics, extended)


def uptake_slopes(acceptor, donor, made, extended=False):
    at = np.asarray(acceptor, float), np.asarray(donor, float)
    return kinetics.uptake_slopes(*at, made.substrates, made.kinetics, extended)


def growth_rate(acceptor, donor, made):
    return kinetics.growth_rate(acceptor, donor, made.substrates, made.kinetics)


def inert_rate(acceptor, made):
    return kinetics.inert_rate(acceptor, made.substrates, made.kinetics)


def saturations(made):
    return np.array([made.substrates.acceptor.half_saturation, made.substrates.donor.half_saturation])


@given(LAWS, amounts, amounts)
def test_the_rates_are_those_of_the_paper(made, acceptor, donor):
    """Of max(C, 0), so that what decays, grows and is taken up stay in proportion. As the transient scheme linearises
    it, each sink goes on along its tangent at zero of its own substrate: it rises, and is a source."""
    above = np.maximum([acceptor, donor], 0.0)
    F1, F2, F3, F4 = oracles.rates(*above, **constants(made))
    q = uptake(acceptor, donor, made)
    assert q == pytest.approx((-F1, -F2), rel=1e-13, abs=1e-300)
    assert growth_rate(acceptor, donor, made) == pytest.approx(F3, rel=1e-12, abs=1e-17)
    assert inert_rate(acceptor, made) == pytest.approx(F4, rel=1e-13, abs=1e-17)
    rises = [uptake_slopes(0.0, above[1], made, extended=True)[0][0],
             uptake_slopes(above[0], 0.0, made, extended=True)[1][1]]
    wanted = q + np.minimum([acceptor, donor], 0.0) * rises
    assert uptake(acceptor, donor, made, extended=True) == pytest.approx(wanted, rel=1e-13) and min(rises) >= 0


@pytest.mark.parametrize("extended", [False, True])
@given(LAWS, between(0.01, 100.0), between(0.01, 100.0), st.sampled_from([(1, 1), (-1, 1), (1, -1), (-1, -1)]))
def test_the_slopes_are_the_derivatives(extended, made, acceptor, donor, signs):
    """Of what is taken up, and below zero of nothing or of its extension, by central differences of order 4 in
    C / (|C| + K), good to about 1e-12 of the rates."""
    half, place = saturations(made), saturations(made) * [acceptor, donor] * signs
    scale = half + np.abs(place)
    slopes = np.array(uptake_slopes(*place, made, extended)) * scale
    found = oracles.derivative(lambda c: np.array(uptake(*(c * scale), made, extended)), place / scale, 1e-3)
    assert slopes == pytest.approx(found, abs=1e-10 * np.abs(slopes).max())


@given(LAWS, concentrations, concentrations, st.just(0.0) | between(1e-3, 5.0))
def test_what_a_sink_takes_up_over_a_step_is_what_the_step_makes(made, acceptor, donor, duration):
    """Y q_D - (q_A - F q_D) / d_c, times the step, is the growth of X_A and X_I at the same concentrations: in every
    point and to round-off."""
    k, sink = made.kinetics, kinetics.Sink(np.array([[3.0]]), duration)
    m = np.array(kinetics.fractions(acceptor, donor, made.substrates)).reshape(2, 1, 1)
    q_a, q_d = duration * sink.uptake(m, k)[0, :, 0]
    active, inert = kinetics.grow(3.0, 0.5, growth_rate(acceptor, donor, made), inert_rate(acceptor, made), duration)
    made_of = k.yield_coefficient * q_d - (q_a - k.acceptor_to_donor_ratio * q_d) / k.decay_oxygen_demand
    size = k.yield_coefficient * q_d + q_a / k.decay_oxygen_demand + active
    assert active + inert - 3.5 == pytest.approx(made_of, abs=1e-13 * size)
