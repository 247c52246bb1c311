"""The modified Gear scheme (3.3): from the supply everywhere towards the steady profiles of :mod:`.monod_channel`.

X_A does not change (no yield, and less than 1e-5 of it decays). In time the scheme is compared with an integrator that
makes no error of its own, on the same mesh; in space with FiPy, whose cells are integrated without an error in time;
and in time with FiPy's own scheme, which is of first order.

Closed pores in which diffusion evens out every concentration: (7)-(10) are four ordinary equations.

A seed in a closed box whose diffusivities are so large that C_A and C_D are uniform to 1e-6; X_A and X_I then are too.
With ``share`` of the box biomass,

    dC_A/dt = -share X_A m_A (k F m_D + d_c f_d b)        dX_A/dt = X_A m_A (k Y m_D - b)
    dC_D/dt = -share X_A k m_A m_D                        dX_I/dt = X_A m_A b (1 - f_d)

are integrated by scipy to 1e-11. The box is followed for five days, by when half of the acceptor is gone.

A step of the midpoint rule takes up substrates with the mean biomass of the step, at concentrations at rest: with C_A
and C_D constant over the step that is what (7)-(10) say, and what is made then balances what is taken up.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import scipy.sparse as sp
from scipy.integrate import solve_ivp
from scipy.spatial import cKDTree
from skfem import Basis, BilinearForm, ElementTriP2, ElementTriP3, MeshTri

from reference import channel_fipy
from reference.monod import sink, slopes, uptake
from repro.fem.mesher import generate
from repro.fem.outline import half_disc
from repro.fem.sizing import ACROSS_AGGREGATE, Sizing
from repro.fem.space import Space
from repro.model import biomass, gear, kinetics, transport
from repro.model.kinetics import Sink
from repro.model.transport import Balance, Concentrations
from verification.kernel.case import Check, Outcome, Profile, Study, at_most, case, refine, study
from verification.problems.channels import (
    CROSSED,
    EVERY,
    NAMES,
    SCENE,
    WORDS,
    along,
    at_heights,
    averaged,
    both,
    filled,
    pair,
    problem,
    rates,
    spaced,
    speed_of,
)
from verification.transport.cross_code import COMBINATIONS, given, titled

LAW = replace(SCENE.kinetics, yield_coefficient=1e-12)
#: h: 0.07, 0.2 and 0.7 s. Water diffuses across the slab in 0.6 s, and crosses it in 0.1 to 6 s.
TIMES = (2e-5, 6e-5, 2e-4)
#: Steps of each of the three intervals; elements (um), and how many meshes of each size.
STEPS = (16, 32, 64, 128)
SIZES = (4.0, 2.5, 5 / 3, 1.0)
SAMPLES = dict(zip(SIZES, (4, 3, 2, 1)))
#: Errors of a density X of both substrates: ours less FiPy's.
CEILINGS = {3e3: 3e-6, 3e4: 3e-5, 3e5: 3e-4}


@cache
def _assembled(size: float, sample: int, peclet: float, order: int = 1) -> transport.Problem:
    return problem(spaced(size, sample, order), speed_of(peclet), law=LAW)


@cache
def _ours(size: float, sample: int, peclet: float, density: float, steps: int, order: int = 1) -> np.ndarray:
    """(times, 2, n): each interval in equal steps, started anew from the end of the last."""
    made, states, last = _assembled(size, sample, peclet, order), [], 0.0
    active = filled(made.space, density)
    now = transport.supplied_everywhere(made)
    for time in TIMES:
        interval, last = time - last, time
        now = gear.advance(made, active, 0 * active, now, interval, fixed_step=interval / steps).concentrations
        states.append(both(now))
    return np.array(states)


@BilinearForm
def product(u, v, w):
    """(u, v)."""
    return u * v


def mass(space: Space) -> np.ndarray:
    """(n, n) um2, the mass matrix on a straight mesh by scikit-fem; of linear functions lumped."""
    if space.order == 1:
        return np.diag(space.lumped())
    straight = space.mesh.straight
    grid = MeshTri(straight.points.T.copy(), straight.triangles.T.copy())
    basis = Basis(grid, {2: ElementTriP2(), 3: ElementTriP3()}[space.order], intorder=8)
    apart, same = cKDTree(basis.doflocs.T).query(space.points)
    if apart.max() > 1e-9:
        raise ValueError("scikit-fem has its nodes elsewhere")
    return product.assemble(basis).toarray()[np.ix_(same, same)]


def _reading(space: Space) -> sp.csr_array:
    """(points, n) concentrations in the points of the reaction from those at the nodes."""
    pieces = space.reaction
    count, k = pieces.dx.shape[1], pieces.cells.shape[1]
    rows = np.repeat(np.arange(pieces.dx.size), k)
    columns = np.repeat(pieces.cells, count, axis=0)
    values = np.tile(pieces.values, (len(pieces.cells), 1))
    return sp.csr_array((values.ravel(), (rows, columns.ravel())), shape=(pieces.dx.size, space.count))


@cache
def _exact_in_time(size: float, sample: int, peclet: float, density: float, order: int) -> np.ndarray:
    """(times, 2, n): the same equations in space, M dC/dt = b - L C - X q in the points of the reaction, by scipy's
    integrator to 1e-8."""
    made, law = _assembled(size, sample, peclet, order), rates(LAW)
    back = np.kron(np.eye(2), np.linalg.inv(mass(made.space)))
    read = sp.block_diag([_reading(made.space)] * 2, "csr")
    load = filled(made.space, density).ravel()

    def rise(_, y):
        return back @ (made.source - made.operator @ y - read.T @ sink(read @ y, load, law))

    def slope(_, y):
        return back @ -(made.operator + read.T @ slopes(read @ y, load, law) @ read).toarray()

    start = np.repeat(pair("supply"), made.space.count)
    found = solve_ivp(rise, (0.0, TIMES[-1]), start, jac=slope, method="BDF", t_eval=TIMES, rtol=1e-8, atol=1e-8)
    return found.y.T.reshape(len(TIMES), 2, -1)


def _largest(apart: np.ndarray) -> dict[str, float]:
    """Of each substrate, over the times: the root mean square over the places (times, 2, ...), over its supply."""
    sizes = np.sqrt(np.mean(apart**2, axis=tuple(range(2, apart.ndim)))).max(axis=0)
    return dict(zip(NAMES, sizes / pair("supply")))


#: Combinations whose error in time is studied, and the last error of each; elements of each order (um).
IN_TIME = {1: {(0.1, 3e5): 2e-5, (1.0, 3e4): 3e-6, (5.0, 3e5): 1e-5},
           2: {(1.0, 3e4): 3e-6, (5.0, 3e5): 1e-5}, 3: {(1.0, 3e4): 3e-6, (5.0, 3e5): 1e-5}}
COARSE = {1: SIZES[0], 2: SIZES[0], 3: 5.0}


@case("transport-gear-in-time", kind="cross-code",
      norm="largest over three times of the root mean square over the nodes, over the supply",
      claim="On a given mesh the modified Gear scheme's concentrations, linear, quadratic and cubic, are those of "
            "scipy's integrator with scikit-fem's mass matrix, with an error of second order in the step",
      mutants=("carry-of-bdf2", "backward-euler", "storage-of-the-biomass-alone", "storage-diagonal"), ways="1 2 3")
def in_time() -> Outcome:
    parts = []
    for order, combinations in IN_TIME.items():
        for combination in combinations:
            parts += _in_time(order, *combination)
    return Outcome(studies=tuple(parts))


def _in_time(order: int, peclet: float, density: float):
    steps, size = np.array(STEPS), COARSE[order]
    exact = _exact_in_time(size, 0, peclet, density, order)
    rows = [_largest(_ours(size, 0, peclet, density, n, order) - exact) for n in STEPS]
    told, ceiling = f"{titled(peclet, density)}, {WORDS[order]}", IN_TIME[order][peclet, density]
    return [study(f"{name}, {told}", TIMES[0] / steps, [row[name] for row in rows], 2,
                  "BDF2 after a first step of backward Euler", ceiling=ceiling) for name in NAMES]


def _from_backward_euler(peclet: float, density: float):
    steps, channel = np.array(STEPS), _channel(SIZES[-1], peclet, density)
    rows = [_largest(_at_cells(SIZES[-1], 0, peclet, density, n) - channel.backward_euler(TIMES, n)[:, :, None])
            for n in STEPS]
    return [study(f"{name} less FiPy's in as many steps, {titled(peclet, density)}", TIMES[0] / steps,
                  [row[name] for row in rows], 1, "the lower of the two: FiPy's TransientTerm is backward Euler",
                  ceiling=3e-4) for name in NAMES]


@cache
def _channel(size: float, peclet: float, density: float) -> channel_fipy.Channel:
    """FiPy's, its cells half as long as our edges."""
    return channel_fipy.Channel(round(2 * (CROSSED[1] - CROSSED[0]) / size), CROSSED, *given(peclet, density))


@cache
def _fipy(size: float, peclet: float, density: float) -> np.ndarray:
    return _channel(size, peclet, density).transient(TIMES)


def _at_cells(size: float, sample: int, peclet: float, density: float, steps: int, x=None, order: int = 1):
    """(times, 2, 5, n) ours at x, at five heights; at FiPy's cells of the same size by default."""
    states = _ours(size, sample, peclet, density, steps, order)
    where = _channel(size, peclet, density).x if x is None else x
    return np.stack([at_heights(spaced(size, sample, order), state, where) for state in states])


@case("transport-gear-fipy", kind="cross-code",
      norm="largest over three times of the root mean square over FiPy's cells, at five heights, over the supply; "
           "several meshes a size",
      claim="Transient profiles of both substrates are FiPy's, both codes refined together in space, at Peclet 0.1, 1, "
            "5 times Thiele numbers 0.6, 1.9, 6; and refined in time, where FiPy's own scheme is of first order; those "
            "of quadratic and cubic elements, on one mesh, are what FiPy's cells come to",
      mutants=("storage-of-the-biomass-alone", "storage-diagonal"), slow=True, ways="1 2 3")
def in_space() -> Outcome:
    studies = [part for combination in COMBINATIONS for part in _in_space(*combination)]
    higher = [part for order in (2, 3) for part in _to_fipy(order, 1.0, 3e4)]
    return Outcome(studies=(*studies, *_from_backward_euler(1.0, 3e4), *higher),
                   profiles=tuple(_profile(*combination) for combination in COMBINATIONS))


def _in_space(peclet: float, density: float):
    errors = refine(lambda size: averaged(_from_fipy, size, peclet, density, samples=SAMPLES), SIZES)
    return [study(f"{name}, {titled(peclet, density)}", SIZES, errors[name], 2,
                  "both codes are of second order; the error in time is a tenth", ceiling=CEILINGS[density])
            for name in NAMES]


def _from_fipy(size: float, sample: int, peclet: float, density: float) -> dict[str, float]:
    ours = _at_cells(size, sample, peclet, density, round(STEPS[-1] / size))
    return _largest(ours - _fipy(size, peclet, density)[:, :, None])


#: FiPy's cells (um), half as long as these, and the elements of order 2 and 3 that they are compared with.
CELLS, FINE = (4.0, 2.5, 5 / 3, 1.0), {2: 1.0, 3: 5 / 3}


def _to_fipy(order: int, peclet: float, density: float):
    """FiPy's cells against one mesh of quadratic or cubic elements, whose error is less than a tenth of theirs."""
    size, rows = FINE[order], []
    for cells in CELLS:
        ours = _at_cells(size, 0, peclet, density, STEPS[-1], _channel(cells, peclet, density).x, order)
        rows.append(_largest(ours - _fipy(cells, peclet, density)[:, :, None]))
    return [study(f"{name} of FiPy less {WORDS[order]} elements', {titled(peclet, density)}", CELLS,
                  [row[name] for row in rows], 2, "FiPy's second order", ceiling=1e-5) for name in NAMES]


def _profile(peclet: float, density: float) -> Profile:
    size, curves = SIZES[-1], []
    x, space = _channel(size, peclet, density).x, spaced(size, 0)
    for time, ours, theirs in zip(TIMES, _ours(size, 0, peclet, density, STEPS[-1]), _fipy(size, peclet, density)):
        for k, name in enumerate(NAMES):
            once = "FiPy" if not curves else "_"  # a name with an underscore is left out of the legend
            curves += [(f"{name}, {3600 * time:.2g} s", "ours", x, along(space, ours[k], x)),
                       (once, "reference", x, theirs[k])]
    return Profile(titled(peclet, density), "x (um)", "C (mg/L)", tuple(curves))


BOX, RADIUS = 24.0, 8.0
SUPPLY, SEEDED = 1000.0, 300.0
#: Times (h) at which both are compared; the transient scheme starts anew at each.
HALF_DAYS = 12.0 * np.arange(1, 11)
MIXED_STEPS = (2.0, 1.0, 0.5, 0.25)
MIXED_NAMES = ("C_A", "C_D", "X_A", "X_I")
#: Kinetics five times slower than the paper's, and half saturations of the supply's size: C falls for days.
SLOW_LAW = replace(SCENE.kinetics, maximum_utilization_rate=SCENE.kinetics.maximum_utilization_rate / 5)
EVEN = {"diffusivity": 1e8, "diffusivity_in_aggregate": 1e8, "supply": SUPPLY}
CLOSED = replace(SCENE.substrates, boundary="closed",
                 acceptor=replace(SCENE.substrates.acceptor, half_saturation=300.0, **EVEN),
                 donor=replace(SCENE.substrates.donor, half_saturation=600.0, **EVEN))


def growing(acceptor, donor, active):
    """dX_A/dt and dX_I/dt, (9)-(10), written down anew."""
    m_a = acceptor / (acceptor + CLOSED.acceptor.half_saturation)
    m_d = donor / (donor + CLOSED.donor.half_saturation)
    b, f_d = SLOW_LAW.decay_coefficient, SLOW_LAW.degradable_fraction
    growth = SLOW_LAW.maximum_utilization_rate * SLOW_LAW.yield_coefficient * m_d - b
    return active * m_a * growth, active * m_a * b * (1 - f_d)


@cache
def _box(order: int) -> transport.Problem:
    return transport.problem(_space(order), None, CLOSED, SLOW_LAW)


@cache
def _space(order: int) -> Space:
    geometry = min(order, 2)
    outline = half_disc(RADIUS, ACROSS_AGGREGATE * 0.5, geometry)
    return Space(generate(outline, (-BOX, BOX), Sizing(BOX, 0.3, 2.0), geometry)[0], order)


@cache
def _mixed_ours(step: float, order: int) -> np.ndarray:
    """(times, 4, 2): mean and range of C_A and C_D over the nodes, of X_A and X_I over the points of the reaction, in
    steps of so many hours."""
    made = _box(order)
    weight = made.space.reaction.dx
    active = SEEDED * weight
    inert, now, rows = 0 * active, transport.supplied_everywhere(made), []
    for interval in np.diff([0.0, *HALF_DAYS]):
        done = gear.advance(made, active, inert, now, interval, fixed_step=step)
        active, inert, now = done.active, done.inert, done.concentrations
        fields = (now.acceptor, now.donor, active / weight, inert / weight)
        rows.append([(field.mean(), np.ptp(field)) for field in fields])
    return np.array(rows)


def _theirs(times, order: int) -> np.ndarray:
    """(times, 4) by scipy."""
    space, law = _space(order), rates(SLOW_LAW, CLOSED)
    share = space.reaction.dx.sum() / space.at.dx.sum()

    def right(_, y):
        sinks = uptake(y[0], y[1], law)
        return [-share * y[2] * sinks[0], -share * y[2] * sinks[1], *growing(*y[:3])]

    return solve_ivp(right, (0, times[-1]), [SUPPLY, SUPPLY, SEEDED, 0.0], t_eval=times, rtol=1e-11, atol=1e-10,
                     method="DOP853").y.T


#: Last errors of C_A, C_D, X_A and X_I.
MIXED_CEILINGS = (4e-5, 1.5e-5, 6e-5, 1e-4)


NORM = "largest relative difference, twice a day for five days"


@case("transport-well-mixed", kind="cross-code", norm=f"{NORM}; X at constant C: relative, after five days",
      claim="In a closed, well-mixed pore C_A, C_D, X_A and X_I follow the four ordinary equations over days, with an "
            "error of second order in the step; at constant C the shape updates integrate X_A and X_I exactly",
      mutants=("inert-fraction", "yield-dropped", "remains-of-the-start", "growth-in-one-increment"),
      ways="1", because="orders 2, 3: transport-well-mixed-higher")
def well_mixed():
    exactly = at_most("X at constant C, 12 min steps", _constant_supply(), 1e-9,
                      "(9)-(10) are integrated exactly: round-off of 600 steps, and scipy's 1e-11")
    return exactly, [part.labelled(WORDS[1]) for part in followed(1)], _profiles()


@case("transport-well-mixed-higher", kind="cross-code", norm=NORM, slow=True,
      claim="With quadratic and cubic concentrations C_A, C_D, X_A and X_I of the well-mixed pore follow the four "
            "ordinary equations alike",
      mutants=("storage-diagonal", "inert-fraction", "remains-of-the-start"),
      over={WORDS[order]: (order,) for order in (2, 3)}, because="order 1: transport-well-mixed")
def followed(order: int):
    """How even the box is, and studies of the four."""
    exact = _theirs(HALF_DAYS, order)
    errors = np.array([np.abs(_mixed_ours(step, order)[:, :, 0] / exact - 1).max(axis=0) for step in MIXED_STEPS])
    uneven = (_mixed_ours(MIXED_STEPS[-1], order)[:, :, 1] / exact).max()
    yield at_most("unevenness in the box", uneven, 1e-6, "L^2 / D over the time in which the supply lasts")
    for k, (name, ceiling) in enumerate(zip(MIXED_NAMES, MIXED_CEILINGS)):
        yield study(name, MIXED_STEPS, errors[:, k], 2, "BDF2, started anew ten times", ceiling=ceiling)


def _constant_supply() -> float:
    """X_A and X_I as the quasi-steady scheme integrates them, over five days of 12 min updates."""
    acceptor, donor = 400.0, 900.0
    growth = kinetics.growth_rate(acceptor, donor, CLOSED, SLOW_LAW)
    remains = kinetics.inert_rate(acceptor, CLOSED, SLOW_LAW)
    active, inert = 3e4, 0.0
    for _ in range(600):
        active, inert = kinetics.grow(active, inert, growth, remains, 0.2)
    found = solve_ivp(lambda t, y: growing(acceptor, donor, y[0]), (0, HALF_DAYS[-1]), [3e4, 0.0], rtol=1e-12,
                      atol=1e-8, method="DOP853").y[:, -1]
    return float(np.abs(np.array([active, inert]) / found - 1).max())


def _profiles() -> tuple[Profile, ...]:
    """Substrates and biomass against time."""
    times = np.linspace(0.5, HALF_DAYS[-1], 121)
    exact, ours = _theirs(times, 1), _mixed_ours(MIXED_STEPS[-1], 1)[:, :, 0]

    def curves(chosen):
        return tuple(part for k in chosen
                     for part in ((MIXED_NAMES[k], "ours", HALF_DAYS, ours[:, k]),
                                  (f"{MIXED_NAMES[k]}, solve_ivp", "reference", times, exact[:, k])))
    return (Profile("substrates", "time (h)", "C (mg/L)", curves((0, 1))),
            Profile("biomass", "time (h)", "X (mg/L)", curves((2, 3))))


#: Lengths of a step (h); X_A more than doubles in the last.
HOURS = (0.2, 2.0, 8.0)
#: The paper's kinetics and diffusivities, the supply held at both ends: both substrates fall towards the wall.
OPEN = replace(SCENE.substrates, acceptor=replace(SCENE.substrates.acceptor, supply=1.0))


@cache
def _open(order: int) -> transport.Problem:
    return transport.problem(_space(order), None, OPEN, SCENE.kinetics)


@case("transport-mean-biomass", kind="exact",
      norm="biomass made less Y donor - (acceptor - F donor) / d_c, over what is made; uptake at constant C, relative; "
           "remainder of a first-order Taylor expansion",
      claim="With the mean biomass of a step of hours, biomass made is Y donor - (acceptor - F donor) / d_c of what is "
            "taken up, to round-off, wherever concentrations are; at constant ones the uptake is the integral of "
            "(7)-(10) over the step; and the tangent is the uptake's derivative",
      mutants=("biomass-of-the-start", "biomass-half-way", "mean-biomass-constant-in-c"), over=EVERY)
def mean_biomass(order: int):
    for hours in HOURS:
        yield _balanced(order, hours)
        yield _integrated(order, hours)
    yield _tangent(order, HOURS[-1])


def _balanced(order: int, hours: float) -> Check:
    """Biomass made against uptake, at the steady concentrations of a step."""
    made, law = _open(order), SCENE.kinetics
    active = law.maximum_density * made.space.reaction.dx
    sink = Sink(active, hours)
    state = transport.steady(made, sink)
    acceptor, donor = (hours * flux.consumed for flux in transport.fluxes(made, sink, state))
    found = biomass.rates(made.space, state, OPEN, law)
    after = kinetics.grow(active, 0 * active, found.growth, found.remains, hours)
    grown = float(np.sum(after[0] - active) + np.sum(after[1]))
    F, d_c = law.acceptor_to_donor_ratio, law.decay_oxygen_demand
    asked = law.yield_coefficient * donor - (acceptor - F * donor) / d_c
    return at_most(f"biomass made, {hours:g} h", abs(grown - asked) / grown, 1e-12,
                   "one integral of growth and uptake in each point: round-off")


def _integrated(order: int, hours: float) -> Check:
    """Uptake at constant concentrations against scipy's integral of (7)-(10) over the step."""
    made, law = _open(order), rates(SCENE.kinetics, OPEN)
    acceptor, donor, seeded = 0.7, 4.0, 300.0
    everywhere = Concentrations(np.full(made.space.count, acceptor), np.full(made.space.count, donor))
    ours = transport.fluxes(made, Sink(seeded * made.space.reaction.dx, hours), everywhere)
    sinks = uptake(acceptor, donor, law)
    yielded, decay = SCENE.kinetics.yield_coefficient, SCENE.kinetics.decay_coefficient
    m_a = acceptor / (acceptor + law["K_A"])
    growth = yielded * sinks[1] - decay * m_a
    found = solve_ivp(lambda t, y: [growth * y[0], y[0] * sinks[0], y[0] * sinks[1]], (0, hours), [seeded, 0.0, 0.0],
                      rtol=1e-12, atol=1e-9, method="DOP853").y[1:, -1]
    taken = hours * np.array([flux.consumed for flux in ours]) / made.space.reaction.dx.sum()
    return at_most(f"uptake at constant C, {hours:g} h", np.abs(taken / found - 1).max(), 1e-10,
                   "scipy's 1e-12, in a few steps")


def _tangent(order: int, hours: float) -> Study:
    """Remainders of the residual along a direction."""
    made, random = _open(order), np.random.default_rng(13)
    balance = Balance(made, Sink(SCENE.kinetics.maximum_density * made.space.reaction.dx, hours))
    state, along = random.uniform(0.5, 1.0, (2, 2 * made.space.count))
    steps = 0.05 * 0.5 ** np.arange(4)
    linear, start = made.system.product(balance.tangent(state), along), balance.residual(state)
    left = [np.abs(balance.residual(state + s * along) - start - s * linear).max() for s in steps]
    return study(f"tangent, {hours:g} h", steps, left, 2, "Taylor's theorem: second order")
