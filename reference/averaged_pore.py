"""A pore averaged over its cross-sections: flow, substrates and growth in one dimension, by FiPy and scipy.

An aggregate of height h(x) lies on the lower wall of the channel 0 < y < W, -L/2 < x < L/2. The model is the limit of
an aggregate that is long compared with W, with little uptake over its height. Its error scales with the squares of the
slope and of the transverse Thiele number h sqrt(X q / (D C)).

*Flow* is fully developed in each section, between two layers (:mod:`reference.layered_channel`): with the mean velocity
u of the open channel, the flux u W is the same everywhere and the loss is the integral of G(h) dx (lubrication).

*Substrates* are constant over a section. With the flux u W C, steady,

    (u W C)' = ((D (W - h) + D_B h) C')' - X h q(C_A, C_D),   u W C - D W C' = u W C_s at -L/2,   C' = 0 at L/2

in FiPy's finite volumes, as in :mod:`reference.channel_fipy` (FiPy's outlet passes nothing unless the gradient is
constrained there). The uptake is added cell by cell, and Newton's method solves the equations.

*Growth.* a and i are X_A and X_I in the material of a cell, over X_m and per volume at t = 0: a' = a r_A(C),
i' = a r_I(C), (9)-(10), in the mean over the aggregate; its area grows by theta = a + i. An aggregate that keeps its
shape, as a half-disc nearly does, stretches by sqrt(theta); its biomass is uniform, and x = 0 stays in place.

Units are consistent. Pairs are (acceptor, donor).
"""
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
import scipy.sparse as sp
from fipy import CentralDifferenceConvectionTerm, Grid1D
from scipy.integrate import solve_ivp
from scipy.optimize import root
from scipy.sparse.linalg import spsolve

from reference import layered_channel
from reference.channel_fipy import diffusion, matrix
from reference.monod import derivatives, sink_derivative, uptake

TOLERANCE, MAX_ITERATIONS = 1e-13, 50
#: Fractions of a Newton step that are tried. If none reduces the defect, the defect is round-off and the full step is
#: taken.
STEP_FRACTIONS = 0.5 ** np.arange(10)


@dataclass(frozen=True)
class Pore:
    """width, length: W, L; ratio: lambda; supply, diffusivity, in_biomass: pairs; density: X_m; rates: dict of k, F,
    decay = d_c f_d b, K_A, K_D, Y, b, remains = b (1 - f_d); speed: mean velocity from (loss of the whole pore per mean
    velocity, without nu/g; half the length of the aggregate)."""

    width: float
    length: float
    ratio: float
    supply: tuple[float, float]
    diffusivity: tuple[float, float]
    in_biomass: tuple[float, float]
    density: float
    rates: dict[str, float]
    speed: Callable[[float, float], float]


@dataclass(frozen=True)
class AveragedState:
    """The pore at one time: x (n,) midpoints of the cells, fields (2, n) C_A and C_D, velocity, and the area of the
    aggregate and x of its ends."""

    time: float
    x: np.ndarray
    fields: np.ndarray
    velocity: float
    area: float
    ends: tuple[float, float]


def half_ellipse(half_length, thickness, cells):
    """(lengths (n,), mean heights (n,)) of equal cells of a half-ellipse around x = 0. The area is exact."""
    s = np.linspace(-1.0, 1.0, cells + 1)
    below = 0.5 * (s * np.sqrt(1 - s**2) + np.arcsin(s))
    return half_length * np.diff(s), thickness * np.diff(below) / np.diff(s)


class Section:
    """One geometry: an aggregate of cells ``lengths`` and ``heights`` (n,) that starts at x = left, and ``fluid`` equal
    cells upstream and downstream of it."""

    def __init__(self, pore, left, lengths, heights, fluid):
        self.pore, self.inside = pore, slice(fluid, fluid + len(lengths))
        self.ends = left, left + lengths.sum()
        before, behind = (np.full(fluid, (pore.length / 2 + gap) / fluid) for gap in (left, -self.ends[1]))
        self.lengths = np.concatenate([before, lengths, behind])
        self.heights = np.concatenate([np.zeros(fluid), heights, np.zeros(fluid)])
        loss = float(self.lengths @ layered_channel.gradient(pore.width, self.heights, pore.ratio))
        self.velocity = pore.speed(loss, (self.ends[1] - self.ends[0]) / 2)
        self.mesh = Grid1D(dx=self.lengths)
        self.x = np.array(self.mesh.cellCenters.value[0]) - pore.length / 2
        advection = self.velocity * pore.width * _unit_flux(len(self.lengths))
        diffusion_matrices = [self._diffusion_matrix(*pair) for pair in zip(pore.diffusivity, pore.in_biomass)]
        self.transport = sp.block_diag([advection + diffusion for diffusion in diffusion_matrices], "csr")
        self.source = np.zeros((2, len(self.lengths)))
        self.source[:, 0] = self.velocity * pore.width * np.array(pore.supply)

    def _diffusion_matrix(self, water, biomass):
        """FiPy's matrix of diffusion."""
        section = water * (self.pore.width - self.heights) + biomass * self.heights
        return matrix(-diffusion(self.mesh, section), self.mesh)

    def steady(self, active, start=None):
        """Steady concentrations (2, n); active: X_A of the aggregate's cells (K,); start: the first iterate."""
        weight = np.zeros(len(self.lengths))
        weight[self.inside] = (self.lengths * self.heights)[self.inside] * active
        fields = np.repeat(self.pore.supply, len(weight)).reshape(2, -1) if start is None else start
        for _ in range(MAX_ITERATIONS):
            defect, size = self._defect(weight, fields)
            if (np.abs(defect) <= TOLERANCE * size).all():
                return fields
            derivative = self.transport + sink_derivative(fields, weight, self.pore.rates)
            step = spsolve(sp.csc_array(derivative), defect).reshape(2, -1)
            reducing = (part for part in STEP_FRACTIONS if self._reduces_defect(weight, fields, part * step))
            fields = fields + step * next(reducing, 1.0)
        raise RuntimeError(f"the finite volumes did not converge: residual {(np.abs(defect) / size).max():.2g}")

    def _reduces_defect(self, weight, fields, step):
        return np.abs(self._defect(weight, fields + step)[0]).sum() < np.abs(self._defect(weight, fields)[0]).sum()

    def _defect(self, weight, fields):
        """The residual of the cells' balances, and the size of its terms, at least that of the larger supply."""
        sinks = weight * np.stack(uptake(*fields, self.pore.rates))
        size = (self.source + np.abs(sinks)).ravel() + abs(self.transport) @ np.abs(fields.ravel())
        size = size + self.source.max()
        return (self.source - sinks).ravel() - self.transport @ fields.ravel(), size


@cache
def _unit_flux(cells):
    """FiPy's matrix of advection by a flux of one. Central differences do not use the cells' lengths."""
    return matrix(CentralDifferenceConvectionTerm(coeff=(1.0,)), Grid1D(nx=cells, dx=1.0))


class Averaged:
    """The run of a seed with cells of ``lengths`` and ``heights`` (n,). fluid: number of cells on each side of it."""

    def __init__(self, pore, lengths, heights, fluid):
        self.pore = pore
        self.lengths = lengths
        self.heights = heights
        self.fluid = fluid
        self.areas = lengths * heights
        self.fields = None
        self.supply = lambda _: pore.supply

    def seed(self):
        """The state at t = 0."""
        return self._state_at(0.0, self._start())

    def run(self, times, accuracy=1e-6):
        """The states at ``times``, which are ascending; the last one is after t = 0."""
        solution = solve_ivp(self._growth_rates, (0.0, times[-1]), self._start(), method="DOP853", t_eval=times,
                          rtol=accuracy, atol=accuracy)
        return [self._state_at(time, state) for time, state in zip(solution.t, solution.y.T)]

    def run_through(self, pieces, times, accuracy):
        """The states at ``times``, which are ascending, while the supply changes linearly within each piece.

        pieces: (end, supply at the piece's start, supply at its end), ascending; the last piece ends at the last time.
        A state at the end of a piece has the supply of the next piece's start."""
        state = self._start()
        begin = 0.0
        states = []
        for number, (end, first, last) in enumerate(pieces, 1):
            self.fields = None
            self.supply = partial(_interpolate, begin, end, np.array(first), np.array(last))
            times_in_piece = [time for time in times if begin <= time < end or (number == len(pieces) and time == end)]
            piece = solve_ivp(self._growth_rates, (begin, end), state, method="DOP853", dense_output=True,
                              rtol=accuracy, atol=accuracy)
            states += [self._state_at(time, piece.sol(time)) for time in times_in_piece]
            state, begin = piece.y[:, -1], end
        return states

    def _start(self):
        return np.concatenate([np.ones_like(self.areas), np.zeros_like(self.areas)])

    def _mean(self, values):
        """The mean of the values of the cells over the aggregate, in each cell."""
        return np.full_like(values, self.areas @ values / self.areas.sum())

    def _solve_section(self, time, state):
        """The section and theta; the concentrations are stored in ``fields``."""
        pore = replace(self.pore, supply=tuple(self.supply(time)))
        active, inert = state.reshape(2, -1)
        theta = active + inert
        lengths, heights = np.sqrt(theta) * self.lengths, np.sqrt(theta) * self.heights
        section = Section(pore, -lengths[: len(lengths) // 2].sum(), lengths, heights, self.fluid)
        self.fields = section.steady(self.pore.density * active / theta, self.fields)
        return section, theta

    def _growth_rates(self, time, state):
        section, _ = self._solve_section(time, state)
        rates, active = self.pore.rates, state[: len(self.areas)]
        m_a, m_d = (c[section.inside] / (c[section.inside] + rates[key]) for c, key in zip(self.fields, ("K_A", "K_D")))
        growth, remains = m_a * (rates["k"] * rates["Y"] * m_d - rates["b"]), m_a * rates["remains"]
        return np.concatenate([self._mean(active * growth), self._mean(active * remains)])

    def _state_at(self, time, state):
        section, theta = self._solve_section(time, state)
        return AveragedState(time, section.x, self.fields, section.velocity, float(self.areas @ theta), section.ends)


def _interpolate(begin, end, first, last, time):
    """Linear interpolation from ``first`` to ``last``."""
    return first + (last - first) * (time - begin) / (end - begin)


def constriction(radius, width, modes=80, points=400):
    """K: the mean deficit in a half-disc of uniform uptake, relative to the means over its sections.

    Green's function of -lap in the strip, minus that of the mean over the section, is the sum over n >= 1 of
    cos(n pi y/W) cos(n pi y'/W) exp(-n pi |x - x'|/W) / (n pi). K A is its double integral over the half-disc. For an
    uptake X q in biomass with the fluid's diffusivity, the deficit is K X q / D.
    """
    s, weight = np.polynomial.legendre.leggauss(points)
    x, height = radius * np.sin(np.pi / 2 * s), radius * np.cos(np.pi / 2 * s)
    distances, total = np.abs(x[:, None] - x), 0.0
    for k in np.arange(1, modes + 1) * np.pi / width:
        column = np.pi / 2 * weight * height * np.sin(k * height) / k
        total += column @ np.exp(-k * distances) @ column / (k * width)
    return total / (np.pi / 2 * radius**2)


def excess(pore, radius, velocity):
    """Effluents of a half-disc minus those of its averaged pore, (2,), to first order in 1 / D.

    In a mixed pore of concentrations c, both models have u W (C_s - c) = X A q(c). The uptake of the two-dimensional
    pore is that at c - K X q / D. The balance, linear around c, gives (u W + X A q') excess = X A q' (K X q / D).
    """
    supply, uptaken = np.array(pore.supply), pore.density * np.pi / 2 * radius**2
    carried = velocity * pore.width
    mixed = root(lambda c: carried * (supply - c) - uptaken * np.array(uptake(*c, pore.rates)), supply, tol=1e-13).x
    deficit = constriction(radius, pore.width) * pore.density * np.array(uptake(*mixed, pore.rates)) / pore.diffusivity
    rises = uptaken * derivatives(mixed, pore.rates)
    return np.linalg.solve(carried * np.eye(2) + rises, rises @ deficit)
