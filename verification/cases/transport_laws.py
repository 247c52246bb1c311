"""Laws of uptake other than dual Monod, and one substrate alone: slabs of biomass at rest.

One substrate is modelled and the other does not limit: the donor is taken up at k X m_D, the acceptor at (k F + d_c f_d
b) X m_A. Uptake of first and of zero order has closed forms, with a film of fluid beside the slab. By Haldane's law
three states are steady at once; scipy finds all of them, in one dimension.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from reference import haldane_slab, slab
from repro.model import transport
from repro.model.kinetics import Sink
from repro.scene import Substrates
from verification.evidence.cases import parametrize
from verification.evidence.checks import at_most, refine, studies
from verification.problems import meshes
from verification.problems.channels import (
    EXPECTED,
    FILM,
    SAMPLES,
    SCENE,
    SLAB,
    WIDTH,
    both,
    decay_demand,
    in_points,
    length,
    problem,
    rms_errors,
    slab_space,
    steady,
    uniform_masses,
)

#: Uptake per biomass (1/h) where the other substrate does not limit.
FASTEST = {"donor": SCENE.kinetics.maximum_utilization_rate,
           "acceptor": SCENE.kinetics.maximum_utilization_rate * SCENE.kinetics.acceptor_to_donor_ratio
           + decay_demand(SCENE.kinetics)}
THIELE = 1.0
#: Last errors of C and of the uptake at this modulus with films, by order: those of transport-first-order-slab.
CEILINGS = {1: (3e-5, 3e-5), 2: (7e-9, 1e-11)}
MESHES = {1: SAMPLES, 2: {4.0: 8, 2.0: 4, 1.0: 2, 0.5: 1}}
ALONE = {f"{name} alone, {word}": (name, order) for name in FASTEST
         for word, order in {"linear": 1, "quadratic": 2}.items()}


def equations(space, name: str, law: str, **changes):
    """One substrate alone, without flow, with the supply at both ends."""
    substrate = replace(getattr(SCENE.substrates, name), **changes)
    return problem(space, None, Substrates(**{name: substrate}), replace(SCENE.kinetics, law=law))


def space_of(size: float, number: int, order: int, film: float = FILM):
    return slab_space(size, number, order, (-SLAB - film, SLAB + film), (-SLAB, SLAB))


def _first_order(size: float, number: int, name: str, order: int) -> dict[str, float]:
    """Element size, and the relative errors of C and of the uptake."""
    substrate, space = getattr(SCENE.substrates, name), space_of(size, number, order)
    kappa = substrate.diffusivity_in_aggregate * (THIELE / SLAB) ** 2
    density = kappa * substrate.half_saturation / FASTEST[name]
    linear = equations(space, name, "first order")
    state = steady(linear, density)
    sides = {"half": SLAB, "in_slab": substrate.diffusivity_in_aggregate, "film": FILM,
             "diffusivity": substrate.diffusivity}
    gap = meshes.distance(in_points(space), both(state)[0][space.cells],
                          lambda x, y: slab.first_order(x, substrate.supply, kappa, **sides)[0])
    flux = transport.fluxes(linear, Sink(uniform_masses(space, density)), state)[name == "donor"]
    expected = slab.first_order(0.0, substrate.supply, kappa, **sides)[1] * 2 * WIDTH * SLAB * kappa * substrate.supply
    return {"size": length(space, size), "C": gap, "taken up": abs(flux.consumed / expected - 1)}


@pytest.mark.case(
    "transport-laws-first-order", kind="exact", mutants=("first-order-bounded", "absent-substrate-limits"),
    references=("slab",))
@parametrize("name, order", ALONE)
def test_first_order_law(name, order, record):
    """With kinetics.law = "first order" one substrate alone has the closed form of a slab with films at Thiele's
    modulus 1, at its own rate of uptake: k X for the donor, (k F + d_c f_d b) X for the acceptor.

    Norm: L2 of C over the mesh, relative; uptake, relative; several meshes a size.
    """
    errors = refine(_first_order, MESHES[order], name, order)
    record(studies(errors, {"C": (*EXPECTED[order], CEILINGS[order][0])}))
    record(at_most("taken up", errors["taken up"][-1], CEILINGS[order][1], "that of transport-first-order-slab"))


DEPTH = 20.0


@pytest.mark.case(
    "transport-laws-zero-order", kind="exact", mutants=("zero-order-far-from-its-limit", "absent-substrate-limits"),
    references=("slab",))
@parametrize("order, size", {"linear": (1, 1.0), "quadratic": (2, 2.0)})
def test_zero_order_law(order, size, record):
    """With kinetics.law = "zero order" the donor alone is taken up at k X down to the depth of penetration, and C is
    zero beyond. Elements widen the front: a triangle of area A to A^(1/2) / 3.

    Norm: largest error of C at the nodes over the supply; depth = flux through a side over k X, relative.
    """
    donor, space = SCENE.substrates.donor, space_of(size, 0, order, 0.0)
    sink = 2 * donor.diffusivity_in_aggregate * donor.supply / DEPTH**2
    density = sink / FASTEST["donor"]
    kinetics = replace(SCENE.kinetics, law="zero order", maximum_density=density)
    zero_order = problem(space, None, Substrates(donor=donor), kinetics)
    state = steady(zero_order, density)
    exact = slab.zero_order(space.points[:, 0], donor.supply, sink, SLAB, donor.diffusivity_in_aggregate)
    flux = transport.fluxes(zero_order, Sink(uniform_masses(space, density)), state)[1]
    why = "(h / depth)^2: C'' jumps within an element; and the widened front, A / (9 depth^2), with A = h^2 / 2"
    bound = (size / order / DEPTH) ** 2 + (size / DEPTH) ** 2 / 18
    record(at_most("C, largest error", np.abs(state.donor - exact).max() / donor.supply, bound, why))
    record(at_most("depth", abs(flux.consumed / (2 * WIDTH * sink * DEPTH) - 1), bound, why))


#: mg/L. Uptake (mg/L/h) by which three states are steady, and by which only a state with little donor is.
INHIBITED = {"supply": 30.0, "half_saturation": 1.0, "inhibition_constant": 1.0}
THREE, ONE = 1e6, 1.2e6
HALDANE_MESHES = {4.0: 6, 2.0: 3, 1.0: 2, 0.5: 1}


@cache
def _haldane_states(sink: float):
    """The solutions, by rising concentration."""
    return haldane_slab.solutions(INHIBITED["supply"], sink, INHIBITED["half_saturation"],
                                  INHIBITED["inhibition_constant"], SLAB,
                                  SCENE.substrates.donor.diffusivity_in_aggregate)


def _haldane(size: float, number: int, order: int, sink: float, from_least: bool = False) -> dict[str, float]:
    """Element size, and the error of C against the solution that is due, over the supply; from_least: the least
    solution is the guess, not the supply."""
    space = space_of(size, number, order, 0.0)
    states = _haldane_states(sink)
    guess = transport.Concentrations(None, states[0](space.points[:, 0])) if from_least else None
    state = steady(equations(space, "donor", "Haldane", **INHIBITED), sink / FASTEST["donor"], guess)
    expected = states[0 if from_least else -1]
    gap, _ = rms_errors(space, both(state), lambda x, y: expected(x)[None])
    return {"size": length(space, size), "C": gap[0] / INHIBITED["supply"]}


@pytest.mark.slow
@pytest.mark.case(
    "transport-laws-haldane", kind="cross-code", references=("haldane_slab",),
    mutants=("haldane-without-inhibition", "haldane-by-newton-alone"))
@parametrize("order, ceiling", {"linear": (1, 1e-4), "quadratic": (2, 1e-6)})
def test_haldane(order, ceiling, record):
    """If three states are steady by Haldane's law, the solution from the supply is the largest of them, and that from
    the least of them is the least. If only a state with little donor is steady, the solution is this state.

    Norm: root mean square of C over the mesh, over the supply; several meshes a size.
    """
    record(at_most("number of solutions, less 3", abs(len(_haldane_states(THREE)) - 3), 0, "scipy's brackets"))
    record(studies(refine(_haldane, HALDANE_MESHES, order, THREE), {"C": (*EXPECTED[order], ceiling)}))
    why = "the states differ by 0.1 or more; the error of the mesh is 1e-3 at most beside the layer of little donor"
    record(at_most("C from the least", _haldane(1.0, 0, order, THREE, True)["C"], 0.01, why))
    record(at_most("C of the one state", _haldane(1.0, 0, order, ONE)["C"], 0.01, why))
