"""Problems that are simpler than the paper's: narrow channels for substrates, boxes for flow.

The one-dimensional cases share narrow channels with random meshes and a slab of biomass from wall to wall. Their
references do not depend on y. Errors are averaged over several unrelated meshes of each size, because in a channel a
few elements wide the errors of single meshes scatter by a factor of 2. Linear concentrations are on straight
triangles, and quadratic ones on curved triangles, as in runs of the package.

Boxes have the exact velocity prescribed all around, for exact solutions of Stokes flow without inlet and outlet. The
element matrices of every form and order, the stabilisation, the assembly and the solver are those of ``repro``. Only
the boundary conditions of :mod:`repro.model.flow` are replaced, and a force may act. One pressure is prescribed,
because the velocity determines the pressure up to a constant. The mean of the pressure is not compared.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from repro.fem.assembly import ElementSystem, saddle_system
from repro.fem.mesh import Mesh
from repro.fem.space import Space
from repro.model import flow, transport
from repro.model.interface import interface_of
from repro.model.kinetics import Sink
from repro.model.transport_in_time import QuasiSteady
from repro.scene import load_scene
from verification.problems import meshes
from verification.problems.schemes import scheme_on

SCENE = load_scene("base")
WIDTH, SLAB = 10.0, 40.0
NAMES = ("acceptor", "donor")
HEIGHTS = 5
#: Under plug flow the slab is 0 < x < SLAB; without flow |x| < SLAB, between films of fluid of thickness FILM or none.
CROSSED, FILM = (-20.0, 60.0), 20.0
#: Ends of the channel with more fluid, for order 2.
WIDE = (-40.0, 80.0)
#: Element sizes (um) and the number of meshes of each. Coarse meshes are cheap and scatter most.
SAMPLES = {4.0: 12, 2.0: 6, 1.0: 3, 0.5: 1}
SECOND = "linear elements, lumped reaction: second order"
WORDS = {1: "linear", 2: "quadratic"}
#: Every order, by its word.
ORDERS = {word: order for order, word in WORDS.items()}
#: Expected orders of concentrations in L2, and their reasons.
EXPECTED = {1: (2, SECOND), 2: (3, "quadratic elements: third order in L2")}
#: Degree of the quadrature in which errors are integrated.
DEGREE = 6


def mesh_with_sides(area: float, size: float, sample: int, ends, width: float, is_biomass, **lines) -> Mesh:
    """The first of nine random meshes whose triangles follow all lines. Its biomass has the given area.

    Raises ValueError if the triangles of no mesh follow the lines.
    """
    for attempt in range(9):
        grid = meshes.channel(ends, width, size, is_biomass, **lines, seed=int(1000 * size) + 100 * sample + attempt)
        if np.isclose(grid.areas[grid.biomass].sum(), area, rtol=1e-12):
            return grid
    raise ValueError(f"size {size:g}, sample {sample}: no mesh follows the sides of the biomass")


@cache
def slab_space(size: float, sample: int, order: int = 1, ends=CROSSED, slab=(0.0, SLAB)) -> Space:
    """A space of an order on one of the meshes of a size."""
    sides = tuple(side for side in slab if side not in ends)
    straight = mesh_with_sides(WIDTH * (slab[1] - slab[0]), size, sample, ends, WIDTH,
                         lambda x, y: (x > slab[0]) & (x < slab[1]), across=sides)
    return meshes.space_on(straight, order)


def prescribed_flow(space: Space, velocity: np.ndarray, mean: float) -> flow.Flow:
    """A prescribed flow: velocity (n, 2) um/h at the nodes of the space, and its mean (um/h)."""
    correction = np.zeros((len(space.cells), 2)) if space.order == 1 else None
    return flow.Flow(mean, velocity, np.zeros(space.mesh.corners), correction, 0.0, 0.0, 1.0)


def problem(space: Space, speed: float | None, substrates=SCENE.substrates, law=SCENE.kinetics) -> transport.Problem:
    """Both substrates under plug flow at a uniform velocity (um/h). Without flow if it is None."""
    carried = None if speed is None else prescribed_flow(space, np.tile([speed, 0.0], (space.count, 1)), speed)
    return transport.problem(space, carried, substrates, law, scheme_on(space))


def uniform_masses(space: Space, density: float) -> np.ndarray:
    """(r, q) um2 mg/L, masses of biomass of a uniform density (mg/L)."""
    return density * space.reaction.dx


def steady(problem: transport.Problem, density: float, guess=None) -> transport.Concentrations:
    """Steady concentrations over biomass of a uniform density (mg/L).

    Quadratic elements take one more step of Newton's method. The method stops where no row errs by more than 1e-13 of
    its terms. At Peclet 0.1 and little uptake this may be 1e-8 of the supply, more than the error of the mesh.
    """
    sink = Sink(uniform_masses(problem.space, density))
    concentrations = QuasiSteady().settled(problem, sink, guess)
    if problem.space.order == 1:
        return concentrations
    balance = transport.Balance(problem, sink)
    state = both(concentrations).ravel()
    state = state + problem.system.solve(balance.tangent(state), -balance.residual(state))
    return concentrations.with_fields(state.reshape(-1, problem.space.count))


def decay_demand(law) -> float:
    """d_c f_d b of (7), 1/h."""
    return law.decay_oxygen_demand * law.degradable_fraction * law.decay_coefficient


def rates(law, substrates=SCENE.substrates) -> dict[str, float]:
    """Constants of the kinetics, as the references take them."""
    return {"k": law.maximum_utilization_rate, "F": law.acceptor_to_donor_ratio, "decay": decay_demand(law),
            "K_A": substrates.acceptor.half_saturation, "K_D": substrates.donor.half_saturation}


def pair(name: str, substrates=SCENE.substrates) -> tuple[float, float]:
    """A constant of both substrates, acceptor first."""
    return getattr(substrates.acceptor, name), getattr(substrates.donor, name)


def substrates_with(**changes: dict[str, float]):
    """The paper's substrates with other values, by substrate and name."""
    return replace(SCENE.substrates, **{name: replace(getattr(SCENE.substrates, name), **values)
                                        for name, values in changes.items()})


def speed_of(peclet: float) -> float:
    """u (um/h) of a Peclet number u SLAB / D of the acceptor in water."""
    return peclet * SCENE.substrates.acceptor.diffusivity / SLAB


def length(space: Space, size: float) -> float:
    """Size for studies of orders: nominal for linear elements, the mean of the mesh for others."""
    return size if space.order == 1 else meshes.mean_size(space.mesh)


def both(state: transport.Concentrations) -> np.ndarray:
    """(s, n) concentrations of the modelled substrates, (2, n) if both are modelled."""
    return state.fields


def in_points(space: Space) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Quadrature of errors: points (T, q, 2) um, weights (T, q) um2 and functions (q, k)."""
    return meshes.fine(space, degree=DEGREE)


def rms_errors(space: Space, fields: np.ndarray, exact) -> tuple[np.ndarray, np.ndarray]:
    """Root mean squares (m,) over the mesh of the errors of fields (m, n), and of exact(x, y) (m, T, q)."""
    where, weight, values = in_points(space)
    truth = np.asarray(exact(*np.moveaxis(where, 2, 0)))
    gap = fields[:, space.cells] @ values.T - truth
    return tuple(np.sqrt(np.sum(weight * part**2, axis=(1, 2)) / weight.sum()) for part in (gap, truth))


def at_heights(space: Space, fields: np.ndarray, x) -> np.ndarray:
    """(..., HEIGHTS, n) values of fields (..., count) at x (n,) and HEIGHTS heights."""
    y = WIDTH * (np.arange(HEIGHTS) + 0.5) / HEIGHTS
    where = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    return meshes.field_at(space, fields.T, where).T.reshape(*fields.shape[:-1], HEIGHTS, -1)


def box_errors(grid: Mesh, order: int, ratio: float, interface: str, exact: Callable) -> dict[str, float]:
    """Relative L2 errors of the velocity, and of the pressure without its mean.

    Unlike in :func:`repro.model.flow.unit_flow`, a node of the interface has one pressure here for both orders. A jump
    of the pressure therefore limits the orders of the errors.

    order: of the velocity; ratio: of the viscosities; exact(x, y): velocity (..., 2), pressure (...) and force
    (..., 2), all dimensionless.
    """
    space = meshes.space_on(grid, order)
    u, p = _box_flow(space, ratio, interface, exact)
    where, weight, shape = meshes.fine(space)
    truth, level, _ = exact(*np.moveaxis(where, 2, 0))
    heads = p[space.mesh.triangles] @ meshes.fine_linear(space).T
    computed, expected = (field - np.average(field, weights=weight) for field in (heads, level))
    return {"velocity": meshes.relative(shape @ u[space.cells], truth, weight),
            "pressure": meshes.relative(computed, expected, weight)}


def _box_flow(space: Space, ratio: float, interface: str, exact: Callable) -> tuple[np.ndarray, np.ndarray]:
    """Velocity (n, 2) at the nodes and pressure (m,) at the corners."""
    grid = space.mesh
    viscosity = np.where(grid.biomass, ratio, 1.0)
    lower = flow.PAIRS[space.order].on(space, viscosity).lower
    blocks = flow.stokes(space, viscosity, interface_of(interface), lower)
    system = grid.topology.system("box", lambda: _constrained_rim(space))
    fields = _load(space, exact), _without_flux(space, exact(*space.points.T)[0])
    right, value = (np.append(field.T, np.zeros(grid.corners)) for field in fields)
    solution = system.solve(blocks, right, value)
    velocity, pressure = np.split(solution, [2 * space.count])
    return velocity.reshape(2, -1).T, pressure


def _rim(space: Space) -> np.ndarray:
    """(n, 2) True for both components of the velocity at nodes on the boundary."""
    dofs = space.dofs
    on = np.zeros((space.count, 2), bool)
    on[np.concatenate([dofs.walls, dofs.inlet.ravel(), dofs.outlet.ravel()])] = True
    return on


def _constrained_rim(space: Space) -> ElementSystem:
    """The system in which all velocities of the rim and the first pressure are prescribed."""
    system = saddle_system(space.cells, space.mesh.triangles, _rim(space))
    constrained = system.constrained.copy()
    constrained[2 * space.count] = True
    return system.with_constrained(constrained)


def _without_flux(space: Space, velocity: np.ndarray) -> np.ndarray:
    """Velocity (n, 2) of the rim without net flux.

    The interpolated values have a small net flux, which a discrete incompressible flow cannot have. Therefore c (x, y)
    is subtracted at nodes in the fluid, where c is of the order of the interpolation error.
    """
    rim = _rim(space)
    values = np.where(rim, velocity, 0.0)
    rim[space.cells[space.mesh.biomass]] = False
    outwards = np.where(rim, space.points, 0.0)
    divergence = flow.divergence(space).sum(axis=1).reshape(len(space.cells), 2, -1)
    flux, unit = (np.einsum("tia,tai->", divergence, field[space.cells]) for field in (values, outwards))
    return values - flux / unit * outwards


def _load(space: Space, exact: Callable) -> np.ndarray:
    """(n, 2) integrals of the force times each nodal function."""
    where, weight, shape = meshes.fine(space)
    *_, force = exact(*np.moveaxis(where, -1, 0))
    load = np.zeros((space.count, 2))
    np.add.at(load, space.cells, np.einsum("tq,tqi,qa->tai", weight, force, shape))
    return load
