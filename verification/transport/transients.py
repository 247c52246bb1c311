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
from scipy.spatial import cKDTree
from skfem import Basis, BilinearForm, ElementTriP2, ElementTriP3, MeshTri

from reference import channel_fipy
from reference.monod import sink, slopes
from repro.fem.space import Space
from repro.model import gear, transport
from verification.case import Outcome, Profile, case
from verification.convergence import refine, study
from verification.transport.channels import (
    CROSSED,
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
from verification.transport.monod_channel import COMBINATIONS, given, titled

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
      mutants=("carry-of-bdf2", "backward-euler", "storage-of-the-biomass-alone", "storage-diagonal"))
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
      mutants=("storage-of-the-biomass-alone", "storage-diagonal"), slow=True)
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
