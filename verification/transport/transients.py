"""The modified Gear scheme (3.3): from the supply everywhere towards the steady profiles of :mod:`.monod_channel`.

X_A does not change (no yield, and less than 1e-5 of it decays). In time the scheme is compared with an integrator that
makes no error of its own, on the same mesh; in space with FiPy, whose cells are integrated without an error in time;
and in time with FiPy's own scheme, which is of first order.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import scipy.sparse as sp
from scipy.integrate import solve_ivp

from reference import channel_fipy
from reference.monod import sink, slopes
from repro.model import gear, transport
from verification.case import Outcome, Profile, case
from verification.convergence import refine, study
from verification.transport.channels import (
    CROSSED,
    SCENE,
    along,
    at_heights,
    averaged,
    both,
    filled,
    meshed,
    pair,
    problem,
    rates,
    speed_of,
)
from verification.transport.monod_channel import COMBINATIONS, NAMES, given, titled

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
def _assembled(size: float, sample: int, peclet: float) -> transport.Problem:
    return problem(meshed(size, sample), speed_of(peclet), law=LAW)


@cache
def _ours(size: float, sample: int, peclet: float, density: float, steps: int) -> np.ndarray:
    """(times, 2, N): each interval in equal steps, started anew from the end of the last."""
    made, states, last = _assembled(size, sample, peclet), [], 0.0
    active = filled(made.mesh, density)
    now = transport.supplied_everywhere(made)
    for time in TIMES:
        interval, last = time - last, time
        now = gear.advance(made, active, 0 * active, now, interval, fixed_step=interval / steps).concentrations
        states.append(both(now))
    return np.array(states)


@cache
def _exact_in_time(size: float, sample: int, peclet: float, density: float) -> np.ndarray:
    """(times, 2, N): the same equations in space, M dC/dt = b - L C - m X q, by scipy's integrator to 1e-8."""
    made, law = _assembled(size, sample, peclet), rates(LAW)
    matrix = sp.block_diag([operator.matrix for operator in made.both], "csc")
    source, mass = np.concatenate([operator.source for operator in made.both]), np.tile(made.total, 2)
    load = made.body * density
    start = np.repeat(pair("supply"), len(made.total))
    found = solve_ivp(lambda t, y: (source - matrix @ y - sink(y, load, law)) / mass, (0.0, TIMES[-1]), start,
                      jac=lambda t, y: sp.csc_array(sp.diags_array(-1 / mass) @ (matrix + slopes(y, load, law))),
                      method="BDF", t_eval=TIMES, rtol=1e-8, atol=1e-8)
    return found.y.T.reshape(len(TIMES), 2, -1)


def _largest(apart: np.ndarray) -> dict[str, float]:
    """Of each substrate, over the times: the root mean square over the places (times, 2, ...), over its supply."""
    sizes = np.sqrt(np.mean(apart**2, axis=tuple(range(2, apart.ndim)))).max(axis=0)
    return dict(zip(NAMES, sizes / pair("supply")))


#: Combinations whose error in time is studied, and the last error of each.
IN_TIME = {(0.1, 3e5): 2e-5, (1.0, 3e4): 3e-6, (5.0, 3e5): 1e-5}


@case("transport-gear-in-time", kind="cross-code",
      norm="largest over three times of the root mean square over the nodes, over the supply",
      claim="On a given mesh the modified Gear scheme's concentrations are those of scipy's integrator, with an error "
            "of second order in the step",
      mutants=("carry-of-bdf2", "backward-euler", "storage-of-the-biomass-alone"))
def in_time() -> Outcome:
    return Outcome(studies=tuple(part for combination in IN_TIME for part in _in_time(*combination)))


def _in_time(peclet: float, density: float):
    steps = np.array(STEPS)
    exact = _exact_in_time(SIZES[0], 0, peclet, density)
    rows = [_largest(_ours(SIZES[0], 0, peclet, density, n) - exact) for n in STEPS]
    return [study(f"{name}, {titled(peclet, density)}", TIMES[0] / steps, [row[name] for row in rows], 2,
                  "BDF2 after a first step of backward Euler", ceiling=IN_TIME[peclet, density]) for name in NAMES]


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


def _at_cells(size: float, sample: int, peclet: float, density: float, steps: int) -> np.ndarray:
    """(times, 2, 5, n) ours at FiPy's cells, at five heights."""
    states, x = _ours(size, sample, peclet, density, steps), _channel(size, peclet, density).x
    return np.stack([at_heights(meshed(size, sample), state, x) for state in states])


@case("transport-gear-fipy", kind="cross-code",
      norm="largest over three times of the root mean square over FiPy's cells, at five heights, over the supply; "
           "several meshes a size",
      claim="Transient profiles of both substrates are FiPy's, both codes refined together in space, at Peclet 0.1, 1, "
            "5 times Thiele numbers 0.6, 1.9, 6; and refined in time, where FiPy's own scheme is of first order",
      mutants=("storage-of-the-biomass-alone",), slow=True)
def in_space() -> Outcome:
    studies = [part for combination in COMBINATIONS for part in _in_space(*combination)]
    return Outcome(studies=(*studies, *_from_backward_euler(1.0, 3e4)),
                   profiles=tuple(_profile(*combination) for combination in COMBINATIONS))


def _in_space(peclet: float, density: float):
    errors = refine(lambda size: averaged(_from_fipy, size, peclet, density, samples=SAMPLES), SIZES)
    return [study(f"{name}, {titled(peclet, density)}", SIZES, errors[name], 2,
                  "both codes are of second order; the error in time is a tenth", ceiling=CEILINGS[density])
            for name in NAMES]


def _from_fipy(size: float, sample: int, peclet: float, density: float) -> dict[str, float]:
    ours = _at_cells(size, sample, peclet, density, round(STEPS[-1] / size))
    return _largest(ours - _fipy(size, peclet, density)[:, :, None])


def _profile(peclet: float, density: float) -> Profile:
    size, curves = SIZES[-1], []
    x, grid = _channel(size, peclet, density).x, meshed(size, 0)
    for time, ours, theirs in zip(TIMES, _ours(size, 0, peclet, density, STEPS[-1]), _fipy(size, peclet, density)):
        for k, name in enumerate(NAMES):
            once = "FiPy" if not curves else "_"  # a name with an underscore is left out of the legend
            curves += [(f"{name}, {3600 * time:.2g} s", "ours", x, along(grid, ours[k], x)),
                       (once, "reference", x, theirs[k])]
    return Profile(titled(peclet, density), "x (um)", "C (mg/L)", tuple(curves))
