"""Concentrations chosen beforehand: the full nonlinear equations, flow that bends, D that jumps at a half-disc.

The forcing, and the flux through the mesh's sides, are added to the operators' sources; all else is the code's.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from skfem import Basis, ElementTriP1, FacetBasis, LinearForm

from reference import manufactured_transport
from repro.fem import geometry, mesh
from repro.model import flow, transport
from verification import norms
from verification.case import Outcome, Profile, case
from verification.convergence import refine, study
from verification.transport.channels import SCENE, averaged, both, pair, rates

WIDTH, RADIUS, ENDS, LARGEST = 50.0, 20.0, (-65.0, 65.0), 3e5
NAMES = ("acceptor", "donor")
SUBSTRATES = replace(SCENE.substrates, donor=replace(SCENE.substrates.donor, half_saturation=3.0))
#: Refinements, and how many unrelated meshes about each: the refinement is NEAR times the last one's, up and down.
REFINEMENTS, NEAR = {0.4: 5, 0.8: 3, 1.6: 2, 3.2: 1}, 1.03
#: Longest elements (um).
SIZES = [WIDTH / geometry.ACROSS_PORE / refinement for refinement in REFINEMENTS]
#: u_ave W / D_A, and the last errors of acceptor and donor.
PECLETS = {0.1: (3e-4, 9e-4), 1.0: (1.2e-3, 2.5e-3), 10.0: (2.5e-3, 3.5e-3), 100.0: (4e-3, 5e-3)}


@LinearForm
def load(v, w):
    """(f, v), f given at the points of quadrature."""
    return w["f"] * v


@cache
def _meshed(refinement: float, sample: int) -> mesh.PoreMesh:
    about = refinement * NEAR ** (sample - REFINEMENTS[refinement] // 2)
    return mesh.generate(geometry.seed(RADIUS, about), ENDS, geometry.Sizing(WIDTH, about, 2.0))[0]


@cache
def _chosen(peclet: float):
    """The mean velocity (um/h), and the chosen fields by side."""
    spreads = (pair("diffusivity", SUBSTRATES), pair("diffusivity_in_aggregate", SUBSTRATES))
    mean = peclet * spreads[0][0] / WIDTH
    law = rates(SCENE.kinetics, SUBSTRATES)
    return mean, manufactured_transport.fields(WIDTH, RADIUS, mean, *spreads, LARGEST, law)


@cache
def _solved(refinement: float, sample: int, peclet: float):
    """(mesh, C (2, N))."""
    grid, (mean, sides) = _meshed(refinement, sample), _chosen(peclet)
    made = transport.problem(grid, _flow(grid, mean), SUBSTRATES, SCENE.kinetics)
    operators = [_forced(operator, grid, mean, _of(sides, k)) for k, operator in enumerate(made.both)]
    made = replace(made, acceptor=operators[0], donor=operators[1])
    return grid, both(transport.steady(made, _density()(*grid.points.T)))


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


def _flow(grid: mesh.PoreMesh, mean: float) -> flow.Flow:
    velocity = np.column_stack([part(*grid.points.T) for part in _velocity(mean)])
    return flow.Flow(mean, velocity, np.zeros(len(velocity)), np.zeros((len(grid.triangles), 2)), 0.0, 0.0, 1.0)


def _forced(operator: transport.Operator, grid: mesh.PoreMesh, mean: float, chosen) -> transport.Operator:
    """The operator with the forcing and the flux through the sides; chosen: the field by side."""
    inside, rim = (kind(grid.fem, ElementTriP1(), intorder=5) for kind in (Basis, FacetBasis))
    where = inside.global_coordinates().value
    forcing = load.assemble(inside, f=_by_side(grid.biomass, chosen, "forcing", where))
    passed = load.assemble(rim, f=_through(rim, grid, mean, operator.supply, chosen))
    return replace(operator, source=operator.source + forcing + passed)


def _by_side(biomass, chosen, name: str, where) -> np.ndarray:
    """A function of the chosen field on the side of each element (K,), at places (2, K, q)."""
    return np.where(biomass[:, None], *(getattr(chosen[side], name)(*where) for side in ("biomass", "fluid")))


def _through(rim: FacetBasis, grid: mesh.PoreMesh, mean: float, supply: float, chosen) -> np.ndarray:
    """What enters through the sides: D dC/dn, and u_x (C - C_s) at the inlet, where the code has it leave."""
    where, biomass = rim.global_coordinates().value, grid.biomass[grid.fem.f2t[0, rim.find]]
    flux = _by_side(biomass, chosen, "flux", where)
    over = _by_side(biomass, chosen, "value", where) - supply
    at_inlet = np.isclose(where[0], ENDS[0])
    return np.sum(flux * rim.normals, axis=0) + np.where(at_inlet, _velocity(mean)[0](*where) * over, 0.0)


@case("transport-manufactured", kind="manufactured", norm="L2 of each substrate over the mesh, relative",
      claim="Chosen concentrations around a half-disc come out of the full equations with second order, at Peclet "
            "numbers of the pore from 0.1 to 100 and of the elements from 0.002 to 18",
      mutants=("cross-flow-sign", "exchanged-half-saturation", "fluid-diffusivity", "ratio-on-the-donor-only",
               "quarter-of-a-triangle"))
def chosen_concentrations() -> Outcome:
    studies = [part for peclet, ceilings in PECLETS.items() for part in _studies(peclet, ceilings)]
    return Outcome(studies=tuple(studies), profiles=tuple(_profile(peclet) for peclet in PECLETS))


def _studies(peclet: float, ceilings):
    errors = refine(lambda refinement: averaged(_errors, refinement, peclet, samples=REFINEMENTS), REFINEMENTS)
    return [study(f"{name}, pore's Pe = {peclet:g}, elements' {_cells(peclet)}", SIZES, errors[name], 2,
                  "linear elements, lumped reaction, chords for arcs: second order", ceiling=ceiling)
            for name, ceiling in zip(NAMES, ceilings)]


def _cells(peclet: float) -> str:
    return " to ".join(f"{peclet * size / WIDTH:.1g}" for size in (SIZES[-1], SIZES[0]))


def _errors(refinement: float, sample: int, peclet: float) -> dict[str, float]:
    """L2 of both substrates, on each element less the chosen field of its side."""
    (grid, found), (_, sides) = _solved(refinement, sample, peclet), _chosen(peclet)
    where, weight, shape = norms.quadrature(grid.points, grid.triangles)
    errors = {}
    for k, name in enumerate(NAMES):
        truth = _by_side(grid.biomass, _of(sides, k), "value", np.moveaxis(where, 2, 0))
        apart = np.einsum("qa,ta->tq", shape, found[k][grid.triangles]) - truth
        errors[name] = float(np.sqrt(np.sum(weight * apart**2) / np.sum(weight * truth**2)))
    return errors


def _profile(peclet: float) -> Profile:
    """Along the pore, a tenth of its width above the lower wall."""
    (grid, found), (_, sides) = _solved(max(REFINEMENTS), 0, peclet), _chosen(peclet)
    x = np.linspace(ENDS[0], ENDS[1], 66)
    where, curves = np.column_stack([x, np.full(len(x), WIDTH / 10)]), []
    ours = norms.sample(grid.points, grid.triangles, found.T, where).T
    for k, name in enumerate(NAMES):
        chosen = _by_side(np.hypot(*where.T) < RADIUS, _of(sides, k), "value", where.T[:, :, None])[:, 0]
        curves += [(name, "ours", x, ours[k]), (f"{name}, chosen", "exact", x, chosen)]
    return Profile(f"Pe = {peclet:g}, y = {WIDTH / 10:g} um", "x (um)", "C (mg/L)", tuple(curves))
