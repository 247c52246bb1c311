"""Diffusion and dual Monod uptake as a user of other packages would solve it: FiPy, py-pde, and plain scikit-fem.

    -D lap C + u dC/dx + X q(C_A, C_D) = 0       for both substrates, X in the biomass alone, D the same everywhere

with u = 0 and the supply at both ends, or with (11)-(12) there. FiPy solves the coupled equations with a direct solver.
The uptake is linearised as its manual recommends (Newton's method). py-pde integrates to the steady state in explicit
Euler steps compiled by numba; its adaptive Runge-Kutta method took longer. An expert's method uses the matrix of
py-pde's Laplacian in Newton's method (:mod:`reference.diffusion_reaction_pypde`). This package solves its transport on
right triangles that halve the square cells of their grids.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from fipy import (
    CellVariable,
    CentralDifferenceConvectionTerm,
    DiffusionTerm,
    Grid1D,
    Grid2D,
    ImplicitSourceTerm,
    LinearLUSolver,
)
from pde import PDE, CallbackTracker, CartesianGrid, Controller, EulerSolver, FieldCollection, ScalarField
from skfem import Basis, ElementTriP2, MeshTri, asm

from reference import channel_bvp
from reference import diffusion_reaction_pypde as pypde
from reference.monod import derivatives, uptake
from reference.whole_run import Pore
from reference.whole_run_pore import steady, stiffness
from repro.fem.mesh import Mesh
from repro.fem.walls import channel_walls
from repro.model import transport
from repro.model.kinetics import Sink
from repro.scene import load_scene
from verification.bench.record import clock, measured
from verification.problems import channels, meshes
from verification.problems.pairs import upright

#: Diffusivities (um2/h) of acceptor and donor, the same in fluid and biomass; density of the biomass and supply (mg/L);
#: kinetics in the form of :mod:`reference.monod`.
DIFFUSIVITY, DENSITY = (8e6, 4e6), 3e4
SUPPLY, RATES = Pore().supply, Pore().rates
#: FiPy: the change over the supply at which Newton's method stops, and the residual to which the direct solver refines.
#: The default residual, 1e-5, leaves an error of 1e-3 on fine grids.
CHANGE, RESIDUAL = 1e-8, 1e-14
MAX_ITERATIONS = 40
#: Duration of a py-pde run in diffusion times L^2 / D of the domain, with the supply at both ends or with an outlet.
#: Less than exp(-pi^2 TIMES) or exp(-pi^2 TIMES_OPEN / 4) of the start remains. Then the step over h^2 / D and
#: dimension, which is stable up to a half, and the number of parts in which the run is observed.
TIMES, TIMES_OPEN = 1.5, 6.0
STABLE, PARTS = 0.4, 100


@dataclass(frozen=True)
class Problem:
    """A problem with biomass where ``inside(x, y)``.

    box: ends (um) along, and across in two dimensions; linear, curved: numbers of cells for this package's elements of
    order 1 and 2; stepped: cells of py-pde's compiled run; speed: u (um/h).
    """

    box: tuple[tuple[float, float], ...]
    inside: Callable[..., np.ndarray]
    linear: tuple[int, ...]
    curved: tuple[int, ...]
    stepped: int
    speed: float = 0.0

    def cells(self, across: int) -> list[int]:
        """Cells along (and across) with ``across`` to the width, or to the length in one dimension."""
        lengths = np.ptp(self.box, axis=1)
        return [round(length / lengths[-1] * across) for length in lengths]

    def judged(self, fields, load) -> np.ndarray:
        """(2,) C in the last cell (mg/L), or without flow the uptake (um2 mg/L/h); load: X times the areas of the
        cells."""
        if self.speed:
            return fields[:, -1]
        return np.array([np.sum(load * q) for q in uptake(*fields, RATES)])


def fipy(problem: Problem, across: int) -> np.ndarray:
    """(2,) numbers of FiPy's solution."""
    mesh = _fipy_mesh(problem, across)
    where = problem.inside(*mesh.cellCenters.value)
    X = CellVariable(mesh=mesh, value=np.where(where, DENSITY, 0.0))
    both = [CellVariable(mesh=mesh, value=s) for s in SUPPLY]
    linear = [CellVariable(mesh=mesh) for _ in range(6)]
    equations = []
    for k, field in enumerate(both):
        *slopes, constant = linear[3 * k: 3 * k + 3]
        one = DiffusionTerm(coeff=DIFFUSIVITY[k], var=field) == X * constant
        for other, slope in zip(both, slopes):
            one = one + ImplicitSourceTerm(coeff=-X * slope, var=other)
        equations.append(one + _fipy_ends(problem, mesh, field, k))
    equation = equations[0] & equations[1]
    for _ in range(MAX_ITERATIONS):
        before = np.array([field.value for field in both])
        for variable, values in zip(linear, _linear(before)):
            variable.setValue(values)
        equation.sweep(solver=LinearLUSolver(tolerance=RESIDUAL))
        fields = np.array([field.value for field in both])
        if np.abs(fields - before).max() < CHANGE * max(SUPPLY):
            break
    return problem.judged(fields, X.value * mesh.cellVolumes)


def _fipy_mesh(problem: Problem, across: int):
    counts = problem.cells(across)
    steps = [(last - first) / count for (first, last), count in zip(problem.box, counts)]
    kind = Grid1D if len(counts) == 1 else Grid2D
    return kind(*steps, *counts) + [(first,) for first, _ in problem.box]


def _fipy_ends(problem: Problem, mesh, field, k: int):
    """The supply at both ends, or the term of advection. Its inflow u (C_supply - C) is a source in the first cell. The
    gradient at the outlet is constrained to zero, since nothing leaves FiPy's grid otherwise."""
    if not problem.speed:
        field.constrain(SUPPLY[k], mesh.facesLeft | mesh.facesRight)
        return 0.0
    field.faceGrad.constrain([0.0], where=mesh.facesRight)
    first = CellVariable(mesh=mesh, value=0.0)
    first[0] = problem.speed / mesh.dx
    return first * SUPPLY[k] - CentralDifferenceConvectionTerm(coeff=(problem.speed,), var=field)


def _linear(concentrations: np.ndarray) -> np.ndarray:
    """(6, n) q linearised at C (2, n): for the acceptor and then the donor the derivatives by C_A and C_D, by central
    differences, and the constant."""
    by = derivatives(concentrations, RATES)
    rest = np.array(uptake(*concentrations, RATES)) - np.einsum("kjn,jn->kn", by, concentrations)
    return np.concatenate([by, rest[:, None]], axis=1).reshape(6, -1)


def py_pde(problem: Problem, across: int) -> tuple[np.ndarray, dict]:
    """(2,) numbers of py-pde's solution, and the seconds (wall, processor) of numba's compilation: those of the run's
    first hundredth, less those of another one."""
    grid = CartesianGrid([list(ends) for ends in problem.box], problem.cells(across))
    where = problem.inside(*np.moveaxis(grid.cell_coords, -1, 0))
    X = ScalarField(grid, np.where(where, DENSITY, 0.0))
    ends = {f"{name}:*": _pde_ends(problem, k) for k, name in enumerate("AD")}
    equation = PDE(_pde_rules(problem), consts={"X": X}, bc_ops=ends)
    state = FieldCollection([ScalarField(grid, s, label=name) for s, name in zip(SUPPLY, "AD")])
    times = TIMES_OPEN if problem.speed else TIMES
    time = times * np.ptp(problem.box[0]) ** 2 / min(DIFFUSIVITY)
    dt = STABLE * min(grid.discretization) ** 2 / max(DIFFUSIVITY) / grid.num_axes
    marks = [clock()]
    watch = CallbackTracker(lambda state, t: marks.append(clock()), interrupts=time / PARTS)
    solution = Controller(EulerSolver(equation, backend="numba"), t_range=time, tracker=watch).run(state, dt=dt)
    fields = np.array([part.data.ravel() for part in solution])
    load = X.data.ravel() * np.prod(grid.discretization)
    return problem.judged(fields, load), _compiled(marks)


def _compiled(marks: list[np.ndarray]) -> dict[str, float]:
    """Time to the second mark of a callback (the first is at t = 0), less the mean interval between the other marks."""
    first, _, second, *_, last = marks
    seconds, cpu = second - first - (last - second) / (len(marks) - 3)
    return {"apart_seconds": seconds, "apart_cpu": cpu}


def _pde_rules(problem: Problem) -> dict[str, str]:
    """The equations in the syntax of py-pde."""
    r = RATES
    m_a, m_d = f"A / (A + {r['K_A']})", f"D / (D + {r['K_D']})"
    sinks = (f"X * {m_a} * ({r['k'] * r['F']} * {m_d} + {r['decay']})", f"X * {r['k']} * {m_a} * {m_d}")
    carried = [f" - {problem.speed} * d_dx({name})" if problem.speed else "" for name in "AD"]
    return {name: f"{d} * laplace({name}){carry} - {sink}"
            for name, d, carry, sink in zip("AD", DIFFUSIVITY, carried, sinks)}


def _pde_ends(problem: Problem, k: int) -> dict:
    supply, spread = SUPPLY[k], DIFFUSIVITY[k]
    if not problem.speed:
        ends = {"x": {"value": supply}}
    else:
        share = problem.speed / spread
        ends = {"x-": {"type": "mixed", "value": share, "const": share * supply}, "x+": {"derivative": 0.0}}
    return ends if len(problem.box) == 1 else {**ends, "y": {"derivative": 0.0}}


#: Substrates and kinetics of Table 1, with other diffusivities.
SCENE = load_scene("base", [f"substrates.{name}.{key}={d} um^2/h" for name, d in zip(channels.NAMES, DIFFUSIVITY)
                            for key in ("diffusivity", "diffusivity_in_aggregate")])


def solve_with_repro(problem: Problem, across: int, order: int) -> list[float]:
    """(2,) judged numbers, by linear (order 1) or quadratic elements on halved squares. In one dimension the mesh is a
    row of squares."""
    ends, (along, *rows) = problem.box[0], problem.cells(across)
    rows = rows or [1]
    width = rows[0] * np.ptp(ends) / along
    halved = MeshTri.init_tensor(np.linspace(*ends, along + 1), np.linspace(0.0, width, rows[0] + 1))
    points, triangles = upright(halved.p.T, halved.t.T)
    biomass = problem.inside(*points[triangles].mean(axis=1).T)
    space = meshes.space_on(Mesh.of(points, triangles, biomass, (), channel_walls(width), ends), order)
    solved = channels.problem(space, problem.speed or None, SCENE.substrates, SCENE.kinetics)
    sink = Sink(DENSITY * space.reaction.dx)
    fluxes = transport.fluxes(solved, sink, transport.steady(solved, sink))
    return [flux.effluent if problem.speed else flux.consumed for flux in fluxes]


#: Methods of this package, by the order of their elements.
COMPILED = "py-pde, compiled"
METHODS = {1: "linear elements (paper)", 2: "order 2 (fast, accurate)"}
QUADRATIC = "scikit-fem: quadratic elements"


def _compared(problem: Problem, about: tuple[str, str, str], other_codes: dict, truths, scale) -> dict:
    """A part of the benchmark. about: (title, error, reference), the latter formatted with the finer of both truths and
    their difference; other_codes: {name: (sizes, solve)}, ``solve(cells)`` returns (2,) numbers; truths: the reference,
    coarser first. py-pde's compiled run comes once, on one grid: numba compiles for longer than it runs.
    """
    coarse, truth = truths

    def error(uptake) -> float:
        return float(np.max(np.abs(uptake - truth) / scale))

    def solved(solve, cells: int) -> dict:
        return {"error": error(solve(cells))}

    def stepped() -> dict:
        uptake, compiled = py_pde(problem, problem.stepped)
        return {"error": error(uptake), **compiled}

    methods = {method: (problem.linear if order == 1 else problem.curved,
                        partial(solve_with_repro, problem, order=order))
               for order, method in METHODS.items()} | other_codes
    jobs = {(method, f"{cells} cells"): partial(solved, solve, cells)
            for method, (sizes, solve) in methods.items() for cells in sizes}
    once = {(COMPILED, f"{problem.stepped} cells"): stepped}
    title, judged, reference = about
    return {"title": title, "error": judged, "reference": reference.format(*truth, error(coarse)), "repeats": REPEATS,
            "lines": measured(jobs, REPEATS) + measured(once, 1)}


#: Counted runs of a job.
REPEATS = 3
HALF = WIDTH = 64.0
SIDE = 32.0


def _inside(x, y):
    return (np.abs(x) < SIDE) & (y < SIDE)


#: Cells across the width.
BOX = Problem(((-HALF, HALF), (0.0, WIDTH)), _inside, (8, 16, 32, 64, 96), (2, 4, 8, 16, 24), 16)
#: Of the box's reference, cells across.
COARSE, FINE = 32, 64


def box_part() -> dict:
    """Diffusion and dual Monod uptake in a box with a block of biomass. The sides of the block follow the cells of FiPy
    and py-pde. The error is that of the uptake."""
    truths = [quadratic(cells) for cells in (COARSE, FINE)]
    cells = (8, 16, 32, 64)
    other_codes = {QUADRATIC: ((4, 8, 16), quadratic), "fipy": (cells, partial(fipy, BOX)),
              "py-pde's Laplacian, Newton by scipy": (cells, _newton)}
    about = ("Uptake without flow: a block of 64 by 32 um in a box of 128 by 64 um; grid, assembly, solution",
             "what is taken up of each substrate, relative, the larger error",
             f"quadratic elements of scikit-fem, {FINE} cells across: {{:.9g}} and {{:.9g}} um2 mg/L/h; from {COARSE} "
             "cells on they change by {:.1e}")
    return _compared(BOX, about, other_codes, truths, truths[1])


def _newton(cells: int) -> np.ndarray:
    box = pypde.Box(cells, HALF, WIDTH, pypde.block(SIDE, SIDE))
    fields = box.steady(DIFFUSIVITY, SUPPLY, DENSITY, RATES)
    return BOX.judged(fields, DENSITY * box.part * (WIDTH / cells) ** 2)


def quadratic(cells: int) -> np.ndarray:
    """(2,) uptake from scikit-fem's quadratic elements and Newton's method."""
    mesh = MeshTri.init_tensor(np.linspace(-HALF, HALF, 2 * cells + 1), np.linspace(0.0, WIDTH, cells + 1))
    domain = Basis(mesh, ElementTriP2(), intorder=6)
    body = Basis(mesh, ElementTriP2(), intorder=6, elements=np.flatnonzero(_inside(*mesh.p[:, mesh.t].mean(axis=1))))
    laplace = asm(stiffness, domain)
    inner = np.flatnonzero(np.abs(domain.doflocs[0]) < HALF * (1 - 1e-9))
    fields = steady(body, [(d * laplace, 0.0) for d in DIFFUSIVITY], DENSITY, RATES,
                    np.outer(SUPPLY, np.ones(domain.N)), inner)
    return BOX.judged([body.interpolate(field) for field in fields], DENSITY * body.dx)


#: um; um/h.
ENDS, STRIP = (-40.0, 80.0), 40.0
SPEED = 1e5
#: Cells along, multiples of three: faces lie on both ends of the strip.
CHANNEL = Problem((ENDS,), lambda x, *y: (x > 0) & (x < STRIP), (15, 30, 60, 120, 240, 480), (6, 12, 24, 48, 96), 60,
                  SPEED)


def channel_part() -> dict:
    """Plug flow through a strip of biomass with dual Monod uptake, one-dimensional: error of the effluents.

    Other codes solve it in one dimension; this package uses a ribbon of one cell across, with more than twice the
    unknowns.
    """
    other_codes = {"fipy": ((30, 60, 120, 240, 480), partial(fipy, CHANNEL))}
    about = ("Uptake in plug flow through a strip, one-dimensional; grid, assembly and solution",
             "effluents over the supply, the larger error",
             "scipy's solve_bvp, tolerance 1e-9: {:.9f} and {:.9f} mg/L; from 1e-7 on they change by {:.1e} of the "
             "supply")
    return _compared(CHANNEL, about, other_codes, [reference(1e-7), reference(1e-9)], SUPPLY)


def reference(tolerance: float) -> np.ndarray:
    """(2,) effluents, mg/L."""
    solution = channel_bvp.solve(SPEED, SUPPLY, DIFFUSIVITY, DIFFUSIVITY, DENSITY, RATES, STRIP, tolerance)
    return solution(np.array([STRIP]))[:, 0]
