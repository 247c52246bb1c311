"""Quasi-steady substrates (7)-(13) with elements of every order: solutions without biomass, starts of Newton's method,
and refusals. Cases of the stage transport test closed forms, other codes, the balance, starved pores, scaling and the
mean biomass of a step. `test_derived.py` tests that uptake follows from rates and concentrations, `test_guards.py`
that two quadratures of the uptake agree."""
from contextlib import nullcontext
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from skfem import MeshTri

from repro.errors import SimulationError, TransportError, Unresolved
from repro.fem.mesh import Mesh, triangle_areas
from repro.fem.walls import channel_walls
from repro.march.simulation import simulate
from repro.model import meshing, solving, transport
from repro.model.kinetics import Sink
from repro.model.meshing import seeded
from repro.model.solving import Solved, solve
from repro.model.transport import Concentrations
from repro.schemes import PAPER
from tests.strategies import EVERY_ORDER, coarse_base, scene
from tests.test_derived import integrate_over_end, node_coordinates
from verification.problems.meshes import space_on
from verification.problems.schemes import exchange, exchanged

FINE = {1: 1.0, 2: 0.45}


def solved(radius, supply, velocity, order, inlet="local"):
    """(Pore, Solved) of a fixed shape."""
    numerics = {"refinement": 1.0 if order == 1 else 0.5}
    plain = scene(radius, "50 um", supply, supply, velocity, numerics=numerics, order=order)
    return at_start(exchanged(plain, exchange(inlet=inlet)))


def at_start(scene):
    """(Pore, Solved) of a scene."""
    start = seeded(scene)
    return start, solving.solve(scene, start)


def everywhere(start, value):
    """Both concentrations, the same at all nodes."""
    same = np.full(start.space.count, value)
    return Concentrations(same, same)


@EVERY_ORDER
@pytest.mark.parametrize("inlet", ["local", "mean"])
def test_a_constant_supply_stays_constant_without_biomass(inlet, order):
    """This holds around an obstacle and for both forms of (11), to round-off, since w is free of divergence for every
    order. Newton's method needs one step from zero concentrations."""
    start, solution = solved("30 um", "10 mg/L", "2.9 m/day", order, inlet)
    alone = transport.steady(solution.problem, None, everywhere(start, 0.0))
    assert alone.iterations <= 2
    assert alone.acceptor == pytest.approx(np.full(len(alone.acceptor), 10.0), abs=1e-10)
    assert alone.donor == pytest.approx(np.full(len(alone.donor), 10.0), abs=1e-10)


def right_triangles():
    """A structured mesh of 40 x 20 um, biomass from x = 10 to 20 um."""
    fem = MeshTri.init_tensor(np.linspace(0.0, 40.0, 9), np.linspace(0.0, 20.0, 5))
    points, triangles = fem.p.T.copy(), fem.t.T.copy()
    wrong = triangle_areas(points, triangles) < 0
    triangles[wrong] = triangles[wrong][:, ::-1]
    x = points[triangles, 0].mean(axis=1)
    return Mesh.of(points, triangles, (x > 10) & (x < 20), (), channel_walls(20.0), (0.0, 40.0))


@EVERY_ORDER
def test_couplings_that_are_exactly_zero_stay_in_the_matrix(order):
    """In right triangles nothing diffuses along the hypotenuse, so that without flow these entries are zero. The steady
    state without biomass is the supply."""
    space = space_on(right_triangles(), order)
    problem = transport.problem(space, None, scene().substrates, scene().kinetics)
    concentrations = transport.steady(problem, Sink(np.zeros_like(space.reaction.dx)))
    assert concentrations.acceptor == pytest.approx(10.0, rel=1e-12)


def thick(velocity, order=2, refinement=None):
    """A half-disc of 60 um in a pore of 100 um."""
    numerics = {"refinement": refinement or FINE[order]}
    return scene("60 um", "100 um", velocity=velocity, numerics=numerics, order=order)


@EVERY_ORDER
def test_too_slow_a_flow_is_refused(order):
    """Below u W / D = 1e-8 the supply at the inlet is lost in round-off."""
    with pytest.raises(TransportError, match=r"Peclet number u W / D is 1\.2e-09, under 1e-08: nothing is supplied"):
        at_start(thick("1e-9 m/day", order))
    assert np.isfinite(at_start(thick(None, order))[1].fluxes[0].consumed), "pure diffusion, as advised"
    if order > 1:
        assert np.isfinite(at_start(thick("1e-8 m/day", order))[1].fluxes[0].effluent)


def test_concentrations_keep_their_bounds_without_elements_for_boundary_layers(monkeypatch):
    """At u W / D = 4e4 the divergence-free w exceeds the supply by a fourth of the accepted part at most. The mutants
    carried-by-u and carried-by-taylor-hood show that advection by u is detected."""
    monkeypatch.setattr(meshing, "BOUNDARY_LAYER", 0.0)
    state = at_start(thick("290 m/day", 2, 0.2))[1].concentrations
    assert max(state.acceptor.max(), state.donor.max()) < 10 * (1 + transport.OVERSHOOT / 4)


def starved(half, order):
    """A seed that the acceptor reaches in part only, with a half saturation that no mesh resolves."""
    model = scene("30 um", "100 um", "1 mg/L", "10 mg/L", "0.5 m/day", numerics={
        "refinement": 0.4 / order}, order=order)
    acceptor = replace(model.substrates.acceptor, half_saturation=half)
    return replace(model, substrates=replace(model.substrates, acceptor=acceptor))


def outcome(scene):
    """The solution at t = 0, or the error."""
    try:
        with np.errstate(all="raise", under="ignore"):
            return at_start(scene)[1]
    except (Unresolved, FloatingPointError) as error:
        return error


@EVERY_ORDER
@pytest.mark.parametrize("half", [1e-17, 1e-300])
def test_a_half_saturation_below_round_off_is_solved_or_refused_as_a_front(order, half):
    """C / (C + K) is one to the last bit, and the substrate runs out, without a floating-point error. The solution
    differs by about 1e-15 from that with a half saturation of 1e-15."""
    solution = outcome(starved(half, order))
    if order == 1 and half == 1e-17:
        assert isinstance(solution, Solved), solution
        other = outcome(starved(1e-15, order))
        assert solution.concentrations.acceptor == pytest.approx(other.concentrations.acceptor, abs=1e-10)
        assert solution.concentrations.acceptor.min() < 1e-10 < solution.fluxes[0].consumed
    else:
        assert isinstance(solution, Unresolved), solution
        assert "the mesh is too coarse for the front in the aggregate" in str(solution)


def test_an_update_whose_biomass_meets_an_unresolved_front_gives_advice(monkeypatch):
    """The front is that of the biomass at the end of the step."""
    model = scene("5 um", velocity="1 m/day", growth={"end": "1 h", "time_step": "0.5 h"}, numerics={"refinement": 0.4})
    solve_steady, calls = transport.steady, []

    def fail_once(*arguments):
        calls.append(arguments)
        if len(calls) == 2:
            raise Unresolved("a front")
        return solve_steady(*arguments)

    monkeypatch.setattr(transport, "steady", fail_once)
    with pytest.raises(SimulationError, match="in transport: a front; try a larger numerics.refinement"):
        list(simulate(model))
    assert calls[1][1].active.sum() > 1.005 * calls[0][1].active.sum()


@EVERY_ORDER
def test_without_flow_the_ends_are_means_over_their_height(order):
    """The fields are not linear, and differ at inlet and outlet. Gauss's rule integrates along each end."""
    scene, pore = coarse_base(order, "numerics.transport=gear", "substrates.boundary=closed", unset=["flow"])
    x, y = node_coordinates(pore.space).T
    fields = [2 + np.sin(y / 7) + 0.01 * x, 5 + np.cos(y / 9) - 0.02 * x]
    problem = transport.problem(pore.space, None, scene.substrates, scene.kinetics)
    all_fluxes = transport.fluxes(problem, None, transport.Concentrations(*fields))
    for flux, field in zip(all_fluxes, fields):
        means = [integrate_over_end(pore.space, end, field) / scene.pore.width for end in pore.mesh.ends]
        assert [flux.inlet, flux.effluent] == pytest.approx(means, rel=1e-9) and abs(means[0] - means[1]) > 0.5


@EVERY_ORDER
def test_the_inlet_is_weighted_with_the_flow_for_any_inlet_condition(order):
    scene, pore = coarse_base(order)
    flow = solve(scene, pore).flow
    schemes = (replace(PAPER, inlet=inlet) for inlet in ("local", "mean"))
    local, mean = (transport.problem(pore.space, flow, scene.substrates, scene.kinetics, scheme).inflow
                   for scheme in schemes)
    assert np.array_equal(mean, local) and mean.sum() == pytest.approx(flow.mean_velocity * scene.pore.width)


@EVERY_ORDER
def test_a_concentration_may_leave_its_bounds_by_the_documented_part(order):
    """It may fall below zero by a thousandth of its supply and, with curved elements, exceed it by a fiftieth."""
    scene, pore = coarse_base(order)
    problem = transport.problem(pore.space, None, scene.substrates, scene.kinetics)
    for k, (part, accepted) in product((0, 1), ((-9e-4, True), (-1.1e-3, False), (1.019, True), (1.021, order == 1))):
        state = problem.supply
        state[k * problem.space.count + 7] *= part
        with nullcontext() if accepted else pytest.raises(Unresolved, match=("acceptor", "donor")[k]):
            transport._checked(problem, state, 1)
