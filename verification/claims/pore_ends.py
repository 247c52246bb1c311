"""C20, C36: the fluid between the aggregate and the pore's ends, and the condition at the outlet.

C19: how far from the aggregate the pore must be meshed (3.1).

The meshes are nested: a core around the aggregate, and columns of triangles beyond it. A longer mesh contains all
columns of a shorter one. The difference of two meshes is therefore the effect of the missing columns; two unrelated
meshes differ by more. The resistance of columns of linear elements is some tenths of a percent too large. This is no
effect of the truncation: the same mesh without biomass shows it, and it is subtracted.
"""

from dataclasses import replace

import numpy as np

from repro.errors import TransportError
from repro.fem.mesh import Mesh
from repro.fem.newton import Newton
from repro.model import transport
from repro.model.kinetics import Sink
from repro.model.meshing import sized
from repro.model.pore import Pore
from repro.model.solving import Solved
from repro.model.transport import Concentrations
from repro.scene import Scene
from verification.claims import FEW, FEW_WORDS, OF_SCHEME, TRANSPORT, TRANSPORT_WORDS, Finding, at_most, claim, near
from verification.claims.levels import ALONE, BESIDE, cached
from verification.claims.permeability import clean
from verification.claims.runs import (
    BASE,
    PLOTTED,
    SUBSTRATES,
    flow_in,
    full_biomass,
    half_disc,
    halved,
    load_packaged,
    remeshed,
    solution,
    solved_pore,
)
from verification.problems.meshes import field_at

PARTS = 64


@cached
def fully_meshed_pore(*changes: str) -> tuple[Scene, Pore, Solved]:
    """The aggregate of base at 19.2 h in a mesh of the whole pore, at the same mean velocity, solved.

    changes: KEY=VALUE of the scene, such as a longer pore.
    """
    pore, solved = solved_pore(BASE, PLOTTED)
    scene = load_packaged(*BASE, 'numerics.extent="full"', *changes)
    scene = replace(scene, flow=replace(scene.flow, head=None, mean_velocity=solved.flow.mean_velocity))
    return scene, *remeshed(scene, pore, solved)


@claim("C20", "3.1", "(26) describes the unmeshed part", about=OF_SCHEME, sizes=BESIDE)
def upstream_profile() -> Finding:
    """Concentrations upstream in the wholly meshed pore of base at 19.2 h against (26), alpha fitted at one section.

    The section is 1 W from the aggregate, where the mesh may end (C19). The claim compares the means over sections from
    there to the pore's inlet, and reports the range of concentrations within a section, in which (26) takes them as
    constant.
    """
    scene, pore, solved = fully_meshed_pore()
    x = np.linspace(pore.outline.upstream - scene.pore.width, -scene.pore.length / 2, 40)
    checks, parts = [], []
    for name in SUBSTRATES:
        substrate, field = getattr(scene.substrates, name), getattr(solved.concentrations, name)
        across = 100 * sections(pore, field, x) / substrate.supply
        rate = solved.flow.mean_velocity / substrate.diffusivity
        law = 100 - (100 - across[0].mean()) * np.exp(rate * (x - x[0]))
        bend = np.ptp(across, axis=1)
        checks += [at_most(f"{name}: error of (26) for the mean of a section (% of the supply)", "describes it",
                           np.abs(across.mean(axis=1) - law).max(), 100 * TRANSPORT, TRANSPORT_WORDS),
                   at_most(f"{name}: largest range within a section (% of the supply)", "isolines perpendicular",
                           bend.max(), 100 * FEW, FEW_WORDS)]
        parts.append(f"{name} {bend[0]:.2g} % 1 W from the aggregate, {bend[-1]:.2g} % at the pore's inlet")
    return Finding(tuple(checks), note="Range within a section: " + "; ".join(parts) + ". There (11) with the local "
                   "u_x bends the isolines [E4].")


def sections(pore: Pore, field: np.ndarray, x: np.ndarray) -> np.ndarray:
    """(n, PARTS) values of a nodal field at the middles of equal parts of the sections x (n,)."""
    heights = (np.arange(PARTS) + 0.5) / PARTS * pore.mesh.width
    where = np.stack(np.meshgrid(x, heights, indexing="ij"), axis=-1).reshape(-1, 2)
    return field_at(pore.space, field, where).reshape(len(x), PARTS)


LENGTHS = (600.0, 900.0, 1200.0)


@claim("C36", "2.2", "the flux is not affected by the condition at the downgradient end (12), if the channel is long "
       "enough", date="2026-11-29 17:14")
def downgradient_end() -> Finding:
    """Uptake of the aggregate of base at 19.2 h with other positions of the outlet and other values there.

    The mean velocity is the same. First (12) applies at the end of the meshed part and of the whole pore. Then C at the
    pore's end is zero or the supply: the least and the most that a next pore can offer. Then the same applies in longer
    pores.
    """
    scene, _, full = fully_meshed_pore()
    _, central = remeshed(replace(scene, numerics=load_packaged(*BASE).numerics), *solved_pore(BASE, PLOTTED))
    effects = np.array([end_effect(f'pore.length="{length} um"') for length in LENGTHS])
    rate = scene.flow.mean_velocity / scene.substrates.acceptor.diffusivity
    decay = np.log(effects[1] / effects[2]) / (0.5 * (LENGTHS[2] - LENGTHS[1])) / rate
    checks = (at_most("uptake, (12) put at the end of the meshed part: change (%)", "not affected",
                      largest_difference(uptake(central), uptake(full)), 100 * TRANSPORT, TRANSPORT_WORDS),
              at_most("uptake, any value held at the end of 600 um: change (%)", "not affected", effects[0],
                      100 * FEW, FEW_WORDS),
              near("its decay with the pore's length, over u_ave / D_A", "if long enough", decay, 1.0, 0.05,
                   "(25): exp(-u x / D) upstream; 5 %, since the donor's part fades sooner"))
    changes = ", ".join(f"{effect:.2g} % at {length:g} um" for effect, length in zip(effects, LENGTHS))
    return Finding(checks, note="Largest change of the uptake if C at the pore's end is zero or the supply: "
                   f"{changes}. By (11) the entering flux is u_ave W C_supply, whatever C is downstream.")


def uptake(solved: Solved) -> np.ndarray:
    """(2,) acceptor and donor consumed, um2 mg/L/h."""
    return np.array([flux.consumed for flux in solved.fluxes])


def end_effect(*changes: str) -> float:
    """Largest change (%) of the uptake if C at the pore's end is zero, or the supply."""
    _, pore, solved = fully_meshed_pore(*changes)
    outlet = pore.space.outlet.nodes
    prescribed = [solve_with_prescribed(pore, solved, outlet, part) for part in (0.0, 1.0)]
    return max(largest_difference(uptake(changed), uptake(solved)) for changed in prescribed)


def solve_with_prescribed(pore: Pore, solved: Solved, nodes: np.ndarray, part: float) -> Solved:
    """Solve again with both concentrations prescribed as a part of their supply at some nodes, at the outlet instead of
    (12)."""
    problem, state = solved.problem, solved.concentrations
    rows = np.tile(np.isin(np.arange(problem.space.count), nodes), 2)
    problem = replace(problem, system=problem.system.with_constrained(rows))
    guess = 0.5 * np.concatenate([state.acceptor, state.donor])
    guess[rows] = part * problem.supply[rows]
    sink = Sink(pore.active)
    balance = transport.Balance(problem, sink)
    newton = Newton(transport.NEWTON, transport.MOST_ITERATIONS)
    last, _, converged = newton.solve(balance, balance.begun(guess))
    if not converged:
        raise TransportError(f"Newton's method has not converged: defect {last.defect:.2g}")
    state = Concentrations(*last.state.reshape(2, -1))
    return replace(solved, problem=problem, concentrations=state, fluxes=transport.fluxes(problem, sink, state))


def largest_difference(computed: np.ndarray, expected: np.ndarray) -> float:
    """Largest relative difference, %."""
    return 100 * float(np.abs(computed / expected - 1).max())


RADII, REACHES = (5.0, 10.0, 20.0, 30.0), (0.25, 0.5, 1.0, 1.5)


@claim("C19", "3.1", "meshing to min(5 R, 1 W) from the aggregate suffices", about=OF_SCHEME, sizes=BESIDE, steps=ALONE,
       fixed="the shapes are prescribed, and the claim has no steps", date="2026-11-22 18:19")
def truncation() -> Finding:
    """Conductivity, and effluents at one mean velocity, of half-discs of X_m meshed to parts of min(5 R, W), against
    the whole pore meshed, on nested meshes whose clean part resists alike."""
    scene = load_packaged(*BASE)
    errors = {radius: _errors(scene, radius) for radius in RADII}
    checks = tuple(at_most(f"largest error at min(5 R, W), R = {radius:g} um (%)", "suffices",
                           deviations[REACHES.index(1.0)].max(), 0.5, "0.5 %: as little as the time step is to matter")
                   for radius, deviations in errors.items())
    table = "; ".join(f"R = {radius:g} um: {_listed(deviations)}" for radius, deviations in errors.items())
    return Finding(checks, reason="the truncation has a larger effect",
                   note="Errors (%) of conductivity/acceptor effluent/donor effluent at parts of min(5 R, W): "
                   f"{table}. The error of the elements of the clean part is subtracted, because it is no effect of "
                   "the truncation.")


def _listed(errors: np.ndarray) -> str:
    """The three errors at each distance, in words."""
    return ", ".join("{:g}: {:.2g}/{:.2g}/{:.2g}".format(part, *row) for part, row in zip(REACHES, errors))


def _errors(scene, radius: float) -> np.ndarray:
    """(parts, 3) errors in percent at each distance."""
    meshes = nested(scene, radius, [part * min(5 * radius, scene.pore.width) for part in REACHES])
    velocity = flow_in(scene, meshes[-1]).mean_velocity
    scene = replace(scene, flow=replace(scene.flow, head=None, mean_velocity=velocity))
    values = np.array([_numbers(scene, grid) for grid in meshes])
    return 100 * np.abs(values[:-1] / values[-1] - 1)


def _numbers(scene, grid: Mesh) -> list[float]:
    """Conductivity, and both effluents. The resistance is the exact one of the clean pore, plus the difference that the
    biomass makes on this mesh."""
    flow, fluxes = solution(scene, grid, full_biomass(scene, grid))
    added = 1 / flow.conductivity - 1 / flow_in(scene, emptied(grid)).conductivity
    return [1 / (added + 1 / clean(scene)), *(flux.effluent for flux in fluxes)]


def emptied(grid: Mesh) -> Mesh:
    """The same mesh without biomass."""
    topology = replace(grid.topology, region=np.zeros(len(grid.cells), int), loops=())
    return replace(grid, topology=topology)


def nested(scene, radius: float, reaches: list[float]) -> list[Mesh]:
    """Meshes around a half-disc to ascending distances (um) from it, and to the pore's ends. Each is a part of the next
    one."""
    meshes = [half_disc(scene, radius, reaches[0])]
    for end in (*(radius + reach for reach in reaches[1:]), scene.pore.length / 2):
        meshes.append(lengthened(meshes[-1], end, sized(scene).largest))
    return meshes


def lengthened(mesh: Mesh, end: float, size: float) -> Mesh:
    """Extend a mesh to -end and end (um) by columns of triangles, each at most ``size`` (um) long."""
    for line, start in zip((mesh.topology.inlet, mesh.topology.outlet), mesh.ends):
        places = np.linspace(start, np.copysign(end, start), 1 + int(np.ceil((end - abs(start)) / size)))
        mesh = _with_columns(mesh, line, places[1:])
    return Mesh.of(mesh.points, mesh.cells, mesh.topology.region, mesh.topology.loops, mesh.walls, (-end, end))


def _with_columns(mesh: Mesh, line: np.ndarray, places: np.ndarray) -> Mesh:
    """Add columns of triangles from a line of nodes to each position x in turn. No triangle has an edge on an end and
    one on a wall: diagonals run from the outer node nearer to the middle of the pore."""
    y = mesh.points[line, 1]
    new = np.column_stack([np.repeat(places, len(line)), np.tile(y, len(places))])
    numbers = len(mesh.points) + np.arange(len(new)).reshape(len(places), len(line))
    cells = halved(np.vstack([line, numbers]), np.tile(y[:-1] + y[1:] < mesh.width, len(places)))
    if places[0] < mesh.points[line[0], 0]:
        cells = cells[:, ::-1]
    topology = replace(mesh.topology, cells=np.vstack([mesh.cells, cells]),
                       region=np.append(mesh.topology.region, np.zeros(len(cells), int)))
    return replace(mesh, points=np.vstack([mesh.points, new]), topology=topology)
