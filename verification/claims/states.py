"""Aggregates of a given shape, and what is solved around them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from repro.fem import mesher
from repro.fem.mesh import Mesh
from repro.fem.outline import half_disc as seed
from repro.fem.sizing import ACROSS_AGGREGATE
from repro.fem.space import Space
from repro.model import biomass, flow, pore, transport
from repro.model.kinetics import Sink


@dataclass(frozen=True, eq=False)
class Solution:
    """Flow and substrates in one geometry, with the ledger and the end values of both substrates."""

    flow: flow.Flow
    problem: transport.Problem
    concentrations: transport.Concentrations
    fluxes: tuple[transport.Fluxes, transport.Fluxes]


def solution(scene, grid: Mesh, active: np.ndarray, carried_by_u: bool = False) -> Solution:
    """Flow under the scene's drive, then steady substrates over X_A (N,) mg/L.

    carried_by_u: advect with u itself, as the paper writes it, and not with the divergence-free w = u - tau grad p.
    """
    found = flow_in(scene, grid)
    carrier = replace(found, correction=0 * found.correction) if carried_by_u else found
    space = Space(grid, scene.numerics.order)
    problem = transport.problem(space, carrier, scene.substrates, scene.kinetics, scene.numerics.inlet)
    sink = Sink(biomass.at_points(space, active) * space.reaction.dx)
    state = transport.steady(problem, sink)
    return Solution(found, problem, state, transport.fluxes(problem, sink, state))


def flow_in(scene, grid: Mesh) -> flow.Flow:
    """Flow under the scene's drive."""
    return pore.solve_flow(scene, Space(grid, scene.numerics.order))


def full_biomass(scene, grid: Mesh) -> np.ndarray:
    """X_A (N,) = X_m on the aggregate."""
    active = np.zeros(len(grid.points))
    active[grid.body] = scene.kinetics.maximum_density
    return active


def half_disc(scene, radius: float, reach: float | None) -> Mesh:
    """The mesh around a half-disc, to the distance ``reach`` (um) on both sides; None: over the whole pore."""
    end = scene.pore.length / 2 if reach is None else min(radius + reach, scene.pore.length / 2)
    numerics = scene.numerics
    outline = seed(radius, ACROSS_AGGREGATE * numerics.refinement, numerics.geometry)
    return mesher.generate(outline, (-end, end), pore.sized(scene), numerics.geometry)[0]
