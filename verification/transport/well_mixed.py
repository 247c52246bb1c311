"""Closed pores in which diffusion evens out every concentration: (7)-(10) are four ordinary equations.

A seed in a closed box whose diffusivities are so large that C_A and C_D are uniform to 1e-6; X_A and X_I then are too.
With ``share`` of the box biomass,

    dC_A/dt = -share X_A m_A (k F m_D + d_c f_d b)        dX_A/dt = X_A m_A (k Y m_D - b)
    dC_D/dt = -share X_A k m_A m_D                        dX_I/dt = X_A m_A b (1 - f_d)

are integrated by scipy to 1e-11. The box is followed for five days, by when half of the acceptor is gone.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from scipy.integrate import solve_ivp

from reference.monod import uptake
from repro.fem import geometry, mesh
from repro.model import gear, kinetics, transport
from verification.case import Outcome, Profile, at_most, case
from verification.convergence import study
from verification.transport.channels import SCENE, rates

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


def biomass(acceptor, donor, active):
    """dX_A/dt and dX_I/dt, (9)-(10), written down anew."""
    m_a = acceptor / (acceptor + CLOSED.acceptor.half_saturation)
    m_d = donor / (donor + CLOSED.donor.half_saturation)
    b, f_d = LAW.decay_coefficient, LAW.degradable_fraction
    growth = LAW.maximum_utilization_rate * LAW.yield_coefficient * m_d - b
    return active * m_a * growth, active * m_a * b * (1 - f_d)


@cache
def _box():
    grid, _ = mesh.generate(geometry.seed(RADIUS, 0.5), (-BOX, BOX), geometry.Sizing(BOX, 0.3, 2.0))
    return transport.problem(grid, None, CLOSED, LAW)


@cache
def _ours(step: float) -> np.ndarray:
    """(times, 4, 2): mean and range over the nodes of C_A, C_D, X_A and X_I, in steps of so many hours."""
    made = _box()
    active = np.where(made.body > 0, SEEDED, 0.0)
    inert, now, rows = 0 * active, transport.supplied_everywhere(made), []
    for interval in np.diff([0.0, *TIMES]):
        done = gear.advance(made, active, inert, now, interval, fixed_step=step)
        active, inert, now = done.active, done.inert, done.concentrations
        fields = (now.acceptor, now.donor, active[made.mesh.body], inert[made.mesh.body])
        rows.append([(field.mean(), np.ptp(field)) for field in fields])
    return np.array(rows)


def _theirs(times) -> np.ndarray:
    """(times, 4) by scipy."""
    made, law = _box(), rates(LAW, CLOSED)
    share = made.body.sum() / made.total.sum()

    def right(_, y):
        sinks = uptake(y[0], y[1], law)
        return [-share * y[2] * sinks[0], -share * y[2] * sinks[1], *biomass(*y[:3])]

    return solve_ivp(right, (0, times[-1]), [SUPPLY, SUPPLY, SEEDED, 0.0], t_eval=times, rtol=1e-11, atol=1e-10,
                     method="DOP853").y.T


@case("transport-well-mixed", kind="cross-code",
      norm="largest relative difference, twice a day for five days; X at constant C: relative, after five days",
      claim="In a closed, well-mixed pore C_A, C_D, X_A and X_I follow the four ordinary equations over days, with an "
            "error of second order in the step; at constant C the shape updates integrate X_A and X_I exactly",
      mutants=("inert-fraction", "yield-dropped", "remains-of-the-start", "growth-in-one-increment"))
def well_mixed() -> Outcome:
    exact = _theirs(TIMES)
    errors = np.array([np.abs(_ours(step)[:, :, 0] / exact - 1).max(axis=0) for step in STEPS])
    studies = [study(name, STEPS, errors[:, k], 2, "BDF2, started anew ten times", ceiling=ceiling)
               for k, (name, ceiling) in enumerate(zip(NAMES, (4e-5, 1.5e-5, 6e-5, 1e-4)))]
    uneven = (_ours(STEPS[-1])[:, :, 1] / exact).max()
    return Outcome((at_most("X at constant C, 12 min steps", _constant_supply(), 1e-9,
                            "(9)-(10) are integrated exactly: round-off of 600 steps, and scipy's 1e-11"),
                    at_most("unevenness in the box", uneven, 1e-6, "L^2 / D over the time in which the supply lasts")),
                   tuple(studies), _profiles())


def _constant_supply() -> float:
    """X_A and X_I as the quasi-steady scheme integrates them, over five days of 12 min updates."""
    acceptor, donor = 400.0, 900.0
    growth = kinetics.growth_rate(acceptor, donor, CLOSED, LAW)
    remains = kinetics.inert_rate(acceptor, CLOSED, LAW)
    active, inert = 3e4, 0.0
    for _ in range(600):
        active, inert = kinetics.grow(active, inert, growth, remains, 0.2)
    found = solve_ivp(lambda t, y: biomass(acceptor, donor, y[0]), (0, TIMES[-1]), [3e4, 0.0], rtol=1e-12,
                      atol=1e-8, method="DOP853").y[:, -1]
    return float(np.abs(np.array([active, inert]) / found - 1).max())


def _profiles() -> tuple[Profile, ...]:
    """Substrates and biomass against time."""
    times = np.linspace(0.5, TIMES[-1], 121)
    exact, ours = _theirs(times), _ours(STEPS[-1])[:, :, 0]

    def curves(chosen):
        return tuple(part for k in chosen
                     for part in ((NAMES[k], "ours", TIMES, ours[:, k]),
                                  (f"{NAMES[k]}, solve_ivp", "reference", times, exact[:, k])))
    return (Profile("substrates", "time (h)", "C (mg/L)", curves((0, 1))),
            Profile("biomass", "time (h)", "X (mg/L)", curves((2, 3))))
