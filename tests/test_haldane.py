"""Haldane's law in a slab of biomass where several states are steady at once, with scipy's profiles as the reference.

``reference/haldane_slab.py`` shoots from the middle of the slab and shares nothing with the solver. Its least state has
little donor, and its largest one is that which is reached in time from the supply.
"""
from dataclasses import replace

import numpy as np
import pytest

from reference import haldane_slab
from repro.model import gear, transport
from repro.model.uptake_law import LAWS
from repro.scene import Substrates
from verification.problems import channels

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


@pytest.mark.parametrize("share", [-0.02, -1e-4, 0.0])
def test_a_small_change_of_the_start_changes_no_state(slab, share):
    """Three states are steady. A run starts from the supply and reaches the state with the most donor. The starts here
    are the supply and each stable state, changed by a share that varies from node to node."""
    _, problem, density, states = slab
    assert largest_gap(channels.steady(problem, density).donor, states[-1]) < MESH
    supplied = np.full_like(states[0], SUPPLY)
    for start, expected in ((supplied, states[-1]), (states[-1], states[-1]), (states[0], states[0])):
        changed = start * (1 + share * np.random.default_rng(1).uniform(size=len(start)))
        computed = channels.steady(problem, density, transport.Concentrations(None, changed)).donor
        assert largest_gap(computed, expected) < MESH


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
