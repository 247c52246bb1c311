"""Concentrations chosen beforehand: the full nonlinear equations, flow that bends, D that jumps at a half-disc.

The forcing, and the flux through the mesh's sides, are added to the operators' sources; all else is the code's.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from reference import manufactured_transport
from repro.fem import elements
from repro.fem.sizing import ACROSS_PORE
from repro.fem.space import Space
from repro.model import flow, transport
from repro.model.kinetics import Sink
from verification.kernel.case import Outcome, Profile, case, refine, study
from verification.problems import meshes, norms
from verification.problems.channels import (
    NAMES,
    SCENE,
    WORDS,
    apart,
    averaged,
    both,
    carrying,
    in_points,
    pair,
    rates,
    sample,
)

WIDTH, RADIUS, ENDS, LARGEST = 50.0, 20.0, (-65.0, 65.0), 3e5
SUBSTRATES = replace(SCENE.substrates, donor=replace(SCENE.substrates.donor, half_saturation=3.0))
#: Refinements of each order, and how many unrelated meshes about each: the refinement is NEAR times the last one's, up
#: and down.
REFINEMENTS = {1: {0.4: 5, 0.8: 3, 1.6: 2, 3.2: 1}, 2: {0.4: 5, 0.8: 3, 1.6: 2, 2.4: 1},
               3: {0.4: 6, 0.8: 4, 1.4: 3, 2.2: 1}}
NEAR = 1.03
#: u_ave W / D_A, and the last errors of acceptor and donor, of each order.
PECLETS = {1: {0.1: (3e-4, 9e-4), 1.0: (1.2e-3, 2.5e-3), 10.0: (2.5e-3, 3.5e-3), 100.0: (4e-3, 5e-3)},
           2: {0.1: (1e-6, 1.5e-6), 1.0: (1e-6, 1.5e-6), 100.0: (8e-6, 1.7e-5)},
           3: {0.1: (8e-9, 1.1e-8), 10.0: (1.6e-7, 3e-7)}}
#: The last errors with u_ave for the inlet's u_x, at Pe = 10.
PRINTED = {1: (3e-4, 3e-4), 2: (1.5e-6, 3e-6), 3: (1.6e-7, 3e-7)}
ADVECTED = "quadratic elements: fourth order of advection, which is all that is seen at a large Peclet number"


def _expected(order: int, peclet: float) -> dict[str, object]:
    """Order in L2, why, and the half width of its band."""
    if order == 1:
        return {"order": 2, "origin": "linear elements, lumped reaction, chords for arcs: second order"}
    if order == 3:
        return {"order": 4, "band": 0.4, "origin": "cubic elements, parabolas for arcs: fourth order"}
    if peclet > 1:
        return {"order": 4, "origin": ADVECTED}
    if peclet == 1:
        return {"order": 3.3, "band": 0.45, "origin": "quadratic elements: between fourth order of advection and third"}
    return {"order": 3, "origin": "quadratic elements, parabolas for arcs: third order"}


@cache
def _spaced(refinement: float, number: int, order: int) -> Space:
    about = refinement * NEAR ** (number - REFINEMENTS[order][refinement] // 2)
    return meshes.half_disc_space(RADIUS, about, ENDS, WIDTH, order)


@cache
def _chosen(peclet: float):
    """The mean velocity (um/h), and the chosen fields by side."""
    spreads = (pair("diffusivity", SUBSTRATES), pair("diffusivity_in_aggregate", SUBSTRATES))
    mean = peclet * spreads[0][0] / WIDTH
    law = rates(SCENE.kinetics, SUBSTRATES)
    return mean, manufactured_transport.fields(WIDTH, RADIUS, mean, *spreads, LARGEST, law)


@cache
def _solved(refinement: float, number: int, order: int, peclet: float, inlet: str):
    """(space, C (2, n))."""
    space, (mean, sides) = _spaced(refinement, number, order), _chosen(peclet)
    made = transport.problem(space, _flow(space, mean), SUBSTRATES, SCENE.kinetics, inlet)
    added = [_added(space, mean, pair("supply", SUBSTRATES)[k], _of(sides, k), inlet) for k in (0, 1)]
    made = replace(made, source=made.source + np.concatenate(added))
    where = _reaction_points(space)
    active = _density()(where[..., 0], where[..., 1]) * space.reaction.dx
    return space, both(transport.steady(made, Sink(active)))


def _reaction_points(space: Space) -> np.ndarray:
    """(r, q, 2) um, where the reaction is taken."""
    if space.order == 1:
        return space.points[space.reaction.cells]
    nodes = space.mesh.points[space.mesh.cells[space.mesh.biomass]]
    return np.einsum("qg,tgi->tqi", space.table.shape, nodes)


@cache
def _density():
    """X as a function of x and y."""
    return manufactured_transport.function(manufactured_transport.density(RADIUS, LARGEST))


def _of(sides, k: int):
    """The field of one substrate by side."""
    return {side: found[k] for side, found in sides.items()}


@cache
def _velocity(mean: float):
    """u_x and u_y as functions of x and y."""
    return [manufactured_transport.function(part) for part in manufactured_transport.velocity(WIDTH, mean)]


def _flow(space: Space, mean: float) -> flow.Flow:
    return carrying(space, np.column_stack([part(*space.points.T) for part in _velocity(mean)]), mean)


def _added(space: Space, mean: float, supply: float, chosen, inlet: str) -> np.ndarray:
    """(n,) the forcing and what enters through the sides; chosen: the field by side."""
    where, weight, values = in_points(space)
    forcing = weight * _by_side(space.mesh.biomass, chosen, "forcing", where[..., 0], where[..., 1])
    found = np.bincount(space.cells.ravel(), (forcing @ values).ravel(), space.count)
    for nodes, owner, ends in _sides(space):
        found += _through(space, nodes, owner, ends, mean, supply, chosen, inlet)
    return found


def _by_side(biomass, chosen, name: str, x, y) -> np.ndarray:
    """A function of the chosen field on the side of each element (K,), at x and y (K, q)."""
    return np.where(biomass[:, None], *(getattr(chosen[side], name)(x, y) for side in ("biomass", "fluid")))


def _sides(space: Space):
    """The mesh's rim: nodes (E, e), triangles (E,) and ends (E, 2) um of the edges 01, 12 and 20 that have one
    triangle alone; nodes from the first end to the second."""
    topology, order = space.mesh.topology, space.order
    alone = np.bincount(topology.cell_edges.ravel(), minlength=len(topology.edges)) == 1
    parameters = np.linspace(0, 1, order + 1)
    for k in range(3):
        owner = np.flatnonzero(alone[topology.cell_edges[:, k]])
        corners = np.array([[0, 0], [1, 0], [0, 1]])[[k, (k + 1) % 3]]
        places = corners[0] + parameters[:, None] * (corners[1] - corners[0])
        local = [int(np.argmin(np.abs(elements.nodes(order) - place).sum(axis=1))) for place in places]
        ends = space.mesh.points[space.mesh.triangles[owner][:, [k, (k + 1) % 3]]]
        yield space.cells[owner][:, local], owner, ends


def _through(space: Space, nodes, owner, ends, mean: float, supply: float, chosen, inlet: str) -> np.ndarray:
    """(n,) of what enters through edges: D dC/dn; and at the inlet, where the code has it leave, u_x (C - C_s), or with
    the printed condition u_ave (C - C_s) [E4]."""
    points, weights = np.polynomial.legendre.leggauss(6)
    along = (points + 1) / 2
    start, along_edge = ends[:, 0], ends[:, 1] - ends[:, 0]
    x, y = np.moveaxis(start[:, None] + along[:, None] * along_edge[:, None], 2, 0)
    biomass, length = space.mesh.biomass[owner], np.hypot(*along_edge.T)[:, None]
    flux = _by_side(biomass, chosen, "flux", x, y)
    passed = flux[0] * along_edge[:, 1, None] - flux[1] * along_edge[:, 0, None]
    enters = _velocity(mean)[0](x, y) if inlet == "local" else mean
    over = enters * (_by_side(biomass, chosen, "value", x, y) - supply) * length
    passed = passed + np.where(np.isclose(x, ENDS[0]), over, 0.0)
    values = elements.values(space.order, np.column_stack([along, 0 * along]))[:, elements.ON_EDGE[space.order]]
    return np.bincount(nodes.ravel(), ((passed * weights / 2) @ values).ravel(), space.count)


@case("transport-manufactured", kind="manufactured", norm="L2 of each substrate over the mesh, relative",
      claim="Chosen concentrations around a half-disc come out of the full equations with second order, at Peclet "
            "numbers of the pore from 0.1 to 100 and of the elements from 0.002 to 18, with either inlet condition",
      mutants=("cross-flow-sign", "exchanged-half-saturation", "fluid-diffusivity", "ratio-on-the-donor-only",
               "quarter-of-a-triangle"), ways="1", because="orders 2, 3: transport-manufactured-higher")
def chosen_concentrations() -> Outcome:
    return Outcome(studies=_all_studies(1), profiles=tuple(_profile(peclet) for peclet in PECLETS[1]))


@case("transport-manufactured-higher", kind="manufactured", slow=True,
      norm="L2 of each substrate over the mesh, relative",
      claim="The same with quadratic and cubic elements on curved triangles, at Peclet numbers from 0.1 to 100, with "
            "either inlet condition: third order, of advection alone fourth; and fourth order",
      mutants=("printed-inlet-forgotten", "conserving-cross-flow", "exchanged-half-saturation", "fluid-diffusivity"),
      ways="2 3", because="order 1: transport-manufactured")
def chosen_of_higher_order() -> Outcome:
    return Outcome(studies=(*_all_studies(2), *_all_studies(3)))


def _all_studies(order: int) -> tuple:
    parts = []
    for peclet, ceilings in PECLETS[order].items():
        parts += _studies(order, peclet, "local", ceilings)
    return (*parts, *_studies(order, 10.0, "mean", PRINTED[order]))


def _studies(order: int, peclet: float, inlet: str, ceilings):
    samples, told = REFINEMENTS[order], WORDS[order] + (", printed inlet" if inlet == "mean" else "")
    errors = refine(lambda size: averaged(_errors, size, order, peclet, inlet, samples=samples), samples)
    cells = " to ".join(f"{peclet * size / WIDTH:.1g}" for size in errors["size"][[-1, 0]])
    return [study(f"{name}, pore's Pe = {peclet:g}, elements' {cells}, {told}", errors["size"], errors[name],
                  **_expected(order, peclet), ceiling=ceiling) for name, ceiling in zip(NAMES, ceilings)]


def _errors(refinement: float, number: int, order: int, peclet: float, inlet: str) -> dict[str, float]:
    """Size of the elements, nominal for linear ones; L2 of both substrates, on each element less the chosen field of
    its side."""
    (space, found), (_, sides) = _solved(refinement, number, order, peclet, inlet), _chosen(peclet)

    def truth(x, y):
        return [_by_side(space.mesh.biomass, _of(sides, k), "value", x, y) for k in (0, 1)]

    gap, size = apart(space, found, truth)
    length = WIDTH / ACROSS_PORE / refinement if order == 1 else norms.mean_size(space.mesh)
    return {"size": length, **dict(zip(NAMES, gap / size))}


def _profile(peclet: float) -> Profile:
    """Along the pore, a tenth of its width above the lower wall."""
    (space, found), (_, sides) = _solved(max(REFINEMENTS[1]), 0, 1, peclet, "local"), _chosen(peclet)
    x = np.linspace(ENDS[0], ENDS[1], 66)
    where, curves = np.column_stack([x, np.full(len(x), WIDTH / 10)]), []
    ours, inside = sample(space, found, where), np.hypot(*where.T) < RADIUS
    for k, name in enumerate(NAMES):
        chosen = _by_side(inside, _of(sides, k), "value", *where.T[:, :, None])[:, 0]
        curves += [(name, "ours", x, ours[k]), (f"{name}, chosen", "exact", x, chosen)]
    return Profile(f"Pe = {peclet:g}, y = {WIDTH / 10:g} um", "x (um)", "C (mg/L)", tuple(curves))
