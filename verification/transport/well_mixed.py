"""Closed pores in which diffusion evens out every concentration: (7)-(10) are four ordinary equations.

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
from scipy.integrate import solve_ivp

from reference.monod import uptake
from repro.fem.mesher import generate
from repro.fem.outline import half_disc
from repro.fem.sizing import ACROSS_AGGREGATE, Sizing
from repro.fem.space import Space
from repro.model import biomass, gear, kinetics, transport
from repro.model.kinetics import Sink
from repro.model.transport import Balance, Concentrations
from verification.case import Check, Outcome, Profile, at_most, case
from verification.convergence import Study, study
from verification.transport.channels import ORDERS, SCENE, WORDS, rates

BOX, RADIUS = 24.0, 8.0
SUPPLY, SEEDED = 1000.0, 300.0
#: Times (h) at which both are compared; the transient scheme starts anew at each.
TIMES = 12.0 * np.arange(1, 11)
STEPS = (2.0, 1.0, 0.5, 0.25)
NAMES = ("C_A", "C_D", "X_A", "X_I")
#: Kinetics five times slower than the paper's, and half saturations of the supply's size: C falls for days.
LAW = replace(SCENE.kinetics, maximum_utilization_rate=SCENE.kinetics.maximum_utilization_rate / 5)
EVEN = {"diffusivity": 1e8, "diffusivity_in_aggregate": 1e8, "supply": SUPPLY}
CLOSED = replace(SCENE.substrates, boundary="closed",
                 acceptor=replace(SCENE.substrates.acceptor, half_saturation=300.0, **EVEN),
                 donor=replace(SCENE.substrates.donor, half_saturation=600.0, **EVEN))


def growing(acceptor, donor, active):
    """dX_A/dt and dX_I/dt, (9)-(10), written down anew."""
    m_a = acceptor / (acceptor + CLOSED.acceptor.half_saturation)
    m_d = donor / (donor + CLOSED.donor.half_saturation)
    b, f_d = LAW.decay_coefficient, LAW.degradable_fraction
    growth = LAW.maximum_utilization_rate * LAW.yield_coefficient * m_d - b
    return active * m_a * growth, active * m_a * b * (1 - f_d)


@cache
def _box(order: int) -> transport.Problem:
    return transport.problem(_space(order), None, CLOSED, LAW)


@cache
def _space(order: int) -> Space:
    geometry = min(order, 2)
    outline = half_disc(RADIUS, ACROSS_AGGREGATE * 0.5, geometry)
    return Space(generate(outline, (-BOX, BOX), Sizing(BOX, 0.3, 2.0), geometry)[0], order)


@cache
def _ours(step: float, order: int) -> np.ndarray:
    """(times, 4, 2): mean and range of C_A and C_D over the nodes, of X_A and X_I over the points of the reaction, in
    steps of so many hours."""
    made = _box(order)
    weight = made.space.reaction.dx
    active = SEEDED * weight
    inert, now, rows = 0 * active, transport.supplied_everywhere(made), []
    for interval in np.diff([0.0, *TIMES]):
        done = gear.advance(made, active, inert, now, interval, fixed_step=step)
        active, inert, now = done.active, done.inert, done.concentrations
        fields = (now.acceptor, now.donor, active / weight, inert / weight)
        rows.append([(field.mean(), np.ptp(field)) for field in fields])
    return np.array(rows)


def _theirs(times, order: int) -> np.ndarray:
    """(times, 4) by scipy."""
    space, law = _space(order), rates(LAW, CLOSED)
    share = space.reaction.dx.sum() / space.at.dx.sum()

    def right(_, y):
        sinks = uptake(y[0], y[1], law)
        return [-share * y[2] * sinks[0], -share * y[2] * sinks[1], *growing(*y[:3])]

    return solve_ivp(right, (0, times[-1]), [SUPPLY, SUPPLY, SEEDED, 0.0], t_eval=times, rtol=1e-11, atol=1e-10,
                     method="DOP853").y.T


#: Last errors of C_A, C_D, X_A and X_I.
CEILINGS = (4e-5, 1.5e-5, 6e-5, 1e-4)


NORM = "largest relative difference, twice a day for five days"


@case("transport-well-mixed", kind="cross-code", norm=f"{NORM}; X at constant C: relative, after five days",
      claim="In a closed, well-mixed pore C_A, C_D, X_A and X_I follow the four ordinary equations over days, with an "
            "error of second order in the step; at constant C the shape updates integrate X_A and X_I exactly",
      mutants=("inert-fraction", "yield-dropped", "remains-of-the-start", "growth-in-one-increment"))
def well_mixed() -> Outcome:
    checks, studies = _followed(1)
    exactly = at_most("X at constant C, 12 min steps", _constant_supply(), 1e-9,
                      "(9)-(10) are integrated exactly: round-off of 600 steps, and scipy's 1e-11")
    return Outcome((exactly, checks), studies, _profiles())


@case("transport-well-mixed-higher", kind="cross-code", norm=NORM, slow=True,
      claim="With quadratic and cubic concentrations C_A, C_D, X_A and X_I of the well-mixed pore follow the four "
            "ordinary equations alike",
      mutants=("storage-diagonal", "inert-fraction", "remains-of-the-start"))
def well_mixed_of_higher_order() -> Outcome:
    quadratic, cubic = _followed(2), _followed(3)
    return Outcome((quadratic[0], cubic[0]), (*quadratic[1], *cubic[1]))


def _followed(order: int) -> tuple[Check, tuple]:
    """How even the box is, and studies of the four."""
    exact = _theirs(TIMES, order)
    errors = np.array([np.abs(_ours(step, order)[:, :, 0] / exact - 1).max(axis=0) for step in STEPS])
    uneven = (_ours(STEPS[-1], order)[:, :, 1] / exact).max()
    return (at_most(f"unevenness in the box, {WORDS[order]}", uneven, 1e-6,
                    "L^2 / D over the time in which the supply lasts"),
            tuple(study(f"{name}, {WORDS[order]}", STEPS, errors[:, k], 2, "BDF2, started anew ten times",
                        ceiling=ceiling) for k, (name, ceiling) in enumerate(zip(NAMES, CEILINGS))))


def _constant_supply() -> float:
    """X_A and X_I as the quasi-steady scheme integrates them, over five days of 12 min updates."""
    acceptor, donor = 400.0, 900.0
    growth = kinetics.growth_rate(acceptor, donor, CLOSED, LAW)
    remains = kinetics.inert_rate(acceptor, CLOSED, LAW)
    active, inert = 3e4, 0.0
    for _ in range(600):
        active, inert = kinetics.grow(active, inert, growth, remains, 0.2)
    found = solve_ivp(lambda t, y: growing(acceptor, donor, y[0]), (0, TIMES[-1]), [3e4, 0.0], rtol=1e-12,
                      atol=1e-8, method="DOP853").y[:, -1]
    return float(np.abs(np.array([active, inert]) / found - 1).max())


def _profiles() -> tuple[Profile, ...]:
    """Substrates and biomass against time."""
    times = np.linspace(0.5, TIMES[-1], 121)
    exact, ours = _theirs(times, 1), _ours(STEPS[-1], 1)[:, :, 0]

    def curves(chosen):
        return tuple(part for k in chosen
                     for part in ((NAMES[k], "ours", TIMES, ours[:, k]),
                                  (f"{NAMES[k]}, solve_ivp", "reference", times, exact[:, k])))
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
      mutants=("biomass-of-the-start", "biomass-half-way", "mean-biomass-constant-in-c"))
def mean_biomass() -> Outcome:
    checks, studies = [], []
    for order in ORDERS:
        for hours in HOURS:
            checks += [_balanced(order, hours), _integrated(order, hours)]
        studies.append(_tangent(order, HOURS[-1]))
    return Outcome(tuple(checks), tuple(studies))


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
    return at_most(f"biomass made, {hours:g} h, {WORDS[order]}", abs(grown - asked) / grown, 1e-12,
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
    return at_most(f"uptake at constant C, {hours:g} h, {WORDS[order]}", np.abs(taken / found - 1).max(), 1e-10,
                   "scipy's 1e-12, in a few steps")


def _tangent(order: int, hours: float) -> Study:
    """Remainders of the residual along a direction."""
    made, random = _open(order), np.random.default_rng(13)
    balance = Balance(made, Sink(SCENE.kinetics.maximum_density * made.space.reaction.dx, hours))
    state, along = random.uniform(0.5, 1.0, (2, 2 * made.space.count))
    steps = 0.05 * 0.5 ** np.arange(4)
    linear, start = made.system.product(balance.tangent(state), along), balance.residual(state)
    left = [np.abs(balance.residual(state + s * along) - start - s * linear).max() for s in steps]
    return study(f"tangent, {hours:g} h, {WORDS[order]}", steps, left, 2, "Taylor's theorem: second order")
