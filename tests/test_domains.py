"""An iterate that leaves the domain of a stage's equations is a failure of this stage, and its step is shortened.

A power, root, logarithm or quotient does not exist there: of J < 0, of an area of zero, of a number that overflows.
"""
import gc
import weakref
from functools import cache, partial

import numpy as np
import pytest

from repro.errors import GrowthError, MeshError, TransferError, TransportError
from repro.fem import transfer
from repro.march import midpoint
from repro.march.simulation import simulate
from repro.model import contact_lines, contact_newton, gear, growth, mesh_motion, surface, transport
from repro.model.closing_by_lines import ByLines
from repro.model.contact_lines import PATIENT
from repro.model.kinetics import Sink
from repro.model.mechanics import Mechanics
from repro.model.meshing import seeded
from repro.model.solving import Solver
from repro.model.uptake_law import LAWS
from repro.scene import load_scene
from tests.strategies import half_disc

TOWER = 'aggregate.outline=[["-25 um","0 um"],["-15 um","50 um"],["15 um","50 um"],["25 um","0 um"]]'
FAST = ["numerics.preset=fast", "numerics.refinement=0.25"]
OUT_OF_DOMAIN = "an iterate leaves the domain of its equations"
#: A concentration (mg/L) whose square or exponential overflows.
HUGE = 1e200


def turned_over(points, nodes):
    """Points with the aggregate's nodes mirrored."""
    mirrored = points.copy()
    mirrored[nodes] *= [-1, 1]
    return mirrored


@cache
def tower():
    """The closing of a tower from wall to wall that has grown by 5 %, the tower, and its contact lines."""
    scene = load_scene("base", [TOWER, *FAST], unset=["aggregate.radius"])
    start = seeded(scene)
    grown = start.with_body(theta=1.05 * start.body.theta)
    lines = contact_lines.lines_of(grown.boundary)
    return ByLines(Mechanics.of(scene), grown, start, None, PATIENT), grown, lines


def test_contact_lines_from_a_triangle_that_is_turned_over_fail_in_growth():
    """The search with whole equilibria then takes over."""
    closing, grown, lines = tower()
    bad = turned_over(grown.mesh.points, grown.mesh.body)
    place = partial(closing._place, grown, grown.body.wall, lines)
    with pytest.raises(GrowthError, match=OUT_OF_DOMAIN):
        contact_newton.Coupled(place, lines, bad, grown.pressure).solve()
    closing._trials[-1] = (np.zeros(0), bad, grown.pressure)
    try:
        settled = closing.settle(grown.body.wall, lines)
    except FloatingPointError as error:
        pytest.fail(f"an error that no search handles: {error}")
    assert settled is None and not any(line.advance for line in lines)


@cache
def stirred(law, substrates):
    """A pore with flow, and the problem of its substrates; None where a law needs the other substrate."""
    unset = {"both": [], "acceptor": ["substrates.donor"], "donor": ["substrates.acceptor"]}[substrates]
    scene = load_scene("base", [*FAST, f"kinetics.law={law}"], unset=unset)
    pore = seeded(scene)
    carried = Solver.of(scene).solve_flow(pore.space, scene.flow)
    return pore, transport.problem(pore.space, carried, scene.substrates, scene.kinetics, scene.numerics.scheme)


LAWS_AND_SUBSTRATES = pytest.mark.parametrize("law, substrates", [
    (law, substrates) for law in LAWS for substrates in ("both", "acceptor", "donor")
    if (law, substrates) != ("Haldane", "acceptor")])  # its inhibitor is the donor


@pytest.mark.parametrize("law, substrates", [
    each for each in LAWS_AND_SUBSTRATES.args[1] if each[0] != "zero order"])
def test_substrates_whose_uptake_overflows_fail_in_transport(law, substrates):
    """Biomass that grows over 1e5 h, and concentrations of an iterate that diverges. Uptake of zero order is
    bounded."""
    pore, problem = stirred(law, substrates)
    huge = transport.supplied_everywhere(problem).with_fields(np.full((len(problem.kinds), pore.space.count), HUGE))
    with pytest.raises(TransportError, match=OUT_OF_DOMAIN):
        transport.steady(problem, Sink(pore.active, 1e5))
    with pytest.raises(TransportError, match=OUT_OF_DOMAIN):
        gear.advance(problem, pore.active, pore.inert, huge, 1.0)
    if law != "first order":  # its uptake is linear
        with pytest.raises(TransportError, match=OUT_OF_DOMAIN):
            gear.settle(problem, Sink(pore.active), huge)


@pytest.mark.parametrize("law", [law for law in LAWS if LAWS[law].monotone])
def test_newtons_method_starts_again_if_its_guess_overflows(law):
    pore, problem = stirred(law, "both")
    supplied = transport.supplied_everywhere(problem)
    huge = supplied.with_fields(np.full_like(supplied.fields, HUGE))
    computed, expected = (transport.steady(problem, Sink(pore.active), guess) for guess in (huge, supplied))
    assert computed.fields == pytest.approx(expected.fields, rel=1e-6, abs=1e-9)  # NEWTON is 1e-11 of a row's terms


def test_a_point_in_a_collapsed_triangle_fails_in_the_transfer():
    points = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
    with pytest.raises(TransferError, match=OUT_OF_DOMAIN):
        transfer.located(points, np.array([[0, 1, 2]]), np.array([[0.5, 0.0]]))


def run(monkeypatch, *changes, unset=()):
    """[[length, error or None]] of the attempted steps of a run to 0.6 h, and the time of its last row."""
    attempts, attempt = [], midpoint.attempt

    def record(stages, previous, solved, duration, *options, **named):
        attempts.append([duration, None])
        try:
            return attempt(stages, previous, solved, duration, *options, **named)
        except Exception as error:
            attempts[-1][1] = error
            raise

    monkeypatch.setattr(midpoint, "attempt", record)
    end = ["growth.end=0.6 h", 'output.times=["0.6 h"]']
    *_, last = simulate(load_scene("base", [*FAST, *end, *changes], unset=unset))
    return attempts, last.pore.time


def leave_domain(monkeypatch, owner, name, shortest=0.0):
    """Let a function of a stage leave its domain in each attempted step longer than ``shortest`` (h)."""
    function, attempt, lengths = getattr(owner, name), midpoint.attempt, [0.0]

    def start(stages, previous, solved, duration, *options, **named):
        lengths.append(duration)
        return attempt(stages, previous, solved, duration, *options, **named)

    def fail(*arguments, **options):
        if lengths[-1] > shortest:
            np.power(-1.0, -2 / 3)
        return function(*arguments, **options)

    monkeypatch.setattr(midpoint, "attempt", start)
    monkeypatch.setattr(owner, name, fail)


@pytest.mark.parametrize("owner, name, kind", [
    (growth.System, "residual", GrowthError), (transport.Balance, "residual", TransportError),
    (mesh_motion, "saddle_blocks", MeshError), (surface, "_lengths", GrowthError)])
def test_a_run_shortens_a_step_in_which_a_stage_leaves_its_domain(monkeypatch, owner, name, kind):
    """The first step is 1.6 h and its half 0.8 h."""
    leave_domain(monkeypatch, owner, name, shortest=1.0)
    attempts, end = run(monkeypatch)
    assert end == 0.6 and [length for length, _ in attempts[:2]] == [1.6, 0.8]
    assert [type(error) for _, error in attempts[:2]] == [kind, type(None)]


def test_a_run_finds_contact_lines_by_equilibria_if_newtons_method_leaves_its_domain(monkeypatch):
    """No step fails."""
    leave_domain(monkeypatch, contact_newton.Coupled, "_step")
    step = ["growth.time_step=0.01 h", "growth.end=0.08 h", 'output.times=["0.08 h"]']
    attempts, end = run(monkeypatch, TOWER, *step, unset=["aggregate.radius"])
    assert end == 0.08 and not any(error for _, error in attempts)


# ---------------------------------------------------------------- growth


GEOMETRIES = pytest.mark.parametrize("geometry", [1, 2])


def constant(body, theta):
    """(t, q) expansion from one value or one value per triangle (t,)."""
    return np.broadcast_to(np.reshape(theta, (-1, 1)), body.at.dx.shape).astype(float)


def at_rest(body, constrained, theta, prescribed=None):
    """Return the equilibrium from the reference under theta (t, q)."""
    target = body.reference if prescribed is None else prescribed
    return growth.equilibrium(body, theta, body.reference, np.zeros(body.shape.corners), constrained, target)


@GEOMETRIES
def test_a_start_that_is_turned_over_is_refused(geometry):
    """det F <= 0 is detected before any division by it, and so is theta <= 0."""
    body, constrained, rim, _ = half_disc(5.0, geometry=geometry)
    folded, push = body.reference.copy(), np.zeros(body.shape.corners)
    folded[np.setdiff1d(np.arange(body.shape.corners), rim)[0]] += 100.0
    for start in (folded, body.reference * [-1, 1], body.reference * [1, 0]):
        assert body.strained(start).J.min() <= 0
        with pytest.raises(GrowthError, match="turned over"):
            growth.equilibrium(body, constant(body, 1.0), start, push, constrained, start)
    for theta in (-1.0, 0.0):
        with pytest.raises(GrowthError, match="turned over or from theta <= 0"):
            at_rest(body, constrained, constant(body, theta))


def test_an_unused_system_is_freed():
    """It stores fields at every quadrature point."""
    gc.disable()
    try:
        body, constrained, _, _ = half_disc(5.0, 0.5, geometry=2)
        system = growth.System(body, constrained)
        system.under(constant(body, 1.1), body.reference, body.reference, np.zeros(body.shape.corners))
        alive = weakref.ref(system)
        del system
        assert alive() is None
    finally:
        gc.enable()
