"""Dual Monod kinetics (7)-(10): values against the paper's formulas, derivatives, bounds, and values below zero.
Haldane's law in a slab in which several states are steady at once; `reference/haldane_slab.py` has them."""
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from reference import haldane_slab
from repro import load_scene
from repro.model import gear, kinetics, transport
from repro.model.meshing import seeded
from repro.model.uptake_law import LAWS, UptakeLaw
from repro.model.uptake_law import LAWS as LAWS_OF_UPTAKE
from repro.scene import Substrates
from tests import oracles
from tests.strategies import between, concentrations, rate_constants, scenes
from verification.problems import channels

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


@pytest.mark.parametrize("absent", ["", "acceptor", "donor"])
@pytest.mark.parametrize("preset", ["paper", "fast", "exact"])
def test_the_front_of_zero_order_follows_the_mesh_at_a_known_loss(preset, absent):
    """Only this law depends on the mesh. The front (D K / (q X_m))^1/2 is a third of the root of its part's area. With
    flux^2 = 2 q X_m D int m dC, a layer takes up less than in the limit by K / (2 C)."""
    scene = load_scene("base", ["kinetics.law=zero order", f"numerics.preset={preset}"])
    kept = Substrates(**{name: kind for name, kind in scene.substrates.modelled.items() if name != absent})
    space = seeded(scene).space
    rates = kinetics.rate_law(kept, scene.kinetics).on(space, kept)
    areas = space.reaction.dx.sum(axis=1)
    whole = scene.kinetics.maximum_density * np.array(rates.uptake_at(1.0, 1.0))[rates.modelled]
    for kind, uptake, one in zip(kept.modelled.values(), whole, rates.both):
        half = np.ravel(one.half_saturation)
        assert kind.diffusivity_in_aggregate * half / uptake == pytest.approx(areas / 9, rel=1e-12)
    supply = 20 * half[0]
    taken, _ = quad(lambda c: float(one.fraction(np.full((len(half), 1), c))[0, 0]), 0.0, supply, limit=200)
    assert 1 - np.sqrt(taken / supply) == pytest.approx(1 / 40, rel=0.02)
    monod = kinetics.rate_law(kept, replace(scene.kinetics, law="dual Monod"))
    assert monod.on(space, kept) is monod


@pytest.mark.parametrize("name", LAWS_OF_UPTAKE)
@pytest.mark.parametrize("substrate", [0, 1])
@given(SCENES, between(0.01, 100.0))
def test_every_law_of_uptake_satisfies_its_definition(substrate, name, scene, part):
    """dm/dC, and dm/ds at s = C / (C + K) in the law's own and the general form, are derivatives of m(C), by central
    differences good to about 1e-10. At C = 0, m is 0 and has its steepest slope, 1 / K. m stays under its bound and
    does not saturate at K / 2. C(s) and s(C) are inverse functions."""
    law_m = list(LAWS_OF_UPTAKE[name].of(scene.substrates.acceptor, scene.substrates.donor))[substrate]
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


# ---------------------------------------------------------------- Haldane's law


SUPPLY, HALF_SATURATION, INHIBITION = 30.0, 1.0, 1.0
#: Uptake, mg/L/h.
SINK = 1e6
#: Error over the supply of quadratic elements of 4 um, beside the layer of little donor.
MESH = 0.01
#: Time (h) in which the slab settles: forty times l^2 / D.
SETTLED = 0.02


@pytest.fixture(scope="module")
def slab():
    """Space, problem and density of the biomass, which does not grow; and the reference's states at the nodes."""
    donor = replace(channels.SCENE.substrates.donor, supply=SUPPLY, half_saturation=HALF_SATURATION,
                    inhibition_constant=INHIBITION)
    space = channels.slab_space(4.0, 0, 2, (-channels.SLAB, channels.SLAB), (-channels.SLAB, channels.SLAB))
    kinetics = replace(channels.SCENE.kinetics, law="Haldane", yield_coefficient=1e-12, decay_coefficient=0.0)
    problem = channels.problem(space, None, Substrates(donor=donor), kinetics)
    solutions = haldane_slab.solutions(SUPPLY, SINK, HALF_SATURATION, INHIBITION, channels.SLAB,
                                       donor.diffusivity_in_aggregate)
    states = [solution(space.points[:, 0]) for solution in solutions]
    assert len(states) == 3 and min(largest_gap(state, states[-1]) for state in states[:-1]) > 10 * MESH
    return space, problem, SINK / kinetics.maximum_utilization_rate, states


def largest_gap(one, other):
    return np.abs(one - other).max() / SUPPLY


@pytest.mark.parametrize("place", [0, -1])
def test_the_transient_scheme_settles_to_the_same_state(slab, place):
    """Gear's scheme, from the supply and from a start with little donor."""
    space, problem, density, states = slab
    supplied = transport.supplied_everywhere(problem)
    start = transport.Concentrations(None, states[0] if place == 0 else supplied.donor)
    active = channels.uniform_masses(space, density)
    end = gear.advance(problem, active, 0 * active, start, SETTLED).concentrations
    steady = channels.steady(problem, density, start if place == 0 else None)
    assert largest_gap(end.donor, steady.donor) < 10 * gear.TOLERANCE
    assert largest_gap(end.donor, states[place]) < MESH


def test_only_haldanes_law_may_have_several_states():
    """m of every law without the mark never decreases up to a large C."""
    concentrations = np.linspace(0, 50, 501)
    for name, law in LAWS.items():
        constants = (1.0, 1.0) if name == "Haldane" else (1.0,)
        rises = np.diff(law(*constants).fraction(concentrations)) >= 0
        assert rises.all() == law.monotone
