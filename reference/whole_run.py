"""The whole base run (section 4), continuous in time, by scikit-fem's quadratic elements on curved triangles.

Material at X at t = 0 has M_A and M_I: X_A and X_I per volume at t = 0, over X_m. Its mass grows as

    d log(M_A)/dt = m_A (k Y m_D - b),      dM_I/dt = M_A m_A b (1 - f_d),      theta = M_A + M_I

(9)-(10), M_A = 1 and M_I = 0 at t = 0. At every time the aggregate is in equilibrium under theta
(:mod:`reference.whole_run_body`), with X_A = X_m M_A / J. The fluid around it has a new mesh at every time
(:mod:`reference.whole_run_grid`) for the flow and the quasi-steady substrates (:mod:`reference.whole_run_pore`). M_A
and M_I are values at the quadrature points, which move with the aggregate, so that nothing is interpolated. The meshed
part ends min(10 thickness, 1.5 W) from the aggregate (3.1); outside it the flow is Poiseuille's. The classical
Runge-Kutta method of fourth order integrates in time, without the paper's shape updates of 12 min.
"""
from dataclasses import dataclass

import numpy as np

from reference.whole_run_body import Body
from reference.whole_run_grid import grid
from reference.whole_run_pore import ORDER, Flow, Section

M_PER_D = 24e-6
#: The numbers of a solution: m/d, m/d, um2, um, um, um, mg/L, mg/L.
NAMES = ("velocity", "conductivity", "area", "thickness", "upstream", "downstream", "acceptor", "donor")
#: Orders for the extrapolation in :func:`converged`: in space the least order observed on 8 to 16 rings, in time
#: that of the method.
SPACE, TIME = 3, 4


@dataclass(frozen=True)
class Pore:
    """Section 4's pore with the values of Table 1; pairs are of the acceptor (oxygen) and the donor (phenol).

    width, length: W, L (um); radius: R_0 (um); head over the whole pore (1e-3 cm, in um); viscosity: nu_water / g
    (um h); ratio: lambda; supply: 10 K_s (mg/L); diffusivity, in_biomass: D (um2/h); rates: K_A, K_D (mg/L), k, b and
    decay = d_c f_d b and remains = b (1 - f_d) (1/h), Y, and F as printed [E1]; density: X_m (mg/L).
    """

    width: float = 50.0
    length: float = 600.0
    radius: float = 5.0
    head: float = 10.0
    viscosity: float = 0.01003e8 / 9.81e6 / 3600
    ratio: float = 2.0e3
    supply: tuple[float, float] = (10.0, 10.0)
    diffusivity: tuple[float, float] = (2.32e8 / 24, 1.01e8 / 24)
    in_biomass: tuple[float, float] = (1.85e8 / 24, 0.81e8 / 24)
    k: float = 9.3 / 24
    b: float = 0.12 / 24
    Y: float = 0.61
    F: float = 1.52
    f_d: float = 0.8
    d_c: float = 1.42
    half_saturation: tuple[float, float] = (1.0, 1.0)
    density: float = 30_000.0

    @property
    def rates(self):
        """Rates for :mod:`reference.monod`."""
        return {"k": self.k, "F": self.F, "decay": self.d_c * self.f_d * self.b,
                "K_A": self.half_saturation[0], "K_D": self.half_saturation[1]}

    def growth(self, acceptor, donor):
        """F3 / X_A and F4 / X_A (1/h) in the shape of the concentrations (9)-(10)."""
        m_A, m_D = (C / (C + K) for C, K in zip((acceptor, donor), self.half_saturation))
        return m_A * (self.k * self.Y * m_D - self.b), m_A * self.b * (1 - self.f_d)


@dataclass(frozen=True, eq=False)
class CoupledSolution:
    """The solution at one time: outline a -> (x, y) (um); section and flow; loss (1/um) over the pore for a mean
    velocity of one; speed: mean velocity (um/h); active: X_A at the aggregate's points (mg/L); fields (2, K): C_A,
    C_D (mg/L)."""

    outline: object
    section: Section
    flow: Flow
    loss: float
    speed: float
    active: np.ndarray
    fields: np.ndarray


class Run:
    """The run of a pore on a grid of ``rings`` rings; its state is log(M_A) and M_I, (2, t, Q)."""

    def __init__(self, pore, rings):
        self.pore, self.grid = pore, grid(rings)
        self.body = Body(self.grid, pore.radius, ORDER)
        self.seed = np.zeros((2, *self.body.dx.shape))
        self.shape = self.body.start, np.zeros(self.body.lower.N), 1.0
        self.fields = np.multiply.outer(pore.supply, np.ones(self.grid.polar.shape[1]))

    def solve(self, state):
        """:class:`CoupledSolution` at a state. Newton's methods start from the last shape and concentrations."""
        theta, pore = np.exp(state[0]) + state[1], self.pore
        places = self._deform(theta)
        outline = self.grid.outline(places)
        ends = _ends(pore, outline)
        section = Section(self.grid, self.grid.around(places, pore.width, ends), pore.width, ends)
        flow = section.flow(pore.ratio)
        loss = flow.loss + 12 * (pore.length - ends[1] + ends[0]) / pore.width**2
        speed = pore.head / (pore.viscosity * loss)
        active = pore.density * np.exp(state[0]) * self.body.dx / section.body.dx
        self.fields = section.steady(section.operators(pore, speed, flow), active, pore.rates, self.fields)
        return CoupledSolution(outline, section, flow, loss, speed, active, self.fields)

    def _deform(self, theta):
        """Positions of the nodes under theta. The start is the previous shape, scaled with the mean theta."""
        places, pressure, before = self.shape
        mean = float(np.sum(theta * self.body.dx) / self.body.dx.sum())
        deformed = self.body.grown(theta, places * np.sqrt(mean / before), pressure * (mean / before) ** (-2 / 3))
        self.shape = *deformed, mean
        return deformed[0]

    def rate(self, state):
        """d state / dt (1/h)."""
        solution = self.solve(state)
        growth, remains = self.pore.growth(*solution.section.inside(solution.fields))
        return np.array([growth, np.exp(state[0]) * remains])

    def step(self, state, length):
        """The state after a Runge-Kutta step of ``length`` (h)."""
        a = self.rate(state)
        b = self.rate(state + length / 2 * a)
        c = self.rate(state + length / 2 * b)
        d = self.rate(state + length * c)
        return state + length / 6 * (a + 2 * b + 2 * c + d)

    def solutions(self, times, steps):
        """Yield :class:`CoupledSolution` at ascending ``times`` (h). ``steps`` lead to the first time;
        later steps are no longer."""
        state, previous_time = self.seed, 0.0
        for time in times:
            count = int(np.ceil(round((time - previous_time) / times[0] * steps, 6)))
            for _ in range(count):
                state = self.step(state, (time - previous_time) / count)
            previous_time = time
            yield self.solve(state)

    def numbers(self, solution):
        """The numbers in NAMES, (8,)."""
        conductivity = self.pore.length / (self.pore.viscosity * solution.loss)
        line = solution.outline(np.linspace(0.0, np.pi, 2001))
        return np.array([M_PER_D * solution.speed, M_PER_D * conductivity, solution.section.body.dx.sum(),
                         line[:, 1].max(), line[-1, 0], line[0, 0],
                         *solution.section.effluents(solution.flow, solution.fields)])


def _ends(pore, outline):
    """Ends (um) of the meshed part (3.1)."""
    (right, _), (left, _), (_, thickness) = map(outline, (0.0, np.pi, np.pi / 2))
    reach = min(10 * thickness, 1.5 * pore.width)
    return left - reach, right + reach


def numbers(pore, rings, steps, times):
    """The numbers in NAMES of the run of a pore at ``times`` (h), (times, 8); steps: up to the first time."""
    run = Run(pore, rings)
    return np.array([run.numbers(solution) for solution in run.solutions(times, steps)])


@dataclass(frozen=True, eq=False)
class Converged:
    """values (times, 8), of NAMES; space, time: corrections by extrapolation, which estimate the errors."""

    values: np.ndarray
    space: np.ndarray
    time: np.ndarray


def converged(pore, times, rings=(8, 12), steps=(8, 16)):
    """:class:`Converged` from three runs: a coarse one, one with more rings, one with more steps. The errors in space
    and in time add up, to first order; each is extrapolated. The relative error of Base at 19.2 and 19.4 h is 2e-5; the
    errors of effluents are relative to the supply."""
    coarse, fine, many = (numbers(pore, *size, times) for size in zip((rings[0], rings[1], rings[0]),
                                                                     (steps[0], steps[0], steps[1])))
    space = (fine - coarse) / ((rings[1] / rings[0]) ** SPACE - 1)
    time = (many - coarse) / ((steps[1] / steps[0]) ** TIME - 1)
    return Converged(fine + many - coarse + space + time, space, time)
