"""Dual Monod kinetics (7)-(10): values against the paper's formulas, derivatives, bounds, and what is below zero."""
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from repro.model import kinetics
from repro.model.uptake_law import LAWS as LAWS_OF_UPTAKE
from repro.model.uptake_law import UptakeLaw
from tests import oracles
from tests.strategies import between, concentrations, constants, scenes

LAWS = scenes(drives=("none",))  # any constants
amounts = concentrations | st.floats(-100.0, 0.0)


def law(made):
    """The rates of a scene."""
    return kinetics.rate_law(made.substrates, made.kinetics)


def extended_uptake(place, made):
    """(2, 2) uptake of acceptor and donor, extended below zero, and its derivative by the own concentration."""
    return np.array([law(made).own_uptake(s, *np.asarray(place, float)) for s in (0, 1)])


def half_saturations(made):
    return np.array([made.substrates.acceptor.half_saturation, made.substrates.donor.half_saturation])


@given(LAWS, amounts, amounts)
def test_the_rates_are_those_of_the_paper(made, acceptor, donor):
    """Of max(C, 0), so that what decays, grows and is taken up stay in proportion. As the transient scheme linearises
    it, each sink goes on along its tangent at zero of its own substrate: it rises, and is a source."""
    above = np.maximum([acceptor, donor], 0.0)
    F1, F2, F3, F4 = oracles.rates(*above, **constants(made))
    q = np.array(law(made).uptake(acceptor, donor))
    assert q == pytest.approx((-F1, -F2), rel=1e-13, abs=1e-300)
    assert law(made).growth_rate(acceptor, donor) == pytest.approx(F3, rel=1e-12, abs=1e-17)
    assert law(made).inert_rate(acceptor) == pytest.approx(F4, rel=1e-13, abs=1e-17)
    rises = np.array([extended_uptake((0.0, above[1]), made)[0, 1], extended_uptake((above[0], 0.0), made)[1, 1]])
    expected = q + np.minimum([acceptor, donor], 0.0) * rises
    assert extended_uptake((acceptor, donor), made)[:, 0] == pytest.approx(expected, rel=1e-13) and rises.min() >= 0


@given(LAWS, between(0.01, 100.0), between(0.01, 100.0), st.sampled_from([(1, 1), (-1, 1), (1, -1), (-1, -1)]))
def test_the_slopes_are_the_derivatives(made, acceptor, donor, signs):
    """Of the extended uptake by the own concentration, on both sides of zero, by central differences of order 4 in
    C / (|C| + K), good to about 1e-12 of the rates."""
    place = half_saturations(made) * [acceptor, donor] * signs
    scale = half_saturations(made) + np.abs(place)
    slopes = extended_uptake(place, made)[:, 1] * scale
    expected = oracles.derivative(lambda c: extended_uptake(c * scale, made)[:, 0], place / scale, 1e-3).diagonal()
    assert slopes == pytest.approx(expected, abs=1e-10 * np.abs(slopes).max())


@pytest.mark.parametrize("chosen", LAWS_OF_UPTAKE)
@pytest.mark.parametrize("substrate", [0, 1])
@given(LAWS, between(0.01, 100.0))
def test_every_law_of_uptake_keeps_its_statements(substrate, chosen, made, part):
    """dm/dC, and dm/ds at s = C / (C + K) in the law's own form and in the general one, are derivatives of m(C), by
    central differences good to about 1e-10. m is 0 without substrate and rises there with 1 / K, its steepest slope.
    It stays under its bound, does not saturate at K / 2, and C and s are inverse."""
    one = list(LAWS_OF_UPTAKE[chosen].of(made.substrates.acceptor, made.substrates.donor))[substrate]
    half, concentration, saturation = one.half_saturation, part * one.half_saturation, part / (1 + part)
    slope = oracles.derivative(lambda c: one.fraction(c * half), np.array([part]), 1e-3 * part).item()
    rise = slope / (1 - saturation) ** 2
    assert one.slope(concentration) * half == pytest.approx(slope, rel=1e-8, abs=1e-11)
    for of_saturation in (one.at_saturation(saturation), UptakeLaw.at_saturation(one, saturation)):
        assert of_saturation == pytest.approx((one.fraction(concentration), rise), rel=1e-8, abs=1e-9)
    assert one.saturation(concentration) == pytest.approx(saturation, rel=1e-14)
    assert one.concentration(saturation) == pytest.approx(concentration, rel=1e-12)
    supplies = half * np.logspace(-6, 6, 60)
    assert one.fraction(0.0) == 0 and one.slope(0.0) * half == pytest.approx(1.0, rel=1e-14)
    assert (one.slope(supplies) * half <= 1).all() and (one.fraction(supplies) <= one.largest(supplies[-1])).all()
    assert not one.saturates(0.5 * half)


@given(LAWS, concentrations, concentrations, st.just(0.0) | between(1e-3, 5.0))
def test_what_a_sink_takes_up_over_a_step_is_what_the_step_makes(made, acceptor, donor, duration):
    """Y q_D - (q_A - F q_D) / d_c, times the step, is the growth of X_A and X_I at the same concentrations: in every
    point and to round-off."""
    k, sink = made.kinetics, kinetics.Sink(np.array([[3.0]]), duration)
    m = np.array(law(made).fractions(acceptor, donor)).reshape(2, 1, 1)
    q_a, q_d = duration * sink.uptake(m, law(made))[0, :, 0]
    growth, remains = law(made).growth_rate(acceptor, donor), law(made).inert_rate(acceptor)
    active, inert = kinetics.grow(3.0, 0.5, growth, remains, duration)
    made_of = k.yield_coefficient * q_d - (q_a - k.acceptor_to_donor_ratio * q_d) / k.decay_oxygen_demand
    size = k.yield_coefficient * q_d + q_a / k.decay_oxygen_demand + active
    assert active + inert - 3.5 == pytest.approx(made_of, abs=1e-13 * size)
