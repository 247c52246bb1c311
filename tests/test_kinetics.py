"""Dual Monod kinetics (7)-(10): values against the paper's formulas, derivatives, bounds, and values below zero. The
cases transport-laws have the closed forms of each law."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from repro.model import kinetics
from repro.model.uptake_law import LAWS, UptakeLaw
from tests import oracles
from tests.strategies import between, concentrations, rate_constants, scenes

SCENES = scenes(drives=("none",))  # any constants
amounts = concentrations | st.floats(-100.0, 0.0)


def law(scene):
    """The rates of a scene."""
    return kinetics.rate_law(scene.substrates, scene.kinetics)


def extended_uptake(point, scene):
    """(2, 2) uptake of acceptor and donor, extended below zero; its derivative by the same concentration."""
    return np.array([law(scene).own_uptake(s, *np.asarray(point, float)) for s in (0, 1)])


@given(SCENES, amounts, amounts)
def test_the_rates_are_those_of_the_paper(scene, acceptor, donor):
    """They depend on max(C, 0), so that decay, growth and uptake stay in proportion. The transient scheme continues
    each sink along its tangent at zero of its own substrate: below zero the sink is a source."""
    above = np.maximum([acceptor, donor], 0.0)
    F1, F2, F3, F4 = oracles.rates(*above, **rate_constants(scene))
    q = np.array(law(scene).uptake(acceptor, donor))
    assert q == pytest.approx((-F1, -F2), rel=1e-13, abs=1e-300)
    assert law(scene).growth_rate(acceptor, donor) == pytest.approx(F3, rel=1e-12, abs=1e-17)
    assert law(scene).inert_rate(acceptor, donor) == pytest.approx(F4, rel=1e-13, abs=1e-17)
    rises = np.array([extended_uptake((0.0, above[1]), scene)[0, 1], extended_uptake((above[0], 0.0), scene)[1, 1]])
    expected = q + np.minimum([acceptor, donor], 0.0) * rises
    assert extended_uptake((acceptor, donor), scene)[:, 0] == pytest.approx(expected, rel=1e-13) and rises.min() >= 0


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("substrate", [0, 1])
@given(SCENES, between(0.01, 100.0))
def test_every_law_of_uptake_satisfies_its_definition(substrate, name, scene, part):
    """dm/dC, and dm/ds at s = C / (C + K) in the law's own and the general form, are derivatives of m(C), by central
    differences good to about 1e-10. At C = 0, m is 0 and has its steepest slope, 1 / K. m stays under its bound and
    does not saturate at K / 2. C(s) and s(C) are inverse functions."""
    law_m = list(LAWS[name].of(scene.substrates.acceptor, scene.substrates.donor))[substrate]
    half = law_m.half_saturation
    concentration, saturation = part * half, part / (1 + part)
    slope = oracles.derivative(lambda c: law_m.fraction(c * half), np.array([part]), 1e-3 * part).item()
    rise = slope / (1 - saturation) ** 2
    assert law_m.slope(concentration) * half == pytest.approx(slope, rel=1e-8, abs=1e-11)
    for of_saturation in (law_m.at_saturation(saturation), UptakeLaw.at_saturation(law_m, saturation)):
        assert of_saturation == pytest.approx((law_m.fraction(concentration), rise), rel=1e-8, abs=1e-9)
    assert law_m.saturation(concentration) == pytest.approx(saturation, rel=1e-14)
    assert law_m.concentration(saturation) == pytest.approx(concentration, rel=1e-12)
    supplies = half * np.logspace(-6, 6, 60)
    assert law_m.fraction(0.0) == 0 and law_m.slope(0.0) * half == pytest.approx(1.0, rel=1e-14)
    assert (law_m.slope(supplies) * half <= 1).all() and (law_m.fraction(supplies) <= law_m.largest(supplies[-1])).all()
    assert not law_m.saturates(0.5 * half)


def test_only_haldanes_law_may_have_several_states():
    """m of every law without the mark never decreases up to a large C."""
    concentrations = np.linspace(0, 50, 501)
    for name, law in LAWS.items():
        constants = (1.0, 1.0) if name == "Haldane" else (1.0,)
        rises = np.diff(law(*constants).fraction(concentrations)) >= 0
        assert rises.all() == law.monotone
